//! Homing on the demo rig's stage, from wherever it stands, and seeking its mark.
#![allow(clippy::float_cmp, reason = "places are exact")]

use crate::bench::{Bench, SECOND, assert_takes, switch, textbook_seconds, travel};
use stepdrive_drive::smsd::Memory;
use stepdrive_rig::file::{DEMO, RigFile};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

/// The stage of the demo rig, with its carriage at `start`.
fn stage(start: f64) -> Bench {
    let lines =
        travel(-2000.0, 2000.0, start) + &switch("SET_ZERO", -120.0, -100.0) + &switch("IN1", 300.0, 320.0);
    Bench::new(&lines)
}

#[test]
fn the_stage_here_is_the_one_of_the_demo_rig() {
    let demo = RigFile::parse(DEMO).expect("valid");
    let demo = &demo.drives[0];
    let demo = format!("{:?}", demo.smsd().expect("an SMSD").power_up(demo, Memory::factory()));
    let machine = format!("{:?}", stage(0.0).machine);
    let mechanics = |text: &str| text[text.find("mechanics").expect("there")..].to_owned();
    assert_eq!(mechanics(&demo), mechanics(&machine));
}

#[test]
fn from_outside_homing_stops_at_the_near_edge_of_the_switch() {
    for (opcode, start, edge) in [
        (Opcode::ScanZeroR, 0.0, -100.0),
        (Opcode::ScanZeroR, 1500.0, -100.0),
        (Opcode::ScanZeroF, -150.0, -120.0),
        (Opcode::ScanZeroF, -2000.0, -120.0),
    ] {
        let mut bench = stage(start);
        bench.order(opcode, 400);
        let time = bench.run_until_ready();
        assert_takes(time, textbook_seconds(400, (edge - start).abs()));
        assert_eq!((bench.carriage(), bench.position()), (edge, 0), "from {start}");
        bench.run_for(SECOND);
        assert_eq!(bench.carriage(), edge);
    }
}

#[test]
fn from_inside_the_switch_homing_is_done_where_it_stands() {
    for start in [-120.0, -110.0, -100.0] {
        let mut bench = stage(start);
        bench.order(Opcode::ScanZeroR, 400);
        assert_eq!((bench.read(Reg::Ready), bench.read(Reg::HiZ)), (1, 0));
        assert_eq!((bench.carriage(), bench.position()), (start, 0));
    }
}

#[test]
fn from_beyond_the_switch_homing_runs_into_the_end_and_seeks_for_ever() {
    let mut bench = stage(-500.0);
    bench.order(Opcode::ScanZeroR, 400);
    bench.run_for(60 * SECOND);
    assert_eq!((bench.carriage(), bench.stalled(), bench.read(Reg::Ready)), (-2000.0, true, 0));
    bench.go(Opcode::ScanZeroF, 400);
    assert_eq!((bench.carriage(), bench.position(), bench.stalled()), (-120.0, 0, false));
}

#[test]
fn homing_again_after_coming_off_the_switch_ends_at_the_same_place() {
    let mut bench = stage(0.0);
    bench.go(Opcode::ScanZeroR, 400);
    for distance in [1, 7, 1600, 10_000] {
        bench.go(Opcode::MoveF, distance);
        bench.go(Opcode::ScanZeroR, 1000);
        assert_eq!((bench.carriage(), bench.position()), (-100.0, 0), "after {distance}");
    }
}

#[test]
fn the_mark_is_sought_and_gone_back_to() {
    let mut bench = stage(0.0);
    bench.go(Opcode::ScanZeroR, 400);
    bench.go(Opcode::ScanMark2F, 400);
    assert!(bench.carriage() > 370.0, "it has braked behind the edge");
    bench.command(Opcode::GoMark);
    bench.run_until_ready();
    assert_eq!((bench.carriage(), bench.position()), (300.0, 400 * 16));
}

#[test]
fn go_until_a_switch_brakes_behind_it() {
    let mut bench = stage(0.0);
    bench.go(Opcode::GoUntilF, 1);
    let braked = bench.carriage() - 300.0;
    // The triangle is not cut off: 300 full steps do not suffice for MAX_SPEED, so it brakes as far as it has come.
    assert!((braked - 300.0).abs() < 0.1, "{braked}");
}

#[test]
fn a_masked_home_switch_is_run_over() {
    let mut bench = stage(0.0);
    bench.write(Reg::Mask, 0xFB);
    bench.order(Opcode::ScanZeroR, 400);
    bench.run_for(2 * SECOND);
    assert!(bench.carriage() < -120.0);
    assert_eq!(bench.read(Reg::Ready), 0);
}

#[test]
fn an_autonomous_program_homes_at_power_up() {
    let mut writer = stage(0.0);
    writer.store(&[
        Instruction::with_position(Opcode::ScanZeroR, 400),
        Instruction::with_position(Opcode::MoveF, 1600),
    ]);
    let memory = writer.machine.drive().memory().clone();
    let lines = "autonomous = true\nmode_n_programs = 0\n".to_owned() + &switch("SET_ZERO", -120.0, -100.0);
    let mut bench = Bench::remembering(&lines, memory);
    bench.run_for(10 * SECOND);
    assert_eq!((bench.carriage(), bench.position()), (0.0, 1600));
    assert_eq!(bench.read(Reg::ProgramRun), 0);
}
