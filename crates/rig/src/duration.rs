//! Durations as people write them: `5ms`, `1.5us`, `0.5 s`, `8h`.
//!
//! Exact to the nanosecond: decimal digits are counted, never rounded.

use crate::names::shown;
use alloc::string::String;
use core::fmt;
use core::time::Duration;

/// A unit and its nanoseconds, the shortest first.
const UNITS: [(&str, u64); 6] = [
    ("ns", 1),
    ("us", 1_000),
    ("ms", 1_000_000),
    ("s", 1_000_000_000),
    ("min", 60_000_000_000),
    ("h", 3_600_000_000_000),
];

/// No more decimals than this can be whole nanoseconds: an hour has 2^13 · 3^2 · 5^11 of them.
const MOST_DECIMALS: usize = 13;

/// Why a text is no duration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DurationError {
    /// It does not begin with a decimal number.
    NoNumber,
    /// It is less than nothing.
    Negative,
    /// The number has no unit.
    NoUnit,
    /// There is no such unit.
    UnknownUnit(String),
    /// It is no whole number of nanoseconds.
    TooFine,
    /// It is longer than the rig's clock runs.
    TooLong,
}

/// Reads a duration: a decimal number and a unit, `ns`, `us`, `ms`, `s`, `min` or `h`, with or without a space between.
///
/// # Errors
/// What is wrong with it. Nothing is rounded: less than a nanosecond, or more than 2^64 of them, is refused.
pub fn parse(text: &str) -> Result<Duration, DurationError> {
    let text = text.trim();
    if text.starts_with('-') {
        return Err(DurationError::Negative);
    }
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let (whole, decimals) = number.split_once('.').unwrap_or((number, "0"));
    if whole.is_empty() || decimals.is_empty() || decimals.contains('.') {
        return Err(DurationError::NoNumber);
    }
    let unit = unit_nanos(unit.trim_start())?;
    let nanos = whole_nanos(whole, unit)?.checked_add(decimal_nanos(decimals, unit)?);
    nanos.map(Duration::from_nanos).ok_or(DurationError::TooLong)
}

fn unit_nanos(unit: &str) -> Result<u64, DurationError> {
    if unit.is_empty() {
        return Err(DurationError::NoUnit);
    }
    let found = UNITS.into_iter().find(|(name, _)| *name == unit);
    found.map(|(_, nanos)| nanos).ok_or_else(|| DurationError::UnknownUnit(shown(unit)))
}

fn unit_names() -> String {
    UNITS.map(|(name, _)| name).join(", ")
}

fn whole_nanos(digits: &str, unit: u64) -> Result<u64, DurationError> {
    let number = digits.parse::<u64>().ok().and_then(|number| number.checked_mul(unit));
    number.ok_or(DurationError::TooLong)
}

fn decimal_nanos(digits: &str, unit: u64) -> Result<u64, DurationError> {
    let digits = digits.trim_end_matches('0');
    if digits.len() > MOST_DECIMALS {
        return Err(DurationError::TooFine);
    }
    // 13 decimals of an hour take 85 bits.
    let parts = digits.bytes().fold(0, |parts, digit| parts * 10 + u128::from(digit - b'0'));
    let scale = digits.bytes().fold(1, |scale, _| scale * 10);
    let nanos = parts * u128::from(unit);
    let whole = nanos.is_multiple_of(scale).then_some(nanos / scale);
    whole.and_then(|nanos| u64::try_from(nanos).ok()).ok_or(DurationError::TooFine)
}

impl fmt::Display for DurationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DurationError::NoNumber => f.write_str("a duration is a number and a unit, as in 5ms or 1.5s"),
            DurationError::Negative => f.write_str("a duration is not negative"),
            DurationError::NoUnit => write!(f, "the unit is missing; it is one of {}", unit_names()),
            DurationError::UnknownUnit(unit) => {
                write!(f, "the unit `{unit}` is unknown; it is one of {}", unit_names())
            }
            DurationError::TooFine => f.write_str("a duration is a whole number of nanoseconds"),
            DurationError::TooLong => f.write_str("a duration is at most 584 years"),
        }
    }
}

impl core::error::Error for DurationError {}

/// A duration as it is written, for as long as the rig's clock runs: [`parse`] reads it back as it was.
///
/// In the largest of `h` and `min` that it is a whole number of, else with decimals in the largest of `s`, `ms`, `us`
/// and `ns` that is no longer than it: `90min`, `1.5s`, `250ns`.
pub fn display(duration: Duration) -> impl fmt::Display {
    Written(duration)
}

struct Written(Duration);

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let nanos = self.0.as_nanos();
        let (name, unit) = unit_for(nanos);
        write!(f, "{}", nanos / unit)?;
        let mut rest = nanos % unit;
        if rest != 0 {
            f.write_str(".")?;
        }
        while rest != 0 {
            rest *= 10;
            write!(f, "{}", rest / unit)?;
            rest %= unit;
        }
        f.write_str(name)
    }
}

/// The unit in which a duration is shown, and its nanoseconds.
fn unit_for(nanos: u128) -> (&'static str, u128) {
    let fits = |name: &str, unit: u128| match name {
        "h" | "min" => nanos.is_multiple_of(unit),
        _ => true,
    };
    let units = UNITS.into_iter().rev().map(|(name, unit)| (name, u128::from(unit)));
    let mut fitting = units.filter(|(name, unit)| nanos >= *unit && fits(name, *unit));
    fitting.next().unwrap_or(("s", 1_000_000_000))
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::format;
    use std::string::ToString;

    fn nanos(text: &str) -> u64 {
        let duration = parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        u64::try_from(duration.as_nanos()).expect("within the rig's clock")
    }

    fn refusal(text: &str) -> String {
        parse(text).expect_err(text).to_string()
    }

    #[test]
    fn every_unit_is_read() {
        assert_eq!(nanos("250ns"), 250);
        assert_eq!(nanos("1.5us"), 1_500);
        assert_eq!(nanos("5ms"), 5_000_000);
        assert_eq!(nanos("2s"), 2_000_000_000);
        assert_eq!(nanos("3min"), 180_000_000_000);
        assert_eq!(nanos("8h"), 28_800_000_000_000);
    }

    #[test]
    fn spaces_and_zeros_do_not_matter() {
        assert_eq!(nanos(" 0.5 s "), 500_000_000);
        assert_eq!(nanos("0.50000000000000000000000s"), 500_000_000);
        assert_eq!(nanos("000000000000000000000007ns"), 7);
        assert_eq!(nanos("0s"), 0);
    }

    #[test]
    fn nothing_is_rounded() {
        assert_eq!(nanos("0.000000001s"), 1);
        assert_eq!(nanos("9007199254.740993s"), 9_007_199_254_740_993_000);
        assert_eq!(nanos("0.0000000000025h"), 9);
        assert_eq!(nanos("18446744073.709551615s"), u64::MAX);
        for text in ["0.5ns", "0.0000000001s", "0.00000000000001h", "0.3333333333333h"] {
            assert_eq!(refusal(text), "a duration is a whole number of nanoseconds", "{text}");
        }
    }

    #[test]
    fn what_is_longer_than_the_clock_runs_is_refused() {
        for text in ["18446744073.709551616s", "18446744073709551616ns", "99999999999999999999999h"] {
            assert_eq!(refusal(text), "a duration is at most 584 years", "{text}");
        }
    }

    #[test]
    fn what_is_no_duration_is_told() {
        assert_eq!(refusal("-5ms"), "a duration is not negative");
        assert_eq!(refusal("5"), "the unit is missing; it is one of ns, us, ms, s, min, h");
        assert_eq!(refusal("5 parsec"), "the unit `parsec` is unknown; it is one of ns, us, ms, s, min, h");
        for text in ["", "ms", ".5s", "5.s", "1.2.3s", "..s", "+5s", "five ms"] {
            assert_eq!(refusal(text), "a duration is a number and a unit, as in 5ms or 1.5s", "{text}");
        }
    }

    #[test]
    fn a_duration_is_shown_in_the_unit_that_suits_it() {
        for text in ["0s", "250ns", "1.5us", "5ms", "500ms", "1.5s", "61s", "1min", "90min", "8h", "1000h"] {
            assert_eq!(display(parse(text).expect(text)).to_string(), text);
        }
        for (text, shown) in [("60s", "1min"), ("1500ms", "1.5s"), ("1.5h", "90min"), ("0.25us", "250ns")] {
            assert_eq!(display(parse(text).expect(text)).to_string(), shown);
        }
        assert_eq!(display(Duration::MAX).to_string(), "18446744073709551615.999999999s");
    }

    proptest! {
        #[test]
        fn what_is_shown_is_read_back(nanos: u64, zeros in 0_u32..20) {
            let duration = Duration::from_nanos(nanos / 10_u64.pow(zeros) * 10_u64.pow(zeros));
            prop_assert_eq!(parse(&display(duration).to_string()), Ok(duration));
        }

        #[test]
        fn no_text_panics(text: String, digits in "[-0-9.]{0,40}", unit in "[a-z ]{0,4}") {
            let _ = parse(&text);
            let _ = parse(&format!("{digits}{unit}"));
        }
    }
}
