//! One stretch of constant acceleration.

use crate::num;

/// What the generator is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Speed grows.
    Accelerating,
    /// Speed stays.
    Constant,
    /// Speed falls.
    Decelerating,
    /// The rotor stands.
    Stopped,
}

/// A stretch of constant acceleration within a [`crate::Profile`].
///
/// Times count from the start of the profile, distances from its origin in counts. The segment holds for the whole
/// nanoseconds `start_ns..end_ns`, which are the boundaries in seconds rounded up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Start, in seconds.
    pub start_s: f64,
    /// End, in seconds; infinite for a cruise without end.
    pub end_s: f64,
    /// First whole nanosecond of the segment.
    pub start_ns: u64,
    /// First whole nanosecond after the segment; `u64::MAX` for a cruise without end.
    pub end_ns: u64,
    /// Distance at the start, in counts.
    pub s_start: f64,
    /// Distance at the end, in counts; infinite for a cruise without end.
    pub s_end: f64,
    /// Speed at the start, in counts per second.
    pub v_start: f64,
    /// Speed at the end, in counts per second.
    pub v_end: f64,
    /// Acceleration in counts per second squared, negative when braking.
    pub accel: f64,
}

impl Segment {
    /// What the generator does during this segment; never [`Phase::Stopped`].
    pub fn phase(&self) -> Phase {
        if self.accel > 0.0 {
            Phase::Accelerating
        } else if self.accel < 0.0 {
            Phase::Decelerating
        } else {
            Phase::Constant
        }
    }

    /// The distance at `ns`, never outside `s_start..=s_end`.
    ///
    /// Reckoned from the start while accelerating and from the end while braking: then the time that enters the
    /// formula only grows, or only shrinks, and every rounding step keeps the order, so the distance never steps back,
    /// and the end is met exactly.
    pub(crate) fn position(&self, ns: u64) -> f64 {
        if self.accel < 0.0 {
            let left = self.left(ns);
            let s = self.s_end - left * (self.v_end - 0.5 * self.accel * left);
            // Rounding must not let the last count come while there is time left.
            let most = if left > 0.0 { self.s_end.next_down() } else { self.s_end };
            s.min(most).max(self.s_start)
        } else {
            let gone = self.gone(ns);
            let s = self.s_start + gone * (self.v_start + 0.5 * self.accel * gone);
            s.max(self.s_start).min(self.s_end)
        }
    }

    /// The speed at `ns`, never outside the speeds at the two ends.
    pub(crate) fn speed(&self, ns: u64) -> f64 {
        if self.accel < 0.0 {
            (self.v_end - self.accel * self.left(ns)).min(self.v_start)
        } else {
            (self.v_start + self.accel * self.gone(ns)).min(self.v_end)
        }
    }

    /// About when the distance `s` is reached, in nanoseconds.
    pub(crate) fn about_when_at(&self, s: f64) -> u64 {
        if self.accel < 0.0 {
            num::nanos(self.end_s - time_over(self.s_end - s, self.v_end, -self.accel))
        } else {
            num::nanos(self.start_s + time_over(s - self.s_start, self.v_start, self.accel))
        }
    }

    /// About when the speed `v` is passed, in nanoseconds.
    pub(crate) fn about_when_speed(&self, v: f64) -> u64 {
        num::nanos(self.start_s + (v - self.v_start) / self.accel)
    }

    /// Seconds since the start of the segment.
    fn gone(&self, ns: u64) -> f64 {
        (num::seconds(ns) - self.start_s).max(0.0)
    }

    /// Seconds to the end of the segment.
    fn left(&self, ns: u64) -> f64 {
        (self.end_s - num::seconds(ns)).max(0.0)
    }
}

/// The time in which a body that starts at speed `v` and accelerates at `a` covers `length`. In this form of the
/// quadratic formula nothing cancels, also when `a` is 0.
fn time_over(length: f64, v: f64, a: f64) -> f64 {
    2.0 * length / (v + libm::sqrt(v * v + 2.0 * a * length))
}
