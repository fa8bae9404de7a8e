//! What is different of an axis over USB: not all is told.
#![allow(clippy::float_cmp, reason = "whole steps are exact")]

use crate::stage::{SECOND, Stage};
use crate::usb::UsbStage;
use stepdrive_host::Direction;
use stepdrive_host::axis::{Axis, MoveOptions, Stop};
use stepdrive_host::units::{Amount, Goal};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

const HERE: MoveOptions = MoveOptions { speed: None, no_wait: false, override_trust: false, timeout: None };

fn by(text: &str) -> Goal {
    Goal::By(Amount::parse(text).expect("an amount"))
}

#[tokio::test(start_paused = true)]
async fn a_plan_says_which_ramp_it_supposes_and_takes_what_was_set_last() {
    let rig = UsbStage::new().await;
    let axis = rig.axis();
    let plan = axis.plan(by("500 steps"), HERE).await.expect("possible");
    assert_eq!(
        plan.supposed.as_deref(),
        Some("ACC 1000, DEC 1000 are supposed: this line does not tell them")
    );
    axis.motor().client().write(Reg::Acc, 4000).await.expect("taken");
    axis.motor().client().write(Reg::Dec, 2000).await.expect("taken");
    let faster = axis.plan(by("500 steps"), HERE).await.expect("possible");
    assert_eq!(
        faster.supposed.as_deref(),
        Some("ACC 4000, DEC 2000 are supposed: this line does not tell them")
    );
    assert!(faster.duration < plan.duration, "{faster:?}");
    assert_eq!(plan.sent, ["02 00 01 7D 00  MOVE_F 8000"]);
}

#[tokio::test(start_paused = true)]
async fn home_is_looked_for_as_slowly_as_at_power_up_where_no_speed_is_given() {
    let rig = UsbStage::new().await;
    let axis = rig.axis();
    axis.stop(Stop::Soft).await.expect("held");
    let watched = async {
        tokio::time::sleep(3 * SECOND).await;
        rig.speed()
    };
    let (homed, speed) = tokio::join!(axis.home(Direction::Negative, HERE), watched);
    homed.expect("found");
    assert!((speed.abs() - 16.0).abs() < 0.5, "{speed}");
    assert_eq!(rig.carriage(), -100.0);
}

#[tokio::test(start_paused = true)]
async fn a_program_that_only_waits_is_not_seen_and_refuses_no_move() {
    let rig = UsbStage::new().await;
    let axis = rig.axis();
    let client = axis.motor().client();
    client.store_program(0, &[Instruction { opcode: Opcode::SetWait, data: 60_000 }]).await.expect("stored");
    client.start_program(0).await.expect("started");
    assert_eq!(client.program().await.expect("a state").running, None);
    axis.go(by("5 steps"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), 5.0);
}
