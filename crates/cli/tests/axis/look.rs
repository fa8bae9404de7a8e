//! `status`, `flags`, `clear`, and the help texts.

use crate::bench::{Bench, keys};
use serde_json::json;

#[test]
fn status_tells_all_about_an_smsd_in_the_unit_of_its_axis() {
    let bench = Bench::start();
    let text = bench.run("status -a stage");
    let expected = format!(
        "stage  smsd+tcp://{}?unit=1
  controller  SMSD-4.2LAN, hardware 1, firmware 1.3, register map 4.3
  mode        commands
  position    0mm (0 full steps), unknown: the axis has not been homed
  motion      stands, de-energised
  soft limits -10 to 200 mm, within them
  switches    none active
  faults      none
",
        bench.address(0)
    );
    assert_eq!(text.done(), expected);
}

#[test]
fn status_as_json_has_the_units_in_its_names() {
    let bench = Bench::start();
    let status = bench.json("status -a stage");
    let expected = [
        "axis",
        "controller",
        "doubt",
        "energised",
        "faults",
        "limit_negative",
        "limit_positive",
        "mode",
        "moving",
        "position_full_steps",
        "position_mm",
        "soft_limits_mm",
        "speed_mm_per_s",
        "target",
        "trust",
        "within_soft_limits",
    ];
    assert_eq!(keys(&status), expected);
    assert_eq!(
        (&status["axis"], &status["trust"], &status["moving"]),
        (&json!("stage"), &json!("unknown"), &json!(false))
    );
    assert_eq!((&status["soft_limits_mm"], &status["faults"]), (&json!([-10.0, 200.0]), &json!([])));
    let status = bench.json("status -a uhv");
    assert!(
        keys(&status).contains(&"position_turns") && keys(&status).contains(&"speed_turns_per_s"),
        "{status}"
    );
    assert_eq!(status["soft_limits_turns"], json!(null));
    let status = bench.json(&format!("status -a {}", bench.address(0)));
    assert!(
        keys(&status).contains(&"soft_limits_full_steps") && status["position_full_steps"] == 0.0,
        "{status}"
    );
}

#[test]
fn status_shows_an_smd3_whose_switch_and_fault_are_there() {
    let bench = Bench::start();
    bench.rig.rig("input uhv.LIMIT_POSITIVE 1").done();
    bench.run("stop -a uhv --hard").done();
    let text = bench.run("status -a uhv").done().to_owned();
    assert!(text.contains("  controller  SMD3, serial number "), "{text}");
    assert!(text.contains("\n  switches    the positive limit is active\n"), "{text}");
    assert!(text.ends_with("\n  faults      EMERGENCY STOP\n"), "{text}");
    let status = bench.json("status -a uhv");
    assert_eq!(status["faults"], json!([{ "name": "EMERGENCY STOP", "about": "`ESTOP` was sent." }]));
    assert_eq!((&status["limit_positive"], &status["energised"]), (&json!(true), &json!(false)));
}

#[test]
fn nothing_moves_or_changes_by_looking() {
    let bench = Bench::start();
    let before = (bench.rig.drive(0), bench.rig.drive(1));
    for words in ["status", "flags", "status --json", "flags --json"] {
        bench.run(&format!("{words} -a stage")).done();
        bench.run(&format!("{words} -a uhv")).done();
    }
    bench.run("get -a stage MAX_SPEED").done();
    bench.run("get -a uhv VMAX").done();
    let after = (bench.rig.drive(0), bench.rig.drive(1));
    let same = |key: &str| (&before.0[key], &before.1[key]) == (&after.0[key], &after.1[key]);
    assert!(["position", "carriage", "state", "speed"].into_iter().all(same), "{before:?} {after:?}");
}

#[test]
fn flags_are_told_with_what_they_say() {
    let bench = Bench::start();
    let text = bench.run("flags -a stage").done().to_owned();
    let hiz = "HiZ          status  yes  The motor's phases are de-energised.";
    assert!(text.starts_with("FLAG         KIND    SET  WHAT IT SAYS\n") && text.contains(hiz), "{text}");
    assert_eq!(text.lines().count(), 11);
    let text = bench.run("flags -a uhv").done().to_owned();
    assert!(
        text.contains("\nSTANDBY              status  yes  The motor stands,") && !text.contains("ASSUMED"),
        "{text}"
    );
    let flags = bench.json("flags -a uhv");
    assert_eq!(keys(&flags), ["axis", "flags"]);
    let flags = flags["flags"].as_array().expect("an array");
    assert_eq!((flags.len(), keys(&flags[0])), (15, vec!["about", "kind", "name", "set"]));
    let set: Vec<_> =
        flags.iter().filter(|flag| flag["set"] == true).map(|flag| flag["name"].clone()).collect();
    assert_eq!(set, ["STANDBY"]);
}

#[test]
fn a_fault_is_cleared_when_its_cause_is_gone_and_is_exit_code_8_while_it_is_not() {
    let bench = Bench::start();
    assert_eq!(bench.run("clear -a uhv").done(), "uhv: no fault was latched\n");
    bench.rig.rig("fault uhv.thermocouple open").done();
    let address = bench.address(1);
    let said = bench.run("move -a uhv by 1 turn").refused(8);
    let expected = "TOPEN (The selected temperature sensor is open); clear the fault first; nothing was sent";
    assert_eq!(said, format!("uhv at {address}: {expected}"));
    let said = bench.run("clear -a uhv").refused(8);
    assert!(
        said.starts_with("uhv is not clear: TOPEN (The selected temperature sensor is open); the cause is"),
        "{said}"
    );
    bench.rig.rig("fault uhv.thermocouple off").done();
    assert_eq!(bench.json("clear -a uhv"), json!({ "axis": "uhv", "cleared": ["TOPEN"] }));
    bench.run("move -a uhv by 1 turn").done();
}

#[test]
fn help_of_every_command_has_examples() {
    let bench = Bench::start();
    for command in
        ["status", "watch", "move", "run", "stop", "home", "zero", "get", "set", "flags", "clear", "bake"]
    {
        let ran = bench.run(&format!("{command} --help"));
        let help = ran.done();
        assert!(help.contains(&format!("\nExamples:\n  stepdrive {command}")), "{help}");
        assert!(help.contains(&format!("\n  $ stepdrive {command}")) && help.contains("--json"), "{help}");
    }
}
