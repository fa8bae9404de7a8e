//! Instructions that answer, set, or belong into programs.

use super::{Port, word};
use crate::bench::{Bench, MS, SECOND, config, line, plain};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Opcode, Operand};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, Reply, Request};

/// The codes of the answers from 0x00 on, as the sheet of facts has them; 0x2E, `RETURN_PROGRAM`, is an error.
const CODES: [u8; 63] = [
    13, 18, 14, 0, 15, 0, 0, 0, 0, 0, 0, 16, 17, 0, 0, 0, // 00
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // 10
    0, 0, 0, 0, 22, 23, 23, 0, 0, 0, 0, 0, 0, 0, 10, 0, // 20
    0, 0, 0, 0, 0, 13, 19, 20, 21, 0, 0, 0, 0, 0, 0, // 30
];

/// Current control, motor 30, 1/16, 1.0 A, 25 %.
const MODE: i32 = 10_813;

/// A value that the instruction takes.
fn operand(operand: Operand) -> i32 {
    match operand {
        Operand::Number { max, .. } => max.cast_signed(),
        Operand::Mode => 133_250,
        Operand::Mask => 0xFF,
        Operand::None | Operand::Position | Operand::Input | Operand::Jump | Operand::Loop => 1,
    }
}

#[test]
fn every_instruction_is_answered_with_its_code() {
    for (info, expected) in INSTRUCTIONS.iter().zip(CODES) {
        let mut port = Port::new();
        let reply = port.reply(&Request::Command(word(info.opcode, operand(info.operand))));
        let (Reply::Powerstep01(answer) | Reply::Response(answer)) = reply else {
            panic!("{} was answered {reply:?}", info.name)
        };
        assert_eq!(answer.code.number(), expected, "{}", info.name);
        assert_eq!(matches!(reply, Reply::Response(_)), expected == 10, "{}", info.name);
        assert!(!port.bench.cmd_error(), "{}", info.name);
    }
}

#[test]
fn data_of_an_instruction_without_operand_is_ignored() {
    for info in INSTRUCTIONS.iter().filter(|info| info.operand == Operand::None) {
        let (mut bare, mut loaded) = (Port::new(), Port::new());
        let expected = bare.reply(&Request::Command(word(info.opcode, 0)));
        assert_eq!(loaded.reply(&Request::Command(word(info.opcode, -1))), expected, "{}", info.name);
        let after = (bare.snapshot(), loaded.snapshot());
        assert_eq!(after.0, after.1, "{}", info.name);
    }
}

#[test]
fn an_unknown_instruction_and_reserved_bits_are_refused() {
    let mut port = Port::new();
    port.assert_refused(&Request::Command(0x3F0), Code::ErrorNoCommand);
    port.assert_refused(&Request::Command(0xFFFF_FFF0), Code::ErrorNoCommand);
    for bits in 1..16 {
        let stop = word(Opcode::HardStop, 0) | bits;
        port.assert_refused(&Request::Command(stop), Code::ErrorRange);
    }
}

#[test]
fn settings_are_read_by_modbus_and_answered() {
    let settings = [
        (Opcode::SetMinSpeed, Reg::MinSpeed, [0, 950]),
        (Opcode::SetMaxSpeed, Reg::MaxSpeed, [16, 15_600]),
        (Opcode::SetAcc, Reg::Acc, [15, 59_000]),
        (Opcode::SetDec, Reg::Dec, [15, 59_000]),
        (Opcode::SetFsSpeed, Reg::FsSpeed, [15, 15_600]),
        (Opcode::SetMaskEvent, Reg::Mask, [0, 0xA5]),
    ];
    let mut port = Port::new();
    for (opcode, reg, values) in settings {
        for value in values {
            port.order(opcode, value);
            assert_eq!(port.bench.read(reg), i64::from(value), "{opcode}");
        }
    }
    assert_eq!((port.get(Opcode::GetMinSpeed), port.get(Opcode::GetMaxSpeed)), (950, 15_600));
    port.bench.write(Reg::MinSpeed, 12);
    port.bench.write(Reg::MaxSpeed, 345);
    assert_eq!((port.get(Opcode::GetMinSpeed), port.get(Opcode::GetMaxSpeed)), (12, 345));
}

#[test]
fn the_motor_configuration_is_set_and_answered_and_both_protocols_see_it() {
    let registers =
        [Reg::CurrentOrVoltage, Reg::MotorType, Reg::Microstepping, Reg::WorkCurrent, Reg::StopCurrent];
    let mut port = Port::new();
    port.order(Opcode::SetMode, MODE);
    assert_eq!(registers.map(|reg| port.bench.read(reg)), [1, 30, 4, 10, 0]);
    assert_eq!(port.get(Opcode::GetMode).cast_signed(), MODE);
    port.bench.write(Reg::Microstepping, 7);
    port.bench.write(Reg::StopCurrent, 3);
    assert_eq!(port.get(Opcode::GetMode), 1 | 30 << 1 | 7 << 7 | 10 << 10 | 3 << 17);
}

#[test]
fn get_mode_carries_the_program_of_the_front_panel_and_set_mode_ignores_it() {
    let mut port = Port::new();
    port.bench.drive.set_panel(false, Some(2));
    let mode = port.get(Opcode::GetMode);
    assert_eq!(mode >> 19, 2);
    port.order(Opcode::SetMode, MODE + (7 << 19) - (1 << 22));
    assert_eq!(port.get(Opcode::GetMode), (2 << 19) + MODE.cast_unsigned());
    assert_eq!(port.bench.read(Reg::ModeNPrograms), 2);
}

#[test]
fn set_mode_goes_by_the_model() {
    let larger = 1 | 54 << 1 | 80 << 10;
    let mut port = Port::with(config(Model::Smsd80));
    assert_eq!(port.order(Opcode::SetMode, larger).code, Code::Ok);
    assert_eq!(port.bench.read(Reg::MotorType), 54);
    Port::new().assert_refused(&Request::Command(word(Opcode::SetMode, larger)), Code::ErrorRange);
}

#[test]
fn the_relay_is_set_answered_and_seen() {
    let mut port = Port::new();
    assert_eq!(port.order(Opcode::GetRele, 0).code, Code::StatusReleClr);
    assert_eq!(port.order(Opcode::SetRele, 0).code, Code::StatusReleSet);
    assert_eq!(port.bench.read(Reg::Relay), 1);
    assert_eq!(port.order(Opcode::GetRele, 0).code, Code::StatusReleSet);
    port.bench.write(Reg::Relay, 0);
    assert_eq!(port.order(Opcode::GetRele, 0).code, Code::StatusReleClr);
    port.bench.write(Reg::Relay, 1);
    assert_eq!(port.order(Opcode::ClrRele, 0).code, Code::StatusReleClr);
    assert_eq!(port.bench.read(Reg::Relay), 0);
}

#[test]
fn what_is_asked_for_while_the_motor_turns_is_what_the_registers_say() {
    let mut port = Port::new();
    port.order(Opcode::RunR, 333);
    for _ in 0..20 {
        port.bench.run_for(37 * MS);
        for (opcode, reg) in [(Opcode::GetSpeed, Reg::Speed), (Opcode::GetElPos, Reg::ElPos)] {
            assert_eq!(i64::from(port.get(opcode)), port.bench.read(reg));
        }
        let position = port.get(Opcode::GetAbsPos).cast_signed();
        assert!(position < 0);
        assert_eq!(i64::from(position), port.bench.position());
        let status = port.order(Opcode::GetSpeed, 0).status;
        assert_eq!(i64::from(status.word()), port.bench.read(Reg::StatusWord));
    }
}

#[test]
fn inputs_mask_and_waiting_come_in_one_value() {
    let mut port = Port::new();
    assert_eq!(port.get(Opcode::StatusInEvent), 0x0000_FF00);
    port.bench.input(Input::In0, true);
    port.bench.input(Input::Continue, true);
    port.order(Opcode::SetMaskEvent, 0x7E);
    port.order(Opcode::ScanZeroF, 100);
    assert_eq!(port.get(Opcode::StatusInEvent), 0x0004_7E81);
    port.bench.store(0, &[plain(Opcode::WaitIn1)]);
    port.order(Opcode::StartProgramMem0, 0);
    port.bench.settle();
    assert_eq!(port.get(Opcode::StatusInEvent), 0x0006_7E81);
}

#[test]
fn get_status_and_clr_answers_the_flags_and_then_clears_them() {
    let mut port = Port::new();
    port.bench.input(Input::Sw, true);
    port.bench.input(Input::Sw, false);
    port.order(Opcode::RunF, 100);
    port.order(Opcode::MoveF, 100);
    let answer = port.order(Opcode::GetStatusAndClr, 0);
    assert!(answer.status.cmd_error && answer.status.sw_evn);
    assert_eq!((answer.code, answer.data), (Code::Ok, 0));
    assert_eq!((port.bench.read(Reg::CmdError), port.bench.read(Reg::SwEvn)), (0, 0));
    let answer = port.order(Opcode::GetStatusAndClr, 0);
    assert!(!answer.status.cmd_error && !answer.status.sw_evn);
}

#[test]
fn get_status_and_clr_lets_bridges_that_were_shut_down_be_used_again() {
    let mut port = Port::new();
    port.bench.drive.overheat(port.bench.now, true);
    port.bench.drive.overheat(port.bench.now, false);
    assert!(port.order(Opcode::HardStop, 0).status.hi_z);
    port.order(Opcode::GetStatusAndClr, 0);
    assert!(!port.order(Opcode::HardStop, 0).status.hi_z);
}

#[test]
fn the_stack_is_the_memory_area_and_line_of_the_program() {
    let mut port = Port::new();
    port.bench.store(2, &[line(Opcode::SetWait, 10), line(Opcode::SetWait, 10), line(Opcode::SetWait, 10)]);
    port.order(Opcode::StartProgramMem2, 0);
    for expected in [0x200, 0x201, 0x202, 0x203] {
        port.bench.settle();
        assert_eq!(port.get(Opcode::GetStack), expected);
        port.bench.run_for(10 * MS);
    }
}

#[test]
fn a_line_past_the_end_stays_within_its_bits_of_the_stack() {
    let mut port = Port::new();
    port.bench.store(1, &[line(Opcode::LoopProgram, 0x3FF)]);
    port.order(Opcode::StartProgramMem1, 0);
    port.bench.run_until_ended();
    assert_eq!(port.get(Opcode::GetStack), 0x1FF);
}

#[test]
fn what_belongs_into_programs_has_no_effect_whether_or_not_one_runs() {
    let without_effect = [0x00, 0x23, 0x27, 0x28, 0x29, 0x2A, 0x2B, 0x2C, 0x2D, 0x39, 0x3A, 0x3B, 0x3C];
    let idle = Port::new();
    let mut running = Port::new();
    running.bench.store(0, &[line(Opcode::SetWait, 1000), plain(Opcode::SetRele)]);
    running.order(Opcode::StartProgramMem0, 0);
    running.bench.settle();
    for mut port in [idle, running] {
        let before = port.snapshot();
        for code in without_effect {
            let opcode = Opcode::from_code(code).expect("listed");
            port.order(opcode, 3);
            assert_eq!(port.snapshot(), before, "{opcode}");
        }
        port.assert_refused(&Request::Command(word(Opcode::ReturnProgram, 0)), Code::ErrorPrograms);
    }
}

#[test]
fn a_program_is_started_and_stopped() {
    for (area, start) in (0..).zip(0x2F..=0x32) {
        let mut port = Port::new();
        port.bench.store(area, &[line(Opcode::RunF, 200), line(Opcode::SetWait, 60_000)]);
        port.order(Opcode::from_code(start).expect("listed"), 0);
        port.bench.run_for(SECOND);
        assert!(port.bench.program_runs());
        assert_eq!(port.bench.place(), (i64::from(area), 1));
        let answer = port.order(Opcode::StopProgramMem, 0);
        assert_eq!(answer.code, Code::Ok);
        assert!(!port.bench.program_runs());
        assert_eq!(port.bench.speed(), 200);
    }
}

#[test]
fn an_instruction_while_a_program_runs_is_carried_out_and_the_program_goes_on() {
    let mut port = Port::new();
    port.bench.store(0, &[line(Opcode::SetWait, 100), plain(Opcode::SetRele)]);
    port.order(Opcode::StartProgramMem0, 0);
    port.order(Opcode::SetMaxSpeed, 77);
    port.order(Opcode::End, 0);
    port.bench.run_for(SECOND);
    assert!(port.bench.drive.relay());
    assert_eq!(port.bench.read(Reg::MaxSpeed), 77);
}

#[test]
fn uncovering_an_input_lets_the_program_go_on_that_waits_for_it() {
    let mut port = Port::new();
    port.order(Opcode::SetMaskEvent, 0);
    port.bench.input(Input::In0, true);
    port.bench.start(&[plain(Opcode::WaitIn0), plain(Opcode::SetRele)]);
    port.bench.run_for(SECOND);
    assert!(!port.bench.drive.relay());
    port.order(Opcode::SetMaskEvent, 1);
    port.bench.run_for(2 * MS);
    assert!(port.bench.drive.relay());
}

#[test]
fn registers_of_cmd_keep_what_modbus_wrote() {
    let mut port = Port::new();
    port.bench.order(Opcode::RunF, 100);
    port.order(Opcode::SoftStop, 0);
    port.bench.run_until_ready();
    port.order(Opcode::MoveF, 50);
    let read = |bench: &mut Bench, reg| bench.read(reg);
    assert_eq!(read(&mut port.bench, Reg::Cmd), i64::from(Opcode::RunF.code()));
    assert_eq!(read(&mut port.bench, Reg::TargetSpeed), 100);
    assert_eq!(read(&mut port.bench, Reg::TargetPos), 0);
}
