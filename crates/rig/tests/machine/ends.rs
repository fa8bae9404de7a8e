//! Hard ends: the rotor stalls, the counter runs on, the mechanics does not.
#![allow(clippy::float_cmp, reason = "places are exact")]

use crate::bench::{Bench, SECOND, switch, travel};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

#[test]
fn at_an_end_the_counter_runs_on_and_the_carriage_does_not() {
    for (opcode, end, sign) in [(Opcode::MoveF, 10.0, 1), (Opcode::MoveR, -10.0, -1)] {
        let mut bench = Bench::new(&travel(-10.0, 10.0, 0.0));
        bench.order(opcode, 100 * 16);
        let mut stalled = false;
        while bench.read(Reg::Ready) == 0 {
            stalled |= bench.stalled();
            assert!(bench.carriage().abs() <= 10.0);
            bench.run_for(SECOND / 100);
        }
        assert!(stalled);
        assert_eq!((bench.carriage(), bench.position()), (end, sign * 1600));
        assert!(!bench.stalled(), "nothing drives it any more");
    }
}

#[test]
fn an_end_is_never_noticed_by_the_controller() {
    let mut bench = Bench::new(&travel(-10.0, 10.0, 0.0));
    bench.order(Opcode::RunF, 500);
    bench.run_for(10 * SECOND);
    assert!(bench.stalled());
    assert_eq!((bench.read(Reg::ConstSpeed), bench.read(Reg::CmdError), bench.read(Reg::Speed)), (1, 0, 500));
}

#[test]
fn the_carriage_leaves_an_end_with_the_first_microstep_back() {
    let mut bench = Bench::new(&travel(-10.0, 10.0, 0.0));
    bench.go(Opcode::MoveF, 100 * 16);
    bench.go(Opcode::MoveR, 1);
    assert_eq!(bench.carriage(), 10.0 - 0.0625);
    bench.go(Opcode::GoTo, 0);
    assert_eq!(bench.carriage(), -10.0, "the counter has lost the place");
}

#[test]
fn a_reversal_against_an_end_leaves_it_at_the_turn() {
    let mut bench = Bench::new(&travel(-10.0, 10.0, 0.0));
    bench.order(Opcode::RunF, 500);
    bench.run_for(2 * SECOND);
    bench.order(Opcode::RunR, 500);
    assert_eq!((bench.carriage(), bench.stalled()), (10.0, true));
    bench.run_until(|bench| bench.read(Reg::DirFlag) == 0);
    let turn = bench.position();
    assert!(bench.carriage() == 10.0 && !bench.stalled());
    bench.run_for(SECOND / 10);
    let back = (turn - bench.position()) as f64 / 16.0;
    assert!(back > 1.0);
    assert_eq!(bench.carriage(), 10.0 - back);
}

#[test]
fn a_reversal_at_once_leaves_an_end_at_once() {
    let mut bench = Bench::new(&travel(-10.0, 10.0, 0.0));
    bench.write(Reg::MinSpeed, 300);
    bench.order(Opcode::RunF, 15);
    bench.run_for(SECOND);
    let turn = bench.position();
    bench.order(Opcode::RunR, 15);
    bench.run_for(SECOND / 100);
    assert_eq!(bench.carriage(), 10.0 - (turn - bench.position()) as f64 / 16.0);
}

#[test]
fn standing_at_an_end_is_no_stall_and_turning_away_from_it_neither() {
    let mut bench = Bench::new(&travel(-10.0, 10.0, 10.0));
    assert!(!bench.stalled());
    bench.order(Opcode::RunR, 100);
    bench.run_for(SECOND / 100);
    assert!(!bench.stalled());
}

#[test]
fn a_switch_at_the_end_stays_closed_while_the_rotor_stalls() {
    let lines = travel(-10.0, 10.0, 0.0) + &switch("SW", 9.0, 10.0) + &switch("IN0", 10.0, 20.0);
    let mut bench = Bench::new(&lines);
    bench.order(Opcode::RunF, 500);
    bench.run_for(10 * SECOND);
    assert_eq!(bench.read(Reg::Inputs), 0b1001);
    bench.write(Reg::Clr, 1);
    bench.order(Opcode::RunR, 500);
    bench.run_until(|bench| bench.read(Reg::Inputs) == 0b1000);
    assert_eq!(bench.carriage(), 10.0 - 0.0625);
    bench.run_until(|bench| bench.read(Reg::Inputs) == 0);
    assert_eq!((bench.carriage(), bench.read(Reg::SwEvn)), (9.0 - 0.0625, 0));
}

#[test]
fn a_switch_beyond_the_end_never_closes() {
    let mut bench = Bench::new(&(travel(-10.0, 10.0, 0.0) + &switch("SET_ZERO", 11.0, 12.0)));
    bench.order(Opcode::ScanZeroF, 500);
    bench.run_for(60 * SECOND);
    assert_eq!((bench.read(Reg::Ready), bench.machine.next_wake()), (0, None));
}

#[test]
fn homing_against_an_end_finds_the_same_place_however_many_steps_are_lost() {
    for steps in [20, 21, 500, 5000] {
        let mut bench = Bench::new(&travel(-10.0, 10.0, 3.0));
        bench.go(Opcode::MoveR, steps * 16);
        bench.write(Reg::ResetPos, 1);
        bench.go(Opcode::GoTo, 5 * 16);
        assert_eq!(bench.carriage(), -5.0);
    }
}

#[test]
fn ends_between_two_microsteps_hold_the_carriage_where_they_are() {
    let mut bench = Bench::new(&travel(-0.3, 0.3, 0.0));
    bench.go(Opcode::MoveF, 100);
    // The last place of 1/256 full step within the travel.
    assert_eq!(bench.carriage(), 76.0 / 256.0);
    bench.go(Opcode::MoveR, 1);
    assert_eq!(bench.carriage(), 76.0 / 256.0 - 0.0625);
}

#[test]
fn the_destination_is_the_plan_whatever_holds_the_carriage() {
    let mut bench = Bench::new(&travel(-10.0, 10.0, 2.0));
    let destination = |bench: &Bench| bench.machine.destination(bench.now);
    assert_eq!(destination(&bench), None);
    bench.order(Opcode::MoveF, 5 * 16);
    assert_eq!(destination(&bench), Some(7.0));
    bench.run_for(SECOND / 50);
    assert_eq!(destination(&bench), Some(7.0));
    bench.run_until_ready();
    assert_eq!((bench.carriage(), destination(&bench)), (7.0, None));
    bench.order(Opcode::MoveF, 100 * 16);
    assert_eq!(destination(&bench), Some(107.0), "beyond the end");
    bench.order(Opcode::RunR, 100);
    assert_eq!(destination(&bench), None);
    bench.run_for(SECOND / 20);
    bench.write(Reg::SoftStop, 1);
    let planned = destination(&bench).expect("it brakes");
    bench.run_until_ready();
    assert_eq!(bench.carriage(), planned);
    bench.order(Opcode::MoveF, 16);
    bench.machine.switch_off(bench.now);
    assert_eq!(destination(&bench), None);
}
