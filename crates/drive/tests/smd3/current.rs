//! The current: by what the motor does, and after a standstill by `PDDEL` and `IHD`.

use crate::bench::{Bench, MS, SECOND, assert_near};
use core::time::Duration;
use stepdrive_drive::smd3::Phases;

fn bench() -> Bench {
    let mut bench = Bench::new();
    bench.set("IR", 0.5);
    bench.set("IA", 0.75);
    bench.set("IH", 0.25);
    bench
}

#[test]
fn each_phase_of_a_move_has_its_current() {
    let mut bench = bench();
    assert_near(bench.current(), 0.25, 0.0);
    bench.order("RUNA", "3000");
    assert_near(bench.current(), 0.75, 0.0);
    bench.run_until(|bench| bench.flag("ATSPEED"));
    assert_near(bench.current(), 0.5, 0.0);
    bench.set("IR", 0.625);
    assert_near(bench.current(), 0.625, 0.0);
    bench.run_until(|bench| !bench.flag("ATSPEED"));
    assert_near(bench.current(), 0.75, 0.0);
}

#[test]
fn after_a_standstill_it_is_held_for_pddel_and_lowered_by_ihd() {
    let mut bench = bench();
    let delay = bench.set("PDDEL", 500) * 1e-3;
    let step = bench.set("IHD", 100) * 1e-3;
    bench.order("RUNA", "3000");
    bench.run_until_standby();
    let wakes = bench.wakes;
    let after =
        |bench: &mut Bench, seconds: f64| bench.drive.current(bench.now + Duration::from_secs_f64(seconds));
    let rows =
        [(0.0, 0), (delay - 1e-6, 0), (delay + 1e-6, 0), (delay + step - 1e-6, 0), (delay + step + 1e-6, 1)];
    for (seconds, steps) in rows {
        assert_near(after(&mut bench, seconds), 0.75 - f64::from(steps) / 32.0, 0.0);
    }
    for steps in 0..16 {
        let half_way = delay + step * (f64::from(steps) + 0.5);
        assert_near(after(&mut bench, half_way), 0.75 - f64::from(steps) / 32.0, 1e-12);
    }
    assert_near(after(&mut bench, delay + 16.0 * step + 1e-6), 0.25, 0.0);
    bench.run_for(100 * SECOND);
    assert_near(bench.current(), 0.25, 0.0);
    assert_eq!(bench.wakes, wakes, "no step of it costs a wake-up");
}

#[test]
fn without_ihd_it_falls_at_once_and_without_pddel_immediately() {
    let mut bench = bench();
    bench.set("IHD", 0);
    bench.order("RUNA", "10");
    bench.run_until_standby();
    assert_near(bench.current(), 0.75, 0.0);
    bench.run_for(110 * MS);
    assert_near(bench.current(), 0.25, 0.0);
    bench.set("PDDEL", 0);
    bench.order("RUNA", "20");
    bench.run_until_standby();
    assert_near(bench.current(), 0.25, 0.0);
}

#[test]
fn stopped_dead_out_of_constant_speed_it_is_the_run_current_that_is_held() {
    let mut bench = bench();
    bench.set("L", 1);
    bench.order("RUNV", "+");
    bench.run_for(3 * SECOND);
    bench.signal(stepdrive_spec::smd3::signals::Signal::LimitPositive, true);
    assert_near(bench.current(), 0.5, 0.0);
}

#[test]
fn a_hold_current_above_the_others_is_reached_after_pddel() {
    let mut bench = bench();
    bench.set("IH", 1);
    bench.order("RUNA", "10");
    bench.run_until_standby();
    bench.run_for(100 * MS);
    assert_near(bench.current(), 0.75, 0.0);
    bench.run_for(10 * MS);
    assert_near(bench.current(), 1.0, 0.0);
}

#[test]
fn without_hold_current_the_phases_are_as_f_says() {
    for (f, phases) in [(0, Phases::Driven), (1, Phases::Freewheeling), (2, Phases::Shorted)] {
        let mut bench = bench();
        bench.set("F", f);
        assert_eq!(bench.drive.phases(bench.now), Phases::Driven, "with hold current");
        bench.set("IH", 0);
        assert_eq!(bench.drive.phases(bench.now), phases);
        bench.order("RUNA", "10");
        assert_eq!(bench.drive.phases(bench.now), Phases::Driven);
        bench.run_until_standby();
        assert_eq!(bench.drive.phases(bench.now), Phases::Driven, "while it is lowered");
        bench.run_for(2 * SECOND);
        assert_eq!(bench.drive.phases(bench.now), phases);
    }
}

#[test]
fn a_disabled_motor_has_no_current_and_is_held_again_after_clr() {
    let mut bench = bench();
    bench.order("ESTOP", "");
    assert_near(bench.current(), 0.0, 0.0);
    bench.order("CLR", "");
    assert_near(bench.current(), 0.25, 0.0);
}
