//! A controller on the bench: a virtual clock, switches that its rotor moves, and verbs that say what a test does.

use core::ops::RangeInclusive;
use core::time::Duration;
use stepdrive_drive::smd3::{Config, Smd3, Stored, Thermal};
use stepdrive_motion::Direction;
use stepdrive_spec::smd3::commands::{Command, Kind, Reply, Request, Value};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, STATUS_FLAGS};
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::time::Instant;

pub(crate) const SECOND: Duration = Duration::from_secs(1);
pub(crate) const MS: Duration = Duration::from_millis(1);
/// Units of the rotor to the full step.
pub(crate) const STEP: i64 = Smd3::ROTOR_UNITS;

/// A switch that is closed while the rotor is within a range of its units.
pub(crate) struct Switch {
    pub(crate) signal: Signal,
    pub(crate) closed: RangeInclusive<i64>,
}

/// A controller and the time.
pub(crate) struct Bench {
    pub(crate) drive: Smd3,
    pub(crate) now: Instant,
    switches: Vec<Switch>,
    /// Wake-ups handled so far.
    pub(crate) wakes: u64,
}

impl Bench {
    /// A controller fresh from the factory, with nothing connected.
    pub(crate) fn new() -> Bench {
        Bench::with(Config::default(), &Stored::Nothing, 0)
    }

    pub(crate) fn with(config: Config, stored: &Stored, signals: u16) -> Bench {
        let drive = Smd3::power_up(Instant::ZERO, config, *stored, signals);
        Bench { drive, now: Instant::ZERO, switches: Vec::new(), wakes: 0 }
    }

    /// A controller whose motor warms up in this way.
    pub(crate) fn warming(thermal: Thermal) -> Bench {
        Bench::with(Config { thermal, ..Config::default() }, &Stored::Nothing, 0)
    }

    /// A controller in this mode.
    pub(crate) fn in_mode(mode: u32) -> Bench {
        let mut bench = Bench::new();
        bench.set("MODE", mode);
        bench
    }

    /// Wires a switch between two places of the rotor, in full steps, and enables the limits.
    pub(crate) fn switch(&mut self, signal: Signal, closed: RangeInclusive<i64>) {
        let closed = closed.start() * STEP..=closed.end() * STEP;
        self.switches.push(Switch { signal, closed });
        self.set("L", 1);
        self.tell_switches();
    }

    // ---- commands

    /// Sends a command with an argument; none when it is empty.
    pub(crate) fn send(&mut self, mnemonic: &str, argument: &str) -> Reply {
        let command = Command::from_mnemonic(mnemonic).expect("a mnemonic");
        let argument = (!argument.is_empty()).then(|| typed(command.info().kind, argument));
        self.request(Request { command, argument })
    }

    pub(crate) fn request(&mut self, request: Request) -> Reply {
        self.drive.handle(self.now, Ok(Some(request)))
    }

    /// Does what takes no argument, or a sign.
    pub(crate) fn order(&mut self, mnemonic: &str, argument: &str) {
        let reply = self.send(mnemonic, argument);
        assert_eq!(reply.outcome, Ok(None), "{mnemonic},{argument}");
    }

    /// Sets a value that is taken; answers what was set.
    #[allow(clippy::needless_pass_by_value, reason = "numbers and text alike")]
    pub(crate) fn set(&mut self, mnemonic: &str, value: impl ToString) -> f64 {
        let value = value.to_string();
        let reply = self.send(mnemonic, &value);
        let value = reply.outcome.unwrap_or_else(|error| panic!("{mnemonic},{value}: {error}"));
        number(value.unwrap_or_else(|| panic!("{mnemonic} answers nothing")))
    }

    /// Reads a value as a number.
    pub(crate) fn get(&mut self, mnemonic: &str) -> f64 {
        let reply = self.send(mnemonic, "");
        number(reply.outcome.expect("readable").expect("a value"))
    }

    /// Asserts that a command is refused with this number.
    #[track_caller]
    pub(crate) fn refused(&mut self, mnemonic: &str, argument: &str, code: i16) {
        let outcome = self.send(mnemonic, argument).outcome;
        assert_eq!(outcome.map_err(Error::code), Err(code), "{mnemonic},{argument}");
    }

    // ---- signals and time

    pub(crate) fn signal(&mut self, signal: Signal, present: bool) {
        self.drive.set_signal(self.now, signal, present);
    }

    /// The next thing that happens by itself: a wake-up, or the rotor at a switch.
    fn next(&self) -> Option<Instant> {
        let here = self.drive.rotor(self.now);
        let edges = self.switches.iter().flat_map(|switch| match self.drive.direction() {
            Direction::Forward => [*switch.closed.start(), switch.closed.end() + 1],
            Direction::Reverse => [*switch.closed.end(), switch.closed.start() - 1],
        });
        let crossed =
            edges.filter(|edge| *edge != here).filter_map(|edge| self.drive.when_rotor_reaches(edge));
        let wake = self.drive.next_wake().map(|(at, _)| at);
        crossed.chain(wake).min()
    }

    /// Lets the next thing happen if it comes by `end`.
    pub(crate) fn step(&mut self, end: Instant) -> bool {
        let Some(at) = self.next().filter(|at| *at <= end) else { return false };
        assert!(at >= self.now, "a wake-up at {at} is in the past of {}", self.now);
        self.now = at;
        self.drive.handle_wake(at);
        self.tell_switches();
        self.wakes += 1;
        let next = self.drive.next_wake();
        assert!(next.is_none_or(|(next, _)| next > at), "after {at} the next wake-up is at {next:?}");
        true
    }

    fn tell_switches(&mut self) {
        for switch in &self.switches {
            let closed = switch.closed.contains(&self.drive.rotor(self.now));
            self.drive.set_signal(self.now, switch.signal, closed);
        }
    }

    pub(crate) fn run_for(&mut self, time: Duration) {
        let end = self.now + time;
        while self.step(end) {}
        self.now = end;
    }

    /// Lets time jump from event to event until `done`; answers how long that took.
    #[track_caller]
    pub(crate) fn run_until(&mut self, done: impl Fn(&Bench) -> bool) -> Duration {
        let start = self.now;
        while !done(self) {
            assert!(self.step(Instant::FAR_FUTURE), "nothing will happen any more: {}", self.flags());
        }
        self.now.since(start)
    }

    #[track_caller]
    pub(crate) fn run_until_standby(&mut self) -> Duration {
        self.run_until(Bench::standby)
    }

    // ---- inspection

    /// The names of the flags that are set, status flags first.
    pub(crate) fn flags(&self) -> String {
        let flags = self.drive.flags();
        let status = STATUS_FLAGS.iter().filter(|row| row.is_in(flags.status));
        let errors = ERROR_FLAGS.iter().filter(|row| row.is_in(flags.error));
        let names: Vec<&str> = status.chain(errors).map(|row| row.name).collect();
        names.join(", ")
    }

    pub(crate) fn standby(&self) -> bool {
        self.flag("STANDBY")
    }

    pub(crate) fn flag(&self, name: &str) -> bool {
        self.flags().split(", ").any(|flag| flag == name)
    }

    pub(crate) fn position(&self) -> f64 {
        self.drive.position(self.now)
    }

    pub(crate) fn velocity(&self) -> f64 {
        self.drive.velocity(self.now)
    }

    pub(crate) fn current(&self) -> f64 {
        self.drive.current(self.now)
    }

    pub(crate) fn temperature(&self) -> f64 {
        self.drive.temperature(self.now)
    }
}

/// An argument as the codec would make it from its text.
pub(crate) fn typed(kind: Kind, argument: &str) -> Value {
    match kind {
        Kind::Int => Value::Int(argument.parse().expect("INT")),
        Kind::Uint => Value::Uint(argument.parse().expect("UINT")),
        Kind::Float => Value::Float(argument.parse().expect("FLOAT")),
        Kind::Bool => Value::Bool(argument == "1"),
        Kind::Sign => Value::Sign(argument == "+"),
        Kind::None | Kind::Text => panic!("takes no argument"),
    }
}

pub(crate) fn number(value: Value) -> f64 {
    match value {
        Value::Int(value) => value as f64,
        Value::Uint(value) => value as f64,
        Value::Float(value) => value,
        Value::Bool(value) => f64::from(u8::from(value)),
        Value::Mode(mode) => f64::from(mode.number()),
        Value::Sign(_) | Value::Text(_) | Value::FlagTable => panic!("{value:?} is no number"),
    }
}

#[track_caller]
pub(crate) fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} where {expected} was expected");
}

/// Asserts that a time is what the textbook says, to a nanosecond or two and the rounding of a calculation in seconds.
#[track_caller]
pub(crate) fn assert_takes(found: Duration, seconds: f64) {
    let error = (found.as_secs_f64() - seconds).abs();
    assert!(error <= 5e-9 + 1e-11 * seconds, "took {found:?}, the textbook says {seconds} s");
}
