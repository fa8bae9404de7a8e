//! The two directions of a motor.

use std::fmt;

/// A direction of a motor, or of an axis as its scale has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Direction {
    /// The position grows.
    Positive,
    /// The position falls.
    Negative,
}

impl Direction {
    /// 1 or -1.
    pub const fn sign(self) -> i64 {
        match self {
            Direction::Positive => 1,
            Direction::Negative => -1,
        }
    }

    /// The other one.
    #[must_use]
    pub const fn opposite(self) -> Direction {
        match self {
            Direction::Positive => Direction::Negative,
            Direction::Negative => Direction::Positive,
        }
    }
}

impl fmt::Display for Direction {
    /// `+` or `-`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(if *self == Direction::Positive { "+" } else { "-" })
    }
}
