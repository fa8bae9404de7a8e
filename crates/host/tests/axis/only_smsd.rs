//! What only an SMSD does.
#![allow(clippy::float_cmp, reason = "whole steps are exact")]

use crate::families::SmsdStage;
use crate::link::Fault;
use crate::stage::Stage;
use crate::station::SECOND;
use stepdrive_host::axis::{Axis, MoveOptions, Stop};
use stepdrive_host::trust::{Doubt, Trust};
use stepdrive_host::units::{Amount, Goal};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

const HERE: MoveOptions = MoveOptions { speed: None, no_wait: false, override_trust: false, timeout: None };

fn steps(text: &str) -> Amount {
    Amount::parse(text).expect("an amount")
}

#[tokio::test(start_paused = true)]
async fn a_plan_shows_the_requests_that_are_sent() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    let options = MoveOptions { override_trust: true, ..HERE };
    let plan = axis.plan(Goal::To(steps("100 steps")), options).await.expect("possible");
    let sent = ["10 11 06 00 02 04 06 40 00 00  TARGET_POS = 1600", "06 11 09 00 12  CMD = GO_TO_F"];
    assert_eq!(plan.sent, sent);
}

#[tokio::test(start_paused = true)]
async fn microsteps_follow_the_present_mode() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    for (code, parts) in [(0, 1), (3, 8), (7, 128)] {
        axis.stop(Stop::Free).await.expect("freed");
        axis.wait_done(None).await.expect("it stands");
        axis.motor().client().write(Reg::Microstepping, code).await.expect("taken");
        let before = rig.carriage();
        axis.move_by(steps("50 steps"), HERE).await.expect("it is there");
        assert_eq!(rig.carriage() - before, 50.0, "1/{parts}");
    }
    let rounded = axis.plan(Goal::By(steps("0.001 steps")), HERE).await.expect("possible");
    assert!(rounded.rounded && rounded.full_steps == 0.0);
}

#[tokio::test(start_paused = true)]
async fn a_step_mode_that_does_not_exist_is_told_instead_of_a_position() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    axis.state().await.expect("a state");
    let told = "MICROSTEPPING of stage reads 9, and it can be 0 to 7 (full step to 1/128); without it positions cannot be told; \
                write another value to it";
    rig.bench.faults([Fault::Register(0, 9)]);
    assert_eq!(axis.state().await, Err(Error::Device(told.to_owned())));
    // The state first, then the profile, and then the step mode again.
    rig.bench.faults([Fault::None, Fault::None, Fault::None, Fault::Register(0, 9)]);
    let refused = axis.move_by(steps("5 steps"), HERE).await.expect_err("how far that is cannot be told");
    assert_eq!(refused, Error::Device(told.to_owned()));
    assert_eq!(rig.starts(), 0);
    rig.bench.faults([Fault::Register(0, 7)]);
    axis.state().await.expect("1/128 there is");
}

#[tokio::test(start_paused = true)]
async fn a_move_never_goes_over_the_end_of_the_counter() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    axis.stop(Stop::Soft).await.expect("held");
    axis.zero().await.expect("it stands");
    let refused = axis.move_by(steps("131072 steps"), HERE).await.expect_err("2^21 microsteps of 1/16");
    assert!(refused.to_string().contains("it has -131072 to 131071.9375 full steps"), "{refused}");
    axis.move_to(steps("131071 steps"), HERE).await.expect("it is there");
    // The shorter way would be over the end of the counter.
    axis.move_to(steps("-131071 steps"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), -131_071.0);
}

#[tokio::test(start_paused = true)]
async fn a_motor_without_current_has_no_position() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    assert!(matches!(axis.zero().await, Err(Error::Refused(_))), "its rotor is not held at power-up");
    axis.stop(Stop::Soft).await.expect("held");
    axis.zero().await.expect("it stands");
    axis.motor().client().hard_hi_z().await.expect("freed");
    let state = axis.state().await.expect("a state");
    assert_eq!((state.trust, state.doubt, state.energised), (Trust::Unknown, Some(Doubt::Freed), false));
}

#[tokio::test(start_paused = true)]
async fn a_move_by_somebody_else_makes_the_position_suspect() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    axis.stop(Stop::Soft).await.expect("held");
    axis.zero().await.expect("it stands");
    rig.move_behind_its_back(50).await;
    let state = axis.state().await.expect("a state");
    assert_eq!((state.trust, state.doubt), (Trust::Suspect, Some(Doubt::MovedUnwatched)));
}

#[tokio::test(start_paused = true)]
async fn a_refusal_that_is_latched_stands_against_motion_until_it_is_cleared() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    axis.run(Direction::Positive, HERE).await.expect("started");
    tokio::time::sleep(SECOND).await;
    axis.motor().client().move_by(5).await.expect_err("it turns");
    axis.stop(Stop::Soft).await.expect("stopped");
    let fault = axis.wait_done(None).await.expect_err("CMD_ERROR is latched");
    assert!(fault.to_string().contains("CMD_ERROR") && fault.exit_code() == 8, "{fault}");
    assert!(matches!(axis.move_by(steps("5 steps"), HERE).await, Err(Error::Fault(_))));
    assert_eq!(axis.clear_faults().await, Ok(vec![]));
    axis.move_by(steps("5 steps"), HERE).await.expect("it is there");
}

#[tokio::test(start_paused = true)]
async fn while_a_program_runs_nothing_is_moved_beside_it() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    let program = [Instruction { opcode: Opcode::SetWait, data: 60_000 }];
    axis.motor().client().store_program(0, &program).await.expect("stored");
    axis.motor().client().command(Opcode::StartProgramMem0, None).await.expect("started");
    let refused = axis.move_by(steps("5 steps"), HERE).await.expect_err("a program runs");
    assert!(refused.to_string().contains("stop it first"), "{refused}");
}

#[tokio::test(start_paused = true)]
async fn homing_wants_its_input_unmasked() {
    let rig = SmsdStage::new().await;
    let axis = rig.axis();
    axis.motor().client().write(Reg::Mask, i64::from(!Input::SetZero.bit())).await.expect("taken");
    let refused = axis.home(Direction::Negative, HERE).await.expect_err("masked");
    assert!(
        refused.to_string().contains("SET_ZERO of stage is masked") && refused.exit_code() == 7,
        "{refused}"
    );
    assert_eq!(rig.starts(), 0);
}
