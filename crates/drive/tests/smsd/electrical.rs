//! `EL_POS`, the microstep modes, and the change to full steps at speed.

use crate::bench::{Bench, MS, SECOND};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

fn el_pos(bench: &mut Bench) -> i64 {
    bench.read(Reg::ElPos)
}

fn move_by(bench: &mut Bench, displacement: i64) {
    bench.order(Opcode::MoveF, displacement);
    bench.run_until_ready();
}

#[test]
fn a_microstep_is_its_share_of_128_in_every_mode() {
    for microstepping in 0..=7 {
        let mut bench = Bench::tuned(microstepping, 0, 1000, 1000, 1000);
        let unit = 128 >> microstepping;
        move_by(&mut bench, 1);
        assert_eq!(el_pos(&mut bench), unit, "1/{}", 1 << microstepping);
        move_by(&mut bench, -2);
        assert_eq!(el_pos(&mut bench), 512 - unit);
    }
}

#[test]
fn the_electrical_position_repeats_every_four_full_steps() {
    for microstepping in 0..=7 {
        let mut bench = Bench::tuned(microstepping, 0, 1000, 1000, 1000);
        for step in 1..=9 {
            move_by(&mut bench, 1 << microstepping);
            assert_eq!(el_pos(&mut bench), step % 4 * 128);
        }
    }
}

#[test]
fn resetting_the_position_leaves_the_electrical_position() {
    let mut bench = Bench::new();
    move_by(&mut bench, 5);
    bench.trigger(Reg::ResetPos);
    assert_eq!((bench.position(), el_pos(&mut bench)), (0, 5 * 8));
}

#[test]
fn a_change_of_microstep_keeps_the_position_number_and_restarts_the_electrical_position() {
    let mut bench = Bench::new();
    move_by(&mut bench, 37);
    bench.command(Opcode::HardHiZ);
    bench.write(Reg::Microstepping, 7);
    assert_eq!((bench.position(), el_pos(&mut bench)), (37, 0));
    move_by(&mut bench, 128);
    assert_eq!((bench.position(), el_pos(&mut bench)), (165, 128));
    assert_eq!(bench.drive.rotor(bench.now), 37 * 16 + 256);
}

#[test]
fn writing_the_present_microstep_again_changes_nothing() {
    let mut bench = Bench::new();
    move_by(&mut bench, 37);
    bench.command(Opcode::HardHiZ);
    bench.write(Reg::Microstepping, 4);
    assert_eq!(el_pos(&mut bench), 37 * 8);
}

#[test]
fn speeds_are_full_steps_in_every_microstep_mode() {
    for microstepping in 0..=7 {
        let mut bench = Bench::tuned(microstepping, 0, 1000, 1000, 1000);
        bench.order(Opcode::RunF, 640);
        bench.run_until_ready();
        assert_eq!(bench.speed(), 640);
        let before = bench.position();
        bench.run_for(SECOND);
        assert_eq!(bench.position() - before, 640 << microstepping);
    }
}

#[test]
fn above_fs_speed_the_motor_is_driven_in_whole_steps() {
    let mut bench = Bench::new();
    bench.write(Reg::FsSpeed, 300);
    bench.order(Opcode::RunF, 600);
    let mut microsteps_below = false;
    while bench.drive.speed(bench.now) < 290.0 {
        microsteps_below |= el_pos(&mut bench) % 128 != 0;
        bench.run_for(MS);
    }
    assert!(microsteps_below);
    bench.run_until_ready();
    for _ in 0..200 {
        bench.run_for(MS / 7);
        let (position, el_pos) = (bench.position(), el_pos(&mut bench));
        assert_eq!(el_pos, position.div_euclid(16) * 128 % 512, "whole steps only");
    }
    bench.command(Opcode::SoftStop);
    bench.run_until_ready();
    assert_eq!(el_pos(&mut bench), bench.position() * 8 % 512, "microsteps again");
}

#[test]
fn the_change_to_full_steps_waits_for_a_whole_step_and_loses_no_microstep() {
    let mut bench = Bench::tuned(7, 0, 1000, 1000, 1000);
    bench.write(Reg::FsSpeed, 300);
    bench.order(Opcode::RunF, 600);
    bench.run_until_ready();
    bench.command(Opcode::HardStop);
    bench.trigger(Reg::ResetPos);
    let origin = (el_pos(&mut bench) - bench.position()).rem_euclid(512);
    bench.order(Opcode::RunF, 600);
    let mut changed = None;
    for _ in 0..40_000 {
        bench.run_for(MS / 100);
        let (exact, shown) = ((bench.position() + origin).rem_euclid(512), el_pos(&mut bench));
        assert!(shown == exact || shown == exact / 128 * 128, "{exact} shows as {shown}");
        if shown != exact && changed.is_none() {
            changed = Some(bench.drive.speed(bench.now));
            assert!(exact % 128 < 16, "the change came at {exact}, inside a step");
        }
    }
    let speed = changed.expect("the threshold was passed");
    assert!((300.0..320.0).contains(&speed), "{speed}");
}

#[test]
fn at_the_highest_fs_speed_the_motor_never_leaves_its_microsteps() {
    let mut bench = Bench::tuned(4, 0, 15_600, 59_000, 59_000);
    bench.order(Opcode::RunF, 15_600);
    bench.run_until_ready();
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..2000 {
        bench.run_for(MS / 50);
        seen.insert(el_pos(&mut bench) % 128);
    }
    assert_eq!(seen.len(), 16);
}

#[test]
fn fs_speed_may_change_in_motion() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 600);
    bench.run_until_ready();
    let whole_steps = |bench: &mut Bench| {
        (0..100).all(|_| {
            bench.run_for(MS / 7);
            el_pos(bench) % 128 == 0
        })
    };
    assert!(!whole_steps(&mut bench));
    bench.write(Reg::FsSpeed, 100);
    bench.run_for(10 * MS);
    assert!(whole_steps(&mut bench));
    bench.write(Reg::FsSpeed, 15_600);
    bench.run_for(10 * MS);
    assert!(!whole_steps(&mut bench));
}
