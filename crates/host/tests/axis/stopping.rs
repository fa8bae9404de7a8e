//! That a stop wins, whenever it comes and whatever is under way.
#![allow(clippy::float_cmp, reason = "whole steps are exact")]

use crate::stage::{MS, SECOND, Stage, suite};
use crate::suite::{amount, energise, goal, told, zeroed};
use std::time::Duration;
use stepdrive_host::axis::{Axis, DriveAxis, MoveOptions, Stop};
use stepdrive_host::trust::{Doubt, Trust};
use stepdrive_host::units::Speed;
use stepdrive_host::{Direction, Error};
use tokio::time::{Instant, sleep, timeout};

const HERE: MoveOptions = MoveOptions { speed: None, no_wait: false, override_trust: false, timeout: None };

/// The ways to stop, in turn.
pub(crate) const WAYS: [Stop; 3] = [Stop::Soft, Stop::Hard, Stop::Free];

suite! { $ hold of stopping:
    a_stop_at_any_moment_of_homing_wins
    a_stop_at_any_moment_of_homing_from_the_switch_wins
    a_stop_at_any_moment_of_a_move_wins_and_stays_of_its_kind
    a_stop_at_any_moment_of_a_run_wins
    a_stop_that_is_given_up_half_way_still_ends_what_is_being_sent
    a_stop_behind_the_call_ends_what_was_not_even_begun
    a_motion_that_is_asked_for_behind_a_stop_is_made
    a_stop_waits_for_no_more_than_what_is_being_sent
    a_speed_that_the_controller_does_not_take_is_refused_beforehand
}

pub(crate) fn at(text: &str) -> MoveOptions {
    MoveOptions { speed: Some(Speed::parse(text).expect("a speed")), ..HERE }
}

/// Looks at the motor until it has stood for a while: it only ever gets slower.
async fn brakes_to_a_standstill<S: Stage>(rig: &S, when: &str) {
    let mut speed = rig.speed().abs();
    for _ in 0..300 {
        sleep(10 * MS).await;
        let now = rig.speed().abs();
        assert!(now <= speed + 0.01, "{when}: {now} steps/s behind {speed} steps/s");
        speed = now;
    }
    assert_eq!(speed, 0.0, "{when}");
}

/// Stops after a while. Nothing starts once that was answered, and the motor only ever gets slower.
pub(crate) async fn stop_and_watch<S: Stage>(
    axis: &DriveAxis<S::Motor>,
    rig: &S,
    after: Duration,
    how: Stop,
) {
    let when = format!("{how:?} after {after:?}");
    sleep(after).await;
    axis.stop(how).await.expect("stopped");
    rig.starts();
    brakes_to_a_standstill(rig, &when).await;
    assert_eq!(rig.starts(), 0, "{when}");
}

/// Homes, stops after a while on a line that is slow, and looks whether that was all. Answers whether home was found first.
async fn home_and_stop<S: Stage>(axis: DriveAxis<S::Motor>, rig: &S, after: Duration, how: Stop) -> bool {
    let when = format!("{how:?} after {after:?}");
    rig.slow_down(30 * MS);
    let homing = axis.home(Direction::Negative, at("200 steps/s"));
    let (homed, ()) = tokio::join!(homing, stop_and_watch(&axis, rig, after, how));
    let state = axis.state().await.expect("a state");
    assert!(state.energised == (how == Stop::Soft) || how == Stop::Hard, "{when}: {state:?}");
    if homed.is_ok() {
        return true;
    }
    let words = told(homed);
    assert!(words.contains("was told to stop while it looked for home; home it again"), "{when}: {words}");
    let doubt = axis.trust().doubt();
    let before = [Doubt::NotHomed, Doubt::HomingFailed, Doubt::Freed, Doubt::Disabled];
    assert!(doubt.is_some_and(|doubt| before.contains(&doubt)), "{when}: {doubt:?}");
    false
}

pub(crate) async fn a_stop_at_any_moment_of_homing_wins<S: Stage>() {
    let mut found = 0;
    for (number, how) in (0..60).zip(WAYS.into_iter().cycle()) {
        let rig = S::new().await;
        let axis = rig.axis();
        energise(&axis).await;
        found += u32::from(home_and_stop(axis, &rig, number * 29 * MS, how).await);
    }
    assert!((1..30).contains(&found), "the last stops came behind it, {found} of them");
}

pub(crate) async fn a_stop_at_any_moment_of_homing_from_the_switch_wins<S: Stage>() {
    let mut found = 0;
    for (number, how) in (0..60).zip(WAYS.into_iter().cycle()) {
        let rig = S::new().await;
        let axis = rig.axis();
        energise(&axis).await;
        axis.move_by(amount("-108 steps"), HERE).await.ok();
        axis.distrust(Doubt::NotHomed);
        found += u32::from(home_and_stop(axis, &rig, number * 29 * MS, how).await);
    }
    assert!((1..60).contains(&found), "the last stops came behind it, {found} of them");
}

pub(crate) async fn a_stop_at_any_moment_of_a_move_wins_and_stays_of_its_kind<S: Stage>() {
    for (number, how) in (0..45).zip(WAYS.into_iter().cycle()) {
        let rig = S::new().await;
        let axis = zeroed(&rig).await;
        rig.slow_down(30 * MS);
        let after = number * 19 * MS;
        let moving = axis.go(goal("by 100mm"), HERE);
        let (moved, ()) = tokio::join!(moving, stop_and_watch(&axis, &rig, after, how));
        let when = format!("{how:?} after {after:?}");
        assert!(matches!(moved, Err(Error::Refused(_) | Error::Fault(_))), "{when}: {moved:?}");
        let state = axis.state().await.expect("a state");
        assert!(state.energised == (how == Stop::Soft) || how == Stop::Hard, "{when}: {state:?}");
    }
}

pub(crate) async fn a_stop_at_any_moment_of_a_run_wins<S: Stage>() {
    for (number, how) in (0..45).zip(WAYS.into_iter().cycle()) {
        let rig = S::new().await;
        let axis = zeroed(&rig).await;
        rig.slow_down(30 * MS);
        let after = number * 13 * MS;
        let run = axis.run(Direction::Positive, HERE);
        let (ran, ()) = tokio::join!(run, stop_and_watch(&axis, &rig, after, how));
        assert!(matches!(ran, Ok(()) | Err(Error::Refused(_))), "{how:?} after {after:?}: {ran:?}");
    }
}

pub(crate) async fn a_stop_that_is_given_up_half_way_still_ends_what_is_being_sent<S: Stage>() {
    let mut ended = 0;
    for (number, how) in (0..60).zip(WAYS.into_iter().cycle()) {
        let rig = S::new().await;
        let axis = zeroed(&rig).await;
        rig.slow_down(30 * MS);
        let given_up = async {
            sleep(number * 10 * MS).await;
            assert!(timeout(10 * MS, axis.stop(how)).await.is_err());
        };
        let moving = MoveOptions { no_wait: true, ..HERE };
        let (moved, ()) = tokio::join!(axis.go(goal("by 1000mm"), moving), given_up);
        if moved.is_ok() {
            continue;
        }
        ended += 1;
        assert!(told(moved).contains("was told to stop while it was being sent off"));
        sleep(3 * SECOND).await;
        assert_eq!(rig.speed(), 0.0, "{how:?} after {} ms", number * 10);
        let state = axis.state().await.expect("a state");
        let was_sent_off = rig.starts() > 0;
        assert!(how != Stop::Free || !was_sent_off || !state.energised, "after {} ms", number * 10);
    }
    assert!((5..50).contains(&ended), "{ended} of them came in time");
}

pub(crate) async fn a_stop_behind_the_call_ends_what_was_not_even_begun<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    let (go, run) = (axis.go(goal("by 1mm"), HERE), axis.run(Direction::Positive, HERE));
    let home = axis.home(Direction::Negative, HERE);
    axis.stop(Stop::Soft).await.expect("stopped");
    for words in [told(go.await), told(run.await), told(home.await)] {
        assert!(words.contains("was told to stop while it"), "{words}");
    }
    assert_eq!((rig.starts(), rig.carriage()), (0, 0.0));
    assert_eq!(axis.trust().trust(), Trust::Trusted, "nothing was sent");
}

pub(crate) async fn a_motion_that_is_asked_for_behind_a_stop_is_made<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    rig.slow_down(30 * MS);
    let (stopped, gone) = tokio::join!(axis.stop(Stop::Soft), axis.go(goal("by 5mm"), HERE));
    assert_eq!(stopped, Ok(()));
    gone.expect("it is there");
    assert_eq!(rig.carriage(), 200.0);
}

pub(crate) async fn a_stop_waits_for_no_more_than_what_is_being_sent<S: Stage>() {
    for after in [100 * MS, 500 * MS] {
        let rig = S::new().await;
        let axis = zeroed(&rig).await;
        let stopped = async {
            sleep(after).await;
            let began = Instant::now();
            axis.stop(Stop::Soft).await.expect("stopped");
            assert!(began.elapsed() < 50 * MS, "{:?}", began.elapsed());
        };
        let (homed, ()) = tokio::join!(axis.home(Direction::Positive, HERE), stopped);
        assert!(told(homed).contains("was told to stop"));
    }
}

pub(crate) async fn a_speed_that_the_controller_does_not_take_is_refused_beforehand<S: Stage>() {
    let rig = S::new().await;
    let axis = zeroed(&rig).await;
    for (speed, shown) in [("100000 steps/s", " 100000 "), ("9000000000 steps/s", " 9e9 ")] {
        let refused = axis.plan(goal("by 1mm"), at(speed)).await.expect_err("too fast");
        let words = refused.to_string();
        assert!(words.contains(shown) && words.contains(" is out of range: "), "{words}");
        assert!(words.ends_with("; nothing was sent") && refused.exit_code() == 1, "{words}");
        assert_eq!(axis.go(goal("by 1mm"), at(speed)).await.expect_err("too fast"), refused);
        assert_eq!(axis.run(Direction::Positive, at(speed)).await, Err(refused));
        let refused = axis.home(Direction::Negative, at(speed)).await.expect_err("too fast");
        assert!(refused.to_string().contains(shown) && refused.exit_code() == 1, "{refused}");
    }
    assert_eq!((rig.starts(), axis.trust().trust()), (0, Trust::Trusted));
}
