//! The judge of the planner: plain, slow, and without any of its formulas.
//!
//! Clever motion code never has the last word. [`check`] takes a finished [`Profile`] and what was asked for, walks
//! through its segments, integrates each one from its start, and reports the first thing that is wrong, with numbers.

use crate::segment::{Phase, Segment};
pub use crate::violation::Violation;
use crate::{Limits, Profile};

/// The share of a limit by which rounding may exceed it.
const RELATIVE: f64 = 1e-9;
/// Counts by which a segment may miss its place: the planner lets a leg planned anew be a millionth of a count off.
const COUNTS: f64 = 2e-6;
/// The share of a quantity that a handful of rounding steps may take.
const BITS: f64 = 16.0 * f64::EPSILON;
/// Points at which the evaluation of each segment is compared with the integral.
const PROBES: u64 = 8;

/// Where a profile was asked to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// In a cruise for ever.
    Endless,
    /// Standing at exactly this count.
    At(u64),
    /// Standing wherever braking ends.
    Anywhere,
}

/// Whether `profile` is a right plan from the speed `v0` (0 for a standstill) to `end` under `limits`.
///
/// # Errors
///
/// The first violation met, in the order of the segments.
pub fn check(profile: &Profile, limits: &Limits, v0: f64, end: End) -> Result<(), Violation> {
    let limits = limits.sane();
    let mut before = Before { t: 0.0, s: profile.start_position(), v: start_speed(profile, &limits, v0) };
    for (number, segment) in profile.segments().iter().enumerate() {
        check_start(number, segment, &before)?;
        check_limits(number, segment, &limits, v0)?;
        check_integral(number, segment)?;
        check_evaluation(profile, segment)?;
        before = Before { t: segment.end_s, s: segment.s_end, v: segment.v_end };
    }
    check_end(profile, &limits, v0, end)
}

/// Where the segment before left off.
struct Before {
    t: f64,
    s: f64,
    v: f64,
}

/// The speed with which the profile must begin: `v0`, or from a standstill the start speed. A move too short to brake
/// from the start speed begins with its only braking at a lower one.
fn start_speed(profile: &Profile, limits: &Limits, v0: f64) -> f64 {
    match profile.segments() {
        [only] if v0 <= 0.0 && only.phase() == Phase::Decelerating => only.v_start.min(limits.start),
        _ if v0 <= 0.0 => limits.start,
        _ => v0,
    }
}

fn check_start(segment: usize, this: &Segment, before: &Before) -> Result<(), Violation> {
    let gap = |what, expected, found| Err(Violation::Gap { segment, what, expected, found });
    if this.start_s != before.t {
        return gap("time", before.t, this.start_s);
    }
    if this.s_start != before.s {
        return gap("distance", before.s, this.s_start);
    }
    if !near(this.v_start, before.v) {
        return gap("speed", before.v, this.v_start);
    }
    Ok(())
}

fn check_limits(segment: usize, this: &Segment, limits: &Limits, v0: f64) -> Result<(), Violation> {
    let limit = if this.accel < 0.0 { limits.dec } else { limits.acc };
    if this.accel.is_nan() || this.accel.abs() > limit * (1.0 + RELATIVE) {
        return Err(Violation::TooSteep { segment, accel: this.accel, limit });
    }
    let high = limits.max.max(v0) * (1.0 + RELATIVE);
    for speed in [this.v_start, this.v_end] {
        if !(0.0..=high).contains(&speed) {
            return Err(Violation::Speed { segment, speed, low: 0.0, high });
        }
    }
    // What speeds up or cruises never falls below a start from standstill or the speed it had.
    let low = limits.start.min(limits.stop).min(if v0 > 0.0 { v0 } else { limits.start });
    if this.accel >= 0.0 && this.v_start < low * (1.0 - RELATIVE) {
        return Err(Violation::Speed { segment, speed: this.v_start, low, high });
    }
    Ok(())
}

/// Integrates the segment from its start and compares with its end.
fn check_integral(segment: usize, this: &Segment) -> Result<(), Violation> {
    let wrong = |what, expected, found| Err(Violation::Inconsistent { segment, what, expected, found });
    let duration = this.end_s - this.start_s;
    if duration.is_nan() || duration < 0.0 {
        return wrong("duration", 0.0, duration);
    }
    if duration.is_infinite() {
        let endless = this.accel == 0.0 && this.v_end == this.v_start && this.s_end.is_infinite();
        return if endless { Ok(()) } else { wrong("duration", this.s_end, duration) };
    }
    let v_end = this.v_start + this.accel * duration;
    // The time itself is only known to its last bit.
    let v_slack = this.accel.abs() * time_slack(this) + RELATIVE * this.v_start.max(this.v_end);
    if (v_end - this.v_end).abs() > v_slack {
        return wrong("speed", v_end, this.v_end);
    }
    let s_end = this.s_start + 0.5 * (this.v_start + this.v_end) * duration;
    if (s_end - this.s_end).abs() > distance_slack(this, this.s_end) {
        return wrong("distance", s_end, this.s_end);
    }
    if this.s_end < this.s_start {
        return wrong("distance", this.s_start, this.s_end);
    }
    check_nanos(segment, this)
}

/// The whole nanoseconds are those after the boundaries in seconds.
fn check_nanos(segment: usize, this: &Segment) -> Result<(), Violation> {
    for (ns, s) in [(this.start_ns, this.start_s), (this.end_ns, this.end_s)] {
        let late = crate::num::seconds(ns) - s;
        if ns < u64::MAX && !(-RELATIVE * s..=1e-9 * (1.0 + 1e-6) + RELATIVE * s).contains(&late) {
            return Err(Violation::Inconsistent {
                segment,
                what: "nanoseconds",
                expected: s * 1e9,
                found: late,
            });
        }
    }
    Ok(())
}

/// The profile answers within the segment what the integral says, and never steps back.
fn check_evaluation(profile: &Profile, this: &Segment) -> Result<(), Violation> {
    let mut last = this.s_start;
    for probe in 0..PROBES {
        let span = this.end_ns.saturating_sub(this.start_ns) / PROBES;
        let at_ns = this.start_ns.saturating_add(span.saturating_mul(probe));
        let t = crate::num::seconds(at_ns) - this.start_s;
        let expected = this.s_start + this.v_start * t + 0.5 * this.accel * t * t;
        let found = profile.position(at_ns);
        if at_ns < this.end_ns && (found < last || (found - expected).abs() > distance_slack(this, expected))
        {
            return Err(Violation::Evaluation { at_ns, expected, found });
        }
        last = last.max(found);
    }
    Ok(())
}

fn check_end(profile: &Profile, limits: &Limits, v0: f64, end: End) -> Result<(), Violation> {
    let found = profile.end_position();
    let expected = match end {
        End::Endless => f64::INFINITY,
        // At count 0 the fraction it was planned with is left to be dropped.
        End::At(n) => crate::num::distance(n).max(profile.start_position()),
        End::Anywhere => found,
    };
    if found != expected {
        return Err(Violation::WrongEnd { expected, found });
    }
    let speed = profile.segments().last().map_or(v0.max(0.0), |last| last.v_end);
    if end != End::Endless && speed > limits.stop * (1.0 + RELATIVE) {
        return Err(Violation::EndsTurning { speed, limit: limits.stop });
    }
    Ok(())
}

/// Seconds by which rounding may shift the ends of a segment.
fn time_slack(segment: &Segment) -> f64 {
    BITS * segment.end_s
}

/// Counts by which rounding may shift a distance of about `reach` within a segment: the bits of the distance itself, of
/// the time, and of the difference of two speeds of which the planner made a time.
fn distance_slack(segment: &Segment, reach: f64) -> f64 {
    let v = segment.v_start.max(segment.v_end);
    let time = if segment.end_s.is_finite() { time_slack(segment) } else { 0.0 };
    let change = if segment.accel == 0.0 { 0.0 } else { BITS * v / segment.accel.abs() };
    COUNTS + BITS * reach + v * (time + change)
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= RELATIVE * a.abs().max(b.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use arrayvec::ArrayVec;
    use core::time::Duration;
    use std::string::ToString;

    const LIMITS: Limits =
        Limits { start: 10.0, stop: 10.0, max: 1000.0, acc: 1000.0, dec: 500.0, zero_wait: Duration::ZERO };

    /// A right move with its segments spoilt by `spoil`, judged.
    fn judge(spoil: impl Fn(&mut [Segment])) -> Result<(), Violation> {
        let right = Profile::distance(0.0, 0.0, 4000, &LIMITS).unwrap();
        let mut segments: ArrayVec<Segment, { crate::MAX_SEGMENTS }> =
            right.segments().iter().copied().collect();
        spoil(&mut segments);
        check(&Profile::new(0.0, segments), &LIMITS, 0.0, End::At(4000))
    }

    #[test]
    fn a_right_move_passes() {
        assert_eq!(judge(|_| ()), Ok(()));
    }

    #[test]
    fn a_gap_in_time_distance_or_speed_is_found() {
        for (what, found) in [
            ("time", judge(|s| s[1].start_s += 1e-6)),
            ("distance", judge(|s| s[1].s_start += 1.0)),
            ("speed", judge(|s| s[1].v_start -= 1.0)),
        ] {
            assert!(
                matches!(found, Err(Violation::Gap { segment: 1, what: w, .. }) if w == what),
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_limit_that_is_exceeded_is_found() {
        let slow = Limits { max: 900.0, ..LIMITS };
        let gentle = Limits { dec: 499.0, ..LIMITS };
        let profile = Profile::distance(0.0, 0.0, 4000, &LIMITS).unwrap();
        let judged = |limits| check(&profile, limits, 0.0, End::At(4000));
        assert!(matches!(judged(&slow), Err(Violation::Speed { segment: 0, speed: 1000.0, .. })));
        assert!(matches!(judged(&gentle), Err(Violation::TooSteep { segment: 2, accel: -500.0, .. })));
    }

    #[test]
    fn a_segment_that_does_not_integrate_is_found() {
        let found = judge(|s| s[0].s_end += 0.01);
        assert!(
            matches!(found, Err(Violation::Inconsistent { segment: 0, what: "distance", .. })),
            "{found:?}"
        );
        let found = judge(|s| s[2].end_ns += 10_000);
        assert!(matches!(found, Err(Violation::Inconsistent { what: "nanoseconds", .. })), "{found:?}");
    }

    #[test]
    fn an_end_in_the_wrong_place_or_at_speed_is_found() {
        let profile = Profile::distance(0.0, 0.0, 4000, &LIMITS).unwrap();
        assert_eq!(
            check(&profile, &LIMITS, 0.0, End::At(4001)),
            Err(Violation::WrongEnd { expected: 4001.0, found: 4000.0 })
        );
        let strict = Limits { stop: 0.0, ..LIMITS };
        assert_eq!(
            check(&profile, &strict, 0.0, End::At(4000)),
            Err(Violation::EndsTurning { speed: 10.0, limit: 0.0 })
        );
    }

    #[test]
    fn a_violation_prints_its_numbers() {
        let violation = Violation::TooSteep { segment: 2, accel: -500.0, limit: 499.0 };
        assert_eq!(violation.to_string(), "segment 2 accelerates at -500, limit 499");
    }
}
