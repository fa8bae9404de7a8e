//! Arguments and data items of each type (manual, *Argument types*). White space around them is gone already.
//!
//! What is not well formed is [`Error::ArgumentType`]; what is, but cannot be held, is [`Error::ArgumentValidation`].

use core::str::FromStr;
use stepdrive_spec::smd3::errors::Error;

/// INT: digits, with or without sign.
pub(super) fn int(item: &[u8]) -> Result<i64, Error> {
    let (b"" | b"+" | b"-", digits) = split_sign(item) else { return Err(Error::ArgumentType) };
    if !is_digits(digits) {
        return Err(Error::ArgumentType);
    }
    parse(item)
}

/// UINT: digits without sign, or `0x` and hexadecimal ones.
pub(super) fn uint(item: &[u8]) -> Result<u64, Error> {
    let [b'0', b'x' | b'X', digits @ ..] = item else {
        return if is_digits(item) { parse(item) } else { Err(Error::ArgumentType) };
    };
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_hexdigit) {
        return Err(Error::ArgumentType);
    }
    let text = core::str::from_utf8(digits).map_err(|_| Error::ArgumentType)?;
    // Digits, so the only failure left is one too many of them.
    u64::from_str_radix(text, 16).map_err(|_| Error::ArgumentValidation)
}

/// FLOAT: digits with or without sign, point and exponent, and with a digit before or behind the point.
pub(super) fn float(item: &[u8]) -> Result<f64, Error> {
    if !is_float(item) {
        return Err(Error::ArgumentType);
    }
    let value: f64 = parse(item)?;
    if value.is_finite() { Ok(value) } else { Err(Error::ArgumentValidation) }
}

/// BOOL: `0` or `1`, and no other way to write them.
pub(super) fn boolean(item: &[u8]) -> Result<bool, Error> {
    match item {
        b"0" => Ok(false),
        b"1" => Ok(true),
        _ => match uint(item) {
            Ok(_) => Err(Error::ArgumentValidation),
            Err(error) => Err(error),
        },
    }
}

/// STRING that is a direction: `+`, `true`, or `-`.
pub(super) fn sign(item: &[u8]) -> Result<bool, Error> {
    match item {
        b"+" => Ok(true),
        b"-" => Ok(false),
        _ if is_string(item) => Err(Error::ArgumentValidation),
        _ => Err(Error::ArgumentType),
    }
}

/// Whether these are the characters 0x20 to 0x7E of a STRING, and at least one.
fn is_string(item: &[u8]) -> bool {
    !item.is_empty() && item.iter().all(|byte| matches!(byte, b' '..=b'~'))
}

fn is_digits(item: &[u8]) -> bool {
    !item.is_empty() && item.iter().all(u8::is_ascii_digit)
}

fn is_float(item: &[u8]) -> bool {
    let (_, unsigned) = split_sign(item);
    let mut parts = unsigned.splitn(2, |byte| matches!(byte, b'e' | b'E'));
    let mantissa = parts.next().unwrap_or_default();
    let exponent_fits = parts.next().is_none_or(|exponent| is_digits(split_sign(exponent).1));
    exponent_fits && is_mantissa(mantissa)
}

/// Digits with or without one point, and at least one digit.
fn is_mantissa(item: &[u8]) -> bool {
    let mut parts = item.splitn(2, |byte| *byte == b'.');
    let (whole, fraction) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    match (whole, fraction) {
        ([], digits) | (digits, []) => is_digits(digits),
        (whole, fraction) => is_digits(whole) && is_digits(fraction),
    }
}

/// The sign, empty where there is none, and what is behind it.
fn split_sign(item: &[u8]) -> (&[u8], &[u8]) {
    let len = usize::from(matches!(item, [b'+' | b'-', ..]));
    item.split_at_checked(len).unwrap_or((b"", item))
}

/// The value of a number that is known to be well formed.
fn parse<T: FromStr>(item: &[u8]) -> Result<T, Error> {
    // What is well formed is ASCII and fails only where it is too large.
    let text = core::str::from_utf8(item).map_err(|_| Error::ArgumentType)?;
    text.parse().map_err(|_| Error::ArgumentValidation)
}
