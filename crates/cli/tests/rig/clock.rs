//! `rig clock`.

use crate::bench::Bench;
use stepdrive_spec::smsd::registers::Reg;

#[test]
fn the_clock_is_shown() {
    let bench = Bench::start();
    assert_eq!(bench.rig("clock").done(), "clock paused, rig time 0s\n");
    assert_eq!((&bench.json("clock")["mode"], &bench.json("clock")["now_ns"]), (&"paused".into(), &0.into()));
}

#[test]
fn the_clock_is_set_and_time_goes_on_from_where_it_was() {
    let bench = Bench::start();
    bench.rig("clock step 5s").done();
    assert!(bench.rig("clock x1000").done().starts_with("clock x1000, rig time 5"));
    assert!(bench.rig("clock real").done().starts_with("clock real, rig time "));
    let paused = bench.json("clock pause");
    assert_eq!(paused["mode"], "paused");
    let now = paused["now_ns"].as_u64().expect("a time");
    assert!(now > 5_000_000_000, "time has passed: {now}");
    assert_eq!(bench.json("clock")["now_ns"], now, "and stands still now");
    assert_eq!(bench.json("clock paused")["now_ns"], now);
}

#[test]
fn a_step_is_exact() {
    let bench = Bench::start();
    assert_eq!(bench.rig("clock step 1.5s").done(), "clock paused, rig time 1.5s\n");
    assert_eq!(bench.rig("clock step 1 ns").done(), "clock paused, rig time 1.500000001s\n");
    assert_eq!(bench.json("clock step 1h")["now_ns"], 3_601_500_000_001_u64);
}

#[test]
fn it_runs_until_a_condition_holds() {
    let bench = Bench::start();
    // RUN_F at 100 full steps a second: 1600 microsteps of 1/16 take a second, and the ramp.
    bench.client(0).write(Reg::TargetSpeed, &[100, 0, 0, 0, 0x0E]).expect("answered").expect("runs");
    let ran = bench.rig("clock run-until 'a.ABS_POS>=1600'");
    assert!(ran.done().starts_with("a.ABS_POS>=1600 at rig time 1."), "{}", ran.stdout());
    assert_eq!(bench.drive(0)["position"], 1600.0);
    // Quotes are only needed for what the shell takes for its own.
    let reached = bench.json("clock run-until a.ABS_POS >= 3200 --within 10min");
    assert_eq!(reached["reached"], true);
    assert_eq!(bench.drive(0)["position"], 3200.0);
}

#[test]
fn it_runs_until_nothing_will_happen_by_itself() {
    let bench = Bench::start();
    let mut client = bench.client(0);
    client.write(Reg::TargetSpeed, &[100, 0, 0, 0, 0x0E]).expect("answered").expect("runs");
    bench.rig("clock step 2s").done();
    client.set(Reg::SoftStop, true).expect("answered").expect("stops");
    assert!(bench.rig("clock run-until idle").done().starts_with("idle at rig time 2."));
    assert_eq!(bench.drive(0)["speed"], 0.0);
}

#[test]
fn a_condition_that_does_not_come_by_the_deadline_is_exit_code_2() {
    let bench = Bench::start();
    let ran = bench.rig("clock run-until 'a.ABS_POS>=1' --within 10min");
    let said = ran.refused(2);
    assert!(said.starts_with("`a.ABS_POS>=1` has not come within 10min; rig time is 10min"), "{said}");
    let ran = bench.rig("clock run-until 'a.ABS_POS>=1' --within 1s --json");
    assert_eq!(ran.code(), 2);
    let json: serde_json::Value = serde_json::from_str(ran.stdout()).expect("JSON");
    assert_eq!((&json["reached"], &json["now_ns"]), (&false.into(), &601_000_000_000_u64.into()));
}

#[test]
fn what_is_no_way_to_set_the_clock_is_told_with_exit_code_1() {
    let bench = Bench::start();
    for (words, part) in [
        ("clock soon", "clock `soon` is unknown; it is real, paused, or x and a factor"),
        ("clock x0", "0.01 to 1000000"),
        ("clock step", "step DURATION"),
        ("clock step 5", "the unit is missing"),
        ("clock run-until", "run-until idle"),
        ("clock run-until idel", "expected a quantity of a drive"),
        ("clock run-until c.READY", "unknown drive `c`"),
        ("clock run-until idle --within 5", "the unit is missing"),
        ("clock real --within 5s", "--within goes with run-until"),
    ] {
        let said = bench.rig(words).refused(1);
        assert!(said.contains(part), "{words}: {said}");
    }
    assert_eq!(bench.json("clock")["now_ns"], 0, "nothing has moved");
}
