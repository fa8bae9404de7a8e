//! Motion by instructions: the same as by `CMD` and the coils.

use super::Port;
use crate::bench::{MS, SECOND, config};
use core::time::Duration;
use stepdrive_drive::smsd::{Config, Event, Why};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Opcode, Operand};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::ring;
use stepdrive_spec::smsd::standard::{Code, Request, VERSION_1};
use stepdrive_spec::smsd::status::MotStatus;

const LONG_BRAKE: i64 = 15;

/// Turning at 400 full steps a second.
fn turning() -> Port {
    let mut port = Port::new();
    port.bench.write(Reg::Dec, LONG_BRAKE);
    port.order(Opcode::RunF, 400);
    port.bench.run_for(SECOND);
    port
}

/// What can be seen of the motion now and later.
fn course(port: &mut Port) -> Vec<String> {
    let look = |port: &mut Port| {
        let (drive, now) = (&port.bench.drive, port.bench.now);
        format!("{:?} {} {}", drive.status(now), drive.rotor(now), drive.position(now))
    };
    let mut seen = vec![look(port)];
    for step in 0..8 {
        port.bench.run_for(Duration::from_millis(1 << (2 * step)));
        if step == 4 {
            port.bench.input(Input::SetZero, true);
            port.bench.input(Input::In1, true);
            port.bench.input(Input::Sw, true);
        }
        seen.push(look(port));
    }
    seen
}

#[test]
fn every_command_that_cmd_takes_does_here_what_it_does_there() {
    for prepared in [Port::new(), turning()] {
        for info in INSTRUCTIONS.iter().filter(|info| info.in_cmd) {
            let operand: i32 = match info.operand {
                Operand::Number { .. } => 321,
                Operand::Position => -1234,
                Operand::Input => 3,
                Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => 0,
            };
            let (mut here, mut there) = (prepared.clone(), prepared.clone());
            let answer = here.order(info.opcode, operand);
            if info.operand == Operand::None {
                there.bench.command(info.opcode);
            } else {
                there.bench.order(info.opcode, operand.into());
            }
            assert_eq!(answer.status, there.bench.drive.status(there.bench.now), "{}", info.name);
            assert_eq!((answer.code, answer.data), (Code::Ok, 0), "{}", info.name);
            assert_eq!(course(&mut here), course(&mut there), "{}", info.name);
        }
    }
}

#[test]
fn the_resets_do_here_what_their_coils_do() {
    for (opcode, coil) in
        [(Opcode::ResetPos, Reg::ResetPos), (Opcode::ResetPowerstep01, Reg::ResetPowerstep01)]
    {
        let (mut here, mut there) = (turning(), turning());
        let answer = here.order(opcode, 0);
        there.bench.trigger(coil);
        assert_eq!(answer.status, there.bench.drive.status(there.bench.now));
        assert_eq!(here.snapshot(), there.snapshot(), "{opcode}");
        assert_eq!(here.bench.position(), 0);
    }
}

#[test]
fn what_the_motor_does_not_allow_is_answered_as_ever_and_sets_cmd_error() {
    for (opcode, operand) in [
        (Opcode::MoveF, 100),
        (Opcode::MoveR, 100),
        (Opcode::SetMode, 133_250),
        (Opcode::SetMinSpeed, 100),
        (Opcode::SetAcc, 500),
        (Opcode::SetDec, 500),
        (Opcode::StepClock, 0),
    ] {
        let mut port = turning();
        let answer = port.order(opcode, operand);
        assert_eq!((answer.code, answer.data), (Code::Ok, 0), "{opcode}");
        assert!(answer.status.cmd_error && answer.status.motion == MotStatus::ConstantSpeed, "{opcode}");
        let Some(Event::Refused(refusal)) = port.bench.drive.poll_event() else { panic!("{opcode}") };
        assert_eq!((refusal.opcode, refusal.place), (Some(opcode), None));
        assert!(matches!(refusal.why, Why::Turning(400) | Why::Energised), "{refusal}");
        port.bench.trigger(Reg::Clr);
        let after = port.bench.drive.clone();
        let untouched = turning().bench.drive;
        for reg in [Reg::MinSpeed, Reg::Acc, Reg::Dec, Reg::Microstepping] {
            assert_eq!(port.bench.read(reg), turning().bench.read(reg), "{opcode}");
        }
        assert_eq!(after.rotor(port.bench.now), untouched.rotor(port.bench.now), "{opcode}");
    }
}

#[test]
fn go_to_waits_for_ready() {
    for opcode in [Opcode::GoTo, Opcode::GoToF, Opcode::GoToR, Opcode::GoZero, Opcode::GoMark] {
        let mut port = Port::new();
        port.order(Opcode::MoveF, 5000);
        port.bench.run_for(SECOND / 10);
        let answer = port.order(opcode, 7);
        assert_eq!(answer.code, Code::Ok);
        assert!(answer.status.cmd_error && !answer.status.ready, "{opcode}");
        port.bench.run_until_ready();
        assert_eq!(port.bench.position(), 5000, "{opcode}");
    }
}

#[test]
fn an_operand_out_of_range_is_refused_in_every_state_and_changes_nothing() {
    let wrong = [
        (Opcode::RunF, 14),
        (Opcode::RunR, 15_601),
        (Opcode::RunR, 2_000_000),
        (Opcode::ScanZeroF, 14),
        (Opcode::ScanZeroR, 0),
        (Opcode::ScanMarkF, 15_601),
        (Opcode::ScanMarkR, 14),
        (Opcode::ScanMark2F, 14),
        (Opcode::ScanMark2R, 70_000),
        (Opcode::GoUntilF, 8),
        (Opcode::GoUntilR, 1 << 20),
        (Opcode::SetMinSpeed, 951),
        (Opcode::SetMaxSpeed, 15),
        (Opcode::SetMaxSpeed, 15_601),
        (Opcode::SetAcc, 14),
        (Opcode::SetAcc, 59_001),
        (Opcode::SetDec, 14),
        (Opcode::SetDec, 59_001),
        (Opcode::SetFsSpeed, 14),
        (Opcode::SetFsSpeed, 15_601),
        (Opcode::SetWait, 3_600_001),
        (Opcode::SetWait2, 3_600_001),
        // A motor that the SMSD-4.2LAN does not have, no current at all, and more than it gives.
        (Opcode::SetMode, 1 | 46 << 1 | 10 << 10),
        (Opcode::SetMode, 1),
        (Opcode::SetMode, 1 | 43 << 10),
    ];
    for mut port in [Port::new(), turning()] {
        for (opcode, operand) in wrong {
            port.assert_refused(&Request::Command(super::word(opcode, operand)), Code::ErrorRange);
        }
        assert!(!port.bench.cmd_error());
        assert_eq!(port.bench.drive.poll_event(), None);
    }
}

#[test]
fn positions_reach_from_one_end_of_the_ring_to_the_other() {
    for target in [ring::MIN, -1, 0, 1, ring::MAX] {
        let mut port = Port::new();
        port.bench.write(Reg::MaxSpeed, 15_600);
        assert_eq!(port.order(Opcode::GoTo, target).code, Code::Ok);
        port.bench.run_until_ready();
        assert_eq!(port.get(Opcode::GetAbsPos).cast_signed(), target);
        assert_eq!(port.bench.position(), i64::from(target));
    }
}

#[test]
fn version_1_does_not_know_the_instructions_that_came_with_version_2() {
    let mut port = Port::with(Config { protocol_version: VERSION_1, ..config(Model::Smsd42) });
    for code in 0x3A..=0x3F_u32 {
        port.assert_refused(&Request::Command(code << 4 | 100 << 10), Code::ErrorNoCommand);
    }
    assert_eq!(port.order(Opcode::GotoProgramIfZero, 0).code, Code::Ok);
    port.bench.order(Opcode::ScanMark2F, 100);
    port.bench.run_for(SECOND);
    assert_eq!(port.bench.speed(), 100, "Modbus knows them all the same");
}

#[test]
fn step_clock_hands_the_motor_to_the_inputs() {
    let mut port = Port::new();
    port.bench.input(Input::En, true);
    let answer = port.order(Opcode::StepClock, 0);
    assert!(answer.status.ready && !answer.status.hi_z && !answer.status.cmd_error);
    port.bench.input(Input::Dir, true);
    for _ in 0..5 {
        port.bench.input(Input::Step, true);
        port.bench.run_for(MS);
        port.bench.input(Input::Step, false);
        port.bench.run_for(MS);
    }
    assert_eq!(port.get(Opcode::GetAbsPos), 5);
    port.order(Opcode::HardStop, 0);
    port.bench.input(Input::Step, true);
    port.bench.run_for(MS);
    assert_eq!(port.get(Opcode::GetAbsPos), 5);
}
