//! The winding, held at a temperature from outside.

use crate::bench::{Bench, SECOND, assert_near, assert_takes};
use stepdrive_drive::smd3::{Thermal, Timer};
use stepdrive_spec::smd3::signals::{Sensor, Signal};

fn heat(bench: &mut Bench, temperature: f64) {
    bench.drive.heat(bench.now, Some(temperature));
}

#[test]
fn above_190_degrees_it_trips_at_once_whatever_the_mode() {
    for mode in 0..6 {
        let mut bench = Bench::new();
        bench.set("L", 1);
        bench.set("MODE", mode);
        bench.signal(Signal::Joystick, mode == 3);
        match mode {
            2 => bench.order("RUNV", "+"),
            4 => bench.order("RUNB", ""),
            5 => bench.order("RUNH", "+"),
            _ => bench.signal(Signal::Step, true),
        }
        bench.run_for(SECOND / 50);
        heat(&mut bench, 190.0);
        assert!(!bench.flag("TOVR"), "{mode}");
        heat(&mut bench, 190.01);
        assert!(bench.flag("TOVR") && !bench.flag("BAKE"), "{mode}: {}", bench.flags());
        assert_near(bench.get("TMOT"), 190.01, 0.0);
        assert_near(bench.current(), 0.0, 0.0);
        assert_near(bench.velocity(), 0.0, 0.0);
    }
}

#[test]
fn it_is_held_whatever_current_flows() {
    let mut bench = Bench::new();
    heat(&mut bench, 77.0);
    assert_eq!(bench.drive.held_at(), Some(77.0));
    for order in ["+", "-"] {
        bench.order("RUNV", order);
        bench.run_for(1000 * SECOND);
        assert_near(bench.get("TMOT"), 77.0, 0.0);
        assert_near(bench.temperature(), 77.0, 0.0);
    }
    assert_ne!(bench.drive.next_wake().map(|(_, timer)| timer), Some(Timer::Temperature));
}

#[test]
fn let_go_it_cools_and_warms_by_itself_from_there() {
    let mut bench = Bench::new();
    bench.set("IH", 0);
    heat(&mut bench, 120.0);
    bench.run_for(5000 * SECOND);
    bench.drive.heat(bench.now, None);
    assert_eq!(bench.drive.held_at(), None);
    bench.run_for(600 * SECOND);
    assert_near(bench.temperature(), 20.0 + 100.0 * (-1.0_f64).exp(), 1e-9);
    let from = bench.temperature();
    bench.order("RUNV", "+");
    bench.run_for(600 * SECOND);
    assert_near(bench.temperature(), 95.0 + (from - 95.0) * (-1.0_f64).exp(), 1e-9);
}

#[test]
fn let_go_under_current_it_trips_when_the_current_brings_it_there() {
    let mut bench = Bench::warming(Thermal { rise_k: 400.0, ..Thermal::default() });
    bench.order("RUNV", "+");
    bench.run_for(10 * SECOND);
    heat(&mut bench, 150.0);
    bench.run_for(100_000 * SECOND);
    assert!(!bench.flag("TOVR"));
    bench.drive.heat(bench.now, None);
    let took = bench.run_until(|bench| bench.flag("TOVR"));
    assert_takes(took, 600.0 * ((220.0_f64 - 150.0) / (220.0 - 190.0)).ln());
}

#[test]
fn clr_helps_when_it_is_cool_again() {
    let mut bench = Bench::new();
    heat(&mut bench, 200.0);
    bench.order("CLR", "");
    assert!(bench.flag("TOVR"));
    heat(&mut bench, 189.0);
    assert!(bench.flag("TOVR"), "it is latched");
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn what_the_sensor_does_not_show_does_not_trip() {
    let mut bench = Bench::new();
    bench.drive.set_sensor(bench.now, Sensor::Short);
    heat(&mut bench, 250.0);
    assert_eq!(bench.flags(), "STANDBY");
    assert_near(bench.get("TMOT"), 20.0, 0.0);
    assert_near(bench.temperature(), 250.0, 0.0);
    bench.drive.set_sensor(bench.now, Sensor::Connected);
    assert_eq!(bench.flags(), "STANDBY, TOVR");
}

#[test]
fn bake_regulates_by_what_it_is_held_at() {
    let mut bench = Bench::in_mode(4);
    bench.order("RUNB", "");
    for (held, current) in [(20.0, 1.0), (100.0, 1.0), (180.0, 0.0)] {
        heat(&mut bench, held);
        bench.run_for(1000 * SECOND);
        assert_near(bench.current(), current, 0.0);
    }
    heat(&mut bench, 150.0);
    assert_near(bench.current(), (130.0_f64 / 150.0).sqrt(), 1e-12);
    bench.drive.heat(bench.now, None);
    bench.run_for(1000 * SECOND);
    assert_near(bench.temperature(), 150.0, 1e-9);
}

#[test]
fn odd_temperatures_are_brought_into_range() {
    for (odd, held) in
        [(f64::NAN, -273.15), (f64::INFINITY, 1e4), (f64::NEG_INFINITY, -273.15), (-300.0, -273.15)]
    {
        let mut bench = Bench::new();
        heat(&mut bench, odd);
        assert_near(bench.temperature(), held, 0.0);
        bench.drive.heat(bench.now, None);
        bench.run_for(100_000 * SECOND);
        assert_near(bench.temperature(), 20.0, 1.0);
    }
}
