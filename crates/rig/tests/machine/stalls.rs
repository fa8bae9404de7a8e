//! Stalls as the controller counts them.
#![allow(clippy::float_cmp, reason = "places are exact")]

use crate::bench::{Bench, MS, SECOND, travel};
use stepdrive_drive::smsd::StandardSession;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Counter, Reply, Request};

const PASSWORD: u64 = 0x0123_4567_89AB_CDEF;

/// Two full steps from either end of its travel, with a line of the standard protocol on which somebody has logged in.
fn stage() -> (Bench, StandardSession) {
    let mut bench = Bench::new(&travel(-2.0, 2.0, 0.0));
    let mut session = StandardSession::usb();
    bench.run_for(SECOND);
    bench.machine.handle_standard(bench.now, &mut session, Ok(&Request::Authorise(PASSWORD)));
    assert!(session.is_authorised());
    (bench, session)
}

fn counted((bench, session): &mut (Bench, StandardSession)) -> u32 {
    match bench.machine.handle_standard(bench.now, session, Ok(&Request::GetErrors)) {
        Some(Reply::Errors(counters)) => counters[Counter::StallPowerstep01 as usize],
        reply => panic!("{reply:?}"),
    }
}

#[test]
fn a_stall_is_counted_as_soon_as_a_step_is_lost_and_once() {
    let mut stage = stage();
    stage.0.order(Opcode::RunF, 100);
    while stage.0.position() < 32 {
        stage.0.run_for(MS / 10);
    }
    assert_eq!(counted(&mut stage), 0, "it has reached the end and lost nothing");
    for _ in 0..20 {
        stage.0.run_for(SECOND / 10);
        assert_eq!(counted(&mut stage), 1);
        assert_eq!(counted(&mut stage), 1);
    }
    stage.0.command(Opcode::SoftStop);
    stage.0.run_until_ready();
    assert_eq!(counted(&mut stage), 1);
}

#[test]
fn each_motion_that_is_held_is_a_stall_of_its_own() {
    let mut stage = stage();
    for stalls in 1..=4 {
        stage.0.go(Opcode::MoveF, 1000);
        assert_eq!(counted(&mut stage), stalls);
    }
}

#[test]
fn from_one_end_to_the_other_each_is_counted_whoever_looks() {
    for looks in [1, 1000] {
        let mut stage = stage();
        stage.0.write(Reg::MinSpeed, 950);
        for stalls in 1..=6 {
            stage.0.order(if stalls % 2 == 1 { Opcode::RunF } else { Opcode::RunR }, 960);
            for _ in 0..looks {
                stage.0.run_for(SECOND / looks);
                counted(&mut stage);
            }
            assert_eq!(counted(&mut stage), stalls);
        }
    }
}

#[test]
fn a_rotor_that_is_held_stalls_and_one_that_is_let_go_does_not() {
    let mut stage = stage();
    stage.0.order(Opcode::RunF, 100);
    stage.0.run_for(MS);
    stage.0.machine.block_rotor(stage.0.now, true);
    stage.0.run_for(SECOND / 10);
    assert_eq!(counted(&mut stage), 1);
    stage.0.command(Opcode::SoftStop);
    stage.0.run_until_ready();
    stage.0.machine.block_rotor(stage.0.now, false);
    stage.0.go(Opcode::MoveR, 16);
    assert_eq!(counted(&mut stage), 1);
}

#[test]
fn a_motion_that_ends_at_the_end_or_turns_back_loses_nothing() {
    let mut stage = stage();
    stage.0.go(Opcode::MoveF, 32);
    stage.0.go(Opcode::MoveR, 64);
    stage.0.go(Opcode::MoveF, 64);
    assert_eq!((stage.0.carriage(), counted(&mut stage)), (2.0, 0));
}

#[test]
fn power_off_forgets_the_stalls() {
    let mut stage = stage();
    stage.0.go(Opcode::MoveF, 1000);
    stage.0.machine.switch_off(stage.0.now);
    assert_eq!(stage.0.machine.handle_standard(stage.0.now, &mut stage.1, Ok(&Request::GetErrors)), None);
    stage.0.machine.switch_on(stage.0.now);
    assert_eq!(stage.0.machine.drive().counters()[Counter::StallPowerstep01 as usize], 0);
}
