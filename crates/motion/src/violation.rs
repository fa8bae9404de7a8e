//! What the checker can find wrong with a profile.

use core::fmt;

/// What is wrong with a profile. Segments are numbered from 0, quantities are in seconds, counts, counts per second and
/// counts per second squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Violation {
    /// A segment does not begin where and as fast as the one before it, or the start, left off.
    Gap {
        /// The segment.
        segment: usize,
        /// What does not fit: "time", "distance" or "speed".
        what: &'static str,
        /// The value that was expected.
        expected: f64,
        /// The value in the segment.
        found: f64,
    },
    /// A segment does not end where its acceleration takes it.
    Inconsistent {
        /// The segment.
        segment: usize,
        /// What does not fit: "distance", "speed", "duration" or "nanoseconds".
        what: &'static str,
        /// The value that was expected.
        expected: f64,
        /// The value in the segment.
        found: f64,
    },
    /// A segment accelerates or brakes harder than allowed.
    TooSteep {
        /// The segment.
        segment: usize,
        /// Its acceleration.
        accel: f64,
        /// The limit.
        limit: f64,
    },
    /// A speed lies outside what is allowed.
    Speed {
        /// The segment.
        segment: usize,
        /// The speed.
        speed: f64,
        /// The lowest that is allowed.
        low: f64,
        /// The highest that is allowed.
        high: f64,
    },
    /// The evaluated profile is not what its segments say, or steps back.
    Evaluation {
        /// Nanoseconds from the start of the profile.
        at_ns: u64,
        /// The distance that was expected.
        expected: f64,
        /// The distance it answered.
        found: f64,
    },
    /// The profile ends in the wrong place.
    WrongEnd {
        /// The distance at which it should end; infinite for a cruise.
        expected: f64,
        /// The distance at which it ends.
        found: f64,
    },
    /// The profile ends too fast for a standstill.
    EndsTurning {
        /// The last speed.
        speed: f64,
        /// The highest speed from which standing is allowed.
        limit: f64,
    },
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Violation::Gap { segment, what, expected, found } => {
                write!(f, "segment {segment} begins with {what} {found}, but {expected} came before it")
            }
            Violation::Inconsistent { segment, what, expected, found } => {
                write!(f, "segment {segment} has {what} {found}, but its acceleration gives {expected}")
            }
            Violation::TooSteep { segment, accel, limit } => {
                write!(f, "segment {segment} accelerates at {accel}, limit {limit}")
            }
            Violation::Speed { segment, speed, low, high } => {
                write!(f, "segment {segment} has speed {speed}, allowed {low} to {high}")
            }
            Violation::Evaluation { at_ns, expected, found } => {
                write!(f, "at {at_ns} ns the profile answers distance {found}, expected {expected}")
            }
            Violation::WrongEnd { expected, found } => {
                write!(f, "ends at distance {found}, expected {expected}")
            }
            Violation::EndsTurning { speed, limit } => {
                write!(f, "ends at speed {speed}, a standstill is allowed from {limit}")
            }
        }
    }
}

impl core::error::Error for Violation {}
