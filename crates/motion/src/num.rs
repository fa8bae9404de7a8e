//! The one place where numbers change their type, and the search that makes an estimated instant exact.

/// Nanoseconds in a second.
const NANOS: f64 = 1e9;
/// A time within this share of itself of a whole nanosecond is that nanosecond: it differs only by rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Nanoseconds as seconds. Exact to the last bit of `f64`; monotone.
#[expect(
    clippy::as_conversions,
    reason = "beyond 104 days the nearest f64 is a few nanoseconds off, and monotone"
)]
pub(crate) fn seconds(ns: u64) -> f64 {
    ns as f64 / NANOS
}

/// The smallest whole number of nanoseconds at or after `seconds`; 0 for a negative time, the largest number for one
/// that does not fit.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the conversion saturates, which is what is wanted at both ends"
)]
pub(crate) fn nanos(seconds: f64) -> u64 {
    let exact = seconds * NANOS;
    let below = exact as u64;
    if exact - below as f64 <= exact * ROUNDING { below } else { below.saturating_add(1) }
}

/// The whole counts in a distance `s ≥ 0`.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "truncating is the floor of a number that is not negative, and the conversion saturates"
)]
pub(crate) fn whole(s: f64) -> i64 {
    s as i64
}

/// A number of counts as a distance; exact up to 2^53.
#[expect(clippy::as_conversions, reason = "counts are kept below 2^53, where every integer is an f64")]
pub(crate) fn distance(counts: u64) -> f64 {
    counts as f64
}

/// The smallest `n` in `low..=high` for which `holds(n)`, which must be monotone and hold at `high`.
///
/// Starts at `guess` and widens the bracket in doubling steps, so a guess that is off by `d` costs about `2·log2(d)`
/// evaluations, and never more than 128.
pub(crate) fn first(low: u64, high: u64, guess: u64, holds: impl Fn(u64) -> bool) -> u64 {
    let guess = guess.min(high).max(low);
    let (mut low, mut high) = if holds(guess) { (low, guess) } else { (guess.saturating_add(1), high) };
    let downward = high == guess;
    let mut step = 1_u64;
    while low < high {
        let probe =
            if downward { high.saturating_sub(step).max(low) } else { low.saturating_add(step).min(high) };
        match (holds(probe), downward) {
            (true, true) => high = probe,
            (false, false) => low = probe.saturating_add(1),
            (true, false) => {
                high = probe;
                break;
            }
            (false, true) => {
                low = probe.saturating_add(1);
                break;
            }
        }
        step = step.saturating_mul(2);
    }
    bisect(low, high, holds)
}

/// As [`first`], by halving alone.
fn bisect(mut low: u64, mut high: u64, holds: impl Fn(u64) -> bool) -> u64 {
    while low < high {
        let middle = low.midpoint(high);
        if holds(middle) {
            high = middle;
        } else {
            low = middle.saturating_add(1);
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_rounded_up_to_a_whole_nanosecond_unless_only_rounding_parts_it_from_one() {
        assert_eq!(nanos(0.1 + 0.2), 300_000_000);
        assert_eq!(nanos(0.3), 300_000_000);
        assert_eq!(nanos(1.2e-9), 2);
        assert_eq!(nanos(1e-20), 1);
    }

    #[test]
    fn times_out_of_range_saturate() {
        assert_eq!(nanos(-1.0), 0);
        assert_eq!(nanos(f64::INFINITY), u64::MAX);
        assert_eq!(nanos(1e300), u64::MAX);
    }

    #[test]
    fn the_search_finds_the_first_from_any_guess() {
        for answer in [0, 1, 2, 7, 99, 100] {
            for guess in 0..=120 {
                assert_eq!(first(0, 100, guess, |n| n >= answer), answer, "guess {guess}");
            }
        }
        assert_eq!(first(0, u64::MAX, 5, |n| n == u64::MAX), u64::MAX);
        assert_eq!(first(0, u64::MAX, u64::MAX, |_| true), 0);
    }
}
