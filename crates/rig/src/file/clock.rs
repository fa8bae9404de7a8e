//! How rig time passes.

use crate::names::shown;
use alloc::string::String;
use core::fmt;
use core::ops::RangeInclusive;

/// The factors by which rig time may pass faster or slower.
const FACTORS: RangeInclusive<f64> = 0.01..=1_000_000.0;

/// How rig time passes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ClockMode {
    /// As fast as time does: `real`.
    #[default]
    Real,
    /// So many times as fast, 0.01 to 1 000 000: `x100`, `x0.5`.
    Factor(f64),
    /// Not at all: `paused`.
    Paused,
}

/// Why a text is no way for time to pass.
#[derive(Clone, Debug, PartialEq)]
pub enum ClockModeError {
    /// It is none of the three.
    Unknown(String),
    /// The factor is out of range.
    Factor(f64),
}

impl ClockMode {
    /// The mode that is written so, as in rig files and commands.
    ///
    /// # Errors
    /// It is none, or its factor is out of range.
    pub fn parse(text: &str) -> Result<ClockMode, ClockModeError> {
        match text {
            "real" => Ok(ClockMode::Real),
            "paused" => Ok(ClockMode::Paused),
            _ => {
                let factor = factor(text).ok_or_else(|| ClockModeError::Unknown(shown(text)))?;
                let mode = FACTORS.contains(&factor).then_some(ClockMode::Factor(factor));
                mode.ok_or(ClockModeError::Factor(factor))
            }
        }
    }
}

/// The number in `x100`: digits, with or without decimals.
fn factor(text: &str) -> Option<f64> {
    let digits = text.strip_prefix('x')?;
    let plain = digits.starts_with(|c: char| c.is_ascii_digit())
        && digits.ends_with(|c: char| c.is_ascii_digit())
        && digits.chars().all(|c| c.is_ascii_digit() || c == '.');
    plain.then(|| digits.parse().ok()).flatten()
}

impl fmt::Display for ClockMode {
    /// As it is written.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClockMode::Real => f.write_str("real"),
            ClockMode::Factor(factor) => write!(f, "x{factor}"),
            ClockMode::Paused => f.write_str("paused"),
        }
    }
}

impl fmt::Display for ClockModeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClockModeError::Unknown(text) => {
                write!(f, "clock `{text}` is unknown; it is real, paused, or x and a factor, as in x100")
            }
            ClockModeError::Factor(factor) => {
                write!(f, "the clock's factor is {factor}; it is {} to {}", FACTORS.start(), FACTORS.end())
            }
        }
    }
}

impl core::error::Error for ClockModeError {}
