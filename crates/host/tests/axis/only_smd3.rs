//! What only an SMD3 does.
#![allow(clippy::float_cmp, reason = "whole steps are exact")]

use crate::families::Smd3Stage;
use crate::stage::Stage;
use crate::station::{Fault, SECOND};
use stepdrive_host::axis::{Axis, DriveAxis, MoveOptions, Smd3Motor, Stop};
use stepdrive_host::trust::{Doubt, Trust};
use stepdrive_host::units::{Amount, Goal};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smd3::commands::{Command, Mode};
use stepdrive_spec::smd3::signals::Sensor;

const HERE: MoveOptions = MoveOptions { speed: None, no_wait: false, override_trust: false, timeout: None };

fn steps(text: &str) -> Amount {
    Amount::parse(text).expect("an amount")
}

#[tokio::test(start_paused = true)]
async fn a_plan_shows_the_lines_that_are_sent() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    let fast = MoveOptions { speed: Some("500 Hz".parse_speed()), ..HERE };
    let plan = axis.plan(Goal::By(steps("200 steps")), fast).await.expect("possible");
    assert_eq!(plan.sent, ["VMAX,500.0", "RUNR,200"]);
    axis.motor().client().set_mode(Mode::Home).await.expect("taken");
    let options = MoveOptions { override_trust: true, ..HERE };
    let plan = axis.plan(Goal::To(steps("-5 steps")), options).await.expect("possible");
    assert_eq!(plan.sent, ["MODE,2", "RUNA,-5"]);
    rig.station.lines();
    axis.move_to(steps("-5 steps"), options).await.expect("it is there");
    let lines = rig.station.lines();
    assert!(
        lines.iter().any(|line| line == "MODE,2") && lines.iter().any(|line| line == "RUNA,-5"),
        "{lines:?}"
    );
}

trait ParseSpeed {
    fn parse_speed(&self) -> stepdrive_host::units::Speed;
}

impl ParseSpeed for str {
    fn parse_speed(&self) -> stepdrive_host::units::Speed {
        stepdrive_host::units::Speed::parse(self).expect("a speed")
    }
}

#[tokio::test(start_paused = true)]
async fn a_limit_that_is_met_ends_a_move_and_makes_the_position_suspect() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.zero().await.expect("it stands");
    let refused = axis.move_to(steps("-500 steps"), HERE).await.expect_err("the switch is there");
    assert_eq!(
        refused.to_string(),
        "uhv stands at -100 steps instead of -500 steps: the limit switch there stopped it; move it away from it"
    );
    let state = axis.state().await.expect("a state");
    assert_eq!((state.trust, state.doubt), (Trust::Suspect, Some(Doubt::LimitMet)));
    assert!(state.limit_negative && !state.limit_positive);
    axis.move_by(steps("20 steps"), HERE).await.expect("away from it");
}

#[tokio::test(start_paused = true)]
async fn a_fault_ends_a_move_stays_latched_and_is_cleared() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.zero().await.expect("it stands");
    axis.run(Direction::Positive, HERE).await.expect("started");
    tokio::time::sleep(SECOND).await;
    rig.station.change(|drive, now| drive.set_sensor(now, Sensor::Open));
    let fault = axis.wait_done(None).await.expect_err("disabled");
    assert!(fault.to_string().contains("TOPEN") && fault.exit_code() == 8, "{fault}");
    assert_eq!(axis.state().await.map(|state| state.trust), Ok(Trust::Unknown));
    let left = axis.clear_faults().await.expect("done");
    assert_eq!(left.iter().map(|fault| fault.name).collect::<Vec<_>>(), ["TOPEN"], "its cause is there");
    assert!(matches!(axis.move_by(steps("5 steps"), HERE).await, Err(Error::Fault(_))));
    rig.station.change(|drive, now| drive.set_sensor(now, Sensor::Connected));
    assert_eq!(axis.clear_faults().await, Ok(vec![]));
    axis.move_by(steps("5 steps"), HERE).await.expect("enabled again");
    assert_eq!(axis.trust().doubt(), Some(Doubt::Disabled));
}

#[tokio::test(start_paused = true)]
async fn in_a_mode_that_somebody_has_chosen_nothing_moves() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.motor().client().set_mode(Mode::Joystick).await.expect("taken");
    for outcome in [
        axis.move_by(steps("5 steps"), HERE).await.map(|_| ()),
        axis.run(Direction::Positive, HERE).await,
        axis.home(Direction::Negative, HERE).await,
    ] {
        let refused = outcome.expect_err("another mode");
        assert!(refused.to_string().contains("mode 3 (Joystick)") && refused.exit_code() == 7, "{refused}");
    }
    assert_eq!(axis.motor().client().mode().await, Ok(Mode::Joystick));
    assert_eq!(rig.starts(), 0);
}

#[tokio::test(start_paused = true)]
async fn homing_leaves_the_drive_in_mode_remote_whatever_becomes_of_it() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.home(Direction::Negative, HERE).await.expect("found");
    assert_eq!(axis.motor().client().mode().await, Ok(Mode::Remote));
    axis.motor().client().set_number(Command::L, 0.0).await.expect("taken");
    let refused = axis.home(Direction::Negative, HERE).await.expect_err("not in use");
    assert!(refused.to_string().contains("enable it with L 1 and L- 1"), "{refused}");
    assert_eq!(axis.motor().client().mode().await, Ok(Mode::Remote));
}

#[tokio::test(start_paused = true)]
async fn a_search_that_was_given_up_half_way_leaves_nothing_that_a_motion_does_not_mend() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.zero().await.expect("it stands");
    assert!(tokio::time::timeout(SECOND / 10, axis.home(Direction::Negative, HERE)).await.is_err());
    axis.stop(Stop::Soft).await.expect("stopped");
    axis.wait_done(None).await.expect("it stands");
    assert_eq!(axis.motor().client().mode().await, Ok(Mode::Home));
    assert_eq!(axis.trust().doubt(), Some(Doubt::HomingFailed));
    axis.move_by(steps("5 steps"), HERE).await.expect("it is there");
    assert_eq!(axis.motor().client().mode().await, Ok(Mode::Remote));
}

#[tokio::test(start_paused = true)]
async fn another_hosts_moves_do_not_shake_a_marked_counter() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.zero().await.expect("it stands");
    rig.move_behind_its_back(50).await;
    assert_eq!(axis.state().await.map(|state| state.trust), Ok(Trust::Trusted));
    axis.move_to(steps("0 steps"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), 0.0);
}

#[tokio::test(start_paused = true)]
async fn without_its_mark_a_counter_at_zero_is_suspect_after_a_cut_line() {
    let rig = Smd3Stage::new().await;
    let axis = DriveAxis::new(rig.motor().keeping_prel());
    axis.zero().await.expect("it stands");
    assert_eq!(axis.motor().client().get_number(Command::Prel).await, Ok(0.0));
    rig.cut();
    tokio::time::sleep(SECOND).await;
    assert_eq!(axis.state().await.map(|state| state.trust), Ok(Trust::Suspect));
    drop(axis);
    let marked: DriveAxis<Smd3Motor> = rig.axis();
    marked.zero().await.expect("it stands");
    assert_eq!(marked.motor().client().get_number(Command::Prel).await, Ok(100_000.0));
}

#[tokio::test(start_paused = true)]
async fn a_position_that_no_drive_can_have_is_garbled_and_not_zero() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.state().await.expect("a state");
    rig.station.faults([Fault::None, Fault::Instead(b"0x0040,0x0000,9.99999E+99\r\n".to_vec())]);
    assert_eq!(axis.state().await.map(|state| state.full_steps), Ok(0.0), "it is asked for again");
    rig.station.otherwise_of("PACT", b"0x0040,0x0000,9.99999E+99\r\n");
    let error = axis.state().await.expect_err("it cannot be there");
    assert_eq!(
        error.to_string(),
        "uhv answered with what cannot be understood: PACT was answered `0x0040,0x0000,9.99999E+99`, a value that it cannot have"
    );
    assert_eq!(error.exit_code(), 5);
    rig.station.otherwise_of("PACT", b"0x0040,0x0000,-8.38861E+06\r\n");
    assert_eq!(
        axis.state().await.map(|state| state.full_steps),
        Ok(-8_388_610.0),
        "six digits of the lowest place"
    );
}

#[tokio::test(start_paused = true)]
async fn a_hard_stop_is_an_emergency_stop() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.run(Direction::Positive, HERE).await.expect("started");
    tokio::time::sleep(SECOND).await;
    axis.stop(Stop::Hard).await.expect("stopped");
    let faults = axis.faults().await.expect("a state");
    assert_eq!(faults.iter().map(|fault| fault.name).collect::<Vec<_>>(), ["EMERGENCY STOP"]);
}

#[tokio::test(start_paused = true)]
async fn a_move_over_the_end_of_the_counter_is_refused() {
    let rig = Smd3Stage::new().await;
    let axis = rig.axis();
    axis.motor().client().set_number(Command::Pact, 8_388_000.0).await.expect("taken");
    let refused = axis.move_by(steps("1000 steps"), HERE).await.expect_err("it would turn over");
    assert!(refused.to_string().contains("where the counter does not reach"), "{refused}");
    let options = MoveOptions { override_trust: true, ..HERE };
    let refused = axis.move_to(steps("-8000000 steps"), options).await.expect_err("the other way is shorter");
    assert!(refused.to_string().contains("go there in two"), "{refused}");
    assert_eq!(rig.starts(), 0);
}
