//! Motion by the inputs `EN`, `STEP` and `DIR`.

use crate::bench::{Bench, MS, SECOND};
use core::time::Duration;
use stepdrive_drive::controller::ROTOR_UNITS;
use stepdrive_motion::Direction;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

/// Handed to the inputs, and enabled.
fn handed_over(bench: &mut Bench) {
    bench.drive.step_clock(bench.now);
    bench.input(Input::En, true);
}

fn pulse(bench: &mut Bench, times: u32, period: Duration) {
    for _ in 0..times {
        bench.input(Input::Step, true);
        bench.run_for(period / 2);
        bench.input(Input::Step, false);
        bench.run_for(period / 2);
    }
}

#[test]
fn each_signal_that_comes_to_step_is_a_microstep() {
    for mode in 0..=7 {
        let mut bench = Bench::new();
        bench.write(Reg::Microstepping, mode);
        handed_over(&mut bench);
        bench.input(Input::Dir, true);
        pulse(&mut bench, 10, MS);
        assert_eq!((bench.position(), bench.drive.direction()), (10, Direction::Forward));
        assert_eq!(bench.drive.rotor(bench.now), (10 * ROTOR_UNITS) >> mode);
        bench.input(Input::Dir, false);
        pulse(&mut bench, 15, MS);
        assert_eq!((bench.position(), bench.drive.direction()), (-5, Direction::Reverse));
        assert_eq!(bench.drive.rotor(bench.now), (-5 * ROTOR_UNITS) >> mode);
        assert_eq!(bench.drive.next_wake(), None);
    }
}

#[test]
fn the_motor_counts_as_standing_and_ready() {
    let mut bench = Bench::new();
    handed_over(&mut bench);
    for _ in 0..20 {
        bench.input(Input::Step, true);
        assert_eq!(
            (bench.flags().as_str(), bench.speed()),
            ("STOP READY", 0),
            "the last direction is reverse"
        );
        bench.run_for(Duration::from_nanos(100));
        assert_eq!((bench.flags().as_str(), bench.speed()), ("STOP READY", 0));
        bench.input(Input::Step, false);
        bench.run_for(MS);
    }
    assert_eq!(bench.position(), -20);
}

#[test]
fn no_step_is_lost_when_they_come_faster_than_they_are_made() {
    let mut bench = Bench::new();
    handed_over(&mut bench);
    bench.input(Input::Dir, true);
    pulse(&mut bench, 1000, Duration::from_nanos(100));
    assert!(bench.position() < 1000);
    bench.run_for(MS);
    assert_eq!(bench.position(), 1000);
}

#[test]
fn en_energises_the_motor_and_lets_steps_count() {
    let mut bench = Bench::new();
    bench.drive.step_clock(bench.now);
    assert_eq!(bench.flags(), "HiZ STOP READY DIR");
    pulse(&mut bench, 5, MS);
    assert_eq!(bench.position(), 0);
    bench.input(Input::En, true);
    assert_eq!(bench.flags(), "STOP READY DIR");
    pulse(&mut bench, 5, MS);
    assert_eq!(bench.position(), -5);
    bench.input(Input::En, false);
    assert_eq!(bench.flags(), "HiZ STOP READY");
    pulse(&mut bench, 5, MS);
    assert_eq!(bench.position(), -5);
    bench.input(Input::En, true);
    pulse(&mut bench, 1, MS);
    assert_eq!(bench.position(), -6);
}

#[test]
fn masked_inputs_are_not_there() {
    for (mask, position) in
        [(0xFF, 3), (!Input::Step.bit(), 0), (!Input::En.bit(), 0), (!Input::Dir.bit(), -3)]
    {
        let mut bench = Bench::new();
        handed_over(&mut bench);
        bench.input(Input::Dir, true);
        bench.write(Reg::Mask, i64::from(mask));
        assert_eq!(bench.read(Reg::HiZ) == 1, mask == !Input::En.bit());
        pulse(&mut bench, 3, MS);
        assert_eq!(bench.position(), position, "{mask:02X}");
    }
}

#[test]
fn without_step_clock_the_inputs_move_nothing() {
    let mut bench = Bench::new();
    bench.command(Opcode::HardStop);
    bench.input(Input::En, true);
    pulse(&mut bench, 3, MS);
    bench.input(Input::En, false);
    assert_eq!((bench.position(), bench.flags().as_str()), (0, "STOP READY DIR"));
}

#[test]
fn a_turning_motor_is_not_handed_over() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 400);
    bench.run_for(SECOND);
    bench.drive.step_clock(bench.now);
    bench.assert_refused("STEP_CLOCK refused: the motor is turning (SPEED 400)");
    assert_eq!(bench.flags(), "CONST_SPEED READY DIR");
}

#[test]
fn commands_take_the_motor_back() {
    for opcode in
        [Opcode::SoftStop, Opcode::HardStop, Opcode::SoftHiZ, Opcode::HardHiZ, Opcode::ResetPowerstep01]
    {
        let mut bench = Bench::new();
        handed_over(&mut bench);
        pulse(&mut bench, 3, MS);
        if opcode == Opcode::ResetPowerstep01 {
            bench.trigger(Reg::ResetPowerstep01);
        } else {
            bench.command(opcode);
        }
        let (position, rotor) = (bench.position(), bench.drive.rotor(bench.now));
        assert_eq!(rotor, -3 * 16);
        pulse(&mut bench, 3, MS);
        assert_eq!((bench.position(), bench.drive.rotor(bench.now)), (position, rotor), "{opcode}");
    }
}

#[test]
fn a_motion_begins_where_the_steps_have_led() {
    let mut bench = Bench::new();
    handed_over(&mut bench);
    bench.input(Input::Dir, true);
    pulse(&mut bench, 7, MS);
    bench.order(Opcode::MoveF, 100);
    bench.run_until_ready();
    assert_eq!(bench.position(), 107);
    pulse(&mut bench, 3, MS);
    assert_eq!(bench.position(), 107);
}

#[test]
fn a_motion_in_the_middle_of_a_step_begins_before_it() {
    let mut bench = Bench::new();
    handed_over(&mut bench);
    bench.input(Input::Dir, true);
    bench.input(Input::Step, true);
    bench.run_for(Duration::from_nanos(100));
    bench.order(Opcode::MoveR, 10);
    bench.run_until_ready();
    assert_eq!((bench.position(), bench.drive.rotor(bench.now)), (-10, -10 * 16));
}

#[test]
fn limits_of_motion_do_not_slow_a_step() {
    let mut bench = Bench::new();
    handed_over(&mut bench);
    bench.input(Input::Dir, true);
    bench.input(Input::Step, true);
    for (reg, value) in [(Reg::MaxSpeed, 20), (Reg::Acc, 15), (Reg::Dec, 15)] {
        bench.write(reg, value);
    }
    bench.run_for(Duration::from_nanos(250));
    assert_eq!(bench.position(), 1);
    assert_eq!(bench.read(Reg::MaxSpeed), 20);
}

#[test]
fn a_motor_that_is_shut_down_is_not_handed_over() {
    let mut bench = Bench::new();
    bench.drive.overheat(bench.now, true);
    handed_over(&mut bench);
    bench.drive.overheat(bench.now, false);
    bench.trigger(Reg::Clr);
    pulse(&mut bench, 3, MS);
    assert_eq!((bench.position(), bench.flags().as_str()), (0, "HiZ STOP READY DIR"));
    bench.drive.step_clock(bench.now);
    pulse(&mut bench, 3, MS);
    assert_eq!((bench.position(), bench.flags().as_str()), (-3, "STOP READY"));
}

#[test]
fn handed_over_again_in_the_middle_of_a_step_it_counts_on_from_where_it_is() {
    let mut bench = Bench::new();
    handed_over(&mut bench);
    pulse(&mut bench, 2, MS);
    bench.input(Input::Step, true);
    bench.run_for(Duration::from_nanos(100));
    bench.drive.step_clock(bench.now);
    bench.input(Input::Step, false);
    bench.run_for(MS);
    assert_eq!(bench.position(), -2);
    pulse(&mut bench, 2, MS);
    assert_eq!(bench.position(), -4);
}

#[test]
fn the_protection_takes_the_motor_from_the_inputs() {
    let mut bench = Bench::new();
    handed_over(&mut bench);
    pulse(&mut bench, 3, MS);
    bench.drive.short_motor(bench.now, true);
    bench.drive.short_motor(bench.now, false);
    bench.trigger(Reg::Clr);
    pulse(&mut bench, 3, MS);
    assert_eq!((bench.position(), bench.flags().as_str()), (-3, "HiZ STOP READY"));
}
