//! What a command costs the SMD3 without its text: queries, settings, motion; and eight hours of bake.
#![allow(missing_docs, reason = "criterion's macros generate items without documentation")]

use core::time::Duration;
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use stepdrive_drive::smd3::{Config, Smd3, Stored};
use stepdrive_spec::smd3::commands::{Command, Request, Value};
use stepdrive_spec::time::Instant;

/// A controller fresh from the factory, a microsecond after power-up.
fn at_rest() -> (Smd3, Instant) {
    (Smd3::power_up(Instant::ZERO, Config::default(), Stored::Nothing, 0), Instant::from_nanos(1_000))
}

/// Half a second into a ramp.
fn moving() -> (Smd3, Instant) {
    let (mut drive, now) = at_rest();
    succeed(&mut drive, now, set(Command::Runv, Value::Sign(true)));
    (drive, now + Duration::from_millis(500))
}

fn query(command: Command) -> Request {
    Request { command, argument: None }
}

fn set(command: Command, value: Value) -> Request {
    Request { command, argument: Some(value) }
}

fn succeed(drive: &mut Smd3, now: Instant, request: Request) {
    assert!(drive.handle(now, Ok(Some(request))).outcome.is_ok(), "{request:?} was refused");
}

/// Times requests that are sent in turn, a microsecond apart; the figure is their mean.
fn time(c: &mut Criterion, name: &str, (mut drive, mut now): (Smd3, Instant), requests: &[Request]) {
    for request in requests {
        succeed(&mut drive, now, *request);
    }
    let mut turns = requests.iter().cycle();
    c.bench_function(&format!("smd3_drive/{name}"), |b| {
        b.iter(|| {
            now = now + Duration::from_micros(1);
            turns.next().map(|request| drive.handle(now, black_box(Ok(Some(*request)))))
        });
    });
}

fn commands(c: &mut Criterion) {
    time(c, "VMAX query", at_rest(), &[query(Command::Vmax)]);
    time(c, "PACT query, moving", moving(), &[query(Command::Pact)]);
    time(c, "TMOT query, moving", moving(), &[query(Command::Tmot)]);
    let vmax = [set(Command::Vmax, Value::Float(900.0)), set(Command::Vmax, Value::Float(1000.0))];
    time(c, "VMAX set, at rest", at_rest(), &vmax);
    time(c, "VMAX set, moving", moving(), &vmax);
    let current = [set(Command::Ia, Value::Float(0.5)), set(Command::Ia, Value::Float(1.0))];
    time(c, "IA set, moving", moving(), &current);
    let reversals = [set(Command::Runv, Value::Sign(false)), set(Command::Runv, Value::Sign(true))];
    time(c, "RUNV forward and back", moving(), &reversals);
    let targets = [set(Command::Runa, Value::Int(100_000)), set(Command::Runa, Value::Int(200_000))];
    time(c, "RUNA to new targets, moving", moving(), &targets);
    time(c, "STORE", at_rest(), &[query(Command::Store)]);
}

/// Eight hours of bake, looked at every minute.
fn bake(c: &mut Criterion) {
    let (mut drive, start) = at_rest();
    succeed(&mut drive, start, set(Command::Mode, Value::Uint(4)));
    c.bench_function("smd3_drive/eight hours of bake, TMOT every minute", |b| {
        b.iter_batched(
            || drive.clone(),
            |mut drive| {
                succeed(&mut drive, start, query(Command::Runb));
                for minute in 1..=480 {
                    let now = start + Duration::from_mins(minute);
                    black_box(drive.handle(now, Ok(Some(query(Command::Tmot)))));
                }
            },
            BatchSize::SmallInput,
        );
    });
}

criterion_group!(smd3_drive, commands, bake);
criterion_main!(smd3_drive);
