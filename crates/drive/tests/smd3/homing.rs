//! The search for a limit switch, from every starting position.

use crate::bench::{Bench, MS, SECOND, STEP, assert_near, assert_takes};
use core::ops::RangeInclusive;
use stepdrive_spec::smd3::signals::Signal;

const FAR: i64 = 1_000_000;

/// In home mode, with a negative limit switch closed along this range of the rotor's full steps.
fn bench(closed: RangeInclusive<i64>) -> Bench {
    let mut bench = Bench::in_mode(5);
    bench.switch(Signal::LimitNegative, closed);
    bench
}

/// Runs to the end of the search and asserts that it was found at this place of the rotor.
#[track_caller]
fn assert_homed(bench: &mut Bench, place: i64) {
    assert!(!bench.standby());
    bench.run_until_standby();
    assert_eq!(bench.drive.rotor(bench.now), place);
    assert_eq!(bench.flags(), "LIMIT NEGATIVE, STANDBY");
    assert_near(bench.get("PACT"), 0.0, 0.0);
    assert_near(bench.get("PREL"), 0.0, 0.0);
}

#[test]
fn the_search_ends_at_the_edge_of_the_switch_from_wherever_it_starts() {
    let starts: [(&str, RangeInclusive<i64>, i64); 6] = [
        ("just before", -1..=-1, -1),
        ("before a wide switch", -FAR..=-3000, -3000),
        ("before a narrow switch", -3001..=-3000, -3000),
        ("on it, near its edge", -FAR..=0, 0),
        ("on it, far in", -FAR..=40, 40),
        ("on a narrow one", -10..=10, 10),
    ];
    for lsm in [0, 1] {
        for tzw in ["0", "0.5"] {
            for (start, closed, edge) in starts.clone() {
                let mut bench = bench(closed);
                bench.set("LSM", lsm);
                bench.set("TZW", tzw);
                bench.order("RUNH", "-");
                assert_homed(&mut bench, edge * STEP);
                assert!(bench.wakes < 20, "{start}, LSM {lsm}, TZW {tzw}: {} wake-ups", bench.wakes);
            }
        }
    }
}

#[test]
fn homing_in_the_positive_direction_is_the_same() {
    let mut bench = Bench::in_mode(5);
    bench.switch(Signal::LimitPositive, 1500..=FAR);
    bench.set("PACT", 77);
    bench.order("RUNH", "+");
    bench.run_until_standby();
    assert_eq!(bench.drive.rotor(bench.now), 1500 * STEP);
    assert_eq!(bench.flags(), "LIMIT POSITIVE, STANDBY");
    assert_near(bench.position(), 0.0, 0.0);
}

#[test]
fn homing_works_with_an_input_that_is_active_low() {
    let mut bench = Bench::in_mode(5);
    bench.set("LP-", 1);
    // The signal goes away at the switch.
    bench.switch(Signal::LimitNegative, -1999..=FAR);
    bench.order("RUNH", "-");
    // The signal ends a microstep before the step -1999.
    assert_homed(&mut bench, -1999 * STEP - 1);
}

#[test]
fn it_backs_off_and_approaches_at_vstart() {
    let mut bench = bench(-FAR..=20);
    let vstart = bench.get("VSTART");
    bench.order("RUNH", "-");
    assert_near(bench.velocity(), vstart, 1e-9);
    assert!(bench.flag("ATSPEED"));
    let microstep = 1.0 / 256.0;
    let took = bench.run_until_standby();
    // 20 full steps and a microstep up to the edge, the microstep back.
    assert_near(took.as_secs_f64(), (20.0 + 2.0 * microstep) / vstart, 1e-6);
}

#[test]
fn the_slowest_vstart_only_takes_its_time() {
    let mut bench = bench(-FAR..=-500);
    let slowest = bench.set("VSTART", 1e-6);
    bench.order("RUNH", "-");
    bench.run_for(3 * SECOND);
    let took = bench.run_until_standby().as_secs_f64();
    assert!(took < 2.1 / 256.0 / slowest + 3.0, "{took} s");
    assert_eq!(bench.drive.rotor(bench.now), -500 * STEP);
}

#[test]
fn a_soft_stop_that_runs_past_the_switch_finds_it_again() {
    let mut bench = bench(-2005..=-2000);
    bench.set("LSM", 1);
    bench.set("VSTOP", 100);
    bench.set("VSTART", 100);
    bench.order("RUNH", "-");
    bench.run_until(|bench| bench.velocity() > 0.0);
    assert!(bench.drive.rotor(bench.now) < -2400 * STEP);
    assert_homed(&mut bench, -2000 * STEP);
}

#[test]
fn tzw_passes_at_each_reversal_and_before_standby() {
    let mut bench = bench(-FAR..=-2000);
    let tzw = bench.set("TZW", 1);
    let (vmax, amax, vstart) = (bench.get("VMAX"), bench.get("AMAX"), bench.get("VSTART"));
    bench.order("RUNH", "-");
    let took = bench.run_until_standby().as_secs_f64();
    let seek = vmax / amax + (2000.0 - vmax * vmax / (2.0 * amax)) / vmax;
    assert_near(took, seek + 2.0 / 256.0 / vstart + 3.0 * tzw, 1e-5);
}

#[test]
fn without_a_switch_ahead_it_searches_until_it_is_stopped() {
    let mut bench = bench(100..=200);
    bench.order("RUNH", "-");
    bench.run_for(1000 * SECOND);
    assert_eq!(bench.flags(), "ATSPEED");
    bench.order("STOP", "");
    let (vmax, dmax) = (bench.get("VMAX"), bench.get("DMAX"));
    bench.run_for(100 * MS);
    bench.set("AMAX", 1000);
    assert_takes(bench.run_until_standby() + 100 * MS, vmax / dmax);
    assert!(bench.position() < -900_000.0, "the position is kept");
}

#[test]
fn a_disabled_limit_cannot_be_searched_for() {
    for (l, plus, minus, code) in [(0, 1, 1, Some(-5)), (1, 1, 0, Some(-5)), (1, 0, 1, None)] {
        let mut bench = Bench::in_mode(5);
        bench.set("L", l);
        bench.set("L+", plus);
        bench.set("L-", minus);
        match code {
            Some(code) => bench.refused("RUNH", "-", code),
            None => bench.order("RUNH", "-"),
        }
        assert_eq!(bench.standby(), code.is_some());
    }
}

#[test]
fn stops_and_faults_end_the_search_in_every_stage() {
    for stop in ["STOP", "SSTOP", "ESTOP"] {
        for wait in [500, 2503, 2700] {
            let mut bench = bench(-2000..=-1990);
            bench.set("LSM", 1);
            bench.set("VSTART", 0.01);
            bench.order("RUNH", "-");
            bench.run_for(wait * MS);
            assert!(!bench.standby(), "{stop} {wait}");
            bench.order(stop, "");
            bench.run_until_standby();
            let position = bench.position();
            assert!(position < -100.0, "{stop} {wait}: PACT is not set");
            bench.run_for(1000 * SECOND);
            assert_near(bench.position(), position, 0.0);
        }
    }
}

#[test]
fn the_other_limit_on_the_way_back_ends_the_search() {
    let mut bench = bench(-FAR..=100);
    bench.switch(Signal::LimitPositive, 50..=FAR);
    bench.set("PACT", 7);
    bench.order("RUNH", "-");
    bench.run_until_standby();
    assert_eq!(bench.drive.rotor(bench.now), 50 * STEP);
    assert_near(bench.position(), 57.0, 0.0);
}

#[test]
fn a_search_in_the_other_direction_takes_the_place_of_the_first() {
    let mut bench = bench(-FAR..=-9000);
    bench.switch(Signal::LimitPositive, 700..=FAR);
    bench.order("RUNH", "-");
    bench.run_for(2 * SECOND);
    bench.order("RUNH", "+");
    bench.run_until_standby();
    assert_eq!(bench.drive.rotor(bench.now), 700 * STEP);
    assert_near(bench.position(), 0.0, 0.0);
}
