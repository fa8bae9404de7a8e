//! The limit inputs: polarity, enables, and how they stop.

use crate::bench::{Bench, SECOND, STEP, assert_near};
use stepdrive_spec::smd3::signals::Signal;

#[test]
fn flags_show_the_inputs_with_their_polarity_whether_or_not_they_are_enabled() {
    let mut bench = Bench::new();
    bench.signal(Signal::LimitPositive, true);
    assert_eq!(bench.flags(), "LIMIT POSITIVE, STANDBY");
    bench.set("LP+", 1);
    assert_eq!(bench.flags(), "STANDBY");
    bench.set("LP-", 1);
    assert_eq!(bench.flags(), "LIMIT NEGATIVE, STANDBY");
    bench.signal(Signal::LimitNegative, true);
    bench.signal(Signal::LimitPositive, false);
    assert_eq!(bench.flags(), "LIMIT POSITIVE, STANDBY");
}

#[test]
fn a_limit_counts_when_it_and_all_of_them_are_enabled() {
    for (l, plus, stops) in [(1, 1, true), (0, 1, false), (1, 0, false), (0, 0, false)] {
        let mut bench = Bench::new();
        bench.set("L", l);
        bench.set("L+", plus);
        bench.order("RUNV", "+");
        bench.run_for(SECOND);
        bench.signal(Signal::LimitPositive, true);
        assert_eq!(bench.standby(), stops);
        // Without a stop it is still there when it is enabled.
        bench.set("L", 1);
        bench.set("L+", 1);
        assert!(bench.standby());
    }
}

#[test]
fn a_hard_limit_stops_on_the_spot_at_any_speed() {
    for (order, argument, signal, at) in [
        ("RUNV", "+", Signal::LimitPositive, 2500),
        ("RUNV", "-", Signal::LimitNegative, -2500),
        ("RUNA", "9000", Signal::LimitPositive, 100),
        ("RUNR", "-9000", Signal::LimitNegative, -3000),
    ] {
        let mut bench = Bench::new();
        let closed = if at > 0 { at..=at + 10 } else { at - 10..=at };
        bench.switch(signal, closed);
        bench.order(order, argument);
        bench.run_until_standby();
        assert_eq!(bench.drive.rotor(bench.now), at * STEP);
        assert_near(bench.get("VACT"), 0.0, 0.0);
        bench.run_for(10 * SECOND);
        assert_near(bench.position(), at as f64, 0.0);
    }
}

#[test]
fn a_soft_limit_brakes_with_dmax_and_forgets_the_target() {
    for (order, argument) in [("RUNV", "+"), ("RUNA", "90000"), ("RUNA", "3000")] {
        let mut bench = Bench::new();
        bench.set("DMAX", 500);
        bench.set("LSM", 1);
        // So narrow that the motor comes to stand beyond it.
        bench.switch(Signal::LimitPositive, 2500..=2501);
        bench.order(order, argument);
        bench.run_until_standby();
        let (vmax, dmax, vstop) = (bench.get("VMAX"), bench.get("DMAX"), bench.get("VSTOP"));
        if argument == "3000" {
            // It was braking for its target already.
            assert!(bench.position() > 2500.0 && bench.position() < 3000.1);
        } else {
            let end = if order == "RUNV" { 0.0 } else { vstop };
            assert_near(bench.position(), 2500.0 + (vmax * vmax - end * end) / (2.0 * dmax), 0.01);
        }
        bench.set("DMAX", 700);
        bench.run_for(10 * SECOND);
        assert!(bench.standby());
    }
}

#[test]
fn a_new_dmax_does_not_resume_what_a_soft_limit_stops() {
    let mut bench = Bench::new();
    bench.set("LSM", 1);
    bench.switch(Signal::LimitPositive, 2500..=2501);
    bench.order("RUNV", "+");
    bench.run_until(|bench| bench.flag("LIMIT POSITIVE"));
    bench.run_for(SECOND / 2);
    bench.set("DMAX", 2000);
    bench.run_until_standby();
    assert!(bench.position() < 3000.0);
}

#[test]
fn motion_towards_an_active_limit_is_accepted_and_does_not_happen() {
    for lsm in [0, 1] {
        let mut bench = Bench::new();
        bench.set("TZW", 1);
        bench.set("L", 1);
        bench.set("LSM", lsm);
        bench.signal(Signal::LimitNegative, true);
        for (order, argument) in [("RUNV", "-"), ("RUNA", "-10"), ("RUNR", "-10")] {
            bench.order(order, argument);
            assert_eq!(bench.flags(), "LIMIT NEGATIVE, STANDBY", "{order}");
            assert_eq!((bench.drive.rotor(bench.now), bench.drive.next_wake()), (0, None), "{order}");
        }
        bench.order("RUNR", "10");
        bench.run_until_standby();
        assert_near(bench.position(), 10.0, 0.0);
    }
}

#[test]
fn the_other_limit_lets_motion_pass() {
    let mut bench = Bench::new();
    bench.switch(Signal::LimitNegative, 100..=200);
    bench.order("RUNA", "1000");
    bench.run_until_standby();
    assert_near(bench.position(), 1000.0, 0.0);
}

#[test]
fn a_reversal_towards_an_active_limit_ends_where_it_turns() {
    for (order, argument, lsm) in [("RUNV", "-", 0), ("RUNV", "-", 1), ("RUNA", "0", 0), ("RUNA", "0", 1)] {
        let mut bench = Bench::new();
        bench.set("L", 1);
        bench.set("LSM", lsm);
        bench.order("RUNV", "+");
        bench.run_for(SECOND);
        bench.signal(Signal::LimitNegative, true);
        bench.order(order, argument);
        assert!(bench.velocity() > 0.0);
        bench.run_until_standby();
        let turn = bench.position();
        assert_near(turn, 1000.0, 3.0);
        bench.run_for(10 * SECOND);
        assert_near(bench.position(), turn, 0.0);
    }
}

#[test]
fn motion_that_a_limit_stopped_does_not_come_back_when_it_opens() {
    let mut bench = Bench::new();
    bench.set("L", 1);
    bench.order("RUNA", "5000");
    bench.run_for(SECOND);
    bench.signal(Signal::LimitPositive, true);
    let position = bench.position();
    bench.signal(Signal::LimitPositive, false);
    bench.run_for(10 * SECOND);
    assert_near(bench.position(), position, 0.0);
    bench.order("RUNA", "5000");
    bench.run_until_standby();
    assert_near(bench.position(), 5000.0, 0.0);
}

#[test]
fn a_limit_stops_what_tzw_held_back() {
    let mut bench = Bench::new();
    bench.set("TZW", 2);
    bench.set("L", 1);
    bench.order("RUNA", "100");
    bench.run_until(|bench| bench.position() >= 100.0);
    bench.order("RUNA", "200");
    bench.run_for(SECOND);
    bench.signal(Signal::LimitPositive, true);
    bench.run_until_standby();
    assert_near(bench.position(), 100.0, 0.0);
}

#[test]
fn a_limit_ends_a_stop_that_could_have_been_resumed() {
    let mut bench = Bench::new();
    bench.set("L", 1);
    bench.set("LSM", 1);
    bench.order("RUNV", "+");
    bench.run_for(SECOND);
    bench.order("STOP", "");
    bench.signal(Signal::LimitPositive, true);
    bench.signal(Signal::LimitPositive, false);
    bench.set("AMAX", 500);
    bench.run_until_standby();
}
