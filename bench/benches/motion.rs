//! Motion: planning a move, evaluating it, solving for a crossing, and living through a reversal.
#![allow(missing_docs, reason = "criterion's macros generate items without documentation")]

use core::hint::black_box;
use core::time::Duration;
use criterion::{Criterion, criterion_group, criterion_main};
use stepdrive_motion::{Axis, Direction, Limits, Profile};
use stepdrive_spec::time::Instant;

/// 1000 steps/s at 1/16, reached and left within a second.
const LIMITS: Limits =
    Limits { start: 0.0, stop: 0.0, max: 16_000.0, acc: 16_000.0, dec: 16_000.0, zero_wait: Duration::ZERO };
/// A move with a cruise of a second: three seconds in all.
const COUNTS: u64 = 32_000;

fn plan(c: &mut Criterion) {
    c.bench_function("motion/plan a move", |b| {
        b.iter(|| Profile::distance(black_box(0.0), 0.0, black_box(COUNTS), &LIMITS));
    });
}

fn evaluate(c: &mut Criterion) {
    let profile = Profile::distance(0.0, 0.0, COUNTS, &LIMITS);
    let profile = profile.expect("a move from a standstill always fits");
    c.bench_function("motion/evaluate position", |b| b.iter(|| profile.position(black_box(2_345_678_901))));
    c.bench_function("motion/solve a crossing", |b| b.iter(|| profile.when_reaches(black_box(31_000))));
}

fn reverse(c: &mut Criterion) {
    let mut running = Axis::new(0);
    running.run(Instant::ZERO, Direction::Forward, 16_000.0, &LIMITS);
    c.bench_function("motion/overshoot and return", |b| {
        b.iter(|| {
            let mut axis = running.clone();
            axis.move_to(Instant::from_nanos(2_000_000_000), black_box(100), &LIMITS);
            while let Some(wake) = axis.next_wake() {
                axis.handle_wake(wake);
            }
            axis
        });
    });
}

criterion_group!(benches, plan, evaluate, reverse);
criterion_main!(benches);
