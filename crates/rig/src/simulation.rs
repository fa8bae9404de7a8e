//! A user program run on a machine on virtual time, step by step.
//!
//! Time jumps from one thing that happens to the next, so an hour of waiting takes no time. What happens is told as
//! [`Step`]s, each with the state of the drive at its instant.

use crate::file::{DriveSection, SmsdSection};
use crate::machine::Machine;
use crate::names::shown;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;
use stepdrive_drive::smsd::{Event, Memory, Place, Refusal, Smsd};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::PROGRAM_AREAS;
use stepdrive_spec::smsd::status::Status;
use stepdrive_spec::time::Instant;

/// A signal that comes to an input, or goes, while the program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal {
    /// When.
    pub at: Instant,
    /// Where.
    pub input: Input,
    /// Whether it comes or goes.
    pub present: bool,
}

/// Reads when signals come to an input of this name, capitals or not: `on`, `at:TIME` (from then on) or
/// `at:TIME..TIME` (between), several parted by commas. `time` reads a TIME, as [`parse`](crate::duration::parse) does.
///
/// # Errors
/// What is wrong with it, for people.
pub fn signals<E: ToString>(
    name: &str,
    times: &str,
    time: impl Fn(&str) -> Result<Duration, E>,
) -> Result<Vec<Signal>, String> {
    let input = Input::from_name(&name.to_ascii_uppercase());
    let names = || Input::ALL.map(Input::name).join(", ");
    let input = input.ok_or_else(|| format!("there is no input {}; there are {}", shown(name), names()))?;
    let mut signals = Vec::new();
    for part in times.split(',') {
        let (from, to) = interval(part.trim(), &time)?;
        signals.push(Signal { at: Instant::ZERO + from, input, present: true });
        signals.extend(to.map(|to| Signal { at: Instant::ZERO + to, input, present: false }));
    }
    Ok(signals)
}

/// From when on there is a signal, and until when; `None` when it stays.
fn interval<E: ToString>(
    part: &str,
    time: impl Fn(&str) -> Result<Duration, E>,
) -> Result<(Duration, Option<Duration>), String> {
    if part == "on" {
        return Ok((Duration::ZERO, None));
    }
    let time = |text| time(text).map_err(|error| error.to_string());
    let times = part.strip_prefix("at:");
    let times = times
        .ok_or_else(|| format!("`{}` is not on, at:TIME or at:TIME..TIME, as in at:2.5s", shown(part)))?;
    let Some((from, to)) = times.split_once("..") else { return Ok((time(times)?, None)) };
    let (from, to) = (time(from)?, time(to)?);
    if from < to { Ok((from, Some(to))) } else { Err(format!("`{}` ends before it begins", shown(part))) }
}

/// Something that happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What.
    pub what: What,
    /// The state right after it.
    pub state: State,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// The instruction at this line ran; this is its word.
    Instruction(Place, u32),
    /// The motion entered another phase, or the inputs or the relay changed.
    Change,
    /// It is over.
    End(End),
}

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The program ended by itself, at this line, and the motor has come to rest or turns on at constant speed.
    Ended(Place),
    /// An instruction was refused.
    Refused(Refusal),
    /// It waits at this line for something that will not come by itself: one of these inputs, a bit each; none when it
    /// waits for a motion that never ends.
    Waiting(Place, u8),
    /// The time that it was given is over, and it still runs at this line.
    TimeOver(Place),
}

/// The state of the drive at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// The instant.
    pub at: Instant,
    /// `ABS_POS`, in microsteps.
    pub position: i32,
    /// `SPEED`, in full steps per second, not rounded.
    pub speed: f64,
    /// The status flags.
    pub status: Status,
    /// The inputs, a bit each.
    pub inputs: u8,
    /// The relay.
    pub relay: bool,
    /// Whether the rotor is being driven against an end of the travel.
    pub stalled: bool,
}

impl State {
    /// The state of a machine that has been brought up to `at`.
    pub fn of(machine: &Machine<Smsd>, at: Instant) -> State {
        let drive = machine.drive();
        State {
            at,
            position: drive.position(at),
            speed: drive.speed(at),
            status: drive.status(at),
            inputs: drive.inputs(),
            relay: drive.relay(),
            stalled: machine.stalled(at),
        }
    }

    /// Whether something else than place and time differs from `other`.
    fn differs(&self, other: &State) -> bool {
        (self.status, self.inputs, self.relay, self.stalled)
            != (other.status, other.inputs, other.relay, other.stalled)
    }
}

impl SmsdSection {
    /// The drive as it leaves the factory, with these programs in its memory areas, switched on in autonomous mode: the
    /// program of memory area `area` (0 to 3) starts at once.
    pub fn start_program(
        &self,
        drive: &DriveSection,
        programs: [&[u32]; PROGRAM_AREAS],
        area: u8,
    ) -> Machine<Smsd> {
        let mut memory = Memory::factory();
        for (number, words) in programs.into_iter().enumerate() {
            memory.load_program(number, words);
        }
        memory.mode_n_programs = area;
        SmsdSection { autonomous: true, mode_n_programs: None, ..self.clone() }.power_up(drive, memory)
    }
}

/// A program that is being run. It is an iterator over what happens; [`What::End`] comes last.
#[derive(Clone, Debug)]
pub struct Simulation {
    machine: Machine<Smsd>,
    /// The signals to come, the next one last.
    signals: Vec<Signal>,
    end: Instant,
    executed: u64,
    last: State,
    over: bool,
}

impl Simulation {
    /// Runs the program of a machine that has just been switched on, for at most `time`; see
    /// [`SmsdSection::start_program`].
    pub fn new(machine: Machine<Smsd>, mut signals: Vec<Signal>, time: Duration) -> Simulation {
        // The sort keeps the order of signals at the same instant; the last is taken first.
        signals.sort_by_key(|signal| signal.at);
        signals.reverse();
        let last = State::of(&machine, Instant::ZERO);
        Simulation { machine, signals, end: Instant::ZERO + time, executed: 0, last, over: false }
    }

    /// The machine as it stands.
    pub fn machine(&self) -> &Machine<Smsd> {
        &self.machine
    }

    /// Lets the next thing happen, whether it is worth telling or not. `None` when nothing is left within the time.
    fn advance(&mut self) -> Option<Instant> {
        let wake = self.machine.next_wake();
        let signal = self.signals.last().map(|signal| signal.at);
        let at = [wake, signal].into_iter().flatten().min().filter(|at| *at <= self.end)?;
        // The machine goes first, so that a signal finds it up to its time.
        if wake == Some(at) {
            self.machine.advance(at);
        } else if let Some(signal) = self.signals.pop() {
            self.machine.set_signal(at, signal.input, signal.present);
        }
        Some(at)
    }

    fn finish(&mut self, at: Instant, end: End) -> Step {
        self.over = true;
        Step { what: What::End(end), state: State::of(&self.machine, at) }
    }

    /// How it ends when nothing more happens within the time.
    fn nothing_left(&self) -> (Instant, End) {
        let program = self.machine.drive().program();
        let later = self.machine.next_wake().is_some() || !self.signals.is_empty();
        match (program.running, later) {
            (false, _) => (self.last.at, End::Ended(program.place)),
            (true, true) => (self.end, End::TimeOver(program.place)),
            (true, false) => (self.last.at, End::Waiting(program.place, program.waiting)),
        }
    }

    /// The instruction that ran, if one did.
    fn instruction(&mut self) -> Option<What> {
        let program = self.machine.drive().program();
        if core::mem::replace(&mut self.executed, program.executed) == program.executed {
            return None;
        }
        let area = self.machine.drive().memory().area(usize::from(program.place.area));
        let word = area.words().get(usize::from(program.place.line)).copied().unwrap_or(0);
        Some(What::Instruction(program.place, word))
    }
}

impl Iterator for Simulation {
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        if self.over {
            return None;
        }
        loop {
            if let Some(Event::Refused(refusal)) = self.machine.drive_mut().poll_event() {
                return Some(self.finish(self.last.at, End::Refused(refusal)));
            }
            let resting = self.machine.next_wake().is_none();
            if !self.machine.drive().program().running && resting {
                let (at, end) = self.nothing_left();
                return Some(self.finish(at, end));
            }
            let Some(at) = self.advance() else {
                let (at, end) = self.nothing_left();
                return Some(self.finish(at, end));
            };
            let state = State::of(&self.machine, at);
            let changed = state.differs(&self.last);
            self.last = state;
            let what = self.instruction().or(changed.then_some(What::Change));
            if let Some(what) = what {
                return Some(Step { what, state });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::duration::parse;
    use alloc::vec;

    #[test]
    fn signals_come_on_from_a_time_on_and_between_two_times() {
        let at = |milliseconds, present| Signal {
            at: Instant::ZERO + Duration::from_millis(milliseconds),
            input: Input::In1,
            present,
        };
        assert_eq!(signals("IN1", "on", parse), Ok(vec![at(0, true)]));
        assert_eq!(signals("in1", "at:2.5s", parse), Ok(vec![at(2500, true)]));
        let twice = vec![at(1000, true), at(1500, false), at(3000, true)];
        assert_eq!(signals("IN1", "at:1s..1500ms, at:3s", parse), Ok(twice));
    }

    #[test]
    fn what_is_no_signal_is_refused_with_what_would_be() {
        for (name, times, part) in [
            ("IN9", "on", "no input IN9; there are IN0, IN1"),
            ("IN1", "soon", "`soon` is not on, at:TIME"),
            ("IN1", "at:2s..1s", "ends before it begins"),
            ("IN1", "at:2fortnights", "ms"),
            ("IN1", "", "at:TIME"),
        ] {
            let message = signals(name, times, parse).expect_err(times);
            assert!(message.contains(part), "{times}: {message}");
        }
    }
}
