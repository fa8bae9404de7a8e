//! The winding's temperature, bake, and the trip.

use crate::bench::{Bench, MS, SECOND, assert_near};
use core::time::Duration;
use stepdrive_drive::smd3::{Thermal, Timer};
use stepdrive_spec::smd3::signals::Sensor;
use stepdrive_spec::time::Instant;

/// A motor that bake can bring above 190 °C.
fn hot() -> Thermal {
    Thermal { rise_k: 250.0, ..Thermal::default() }
}

/// In bake mode, with this set-point; what the motor was held with has left it cold.
fn baking(thermal: Thermal, baket: u32) -> Bench {
    let mut bench = Bench::warming(thermal);
    bench.set("IH", 0);
    bench.set("MODE", 4);
    bench.set("BAKET", baket);
    bench.order("RUNB", "");
    bench
}

#[test]
fn a_cold_motor_is_at_ambient_temperature() {
    let mut bench = Bench::warming(Thermal { ambient_c: 33.0, ..Thermal::default() });
    assert_near(bench.get("TMOT"), 33.0, 0.0);
    bench.run_for(1000 * SECOND);
    assert!(bench.get("TMOT") > 33.0, "the hold current warms it");
}

#[test]
fn turning_warms_the_winding_along_the_closed_form() {
    let mut bench = Bench::new();
    bench.set("IH", 0);
    bench.order("RUNV", "+");
    for seconds in [10.0_f64, 60.0, 600.0, 3600.0] {
        let at = Instant::ZERO + Duration::from_secs_f64(seconds);
        bench.run_for(at.since(bench.now));
        // 1 A as sine and cosine heats half as much as 1 A in both phases.
        assert_near(bench.temperature(), 20.0 + 75.0 * (1.0 - (-seconds / 600.0).exp()), 1e-9);
    }
    assert_eq!(bench.wakes, 1);
}

#[test]
fn a_night_of_moves_and_rests_is_followed_exactly() {
    let mut bench = Bench::new();
    bench.set("PDDEL", 5000);
    bench.set("IHD", 0);
    bench.set("IH", 0.5);
    let mut expected = 20.0;
    let warm = |from: f64, goal: f64, seconds: f64| goal + (from - goal) * (-seconds / 600.0).exp();
    // The hold current of the default before IH was set acted for no time.
    for _ in 0..20 {
        bench.order("RUNR", "5000");
        let moving = bench.run_until_standby();
        expected = warm(expected, 95.0, moving.as_secs_f64());
        let held = bench.get("PDDEL") * 1e-3;
        bench.run_for(300 * SECOND);
        expected = warm(expected, 95.0, held);
        expected = warm(expected, 20.0 + 75.0 * 0.25, 300.0 - held);
    }
    assert_near(bench.temperature(), expected, 1e-6);
}

#[test]
fn lowering_the_current_step_by_step_warms_as_the_steps_would() {
    let mut bench = Bench::new();
    bench.set("IHD", 320);
    bench.set("IH", 0);
    bench.order("RUNR", "10");
    bench.run_until_standby();
    let (mut expected, mut at) = (bench.temperature(), bench.now);
    let end = bench.now + 60 * SECOND;
    while at < end {
        let current = bench.drive.current(at + MS / 2);
        let goal = 20.0 + 75.0 * current * current;
        expected = goal + (expected - goal) * (-1e-3_f64 / 600.0).exp();
        at = at + MS;
    }
    bench.run_for(60 * SECOND);
    assert_near(bench.temperature(), expected, 0.01);
}

#[test]
fn bake_heats_with_all_it_has_and_then_holds() {
    let mut bench = baking(Thermal::default(), 100);
    assert_eq!(bench.flags(), "STANDBY, BAKE");
    assert_near(bench.current(), 1.0, 0.0);
    bench.run_for(100 * SECOND);
    assert_near(bench.temperature(), 20.0 + 150.0 * (1.0 - (-100.0_f64 / 600.0).exp()), 1e-9);
    let mut before = bench.temperature();
    for _ in 0..100 {
        bench.run_for(60 * SECOND);
        assert!(bench.temperature() <= 100.0 + 1e-9, "no overshoot");
        assert!(bench.temperature() >= before - 1e-9);
        before = bench.temperature();
    }
    assert_near(bench.get("TMOT"), 100.0, 1e-6);
    // What balances the losses.
    assert_near(bench.current(), (80.0_f64 / 150.0).sqrt(), 1e-6);
    assert_eq!(bench.drive.rotor(bench.now), 0);
}

#[test]
fn bake_holds_every_setpoint_within_a_kelvin_and_costs_nothing() {
    for baket in [30, 80, 150, 169, 185] {
        let mut bench = baking(hot(), baket);
        bench.run_for(Duration::from_hours(2));
        for _ in 0..360 {
            bench.run_for(60 * SECOND);
            assert_near(bench.temperature(), f64::from(baket), 1.0);
        }
        assert_eq!(bench.wakes, 0);
    }
}

#[test]
fn a_new_setpoint_is_gone_to_from_above_and_below() {
    let mut bench = baking(hot(), 100);
    for baket in [160, 60, 150, 149, 20, 0, 180] {
        bench.set("BAKET", baket);
        bench.run_for(Duration::from_hours(3));
        let reached = f64::from(baket).max(20.0);
        assert_near(bench.temperature(), reached, 0.01);
        if baket <= 20 {
            assert_near(bench.current(), 0.0, 1e-2);
        }
    }
}

#[test]
fn current_follows_the_temperature_without_a_jump() {
    let mut bench = baking(hot(), 120);
    let mut before = bench.current();
    for _ in 0..2000 {
        bench.run_for(SECOND);
        assert!((bench.current() - before).abs() < 0.02, "{before} {}", bench.current());
        before = bench.current();
    }
}

#[test]
fn a_setpoint_out_of_reach_is_approached_with_all_it_has() {
    let mut bench = baking(Thermal::default(), 185);
    bench.run_for(Duration::from_hours(8));
    assert_near(bench.temperature(), 170.0, 0.01);
    assert_near(bench.current(), 1.0, 0.0);
    bench.set("BAKET", 100);
    bench.run_for(Duration::from_hours(1));
    assert_near(bench.temperature(), 100.0, 0.01);
}

#[test]
fn a_setpoint_above_the_trip_ends_in_it() {
    let mut bench = baking(hot(), 200);
    let (at, timer) = bench.drive.next_wake().expect("the trip");
    assert_eq!(timer, Timer::Temperature);
    bench.run_until(|bench| bench.flag("TOVR"));
    assert_eq!((bench.now, bench.flags().as_str()), (at, "STANDBY, TOVR"));
    assert_near(bench.temperature(), 190.0, 1e-6);
    assert_near(bench.current(), 0.0, 0.0);
    bench.refused("RUNB", "", -7);
    bench.run_for(600 * SECOND);
    assert_near(bench.temperature(), 20.0 + 170.0 / 1.0_f64.exp(), 1e-6);
    assert!(bench.flag("TOVR"));
    bench.order("CLR", "");
    bench.set("BAKET", 180);
    bench.order("RUNB", "");
    bench.run_for(Duration::from_hours(8));
    assert_eq!(bench.flags(), "STANDBY, BAKE");
}

#[test]
fn the_trip_acts_in_every_mode_and_holds_while_it_is_too_warm() {
    let thermal = Thermal { ambient_c: 150.0, ..Thermal::default() };
    let mut bench = Bench::warming(thermal);
    bench.order("RUNV", "+");
    bench.run_until(|bench| bench.flag("TOVR"));
    assert_near(bench.velocity(), 0.0, 0.0);
    bench.order("CLR", "");
    // A moment later it is below the trip already.
    bench.run_for(SECOND);
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY");
    let oven = Bench::warming(Thermal { ambient_c: 195.0, ..Thermal::default() });
    assert_eq!(oven.flags(), "STANDBY, TOVR");
}

#[test]
fn a_fault_of_the_sensor_ends_bake() {
    let mut bench = baking(hot(), 150);
    bench.run_for(1000 * SECOND);
    bench.drive.set_sensor(bench.now, Sensor::Open);
    assert_eq!(bench.flags(), "STANDBY, TOPEN");
    bench.drive.set_sensor(bench.now, Sensor::Connected);
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn a_short_circuited_thermocouple_blinds_bake_and_the_trip() {
    let mut bench = baking(hot(), 100);
    bench.drive.set_sensor(bench.now, Sensor::Short);
    bench.run_for(Duration::from_hours(8));
    assert_eq!(bench.flags(), "STANDBY, BAKE");
    assert_near(bench.get("TMOT"), 20.0, 0.0);
    assert_near(bench.temperature(), 270.0, 0.01);
    bench.drive.set_sensor(bench.now, Sensor::Connected);
    assert_eq!(bench.flags(), "STANDBY, TOVR");
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY, TOVR");
}

#[test]
fn stops_end_bake() {
    for stop in ["STOP", "SSTOP", "ESTOP"] {
        let mut bench = baking(hot(), 100);
        bench.run_for(1000 * SECOND);
        bench.order(stop, "");
        assert!(!bench.flag("BAKE"));
        assert_near(bench.current(), 0.0, 0.0);
        let before = bench.temperature();
        bench.run_for(1000 * SECOND);
        assert!(bench.temperature() < before - 10.0);
    }
}

#[test]
fn bake_that_runs_is_not_started_again() {
    let mut bench = baking(hot(), 100);
    bench.run_for(100 * SECOND);
    let before = bench.temperature();
    bench.order("RUNB", "");
    assert_near(bench.temperature(), before, 0.0);
    assert_eq!(bench.flags(), "STANDBY, BAKE");
}
