//! Each instruction in a program: its effect, its time, and how it is refused.

use crate::bench::{
    Bench, MICROSTEPS, MS, SECOND, Textbook, assert_takes, config, count, end, jump, just_before, line, plain,
};
use core::time::Duration;
use stepdrive_drive::smsd::{Memory, Record};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Instruction, Opcode};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::powerstep01 as scale;
use stepdrive_spec::smsd::registers::Reg;

/// Runs one instruction and END; answers the controller afterwards and how long the instruction took.
fn run(bench: &mut Bench, instruction: Instruction) -> Duration {
    let time = bench.run_program(&[instruction, end()]);
    assert!(!bench.cmd_error(), "{}: {:?}", instruction.opcode, bench.drive.poll_event());
    assert_eq!(bench.place(), (0, 1), "{} goes on to the next line", instruction.opcode);
    time
}

/// Asserts that an instruction ends the program it stands in, sets `CMD_ERROR` and gives this reason.
fn assert_ends_program(bench: &mut Bench, instruction: Instruction, reason: &str) {
    let flags = bench.flags();
    bench.store(0, &[instruction, line(Opcode::SetFsSpeed, 15)]);
    bench.command(Opcode::StartProgramMem0);
    bench.settle();
    assert!(!bench.program_runs(), "{}", instruction.opcode);
    assert_eq!(bench.place(), (0, 0));
    assert_eq!(bench.flags(), format!("{flags} CMD_ERROR"), "{}", instruction.opcode);
    bench.assert_refused(&format!("program ended at mem0:0: {} refused: {reason}", instruction.opcode));
    bench.run_for(SECOND);
    assert_eq!(bench.read(Reg::FsSpeed), 15_600, "nothing behind it ran");
}

/// A controller whose motor turns at constant speed.
fn turning() -> Bench {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    bench.run_until_ready();
    bench
}

#[test]
fn every_instruction_of_a_program_is_tested_here_or_with_the_flow() {
    use Opcode::{
        CallProgram, End, GotoProgram, GotoProgramIfIn0, GotoProgramIfIn1, GotoProgramIfInZero,
        GotoProgramIfZero, LoopProgram, ReturnProgram, StartProgramMem0, StartProgramMem1, StartProgramMem2,
        StartProgramMem3, StopProgramMem,
    };
    let flow = [
        CallProgram,
        End,
        GotoProgram,
        GotoProgramIfIn0,
        GotoProgramIfIn1,
        GotoProgramIfInZero,
        GotoProgramIfZero,
        LoopProgram,
        ReturnProgram,
        StartProgramMem0,
        StartProgramMem1,
        StartProgramMem2,
        StartProgramMem3,
        StopProgramMem,
    ];
    let here = INSTRUCTIONS.iter().filter(|info| info.in_program && !flow.contains(&info.opcode));
    // SET_MODE and SET_MASK_EVENT; RUN_F and RUN_R; position, chip and the relay on and off; the five waits.
    let (modes, runs, others, waits) = (2, 2, 4, 5);
    let listed = SETTINGS.len() + modes + MOVES.len() + runs + SEEKS.len() + STOPS.len() + others + waits;
    assert_eq!(here.count(), listed);
}

// ---- settings

const SETTINGS: [(Opcode, Reg, i32, i32); 5] = [
    (Opcode::SetMinSpeed, Reg::MinSpeed, 0, 950),
    (Opcode::SetMaxSpeed, Reg::MaxSpeed, 16, 15_600),
    (Opcode::SetAcc, Reg::Acc, 15, 59_000),
    (Opcode::SetDec, Reg::Dec, 15, 59_000),
    (Opcode::SetFsSpeed, Reg::FsSpeed, 15, 15_600),
];

#[test]
fn a_setting_takes_the_least_time_and_sets_its_register() {
    for (opcode, reg, min, max) in SETTINGS {
        for value in [min, max] {
            let mut bench = Bench::new();
            assert_eq!(run(&mut bench, line(opcode, value)), MS);
            assert_eq!(bench.read(reg), i64::from(value), "{opcode}");
        }
    }
}

#[test]
fn a_setting_out_of_range_ends_the_program() {
    for (opcode, reg, min, max) in SETTINGS {
        for value in [min - 1, max + 1, 0x3F_FFFF].into_iter().filter(|value| *value >= 0) {
            let mut bench = Bench::new();
            let before = bench.read(reg);
            let reason = format!("its value {value} is not within {min} to {max}");
            assert_ends_program(&mut bench, line(opcode, value), &reason);
            assert_eq!(bench.read(reg), before);
        }
    }
}

#[test]
fn settings_that_need_a_standing_motor_end_the_program_while_it_turns() {
    for (opcode, reg, _, _) in SETTINGS {
        let mut bench = turning();
        let needs = matches!(opcode, Opcode::SetMinSpeed | Opcode::SetAcc | Opcode::SetDec);
        if needs {
            assert_ends_program(&mut bench, line(opcode, 500), "the motor is turning (SPEED 500)");
        } else {
            assert_eq!(run(&mut bench, line(opcode, 500)), MS);
        }
        assert_eq!(bench.read(reg) == 500, !needs, "{opcode}");
    }
}

#[test]
fn set_mode_sets_all_five_registers_of_a_de_energised_motor() {
    let mode = MotorConfiguration {
        current_or_voltage: 0,
        motor_type: 45,
        microstepping: 7,
        work_current: 42,
        stop_current: 3,
    };
    let mut bench = Bench::new();
    let data = i32::try_from(mode.data()).expect("19 bits");
    assert_eq!(run(&mut bench, line(Opcode::SetMode, data)), MS);
    let registers =
        [Reg::CurrentOrVoltage, Reg::MotorType, Reg::Microstepping, Reg::WorkCurrent, Reg::StopCurrent];
    assert_eq!(registers.map(|reg| bench.read(reg)), [0, 45, 7, 42, 3]);
    assert_eq!(bench.drive.memory().motor, mode, "it is stored");
}

#[test]
fn set_mode_ends_the_program_when_the_motor_is_energised() {
    let data = i32::try_from(MotorConfiguration::FACTORY.data()).expect("19 bits");
    let mut bench = Bench::new();
    bench.command(Opcode::HardStop);
    assert_ends_program(&mut bench, line(Opcode::SetMode, data), "the motor is energised (HiZ is 0)");
    assert_ends_program(&mut turning(), line(Opcode::SetMode, data), "the motor is energised (HiZ is 0)");
}

#[test]
fn set_mode_ends_the_program_when_the_model_has_no_such_motor_or_current() {
    let with = |motor_type, work_current| {
        let mode = MotorConfiguration { motor_type, work_current, ..MotorConfiguration::FACTORY };
        line(Opcode::SetMode, i32::try_from(mode.data()).expect("19 bits"))
    };
    let reason = "this model has no such motor or current";
    for wrong in [with(46, 10), with(0, 43), with(0, 0)] {
        assert_ends_program(&mut Bench::new(), wrong, reason);
    }
    for wrong in [with(55, 10), with(0, 81), with(0, 0)] {
        assert_ends_program(&mut Bench::of(Model::Smsd80), wrong, reason);
    }
    run(&mut Bench::of(Model::Smsd80), with(54, 80));
}

#[test]
fn set_mask_event_sets_the_mask_and_uncovers_what_is_there() {
    let mut bench = Bench::new();
    assert_eq!(run(&mut bench, line(Opcode::SetMaskEvent, 0x5A)), MS);
    assert_eq!(bench.read(Reg::Mask), 0x5A);
    bench.input(Input::In0, true);
    bench.order(Opcode::GoUntilF, 0);
    bench.run_for(SECOND);
    run(&mut bench, line(Opcode::SetMaskEvent, 0xFF));
    bench.run_until_ready();
    assert_eq!(bench.read(Reg::Stop), 1);
}

// ---- motion

const MOVES: [(Opcode, i32, i64); 7] = [
    (Opcode::MoveF, 16_000, 16_000),
    (Opcode::MoveR, 16_000, -16_000),
    (Opcode::GoToF, 16_000, 16_000),
    (Opcode::GoToR, -16_000, -16_000),
    (Opcode::GoTo, -16_000, -16_000),
    (Opcode::GoZero, 0, 0),
    (Opcode::GoMark, 0, 0),
];

#[test]
fn a_move_holds_the_program_until_it_has_arrived() {
    for (opcode, operand, arrived) in MOVES {
        let mut bench = Bench::new();
        if arrived == 0 {
            bench.order(Opcode::MoveF, 16_000);
            bench.run_until_ready();
        }
        let time = run(&mut bench, line(opcode, operand));
        assert_takes(time, Textbook::factory().seconds(1000.0));
        assert_eq!((bench.position(), bench.read(Reg::Ready)), (arrived, 1), "{opcode}");
    }
}

#[test]
fn a_move_that_is_done_at_once_takes_the_least_time() {
    for (opcode, _, _) in MOVES {
        assert_eq!(run(&mut Bench::new(), plain(opcode)), MS, "{opcode}");
    }
}

#[test]
fn positions_in_a_program_are_signed() {
    for (opcode, arrived) in [(Opcode::MoveF, -200), (Opcode::MoveR, 200), (Opcode::GoTo, -200)] {
        let mut bench = Bench::new();
        run(&mut bench, line(opcode, -200));
        assert_eq!(bench.position(), arrived, "{opcode}");
    }
}

#[test]
fn a_move_ends_the_program_while_the_motor_turns() {
    for opcode in [Opcode::MoveF, Opcode::MoveR] {
        assert_ends_program(&mut turning(), line(opcode, 100), "the motor is turning (SPEED 500)");
    }
}

#[test]
fn positioning_takes_over_from_a_run_in_a_program() {
    let mut bench = Bench::new();
    bench.run_program(&[line(Opcode::RunF, 400), line(Opcode::GoTo, 16_000), end()]);
    assert_eq!((bench.position(), bench.cmd_error()), (16_000, false));
}

#[test]
fn a_run_holds_the_program_until_its_speed_is_reached_and_goes_on_behind_it() {
    for (opcode, flags) in [(Opcode::RunF, "CONST_SPEED READY DIR"), (Opcode::RunR, "CONST_SPEED READY")] {
        let mut bench = Bench::new();
        let time = run(&mut bench, line(opcode, 800));
        assert_takes(time, scale::SPEED.round(800.0) / scale::ACCELERATION.round(1000.0));
        bench.run_for(SECOND);
        assert_eq!((bench.flags().as_str(), bench.speed()), (flags, 800));
    }
}

const SEEKS: [(Opcode, Input); 8] = [
    (Opcode::GoUntilF, Input::In0),
    (Opcode::GoUntilR, Input::In0),
    (Opcode::ScanZeroF, Input::SetZero),
    (Opcode::ScanZeroR, Input::SetZero),
    (Opcode::ScanMarkF, Input::In1),
    (Opcode::ScanMarkR, Input::In1),
    (Opcode::ScanMark2F, Input::In1),
    (Opcode::ScanMark2R, Input::In1),
];

fn seek(opcode: Opcode) -> Instruction {
    line(opcode, if matches!(opcode, Opcode::GoUntilF | Opcode::GoUntilR) { 0 } else { 500 })
}

#[test]
fn a_seek_holds_the_program_until_its_signal_has_come_and_the_motor_stands() {
    for (opcode, input) in SEEKS {
        let mut bench = Bench::new();
        bench.start(&[seek(opcode), end()]);
        bench.run_for(100 * SECOND);
        assert_eq!(bench.place(), (0, 0), "{opcode}");
        assert_eq!(bench.read(Reg::Wait), i64::from(input.bit()));
        bench.input(input, true);
        bench.run_until_ready();
        bench.settle();
        assert_eq!((bench.program_runs(), bench.read(Reg::Stop)), (false, 1), "{opcode}");
    }
}

#[test]
fn a_seek_whose_signal_is_there_takes_the_least_time() {
    for (opcode, input) in SEEKS {
        let mut bench = Bench::new();
        bench.input(input, true);
        assert_eq!(run(&mut bench, seek(opcode)), MS, "{opcode}");
    }
}

#[test]
fn speeds_and_inputs_that_do_not_exist_end_the_program() {
    let scans = SEEKS.iter().map(|(opcode, _)| *opcode).skip(2);
    for opcode in [Opcode::RunF, Opcode::RunR].into_iter().chain(scans) {
        for speed in [0, 14, 15_601, 0x1_0010] {
            let reason = format!("its value {speed} is not within 15 to 15600");
            assert_ends_program(&mut Bench::new(), line(opcode, speed), &reason);
        }
    }
    for opcode in [Opcode::GoUntilF, Opcode::GoUntilR] {
        for input in [8, 0x1_0000, 0x3F_FFFF] {
            let reason = format!("there is no input {input}");
            assert_ends_program(&mut Bench::new(), line(opcode, input), &reason);
        }
    }
}

const STOPS: [Opcode; 4] = [Opcode::SoftStop, Opcode::HardStop, Opcode::SoftHiZ, Opcode::HardHiZ];

#[test]
fn a_stop_holds_the_program_until_the_motor_stands() {
    for stop in STOPS {
        let mut bench = turning();
        let time = run(&mut bench, plain(stop));
        let soft = matches!(stop, Opcode::SoftStop | Opcode::SoftHiZ);
        let braking = scale::SPEED.round(500.0) / scale::ACCELERATION.round(1000.0);
        assert_takes(time, if soft { braking } else { 0.001 });
        let released = matches!(stop, Opcode::SoftHiZ | Opcode::HardHiZ);
        assert_eq!(bench.flags(), if released { "HiZ STOP READY DIR" } else { "STOP READY DIR" }, "{stop}");
    }
}

#[test]
fn position_chip_and_relay_instructions_take_the_least_time() {
    let mut bench = turning();
    assert_eq!(run(&mut bench, plain(Opcode::SetRele)), MS);
    assert!(bench.drive.relay());
    assert_eq!(run(&mut bench, plain(Opcode::ClrRele)), MS);
    assert!(!bench.drive.relay());
    bench.run_until_ready();
    bench.store(0, &[plain(Opcode::ResetPos), end()]);
    bench.command(Opcode::StartProgramMem0);
    bench.settle();
    assert_eq!((bench.position(), bench.speed()), (0, 500));
    bench.run_until_ended();
    assert_eq!(run(&mut bench, plain(Opcode::ResetPowerstep01)), MS);
    assert_eq!((bench.flags().as_str(), bench.position()), ("HiZ STOP READY DIR", 0));
}

// ---- waiting

#[test]
fn a_wait_takes_its_milliseconds_and_at_least_one() {
    for opcode in [Opcode::SetWait, Opcode::SetWait2] {
        for (milliseconds, expected) in [(0, 1), (1, 1), (2, 2), (1500, 1500), (3_600_000, 3_600_000)] {
            let time = run(&mut Bench::new(), line(opcode, milliseconds));
            assert_eq!(time, Duration::from_millis(expected), "{opcode}");
        }
        let reason = "its value 3600001 is not within 0 to 3600000";
        assert_ends_program(&mut Bench::new(), line(opcode, 3_600_001), reason);
    }
}

#[test]
fn an_hour_of_waiting_costs_one_wake_up() {
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::SetWait, 3_600_000), end()]);
    let before = bench.wakes;
    bench.run_for(just_before(3600 * SECOND));
    assert_eq!((bench.wakes - before, bench.program_runs()), (0, true));
    bench.run_for(Duration::from_nanos(1));
    assert_eq!((bench.wakes - before, bench.program_runs()), (1, false));
}

#[test]
fn set_wait_is_not_interrupted() {
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::SetWait, 1000), end()]);
    for input in Input::ALL {
        bench.input(input, true);
    }
    assert_eq!((bench.read(Reg::Wait), bench.run_until_ended()), (0, SECOND));
}

#[test]
fn set_wait_2_is_interrupted_by_three_inputs_and_not_by_the_others() {
    for input in Input::ALL {
        let mut bench = Bench::new();
        bench.start(&[line(Opcode::SetWait2, 1000), end()]);
        assert_eq!(bench.read(Reg::Wait), 0b111);
        bench.run_for(400 * MS);
        bench.input(input, true);
        let interrupts = matches!(input, Input::In0 | Input::In1 | Input::SetZero);
        let rest = if interrupts { Duration::ZERO } else { 600 * MS };
        assert_eq!(bench.run_until_ended(), rest, "{input}");
        assert_eq!(bench.read(Reg::Wait), 0);
    }
}

#[test]
fn a_signal_that_is_there_leaves_set_wait_2_the_least_time() {
    let mut bench = Bench::new();
    bench.input(Input::In1, true);
    assert_eq!(run(&mut bench, line(Opcode::SetWait2, 1000)), MS);
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::SetWait2, 1000), end()]);
    bench.run_for(MS / 4);
    bench.input(Input::In0, true);
    bench.input(Input::In0, false);
    assert_eq!(bench.run_until_ended(), MS * 3 / 4, "a short pulse is enough");
}

#[test]
fn a_masked_signal_does_not_interrupt_until_it_is_uncovered() {
    let mut bench = Bench::new();
    bench.write(Reg::Mask, 0);
    bench.input(Input::In0, true);
    bench.start(&[line(Opcode::SetWait2, 1000), end()]);
    bench.run_for(300 * MS);
    bench.write(Reg::Mask, 1);
    assert_eq!(bench.run_until_ended(), Duration::ZERO);
}

#[test]
fn waiting_for_a_signal_needs_no_wake_up_and_ends_with_it() {
    let waits = [
        (Opcode::WaitIn0, Input::In0),
        (Opcode::WaitIn1, Input::In1),
        (Opcode::WaitContinue, Input::Continue),
    ];
    for (opcode, input) in waits {
        let mut bench = Bench::new();
        bench.start(&[plain(opcode), end()]);
        assert_eq!((bench.drive.next_wake(), bench.read(Reg::Wait)), (None, i64::from(input.bit())));
        bench.run_for(1000 * SECOND);
        for other in Input::ALL.into_iter().filter(|other| *other != input) {
            bench.input(other, true);
        }
        assert_eq!((bench.drive.next_wake(), bench.place()), (None, (0, 0)), "{opcode}");
        bench.input(input, true);
        assert_eq!(bench.run_until_ended(), Duration::ZERO, "{opcode}");
        assert_eq!(bench.read(Reg::Wait), 0);
    }
}

#[test]
fn waiting_for_a_signal_that_is_there_takes_the_least_time() {
    let mut bench = Bench::with(config(Model::Smsd42), Memory::factory(), 0xFF);
    for opcode in [Opcode::WaitIn0, Opcode::WaitIn1, Opcode::WaitContinue] {
        assert_eq!(run(&mut bench, plain(opcode)), MS, "{opcode}");
    }
}

#[test]
fn a_signal_in_the_first_millisecond_of_a_wait_counts() {
    let mut bench = Bench::new();
    bench.start(&[plain(Opcode::WaitIn0), end()]);
    bench.run_for(MS / 10);
    bench.input(Input::In0, true);
    bench.input(Input::In0, false);
    assert_eq!(bench.run_until_ended(), MS * 9 / 10);
}

#[test]
fn a_masked_signal_is_waited_for_until_it_is_uncovered() {
    let mut bench = Bench::new();
    bench.write(Reg::Mask, 0x80);
    bench.input(Input::In1, true);
    bench.start(&[plain(Opcode::WaitIn1), end()]);
    bench.run_for(SECOND);
    assert!(bench.program_runs());
    bench.write(Reg::Mask, 0x82);
    assert_eq!(bench.run_until_ended(), Duration::ZERO);
}

// ---- what is no instruction of a program

#[test]
fn readers_and_usb_instructions_end_the_program() {
    let others = INSTRUCTIONS.iter().filter(|info| !info.in_program).map(|info| info.opcode);
    assert_eq!(others.clone().count(), 12);
    for opcode in others {
        let reason = "it answers the host and has no place in a program";
        assert_ends_program(&mut Bench::new(), plain(opcode), reason);
    }
}

#[test]
fn a_stored_word_that_is_no_instruction_ends_the_program() {
    let mut memory = Memory::factory();
    let mut bytes = memory.encode(Record::Program(0));
    bytes[0] = 1;
    bytes[1] = 0x01;
    memory.decode(Record::Program(0), &bytes).expect("any words are kept");
    let mut bench = Bench::with(config(Model::Smsd42), memory, 0);
    bench.command(Opcode::StartProgramMem0);
    bench.settle();
    assert!(!bench.program_runs());
    bench.assert_refused("program ended at mem0:0: the word 0x00000001 is no instruction");
}

#[test]
fn operands_of_instructions_without_operand_are_ignored() {
    let mut bench = Bench::new();
    assert_eq!(run(&mut bench, line(Opcode::SetRele, -1)), MS);
    assert_eq!(run(&mut bench, jump(Opcode::HardStop, 3, 255)), MS);
}

#[test]
fn a_program_moves_as_far_as_its_lines_say() {
    let mut bench = Bench::new();
    let move_by = i32::try_from(MICROSTEPS).expect("small");
    bench.run_program(&[line(Opcode::MoveF, move_by), count(), count(), line(Opcode::MoveR, 1)]);
    assert_eq!(bench.position(), MICROSTEPS + 1);
}
