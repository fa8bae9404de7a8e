//! `STOP`, `SSTOP`, `ESTOP`.

use crate::bench::{Bench, MS, SECOND, STEP, assert_near, assert_takes};
use core::time::Duration;

/// At constant speed, with different acceleration and deceleration.
fn running(argument: &str) -> Bench {
    let mut bench = Bench::new();
    bench.set("AMAX", 1000);
    bench.set("DMAX", 500);
    bench.order("RUNV", argument);
    bench.run_for(3 * SECOND);
    bench
}

#[test]
fn stop_brakes_with_dmax() {
    let mut bench = running("+");
    let (dmax, vmax) = (bench.get("DMAX"), bench.get("VMAX"));
    bench.order("STOP", "");
    assert_takes(bench.run_until_standby(), vmax / dmax);
}

#[test]
fn stop_of_a_move_ends_at_vstop() {
    let mut bench = Bench::new();
    bench.set("VSTOP", 300);
    bench.order("RUNA", "50000");
    bench.run_for(3 * SECOND);
    let (dmax, vmax, vstop) = (bench.get("DMAX"), bench.get("VMAX"), bench.get("VSTOP"));
    bench.order("STOP", "");
    assert_takes(bench.run_until_standby(), (vmax - vstop) / dmax);
    bench.run_for(60 * SECOND);
    assert!(bench.position() < 5000.0, "it does not go on to its target");
}

#[test]
fn a_new_amax_or_dmax_resumes_what_stop_was_ending() {
    for setting in ["AMAX", "DMAX"] {
        let mut bench = running("-");
        bench.order("STOP", "");
        bench.run_for(SECOND);
        let value = bench.get(setting);
        bench.set(setting, value);
        bench.run_until(|bench| bench.flag("ATSPEED"));
        bench.order("STOP", "");
        bench.run_until_standby();
        bench.set(setting, value);
        bench.run_for(SECOND);
        assert!(bench.standby(), "once it stands nothing is resumed");
        let mut bench = Bench::new();
        bench.order("RUNA", "5000");
        bench.run_for(2 * SECOND);
        bench.order("STOP", "");
        bench.run_for(500 * MS);
        bench.set(setting, 900);
        bench.run_until_standby();
        assert_near(bench.position(), 5000.0, 0.0);
    }
}

#[test]
fn other_settings_leave_a_stop_going() {
    let mut bench = running("+");
    let (vmax, dmax) = (bench.get("VMAX"), bench.get("DMAX"));
    bench.order("STOP", "");
    for (mnemonic, value) in [("VMAX", 2000), ("VSTOP", 100), ("VSTART", 50), ("TZW", 0)] {
        bench.run_for(100 * MS);
        bench.set(mnemonic, value);
    }
    assert_takes(bench.run_until_standby() + 400 * MS, vmax / dmax);
}

#[test]
fn sstop_stands_on_a_full_step_within_a_second_whatever_the_profile() {
    for (vmax, dmax) in [
        (1000.0, 1.0),
        (1000.0, 16_000.0),
        (0.01, 1.0),
        (0.9, 1.0),
        (1.9, 5.0),
        (2.1, 1.0),
        (333.3, 7.0),
        (15_000.0, 1.0),
    ] {
        for (direction, wait) in [("+", 60_001), ("-", 60_001), ("+", 137), ("-", 1), ("+", 0)] {
            let mut bench = Bench::new();
            bench.set("VMAX", vmax);
            bench.set("DMAX", dmax);
            bench.order("RUNV", direction);
            bench.run_for(wait * MS);
            let (start, ahead) = (bench.drive.rotor(bench.now), if direction == "+" { 1 } else { -1 });
            let speed = bench.drive.speed(bench.now);
            bench.order("SSTOP", "");
            let took = bench.run_until_standby();
            let end = bench.drive.rotor(bench.now);
            assert!(took <= SECOND, "{vmax} {direction} after {wait} ms: {took:?}");
            assert!((end - start) * ahead >= 0, "{vmax} {direction} after {wait} ms: it turned back");
            assert!(wait == 0 || end % STEP == 0, "{vmax} {direction} after {wait} ms: {end}");
            // As gently as that can be: the braking uses the second up to the last full step.
            let steps = (end - start).abs() as f64 / STEP as f64;
            assert!(steps >= speed / 2.0 - 1.1 && steps <= (speed / 2.0).max(1.0), "{speed} {steps}");
        }
    }
}

#[test]
fn sstop_is_neither_resumed_nor_changed_by_the_profile() {
    let mut bench = running("+");
    bench.order("SSTOP", "");
    bench.run_for(100 * MS);
    bench.set("AMAX", 500);
    bench.set("DMAX", 16_000);
    bench.set("VMAX", 5);
    bench.order("STOP", "");
    let took = bench.run_until_standby() + 100 * MS;
    assert!(took <= SECOND && took > 990 * MS, "{took:?}");
    assert_eq!(bench.drive.rotor(bench.now) % STEP, 0);
}

#[test]
fn sstop_in_the_middle_of_a_stop_and_of_a_move() {
    let mut bench = running("+");
    bench.order("STOP", "");
    bench.run_for(300 * MS);
    bench.order("SSTOP", "");
    assert!(bench.run_until_standby() <= SECOND);
    assert_eq!(bench.drive.rotor(bench.now) % STEP, 0);
    bench.order("RUNR", "9000");
    bench.run_for(700 * MS);
    bench.order("SSTOP", "");
    assert!(bench.run_until_standby() <= SECOND);
    assert_eq!(bench.drive.rotor(bench.now) % STEP, 0);
}

#[test]
fn estop_stops_at_once_and_disables_the_motor_until_clr() {
    let mut bench = running("+");
    let position = bench.position();
    bench.order("ESTOP", "");
    assert_eq!(bench.flags(), "STANDBY, EMERGENCY STOP");
    assert_near(bench.position(), position, 0.0);
    assert_near(bench.current(), 0.0, 0.0);
    bench.refused("RUNV", "+", -7);
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY");
    assert_near(bench.position(), position, 0.0);
    bench.order("RUNV", "+");
}

#[test]
fn stops_at_standstill_do_nothing() {
    for stop in ["STOP", "SSTOP"] {
        let mut bench = Bench::new();
        bench.set("TZW", 2);
        bench.order(stop, "");
        assert_eq!((bench.flags().as_str(), bench.drive.next_wake()), ("STANDBY", None));
    }
}

#[test]
fn stops_call_off_a_move_that_waits_for_tzw_or_turns_round() {
    for stop in ["STOP", "SSTOP", "ESTOP"] {
        let mut bench = Bench::new();
        bench.set("TZW", 2);
        bench.order("RUNA", "100");
        bench.run_until(|bench| bench.position() >= 100.0);
        bench.order("RUNA", "0");
        bench.run_for(SECOND);
        bench.order(stop, "");
        bench.run_until_standby();
        assert_near(bench.position(), 100.0, 0.0);
        bench.order("CLR", "");
        bench.order("RUNA", "5000");
        bench.run_for(2 * SECOND);
        bench.order("RUNA", "100");
        bench.run_until(|bench| bench.velocity() <= 0.0);
        let turn = bench.position();
        bench.run_for(SECOND);
        bench.order(stop, "");
        let rest = bench.run_until_standby();
        assert!(rest <= SECOND + Duration::from_micros(100), "{stop} {rest:?}");
        assert_near(bench.position(), turn, 0.0);
    }
}
