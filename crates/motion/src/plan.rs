//! From a start, a target and limits to a profile.

use crate::limits::clamp;
use crate::num;
use crate::profile::{MAX_SEGMENTS, Profile};
use crate::segment::Segment;
use crate::{FASTEST, Limits};
use arrayvec::ArrayVec;

/// The fraction of a count by which a leg planned anew in flight may miss its braking point and still count as
/// standing right at it: what rounding can make of a distance, and far less than a count.
const SLACK: f64 = 1e-6;
/// The share of a distance by which rounding may falsify it.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// The largest fraction of a count: the last number before 1.
const ALMOST_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

impl Profile {
    /// From distance `s0` and speed `v0` to a cruise without end at [`Limits::run_speed`] of `speed`.
    ///
    /// `v0 = 0` is a standstill, from which the generator jumps to [`Limits::start`]. A run at no speed is a brake.
    pub fn run(s0: f64, v0: f64, speed: f64, limits: &Limits) -> Profile {
        let limits = limits.sane();
        let cruise = limits.run_speed(speed);
        if cruise <= 0.0 {
            return Profile::brake(s0, v0, &limits);
        }
        let v0 = speed_of(v0);
        let mut plan = Plan::new(s0, if v0 > 0.0 { v0 } else { limits.start });
        plan.ramp(cruise, &limits);
        plan.cruise_for_ever();
        plan.finish()
    }

    /// From distance `s0` and speed `v0` to a standstill at exactly `n` counts from the origin; `None` when braking
    /// from `v0` takes longer than that.
    ///
    /// `v0 = 0` is a standstill; from there every distance succeeds, because the generator jumps to [`Limits::start`]
    /// or, where it could not brake from that speed in time, to the highest speed from which it can. Above
    /// [`Limits::max`] it brakes to it first. With `n = 0` it succeeds when the generator may stand at once, and drops
    /// the fraction `s0`.
    ///
    /// A distance that misses the braking distance by less than a millionth of a count is braked over as it is: a leg
    /// planned anew in the middle of its final braking goes on braking.
    pub fn distance(s0: f64, v0: f64, n: u64, limits: &Limits) -> Option<Profile> {
        let limits = limits.sane();
        let (s0, v0) = (fraction_of(s0), speed_of(v0));
        let length = num::distance(n) - s0;
        if length <= 0.0 && v0 <= limits.stop {
            return Some(Plan::new(s0, v0).finish());
        }
        let in_flight = v0 > 0.0;
        let v = if in_flight { v0 } else { launch_speed(length, &limits) };
        let spare = length - limits.braking_distance(v);
        let slack = SLACK + ROUNDING * (length + v * v / (2.0 * limits.dec));
        if in_flight && spare < -slack {
            return None;
        }
        // From a standstill the speed is lower than `start` only to be braked from.
        let must_brake = if in_flight { spare <= slack } else { v < limits.start };
        let mut plan = Plan::new(s0, v);
        if v > limits.stop && must_brake {
            plan.ramp_to(limits.stop, limits.dec, num::distance(n));
        } else {
            plan.trapezoid(num::distance(n), &limits);
        }
        Some(plan.finish())
    }

    /// From distance `s0` and speed `v0` to a standstill, as soon as [`Limits::dec`] allows: braking to
    /// [`Limits::stop`], wherever that ends. Empty when the generator may stand at once.
    pub fn brake(s0: f64, v0: f64, limits: &Limits) -> Profile {
        let limits = limits.sane();
        let mut plan = Plan::new(s0, speed_of(v0));
        if plan.v > limits.stop {
            plan.ramp(limits.stop, &limits);
        }
        plan.finish()
    }
}

/// A speed to start from, whatever number was given.
fn speed_of(v: f64) -> f64 {
    clamp(v, 0.0, FASTEST)
}

/// A fraction of a count, whatever number was given.
fn fraction_of(s: f64) -> f64 {
    clamp(s, 0.0, ALMOST_ONE)
}

/// The speed to which the generator jumps from a standstill for a move over `length`: `start`, unless it could not
/// brake from there in time.
fn launch_speed(length: f64, limits: &Limits) -> f64 {
    let highest = libm::sqrt(limits.stop * limits.stop + 2.0 * limits.dec * length);
    limits.start.min(highest)
}

/// A profile in the making: its segments, and where they have come to.
struct Plan {
    segments: ArrayVec<Segment, MAX_SEGMENTS>,
    s_start: f64,
    t: f64,
    s: f64,
    v: f64,
}

impl Plan {
    fn new(s0: f64, v: f64) -> Plan {
        let s0 = fraction_of(s0);
        Plan { segments: ArrayVec::new(), s_start: s0, t: 0.0, s: s0, v }
    }

    fn finish(self) -> Profile {
        Profile::new(self.s_start, self.segments)
    }

    /// Accelerate, cruise and brake so as to stand at `end`, which is known to be far enough away.
    fn trapezoid(&mut self, end: f64, limits: &Limits) {
        let (v, length) = (self.v, end - self.s);
        let (acc, dec) = (limits.acc, limits.dec);
        let fastest_end = libm::sqrt(v * v + 2.0 * acc * length);
        if fastest_end <= limits.stop {
            // Too short to get faster than the speed from which it may stand anyway.
            let seconds = 2.0 * length / (v + fastest_end);
            self.push(seconds, end, fastest_end, acc);
            return;
        }
        let (v2, stop2) = (v * v, limits.stop * limits.stop);
        let peak = libm::sqrt((2.0 * acc * dec * length + dec * v2 + acc * stop2) / (acc + dec));
        if peak < limits.max {
            self.ramp(peak.max(v).max(limits.stop), limits);
        } else {
            self.ramp(limits.max, limits);
            self.cruise_to(end - limits.braking_distance(limits.max));
        }
        self.ramp_to(limits.stop, dec, end);
        // When the braking takes no time the segment before it is the last.
        if let Some(last) = self.segments.last_mut() {
            last.s_end = end;
        }
    }

    /// Changes speed to `v_end` over whatever distance that takes.
    fn ramp(&mut self, v_end: f64, limits: &Limits) {
        let rate = if v_end > self.v { limits.acc } else { limits.dec };
        let length = (v_end - self.v).abs() / rate * (0.5 * (v_end + self.v));
        self.ramp_to(v_end, rate, self.s + length);
    }

    /// Changes speed to `v_end` at `rate`; the planner knows that this ends at `s_end`.
    fn ramp_to(&mut self, v_end: f64, rate: f64, s_end: f64) {
        let seconds = (v_end - self.v).abs() / rate;
        let accel = if v_end > self.v { rate } else { -rate };
        self.push(seconds, s_end, v_end, accel);
    }

    fn cruise_to(&mut self, s_end: f64) {
        self.push((s_end - self.s) / self.v, s_end, self.v, 0.0);
    }

    fn cruise_for_ever(&mut self) {
        self.push(f64::INFINITY, f64::INFINITY, self.v, 0.0);
    }

    /// Appends a segment, unless it takes no time.
    fn push(&mut self, seconds: f64, s_end: f64, v_end: f64, accel: f64) {
        if seconds <= 0.0 {
            return;
        }
        let end = self.t + seconds;
        let s_end = s_end.max(self.s);
        let segment = Segment {
            start_s: self.t,
            end_s: end,
            start_ns: num::nanos(self.t),
            end_ns: num::nanos(end),
            s_start: self.s,
            s_end,
            v_start: self.v,
            v_end,
            accel,
        };
        // There is always room: no plan above has more than a change of speed, a cruise and braking.
        if self.segments.try_push(segment).is_ok() {
            (self.t, self.s, self.v) = (end, s_end, v_end);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Phase;
    use core::time::Duration;

    const LIMITS: Limits =
        Limits { start: 0.0, stop: 0.0, max: 1e6, acc: 700.0, dec: 300.0, zero_wait: Duration::ZERO };

    #[test]
    fn a_move_that_just_reaches_the_stop_speed_ends_exactly() {
        for n in 1..2000 {
            let reached = libm::sqrt(2.0 * LIMITS.acc * num::distance(n));
            for stop in [reached.next_down(), reached, reached.next_up()] {
                let profile = Profile::distance(0.0, 0.0, n, &Limits { stop, ..LIMITS }).unwrap();
                assert_eq!(profile.end_position(), num::distance(n));
            }
        }
    }

    #[test]
    fn a_move_too_short_for_the_start_speed_does_nothing_but_brake() {
        for n in 1..2000 {
            let profile = Profile::distance(0.0, 0.0, n, &Limits { start: 1e5, ..LIMITS }).unwrap();
            assert_eq!((profile.segments().len(), profile.phase(0)), (1, Phase::Decelerating));
            assert_eq!(profile.end_position(), num::distance(n));
        }
    }

    #[test]
    fn above_the_top_speed_a_move_brakes_to_it_first() {
        let limits = Limits { max: 600.0, dec: 500.0, ..LIMITS };
        let profile = Profile::distance(0.0, 1000.0, 1600, &limits).unwrap();
        let phases: ArrayVec<Phase, MAX_SEGMENTS> = profile.segments().iter().map(Segment::phase).collect();
        assert_eq!(phases[..], [Phase::Decelerating, Phase::Constant, Phase::Decelerating]);
        // 640 counts down to 600 in 0.8 s, 600 in 1 s, 360 to the standstill in 1.2 s.
        assert_eq!(profile.duration_s(), Some(3.0));
        assert_eq!(Profile::distance(0.0, 1000.0, 999, &limits), None);
    }

    #[test]
    fn standing_at_once_is_an_empty_profile() {
        let limits = Limits { stop: 50.0, ..LIMITS };
        assert!(Profile::brake(0.3, 50.0, &limits).is_empty());
        assert!(Profile::distance(0.3, 50.0, 0, &limits).is_some_and(|profile| profile.is_empty()));
        assert_eq!(Profile::distance(0.3, 60.0, 0, &limits), None);
    }
}
