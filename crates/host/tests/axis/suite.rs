//! The behaviour that all axes share.
#![allow(clippy::float_cmp, reason = "whole steps are exact")]

use crate::stage::{MS, SECOND, Stage, suite};
use std::sync::Arc;
use std::time::Duration;
use stepdrive_host::axis::{Axis, AxisState, DriveAxis, Motor, MoveOptions, Plan, SoftLimits, Stop};
use stepdrive_host::trust::{Doubt, Trust, TrustState};
use stepdrive_host::units::{Amount, Decimal, Goal, Scale, Speed};
use stepdrive_host::{Direction, Error};
use tokio::time::{Instant, timeout};

const HERE: MoveOptions = MoveOptions { speed: None, no_wait: false, override_trust: false, timeout: None };

pub(crate) fn amount(text: &str) -> Amount {
    Amount::parse(text).expect("an amount")
}

pub(crate) fn goal(text: &str) -> Goal {
    Goal::parse(text).expect("a goal")
}

pub(crate) fn told<T: std::fmt::Debug>(outcome: Result<T, Error>) -> String {
    outcome.expect_err("refused").to_string()
}

/// A screw of 5 mm.
fn millimetres() -> Scale {
    Scale::millimetres(Decimal::whole(5), 200).expect("a scale")
}

fn limits(low: i32, high: i32) -> SoftLimits {
    SoftLimits::new(Decimal::whole(low), Decimal::whole(high)).expect("in order")
}

pub(crate) async fn zeroed<S: Stage>(rig: &S) -> DriveAxis<S::Motor> {
    let axis = rig.axis().with_scale(millimetres());
    energise(&axis).await;
    axis.zero().await.expect("it stands");
    rig.starts();
    axis
}

/// A motor that was just switched on may carry no current.
pub(crate) async fn energise<M: Motor>(axis: &DriveAxis<M>) {
    axis.stop(Stop::Soft).await.expect("done");
}

suite! { $ hold of suite:
    looking_moves_nothing_and_shows_an_unknown_position
    a_move_by_ends_where_it_should_and_takes_as_long_as_was_planned
    a_move_to_wants_a_trusted_position
    a_plan_sends_nothing_and_shows_all
    units_that_do_not_fit_are_refused_before_anything_is_sent
    soft_limits_are_checked_before_any_motion
    a_run_ends_at_the_soft_limit_or_when_it_is_stopped
    a_reversed_axis_goes_the_other_way
    a_speed_is_used
    homing_finds_zero_from_either_side_of_the_switch
    homing_that_finds_nothing_ends_at_its_timeout
    a_soft_stop_ends_a_move_and_says_so
    a_hard_stop_stops_at_once_and_makes_the_position_doubtful
    a_freed_motor_has_no_position
    a_motion_while_it_moves_is_refused
    waiting_gives_up_at_its_timeout_without_stopping
    a_dropped_move_goes_on_and_can_be_stopped
    a_stop_that_comes_while_a_move_is_sent_off_wins
    a_stop_that_is_lost_is_sent_again
    homing_that_somebody_else_stops_finds_nothing
    a_lost_reply_to_a_motion_is_told_and_nothing_is_repeated
    a_line_that_falls_silent_behind_a_start_is_told_with_what_was_begun
    a_cut_line_keeps_trust_where_nothing_has_happened
    a_controller_that_started_over_has_no_position
    a_record_of_trust_outlives_the_program
    a_record_of_trust_does_not_outlive_a_restart
    where_the_counter_does_not_reach_nothing_goes
    zero_wants_a_standing_motor
    no_command_is_given_twice_under_any_trouble
    somebody_who_watches_all_the_time_shakes_no_trust
    the_axis_can_be_used_behind_a_box
}

pub(crate) async fn looking_moves_nothing_and_shows_an_unknown_position<S: Stage>() {
    let rig = S::new().await;
    let axis = rig.axis();
    let state = axis.state().await.expect("a state");
    assert_eq!((state.moving, state.speed, state.position), (false, 0.0, amount("0 steps")));
    assert_eq!((state.trust, state.doubt), (Trust::Unknown, Some(Doubt::NotHomed)));
    assert!(state.faults.is_empty() && state.within_soft_limits);
    assert_eq!((rig.starts(), rig.carriage()), (0, 0.0));
}

pub(crate) async fn a_move_by_ends_where_it_should_and_takes_as_long_as_was_planned<S: Stage>() {
    let rig = S::new().await;
    let axis = rig.axis().with_scale(millimetres());
    let began = Instant::now();
    let plan = axis.move_by(amount("12.5mm"), HERE).await.expect("it is there");
    let took = began.elapsed();
    assert_eq!((rig.carriage(), rig.starts()), (500.0, 1));
    assert!(took.abs_diff(plan.duration) < 110 * MS, "{took:?}, planned {:?}", plan.duration);
    let state = axis.state().await.expect("a state");
    assert_eq!((state.position, state.full_steps, state.moving), (amount("12.5mm"), 500.0, false));
    axis.move_by(amount("-3 turns"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), -100.0);
}

pub(crate) async fn a_move_to_wants_a_trusted_position<S: Stage>() {
    let rig = S::new().await;
    let axis = rig.axis();
    let words = told(axis.move_to(amount("20 steps"), HERE).await);
    assert!(words.contains(" is unknown: the axis has not been homed; home it"), "{words}");
    assert_eq!(rig.starts(), 0);
    let anyway = MoveOptions { override_trust: true, ..HERE };
    axis.move_to(amount("20 steps"), anyway).await.expect("it is there");
    assert_eq!(rig.carriage(), 20.0);
    axis.zero().await.expect("it stands");
    axis.move_to(amount("-5 steps"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), 15.0);
    axis.distrust(Doubt::Stalled);
    let words = told(axis.move_to(amount("20 steps"), HERE).await);
    assert!(words.contains("the motor has stalled"), "{words}");
}

pub(crate) async fn a_plan_sends_nothing_and_shows_all<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    let plan: Plan = axis.plan(goal("to 12.51mm"), HERE).await.expect("possible");
    assert_eq!((plan.from, plan.trust), (amount("0mm"), Trust::Trusted));
    assert_eq!((plan.to, plan.rounded), (plan.distance, true), "no controller counts 500.4 full steps");
    assert!((plan.full_steps - 500.4).abs() <= 0.5 && plan.duration > SECOND && plan.duration < 2 * SECOND);
    assert!(plan.sent.iter().all(|line| !line.is_empty()) && !plan.sent.is_empty());
    assert_eq!((rig.starts(), rig.carriage()), (0, 0.0));
    let exact = axis.plan(goal("by 0.5 turns"), HERE).await.expect("possible");
    assert_eq!((exact.rounded, exact.to, exact.full_steps), (false, amount("2.5mm"), 100.0));
}

pub(crate) async fn units_that_do_not_fit_are_refused_before_anything_is_sent<S: Stage>() {
    let rig = S::new().await;
    let axis = rig.axis().with_scale(millimetres());
    let refused = axis.move_by(amount("90 deg"), HERE).await.expect_err("no such unit");
    assert_eq!(refused.to_string(), "90 deg: deg do not fit this axis, which takes mm, turns, steps");
    assert_eq!((refused.exit_code(), rig.starts()), (1, 0));
    let fast = MoveOptions { speed: Some(Speed::parse("9 deg/s").expect("a speed")), ..HERE };
    assert_eq!(axis.move_by(amount("1mm"), fast).await.expect_err("no such unit").exit_code(), 1);
}

pub(crate) async fn soft_limits_are_checked_before_any_motion<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await.with_limits(limits(-2, 10));
    for text in ["to 10.01mm", "to -2.5mm", "by 11mm", "by 3 turns", "by -500 steps"] {
        let refused = axis.go(goal(text), HERE).await.expect_err("beyond");
        assert!(
            refused.to_string().contains("beyond the soft limits [-2, 10] mm; nothing was sent"),
            "{refused}"
        );
        assert_eq!(refused.exit_code(), 7);
        assert_eq!(axis.plan(goal(text), HERE).await, Err(refused));
    }
    assert_eq!((rig.starts(), rig.carriage()), (0, 0.0));
    axis.go(goal("to 10mm"), HERE).await.expect("just within");
    axis.go(goal("by -12mm"), HERE).await.expect("just within");
    assert_eq!(rig.carriage(), -80.0);
}

pub(crate) async fn a_run_ends_at_the_soft_limit_or_when_it_is_stopped<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    axis.run(Direction::Positive, HERE).await.expect("started");
    tokio::time::sleep(60 * SECOND).await;
    assert!(rig.speed() > 900.0);
    axis.stop(Stop::Soft).await.expect("stopped");
    let state = axis.wait_done(None).await.expect("it stands");
    assert!((rig.carriage() - state.full_steps).abs() < 1.0, "{} {}", rig.carriage(), state.full_steps);
    axis.zero().await.expect("it stands");
    let before = rig.carriage();
    let axis = axis.with_limits(limits(-1, 5));
    axis.run(Direction::Positive, HERE).await.expect("started");
    axis.wait_done(None).await.expect("it stands");
    assert_eq!(rig.carriage() - before, 200.0);
    axis.run(Direction::Negative, HERE).await.expect("started");
    axis.wait_done(None).await.expect("it stands");
    assert_eq!(rig.carriage() - before, -40.0);
    let refused = axis.run(Direction::Negative, HERE).await.expect_err("it is there");
    assert!(refused.to_string().contains("at or beyond the soft limit -1mm"), "{refused}");
    let axis = axis.with_limits(limits(0, 5));
    axis.run(Direction::Negative, HERE).await.expect_err("it would go the other way");
    assert_eq!((rig.carriage() - before, rig.speed()), (-40.0, 0.0));
    drop(axis);
    let unknown = rig.axis().with_limits(limits(-1, 5));
    assert!(
        matches!(unknown.run(Direction::Positive, HERE).await, Err(Error::Refused(_))),
        "limits mean nothing there"
    );
}

pub(crate) async fn a_reversed_axis_goes_the_other_way<S: Stage>() {
    let rig = S::new().await;
    let axis = rig.axis().with_scale(millimetres().reversed());
    axis.move_by(amount("-2.5mm"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), 100.0);
    assert_eq!(axis.position().await, Ok(amount("-2.5mm")));
    axis.run(Direction::Positive, HERE).await.expect("started");
    tokio::time::sleep(500 * MS).await;
    let state = axis.state().await.expect("a state");
    assert!(state.speed > 0.0 && rig.carriage() < 100.0, "{state:?}");
    axis.stop(Stop::Soft).await.expect("stopped");
    axis.wait_done(None).await.expect("it stands");
}

pub(crate) async fn a_speed_is_used<S: Stage>() {
    let rig = S::new().await;
    let axis = rig.axis().with_scale(millimetres());
    let slow = MoveOptions { speed: Some(Speed::parse("5mm/s").expect("a speed")), ..HERE };
    let began = Instant::now();
    let plan = axis.move_by(amount("20mm"), slow).await.expect("it is there");
    assert!(began.elapsed() > Duration::from_millis(3800) && began.elapsed() < Duration::from_millis(4400));
    assert!(plan.duration.abs_diff(began.elapsed()) < 200 * MS);
    let hurried = MoveOptions { speed: Some(Speed::parse("1000mm/s").expect("a speed")), ..HERE };
    let refused = axis.move_by(amount("20mm"), hurried).await.expect_err("out of range");
    assert!(refused.to_string().contains("out of range") && refused.exit_code() == 1, "{refused}");
    assert_eq!(rig.starts(), 1);
}

pub(crate) async fn homing_finds_zero_from_either_side_of_the_switch<S: Stage>() {
    let rig = S::new().await;
    let axis = rig.axis();
    let at = MoveOptions { speed: Some(Speed::parse("200 steps/s").expect("a speed")), ..HERE };
    axis.home(Direction::Negative, at).await.expect("found");
    assert_eq!(rig.carriage(), -100.0);
    assert_eq!(axis.trust().trust(), Trust::Trusted);
    axis.move_to(amount("50 steps"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), -50.0);
    axis.move_to(amount("-3 steps"), MoveOptions { override_trust: true, ..HERE }).await.ok();
    axis.home(Direction::Negative, at).await.expect("found from where it is closed");
    assert!((rig.carriage() + 100.0).abs() <= 1.0, "{}", rig.carriage());
    let position = axis.state().await.expect("a state").full_steps;
    assert!(position.abs() < 0.01, "{position}");
}

pub(crate) async fn homing_that_finds_nothing_ends_at_its_timeout<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    axis.move_by(amount("-5mm"), HERE).await.ok();
    drop(axis);
    let impatient = MoveOptions {
        speed: Some(Speed::parse("100 steps/s").expect("a speed")),
        timeout: Some(SECOND / 2),
        ..HERE
    };
    let axis = rig.axis();
    let failed = axis.home(Direction::Positive, impatient).await.expect_err("there is none");
    assert!(matches!(failed, Error::Device(_) | Error::Refused(_)), "{failed}");
    tokio::time::sleep(5 * SECOND).await;
    assert_eq!(rig.speed(), 0.0);
    assert_eq!(axis.trust().trust(), Trust::Unknown);
    axis.move_by(amount("5 steps"), HERE).await.expect("it can be used again");
}

pub(crate) async fn a_soft_stop_ends_a_move_and_says_so<S: Stage>() {
    let rig = S::new().await;
    let axis = Arc::new(zeroed(&rig).await);
    let mover = Arc::clone(&axis);
    let moving = tokio::spawn(async move { mover.move_to(amount("100mm"), HERE).await });
    tokio::time::sleep(2 * SECOND).await;
    axis.stop(Stop::Soft).await.expect("stopped");
    let words = told(moving.await.expect("no panic"));
    assert!(words.contains("instead of 100mm: somebody or something stopped it on the way"), "{words}");
    let state = axis.state().await.expect("a state");
    assert_eq!((state.moving, state.trust), (false, Trust::Trusted));
}

pub(crate) async fn a_hard_stop_stops_at_once_and_makes_the_position_doubtful<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    axis.run(Direction::Positive, HERE).await.expect("started");
    tokio::time::sleep(3 * SECOND).await;
    axis.stop(Stop::Hard).await.expect("stopped");
    assert_eq!(rig.speed(), 0.0);
    axis.clear_faults().await.expect("cleared");
    let state = axis.state().await.expect("a state");
    assert_ne!(state.trust, Trust::Trusted, "{state:?}");
    assert!(axis.move_to(amount("0mm"), HERE).await.is_err());
    axis.move_by(amount("1mm"), HERE).await.expect("it can still be moved");
}

pub(crate) async fn a_freed_motor_has_no_position<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    axis.run(Direction::Positive, HERE).await.expect("started");
    tokio::time::sleep(SECOND).await;
    axis.stop(Stop::Free).await.expect("stopped");
    tokio::time::sleep(3 * SECOND).await;
    let state = axis.state().await.expect("a state");
    assert_eq!((state.energised, state.moving, state.trust), (false, false, Trust::Unknown));
    assert!(axis.zero().await.is_err(), "its rotor is not held");
    assert_eq!(axis.clear_faults().await, Ok(vec![]));
    energise(&axis).await;
    axis.zero().await.expect("it is held again");
    assert_eq!(axis.trust().trust(), Trust::Trusted);
}

pub(crate) async fn a_motion_while_it_moves_is_refused<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    axis.run(Direction::Positive, HERE).await.expect("started");
    tokio::time::sleep(SECOND).await;
    for outcome in [
        axis.move_by(amount("1mm"), HERE).await.map(|_| ()),
        axis.move_to(amount("1mm"), HERE).await.map(|_| ()),
        axis.run(Direction::Negative, HERE).await,
        axis.home(Direction::Negative, HERE).await,
        axis.zero().await,
    ] {
        let refused = outcome.expect_err("it moves");
        assert!(refused.to_string().contains("moves already") && refused.exit_code() == 7, "{refused}");
    }
    assert_eq!(rig.starts(), 1);
}

pub(crate) async fn waiting_gives_up_at_its_timeout_without_stopping<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    let impatient = MoveOptions { timeout: Some(SECOND), ..HERE };
    let words = told(axis.move_by(amount("100mm"), impatient).await);
    assert!(words.contains("still moves after 1s") && words.ends_with("it was not stopped"), "{words}");
    assert!(rig.speed() > 0.0);
    let state: AxisState = axis.wait_done(None).await.expect("it stands");
    assert_eq!(state.position, amount("100mm"));
}

pub(crate) async fn a_dropped_move_goes_on_and_can_be_stopped<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    assert!(timeout(SECOND, axis.move_by(amount("100mm"), HERE)).await.is_err());
    assert!(rig.speed() > 0.0);
    axis.stop(Stop::Soft).await.expect("stopped");
    let state = axis.wait_done(Some(10 * SECOND)).await.expect("it stands");
    assert!(rig.carriage() < 4000.0 && state.trust == Trust::Trusted);
    axis.move_to(amount("1mm"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), 40.0);
}

pub(crate) async fn a_stop_that_comes_while_a_move_is_sent_off_wins<S: Stage>() {
    for after in (5..180).step_by(10) {
        let rig = S::new().await;
        let axis = Arc::new(zeroed(&rig).await);
        // Now every request of the move takes 10 ms, and the stop comes between two of them.
        rig.slow_down(10 * MS);
        let mover = Arc::clone(&axis);
        let moving = tokio::spawn(async move { mover.move_by(amount("100mm"), HERE).await });
        tokio::time::sleep(after * MS).await;
        axis.stop(Stop::Soft).await.expect("stopped");
        tokio::time::sleep(2 * SECOND).await;
        assert_eq!(rig.speed(), 0.0, "after {after} ms");
        assert!(matches!(moving.await.expect("no panic"), Err(Error::Refused(_))), "after {after} ms");
        // The axis is looked at before it is sent off, which takes longer than this.
        assert!(after > 40 || rig.starts() == 0, "after {after} ms");
    }
}

pub(crate) async fn a_stop_that_is_lost_is_sent_again<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    for how in [Stop::Soft, Stop::Hard] {
        axis.run(Direction::Positive, HERE).await.expect("started");
        tokio::time::sleep(SECOND).await;
        rig.lose_request();
        axis.stop(how).await.expect("stopped in the end");
        tokio::time::sleep(2 * SECOND).await;
        assert_eq!(rig.speed(), 0.0, "{how:?}");
    }
}

pub(crate) async fn homing_that_somebody_else_stops_finds_nothing<S: Stage>() {
    let rig = S::new().await;
    let axis = Arc::new(zeroed(&rig).await);
    let at = MoveOptions { speed: Some(Speed::parse("100 steps/s").expect("a speed")), ..HERE };
    let mover = Arc::clone(&axis);
    let homing = tokio::spawn(async move { mover.home(Direction::Negative, at).await });
    tokio::time::sleep(SECOND / 2).await;
    rig.stop_behind_its_back().await;
    let words = told(homing.await.expect("no panic"));
    assert!(words.contains("without having found") && words.contains("home"), "{words}");
    assert_eq!(axis.trust().doubt(), Some(Doubt::HomingFailed));
    axis.home(Direction::Negative, at).await.expect("found");
    assert_eq!(rig.carriage(), -100.0);
}

pub(crate) async fn a_lost_reply_to_a_motion_is_told_and_nothing_is_repeated<S: Stage>() {
    for number in 0..16 {
        let rig = S::new().await;
        let axis = zeroed(&rig).await;
        rig.lose_reply(number);
        let outcome = axis.move_by(amount("5mm"), HERE).await;
        let starts = rig.starts();
        match outcome {
            Ok(_) => assert_eq!((starts, rig.carriage()), (1, 200.0), "{number}"),
            Err(Error::Uncertain { .. }) => assert_eq!(starts, 1, "{number}"),
            Err(other) => panic!("{number}: {other}"),
        }
        let state = axis.wait_done(None).await.expect("it stands");
        assert_eq!((rig.carriage(), state.trust), (200.0, Trust::Trusted), "{number}");
    }
}

pub(crate) async fn a_line_that_falls_silent_behind_a_start_is_told_with_what_was_begun<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    let silence = async {
        tokio::time::sleep(300 * MS).await;
        rig.slow_down(60 * SECOND);
    };
    let (moved, ()) = tokio::join!(axis.move_by(amount("50mm"), HERE), silence);
    let lost = moved.expect_err("silent");
    assert!(lost.to_string().contains("did not answer within 1s; the motion of "), "{lost}");
    assert!(lost.to_string().ends_with(" was begun, and whether it has ended is not known"), "{lost}");
    assert_eq!(lost.exit_code(), 5);
}

pub(crate) async fn a_cut_line_keeps_trust_where_nothing_has_happened<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    rig.cut();
    tokio::time::sleep(MS).await;
    assert_eq!(axis.state().await.expect("a state").trust, Trust::Trusted, "at zero");
    axis.move_to(amount("5mm"), HERE).await.expect("it is there");
    rig.cut();
    tokio::time::sleep(MS).await;
    assert_eq!(axis.state().await.expect("a state").trust, Trust::Trusted, "elsewhere");
    axis.move_by(amount("50mm"), MoveOptions { no_wait: true, ..HERE }).await.expect("started");
    rig.cut();
    axis.wait_done(None).await.expect("it stands");
    assert_eq!(axis.trust().trust(), Trust::Trusted, "on the way");
}

pub(crate) async fn a_controller_that_started_over_has_no_position<S: Stage>() {
    for place in ["0mm", "5mm"] {
        let rig = S::new().await;
        let axis = zeroed(&rig).await;
        axis.move_to(amount(place), HERE).await.expect("it is there");
        rig.restart();
        tokio::time::sleep(MS).await;
        let state = axis.state().await.expect("a state");
        assert_eq!(state.trust, Trust::Unknown, "{place}: {state:?}");
        let refused = axis.move_to(amount("1mm"), HERE).await.expect_err("not trusted");
        assert_eq!(refused.exit_code(), 7, "{refused}");
    }
}

pub(crate) async fn a_record_of_trust_outlives_the_program<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    axis.move_to(amount("5mm"), HERE).await.expect("it is there");
    let record = axis.trust().to_string();
    assert_eq!(record, "trusted 200");
    drop(axis);
    let record = TrustState::parse(&record).expect("a record");
    let axis = rig.axis().with_scale(millimetres()).with_trust(record);
    axis.move_to(amount("1mm"), HERE).await.expect("still trusted");
    assert_eq!(rig.carriage(), 40.0);
}

pub(crate) async fn a_record_of_trust_does_not_outlive_a_restart<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    let record = axis.trust();
    drop(axis);
    rig.restart();
    rig.move_behind_its_back(7).await;
    let axis = rig.axis().with_trust(record);
    let state = axis.state().await.expect("a state");
    assert_ne!(state.trust, Trust::Trusted, "{state:?}");
}

pub(crate) async fn where_the_counter_does_not_reach_nothing_goes<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    for text in ["by 9000000 steps", "by -9000000 steps", "to 9000000 steps", "by 9223372036mm"] {
        let refused = axis.go(goal(text), HERE).await.expect_err("too far");
        assert!(refused.to_string().ends_with("nothing was sent"), "{refused}");
        assert_eq!(refused.exit_code(), 1, "{refused}");
    }
    assert_eq!(rig.starts(), 0);
}

pub(crate) async fn zero_wants_a_standing_motor<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    axis.move_by(amount("5mm"), HERE).await.expect("it is there");
    axis.zero().await.expect("it stands");
    assert_eq!(axis.position().await, Ok(amount("0mm")));
    axis.move_to(amount("5mm"), HERE).await.expect("it is there");
    assert_eq!(rig.carriage(), 400.0);
}

pub(crate) async fn no_command_is_given_twice_under_any_trouble<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    let mut expected = 0.0;
    for number in 0..200_u64 {
        // A fixed walk through all places at which a reply can be lost or a caller can leave.
        rig.lose_reply(usize::try_from(number * 7 % 23).expect("small"));
        let before = rig.carriage();
        let moving = axis.move_by(amount("1mm"), HERE);
        let _ = timeout(Duration::from_millis(number * 13 % 1500), moving).await;
        axis.wait_done(None).await.expect("it stands");
        let starts = rig.starts();
        assert!(starts <= 1, "{number}: started {starts} times");
        expected += if starts == 1 { 40.0 } else { 0.0 };
        assert_eq!(rig.carriage(), expected, "{number}: from {before}");
        assert!(axis.trust().trust() == Trust::Trusted, "{number}: {:?}", axis.trust());
    }
    let state = axis.state().await.expect("a state");
    assert_eq!(state.full_steps, expected);
    assert!(expected > 1000.0, "most moves were made");
}

pub(crate) async fn somebody_who_watches_all_the_time_shakes_no_trust<S: Stage>() {
    let rig = S::new().await;
    let axis = Arc::new(zeroed(&rig).await);
    let watcher = Arc::clone(&axis);
    let watching = tokio::spawn(async move {
        loop {
            watcher.state().await.expect("a state");
            tokio::task::yield_now().await;
            tokio::time::sleep(MS / 4).await;
        }
    });
    for number in 1..30_i64 {
        let there = Amount::parse(&format!("{} steps", number * 7 % 11)).expect("an amount");
        axis.move_to(there, HERE).await.expect("still trusted");
    }
    watching.abort();
    assert_eq!(axis.trust().trust(), Trust::Trusted);
}

pub(crate) async fn the_axis_can_be_used_behind_a_box<S: Stage>() {
    let rig = S::new().await;
    let axis: Box<dyn Axis> = Box::new(zeroed(&rig).await);
    axis.move_to(amount("1mm"), HERE).await.expect("it is there");
    assert_eq!((axis.speed().await, axis.faults().await), (Ok(0.0), Ok(vec![])));
    assert_eq!(axis.position().await, Ok(amount("1mm")));
    assert!(format!("{axis:?}").contains("DriveAxis") && !axis.name().is_empty());
}
