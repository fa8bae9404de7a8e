//! `get` and `set`.

use crate::bench::Bench;
use serde_json::json;

#[test]
fn values_are_read_by_the_makers_names_in_any_case_with_their_units() {
    let bench = Bench::start();
    let text = bench.run("get -a stage max_speed MICROSTEPPING 'IP 0' 0x1101 WORK_CURRENT").done().to_owned();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines,
        [
            "MAX_SPEED = 1000 full steps/s",
            "MICROSTEPPING = 0x0004 (1/16)",
            "IP 0 = 192",
            "MAX_SPEED = 1000 full steps/s",
            "WORK_CURRENT = 10 × 0.1 A (1.0 A)",
        ]
    );
    let text = bench.run("get -a uhv VMAX tmot MODE L+").done().to_owned();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines[0], lines[2], lines[3]), ("VMAX = 1000 Hz", "MODE = 2 (Remote)", "L+ = 1 (on)"));
    assert!(lines[1].starts_with("TMOT = 20") && lines[1].ends_with(" °C"), "{text}");
}

#[test]
fn values_as_json_have_name_value_unit_and_meaning() {
    let bench = Bench::start();
    let values = bench.json("get -a stage MAX_SPEED MICROSTEPPING");
    let expected = json!({ "axis": "stage", "values": [
        { "name": "MAX_SPEED", "value": 1000, "unit": "full steps/s", "meaning": null },
        { "name": "MICROSTEPPING", "value": 4, "unit": null, "meaning": "1/16" },
    ] });
    assert_eq!(values, expected);
    let set = bench.json("set -a uhv VMAX 500");
    assert_eq!((&set["axis"], &set["name"], &set["unit"]), (&json!("uhv"), &json!("VMAX"), &json!("Hz")));
    assert!((set["value"].as_f64().expect("a number") - 500.0).abs() < 0.5, "{set}");
}

#[test]
fn what_is_set_is_read_back() {
    let bench = Bench::start();
    assert_eq!(bench.run("set -a stage MAX_SPEED 800").done(), "MAX_SPEED = 800 full steps/s\n");
    assert_eq!(bench.run("set -a stage TARGET_POS -200").done(), "TARGET_POS = -200 microsteps\n");
    assert!(bench.run("set -a stage Mask 0xFF").done().contains("(all)"));
    assert_eq!(bench.run("get -a stage MAX_SPEED TARGET_POS").done().lines().count(), 2);
    assert_eq!(bench.run("set -a uhv L- 1").done(), "L- = 1 (on)\n");
    bench.run("set -a uhv AMAX 500").done();
    assert_eq!(
        bench.rig.client(0).read(stepdrive_spec::smsd::registers::Reg::MaxSpeed, 1).expect("read"),
        Ok(vec![800])
    );
}

#[test]
fn unknown_names_are_exit_code_1_with_a_suggestion() {
    let bench = Bench::start();
    for (words, told) in [
        ("get -a stage MAX_SPED", "there is no register `MAX_SPED`; did you mean MAX_SPEED?"),
        ("get -a stage MAX_SPEED 0x0000", "there is no register at 0x0000"),
        ("set -a stage max_sped 5", "there is no register `max_sped`; did you mean MAX_SPEED?"),
        ("get -a uhv VMX", "there is no command `VMX`; did you mean VMAX?"),
        ("set -a uhv VMX 5", "there is no command `VMX`; did you mean VMAX?"),
    ] {
        assert_eq!(bench.run(words).refused(1), told, "{words}");
    }
}

#[test]
fn values_that_are_not_taken_are_exit_code_1_and_nothing_is_sent() {
    let bench = Bench::start();
    for (words, told) in [
        (
            "set -a stage MAX_SPEED 99999",
            "MAX_SPEED 99999 is out of range: 16 to 15600 full steps/s; nothing was sent",
        ),
        ("set -a stage MAX_SPEED fast", "MAX_SPEED takes a whole number, not `fast`; nothing was sent"),
        ("set -a stage MAX_SPEED 0xGG", "MAX_SPEED takes a whole number, not `0xGG`; nothing was sent"),
        ("set -a stage MAX_SPEED 1.5", "MAX_SPEED takes a whole number, not `1.5`; nothing was sent"),
        ("set -a stage ABS_POS 0", "ABS_POS can only be read; nothing was sent"),
        (
            "set -a stage WORK_CURRENT 43",
            "WORK_CURRENT 43 is out of range: 1 to 42 × 0.1 A on the SMSD-4.2LAN; nothing was sent",
        ),
        ("set -a uhv VMAX 20000", "VMAX 20000 is out of range: 0 to 15000 Hz; nothing was sent"),
        ("set -a uhv VMAX nan", "VMAX takes a number, not `nan`; nothing was sent"),
        ("set -a uhv TMOT 5", "TMOT can only be read; nothing was sent"),
        ("set -a uhv L 2", "L takes 0 or 1, not 2; nothing was sent"),
        ("get -a stage CLR", "CLR is done, and tells nothing when it is read"),
        ("get -a stage Password_LOW32", "Password_LOW32 is secret and reads as 0"),
        ("get -a uhv STOP", "STOP is done, not read; nothing was sent"),
    ] {
        assert_eq!(bench.run(words).refused(1), told, "{words}");
    }
}

#[test]
fn what_moves_the_motor_is_no_setting() {
    let bench = Bench::start();
    for words in [
        "stage CMD 0x0E",
        "stage 'Soft STOP' 1",
        "stage 'Reset Pos' 1",
        "stage CLR 1",
        "stage Password_CMD 1",
        "stage MEM_CMD 1",
    ] {
        let said = bench.run(&format!("set -a {words}")).refused(1);
        assert!(
            said.contains("is no setting, but does something") && said.ends_with("nothing was sent"),
            "{said}"
        );
    }
    for words in ["uhv RUNV +", "uhv RUNA 100", "uhv STORE 1", "uhv ESTOP 1", "uhv RUNB 1"] {
        let said = bench.run(&format!("set -a {words}")).refused(1);
        assert!(
            said.contains("is no setting, but does something") && said.ends_with("nothing was sent"),
            "{said}"
        );
    }
    assert_eq!(
        (bench.rig.drive(0)["position"].clone(), bench.rig.drive(1)["position"].clone()),
        (json!(0.0), json!(0.0))
    );
}

#[test]
fn a_setting_that_wants_another_state_is_exit_code_7() {
    let bench = Bench::start();
    bench.energise();
    let said = bench.run("set -a stage MICROSTEPPING 5").refused(7);
    assert!(said.contains("the motor is energised; de-energise it first"), "{said}");
    bench.run("run -a uhv -").done();
    let said = bench.run("set -a uhv MODE 0").refused(7);
    assert!(said.contains("Stop motor first"), "{said}");
}
