//! A second reference: the same moves in small ticks, the way a simple controller would make them.
#![allow(clippy::float_cmp, reason = "these figures are exact")]

use core::time::Duration;
use stepdrive_motion::{Limits, Profile};

/// Seconds in a tick.
const TICK: f64 = 1e-5;

/// Where a generator that decides anew in every tick stands, tick by tick, until it has arrived.
fn integrate(n: f64, mut v: f64, limits: &Limits) -> Vec<f64> {
    let mut s = 0.0;
    let mut track = vec![s];
    v = if v > 0.0 { v } else { limits.start };
    while s < n && track.len() < 10_000_000 {
        let braking = (v * v - limits.stop * limits.stop) / (2.0 * limits.dec);
        let before = v;
        if n - s <= braking || v > limits.max {
            v = (v - limits.dec * TICK).max(limits.stop.max(limits.dec * TICK));
        } else {
            v = (v + limits.acc * TICK).min(limits.max);
        }
        s += f64::midpoint(before, v) * TICK;
        track.push(s.min(n));
    }
    track
}

#[test]
fn planned_moves_run_along_their_integrated_tracks() {
    let limits =
        |start, stop, max, acc, dec| Limits { start, stop, max, acc, dec, zero_wait: Duration::ZERO };
    let cases = [
        // v0, counts, limits
        (0.0, 3500, limits(0.0, 0.0, 1000.0, 1000.0, 500.0)),
        (0.0, 700, limits(0.0, 0.0, 1000.0, 1000.0, 500.0)),
        (0.0, 9000, limits(300.0, 300.0, 8000.0, 20_000.0, 50_000.0)),
        (0.0, 40, limits(10.0, 90.0, 8000.0, 2000.0, 500.0)),
        (0.0, 3, limits(0.0, 900.0, 8000.0, 2000.0, 500.0)),
        (4000.0, 9000, limits(50.0, 20.0, 1500.0, 20_000.0, 5000.0)),
        (700.0, 1000, limits(0.0, 0.0, 1500.0, 3000.0, 900.0)),
    ];
    for (v0, n, limits) in cases {
        let profile = Profile::distance(0.0, v0, n, &limits).unwrap();
        let track = integrate(n as f64, v0, &limits);
        // Braking may begin, and the last count come, a few ticks late.
        let slack = 5.0 * TICK * limits.max.max(v0);
        for (tick, s) in track.iter().enumerate() {
            let planned = profile.position(tick as u64 * 10_000);
            assert!(
                (planned - s).abs() <= slack,
                "{planned} planned, {s} integrated, tick {tick} of {n} from {v0}"
            );
        }
    }
}
