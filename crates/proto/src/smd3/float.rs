//! Real numbers as the drive prints them (manual, *Argument types*, FLOAT).

use super::buffer::LineBuf;
use core::fmt::Write;

/// Digits before and behind the point.
const DIGITS: i32 = 6;
/// The number above the greatest of so many digits.
const ABOVE: u64 = 1_000_000;

/// The exponent of the first of [`POWERS`].
const FIRST_POWER: i32 = -7;
/// Powers of ten, or the doubles nearest to them: the numbers from the first up to the last take the short way.
const POWERS: [f64; 23] = [
    1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11,
    1e12, 1e13, 1e14, 1e15,
];

/// Appends a number exactly as `printf("%.5E")` does in C, rounding what lies half-way to the even digit; but a negative
/// zero has no sign.
pub(super) fn put(out: &mut LineBuf, value: f64) {
    if value == 0.0 {
        return out.put(b"0.00000E+00");
    }
    if value.is_sign_negative() {
        out.put(b"-");
    }
    let magnitude = value.abs();
    if magnitude.is_nan() {
        out.put(b"NAN");
    } else if magnitude.is_infinite() {
        out.put(b"INF");
    } else if let Some((digits, exponent)) = decimal(magnitude) {
        put_mantissa(out, digits);
        put_exponent(out, exponent);
    } else {
        put_the_long_way(out, magnitude);
    }
}

/// The number in decimal, as its first six digits, rounded, and the exponent of the first of them. Exact, and several
/// times as fast as `core::fmt`, but only for the numbers between the ends of [`POWERS`].
fn decimal(magnitude: f64) -> Option<(u64, i32)> {
    let reached = POWERS.partition_point(|power| *power <= magnitude);
    if reached == 0 || reached == POWERS.len() {
        return None;
    }
    let exponent = i32::try_from(reached).ok()?.checked_add(FIRST_POWER)?.checked_sub(1)?;
    let digits = scaled(magnitude, DIGITS.checked_sub(1)?.checked_sub(exponent)?)?;
    // Rounded up to the next power of ten, as in 9.999999 to 10.0000.
    if digits == ABOVE { Some((ABOVE / 10, exponent.checked_add(1)?)) } else { Some((digits, exponent)) }
}

/// `magnitude` times 10^`power`, rounded to a whole number, of two as near to the even one.
fn scaled(magnitude: f64, power: i32) -> Option<u64> {
    // Normal and below 2^52, so it is `mantissa` / 2^`halvings`.
    let bits = magnitude.to_bits();
    let mantissa = bits & 0x000F_FFFF_FFFF_FFFF | 0x0010_0000_0000_0000;
    let halvings = u32::try_from(1075_u64.checked_sub(bits >> 52)?).ok()?;
    let ten = 10_u64.checked_pow(power.unsigned_abs())?;
    if power < 0 {
        let divisor = ten.checked_mul(1_u64.checked_shl(halvings)?)?;
        let (whole, rest) = (mantissa.checked_div(divisor)?, mantissa.checked_rem(divisor)?);
        return round(whole, rest.cmp(&divisor.checked_sub(rest)?));
    }
    let product = u128::from(mantissa).checked_mul(ten.into())?;
    let whole = u64::try_from(product.checked_shr(halvings)?).ok()?;
    let half = 1_u128.checked_shl(halvings.checked_sub(1)?)?;
    let rest = product & (half | half.checked_sub(1)?);
    round(whole, rest.cmp(&half))
}

/// The whole number that a number is rounded to, given how what is behind the point compares to a half.
fn round(whole: u64, rest: core::cmp::Ordering) -> Option<u64> {
    let up = rest.is_gt() || rest.is_eq() && whole & 1 == 1;
    whole.checked_add(up.into())
}

/// Any number but 0, by way of `core::fmt`, which is exact and rounds as C does; only its exponents are bare.
fn put_the_long_way(out: &mut LineBuf, magnitude: f64) {
    let mut bare = Bare { text: [0; 16], len: 0 };
    // Its longest, as 1.23456E-308, has 12 characters.
    let _ = write!(bare, "{magnitude:.5E}");
    let mut parts = bare.text.get(..bare.len).unwrap_or_default().split(|byte| *byte == b'E');
    out.put(parts.next().unwrap_or_default());
    let exponent = parts.next().and_then(|text| core::str::from_utf8(text).ok()?.parse().ok());
    put_exponent(out, exponent.unwrap_or(0));
}

/// A few characters.
struct Bare {
    text: [u8; 16],
    len: usize,
}

impl Write for Bare {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let end = self.len.saturating_add(text.len());
        self.text.get_mut(self.len..end).ok_or(core::fmt::Error)?.copy_from_slice(text.as_bytes());
        self.len = end;
        Ok(())
    }
}

/// Appends six digits as `1.23456`.
fn put_mantissa(out: &mut LineBuf, digits: u64) {
    let [first, rest @ ..]: [u8; 6] = decimal_digits(digits);
    out.put(&[first, b'.']);
    out.put(&rest);
}

/// Appends an exponent as `E+04`, with a third digit where it takes one.
fn put_exponent(out: &mut LineBuf, exponent: i32) {
    out.put(if exponent < 0 { b"E-" } else { b"E+" });
    let [hundreds, rest @ ..]: [u8; 3] = decimal_digits(exponent.unsigned_abs().into());
    if hundreds != b'0' {
        out.put(&[hundreds]);
    }
    out.put(&rest);
}

/// The last `N` digits of a number.
fn decimal_digits<const N: usize>(mut number: u64) -> [u8; N] {
    let mut digits = [b'0'; N];
    for digit in digits.iter_mut().rev() {
        let [low, ..] = (number % 10).to_le_bytes();
        *digit |= low;
        number /= 10;
    }
    digits
}
