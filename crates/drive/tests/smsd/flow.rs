//! Jumps, loops and calls.

use crate::bench::{Bench, MS, count, end, jump, line, plain, repeat};
use core::time::Duration;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

/// Runs a program; answers how often [`count`] was carried out in it.
fn counted(program: &[Instruction]) -> i64 {
    let mut bench = Bench::new();
    bench.run_program(program);
    assert!(!bench.cmd_error(), "{:?}", bench.drive.poll_event());
    bench.position()
}

/// An instruction that takes a millisecond and changes nothing.
fn pause() -> Instruction {
    line(Opcode::SetWait, 1)
}

fn goto(area: i32, target: i32) -> Instruction {
    jump(Opcode::GotoProgram, area, target)
}

fn call(area: i32, target: i32) -> Instruction {
    jump(Opcode::CallProgram, area, target)
}

fn back() -> Instruction {
    plain(Opcode::ReturnProgram)
}

// ---- jumps

#[test]
fn a_jump_takes_the_least_time_and_goes_on_at_its_line() {
    let mut bench = Bench::new();
    let time = bench.run_program(&[goto(0, 2), count(), end()]);
    assert_eq!((time, bench.position(), bench.place()), (MS, 0, (0, 2)));
}

#[test]
fn a_jump_may_go_back_and_to_itself() {
    let mut bench = Bench::new();
    bench.start(&[pause(), goto(0, 0)]);
    bench.run_for(1000 * MS);
    assert_eq!((bench.program_runs(), bench.place()), (true, (0, 0)));
    let mut bench = Bench::new();
    bench.start(&[pause(), goto(0, 1)]);
    bench.run_for(1000 * MS);
    assert_eq!((bench.program_runs(), bench.place()), (true, (0, 1)));
}

#[test]
fn a_jump_may_go_to_another_memory() {
    let mut bench = Bench::new();
    bench.store(3, &[count(), line(Opcode::SetWait, 50), goto(1, 1)]);
    bench.store(1, &[count(), line(Opcode::MoveF, 10), end()]);
    bench.start(&[goto(3, 1)]);
    bench.run_for(10 * MS);
    assert_eq!(bench.place(), (3, 1));
    bench.run_until_ended();
    assert_eq!((bench.place(), bench.position()), ((1, 2), 10));
}

#[test]
fn bits_above_the_memory_number_are_ignored_in_a_jump() {
    let mut bench = Bench::new();
    bench.run_program(&[line(Opcode::GotoProgram, 0x3F_FC00 | 2), count(), end()]);
    assert_eq!((bench.position(), bench.place()), (0, (0, 2)));
}

#[test]
fn a_jump_past_the_size_ends_the_program_without_error() {
    for (area, target) in [(0, 2), (0, 254), (0, 255), (1, 0)] {
        let mut bench = Bench::new();
        let time = bench.run_program(&[goto(area, target), count()]);
        assert_eq!((time, bench.cmd_error(), bench.position()), (MS, false, 0));
        assert_eq!(bench.place(), (area.into(), target.into()), "the line that is not there");
    }
}

#[test]
fn a_program_ends_at_its_size_and_past_line_254() {
    let mut bench = Bench::new();
    let time = bench.run_program(&[pause(), pause()]);
    assert_eq!((time, bench.place(), bench.cmd_error()), (2 * MS, (0, 2), false));
    let time = bench.run_program(&[pause(); 255]);
    assert_eq!((time, bench.place(), bench.cmd_error()), (255 * MS, (0, 255), false));
}

#[test]
fn end_ends_a_program_at_once() {
    let mut bench = Bench::new();
    let time = bench.run_program(&[end(), count()]);
    assert_eq!((time, bench.place(), bench.position()), (Duration::ZERO, (0, 0), 0));
}

#[test]
fn conditional_jumps_look_at_their_input() {
    let jumps = [
        (Opcode::GotoProgramIfIn0, Input::In0),
        (Opcode::GotoProgramIfIn1, Input::In1),
        (Opcode::GotoProgramIfInZero, Input::SetZero),
    ];
    for (opcode, input) in jumps {
        for other in Input::ALL {
            for masked in [false, true] {
                let mut bench = Bench::new();
                bench.input(other, true);
                bench.write(Reg::Mask, if masked { 0 } else { 0xFF });
                let time = bench.run_program(&[jump(opcode, 0, 3), pause(), end(), end()]);
                let jumps = other == input && !masked;
                let expected = if jumps { (MS, (0, 3)) } else { (2 * MS, (0, 2)) };
                assert_eq!((time, bench.place()), expected, "{opcode} {other} {masked}");
            }
        }
    }
}

#[test]
fn goto_if_zero_looks_at_the_position() {
    for (position, line_after) in [(0, 3), (1, 2), (-1, 2)] {
        let mut bench = Bench::new();
        bench.order(Opcode::GoTo, position);
        bench.run_until_ready();
        bench.run_program(&[jump(Opcode::GotoProgramIfZero, 0, 3), pause(), end(), end()]);
        assert_eq!(bench.place(), (0, line_after));
    }
}

// ---- loops

#[test]
fn a_loop_repeats_the_instructions_behind_it() {
    for (instructions, cycles) in [(1, 1), (1, 7), (2, 1), (2, 5), (3, 1023)] {
        let mut program = vec![repeat(instructions, cycles)];
        program.extend(vec![pause(); usize::try_from(instructions).expect("small")]);
        program.extend([count(), end()]);
        let mut bench = Bench::new();
        bench.store(0, &program);
        bench.command(Opcode::StartProgramMem0);
        bench.run_until(|bench| bench.position() == 1);
        let body = u64::try_from(instructions * cycles).expect("positive");
        bench.run_until_ended();
        assert_eq!(bench.position(), 1, "what stands behind the loop runs once");
        let time = bench.run_program(&program[..program.len() - 2]);
        assert_eq!(time, Duration::from_millis(1 + body), "{cycles} times {instructions}");
    }
}

#[test]
fn a_loop_of_no_cycles_skips_its_body() {
    assert_eq!(counted(&[repeat(2, 0), count(), count(), end()]), 0);
    assert_eq!(counted(&[repeat(2, 0), count(), count(), count(), end()]), 1);
    assert_eq!(Bench::new().run_program(&[repeat(100, 0), pause(), pause()]), MS);
}

#[test]
fn a_loop_of_no_instructions_does_nothing() {
    for cycles in [0, 1, 1023] {
        assert_eq!(counted(&[repeat(0, cycles), count(), end()]), 1);
    }
}

#[test]
fn loops_nest() {
    assert_eq!(counted(&[repeat(3, 4), count(), repeat(1, 5), count(), end()]), 4 * (1 + 5));
    assert_eq!(counted(&[repeat(4, 2), repeat(2, 3), count(), count(), count(), end()]), 2 * (3 * 2 + 1));
}

#[test]
fn loops_may_end_on_the_same_line() {
    assert_eq!(counted(&[repeat(2, 2), repeat(1, 3), count(), end()]), 6);
    assert_eq!(counted(&[repeat(3, 2), repeat(2, 3), repeat(1, 4), count(), count(), end()]), 25);
}

#[test]
fn a_loop_of_no_cycles_at_the_end_of_another_ends_its_cycle() {
    assert_eq!(counted(&[repeat(3, 4), count(), repeat(1, 0), count(), end()]), 4);
}

#[test]
fn eight_loops_may_be_open_and_a_ninth_ends_the_program() {
    let nested = |depth: i32| {
        let mut program: Vec<Instruction> = (0..depth).map(|level| repeat(depth - level, 2)).collect();
        program.extend([count(), end()]);
        program
    };
    assert_eq!(counted(&nested(8)), 256);
    let mut bench = Bench::new();
    bench.run_program(&nested(9));
    assert_eq!(bench.place(), (0, 8));
    bench.assert_refused("mem0:8: LOOP_PROGRAM refused: 8 loops have not ended yet");
}

#[test]
fn a_loop_that_has_ended_makes_room_for_another() {
    let program: Vec<Instruction> = (0..20).flat_map(|_| [repeat(1, 2), count()]).chain([end()]).collect();
    assert_eq!(counted(&program), 40);
}

#[test]
fn a_jump_out_of_a_loop_leaves_it() {
    // Round and round: were the loop to stay open, the ninth round would end in an error.
    let program = [repeat(20, 12), repeat(2, 100), count(), goto(0, 4), pause(), pause()];
    let mut program = program.to_vec();
    program.extend(vec![pause(); 15]);
    program.push(end());
    assert_eq!(counted(&program), 12);
}

#[test]
fn a_jump_within_a_loop_stays_in_it() {
    assert_eq!(counted(&[repeat(4, 5), goto(0, 3), count(), count(), pause(), end()]), 5);
}

#[test]
fn a_jump_to_the_first_line_of_a_loop_is_no_new_cycle() {
    let program = [repeat(3, 3), count(), jump(Opcode::GotoProgramIfIn0, 0, 1), pause(), end()];
    assert_eq!(counted(&program), 3);
    let mut bench = Bench::new();
    bench.input(Input::In0, true);
    bench.start(&program);
    bench.run_for(500 * MS);
    let rounds = bench.position();
    bench.input(Input::In0, false);
    bench.run_until_ended();
    assert!((rounds + 2..=rounds + 3).contains(&bench.position()), "{rounds}, then {}", bench.position());
}

#[test]
fn a_jump_to_behind_a_loop_ends_it() {
    assert_eq!(counted(&[repeat(2, 9), count(), goto(0, 3), count(), end()]), 2);
}

#[test]
fn a_conditional_jump_at_the_end_of_a_loop_closes_its_cycle_when_it_is_not_taken() {
    assert_eq!(counted(&[repeat(2, 6), count(), jump(Opcode::GotoProgramIfIn0, 0, 4), end(), count()]), 6);
}

#[test]
fn a_loop_that_reaches_past_the_size_ends_with_the_program() {
    assert_eq!(counted(&[repeat(10, 3), count(), count()]), 2);
    let mut program = vec![pause(); 253];
    program.extend([repeat(1023, 1023), count()]);
    assert_eq!(counted(&program), 1);
}

// ---- calls

#[test]
fn a_call_comes_back_to_the_line_behind_it() {
    let mut bench = Bench::new();
    let program = [call(0, 3), line(Opcode::MoveF, 10), end(), count(), back()];
    bench.run_program(&program);
    assert_eq!((bench.position(), bench.place(), bench.cmd_error()), (11, (0, 2), false));
    assert_eq!(Bench::new().run_program(&[call(0, 2), end(), back()]), 2 * MS);
}

#[test]
fn a_subprogram_may_lie_in_another_memory() {
    let mut bench = Bench::new();
    bench.store(2, &[end(), count(), call(3, 0), back()]);
    bench.store(3, &[line(Opcode::MoveF, 10), back()]);
    bench.run_program(&[call(2, 1), line(Opcode::MoveF, 100), end()]);
    assert_eq!((bench.position(), bench.place()), (111, (0, 2)));
}

#[test]
fn sixteen_calls_may_be_open_and_a_seventeenth_ends_the_program() {
    // Line 0 calls line 1, and so on; each then counts and returns to the one before it.
    let chain = |depth: i32| {
        let mut program = vec![call(0, 2), end()];
        for level in 1..depth {
            program.extend([call(0, 2 + level * 3), count(), back()]);
        }
        program.extend([count(), back()]);
        program
    };
    assert_eq!(counted(&chain(16)), 16);
    let mut bench = Bench::new();
    bench.run_program(&chain(17));
    bench.assert_refused("CALL_PROGRAM refused: 16 subprograms have not returned yet");
    assert_eq!((bench.position(), bench.place()), (0, (0, 2 + 15 * 3)));
}

#[test]
fn a_return_without_a_call_ends_the_program() {
    let mut bench = Bench::new();
    bench.run_program(&[pause(), back(), count()]);
    assert_eq!((bench.position(), bench.place()), (0, (0, 1)));
    bench.assert_refused("mem0:1: RETURN_PROGRAM refused: no CALL_PROGRAM has been made");
}

#[test]
fn a_call_at_the_end_of_a_loop_closes_its_cycle_when_it_returns() {
    assert_eq!(counted(&[repeat(2, 3), pause(), call(0, 4), end(), count(), back()]), 3);
}

#[test]
fn a_subprogram_that_runs_over_the_end_of_its_callers_loop_does_not_close_its_cycle() {
    // Line 3 is the last of the loop, and here also the first of the subprogram.
    assert_eq!(counted(&[repeat(3, 2), call(0, 3), goto(0, 5), count(), back(), end()]), 1);
}

#[test]
fn a_loop_left_open_by_a_subprogram_goes_with_it() {
    let program = [
        repeat(1, 20),
        call(0, 3),
        end(),
        // The subprogram returns out of its own loop.
        repeat(2, 5),
        count(),
        back(),
    ];
    assert_eq!(counted(&program), 20);
}

#[test]
fn a_call_to_a_line_past_the_size_ends_the_program() {
    let mut bench = Bench::new();
    bench.run_program(&[call(0, 200), count()]);
    assert_eq!((bench.position(), bench.cmd_error(), bench.place()), (0, false, (0, 200)));
}

#[test]
fn a_call_from_the_last_line_returns_past_the_end() {
    let mut bench = Bench::new();
    let time = bench.run_program(&[goto(0, 2), back(), call(0, 1)]);
    assert_eq!((time, bench.place(), bench.cmd_error()), (3 * MS, (0, 3), false));
}
