//! Running at a speed: how it is reached, changed, turned round, and where the position counter closes its ring.

use crate::bench::{Bench, MICROSTEPS, MS, SECOND, Textbook, assert_takes};
use core::time::Duration;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::powerstep01 as scale;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::status::MotStatus;

/// The acceleration that the factory's 1000 becomes.
const ACC: f64 = 69.0 / 0.068_719_476_736;

fn running(opcode: Opcode, speed: i64) -> Bench {
    let mut bench = Bench::new();
    bench.order(opcode, speed);
    bench.run_until_ready();
    bench
}

#[test]
fn a_run_is_ready_when_its_speed_is_reached_and_goes_on() {
    for (opcode, dir, sign) in [(Opcode::RunF, " DIR", 1), (Opcode::RunR, "", -1)] {
        let mut bench = Bench::new();
        bench.order(opcode, 800);
        assert_eq!(bench.flags(), format!("ACC{dir}"));
        assert_takes(bench.run_until_ready(), scale::SPEED.round(800.0) / ACC);
        assert_eq!(bench.flags(), format!("CONST_SPEED READY{dir}"));
        let before = bench.position();
        bench.run_for(10 * SECOND);
        assert_eq!(bench.flags(), format!("CONST_SPEED READY{dir}"));
        let turned = (sign * (bench.position() - before)) as f64;
        assert!((turned - 10.0 * scale::SPEED.round(800.0) * MICROSTEPS as f64).abs() <= 1.0, "{turned}");
    }
}

#[test]
fn a_cruising_motor_asks_for_no_wake_up() {
    let bench = running(Opcode::RunF, 800);
    assert_eq!(bench.drive.next_wake(), None);
}

#[test]
fn speed_reads_as_the_chip_turns_rounded_to_whole_steps() {
    for (max, shown) in [(1000, 1007), (16, 15), (15_600, 15_594), (400, 397)] {
        let mut bench = Bench::tuned(4, 0, max, 59_000, 59_000);
        assert_eq!(bench.read(Reg::MaxSpeed), max, "the register keeps what was written");
        bench.order(Opcode::GoUntilF, 0);
        bench.run_for(2 * SECOND);
        assert_eq!(bench.speed(), shown, "MAX_SPEED {max}");
    }
}

#[test]
fn speed_has_no_sign_and_is_zero_at_standstill() {
    let mut bench = running(Opcode::RunR, 500);
    assert_eq!(bench.speed(), 500);
    bench.command(Opcode::HardStop);
    assert_eq!(bench.speed(), 0);
}

#[test]
fn a_run_starts_at_min_speed() {
    let mut bench = Bench::tuned(4, 200, 1000, 1000, 1000);
    bench.order(Opcode::RunF, 600);
    assert_eq!(bench.speed(), 200);
    let ramp = scale::SPEED.round(600.0) - scale::MIN_SPEED.round(200.0);
    assert_takes(bench.run_until_ready(), ramp / ACC);
}

#[test]
fn a_run_below_min_speed_turns_at_min_speed() {
    let mut bench = Bench::tuned(4, 200, 1000, 1000, 1000);
    bench.order(Opcode::RunF, 50);
    assert_eq!(bench.flags(), "CONST_SPEED READY DIR");
    assert_eq!((bench.speed(), bench.cmd_error()), (200, false));
}

#[test]
fn a_run_above_max_speed_turns_at_max_speed() {
    let mut bench = running(Opcode::RunF, 15_600);
    assert_eq!((bench.speed(), bench.cmd_error()), (1007, false));
}

#[test]
fn a_min_speed_above_max_speed_gives_way_to_it() {
    let mut bench = Bench::tuned(4, 950, 16, 1000, 1000);
    bench.order(Opcode::RunF, 500);
    assert_eq!((bench.flags().as_str(), bench.speed()), ("CONST_SPEED READY DIR", 15));
}

#[test]
fn another_run_in_the_same_direction_changes_the_speed_on_the_way() {
    let mut bench = running(Opcode::RunF, 400);
    bench.order(Opcode::RunF, 900);
    assert_eq!(bench.flags(), "ACC DIR");
    assert_takes(bench.run_until_ready(), (scale::SPEED.round(900.0) - scale::SPEED.round(400.0)) / ACC);
    bench.order(Opcode::RunF, 100);
    assert_eq!(bench.flags(), "DEC DIR");
    bench.run_until_ready();
    assert_eq!((bench.flags().as_str(), bench.speed()), ("CONST_SPEED READY DIR", 100));
}

#[test]
fn the_same_run_again_changes_nothing() {
    let mut bench = running(Opcode::RunF, 400);
    bench.order(Opcode::RunF, 400);
    assert_eq!(bench.flags(), "CONST_SPEED READY DIR");
}

#[test]
fn the_same_run_again_while_it_accelerates_does_not_delay_it() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 800);
    bench.run_for(300 * MS);
    bench.order(Opcode::RunF, 800);
    let rest = bench.run_until_ready();
    assert_takes(rest + 300 * MS, scale::SPEED.round(800.0) / ACC);
}

#[test]
fn a_run_in_the_other_direction_brakes_first_and_turns_its_direction_flag_at_the_reversal() {
    let mut bench = running(Opcode::RunF, 500);
    let start = bench.position();
    bench.order(Opcode::RunR, 300);
    assert_eq!(bench.drive.status(bench.now).motion, MotStatus::Decelerating);
    assert_eq!(bench.flags(), "DEC DIR");
    let braking = bench.run_until(|bench| bench.flags() == "ACC");
    assert_takes(braking, scale::SPEED.round(500.0) / ACC);
    let turn = bench.position();
    let distance = scale::SPEED.round(500.0).powi(2) / (2.0 * ACC) * MICROSTEPS as f64;
    assert!((turn - start) as f64 - distance < 1.0, "the rotor stands on the last microstep emitted");
    assert_takes(bench.run_until_ready(), scale::SPEED.round(300.0) / ACC);
    assert_eq!(bench.flags(), "CONST_SPEED READY");
    assert!(bench.position() < turn);
}

#[test]
fn a_reversal_at_no_more_than_min_speed_needs_no_braking() {
    let mut bench = Bench::tuned(4, 300, 1000, 1000, 1000);
    bench.order(Opcode::RunF, 15);
    bench.order(Opcode::RunR, 15);
    assert_eq!(bench.flags(), "CONST_SPEED READY");
}

#[test]
fn two_reversals_in_a_row_leave_the_first_direction() {
    let mut bench = running(Opcode::RunF, 500);
    bench.order(Opcode::RunR, 500);
    bench.run_for(100 * MS);
    bench.order(Opcode::RunF, 500);
    assert_eq!(bench.flags_until_ready(), ["ACC DIR", "CONST_SPEED READY DIR"]);
}

#[test]
fn lowering_max_speed_brakes_a_run_to_it_and_raising_it_lets_the_run_resume_its_speed() {
    let mut bench = running(Opcode::RunF, 800);
    bench.write(Reg::MaxSpeed, 400);
    assert_eq!((bench.read(Reg::DecFlag), bench.read(Reg::MaxSpeed)), (1, 400));
    let slow = scale::MAX_SPEED.round(400.0);
    let braking = bench.run_until(|bench| bench.read(Reg::ConstSpeed) == 1);
    assert_takes(braking, (scale::SPEED.round(800.0) - slow) / ACC);
    assert_eq!(bench.speed(), 397);
    bench.write(Reg::MaxSpeed, 2000);
    assert_eq!(bench.read(Reg::AccFlag), 1);
    bench.run_until(|bench| bench.read(Reg::ConstSpeed) == 1);
    assert_eq!(bench.speed(), 800);
}

#[test]
fn a_change_of_max_speed_is_no_command_and_leaves_ready_as_it_was() {
    let mut bench = running(Opcode::RunF, 800);
    bench.write(Reg::MaxSpeed, 400);
    assert_eq!(bench.flags(), "DEC READY DIR");
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 800);
    bench.run_for(700 * MS);
    bench.write(Reg::MaxSpeed, 400);
    assert_eq!(bench.flags_until_ready(), ["DEC DIR", "CONST_SPEED READY DIR"]);
}

#[test]
fn a_max_speed_that_is_not_in_the_way_changes_nothing_in_flight() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    bench.run_for(100 * MS);
    bench.write(Reg::MaxSpeed, 5000);
    let rest = bench.run_until_ready();
    assert_takes(rest + 100 * MS, scale::SPEED.round(500.0) / ACC);
}

#[test]
fn a_run_may_take_over_from_a_move() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveF, 320_000);
    bench.run_for(SECOND / 2);
    bench.order(Opcode::RunR, 200);
    assert_eq!(bench.flags_until_ready(), ["DEC DIR", "ACC", "CONST_SPEED READY"]);
}

#[test]
fn the_counter_runs_over_both_ends_of_its_ring() {
    for (opcode, end, beyond) in
        [(Opcode::RunF, 2_097_151, -2_097_152), (Opcode::RunR, -2_097_152, 2_097_151)]
    {
        let mut bench = Bench::tuned(0, 0, 15_600, 59_000, 59_000);
        bench.order(Opcode::GoTo, end);
        bench.run_until_ready();
        bench.order(opcode, 16);
        bench.run_for(SECOND);
        let past = bench.position();
        assert!((past - beyond).abs() < 20, "{end} and on reads {past}");
        bench.order(opcode, 15_600);
        // A whole turn of the ring and more.
        bench.run_for(300 * SECOND);
        let position = bench.position();
        assert!((-2_097_152..=2_097_151).contains(&position), "{position}");
        bench.command(Opcode::HardStop);
        bench.command(Opcode::GoZero);
        bench.run_until_ready();
        assert_eq!(bench.position(), 0);
    }
}

#[test]
fn the_step_over_the_end_of_the_ring_is_one_microstep() {
    let mut bench = Bench::tuned(0, 0, 1000, 1000, 1000);
    bench.order(Opcode::GoToR, 2_097_151);
    bench.run_until_ready();
    bench.order(Opcode::MoveF, 1);
    bench.run_until_ready();
    assert_eq!(bench.position(), -2_097_152);
    bench.order(Opcode::MoveR, 1);
    bench.run_until_ready();
    assert_eq!(bench.position(), 2_097_151);
}

#[test]
fn a_run_of_an_hour_costs_one_wake_up() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 800);
    bench.run_for(3600 * SECOND);
    assert_eq!(bench.wakes, 1);
    let speed = scale::SPEED.round(800.0);
    let microsteps = (3600.0 - speed / ACC / 2.0) * speed * MICROSTEPS as f64;
    let off = (bench.position() as f64 - microsteps).rem_euclid(4_194_304.0);
    assert!(off.min(4_194_304.0 - off) <= 1.0, "{off} microsteps off");
}

#[test]
fn a_motor_that_has_run_stands_where_the_textbook_says() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    bench.run_for(2 * SECOND);
    let start = bench.position();
    bench.command(Opcode::SoftStop);
    let time = bench.run_until_ready();
    let Textbook { dec, .. } = Textbook::factory();
    assert_takes(time, scale::SPEED.round(500.0) / dec);
    let distance = scale::SPEED.round(500.0).powi(2) / (2.0 * dec) * MICROSTEPS as f64;
    assert!(((bench.position() - start) as f64 - distance).abs() <= 1.0);
    assert_eq!(bench.run_until_ready(), Duration::ZERO);
}
