//! Starting, stopping and watching programs, and what the host may do meanwhile.

use crate::bench::{Bench, MS, SECOND, config, count, end, jump, line, plain};
use core::time::Duration;
use stepdrive_drive::smsd::{Config, Memory, Timer};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::time::Instant;

const STARTS: [Opcode; 4] =
    [Opcode::StartProgramMem0, Opcode::StartProgramMem1, Opcode::StartProgramMem2, Opcode::StartProgramMem3];

fn wait(milliseconds: i32) -> Instruction {
    line(Opcode::SetWait, milliseconds)
}

/// A controller with a different program in each area: area n moves by 10^n and waits for an hour.
fn four_programs() -> Bench {
    let mut bench = Bench::new();
    for (area, displacement) in (0..).zip([1, 10, 100, 1000]) {
        bench.store(area, &[line(Opcode::MoveF, displacement), wait(3_600_000), end()]);
    }
    bench
}

#[test]
fn each_start_command_starts_its_area() {
    for (area, start) in (0..).zip(STARTS) {
        let mut bench = four_programs();
        assert!(!bench.program_runs());
        bench.command(start);
        assert!(bench.program_runs());
        bench.run_for(10 * SECOND);
        assert_eq!((bench.position(), bench.place()), (10_i64.pow(area), (i64::from(area), 1)));
    }
}

#[test]
fn the_first_line_has_its_effect_at_the_instant_of_the_start() {
    let mut bench = Bench::new();
    bench.store(0, &[plain(Opcode::SetRele), end()]);
    bench.command(Opcode::StartProgramMem0);
    assert_eq!(bench.drive.next_wake(), Some((bench.now, Timer::Program)));
    bench.settle();
    assert!(bench.drive.relay());
}

#[test]
fn starting_while_one_runs_restarts() {
    for (area, start) in (0..).zip(STARTS) {
        let mut bench = four_programs();
        bench.command(Opcode::StartProgramMem2);
        bench.run_for(10 * SECOND);
        bench.command(start);
        bench.run_for(10 * SECOND);
        assert_eq!((bench.position(), bench.place()), (100 + 10_i64.pow(area), (i64::from(area), 1)));
    }
}

#[test]
fn an_instruction_may_start_another_program() {
    for (area, start) in (0..).zip(STARTS).skip(1) {
        let mut bench = four_programs();
        // The open call and loop are left behind.
        bench.start(&[jump(Opcode::CallProgram, 0, 1), line(Opcode::LoopProgram, 5 << 10 | 2), plain(start)]);
        bench.run_for(10 * SECOND);
        assert_eq!((bench.position(), bench.place()), (10_i64.pow(area), (i64::from(area), 1)));
    }
    let mut bench = Bench::new();
    bench.start(&[count(), plain(Opcode::StartProgramMem0)]);
    bench.run_for(SECOND);
    assert!(bench.position() > 5, "a program may restart itself, and that takes its time");
}

#[test]
fn the_instruction_stop_ends_the_program() {
    let mut bench = Bench::new();
    let time = bench.run_program(&[line(Opcode::RunF, 500), plain(Opcode::StopProgramMem), count()]);
    assert_eq!((bench.place(), bench.flags().as_str()), ((0, 1), "CONST_SPEED READY DIR"));
    assert!(time > 400 * MS);
    assert!(!bench.cmd_error());
}

#[test]
fn stopping_in_the_middle_of_a_move_leaves_the_motor_to_it() {
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::MoveF, 32_000), count(), end()]);
    bench.run_for(SECOND);
    bench.command(Opcode::StopProgramMem);
    assert!(!bench.program_runs());
    assert_eq!(bench.place(), (0, 0), "the line it stood at");
    bench.run_until_ready();
    bench.run_for(SECOND);
    assert_eq!(bench.position(), 32_000);
}

#[test]
fn stopping_in_the_middle_of_a_wait_ends_it() {
    let waits = [wait(5000), line(Opcode::SetWait2, 5000), plain(Opcode::WaitIn0)];
    for instruction in waits {
        let mut bench = Bench::new();
        bench.start(&[instruction, plain(Opcode::SetRele)]);
        bench.run_for(SECOND);
        bench.command(Opcode::StopProgramMem);
        assert_eq!((bench.read(Reg::Wait), bench.drive.next_wake()), (0, None));
        bench.input(Input::In0, true);
        bench.run_for(10 * SECOND);
        assert!(!bench.drive.relay());
    }
}

#[test]
fn stopping_in_a_seek_leaves_the_motor_seeking() {
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::ScanZeroF, 500), count()]);
    bench.run_for(2 * SECOND);
    bench.command(Opcode::StopProgramMem);
    assert_eq!((bench.flags().as_str(), bench.read(Reg::Wait)), ("CONST_SPEED DIR", 4));
    bench.input(Input::SetZero, true);
    bench.run_for(SECOND);
    assert_eq!((bench.position(), bench.flags().as_str()), (0, "STOP READY DIR"));
}

#[test]
fn restarting_in_the_middle_of_a_move_begins_with_a_refusal() {
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::MoveF, 32_000), end()]);
    bench.run_for(SECOND);
    bench.command(Opcode::StartProgramMem0);
    bench.settle();
    assert!(!bench.program_runs());
    bench.assert_refused("program ended at mem0:0: MOVE_F refused: the motor is turning");
    bench.run_until_ready();
    assert_eq!(bench.position(), 32_000);
}

#[test]
fn stopping_without_a_program_does_nothing() {
    let mut bench = Bench::new();
    bench.command(Opcode::StopProgramMem);
    assert_eq!(bench.flags(), "HiZ STOP READY DIR");
}

#[test]
fn starting_an_empty_area_ends_at_once() {
    let mut bench = Bench::new();
    bench.command(Opcode::StartProgramMem3);
    bench.settle();
    assert_eq!((bench.program_runs(), bench.cmd_error(), bench.place()), (false, false, (3, 0)));
}

#[test]
fn the_line_counts_along() {
    let mut bench = Bench::new();
    bench.store(2, &[wait(10), wait(10), wait(10), end()]);
    bench.command(Opcode::StartProgramMem2);
    for line in 0..3 {
        bench.run_for(5 * MS);
        assert_eq!(bench.place(), (2, line));
        bench.run_for(5 * MS);
    }
    assert_eq!((bench.place(), bench.program_runs()), ((2, 3), false));
}

#[test]
fn a_waiting_program_asks_for_no_wake_up_while_it_waits_for_motion_or_signal() {
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::ScanZeroF, 500), end()]);
    bench.run_for(2 * SECOND);
    assert_eq!(bench.drive.next_wake(), None);
    let mut bench = Bench::new();
    bench.start(&[plain(Opcode::WaitContinue), end()]);
    assert_eq!(bench.drive.next_wake(), None);
    bench.run_for(24 * 3600 * SECOND);
    bench.input(Input::Continue, true);
    assert_eq!(bench.run_until_ended(), Duration::ZERO);
}

#[test]
fn a_command_of_the_host_is_carried_out_and_the_program_goes_on() {
    let mut bench = Bench::new();
    bench.start(&[wait(100), plain(Opcode::SetRele), end()]);
    bench.run_for(50 * MS);
    bench.order(Opcode::RunF, 500);
    bench.write(Reg::MaxSpeed, 700);
    bench.run_until_ended();
    assert!(bench.drive.relay());
    bench.run_until_ready();
    assert_eq!(bench.flags(), "CONST_SPEED READY DIR");
}

#[test]
fn a_stop_by_the_host_lets_a_program_go_on_behind_its_move() {
    for stop in [Opcode::HardStop, Opcode::SoftStop, Opcode::HardHiZ, Opcode::SoftHiZ] {
        let mut bench = Bench::new();
        bench.start(&[line(Opcode::MoveF, 320_000), plain(Opcode::SetRele), end()]);
        bench.run_for(SECOND);
        bench.command(stop);
        bench.run_until_ready();
        bench.settle();
        assert!(bench.drive.relay(), "{stop}");
    }
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::MoveF, 320_000), plain(Opcode::SetRele), end()]);
    bench.run_for(SECOND);
    bench.trigger(Reg::ResetPowerstep01);
    bench.settle();
    assert!(bench.drive.relay(), "programs are untouched by a reset of the motor chip");
}

#[test]
fn a_program_that_holds_for_a_run_is_held_by_the_hosts_motion_instead() {
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::MoveF, 320_000), plain(Opcode::SetRele), end()]);
    bench.run_for(SECOND);
    bench.order(Opcode::ScanZeroF, 300);
    bench.run_for(10 * SECOND);
    assert!(bench.program_runs());
    bench.input(Input::SetZero, true);
    bench.settle();
    assert!(bench.drive.relay());
}

#[test]
fn a_refused_command_of_the_host_does_not_stop_the_program() {
    let mut bench = Bench::new();
    bench.start(&[line(Opcode::MoveF, 3200), plain(Opcode::SetRele), end()]);
    bench.run_for(100 * MS);
    bench.order(Opcode::MoveF, 5);
    bench.assert_refused("MOVE_F refused");
    bench.run_until_ended();
    assert!(bench.drive.relay());
}

#[test]
fn a_refused_instruction_leaves_the_motor_as_it_is() {
    let mut bench = Bench::new();
    bench.run_program(&[line(Opcode::RunF, 500), count(), plain(Opcode::HardStop)]);
    assert_eq!(bench.flags(), "CONST_SPEED READY DIR CMD_ERROR");
    bench.assert_refused("program ended at mem0:1: MOVE_F refused");
}

#[test]
fn clr_does_not_bring_a_program_back() {
    let mut bench = Bench::new();
    bench.run_program(&[plain(Opcode::ReturnProgram), plain(Opcode::SetRele)]);
    bench.trigger(Reg::Clr);
    bench.run_for(SECOND);
    assert!(!bench.program_runs() && !bench.drive.relay());
}

#[test]
fn in_autonomous_mode_the_program_of_the_front_panel_starts_at_power_up() {
    for area in 0..4 {
        let mut memory = four_programs().drive.memory().clone();
        memory.mode_n_programs = area;
        for autonomous in [true, false] {
            let config = Config { autonomous, ..config(Model::Smsd42) };
            let mut bench = Bench::locked(config, memory.clone(), 0);
            let due = autonomous.then_some((Instant::ZERO, Timer::Program));
            assert_eq!(bench.drive.next_wake(), due);
            bench.run_for(10 * SECOND);
            bench.log_in(crate::bench::PASSWORD);
            assert_eq!(bench.read(Reg::ModeNPrograms), area.into());
            assert_eq!(bench.position(), if autonomous { 10_i64.pow(area.into()) } else { 0 });
            assert_eq!(bench.program_runs(), autonomous);
        }
    }
}

#[test]
fn an_autonomous_program_sees_the_inputs_as_they_are_at_power_up() {
    let mut bench = Bench::new();
    bench.store(0, &[jump(Opcode::GotoProgramIfIn0, 0, 2), end(), plain(Opcode::SetRele)]);
    let config = Config { autonomous: true, ..config(Model::Smsd42) };
    let mut bench = Bench::locked(config, bench.drive.memory().clone(), Input::In0.bit());
    bench.run_for(MS);
    assert!(bench.drive.relay());
}

#[test]
fn programs_run_without_any_connection() {
    let mut bench = Bench::new();
    bench.start(&[wait(10), plain(Opcode::SetRele), end()]);
    let mut drive = bench.drive.clone();
    drive.handle_wake(bench.now + SECOND);
    assert!(drive.relay());
}

#[test]
fn what_is_handled_late_happens_at_its_own_instant() {
    let program = [
        line(Opcode::MoveF, 500),
        wait(50),
        line(Opcode::RunR, 400),
        wait(777),
        plain(Opcode::SoftStop),
        line(Opcode::GoTo, 123),
    ];
    let mut on_time = Bench::new();
    on_time.start(&program);
    let mut late = on_time.clone();
    on_time.run_for(60 * SECOND);
    late.now = on_time.now;
    late.drive.handle_wake(late.now);
    assert_eq!(late.snapshot(), on_time.snapshot());
    assert_eq!(late.position(), 123);
}

#[test]
fn a_memory_without_program_gives_nothing_to_run_in_autonomous_mode() {
    let config = Config { autonomous: true, ..config(Model::Smsd42) };
    let mut bench = Bench::locked(config, Memory::factory(), 0);
    bench.run_for(SECOND);
    bench.log_in(crate::bench::PASSWORD);
    assert_eq!((bench.program_runs(), bench.cmd_error()), (false, false));
}
