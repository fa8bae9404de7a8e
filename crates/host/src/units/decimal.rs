//! Decimal numbers as people write them, kept exactly.

use std::fmt;

/// Parts of one.
const PARTS: i64 = 1_000_000_000;
/// Decimals of a number.
const DECIMALS: usize = 9;

/// A decimal number with up to 9 decimals, from -9 223 372 036 to 9 223 372 036, kept exactly.
///
/// It displays with as few decimals as it has, and what is displayed is read as the same number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Decimal(i64);

/// Why a text is no [`Decimal`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotDecimal {
    /// It is no decimal number at all.
    #[error("it is no decimal number, as in 12.5")]
    NoNumber,
    /// It has more decimals than are kept.
    #[error("it has more than {DECIMALS} decimals")]
    TooFine,
    /// It is greater than any that is kept.
    #[error("it is not within ±9223372036")]
    TooLarge,
}

impl Decimal {
    /// 0.
    pub const ZERO: Decimal = Decimal(0);

    /// A whole number.
    pub const fn whole(number: i32) -> Decimal {
        Decimal(number as i64 * PARTS)
    }

    /// Reads digits with or without sign and point; no exponent, no white space.
    ///
    /// # Errors
    /// What is wrong with the text. Nothing is rounded: zeros apart, there are at most 9 decimals.
    pub fn parse(text: &str) -> Result<Decimal, NotDecimal> {
        let (negative, unsigned) = match text.strip_prefix('-') {
            Some(rest) => (true, rest),
            None => (false, text.strip_prefix('+').unwrap_or(text)),
        };
        let (whole, decimals) = unsigned.split_once('.').unwrap_or((unsigned, ""));
        let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
        if !digits(whole) || !digits(decimals) || whole.is_empty() && decimals.is_empty() {
            return Err(NotDecimal::NoNumber);
        }
        let decimals = decimals.trim_end_matches('0');
        if decimals.len() > DECIMALS {
            return Err(NotDecimal::TooFine);
        }
        let parts = magnitude(whole, decimals).ok_or(NotDecimal::TooLarge)?;
        Ok(Decimal(if negative { -parts } else { parts }))
    }

    /// The decimal number nearest to `value`; `None` when that is none that is kept.
    pub fn from_f64(value: f64) -> Option<Decimal> {
        // Shortest digits that are read as the same number, so that 0.1 is a tenth and not what the machine makes of it.
        let shortest = format!("{value}");
        match Decimal::parse(&shortest) {
            Ok(decimal) => Some(decimal),
            Err(NotDecimal::TooFine) => Decimal::parse(&format!("{value:.DECIMALS$}")).ok(),
            Err(NotDecimal::NoNumber | NotDecimal::TooLarge) => None,
        }
    }

    /// The number, as near as a double comes to it.
    pub fn as_f64(self) -> f64 {
        self.0 as f64 / PARTS as f64
    }

    /// The number in billionths.
    pub const fn billionths(self) -> i64 {
        self.0
    }

    /// The number of so many billionths; `None` when it is out of range.
    pub fn from_billionths(parts: i128) -> Option<Decimal> {
        i64::try_from(parts).ok().filter(|parts| *parts != i64::MIN).map(Decimal)
    }
}

/// The billionths of an unsigned number; `None` when there are too many.
fn magnitude(whole: &str, decimals: &str) -> Option<i64> {
    let number = |digits: &str| {
        digits.bytes().try_fold(0_i64, |number, digit| {
            number.checked_mul(10)?.checked_add(i64::from(digit.saturating_sub(b'0')))
        })
    };
    let fraction = number(&format!("{decimals:0<DECIMALS$}"))?;
    number(whole)?.checked_mul(PARTS)?.checked_add(fraction)
}

impl From<i32> for Decimal {
    fn from(number: i32) -> Decimal {
        Decimal::whole(number)
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let parts = self.0.unsigned_abs();
        let (whole, fraction) = (parts / PARTS.unsigned_abs(), parts % PARTS.unsigned_abs());
        if fraction == 0 {
            return f.pad(&format!("{sign}{whole}"));
        }
        let decimals = format!("{fraction:0DECIMALS$}");
        f.pad(&format!("{sign}{whole}.{}", decimals.trim_end_matches('0')))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_number_is_read_as_it_is_written() {
        for (text, billionths) in [
            ("0", 0),
            ("12.5", 12_500_000_000),
            ("-0.1", -100_000_000),
            ("+3", 3_000_000_000),
            (".5", 500_000_000),
            ("5.", 5_000_000_000),
            ("-0", 0),
            ("1.0000000000000", 1_000_000_000),
            ("0.000000001", 1),
            ("9223372036", 9_223_372_036_000_000_000),
        ] {
            assert_eq!(Decimal::parse(text).map(Decimal::billionths), Ok(billionths), "{text}");
        }
    }

    #[test]
    fn what_is_no_decimal_number_is_refused_with_the_reason() {
        for text in ["", "-", ".", "+.", "1e3", "1,5", " 1", "1 ", "--1", "0x10", "NaN", "1.2.3", "٣"] {
            assert_eq!(Decimal::parse(text), Err(NotDecimal::NoNumber), "{text:?}");
        }
        assert_eq!(Decimal::parse("0.0000000001"), Err(NotDecimal::TooFine));
        assert_eq!(Decimal::parse("9223372037"), Err(NotDecimal::TooLarge));
        assert_eq!(Decimal::parse(&"9".repeat(400)), Err(NotDecimal::TooLarge));
    }

    #[test]
    fn a_double_becomes_the_number_that_a_person_would_have_written() {
        assert_eq!(Decimal::from_f64(0.1), Decimal::parse("0.1").ok());
        assert_eq!(Decimal::from_f64(1.0 / 3.0), Decimal::parse("0.333333333").ok());
        assert_eq!(Decimal::from_f64(-1e-12), Some(Decimal::ZERO));
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e10, -1e300] {
            assert_eq!(Decimal::from_f64(value), None, "{value}");
        }
    }

    proptest! {
        #[test]
        fn what_is_displayed_is_read_as_the_same_number(parts in -i64::MAX..=i64::MAX) {
            let decimal = Decimal(parts);
            prop_assert_eq!(Decimal::parse(&decimal.to_string()), Ok(decimal));
        }

        #[test]
        fn no_text_panics(text in "\\PC*") {
            let _ = Decimal::parse(&text);
        }
    }
}
