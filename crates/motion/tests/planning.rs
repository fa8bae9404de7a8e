//! Properties of single profiles, over the whole range of the controllers.
#![allow(clippy::float_cmp, reason = "these figures are exact")]

mod common;

use common::{SECOND, config, distance, limits, part_of, textbook_seconds};
use proptest::prelude::*;
use stepdrive_motion::check::{End, check};
use stepdrive_motion::{Limits, Phase, Profile};

/// Evaluates the profile at `samples` instants and holds it against the limits and against itself.
fn sample(profile: &Profile, limits: &Limits, v0: f64, samples: u64) {
    let span = profile.duration_ns().unwrap_or(100 * SECOND) + 10;
    let top = limits.max.max(v0);
    let mut last = (0, profile.start_position());
    for sample in 0..=samples {
        let ns = span / samples * sample;
        let (s, v) = (profile.position(ns), profile.speed(ns));
        assert!(s >= last.1, "steps back from {} to {s} at {ns}", last.1);
        assert!(v <= top, "speed {v} above {top} at {ns}");
        let seconds = (ns - last.0) as f64 / 1e9;
        let most = top * seconds * (1.0 + 1e-9) + 2e-6 + 1e-12 * s;
        assert!(s - last.1 <= most, "covers {} in {seconds} s", s - last.1);
        last = (ns, s);
    }
}

fn braking_distance(v0: f64, limits: &Limits) -> f64 {
    f64::max((v0 * v0 - limits.stop * limits.stop) / (2.0 * limits.dec), 0.0)
}

fn assert_close(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.max(1.0),
        "takes {found} s, the textbook says {expected} s"
    );
}

proptest! {
    #![proptest_config(config(512))]

    #[test]
    fn a_move_from_standstill_keeps_its_limits_ends_exactly_and_takes_the_textbook_time(
        limits in limits(), n in distance()
    ) {
        let profile = Profile::distance(0.0, 0.0, n, &limits).unwrap();
        prop_assert_eq!(check(&profile, &limits, 0.0, End::At(n)), Ok(()));
        sample(&profile, &limits, 0.0, 200);
        prop_assert_eq!(profile.position(profile.duration_ns().unwrap()), n as f64);
        assert_close(profile.duration_s().unwrap(), textbook_seconds(n as f64, 0.0, &limits));
    }

    #[test]
    fn a_move_in_flight_is_planned_exactly_when_braking_fits(
        limits in limits(), s0 in 0.0..1.0, share in 0.001..1.5, n in distance()
    ) {
        let v0 = limits.max * share;
        let length = n as f64 - s0;
        let braking = braking_distance(v0, &limits);
        match Profile::distance(s0, v0, n, &limits) {
            None => prop_assert!(braking > length),
            Some(profile) => {
                prop_assert!(braking <= length + 1e-5);
                prop_assert_eq!(check(&profile, &limits, v0, End::At(n)), Ok(()));
                sample(&profile, &limits, v0, 100);
                assert_close(profile.duration_s().unwrap(), textbook_seconds(length, v0, &limits));
            }
        }
    }

    #[test]
    fn a_run_reaches_its_speed_and_keeps_it(limits in limits(), s0 in 0.0..1.0, share in 0.0..1.5, speed in 0.0..3e6) {
        let v0 = limits.max * share;
        let profile = Profile::run(s0, v0, speed, &limits);
        let cruise = limits.run_speed(speed);
        prop_assume!(cruise > 0.0);
        prop_assert_eq!(check(&profile, &limits, v0, End::Endless), Ok(()));
        sample(&profile, &limits, v0, 100);
        let ramp_end = profile.next_boundary(0).unwrap_or(0);
        prop_assert_eq!(profile.speed(ramp_end), cruise);
        prop_assert_eq!(profile.phase(u64::MAX), Phase::Constant);
        let from = if v0 > 0.0 { v0 } else { limits.start };
        let rate = if cruise > from { limits.acc } else { limits.dec };
        assert_close(ramp_end as f64 / 1e9, (cruise - from).abs() / rate);
    }

    #[test]
    fn braking_keeps_its_limit_and_ends_at_the_natural_distance(limits in limits(), s0 in 0.0..1.0, share in 0.0..1.5) {
        let v0 = limits.max * share;
        let profile = Profile::brake(s0, v0, &limits);
        prop_assert_eq!(check(&profile, &limits, v0, End::Anywhere), Ok(()));
        let braking = braking_distance(v0, &limits);
        let found = profile.end_position() - s0;
        prop_assert!((found - braking).abs() <= 1e-9 * braking.max(1.0), "{found} for {braking}");
    }

    #[test]
    fn a_count_is_there_at_its_instant_and_not_a_nanosecond_before(
        limits in limits(), n in distance(), picks in prop::collection::vec(0.0..1.0, 8)
    ) {
        let moving = Profile::distance(0.0, 0.0, n, &limits).unwrap();
        let running = Profile::run(0.5, 0.0, limits.max, &limits);
        for pick in picks {
            let count = 1 + part_of(n, pick);
            for profile in [&moving, &running] {
                let Some(at) = profile.when_reaches(count) else {
                    prop_assert!(count > n);
                    continue;
                };
                prop_assert!(profile.position(at) >= count as f64);
                prop_assert!(profile.position(at - 1) < count as f64);
            }
        }
    }

    #[test]
    fn the_last_crossing_of_a_speed_is_the_latest_change_of_side(
        limits in limits(), n in distance(), share in 0.0..1.2, pick in 0.0..1.1
    ) {
        let profile = Profile::distance(0.0, 0.0, n, &limits).unwrap();
        let speed = limits.max * share;
        let at = part_of(profile.duration_ns().unwrap(), pick);
        let crossing = profile.crossing(at, speed);
        let above = |ns| profile.speed(ns) > speed;
        prop_assert_eq!(crossing.above, above(at));
        let since = crossing.since.unwrap_or(0);
        prop_assert!(since <= at);
        if let Some(since) = crossing.since {
            prop_assert!(above(since) == crossing.above && above(since - 1) != crossing.above);
        }
        for step in 0..=20 {
            prop_assert_eq!(above(since + (at - since) / 20 * step), crossing.above);
        }
    }

    #[test]
    fn distance_never_steps_back_from_one_nanosecond_to_the_next(
        limits in limits(), n in distance(), pick in 0.0..1.0
    ) {
        let profile = Profile::distance(0.0, 0.0, n, &limits).unwrap();
        let boundaries = profile.segments().iter().map(|segment| segment.end_ns);
        let somewhere = part_of(profile.duration_ns().unwrap(), pick);
        for around in boundaries.chain([somewhere]) {
            for ns in around.saturating_sub(20)..around + 20 {
                prop_assert!(profile.position(ns) <= profile.position(ns + 1));
            }
        }
    }

    #[test]
    fn no_number_makes_the_planner_panic_or_answer_nonsense(
        numbers in prop::collection::vec(any::<f64>(), 9), n in any::<u64>(), ns in any::<u64>()
    ) {
        let [start, stop, max, acc, dec, s0, v0, speed, other] = numbers[..] else { unreachable!() };
        let limits = Limits { start, stop, max, acc, dec, zero_wait: core::time::Duration::MAX };
        let profiles = [
            Some(Profile::run(s0, v0, speed, &limits)),
            Some(Profile::brake(s0, v0, &limits)),
            Profile::distance(s0, v0, n, &limits),
            Profile::distance(s0, 0.0, n, &limits),
        ];
        for profile in profiles.into_iter().flatten() {
            for ns in [0, 1, ns, u64::MAX] {
                prop_assert!(profile.position(ns) >= 0.0 && profile.speed(ns) >= 0.0);
                let _ = profile.crossing(ns, other);
                let _ = profile.when_reaches(ns);
            }
        }
        prop_assert!(Profile::distance(s0, 0.0, n, &limits).is_some() || n == 0);
    }
}

#[test]
fn a_leg_planned_anew_at_its_braking_point_brakes_at_once() {
    let limits = Limits {
        start: 0.0,
        stop: 0.0,
        max: 1000.0,
        acc: 1000.0,
        dec: 500.0,
        zero_wait: core::time::Duration::ZERO,
    };
    let v0 = (999.5_f64 * 1000.0).sqrt();
    for miss in [-9e-7, 0.0, 9e-7] {
        let profile = Profile::distance(0.5 + miss, v0, 1000, &limits).unwrap();
        assert_eq!(profile.segments().len(), 1);
        assert_eq!(profile.phase(0), Phase::Decelerating);
        assert_eq!(profile.end_position(), 1000.0);
    }
    assert!(Profile::distance(0.5 + 2e-6, v0, 1000, &limits).is_none());
}
