//! Inputs in the ranges of the real controllers, and the textbook to compare with.
#![allow(dead_code, unreachable_pub, reason = "each test program uses its own part of this file")]

use core::time::Duration;
use proptest::prelude::*;
use stepdrive_motion::Limits;

/// A second in nanoseconds.
pub const SECOND: u64 = 1_000_000_000;

/// `cases` cases, and no files left behind.
pub fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

/// The registers of an SMSD controller, in whole steps, times a microstep of 1 to 128. Start and stop are the same speed
/// in half of the cases, as on that controller, and apart in the others, as on an SMD3.
pub fn limits() -> impl Strategy<Value = Limits> {
    let speeds = (prop_oneof![Just(0_u32), 0..=950_u32], prop::option::of(0..=950_u32), 16..=15_600_u32);
    (speeds, 15..=59_000_u32, 15..=59_000_u32, 0..=7_u32).prop_map(|((start, stop, max), acc, dec, micro)| {
        let scaled = |value: u32| f64::from(value) * f64::from(1_u32 << micro);
        Limits {
            start: scaled(start),
            stop: scaled(stop.unwrap_or(start)),
            max: scaled(max),
            acc: scaled(acc),
            dec: scaled(dec),
            zero_wait: Duration::ZERO,
        }
        .sane()
    })
}

/// A distance in counts, of every order of magnitude up to the 22 bits of the controller.
pub fn distance() -> impl Strategy<Value = u64> {
    prop_oneof![1..=20_u64, 1..=5_000_u64, 1..=4_194_303_u64]
}

/// The `share` of a whole number.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the share is not negative")]
pub fn part_of(whole: u64, share: f64) -> u64 {
    (whole as f64 * share) as u64
}

/// The time a move over `length` takes from the speed `v0` (a standstill when 0), found the plain way: the peak speed is
/// searched for by halving until the ramps fill the distance.
pub fn textbook_seconds(length: f64, v0: f64, limits: &Limits) -> f64 {
    let v0 = if v0 > 0.0 { v0 } else { textbook_launch(length, limits) };
    let ramp = |from: f64, to: f64, rate: f64| {
        let seconds = (to - from).abs() / rate;
        (seconds, seconds * (from + to) / 2.0)
    };
    let reached = (v0 * v0 + 2.0 * limits.acc * length).sqrt();
    if reached <= limits.stop {
        return 2.0 * length / (v0 + reached);
    }
    if v0 > limits.max {
        let (down, first) = ramp(v0, limits.max, limits.dec);
        let (stop, last) = ramp(limits.max, limits.stop, limits.dec);
        return down + (length - first - last).max(0.0) / limits.max + stop;
    }
    let both = |peak: f64| (ramp(v0, peak, limits.acc), ramp(peak, limits.stop, limits.dec));
    let fits = |peak: f64| {
        let (up, down) = both(peak);
        up.1 + down.1 <= length
    };
    let peak = if fits(limits.max) { limits.max } else { halve(v0.max(limits.stop), limits.max, fits) };
    let (up, down) = both(peak);
    up.0 + (length - up.1 - down.1).max(0.0) / peak + down.0
}

/// The speed a standstill is left with: `start`, or less where braking from it would not fit.
fn textbook_launch(length: f64, limits: &Limits) -> f64 {
    let fits = |v: f64| (v - limits.stop) / limits.dec * (v + limits.stop) / 2.0 <= length;
    if fits(limits.start) { limits.start } else { halve(limits.stop, limits.start, fits) }
}

/// The largest number between `low`, which fits, and `high`, which does not, that still fits.
fn halve(mut low: f64, mut high: f64, fits: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..200 {
        let middle = f64::midpoint(low, high);
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
