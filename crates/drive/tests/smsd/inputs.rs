//! Signals: motion that waits for one, the mask, `Wait`, and the SW flags.

use crate::bench::{Bench, MS, SECOND, assert_takes, config};
use core::time::Duration;
use stepdrive_drive::smsd::Memory;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Opcode, Operand};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::powerstep01 as scale;
use stepdrive_spec::smsd::registers::Reg;

/// Every seeking command, the input it waits for here, and whether it goes forward.
const SEEKS: [(Opcode, Input, bool); 8] = [
    (Opcode::GoUntilF, Input::In0, true),
    (Opcode::GoUntilR, Input::In0, false),
    (Opcode::ScanZeroF, Input::SetZero, true),
    (Opcode::ScanZeroR, Input::SetZero, false),
    (Opcode::ScanMarkF, Input::In1, true),
    (Opcode::ScanMarkR, Input::In1, false),
    (Opcode::ScanMark2F, Input::In1, true),
    (Opcode::ScanMark2R, Input::In1, false),
];

const SPEED: i64 = 500;

/// Begins a seek at [`SPEED`], or at `MAX_SPEED` where the command says so.
fn seek(bench: &mut Bench, opcode: Opcode) {
    let operand = if opcode.info().operand == Operand::Input { 0 } else { SPEED };
    bench.order(opcode, operand);
}

/// A controller that has sought for two seconds.
fn seeking(opcode: Opcode) -> Bench {
    let mut bench = Bench::new();
    seek(&mut bench, opcode);
    bench.run_for(2 * SECOND);
    bench
}

fn brakes(opcode: Opcode) -> bool {
    matches!(opcode, Opcode::GoUntilF | Opcode::GoUntilR | Opcode::ScanMark2F | Opcode::ScanMark2R)
}

#[test]
fn a_seek_turns_until_its_signal_and_is_not_ready_before() {
    for (opcode, _, forward) in SEEKS {
        let mut bench = seeking(opcode);
        let dir = if forward { " DIR" } else { "" };
        assert_eq!(bench.flags(), format!("CONST_SPEED{dir}"), "{opcode}");
        let max_speed = matches!(opcode, Opcode::GoUntilF | Opcode::GoUntilR);
        assert_eq!(bench.speed(), if max_speed { 1007 } else { SPEED }, "{opcode}");
        bench.run_for(60 * SECOND);
        assert_eq!(bench.flags(), format!("CONST_SPEED{dir}"), "{opcode}");
    }
}

#[test]
fn at_its_signal_a_seek_stops_abruptly_or_brakes() {
    for (opcode, input, forward) in SEEKS {
        let mut bench = seeking(opcode);
        let dir = if forward { " DIR" } else { "" };
        let speed = bench.drive.speed(bench.now);
        bench.input(input, true);
        if brakes(opcode) {
            assert_eq!(bench.flags(), format!("DEC{dir}"), "{opcode}");
            assert_takes(bench.run_until_ready(), speed / scale::ACCELERATION.round(1000.0));
        }
        assert_eq!(bench.flags(), format!("STOP READY{dir}"), "{opcode}");
    }
}

#[test]
fn go_until_waits_for_the_input_that_target_input_names() {
    for input in Input::ALL {
        let mut bench = Bench::new();
        bench.order(Opcode::GoUntilF, input.number().into());
        bench.run_for(SECOND / 10);
        assert_eq!(bench.read(Reg::Wait), i64::from(input.bit()));
        for other in Input::ALL.into_iter().filter(|other| *other != input) {
            bench.input(other, true);
        }
        assert_eq!(bench.read(Reg::AccFlag), 1, "{input}");
        bench.input(input, true);
        assert_eq!(bench.read(Reg::DecFlag), 1, "{input}");
    }
}

#[test]
fn scan_zero_takes_the_position_at_the_signal_as_zero() {
    for opcode in [Opcode::ScanZeroF, Opcode::ScanZeroR] {
        let mut bench = seeking(opcode);
        assert_ne!(bench.position(), 0);
        bench.input(Input::SetZero, true);
        bench.run_for(SECOND);
        assert_eq!(bench.position(), 0);
    }
}

#[test]
fn scan_mark_remembers_the_position_at_the_signal_and_stands_there() {
    for opcode in [Opcode::ScanMarkF, Opcode::ScanMarkR] {
        let mut bench = seeking(opcode);
        let signal = bench.position();
        bench.input(Input::In1, true);
        bench.run_for(SECOND);
        assert_eq!(bench.position(), signal);
        bench.command(Opcode::GoZero);
        bench.run_until_ready();
        bench.command(Opcode::GoMark);
        bench.run_until_ready();
        assert_eq!(bench.position(), signal);
    }
}

#[test]
fn scan_mark2_remembers_the_position_at_the_signal_and_stands_behind_it() {
    for opcode in [Opcode::ScanMark2F, Opcode::ScanMark2R] {
        let mut bench = seeking(opcode);
        let signal = bench.position();
        bench.input(Input::In1, true);
        bench.run_until_ready();
        assert!((bench.position() - signal).abs() > 1000, "{opcode} brakes over 125 full steps");
        bench.command(Opcode::GoMark);
        bench.run_until_ready();
        assert_eq!(bench.position(), signal);
    }
}

#[test]
fn a_signal_while_it_still_accelerates_ends_a_seek_too() {
    for (opcode, input, _) in SEEKS {
        let mut bench = Bench::new();
        seek(&mut bench, opcode);
        bench.run_for(100 * MS);
        bench.input(input, true);
        bench.run_until_ready();
        assert_eq!(bench.read(Reg::Stop), 1, "{opcode}");
    }
}

#[test]
fn a_signal_that_is_there_already_keeps_the_motor_from_starting() {
    for (opcode, input, _) in SEEKS {
        let mut bench = Bench::new();
        bench.order(Opcode::MoveF, 300);
        bench.run_until_ready();
        bench.command(Opcode::HardHiZ);
        bench.input(input, true);
        seek(&mut bench, opcode);
        assert_eq!(bench.flags(), "STOP READY DIR", "{opcode} energises and is done");
        let zeroes = matches!(opcode, Opcode::ScanZeroF | Opcode::ScanZeroR);
        assert_eq!(bench.position(), if zeroes { 0 } else { 300 }, "{opcode}");
        bench.order(Opcode::MoveF, 100);
        bench.run_until_ready();
        bench.command(Opcode::GoMark);
        bench.run_until_ready();
        assert_eq!(bench.position(), if input == Input::In1 { 300 } else { 0 }, "mark of {opcode}");
        assert_eq!(bench.drive.poll_event(), None);
    }
}

#[test]
fn a_signal_that_is_there_already_ends_a_run_as_its_arrival_would() {
    for (opcode, input, _) in SEEKS {
        let mut bench = Bench::new();
        bench.order(Opcode::RunF, 500);
        bench.run_until_ready();
        bench.input(input, true);
        seek(&mut bench, opcode);
        assert_eq!(bench.flags(), if brakes(opcode) { "DEC DIR" } else { "STOP READY DIR" }, "{opcode}");
    }
}

#[test]
fn a_masked_input_never_comes() {
    for (opcode, input, _) in SEEKS {
        let mut bench = Bench::new();
        bench.write(Reg::Mask, i64::from(!input.bit()));
        bench.input(input, true);
        seek(&mut bench, opcode);
        bench.run_for(10 * SECOND);
        bench.input(input, false);
        bench.input(input, true);
        bench.run_for(10 * SECOND);
        assert_eq!(bench.read(Reg::ConstSpeed), 1, "{opcode}");
        assert_eq!(bench.read(Reg::Inputs), i64::from(input.bit()), "Inputs shows the level all the same");
        assert_eq!(bench.read(Reg::Wait), i64::from(input.bit()));
    }
}

#[test]
fn unmasking_a_signal_that_is_there_lets_it_come_at_once() {
    for (opcode, input, _) in SEEKS {
        let mut bench = Bench::new();
        bench.write(Reg::Mask, 0);
        bench.input(input, true);
        seek(&mut bench, opcode);
        bench.run_for(2 * SECOND);
        bench.write(Reg::Mask, i64::from(input.bit()));
        bench.run_until_ready();
        assert_eq!((bench.read(Reg::Stop), bench.read(Reg::Wait)), (1, 0), "{opcode}");
    }
}

#[test]
fn wait_shows_the_input_until_its_signal_has_come() {
    for (opcode, input, _) in SEEKS {
        let mut bench = seeking(opcode);
        assert_eq!(bench.read(Reg::Wait), i64::from(input.bit()), "{opcode}");
        bench.input(input, true);
        assert_eq!(bench.read(Reg::Wait), 0, "{opcode}");
    }
}

#[test]
fn a_signal_that_has_gone_again_has_no_further_effect() {
    for (opcode, input, _) in SEEKS {
        let mut bench = seeking(opcode);
        bench.input(input, true);
        bench.input(input, false);
        bench.run_until_ready();
        let position = bench.position();
        bench.input(input, true);
        assert_eq!((bench.position(), bench.read(Reg::Stop)), (position, 1), "{opcode}");
    }
}

#[test]
fn a_signal_without_a_seek_does_nothing() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    bench.run_until_ready();
    for input in Input::ALL.into_iter().filter(|input| *input != Input::Sw) {
        bench.input(input, true);
        assert_eq!(bench.flags(), "CONST_SPEED READY DIR", "{input}");
    }
}

#[test]
fn a_run_takes_over_from_a_seek() {
    for (opcode, input, _) in SEEKS {
        let mut bench = seeking(opcode);
        bench.order(Opcode::RunF, 200);
        assert_eq!(bench.read(Reg::Wait), 0);
        bench.input(input, true);
        bench.run_until_ready();
        assert_eq!(bench.flags(), "CONST_SPEED READY DIR", "{opcode}");
    }
}

#[test]
fn a_seek_takes_over_from_another() {
    let mut bench = seeking(Opcode::ScanZeroF);
    bench.order(Opcode::ScanMarkR, 300);
    assert_eq!((bench.read(Reg::Wait), bench.flags().as_str()), (2, "DEC DIR"));
    bench.run_for(3 * SECOND);
    bench.input(Input::SetZero, true);
    assert_eq!(bench.flags(), "CONST_SPEED");
    bench.input(Input::In1, true);
    assert_eq!(bench.flags(), "STOP READY");
}

#[test]
fn moves_and_positioning_are_refused_while_it_seeks() {
    for (opcode, _, _) in SEEKS {
        let mut bench = seeking(opcode);
        bench.command(Opcode::MoveF);
        bench.assert_refused("turning");
        bench.command(Opcode::GoZero);
        bench.assert_refused("READY is 0");
        assert_eq!(bench.read(Reg::ConstSpeed), 1);
    }
}

#[test]
fn inputs_shows_every_level() {
    let mut bench = Bench::new();
    for input in Input::ALL {
        bench.input(input, true);
        assert_eq!(bench.read(Reg::Inputs), i64::from(input.bit()), "{input}");
        bench.input(input, false);
    }
    assert_eq!(bench.read(Reg::Inputs), 0);
}

#[test]
fn the_sw_contact_shows_as_it_is_and_its_closing_is_latched() {
    let mut bench = Bench::new();
    bench.input(Input::Sw, true);
    assert_eq!(bench.flags(), "HiZ STOP READY SW_F SW_EVN DIR");
    bench.input(Input::Sw, false);
    assert_eq!(bench.flags(), "HiZ STOP READY SW_EVN DIR");
    bench.trigger(Reg::Clr);
    assert_eq!(bench.flags(), "HiZ STOP READY DIR");
}

#[test]
fn a_contact_that_stays_closed_makes_no_second_event() {
    let mut bench = Bench::new();
    bench.input(Input::Sw, true);
    bench.trigger(Reg::Clr);
    bench.input(Input::Sw, true);
    assert_eq!(bench.flags(), "HiZ STOP READY SW_F DIR");
    bench.input(Input::Sw, false);
    bench.input(Input::Sw, true);
    assert_eq!(bench.flags(), "HiZ STOP READY SW_F SW_EVN DIR");
}

#[test]
fn a_contact_closed_at_power_up_is_no_event() {
    let mut bench = Bench::with(config(Model::Smsd42), Memory::factory(), Input::Sw.bit());
    assert_eq!(bench.flags(), "HiZ STOP READY SW_F DIR");
}

#[test]
fn the_sw_contact_stops_nothing_by_itself() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    bench.run_until_ready();
    bench.input(Input::Sw, true);
    assert_eq!(bench.flags(), "CONST_SPEED READY SW_F SW_EVN DIR");
}

#[test]
fn clr_clears_both_latched_flags_and_no_others() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    bench.run_until_ready();
    bench.command(Opcode::MoveF);
    bench.input(Input::Sw, true);
    assert_eq!(bench.flags(), "CONST_SPEED READY SW_F SW_EVN DIR CMD_ERROR");
    bench.run_for(Duration::from_secs(1));
    bench.trigger(Reg::Clr);
    assert_eq!(bench.flags(), "CONST_SPEED READY SW_F DIR");
}
