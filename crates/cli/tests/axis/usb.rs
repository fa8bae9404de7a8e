//! Every command of an SMSD over its USB port, and over TCP with the standard firmware.

use crate::bench::Bench;
use crate::rig::{self, Ran, until};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead as _, Write as _};
use std::process::Stdio;

/// Waits for 40 s of rig time.
const SLOW: &str = "SET_WAIT 40s\nEND\n";

fn term(bench: &Bench, lines: &str) -> Ran {
    let mut child = bench.command("term -a stage").stdin(Stdio::piped()).spawn().expect("started");
    // It may have ended already.
    let _ = child.stdin.take().expect("piped").write_all(lines.as_bytes());
    Ran(child.wait_with_output().expect("ended"))
}

/// What a command printed that did what it was asked to, and said something besides.
#[track_caller]
fn printed(ran: &Ran) -> &str {
    assert_eq!(ran.code(), 0, "{}", ran.stderr());
    ran.stdout()
}

/// The target of a way to reach `stage` that the ready line names.
fn place(bench: &Bench, way: &str) -> String {
    bench.ready(0)[way].as_str().expect("it is there").to_owned()
}

#[test]
fn status_shows_the_protocol_and_does_not_claim_what_is_not_told() {
    let bench = Bench::over_usb();
    let port = place(&bench, "usb");
    let text = bench.run("status -a stage").done().to_owned();
    assert_eq!(
        text,
        format!(
            "stage  smsd+usb://{port}\n\
             \x20 controller  SMSD-4.2LAN, hardware 1, firmware 1.3, protocol 2\n\
             \x20 mode        commands, or the user program at mem0:0; the standard protocol does not tell which\n\
             \x20 position    0mm (0 full steps), unknown: the axis has not been homed\n\
             \x20 motion      stands, de-energised\n\
             \x20 soft limits -10 to 200 mm, within them\n\
             \x20 switches    none active\n\
             \x20 faults      none\n"
        )
    );
    let over_tcp = bench.json(&format!("status -a smsd+usb+tcp://{}", place(&bench, "usb_tcp")));
    assert_eq!(over_tcp["controller"], "SMSD-4.2LAN, hardware 1, firmware 1.3, protocol 2");
}

#[test]
fn it_homes_moves_runs_and_stops() {
    let bench = Bench::over_usb();
    bench.energise();
    bench.run("move -a stage to 5mm").refused(7);
    assert_eq!(
        bench.run("home -a stage - --speed 5mm/s").done(),
        "stage is at 0mm (0 full steps), trusted\n"
    );
    assert_eq!(bench.run("move -a stage to 12.5mm").done(), "stage is at 12.5mm (500 full steps), trusted\n");
    assert_eq!(
        bench.run("move -a stage by '-1 turn' --speed 10mm/s").done(),
        "stage is at 7.5mm (300 full steps), trusted\n"
    );
    assert_eq!(bench.run("get -a stage MAX_SPEED").done(), "MAX_SPEED = 400 full steps/s\n");
    assert_eq!(
        bench.run("run -a stage + 20mm/s").done(),
        "stage runs in direction +, to the soft limit 200mm\n"
    );
    assert_eq!(bench.json("stop -a stage")["moving"], false);
    assert_eq!(bench.json("status -a stage")["trust"], "trusted");
    assert_eq!(bench.json("stop -a stage --free")["trust"], "unknown");
}

#[test]
fn a_dry_run_shows_packets_and_what_its_time_supposes() {
    let bench = Bench::over_usb();
    bench.energise();
    bench.run("zero -a stage").done();
    let text = bench.run("move -a stage to 12.5mm --speed 10mm/s --dry-run").done().to_owned();
    assert_eq!(
        text,
        "stage would go from 0mm to 12.5mm: 12.5mm (500 full steps), about 1.65 s\n\
         ACC 1000, DEC 1000 are supposed: this line does not tell them\n\
         the position is trusted\n\
         this would be sent:\n\
         \x20 02 60 40 06 00  SET_MAX_SPEED 400\n\
         \x20 02 20 01 7D 00  GO_TO_F 8000\n"
    );
    let told = bench.json("move -a stage to 12.5mm --dry-run");
    assert_eq!(told["supposed"], "ACC 1000, DEC 1000 are supposed: this line does not tell them");
    assert_eq!(bench.json("status -a stage")["position_full_steps"], 0.0);
}

#[test]
fn settings_are_read_back_where_they_can_be() {
    let bench = Bench::over_usb();
    assert_eq!(bench.run("set -a stage MAX_SPEED 800").done(), "MAX_SPEED = 800 full steps/s\n");
    assert_eq!(bench.run("set -a stage MICROSTEPPING 3").done(), "MICROSTEPPING = 0x0003 (1/8)\n");
    assert_eq!(
        bench.run("set -a stage ACC 500").done(),
        "ACC = 500 full steps/s² (taken; this line does not read it back)\n"
    );
    let modbus = place(&bench, "modbus_tcp");
    assert_eq!(bench.run(&format!("get -a {modbus} ACC")).done(), "ACC = 500 full steps/s²\n");
    let said = bench.run("get -a stage MAX_SPEED ACC").refused(1);
    assert!(said.starts_with("ACC cannot be read") && said.contains("no instruction for it"), "{said}");
    bench.energise();
    let said = bench.run("set -a stage MICROSTEPPING 4").refused(7);
    assert!(said.contains("the motor is energised; de-energise it first"), "{said}");
}

#[test]
fn regs_and_flags_show_all_that_can_be_read() {
    let bench = Bench::over_usb();
    let rows = bench.json("regs -a stage")["rows"].as_array().expect("rows").clone();
    let row = |name: &str| rows.iter().find(|row| row["name"] == name).expect("a row").clone();
    assert_eq!(
        (row("MAX_SPEED")["value"].clone(), row("HW_MAJOR")["value"].clone()),
        (json!(1000), json!(6))
    );
    assert_eq!(row("FS_SPEED")["value"], Value::Null);
    assert!(row("FS_SPEED")["error"].as_str().expect("why").starts_with("FS_SPEED cannot be read"));
    assert_eq!(row("CLR")["error"], Value::Null);
    let flags = bench.json("flags -a stage")["flags"].as_array().expect("flags").clone();
    let set: Vec<&str> =
        flags.iter().filter(|flag| flag["set"] == true).filter_map(|flag| flag["name"].as_str()).collect();
    assert_eq!(set, ["HiZ", "STOP", "READY", "DIR"]);
}

#[test]
fn a_profile_is_saved_compared_and_applied_as_far_as_that_can_be_seen() {
    let bench = Bench::over_usb();
    let ran = bench.run("settings save -a stage");
    assert_eq!(ran.stdout(), "8 settings of stage to stage.profile.toml\n");
    assert_eq!(ran.stderr(), "stage does not tell all over this line; left out: ACC, DEC, FS_SPEED\n");
    let file = bench.place().path("stage.profile.toml");
    let text = fs::read_to_string(&file).expect("written");
    let text = text.replace("MAX_SPEED = 1000", "MAX_SPEED = 900\nACC = 2000");
    fs::write(&file, text).expect("written");
    let ran = bench.run("settings diff -a stage");
    assert_eq!(ran.code(), 10, "{}", ran.stderr());
    assert!(ran.stdout().contains("MAX_SPEED  900 full steps/s  1000 full steps/s"), "{}", ran.stdout());
    assert!(ran.stderr().contains("not compared: ACC\n"), "{}", ran.stderr());
    assert_eq!(
        printed(&bench.run("settings apply -a stage")),
        "SETTING    NOW                THEN                SENT\n\
         MAX_SPEED  1000 full steps/s  900 full steps/s    02 60 10 0E 00  SET_MAX_SPEED 900\n\
         ACC        not told           2000 full steps/s²  02 70 40 1F 00  SET_ACC 2000\n\
         set, and 8 settings of the file read back as they should; not told over this line: ACC\n"
    );
    let modbus = place(&bench, "modbus_tcp");
    assert_eq!(bench.run(&format!("get -a {modbus} ACC MAX_SPEED")).done().lines().count(), 2);
    assert!(bench.run(&format!("get -a {modbus} ACC")).done().starts_with("ACC = 2000"));
}

#[test]
fn lan_parameters_take_effect_at_once() {
    let bench = Bench::over_usb();
    printed(&bench.run("settings save -a stage --lan"));
    let file = bench.place().path("stage.profile.toml");
    let text = fs::read_to_string(&file).expect("written");
    fs::write(&file, text.replace("id = 1\n", "id = 9\n")).expect("written");
    let ran = bench.run("settings apply -a stage --lan");
    assert!(printed(&ran).contains("lan.id"), "{}", ran.stdout());
    assert!(ran.stderr().contains("the LAN parameters are in effect"), "{}", ran.stderr());
    assert_eq!(bench.run("get -a stage ID").done(), "ID = 9\n");
    let modbus = place(&bench, "modbus_tcp");
    until(|| bench.run(&format!("status -a {modbus}?unit=9")).code() == 0);
}

#[test]
fn the_terminal_reads_writes_and_commands() {
    let bench = Bench::over_usb();
    let ran = term(&bench, "MAX_SPEED=700\nACC=900\nRelay=on\nRelay\nRUN_F 200\nMOVE_F 5\nHard STOP\nACC\n");
    assert_eq!(ran.code(), 7, "{}", ran.stderr());
    for part in [
        "MAX_SPEED = 700 full steps/s\nACC was written\nRelay = 1  (on)\nRelay = 1  (on)\nRUN_F: the motor turns forward",
        "MOVE_F was refused by stage",
        "CMD_ERROR is set; clear it (CLR) before the next command\nHard STOP: the motor stands, energised",
        "\nACC cannot be read",
    ] {
        assert!(ran.stdout().contains(part), "{part}\n{}", ran.stdout());
    }
    assert_eq!(bench.run("clear -a stage").done(), "stage: CMD_ERROR is cleared\n");
}

#[test]
fn it_is_recorded_and_watched() {
    let bench = Bench::over_usb();
    let words = "record -a stage position MAX_SPEED Inputs --rate 10Hz --for 500ms -o r.csv";
    assert!(bench.run(words).stderr().starts_with("r.csv: 5 rows"));
    let text = fs::read_to_string(bench.place().path("r.csv")).expect("written");
    let heading = "time [s],utc,stage.position [mm],stage.MAX_SPEED [full steps/s],stage.Inputs";
    assert_eq!(text.lines().next(), Some(heading));
    assert!(text.lines().skip(1).all(|line| line.ends_with(",0,1000,0")), "{text}");
    let said = bench.run("record -a stage ACC --for 100ms -o n.csv").refused(1);
    assert!(said.starts_with("stage: ACC cannot be read"), "{said}");
    let mut watch = bench.start_command("watch stage --json");
    let line = watch.lines().next().expect("a line");
    let seen: Value = serde_json::from_str(&line).expect("JSON");
    assert_eq!((&seen["axis"], &seen["moving"]), (&json!("stage"), &json!(false)));
}

#[test]
fn a_program_is_stored_fetched_started_and_followed_to_its_end() {
    let bench = Bench::over_usb();
    assert_eq!(bench.run("program follow -a stage").stderr(), "stage: no program runs\n");
    bench.write("p.smsd", "MOVE_F 1600\nSET_WAIT 20s\nSET_RELE\nEND\n");
    assert_eq!(
        bench.run("program store p.smsd --mem 1 -a stage").done(),
        "stage: 4 instructions stored in memory 1 and read back\n"
    );
    assert_eq!(
        bench.run("program fetch --mem 1 -a stage").done(),
        ".mem 1\n    MOVE_F 1600\n    SET_WAIT 20s\n    SET_RELE\n    END\n"
    );
    let ran = bench.run("program start 1 --follow -a stage");
    assert!(ran.stderr().contains("this line does not tell whether a program runs"), "{}", ran.stderr());
    assert!(printed(&ran).contains("mem1:1        1600      0  SET_WAIT 20s\n"), "{}", ran.stdout());
    assert!(ran.stdout().contains("ended at mem1:3; the motor stands, energised"), "{}", ran.stdout());
    assert_eq!(bench.run("program follow -a stage").stderr(), "stage: no program runs\n");
}

#[test]
fn a_program_that_is_refused_something_is_seen_to_end() {
    let bench = Bench::over_usb();
    bench.write("p.smsd", "RUN_F 100\nMOVE_F 10\nEND\n");
    bench.run("program store p.smsd --mem 0 -a stage");
    let ran = bench.run("program start 0 --follow -a stage");
    assert_eq!(ran.code(), 8, "{}", ran.stdout());
    assert!(ran.stderr().contains("the program ended at mem0:1"), "{}", ran.stderr());
}

#[test]
fn stopping_a_program_says_no_more_than_is_told() {
    let bench = Bench::over_usb();
    bench.write("p.smsd", SLOW);
    bench.run("program store p.smsd --mem 0 -a stage").done();
    bench.run("program start 0 -a stage").done();
    let modbus = place(&bench, "modbus_tcp");
    let runs = || bench.run(&format!("get -a {modbus} PROGRAM_RUN")).done().starts_with("PROGRAM_RUN = 1");
    assert!(runs());
    assert_eq!(bench.run("program stop -a stage").done(), "stage: the program was stopped, if one ran\n");
    assert!(!runs());
    assert_eq!(bench.json("program stop -a stage")["ran"], Value::Null);
}

#[test]
fn trust_is_kept_from_one_command_to_the_next() {
    let bench = Bench::over_usb();
    bench.energise();
    bench.run("zero -a stage").done();
    assert_eq!(bench.json("status -a stage")["trust"], "trusted");
    let modbus = place(&bench, "modbus_tcp");
    bench.run(&format!("move -a {modbus} by '10 steps'")).done();
    let seen = bench.json("status -a stage");
    assert_eq!((&seen["trust"], &seen["position_full_steps"]), (&json!("suspect"), &json!(10.0)));
    bench.rig.rig("power stage off").done();
    bench.rig.rig("power stage on").done();
    assert_eq!(bench.json("status -a stage")["trust"], "unknown");
}

#[test]
fn a_wrong_password_is_exit_code_6_and_a_port_that_is_not_there_5() {
    let bench = Bench::over_usb();
    bench.write("password", "0x1111");
    let said = bench.run("status -a stage --password-file password").refused(6);
    assert!(said.contains("does not accept the password"), "{said}");
    let said = bench.run("status -a smsd+usb:///dev/no-such-port").refused(5);
    assert!(said.starts_with("cannot connect to /dev/no-such-port"), "{said}");
}

#[test]
fn the_standard_firmware_is_driven_over_tcp() {
    let rig = "[rig]\nclock = \"x100\"\napi = \"127.0.0.1:0\"\n[[drive]]\nname = \"big\"\nmodel = \"SMSD-8.0LAN\"\n\
               lan = \"standard\"\nstandard_tcp = \"127.0.0.1:0\"\n";
    let bench = Bench { rig: rig::Bench::with(rig) };
    let at = format!("smsd+std://{}", place(&bench, "standard_tcp"));
    assert!(
        bench.json(&format!("status -a {at}"))["controller"]
            .as_str()
            .expect("text")
            .starts_with("SMSD-8.0LAN")
    );
    bench.run(&format!("stop -a {at}")).done();
    bench.run(&format!("zero -a {at}")).done();
    assert_eq!(
        bench.run(&format!("move -a {at} to '100 steps'")).done(),
        format!("{at} is at 100 steps, trusted\n")
    );
    let said = bench.run(&format!("get -a {at} ID")).refused(1);
    assert!(said.contains("has no ID: it has the standard firmware"), "{said}");
    printed(&bench.run(&format!("settings save big.toml --lan -a {at}")));
    let text = fs::read_to_string(bench.place().path("big.toml")).expect("written");
    assert!(text.contains("\n[lan]\nip = "), "{text}");
    assert_eq!(bench.run(&format!("settings diff big.toml -a {at}")).code(), 0);
    let rows = bench.json(&format!("regs -a {at}"))["rows"].as_array().expect("rows").clone();
    let port = rows.iter().find(|row| row["name"] == "Port").expect("a row");
    assert_eq!(port["default"], 5000);

    let with_id = text.replace("[lan]\n", "[lan]\nid = 3\n").replace("ACC = 1000", "ACC = 1001");
    assert_ne!(with_id, text);
    bench.write("other.toml", &with_id);
    let said = bench.run(&format!("settings apply other.toml --lan -a {at}")).refused(1);
    assert!(
        said.contains("has the standard firmware, which has none; take it out; nothing was sent"),
        "{said}"
    );
}

#[test]
fn what_goes_out_with_a_command_is_no_setting() {
    let bench = Bench::over_usb();
    for name in ["TARGET_SPEED", "TARGET_POS", "TARGET_INPUT"] {
        let said = bench.run(&format!("set -a stage {name} 1")).refused(1);
        assert!(said.starts_with(&format!("{name} is no setting on this line")), "{said}");
    }
}

#[test]
fn a_port_that_another_program_has_open_is_told_as_such() {
    let bench = Bench::over_usb();
    let mut term =
        bench.command("term -a stage").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("started");
    let mut said = std::io::BufReader::new(term.stdout.take().expect("piped"));
    term.stdin.as_mut().expect("piped").write_all(b"status\n").expect("it listens");
    said.read_line(&mut String::new()).expect("it has answered, so it holds the port");
    let refused = bench.run("get -a stage ABS_POS").refused(5);
    assert!(refused.contains("another program has it open"), "{refused}");
    drop(term.stdin.take());
    term.wait().expect("ended");
    bench.run("get -a stage ABS_POS").done();
}
