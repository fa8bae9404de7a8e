//! What an axis does, with figures worked out by hand.
#![allow(clippy::float_cmp, reason = "these figures are exact")]

use core::time::Duration;
use stepdrive_motion::{Axis, Crossing, Direction, Goal, Limits, MAX_COUNT, Phase};
use stepdrive_spec::time::Instant;

/// 1000 counts/s, reached in 1 s over 500 counts and left in 2 s over 1000.
const LIMITS: Limits =
    Limits { start: 0.0, stop: 0.0, max: 1000.0, acc: 1000.0, dec: 500.0, zero_wait: Duration::ZERO };

fn ms(ms: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(ms)
}

/// Wakes the axis until nothing more comes, and gives the instants.
fn drain(axis: &mut Axis) -> Vec<Instant> {
    let mut wakes = Vec::new();
    while let Some(wake) = axis.next_wake() {
        axis.handle_wake(wake);
        wakes.push(wake);
        assert!(wakes.len() < 100, "wakes without end");
    }
    wakes
}

/// Count, speed and phase at `at`, after handling what is due.
fn look(axis: &mut Axis, at: Instant) -> (i64, f64, Phase) {
    axis.handle_wake(at);
    (axis.count(at), axis.speed(at), axis.phase(at))
}

#[test]
fn a_move_wakes_at_each_change_of_phase_and_ends_at_its_target() {
    let mut axis = Axis::new(100);
    axis.move_to(Instant::ZERO, 3600, &LIMITS);
    assert_eq!(axis.goal(), Goal::MoveTo(3600));
    assert_eq!(drain(&mut axis), [ms(1000), ms(3000), ms(5000)]);
    assert_eq!(look(&mut axis, ms(5000)), (3600, 0.0, Phase::Stopped));
    assert_eq!((axis.goal(), axis.is_standing()), (Goal::Stand, true));
}

#[test]
fn a_short_move_is_a_triangle() {
    let mut axis = Axis::new(0);
    axis.move_to(Instant::ZERO, -375, &LIMITS);
    // 125 counts up to 500 counts/s, 250 down.
    assert_eq!(look(&mut axis, ms(500)), (-125, 500.0, Phase::Decelerating));
    assert_eq!(drain(&mut axis), [ms(1500)]);
    assert_eq!((axis.count(ms(1500)), axis.direction()), (-375, Direction::Reverse));
}

#[test]
fn a_start_speed_is_jumped_to_and_left_from() {
    let limits = Limits { start: 200.0, stop: 200.0, ..LIMITS };
    let mut axis = Axis::new(0);
    axis.move_to(Instant::ZERO, 3440, &limits);
    assert_eq!(axis.speed(Instant::ZERO), 200.0);
    // 480 counts up in 0.8 s, 960 down in 1.6 s, 2000 between.
    assert_eq!(drain(&mut axis), [ms(800), ms(2800), ms(4400)]);
    let mut one = Axis::new(0);
    one.move_to(Instant::ZERO, 1, &Limits { max: 200.0, ..limits });
    assert_eq!(drain(&mut one), [ms(5)]);
}

#[test]
fn a_move_too_short_to_brake_from_the_start_speed_starts_slower() {
    let limits = Limits { start: 100.0, dec: 50.0, ..LIMITS };
    let mut axis = Axis::new(0);
    axis.move_to(Instant::ZERO, 1, &limits);
    assert_eq!((axis.speed(Instant::ZERO), axis.phase(Instant::ZERO)), (10.0, Phase::Decelerating));
    assert_eq!(drain(&mut axis), [ms(200)]);
    assert_eq!(axis.count(ms(200)), 1);
}

#[test]
fn a_move_to_the_present_count_does_nothing() {
    let mut axis = Axis::new(7);
    axis.move_to(ms(1), 7, &LIMITS);
    assert_eq!((axis.next_wake(), axis.is_standing(), axis.phase(ms(1))), (None, true, Phase::Stopped));
}

#[test]
fn a_run_goes_on_for_ever_and_changes_speed_in_flight() {
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Forward, 800.0, &LIMITS);
    assert!(!axis.is_settled(ms(799)));
    assert_eq!(look(&mut axis, ms(800)), (320, 800.0, Phase::Constant));
    assert!(axis.is_settled(ms(800)));
    assert_eq!(axis.next_wake(), None);
    axis.run(ms(1000), Direction::Forward, 300.0, &LIMITS);
    assert_eq!(look(&mut axis, ms(1500)), (480 + 337, 550.0, Phase::Decelerating));
    assert_eq!(look(&mut axis, ms(2000)), (480 + 550, 300.0, Phase::Constant));
}

#[test]
fn a_reversal_brakes_to_a_standstill_and_starts_again_at_once() {
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Forward, 500.0, &LIMITS);
    axis.run(ms(1000), Direction::Reverse, 1000.0, &LIMITS);
    assert_eq!(look(&mut axis, ms(1500)), (375 + 187, 250.0, Phase::Decelerating));
    assert_eq!(axis.direction(), Direction::Forward);
    assert_eq!(look(&mut axis, ms(2000)), (625, 0.0, Phase::Accelerating));
    assert_eq!(axis.direction(), Direction::Reverse);
    assert_eq!(look(&mut axis, ms(3000)), (125, 1000.0, Phase::Constant));
}

#[test]
fn a_reversal_stands_still_for_the_zero_wait() {
    let limits = Limits { zero_wait: Duration::from_millis(300), ..LIMITS };
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Forward, 500.0, &limits);
    axis.run(ms(1000), Direction::Reverse, 500.0, &limits);
    assert_eq!(look(&mut axis, ms(2000)), (625, 0.0, Phase::Stopped));
    assert_eq!((axis.is_standing(), axis.next_wake()), (false, Some(ms(2300))));
    assert_eq!(look(&mut axis, ms(2300)), (625, 0.0, Phase::Accelerating));
}

#[test]
fn a_start_in_the_old_direction_or_after_the_zero_wait_does_not_wait() {
    let limits = Limits { zero_wait: Duration::from_millis(300), ..LIMITS };
    let mut axis = Axis::new(0);
    axis.move_to(Instant::ZERO, -10, &limits);
    assert_eq!(axis.phase(Instant::ZERO), Phase::Accelerating, "the first motion has nothing to wait for");
    let end = *drain(&mut axis).last().unwrap();
    axis.move_to(end, -20, &limits);
    assert_eq!(axis.phase(end), Phase::Accelerating);
    let end = *drain(&mut axis).last().unwrap();
    axis.move_to(end + Duration::from_millis(100), 0, &limits);
    assert_eq!(axis.next_wake(), Some(end + Duration::from_millis(300)));
    axis.move_to(end + Duration::from_millis(200), -30, &limits);
    assert_eq!(axis.phase(end + Duration::from_millis(200)), Phase::Accelerating);
}

#[test]
fn a_move_behind_or_too_close_overshoots_and_returns() {
    for (target, turn) in [(100, 1500), (700, 1500), (1499, 1500)] {
        let mut axis = Axis::new(0);
        axis.run(Instant::ZERO, Direction::Forward, 1000.0, &LIMITS);
        axis.move_to(ms(1000), target, &LIMITS);
        assert_eq!(axis.phase(ms(1000)), Phase::Decelerating);
        assert_eq!(look(&mut axis, ms(3000)), (turn, 0.0, Phase::Accelerating), "to {target}");
        let end = *drain(&mut axis).last().unwrap();
        assert_eq!(axis.count(end), target);
    }
}

#[test]
fn a_move_at_the_braking_point_goes_straight_there() {
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Forward, 1000.0, &LIMITS);
    axis.move_to(ms(1000), 1500, &LIMITS);
    assert_eq!(drain(&mut axis), [ms(3000)]);
    assert_eq!(axis.count(ms(3000)), 1500);
}

#[test]
fn a_lowered_max_is_braked_to_and_a_raised_one_accelerated_to() {
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Forward, 900.0, &LIMITS);
    axis.set_limits(ms(1000), &Limits { max: 400.0, ..LIMITS });
    assert_eq!(look(&mut axis, ms(1500)).1, 650.0);
    assert_eq!(look(&mut axis, ms(2000)).1, 400.0);
    assert_eq!(axis.phase(ms(2000)), Phase::Constant);
    axis.set_limits(ms(3000), &Limits { max: 2000.0, ..LIMITS });
    assert_eq!(look(&mut axis, ms(3500)), (495 + 650 + 400 + 325, 900.0, Phase::Constant));
}

#[test]
fn a_move_under_a_lowered_max_still_ends_at_its_target() {
    let mut axis = Axis::new(0);
    axis.move_to(Instant::ZERO, 5000, &LIMITS);
    axis.set_limits(ms(2000), &Limits { max: 500.0, ..LIMITS });
    // 1500 done, 750 down to 500 in 1 s, 2500 at 500 in 5 s, 250 down in 1 s.
    assert_eq!(drain(&mut axis), [ms(3000), ms(8000), ms(9000)]);
    assert_eq!(axis.count(ms(9000)), 5000);
}

#[test]
fn limits_that_change_nothing_do_not_disturb_the_final_braking() {
    let mut axis = Axis::new(0);
    axis.move_to(Instant::ZERO, 3500, &LIMITS);
    for step in 0..20 {
        let at = ms(3001 + step * 97);
        let same = if step % 2 == 0 { LIMITS } else { Limits { max: 1500.0, acc: 400.0, ..LIMITS } };
        axis.set_limits(at, &same);
        assert_eq!(axis.phase(at), Phase::Decelerating);
        let end = axis.next_wake().unwrap();
        assert!(end.as_nanos().abs_diff(5_000_000_000) <= 1, "ends at {end}");
    }
    drain(&mut axis);
    assert_eq!(axis.count(ms(5001)), 3500);
}

#[test]
fn a_command_that_changes_nothing_changes_nothing() {
    let mut axis = Axis::new(0);
    axis.move_to(Instant::ZERO, 3500, &LIMITS);
    axis.handle_wake(ms(700));
    let before = axis.clone();
    axis.move_to(ms(700), 3500, &LIMITS);
    axis.set_limits(ms(700), &LIMITS);
    assert_eq!(axis, before);
}

#[test]
fn braking_ends_on_the_last_count_emitted_and_drops_the_fraction() {
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Reverse, 1000.0, &LIMITS);
    axis.brake(ms(50), &LIMITS);
    // 1.25 counts covered at 50 counts/s, 2.5 more in 100 ms.
    assert_eq!(drain(&mut axis), [ms(150)]);
    assert_eq!((axis.count(ms(150)), axis.goal()), (-3, Goal::Stand));
    axis.move_to(ms(150), 0, &LIMITS);
    let end = *drain(&mut axis).last().unwrap();
    assert_eq!(axis.count(end), 0);
}

#[test]
fn braking_below_the_stop_speed_stands_at_once() {
    let limits = Limits { stop: 300.0, ..LIMITS };
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Forward, 1000.0, &limits);
    axis.brake(ms(200), &limits);
    assert_eq!((axis.is_standing(), axis.count(ms(200)), axis.leg_start()), (true, 20, ms(200)));
}

#[test]
fn a_halt_stands_at_the_present_count() {
    let mut axis = Axis::new(0);
    axis.move_to(Instant::ZERO, 5000, &LIMITS);
    axis.halt(ms(2000));
    assert_eq!((axis.count(ms(2000)), axis.speed(ms(2000)), axis.next_wake()), (1500, 0.0, None));
    assert_eq!(axis.count(ms(9000)), 1500);
}

#[test]
fn a_run_at_no_speed_is_a_brake() {
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Forward, 0.0, &LIMITS);
    assert!(axis.is_standing() && axis.is_settled(Instant::ZERO));
    axis.run(Instant::ZERO, Direction::Forward, 100.0, &LIMITS);
    axis.run(ms(1000), Direction::Forward, f64::NAN, &LIMITS);
    assert_eq!(axis.phase(ms(1000)), Phase::Decelerating);
    assert_eq!(drain(&mut axis), [ms(1200)]);
}

#[test]
fn a_late_wake_lives_through_everything_at_its_own_instant() {
    let limits = Limits { zero_wait: Duration::from_millis(300), ..LIMITS };
    let command = |axis: &mut Axis| {
        axis.run(Instant::ZERO, Direction::Forward, 1000.0, &limits);
        axis.move_to(ms(1000), -2000, &limits);
    };
    let (mut prompt, mut late) = (Axis::new(0), Axis::new(0));
    command(&mut prompt);
    command(&mut late);
    let wakes = drain(&mut prompt);
    late.handle_wake(*wakes.last().unwrap());
    assert_eq!(prompt, late);
    assert_eq!((late.count(ms(90_000)), wakes.len()), (-2000, 5));
}

#[test]
fn an_instant_before_the_latest_one_is_taken_as_that_one() {
    let mut axis = Axis::new(0);
    axis.run(ms(5000), Direction::Forward, 1000.0, &LIMITS);
    axis.brake(ms(1), &LIMITS);
    assert!(axis.is_standing());
    axis.run(ms(2), Direction::Forward, 1000.0, &LIMITS);
    assert_eq!(axis.leg_start(), ms(5000));
}

#[test]
fn a_switch_ahead_is_reached_at_its_instant_and_one_behind_never() {
    let mut axis = Axis::new(0);
    axis.run(Instant::ZERO, Direction::Reverse, 1000.0, &LIMITS);
    assert_eq!(axis.when_reaches(-500), Some(ms(1000)));
    assert_eq!(axis.when_reaches(-2500), Some(ms(3000)));
    assert_eq!((axis.when_reaches(0), axis.when_reaches(1)), (None, None));
    axis.handle_wake(ms(1000));
    assert_eq!(axis.when_reaches(-500), None, "emitted already");
    axis.brake(ms(2000), &LIMITS);
    assert_eq!(axis.when_reaches(-2500), Some(ms(4000)));
    assert_eq!(axis.when_reaches(-2501), None, "past the end of braking");
}

#[test]
fn the_full_step_threshold_is_known_with_the_instant_it_was_crossed() {
    let mut axis = Axis::new(0);
    axis.run(ms(100), Direction::Forward, 1000.0, &LIMITS);
    let crossing = axis.crossing(ms(900), 500.0);
    let since = ms(600) + Duration::from_nanos(1);
    assert_eq!(crossing, Crossing { above: true, since: Some(since) });
    assert_eq!(axis.count(since), 125);
    axis.halt(ms(900));
    assert_eq!(axis.crossing(ms(950), 500.0), Crossing { above: false, since: None });
}

#[test]
fn a_cruise_of_days_stays_exact() {
    let limits = Limits { start: 2_000_000.0, stop: 2_000_000.0, max: 2_000_000.0, ..LIMITS };
    let mut axis = Axis::new(0);
    axis.run(ms(3), Direction::Reverse, 2e6, &limits);
    let days = |days: u64| ms(3) + Duration::from_secs(86_400 * days);
    assert_eq!(axis.count(days(30)), -30 * 86_400 * 2_000_000);
    assert_eq!(axis.when_reaches(-30 * 86_400 * 2_000_000 - 1), Some(days(30) + Duration::from_nanos(500)));
    axis.set_limits(days(30), &Limits { acc: 5.0, ..limits });
    assert_eq!(axis.count(days(60)), -60 * 86_400 * 2_000_000);
}

#[test]
fn the_end_of_the_clock_and_of_the_counts_is_met_without_panic() {
    let fast = Limits { start: 1e9, stop: 1e9, max: f64::INFINITY, ..LIMITS };
    let mut axis = Axis::new(i64::MAX);
    assert_eq!(axis.count(Instant::ZERO), MAX_COUNT);
    axis.run(Instant::ZERO, Direction::Forward, f64::INFINITY, &fast);
    assert!(axis.count(Instant::FAR_FUTURE) > MAX_COUNT);
    axis.move_to(Instant::FAR_FUTURE, i64::MIN, &LIMITS);
    axis.handle_wake(Instant::FAR_FUTURE);
    assert_eq!(axis.next_wake(), None);
}

#[test]
fn the_destination_is_where_the_axis_will_stand_if_it_ever_does() {
    let mut axis = Axis::new(100);
    assert_eq!(axis.destination(), None);
    axis.move_to(Instant::ZERO, 3600, &LIMITS);
    assert_eq!(axis.destination(), Some(3600));
    axis.move_to(ms(1000), 0, &LIMITS);
    assert_eq!(axis.destination(), Some(0), "though it still has to turn round");
    axis.run(ms(1000), Direction::Forward, 1000.0, &LIMITS);
    assert_eq!(axis.destination(), None);
    axis.brake(ms(2000), &LIMITS);
    let braked = axis.destination().expect("it comes to a standstill");
    drain(&mut axis);
    assert_eq!((axis.count(ms(60_000)), axis.destination()), (braked, None));
}
