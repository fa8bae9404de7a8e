//! The plan of one leg, and the questions it answers.

use crate::num;
use crate::segment::{Phase, Segment};
use arrayvec::ArrayVec;

/// The most segments a profile has: a change of speed, a cruise, braking.
pub const MAX_SEGMENTS: usize = 3;

/// On which side of a speed the generator is, and since when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossing<T> {
    /// Whether the speed is above the one asked about; equal is not above.
    pub above: bool,
    /// The earliest time from which that has held without a break; `None` when it has held since the leg started.
    pub since: Option<T>,
}

/// Distance and speed over time of one leg: segments of constant acceleration without gaps, then a standstill or a
/// cruise without end.
///
/// Time is given in whole nanoseconds from the start of the profile; distance is in counts, speed in counts per second.
/// The constructors [`Profile::run`], [`Profile::distance`] and [`Profile::brake`] never fail on odd numbers: limits are
/// made [`crate::Limits::sane`], a fraction `s0` outside `0..1` or a negative `v0` is clamped.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    segments: ArrayVec<Segment, MAX_SEGMENTS>,
    s_start: f64,
}

impl Profile {
    pub(crate) fn new(s_start: f64, segments: ArrayVec<Segment, MAX_SEGMENTS>) -> Profile {
        Profile { segments, s_start }
    }

    /// The segments, in order; none when the profile stands still from the start.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The distance at the start: the fraction of a count with which the leg was planned.
    pub fn start_position(&self) -> f64 {
        self.s_start
    }

    /// The distance at the end, in counts; infinite when the profile cruises for ever.
    pub fn end_position(&self) -> f64 {
        self.segments.last().map_or(self.s_start, |last| last.s_end)
    }

    /// Whether the profile has no motion at all.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// Seconds until the standstill, in closed form; `None` when the profile cruises for ever.
    pub fn duration_s(&self) -> Option<f64> {
        let end = self.segments.last().map_or(0.0, |last| last.end_s);
        end.is_finite().then_some(end)
    }

    /// Whole nanoseconds until the standstill; `None` when it never comes, or not within 584 years.
    pub fn duration_ns(&self) -> Option<u64> {
        let end = self.segments.last().map_or(0, |last| last.end_ns);
        (end < u64::MAX).then_some(end)
    }

    /// The distance at `ns`. Never steps back as `ns` grows.
    pub fn position(&self, ns: u64) -> f64 {
        self.segment_at(ns).map_or_else(|| self.end_position(), |segment| segment.position(ns))
    }

    /// The speed at `ns`.
    pub fn speed(&self, ns: u64) -> f64 {
        self.segment_at(ns).map_or(0.0, |segment| segment.speed(ns))
    }

    /// What the generator does at `ns`.
    pub fn phase(&self, ns: u64) -> Phase {
        self.segment_at(ns).map_or(Phase::Stopped, Segment::phase)
    }

    /// The first change of phase later than `ns`; `None` when there is none.
    pub fn next_boundary(&self, ns: u64) -> Option<u64> {
        self.segments.iter().map(|segment| segment.end_ns).find(|&end| end > ns && end < u64::MAX)
    }

    /// The smallest nanosecond at which [`Profile::position`] is at least `count`; `None` when the profile ends short
    /// of it. 0 when it is there from the start.
    pub fn when_reaches(&self, count: u64) -> Option<u64> {
        let target = num::distance(count);
        if self.s_start >= target {
            return Some(0);
        }
        let segment = self.segments.iter().find(|segment| segment.s_end >= target)?;
        // Only a cruise without end can come too late for the clock.
        let high = segment.end_ns;
        let reached = |ns| self.position(ns) >= target;
        reached(high).then(|| num::first(segment.start_ns, high, segment.about_when_at(target), reached))
    }

    /// On which side of `speed` the generator is at `ns`, and since when.
    pub fn crossing(&self, ns: u64, speed: f64) -> Crossing<u64> {
        let above = self.speed(ns) > speed;
        Crossing { above, since: self.since(ns, speed, above) }
    }

    /// The latest nanosecond up to `ns` at which the generator came to the side of `speed` on which it is at `ns`.
    fn since(&self, ns: u64, speed: f64, above: bool) -> Option<u64> {
        let same = |at: u64| (self.speed(at) > speed) == above;
        let mut high = ns;
        if let Some(end) = self.duration_ns().filter(|&end| end <= ns) {
            // At the standstill since `end`: one nanosecond earlier it may have been on the other side.
            high = end.checked_sub(1)?;
            if !same(high) {
                return Some(end);
            }
        }
        for segment in self.segments.iter().rev().filter(|segment| segment.start_ns < segment.end_ns) {
            if segment.start_ns > high {
                continue;
            }
            if !same(segment.start_ns) {
                return Some(num::first(segment.start_ns, high, segment.about_when_speed(speed), same));
            }
            // The speed is continuous, but between two whole nanoseconds it may jump over `speed`.
            let before = segment.start_ns.checked_sub(1)?;
            if !same(before) {
                return Some(segment.start_ns);
            }
            high = before;
        }
        None
    }

    /// The segment that holds at `ns`; `None` at the standstill.
    fn segment_at(&self, ns: u64) -> Option<&Segment> {
        self.segments.iter().find(|segment| ns < segment.end_ns || segment.s_end.is_infinite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;
    use core::time::Duration;

    /// 0 to 1000 counts/s at 1000 counts/s², down at 500 counts/s².
    const PLAIN: Limits =
        Limits { start: 0.0, stop: 0.0, max: 1000.0, acc: 1000.0, dec: 500.0, zero_wait: Duration::ZERO };
    const SECOND: u64 = 1_000_000_000;

    fn trapezoid() -> Profile {
        Profile::distance(0.0, 0.0, 3500, &PLAIN).unwrap()
    }

    #[test]
    fn position_speed_and_phase_follow_a_trapezoid() {
        let profile = trapezoid();
        let rows = [
            // ns              s       v       phase
            (0, 0.0, 0.0, Phase::Accelerating),
            (SECOND / 2, 125.0, 500.0, Phase::Accelerating),
            (SECOND, 500.0, 1000.0, Phase::Constant),
            (2 * SECOND, 1500.0, 1000.0, Phase::Constant),
            (3 * SECOND, 2500.0, 1000.0, Phase::Decelerating),
            (4 * SECOND, 3250.0, 500.0, Phase::Decelerating),
            (5 * SECOND, 3500.0, 0.0, Phase::Stopped),
            (u64::MAX, 3500.0, 0.0, Phase::Stopped),
        ];
        for (ns, s, v, phase) in rows {
            assert_eq!(
                (profile.position(ns), profile.speed(ns), profile.phase(ns)),
                (s, v, phase),
                "at {ns}"
            );
        }
        assert_eq!(profile.duration_s(), Some(5.0));
    }

    #[test]
    fn counts_are_reached_at_the_instants_worked_out_by_hand() {
        let profile = trapezoid();
        assert_eq!(profile.when_reaches(0), Some(0));
        assert_eq!(profile.when_reaches(125), Some(SECOND / 2));
        assert_eq!(profile.when_reaches(1500), Some(2 * SECOND));
        assert_eq!(profile.when_reaches(3250), Some(4 * SECOND));
        assert_eq!(profile.when_reaches(3501), None);
    }

    #[test]
    fn the_side_of_a_speed_is_known_with_the_instant_of_the_last_crossing() {
        let profile = trapezoid();
        let side = |ns| profile.crossing(ns, 500.0);
        assert_eq!(side(SECOND / 4), Crossing { above: false, since: None });
        assert_eq!(side(SECOND / 2), Crossing { above: false, since: None });
        assert_eq!(side(2 * SECOND), Crossing { above: true, since: Some(SECOND / 2 + 1) });
        assert_eq!(side(4 * SECOND - 1), Crossing { above: true, since: Some(SECOND / 2 + 1) });
        assert_eq!(side(9 * SECOND), Crossing { above: false, since: Some(4 * SECOND) });
        // Passed between the last nanosecond of the ramp and the first of the cruise.
        assert_eq!(
            profile.crossing(2 * SECOND, 999.999_999_9),
            Crossing { above: true, since: Some(SECOND) }
        );
        assert_eq!(profile.crossing(9 * SECOND, 2000.0), Crossing { above: false, since: None });
    }

    #[test]
    fn a_standstill_from_above_the_speed_asked_about_is_a_crossing() {
        let limits = Limits { start: 100.0, stop: 100.0, max: 100.0, ..PLAIN };
        let profile = Profile::distance(0.0, 0.0, 50, &limits).unwrap();
        assert_eq!(profile.crossing(SECOND, 10.0), Crossing { above: false, since: Some(SECOND / 2) });
        assert_eq!(profile.crossing(SECOND / 4, 10.0), Crossing { above: true, since: None });
    }

    #[test]
    fn boundaries_come_in_order_and_end_at_the_standstill() {
        let profile = trapezoid();
        assert_eq!(profile.next_boundary(0), Some(SECOND));
        assert_eq!(profile.next_boundary(SECOND), Some(3 * SECOND));
        assert_eq!(profile.next_boundary(4 * SECOND), Some(5 * SECOND));
        assert_eq!(profile.next_boundary(5 * SECOND), None);
    }

    #[test]
    fn a_cruise_of_years_neither_drifts_nor_overflows() {
        let limits = Limits { start: 1000.0, stop: 1000.0, ..PLAIN };
        let profile = Profile::run(0.0, 0.0, 1000.0, &limits);
        let day = 86_400 * SECOND;
        assert_eq!(profile.position(day), 86_400_000.0);
        assert_eq!(profile.when_reaches(86_400_000), Some(day));
        assert_eq!(profile.position(365 * day), 365.0 * 86_400_000.0);
        assert!(profile.position(u64::MAX).is_finite());
        assert_eq!(profile.when_reaches(u64::MAX), None);
        assert_eq!(profile.duration_ns(), None);
    }
}
