//! `stepdrive regs`.

use crate::bench::{Bench, keys};
use serde_json::Value;

fn row<'a>(regs: &'a Value, name: &str) -> &'a Value {
    let rows = regs["rows"].as_array().expect("rows");
    rows.iter().find(|row| row["name"] == name).unwrap_or_else(|| panic!("no {name}"))
}

#[test]
fn the_whole_map_of_an_smsd_is_shown_decoded() {
    let bench = Bench::start();
    let ran = bench.run("regs -a stage");
    let lines: Vec<&str> = ran.done().lines().collect();
    for line in [
        "ADDRESS  NAME                         VALUE",
        "0x1400   CLR                          -",
        "0x1200   HiZ                          1",
        "0x1004   STATUS                       0x0013",
        "0x110C   MICROSTEPPING                0x0004",
        "0x110D   WORK_CURRENT                 10 × 0.1 A",
        "0x7007   IP",
        "0x2100   Password_LOW32               -",
        "0x3100   CMD                          0x00000000 in all 32",
    ] {
        assert!(lines.iter().any(|shown| shown.starts_with(line)), "{line}\n{}", lines.join("\n"));
    }
    let meaning = |name: &str| lines.iter().find(|line| line.contains(name)).map(|line| line.trim_end());
    assert!(meaning("STATUS ").is_some_and(|line| line.ends_with("HiZ, READY, forward, stopped")));
    assert!(meaning("HW_MAJOR").is_some_and(|line| line.ends_with("SMSD-4.2LAN")));
    assert!(meaning("MICROSTEPPING").is_some_and(|line| line.ends_with("1/16")));
}

#[test]
fn the_map_as_json_has_every_register_with_its_unit_and_default() {
    let bench = Bench::start();
    bench.run("set -a stage MAX_SPEED 800").done();
    let regs = bench.json("regs -a stage");
    assert_eq!((&regs["axis"], &regs["family"]), (&"stage".into(), &"smsd".into()));
    let speed = row(&regs, "MAX_SPEED");
    assert_eq!(
        keys(speed),
        ["about", "address", "default", "differs", "meaning", "name", "table", "unit", "value"]
    );
    assert_eq!((&speed["address"], &speed["table"]), (&"0x1101".into(), &"holding register".into()));
    assert_eq!(
        (&speed["value"], &speed["default"], &speed["differs"]),
        (&800.into(), &1000.into(), &true.into())
    );
    assert_eq!(row(&regs, "CLR")["value"], Value::Null);
    assert_eq!(row(&regs, "Password_LOW32")["value"], Value::Null);
    assert_eq!(row(&regs, "MAC")["value"].as_array().map(Vec::len), Some(6));
}

#[test]
fn only_what_was_changed_is_shown_when_that_is_asked_for() {
    let bench = Bench::start();
    assert_eq!(
        bench.run("regs -a uhv --changed").done(),
        "all settings of uhv are as they leave the factory\n"
    );
    bench.run("set -a uhv VMAX 500").done();
    bench.run("set -a uhv LP+ 1").done();
    let ran = bench.run("regs -a uhv --changed");
    let lines: Vec<Vec<&str>> = ran.done().lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(lines[1], ["LP+", "1", "0", "active", "low"]);
    assert_eq!(lines[2], ["VMAX", "500", "Hz", "1000", "Target", "speed"]);
}

#[test]
fn all_commands_of_an_smd3_are_shown_with_what_they_read() {
    let bench = Bench::start();
    let regs = bench.json("regs -a uhv");
    assert_eq!(regs["family"], "smd3");
    let count = regs["rows"].as_array().map(Vec::len);
    assert_eq!(count, Some(stepdrive_spec::smd3::commands::COMMANDS.len()));
    assert_eq!((&row(&regs, "MODE")["value"], &row(&regs, "MODE")["meaning"]), (&2.into(), &"Remote".into()));
    assert_eq!(row(&regs, "FLAGS")["meaning"], "STANDBY");
    assert_eq!(row(&regs, "RUNA")["value"], Value::Null);
    assert_eq!(row(&regs, "AMAX")["unit"], "Hz/s");
    let ran = bench.run("regs -a uhv");
    assert!(ran.done().contains("\nRUNV ") && !ran.stdout().contains("ADDRESS"), "{}", ran.stdout());
}

#[test]
fn a_controller_that_is_not_there_is_trouble_on_the_line() {
    let bench = Bench::start();
    let told = bench.run("regs -a 127.0.0.1:1 --connect-timeout 200ms").refused(5);
    assert!(told.starts_with("cannot connect to 127.0.0.1:1"), "{told}");
    let told = bench.run("regs -a stge").refused(3);
    assert!(told.contains("there is no axis `stge`"), "{told}");
}
