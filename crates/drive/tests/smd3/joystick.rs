//! The joystick's two modes, and triggered velocity, which is the continuous one with an edge for a button.

use crate::bench::{Bench, MS, SECOND, assert_near};
use stepdrive_spec::smd3::signals::Signal::{self, Joystick, JoystickCcw, JoystickCw};

/// With a joystick in this `JSMODE`.
fn bench(jsmode: u8) -> Bench {
    let mut bench = Bench::new();
    bench.set("JSMODE", jsmode);
    bench.signal(Joystick, true);
    bench
}

fn press(bench: &mut Bench, button: Signal) {
    bench.signal(button, true);
    bench.run_for(100 * MS);
    bench.signal(button, false);
}

#[test]
fn a_brief_press_is_one_step() {
    let mut bench = bench(0);
    for (button, position) in [(JoystickCw, 1.0), (JoystickCw, 2.0), (JoystickCcw, 1.0), (JoystickCcw, 0.0)] {
        bench.signal(button, true);
        bench.run_for(499 * MS);
        assert!(bench.standby());
        bench.signal(button, false);
        bench.run_until_standby();
        assert_near(bench.position(), position, 0.0);
    }
}

#[test]
fn a_long_press_runs_until_it_is_let_go() {
    let mut bench = bench(0);
    bench.signal(JoystickCcw, true);
    bench.run_for(500 * MS);
    assert!(!bench.standby());
    assert_near(bench.position(), 0.0, 0.0);
    bench.run_for(2 * SECOND);
    assert!(bench.flag("ATSPEED") && bench.velocity() < 0.0);
    bench.signal(JoystickCw, true);
    bench.run_for(SECOND);
    assert!(bench.flag("ATSPEED"), "the other button does nothing meanwhile");
    bench.signal(JoystickCw, false);
    bench.signal(JoystickCcw, false);
    assert!(!bench.flag("ATSPEED"));
    bench.set("AMAX", 500);
    bench.run_until_standby();
    assert_near(bench.velocity(), 0.0, 0.0);
}

#[test]
fn in_continuous_mode_a_press_starts_and_the_same_one_stops() {
    let mut bench = bench(1);
    press(&mut bench, JoystickCw);
    bench.run_for(2 * SECOND);
    assert!(bench.flag("ATSPEED"));
    press(&mut bench, JoystickCw);
    bench.run_until_standby();
    press(&mut bench, JoystickCw);
    bench.run_for(2 * SECOND);
    press(&mut bench, JoystickCcw);
    assert!(bench.velocity() > 0.0, "it decelerates first");
    bench.run_for(3 * SECOND);
    assert!(bench.flag("ATSPEED") && bench.velocity() < 0.0);
    press(&mut bench, JoystickCcw);
    press(&mut bench, JoystickCcw);
    bench.run_for(3 * SECOND);
    assert!(bench.flag("ATSPEED"), "a press while it stops starts it again");
}

#[test]
fn without_the_joystick_its_buttons_do_nothing_and_what_they_started_stops() {
    for jsmode in [0, 1] {
        let mut bench = bench(jsmode);
        bench.signal(JoystickCw, true);
        bench.run_for(3 * SECOND);
        assert!(bench.flag("ATSPEED"));
        bench.signal(Joystick, false);
        bench.run_until_standby();
        bench.set("MODE", 3);
        bench.signal(JoystickCw, false);
        bench.signal(JoystickCw, true);
        bench.run_for(SECOND);
        assert!(bench.standby());
    }
}

#[test]
fn buttons_do_nothing_in_other_modes_and_while_the_motor_is_disabled() {
    let mut bench = bench(1);
    bench.set("MODE", 2);
    press(&mut bench, JoystickCw);
    assert!(bench.standby());
    bench.set("MODE", 3);
    bench.order("ESTOP", "");
    press(&mut bench, JoystickCw);
    bench.order("CLR", "");
    assert!(bench.standby());
    press(&mut bench, JoystickCw);
    assert!(!bench.standby());
}

#[test]
fn a_fault_ends_what_a_held_button_does_for_good() {
    let mut bench = bench(0);
    bench.signal(JoystickCw, true);
    bench.run_for(200 * MS);
    bench.order("ESTOP", "");
    bench.order("CLR", "");
    bench.run_for(2 * SECOND);
    bench.signal(JoystickCw, false);
    bench.run_for(2 * SECOND);
    assert_eq!(bench.drive.rotor(bench.now), 0);
}

#[test]
fn limits_stop_the_joystick_too() {
    let mut bench = bench(0);
    bench.switch(Signal::LimitPositive, 2..=100);
    for expected in [1.0, 2.0, 2.0] {
        press(&mut bench, JoystickCw);
        bench.run_for(SECOND);
        assert_near(bench.position(), expected, 0.0);
    }
    bench.signal(JoystickCcw, true);
    bench.run_for(2 * SECOND);
    assert!(bench.velocity() < 0.0);
}

#[test]
fn stop_ends_what_a_held_button_started() {
    let mut bench = bench(0);
    bench.signal(JoystickCw, true);
    bench.run_for(2 * SECOND);
    bench.order("STOP", "");
    bench.run_until_standby();
    bench.signal(JoystickCw, false);
    bench.run_for(SECOND);
    assert!(bench.standby());
}

#[test]
fn an_edge_starts_triggered_velocity_and_the_next_stops_it() {
    for edge in [0, 1] {
        let mut bench = Bench::in_mode(1);
        bench.set("EDGE", edge);
        bench.signal(Signal::Dir, true);
        bench.signal(Signal::Step, true);
        bench.run_for(2 * SECOND);
        assert!(bench.flag("ATSPEED") && bench.velocity() > 0.0);
        bench.signal(Signal::Step, false);
        bench.run_for(2 * SECOND);
        assert_eq!(bench.standby(), edge == 1);
        bench.signal(Signal::Step, true);
        bench.run_for(2 * SECOND);
        assert_eq!(bench.standby(), edge == 0);
    }
}

#[test]
fn an_edge_in_the_other_direction_reverses_triggered_velocity() {
    let mut bench = Bench::in_mode(1);
    bench.signal(Signal::Step, true);
    bench.run_for(2 * SECOND);
    assert!(bench.velocity() < 0.0);
    bench.signal(Signal::Step, false);
    bench.signal(Signal::Dir, true);
    bench.run_for(SECOND);
    assert!(bench.velocity() < 0.0, "the direction counts at the edge");
    bench.signal(Signal::Step, true);
    bench.run_for(3 * SECOND);
    assert!(bench.flag("ATSPEED") && bench.velocity() > 0.0);
    bench.order("STOP", "");
    bench.run_until_standby();
}
