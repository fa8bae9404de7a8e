//! Moves to a place: how far, which way round, how long, and when they are refused.

use crate::bench::{Bench, MICROSTEPS, MS, Textbook, assert_takes};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::ring;

const LOWEST: i64 = ring::MIN as i64;
const HIGHEST: i64 = ring::MAX as i64;

/// Where a fast controller stands after it has gone to `from` and then carried out a command.
fn after(from: i64, opcode: Opcode, operand: i64) -> (i64, Vec<String>) {
    let mut bench = at(from);
    bench.order(opcode, operand);
    let flags = bench.flags_until_ready();
    (bench.position(), flags)
}

/// A fast controller that stands at `position`.
fn at(position: i64) -> Bench {
    let mut bench = Bench::tuned(0, 0, 15_600, 59_000, 59_000);
    bench.order(Opcode::GoTo, position);
    bench.run_until_ready();
    assert_eq!(bench.position(), position);
    bench.write_one(0x1107, 0).expect("data");
    bench
}

#[test]
fn a_move_accelerates_cruises_brakes_and_holds() {
    for (opcode, dir, end) in [(Opcode::MoveF, " DIR", 32_000), (Opcode::MoveR, "", -32_000)] {
        let mut bench = Bench::new();
        bench.order(opcode, 32_000);
        let flags = bench.flags_until_ready();
        let phases = ["ACC", "CONST_SPEED", "DEC", "STOP READY"].map(|phase| format!("{phase}{dir}"));
        assert_eq!(flags, phases);
        assert_eq!(bench.position(), end);
    }
}

#[test]
fn a_short_move_has_no_cruise() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveF, 1000);
    assert_eq!(bench.flags_until_ready(), ["ACC DIR", "DEC DIR", "STOP READY DIR"]);
}

#[test]
fn a_move_ends_exactly_as_many_microsteps_away_as_it_was_told() {
    for microstepping in [0, 4, 7] {
        let mut bench = Bench::tuned(microstepping, 0, 15_600, 59_000, 30_000);
        let mut expected = 0;
        for displacement in [1, 2, 3, 7, 100, 4095, 65_537, 300_000] {
            bench.order(Opcode::MoveF, displacement);
            bench.run_until_ready();
            expected += displacement;
            assert_eq!(bench.position(), expected);
        }
        bench.order(Opcode::MoveR, expected);
        bench.run_until_ready();
        assert_eq!(bench.position(), 0);
    }
}

#[test]
fn moves_take_the_time_of_the_textbook_with_the_limits_of_the_chip() {
    let limits =
        [(0, 1000, 1000, 1000), (0, 15_600, 59_000, 15), (50, 400, 2000, 700), (950, 1200, 15, 59_000)];
    for (min, max, acc, dec) in limits {
        for steps in [1, 10, 2000, 100_000] {
            let mut bench = Bench::tuned(4, min, max, acc, dec);
            bench.order(Opcode::MoveF, steps * MICROSTEPS);
            let time = bench.run_until_ready();
            let textbook = Textbook::of(min, max, acc, dec);
            if steps > 1 || min == 0 {
                assert_takes(time, textbook.seconds(steps as f64));
            }
        }
    }
}

#[test]
fn a_negative_move_goes_the_other_way() {
    let (position, flags) = after(0, Opcode::MoveF, -500);
    assert_eq!((position, flags[0].as_str()), (-500, "ACC"));
    let (position, flags) = after(0, Opcode::MoveR, -500);
    assert_eq!((position, flags[0].as_str()), (500, "ACC DIR"));
}

#[test]
fn a_move_by_nothing_energises_and_is_done_at_once() {
    for opcode in [Opcode::MoveF, Opcode::MoveR] {
        let mut bench = Bench::new();
        bench.order(opcode, 0);
        assert_eq!(bench.flags(), "STOP READY DIR");
    }
}

#[test]
fn the_longest_moves_go_half_way_round_the_ring() {
    assert_eq!(after(0, Opcode::MoveF, HIGHEST).0, HIGHEST);
    assert_eq!(after(0, Opcode::MoveF, LOWEST).0, LOWEST);
    let (position, flags) = after(0, Opcode::MoveR, LOWEST);
    assert_eq!((position, flags[0].as_str()), (LOWEST, "ACC DIR"));
}

#[test]
fn a_move_is_refused_while_the_motor_turns() {
    for opcode in [Opcode::MoveF, Opcode::MoveR] {
        let mut bench = Bench::new();
        bench.order(Opcode::MoveF, 32_000);
        bench.run_for(100 * MS);
        bench.order(opcode, 16);
        assert_eq!(bench.flags(), "ACC DIR CMD_ERROR");
        bench.assert_refused("MOVE_");
        bench.run_until_ready();
        assert_eq!(bench.position(), 32_000, "nothing else has changed");
        bench.order(Opcode::RunF, 500);
        bench.run_until_ready();
        bench.order(opcode, 16);
        bench.assert_refused("the motor is turning (SPEED 500)");
    }
}

#[test]
fn going_to_a_place_is_refused_until_ready() {
    use Opcode::{GoMark, GoTo, GoToF, GoToR, GoZero};
    for opcode in [GoTo, GoToF, GoToR, GoZero, GoMark] {
        let mut bench = Bench::new();
        bench.order(Opcode::MoveF, 3200);
        bench.run_for(10 * MS);
        bench.command(opcode);
        bench.assert_refused("READY is 0");
        bench.run_until_ready();
        assert_eq!(bench.position(), 3200);
        bench.order(Opcode::RunF, 1000);
        bench.run_for(10 * MS);
        bench.command(opcode);
        bench.assert_refused("READY is 0");
        bench.command(Opcode::SoftStop);
        bench.command(opcode);
        bench.assert_refused("READY is 0");
    }
}

#[test]
fn going_to_a_place_takes_the_shorter_way() {
    for (from, to, dir) in [
        (0, 100, " DIR"),
        (0, -100, ""),
        (HIGHEST - 10, LOWEST + 10, " DIR"),
        (LOWEST + 10, HIGHEST - 10, ""),
        (0, HIGHEST, " DIR"),
        (1, HIGHEST, " DIR"),
    ] {
        let (position, flags) = after(from, Opcode::GoTo, to);
        assert_eq!((position, flags[0].as_str()), (to, format!("ACC{dir}").as_str()), "{from} to {to}");
    }
}

#[test]
fn exactly_half_way_round_goes_backward() {
    for (from, to) in [(0, LOWEST), (1, LOWEST + 1), (-1, HIGHEST), (LOWEST, 0)] {
        let (position, flags) = after(from, Opcode::GoTo, to);
        assert_eq!((position, flags[0].as_str()), (to, "ACC"), "{from} to {to}");
    }
}

#[test]
fn a_forced_direction_goes_the_long_way_round() {
    for (opcode, to, dir) in [
        (Opcode::GoToF, 100, " DIR"),
        (Opcode::GoToF, -100, " DIR"),
        (Opcode::GoToR, -100, ""),
        (Opcode::GoToR, 100, ""),
    ] {
        let (position, flags) = after(0, opcode, to);
        assert_eq!((position, flags[0].as_str()), (to, format!("ACC{dir}").as_str()), "{opcode} {to}");
    }
    let seconds = |opcode, to: i64| {
        let mut bench = Bench::tuned(0, 0, 15_600, 59_000, 59_000);
        bench.order(opcode, to);
        bench.run_until_ready().as_secs_f64()
    };
    let textbook = Textbook::of(0, 15_600, 59_000, 59_000);
    let round = (ring::SIZE - 100) as f64;
    assert!((seconds(Opcode::GoToF, -100) - textbook.seconds(round)).abs() < 1e-8);
    assert!((seconds(Opcode::GoToR, 100) - textbook.seconds(round)).abs() < 1e-8);
}

#[test]
fn going_to_where_it_is_completes_at_once() {
    use Opcode::{GoTo, GoToF, GoToR};
    for opcode in [GoTo, GoToF, GoToR] {
        let mut bench = at(77);
        bench.order(opcode, 77);
        assert_eq!(bench.flags(), "STOP READY DIR");
        assert_eq!(bench.position(), 77);
    }
}

#[test]
fn zero_and_mark_are_gone_to_the_shorter_way() {
    for (from, dir) in [(1000, ""), (-1000, " DIR"), (HIGHEST, ""), (LOWEST + 1, " DIR")] {
        for opcode in [Opcode::GoZero, Opcode::GoMark] {
            let mut bench = at(from);
            bench.command(opcode);
            assert_eq!(bench.flags(), format!("ACC{dir}"), "{from}");
            bench.run_until_ready();
            assert_eq!(bench.position(), 0);
        }
    }
}

#[test]
fn a_running_motor_at_constant_speed_can_be_sent_to_a_place_ahead() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 400);
    bench.run_until_ready();
    bench.order(Opcode::GoTo, 32_000);
    assert_eq!(bench.flags_until_ready(), ["ACC DIR", "CONST_SPEED DIR", "DEC DIR", "STOP READY DIR"]);
    assert_eq!(bench.position(), 32_000);
}

#[test]
fn a_running_motor_sent_to_a_place_too_near_overshoots_and_returns() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 400);
    bench.run_until_ready();
    let near = bench.position() + 16;
    bench.order(Opcode::GoTo, near);
    assert_eq!(bench.flags_until_ready(), ["DEC DIR", "ACC", "DEC", "STOP READY"]);
    assert_eq!(bench.position(), near);
}

#[test]
fn a_running_motor_sent_to_a_place_behind_brakes_and_returns() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 400);
    bench.run_until_ready();
    bench.command(Opcode::GoZero);
    assert_eq!(bench.flags_until_ready(), ["DEC DIR", "ACC", "DEC", "STOP READY"]);
    assert_eq!(bench.position(), 0);
}

#[test]
fn a_running_motor_sent_to_where_it_is_comes_back() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 400);
    bench.run_until_ready();
    let here = bench.position();
    bench.order(Opcode::GoTo, here);
    bench.run_until_ready();
    assert_eq!((bench.position(), bench.flags().as_str()), (here, "STOP READY"));
}

#[test]
fn a_running_motor_forced_forward_to_a_place_behind_goes_all_the_way_round() {
    let mut bench = Bench::tuned(0, 0, 15_600, 59_000, 59_000);
    bench.order(Opcode::RunF, 1000);
    bench.run_until_ready();
    bench.order(Opcode::GoToF, 0);
    assert_eq!(bench.flags_until_ready(), ["ACC DIR", "CONST_SPEED DIR", "DEC DIR", "STOP READY DIR"]);
    assert_eq!(bench.position(), 0);
}

#[test]
fn lowering_max_speed_during_a_move_brakes_to_it_and_still_ends_exactly() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveF, 32_000);
    bench.run_until(|bench| bench.flags() == "CONST_SPEED DIR");
    bench.write(Reg::MaxSpeed, 300);
    assert_eq!(bench.flags_until_ready(), ["DEC DIR", "CONST_SPEED DIR", "DEC DIR", "STOP READY DIR"]);
    assert_eq!(bench.position(), 32_000);
}

#[test]
fn raising_max_speed_during_a_move_shortens_it() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveF, 64_000);
    bench.run_until(|bench| bench.flags() == "CONST_SPEED DIR");
    bench.write(Reg::MaxSpeed, 2000);
    assert_eq!(bench.flags(), "ACC DIR");
    let total = bench.now.as_nanos() as f64 / 1e9 + bench.run_until_ready().as_secs_f64();
    assert!(
        (total - Textbook { max: 1998.9, ..Textbook::factory() }.seconds(4000.0)).abs() < 1e-3,
        "{total}"
    );
    assert_eq!(bench.position(), 64_000);
}

#[test]
fn resetting_the_position_in_a_move_shifts_its_end() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveF, 3200);
    bench.run_for(500 * MS);
    let passed = bench.position();
    bench.trigger(Reg::ResetPos);
    assert_eq!(bench.position(), 0);
    bench.run_until_ready();
    assert_eq!(bench.position(), 3200 - passed);
}

#[test]
fn a_move_shorter_than_a_ramp_from_min_speed_still_ends_exactly() {
    for displacement in 1..40 {
        let mut bench = Bench::tuned(4, 950, 1000, 15, 15);
        bench.order(Opcode::MoveF, displacement);
        bench.run_until_ready();
        assert_eq!(bench.position(), displacement);
    }
}
