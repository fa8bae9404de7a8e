//! Step/direction mode.

use crate::bench::{Bench, MS, SECOND, assert_near};
use core::time::Duration;
use stepdrive_spec::smd3::signals::Signal;

fn pulse(bench: &mut Bench, times: u32, period: Duration) {
    for _ in 0..times {
        bench.signal(Signal::Step, true);
        bench.run_for(period / 2);
        bench.signal(Signal::Step, false);
        bench.run_for(period / 2);
    }
}

#[test]
fn an_edge_is_a_step_of_the_resolution_or_a_full_step() {
    for (res, interp, edge, steps) in [
        (256, 0, 0, 1.0 / 256.0),
        (8, 0, 0, 1.0 / 8.0),
        (8, 0, 1, 2.0 / 8.0),
        (64, 1, 0, 1.0),
        (64, 1, 1, 2.0),
    ] {
        let mut bench = Bench::in_mode(0);
        bench.set("RES", res);
        bench.set("INTERP", interp);
        bench.set("EDGE", edge);
        bench.signal(Signal::Dir, true);
        pulse(&mut bench, 10, MS);
        assert_near(bench.position(), 10.0 * steps, 0.0);
        bench.signal(Signal::Dir, false);
        pulse(&mut bench, 15, MS);
        assert_near(bench.position(), -5.0 * steps, 0.0);
    }
}

#[test]
fn no_step_is_lost_when_they_come_faster_than_they_are_carried_out() {
    let mut bench = Bench::in_mode(0);
    bench.set("INTERP", 1);
    bench.signal(Signal::Dir, true);
    pulse(&mut bench, 1000, Duration::from_nanos(200));
    bench.run_for(MS * 100);
    assert_near(bench.position(), 1000.0, 0.0);
}

#[test]
fn the_motor_stands_when_no_step_has_come_for_a_while() {
    let mut bench = Bench::in_mode(0);
    assert!(bench.standby());
    pulse(&mut bench, 3, 10 * MS);
    assert_eq!(bench.flags(), "");
    bench.refused("MODE", "2", -1);
    let rest = bench.run_until_standby();
    // 2^20 clocks, of which the pulse has taken 10 ms already.
    assert!(rest > 77 * MS && rest < 78 * MS, "{rest:?}");
    bench.set("MODE", 2);
}

#[test]
fn edges_do_nothing_in_other_modes_and_while_the_motor_is_disabled() {
    for mode in [2, 3, 4, 5] {
        let mut bench = Bench::in_mode(mode);
        pulse(&mut bench, 3, MS);
        assert!(bench.standby(), "{mode}");
    }
    let mut bench = Bench::in_mode(0);
    bench.order("ESTOP", "");
    pulse(&mut bench, 3, MS);
    bench.order("CLR", "");
    assert_near(bench.position(), 0.0, 0.0);
}

#[test]
fn limits_hold_steps_back() {
    for lsm in [0, 1] {
        let mut bench = Bench::in_mode(0);
        bench.set("INTERP", 1);
        bench.set("LSM", lsm);
        bench.switch(Signal::LimitPositive, 3..=10);
        bench.signal(Signal::Dir, true);
        pulse(&mut bench, 10, MS);
        assert_near(bench.position(), 3.0, 0.0);
        bench.signal(Signal::Dir, false);
        pulse(&mut bench, 10, MS);
        assert_near(bench.position(), -7.0, 0.0);
    }
}

#[test]
fn stops_do_no_harm() {
    for stop in ["STOP", "SSTOP", "ESTOP"] {
        let mut bench = Bench::in_mode(0);
        bench.set("INTERP", 1);
        bench.signal(Signal::Step, true);
        bench.run_for(Duration::from_nanos(500));
        bench.order(stop, "");
        bench.run_for(SECOND);
        assert!(bench.standby() && bench.position() > -1.0 && bench.position() < 0.0, "{stop}");
    }
}

#[test]
fn steps_count_while_the_external_enable_is_there_if_it_is_used() {
    let mut bench = Bench::in_mode(0);
    bench.set("INTERP", 1);
    bench.signal(Signal::Dir, true);
    pulse(&mut bench, 1, MS);
    bench.signal(Signal::Enable, true);
    bench.set("EXTEN", 1);
    pulse(&mut bench, 2, MS);
    assert_near(bench.position(), 3.0, 0.0);
    bench.signal(Signal::Enable, false);
    pulse(&mut bench, 4, MS);
    bench.signal(Signal::Enable, true);
    pulse(&mut bench, 8, MS);
    assert_near(bench.position(), 3.0, 0.0);
    bench.signal(Signal::ResetFault, true);
    pulse(&mut bench, 16, MS);
    assert_near(bench.position(), 19.0, 0.0);
}
