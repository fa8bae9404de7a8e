//! What a motion may not exceed.

use core::time::Duration;

/// The slowest speed the planner carries, in counts per second: one count in about a quarter of an hour. A slower
/// run is a standstill.
pub const SLOWEST: f64 = 1e-3;
/// The fastest speed the planner carries, in counts per second: one count every nanosecond of the clock.
pub const FASTEST: f64 = 1e9;
/// The steepest acceleration the planner carries, in counts per second squared; stands for "infinite", because with it
/// every change of speed takes at most a microsecond.
pub const STEEPEST: f64 = 1e15;
/// The gentlest acceleration the planner carries, in counts per second squared.
const GENTLEST: f64 = 1e-3;

/// Speeds in counts per second, accelerations in counts per second squared.
///
/// Any numbers may be put in; [`Limits::sane`] says which are used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The speed to which a motion from a standstill jumps (`MIN_SPEED`, `VSTART`): 0 up to `max`.
    pub start: f64,
    /// The speed from which braking ends in a standstill (`MIN_SPEED`, `VSTOP`): 0 up to `max`.
    pub stop: f64,
    /// The speed that is never exceeded by what is planned from here on: [`SLOWEST`] to [`FASTEST`].
    pub max: f64,
    /// The acceleration: above 0, to [`STEEPEST`].
    pub acc: f64,
    /// The deceleration, as a positive number: above 0, to [`STEEPEST`].
    pub dec: f64,
    /// The standstill that must pass before a start in the other direction (`TZW`); zero where there is no such rule.
    pub zero_wait: Duration,
}

impl Limits {
    /// These limits with every number in its range: `max` and the accelerations are clamped into theirs, `start` and
    /// `stop` into `0..=max` (where they disagree, `max` wins); what is not a number becomes the lower end of its range.
    /// Every planner applies this first; applying it twice changes nothing.
    #[must_use]
    pub fn sane(&self) -> Limits {
        let max = clamp(self.max, SLOWEST, FASTEST);
        Limits {
            start: clamp(self.start, 0.0, max),
            stop: clamp(self.stop, 0.0, max),
            max,
            acc: clamp(self.acc, GENTLEST, STEEPEST),
            dec: clamp(self.dec, GENTLEST, STEEPEST),
            zero_wait: self.zero_wait,
        }
    }

    /// The speed at which a run asked for at `speed` cruises: at least `start`, at most `max`, and 0 when that leaves
    /// less than [`SLOWEST`].
    pub fn run_speed(&self, speed: f64) -> f64 {
        let sane = self.sane();
        let speed = clamp(speed, sane.start, sane.max);
        if speed < SLOWEST { 0.0 } else { speed }
    }

    /// The distance in counts that braking from `speed` to a standstill takes.
    pub(crate) fn braking_distance(&self, speed: f64) -> f64 {
        ((speed * speed - self.stop * self.stop) / (2.0 * self.dec)).max(0.0)
    }
}

/// `value` within `low..=high`; `low` when it is not a number.
pub(crate) fn clamp(value: f64, low: f64, high: f64) -> f64 {
    // f64::max returns the other operand when one is not a number.
    value.max(low).min(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WILD: Limits = Limits {
        start: f64::NAN,
        stop: 700.0,
        max: 500.0,
        acc: f64::INFINITY,
        dec: -3.0,
        zero_wait: Duration::ZERO,
    };

    #[test]
    fn limits_that_contradict_each_other_are_settled_in_favour_of_max() {
        let sane = WILD.sane();
        assert_eq!((sane.start, sane.stop, sane.max), (0.0, 500.0, 500.0));
        assert_eq!((sane.acc, sane.dec), (STEEPEST, GENTLEST));
        assert_eq!(sane.sane(), sane);
    }

    #[test]
    fn a_run_speed_lies_between_start_and_max_or_is_zero() {
        let limits =
            Limits { start: 5.0, stop: 5.0, max: 500.0, acc: 1.0, dec: 1.0, zero_wait: Duration::ZERO };
        assert_eq!(limits.run_speed(0.0), 5.0);
        assert_eq!(limits.run_speed(70.0), 70.0);
        assert_eq!(limits.run_speed(f64::INFINITY), 500.0);
        assert_eq!(Limits { start: 0.0, ..limits }.run_speed(f64::NAN), 0.0);
    }
}
