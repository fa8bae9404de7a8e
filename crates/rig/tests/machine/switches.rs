//! Switches: when they close and open, and what the controller sees of it.
#![allow(clippy::float_cmp, reason = "places are exact")]

use crate::bench::{Bench, MS, SECOND, assert_takes, switch, textbook_seconds};
use core::time::Duration;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

/// Runs until `Inputs` is `levels`, and answers how long that took.
fn until_inputs(bench: &mut Bench, levels: i64) -> Duration {
    bench.run_until(|bench| bench.read(Reg::Inputs) == levels)
}

#[test]
fn a_switch_closes_and_opens_at_the_instants_of_the_closed_form() {
    for (opcode, closed) in [(Opcode::RunF, [100.0, 120.0]), (Opcode::RunR, [-120.0, -100.0])] {
        for speed in [100, 400, 1000] {
            let mut bench = Bench::new(&switch("IN0", closed[0], closed[1]));
            bench.order(opcode, speed);
            let closes = until_inputs(&mut bench, 1);
            assert_takes(closes, textbook_seconds(speed, 100.0));
            assert_eq!(bench.carriage().abs(), 100.0);
            let opens = closes + until_inputs(&mut bench, 0);
            // The first microstep of 1/16 behind the switch.
            assert_takes(opens, textbook_seconds(speed, 120.0 + 1.0 / 16.0));
            assert_eq!(bench.carriage().abs(), 120.0625);
        }
    }
}

#[test]
fn a_nanosecond_before_a_switch_closes_it_is_open() {
    let mut bench = Bench::new(&switch("IN0", 100.0, 120.0));
    bench.order(Opcode::RunF, 400);
    let mut early = bench.clone();
    let closes = until_inputs(&mut bench, 1);
    early.run_for(closes.saturating_sub(Duration::from_nanos(1)));
    assert_eq!(early.read(Reg::Inputs), 0);
    assert!(early.carriage() < 100.0);
    early.run_for(Duration::from_nanos(1));
    assert_eq!((early.read(Reg::Inputs), early.carriage()), (1, 100.0));
}

#[test]
fn an_edge_between_two_microsteps_is_met_by_the_first_one_past_it() {
    // At 1/16 the rotor stands at 0.0625, 0.125 ...
    let mut bench = Bench::new(&switch("IN0", 0.07, 0.3));
    for (microstep, closed) in [(1, 0), (2, 1), (3, 1), (4, 1), (5, 0)] {
        bench.go(Opcode::MoveF, 1);
        assert_eq!(bench.read(Reg::Inputs), closed, "microstep {microstep}");
    }
    for (microstep, closed) in [(4, 1), (3, 1), (2, 1), (1, 0)] {
        bench.go(Opcode::MoveR, 1);
        assert_eq!(bench.read(Reg::Inputs), closed, "microstep {microstep}");
    }
}

#[test]
fn both_ends_of_a_switch_belong_to_it() {
    let mut bench = Bench::new(&switch("IN0", 1.0, 2.0));
    for (microsteps, closed) in [(15, 0), (1, 1), (16, 1), (1, 0)] {
        bench.go(Opcode::MoveF, microsteps);
        assert_eq!(bench.read(Reg::Inputs), closed, "at {}", bench.carriage());
    }
}

#[test]
fn a_switch_between_two_places_of_the_rotor_is_never_met() {
    for (microstepping, meets) in [(0, false), (1, true), (4, true)] {
        let mut bench = Bench::new(&switch("SW", 10.4, 10.6));
        bench.write(Reg::Microstepping, microstepping);
        bench.order(Opcode::RunF, 400);
        bench.run_for(SECOND);
        assert!(bench.carriage() > 50.0);
        assert_eq!(bench.read(Reg::SwEvn) == 1, meets, "1/{}", 1 << microstepping);
        assert_eq!(bench.read(Reg::SwF), 0);
    }
}

#[test]
fn a_narrow_switch_behind_a_coarse_step_hides_none_that_comes_later() {
    let lines = switch("IN0", 10.4, 10.6) + &switch("IN1", 20.0, 21.0);
    let mut bench = Bench::new(&lines);
    bench.write(Reg::Microstepping, 0);
    bench.order(Opcode::ScanMarkF, 400);
    bench.run_until_ready();
    assert_eq!(bench.position(), 20);
}

#[test]
fn overlapping_switches_on_one_input_are_one() {
    let lines = switch("SW", 10.0, 20.0) + &switch("SW", 15.0, 30.0) + &switch("SW", 30.0, 31.0);
    let mut bench = Bench::new(&lines);
    for (place, closed, event) in [
        (5, 0, 0),
        (10, 1, 1),
        (14, 1, 0),
        (15, 1, 0),
        (21, 1, 0),
        (30, 1, 0),
        (31, 1, 0),
        (32, 0, 0),
        (31, 1, 1),
    ] {
        bench.go(Opcode::GoTo, place * 16);
        assert_eq!((bench.read(Reg::SwF), bench.read(Reg::SwEvn)), (closed, event), "at {place}");
        bench.write(Reg::Clr, 1);
    }
}

#[test]
fn switches_on_several_inputs_may_share_an_edge() {
    let lines = switch("IN0", 10.0, 20.0) + &switch("IN1", 10.0, 15.0) + &switch("EN", 5.0, 10.0);
    let mut bench = Bench::new(&lines);
    let mut seen = vec![0];
    bench.order(Opcode::RunF, 400);
    while bench.step(bench.now + SECOND) {
        seen.push(bench.read(Reg::Inputs));
    }
    seen.dedup();
    assert_eq!(seen, [0, 0b1_0000, 0b1_0011, 0b11, 0b01, 0]);
}

#[test]
fn starting_inside_a_switch_is_no_event() {
    let lines = format!("[drive.mechanics]\nstart = 5.0\n{}", switch("SW", 0.0, 10.0));
    let mut bench = Bench::new(&lines);
    assert_eq!((bench.read(Reg::SwF), bench.read(Reg::SwEvn), bench.read(Reg::Inputs)), (1, 0, 8));
    bench.go(Opcode::MoveF, 100 * 16);
    assert_eq!((bench.read(Reg::SwF), bench.read(Reg::SwEvn)), (0, 0));
    bench.go(Opcode::MoveR, 100 * 16);
    assert_eq!((bench.read(Reg::SwF), bench.read(Reg::SwEvn)), (1, 1));
}

#[test]
fn a_pass_over_a_switch_is_latched() {
    let mut bench = Bench::new(&switch("SW", 100.0, 100.1));
    bench.go(Opcode::MoveF, 200 * 16);
    assert_eq!((bench.read(Reg::SwF), bench.read(Reg::SwEvn)), (0, 1));
}

#[test]
fn a_program_whose_move_ends_on_a_switch_sees_it() {
    for (microsteps, sees) in [(1599, false), (1600, true)] {
        let mut bench = Bench::new(&switch("IN0", 100.0, 120.0));
        bench.store(&[
            Instruction::with_position(Opcode::MoveF, microsteps),
            Instruction::with_position(Opcode::GotoProgramIfIn0, 3),
            Instruction::with_position(Opcode::End, 0),
            Instruction::with_position(Opcode::SetRele, 0),
        ]);
        bench.command(Opcode::StartProgramMem0);
        bench.run_until(|bench| bench.read(Reg::ProgramRun) == 0);
        assert_eq!(bench.read(Reg::Relay) == 1, sees, "after {microsteps}");
    }
}

#[test]
fn a_wait_in_a_program_ends_at_the_instant_of_the_switch() {
    let mut bench = Bench::new(&switch("IN1", 100.0, 120.0));
    bench.store(&[
        Instruction::with_position(Opcode::WaitIn1, 0),
        Instruction::with_position(Opcode::HardStop, 0),
    ]);
    bench.command(Opcode::StartProgramMem0);
    bench.order(Opcode::RunF, 400);
    let time = bench.run_until(|bench| bench.read(Reg::Stop) == 1);
    assert_takes(time, textbook_seconds(400, 100.0));
    assert_eq!(bench.carriage(), 100.0);
}

#[test]
fn a_signal_from_elsewhere_adds_to_the_switches() {
    let mut bench = Bench::new(&switch("IN0", 10.0, 20.0));
    let now = |bench: &Bench| bench.now;
    bench.machine.set_signal(now(&bench), Input::In0, true);
    assert_eq!(bench.read(Reg::Inputs), 1);
    bench.go(Opcode::GoTo, 15 * 16);
    bench.machine.set_signal(now(&bench), Input::In0, false);
    assert_eq!(bench.read(Reg::Inputs), 1, "the switch is closed");
    bench.machine.set_signal(now(&bench), Input::In0, true);
    bench.go(Opcode::GoTo, 0);
    assert_eq!(bench.read(Reg::Inputs), 1, "the wire is not off");
    bench.machine.set_signal(now(&bench), Input::In0, false);
    assert_eq!(bench.read(Reg::Inputs), 0);
}

#[test]
fn a_signal_from_elsewhere_ends_a_seek_at_its_instant() {
    let mut bench = Bench::new("");
    bench.order(Opcode::GoUntilF, 4);
    bench.now = bench.now + 2 * SECOND;
    bench.machine.set_signal(bench.now, Input::En, true);
    assert_eq!(bench.read(Reg::DecFlag), 1);
    bench.run_until_ready();
    assert_eq!(bench.machine.next_wake(), None);
}

#[test]
fn resetting_position_or_chip_does_not_move_the_switches() {
    for coil in [Reg::ResetPos, Reg::ResetPowerstep01] {
        let mut bench = Bench::new(&switch("SET_ZERO", 100.0, 120.0));
        bench.go(Opcode::MoveF, 50 * 16);
        bench.write(coil, 1);
        bench.go(Opcode::ScanZeroF, 100);
        assert_eq!(bench.carriage(), 100.0);
    }
}

#[test]
fn a_change_of_microstep_does_not_move_the_switches() {
    let mut bench = Bench::new(&switch("SET_ZERO", 100.0, 120.0));
    bench.go(Opcode::MoveF, 50 * 16 + 3);
    for microstepping in [7, 0, 5] {
        bench.command(Opcode::HardHiZ);
        bench.write(Reg::Microstepping, microstepping);
        bench.go(Opcode::MoveF, 3);
    }
    bench.command(Opcode::HardHiZ);
    bench.write(Reg::Microstepping, 4);
    bench.go(Opcode::ScanZeroF, 100);
    assert!((100.0..100.0625).contains(&bench.carriage()), "{}", bench.carriage());
}

#[test]
fn a_switch_beyond_the_ring_of_the_counter_is_met() {
    let mut bench = Bench::new(&switch("SET_ZERO", 20_000.0, 20_001.0));
    bench.write(Reg::Microstepping, 7);
    bench.write(Reg::MaxSpeed, 15_600);
    bench.go(Opcode::ScanZeroF, 5000);
    assert_eq!(bench.carriage(), 20_000.0);
}

#[test]
fn a_machine_at_rest_asks_for_no_wake_up() {
    let mut bench = Bench::new(&switch("IN0", 0.0, 20.0));
    assert_eq!(bench.machine.next_wake(), None);
    bench.go(Opcode::MoveF, 50 * 16);
    assert_eq!(bench.machine.next_wake(), None);
    bench.write(Reg::HardHiZ, 1);
    assert_eq!(bench.machine.next_wake(), None);
}

#[test]
fn a_cruising_machine_wakes_at_switches_and_never_again_when_they_are_behind() {
    let mut bench = Bench::new(&(switch("IN0", 1000.0, 1020.0) + &switch("IN1", -5.0, -1.0)));
    bench.order(Opcode::RunF, 500);
    bench.run_for(3600 * SECOND);
    // The speed is reached, the switch closes, it opens.
    assert_eq!((bench.wakes, bench.machine.next_wake()), (3, None));
}

#[test]
fn requests_in_flight_leave_the_wake_up_at_the_switch_where_it_belongs() {
    let mut bench = Bench::new(&switch("IN0", 500.0, 520.0));
    bench.order(Opcode::RunF, 300);
    for speed in (100..1000).step_by(45) {
        bench.run_for(50 * MS);
        bench.order(Opcode::RunF, speed);
    }
    until_inputs(&mut bench, 1);
    assert_eq!(bench.carriage(), 500.0);
    bench.order(Opcode::RunR, 300);
    bench.run_until(|bench| bench.read(Reg::DirFlag) == 0);
    until_inputs(&mut bench, 1);
    assert_eq!(bench.carriage(), 520.0);
    until_inputs(&mut bench, 0);
    assert_eq!(bench.carriage(), 500.0 - 0.0625);
}
