//! Modes of operation, and the joystick that changes them.

use crate::bench::{Bench, SECOND, assert_near};
use stepdrive_drive::smd3::{Config, Stored};
use stepdrive_spec::smd3::commands::Mode;
use stepdrive_spec::smd3::signals::Signal;

#[test]
fn every_mode_can_be_chosen() {
    let mut bench = Bench::new();
    for mode in Mode::ALL {
        bench.set("MODE", mode.number());
        assert_eq!(bench.drive.mode(), mode);
        assert_near(bench.get("MODE"), f64::from(mode.number()), 0.0);
    }
    bench.refused("MODE", "6", -2);
}

#[test]
fn a_joystick_that_is_plugged_in_takes_over_and_gives_back() {
    let mut bench = Bench::in_mode(5);
    bench.signal(Signal::Joystick, true);
    assert_eq!(bench.drive.mode(), Mode::Joystick);
    assert_eq!(bench.flags(), "JSCON, STANDBY");
    bench.signal(Signal::Joystick, false);
    assert_eq!(bench.drive.mode(), Mode::Home);
}

#[test]
fn a_joystick_waits_for_standby() {
    let mut bench = Bench::new();
    bench.order("RUNV", "+");
    bench.run_for(SECOND);
    bench.signal(Signal::Joystick, true);
    assert_eq!(bench.drive.mode(), Mode::Remote);
    bench.order("STOP", "");
    bench.run_until_standby();
    assert_eq!(bench.drive.mode(), Mode::Joystick);
    bench.signal(Signal::JoystickCw, true);
    bench.run_for(SECOND);
    bench.signal(Signal::Joystick, false);
    assert_eq!(bench.drive.mode(), Mode::Joystick);
    bench.run_until_standby();
    assert_eq!(bench.drive.mode(), Mode::Remote);
}

#[test]
fn a_joystick_that_goes_before_its_turn_came_changes_nothing() {
    let mut bench = Bench::new();
    bench.order("RUNA", "100");
    bench.signal(Signal::Joystick, true);
    bench.signal(Signal::Joystick, false);
    bench.run_until_standby();
    assert_eq!(bench.drive.mode(), Mode::Remote);
    assert_near(bench.position(), 100.0, 0.0);
}

#[test]
fn without_autojs_a_joystick_changes_nothing() {
    let mut bench = Bench::new();
    bench.set("AUTOJS", 0);
    bench.signal(Signal::Joystick, true);
    assert_eq!(bench.drive.mode(), Mode::Remote);
    bench.set("MODE", 3);
    bench.signal(Signal::Joystick, false);
    assert_eq!(bench.drive.mode(), Mode::Joystick);
}

#[test]
fn a_mode_that_is_chosen_counts_although_a_joystick_is_there() {
    let mut bench = Bench::new();
    bench.signal(Signal::Joystick, true);
    bench.set("MODE", 4);
    assert_eq!(bench.drive.mode(), Mode::Bake);
    bench.signal(Signal::Joystick, false);
    assert_eq!(bench.drive.mode(), Mode::Bake);
}

#[test]
fn a_joystick_is_noticed_at_power_up_and_the_mode_it_replaced_is_stored() {
    let mut bench = Bench::with(Config::default(), &Stored::Nothing, Signal::Joystick.bit());
    assert_eq!(bench.drive.mode(), Mode::Joystick);
    bench.order("STORE", "");
    let Stored::Intact(settings) = bench.drive.stored() else { panic!("stored") };
    assert_eq!(settings.mode(), Mode::Remote);
}

#[test]
fn a_joystick_lets_bake_go_on() {
    let mut bench = Bench::in_mode(4);
    bench.order("RUNB", "");
    bench.signal(Signal::Joystick, true);
    assert_eq!(bench.flags(), "JSCON, STANDBY, BAKE");
    bench.order("STOP", "");
    assert_eq!(bench.drive.mode(), Mode::Joystick);
}

#[test]
fn leaving_bake_mode_ends_bake() {
    let mut bench = Bench::in_mode(4);
    bench.order("RUNB", "");
    assert_eq!(bench.flags(), "STANDBY, BAKE");
    bench.set("MODE", 2);
    assert_eq!(bench.flags(), "STANDBY");
}
