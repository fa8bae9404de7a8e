//! The motor chip's protection: a short circuit and too much heat shut the bridges down.

use crate::bench::{Bench, MS, SECOND, end, line, plain};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

/// Something that shuts the bridges down.
type Trouble = fn(&mut Bench, bool);

const SHORT: Trouble = |bench, on| bench.drive.short_motor(bench.now, on);
const HEAT: Trouble = |bench, on| bench.drive.overheat(bench.now, on);

const SHUT_DOWN: &str = "HiZ STOP READY DIR";

#[test]
fn a_turning_motor_is_in_hiz_at_once_and_the_position_keeps_its_number() {
    for trouble in [SHORT, HEAT] {
        let mut bench = Bench::new();
        bench.order(Opcode::RunF, 400);
        bench.run_for(SECOND);
        let (position, rotor) = (bench.position(), bench.drive.rotor(bench.now));
        trouble(&mut bench, true);
        assert_eq!((bench.flags().as_str(), bench.speed()), (SHUT_DOWN, 0));
        assert_eq!(bench.drive.next_wake(), None);
        bench.run_for(SECOND);
        assert_eq!((bench.position(), bench.drive.rotor(bench.now)), (position, rotor));
        assert!(position > 0);
    }
}

#[test]
fn a_holding_motor_is_in_hiz_at_once() {
    for trouble in [SHORT, HEAT] {
        let mut bench = Bench::new();
        bench.command(Opcode::HardStop);
        assert_eq!(bench.flags(), "STOP READY DIR");
        trouble(&mut bench, true);
        assert_eq!(bench.flags(), SHUT_DOWN);
    }
}

#[test]
fn what_would_energise_the_motor_is_taken_and_over_at_once() {
    for trouble in [SHORT, HEAT] {
        for opcode in [
            Opcode::RunF,
            Opcode::MoveF,
            Opcode::GoTo,
            Opcode::GoUntilF,
            Opcode::ScanZeroF,
            Opcode::ScanMark2F,
            Opcode::SoftStop,
            Opcode::HardStop,
            Opcode::SoftHiZ,
            Opcode::HardHiZ,
        ] {
            let mut bench = Bench::new();
            bench.write(Reg::TargetPos, 1000);
            bench.write(Reg::TargetSpeed, 100);
            trouble(&mut bench, true);
            bench.command(opcode);
            assert_eq!((bench.flags().as_str(), bench.read(Reg::Wait)), (SHUT_DOWN, 0), "{opcode}");
            bench.run_for(SECOND);
            assert_eq!((bench.position(), bench.drive.rotor(bench.now)), (0, 0), "{opcode}");
        }
    }
}

#[test]
fn a_motion_that_waits_for_a_signal_is_over() {
    for trouble in [SHORT, HEAT] {
        let mut bench = Bench::new();
        bench.order(Opcode::GoUntilF, 0);
        bench.run_for(SECOND);
        assert_eq!(bench.read(Reg::Wait), 1);
        trouble(&mut bench, true);
        let position = bench.position();
        assert_eq!((bench.flags().as_str(), bench.read(Reg::Wait)), (SHUT_DOWN, 0));
        bench.input(Input::In0, true);
        assert_eq!((bench.flags().as_str(), bench.position()), (SHUT_DOWN, position));
    }
}

#[test]
fn a_scan_whose_signal_is_there_already_still_takes_zero() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveF, 100);
    bench.run_until_ready();
    SHORT(&mut bench, true);
    assert_eq!(bench.position(), 100);
    bench.input(Input::SetZero, true);
    bench.order(Opcode::ScanZeroF, 100);
    assert_eq!((bench.flags().as_str(), bench.position()), (SHUT_DOWN, 0));
}

#[test]
fn a_program_that_waits_for_ready_goes_on() {
    let program: [Instruction; 4] =
        [line(Opcode::MoveF, 100_000), line(Opcode::MoveF, 100_000), plain(Opcode::SetRele), end()];
    for trouble in [SHORT, HEAT] {
        let mut bench = Bench::new();
        bench.start(&program);
        bench.run_for(SECOND);
        assert_eq!(bench.place(), (0, 0));
        trouble(&mut bench, true);
        let took = bench.run_until_ended();
        assert_eq!(took, 2 * MS, "the two lines after the first move, and END at once");
        assert!(bench.drive.relay() && !bench.cmd_error());
        assert!(bench.position() < 100_000);
    }
}

#[test]
fn the_bridges_stay_shut_down_until_clr() {
    for trouble in [SHORT, HEAT] {
        for clears in [Reg::Clr, Reg::ResetPowerstep01] {
            let mut bench = Bench::new();
            bench.order(Opcode::RunF, 400);
            trouble(&mut bench, true);
            trouble(&mut bench, false);
            bench.order(Opcode::RunF, 400);
            assert_eq!(bench.flags(), SHUT_DOWN);
            bench.trigger(clears);
            assert_eq!(bench.flags(), SHUT_DOWN, "it does not start anything");
            bench.order(Opcode::RunF, 400);
            assert_eq!(bench.flags(), "ACC DIR");
        }
    }
}

#[test]
fn clr_does_not_help_while_the_trouble_is_there() {
    for trouble in [SHORT, HEAT] {
        for clears in [Reg::Clr, Reg::ResetPowerstep01] {
            let mut bench = Bench::new();
            bench.order(Opcode::RunF, 400);
            trouble(&mut bench, true);
            for _ in 0..2 {
                bench.trigger(clears);
                bench.order(Opcode::RunF, 400);
                assert_eq!(bench.flags(), SHUT_DOWN);
            }
        }
    }
}

#[test]
fn a_short_circuit_shows_only_under_current_and_heat_always() {
    for (trouble, shut_down) in [(SHORT, false), (HEAT, true)] {
        let mut bench = Bench::new();
        trouble(&mut bench, true);
        assert_eq!(bench.flags(), SHUT_DOWN, "as at power-up");
        trouble(&mut bench, false);
        bench.order(Opcode::RunF, 400);
        assert_eq!(bench.flags() == SHUT_DOWN, shut_down);
    }
}

#[test]
fn trouble_outlasts_a_power_cycle_and_what_it_shut_down_does_not() {
    for trouble in [SHORT, HEAT] {
        let cycle = |bench: &mut Bench| {
            bench.drive.switch_off(bench.now);
            bench.drive.switch_on(bench.now, 0);
            bench.order(Opcode::RunF, 400);
        };
        let mut bench = Bench::new();
        bench.order(Opcode::RunF, 400);
        trouble(&mut bench, true);
        cycle(&mut bench);
        assert_eq!(bench.flags(), SHUT_DOWN);
        trouble(&mut bench, false);
        cycle(&mut bench);
        assert_eq!(bench.flags(), "ACC DIR");
    }
}

#[test]
fn trouble_may_come_and_go_while_the_controller_is_off() {
    for trouble in [SHORT, HEAT] {
        let mut bench = Bench::new();
        bench.drive.switch_off(bench.now);
        trouble(&mut bench, true);
        trouble(&mut bench, false);
        bench.drive.switch_on(bench.now, 0);
        bench.order(Opcode::RunF, 400);
        assert_eq!(bench.flags(), "ACC DIR");
    }
}
