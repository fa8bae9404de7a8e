//! Exceptions of the controller in words.

use super::session::Trouble;
use super::value::{Run, Slot};
use crate::Error;
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Reg, Writable};

/// What was asked for when trouble came.
#[derive(Clone, Copy, Debug)]
pub(super) enum Asked<'a> {
    /// To read these.
    Read(Run<'a>),
    /// To write these.
    Write(Run<'a>, &'a [i64], Option<Model>),
}

impl Asked<'_> {
    /// The trouble as an error.
    pub(super) fn explain(self, trouble: Trouble, controller: &str) -> Error {
        match trouble {
            Trouble::Told(error) => error,
            Trouble::NotSent(error) => Error::Line(error),
            Trouble::Unanswered(lost) => self.unanswered(Error::Line(lost.cause)),
            Trouble::Exception(exception) => self.refused(exception, controller),
        }
    }

    fn unanswered(self, cause: Error) -> Error {
        match self {
            Asked::Read(_) => cause,
            Asked::Write(..) => {
                let done = format!("whether {} was written is not known", self.what());
                Error::Partly { done, cause: Box::new(cause) }
            }
        }
    }

    fn refused(self, exception: Exception, controller: &str) -> Error {
        let what = self.what();
        match exception {
            Exception::IllegalFunction => Error::Device(format!(
                "{controller} does not know how to {} {what} ({exception}); is it an SMSD-4.2LAN or SMSD-8.0LAN?",
                self.verb()
            )),
            Exception::IllegalDataAddress => Error::Device(format!(
                "{controller} does not let one {} {what}{} ({exception}){}",
                self.verb(),
                self.place(),
                self.unchanged()
            )),
            Exception::IllegalDataValue => Error::Refused(format!(
                "{controller} refused {what} as out of range ({exception}){}{}",
                self.ranges(),
                self.unchanged()
            )),
            Exception::ServerDeviceFailure => Error::Device(format!(
                "{controller} failed to {} {what} ({exception}); {}",
                self.verb(),
                self.after_failure()
            )),
            Exception::ServerDeviceBusy => self.not_now(exception, controller),
            Exception::Other(_) => {
                Error::Device(format!("{controller} refused to {} {what}: {exception}", self.verb()))
            }
        }
    }

    fn verb(self) -> &'static str {
        match self {
            Asked::Read(_) => "read",
            Asked::Write(..) => "write",
        }
    }

    fn run(&self) -> Run<'_> {
        match self {
            Asked::Read(run) | Asked::Write(run, ..) => *run,
        }
    }

    /// The registers, with the values that they were to take unless nobody should see them.
    fn what(self) -> String {
        match self {
            Asked::Read(run) => run.to_string(),
            Asked::Write(run, values, _) => {
                let shown = |(slot, value): (&Slot, &i64)| {
                    if slot.tells() || slot.acts() { format!("{slot} {value}") } else { slot.to_string() }
                };
                let all: Vec<String> = run.slots.iter().zip(values).map(shown).collect();
                match all.as_slice() {
                    [first, .., last] if all.len() > 8 => format!("{first} … {last}"),
                    _ => all.join(", "),
                }
            }
        }
    }

    fn place(self) -> String {
        let first = self.run().slots.first();
        first.map_or_else(String::new, |slot| {
            format!(" at {} {:04X}", slot.row.table.abbreviation(), slot.address())
        })
    }

    fn ranges(self) -> String {
        let Asked::Write(run, _, model) = self else { return String::new() };
        match run.slots {
            [slot] => format!("; it takes {}", slot.takes(model)),
            _ => String::new(),
        }
    }

    fn unchanged(self) -> &'static str {
        match self {
            Asked::Read(_) => "",
            Asked::Write(..) => "; nothing was changed",
        }
    }

    fn after_failure(self) -> &'static str {
        match self {
            Asked::Read(_) => "try again",
            Asked::Write(..) => "read it back before you go on",
        }
    }

    /// The error of a controller that is busy; no interlock stands against being read.
    fn not_now(self, exception: Exception, controller: &str) -> Error {
        let what = self.what();
        match self {
            Asked::Read(_) => Error::Device(format!(
                "{controller} refused to read {what} ({exception}): it is busy; try again"
            )),
            Asked::Write(..) => {
                Error::Refused(format!("{controller} refused {what} ({exception}): {}", self.why_not_now()))
            }
        }
    }

    /// What stands against a write.
    fn why_not_now(self) -> &'static str {
        let has = |when: fn(&Slot) -> bool| self.run().slots.iter().any(when);
        if has(|slot| slot.row.id == Reg::MemCmd) {
            "a procedure of MEM_CMD is at work, or the program in that memory area is running; wait, or stop the program"
        } else if has(|slot| slot.row.writable == Writable::HiZ) {
            "the motor is energised; de-energise it first (Soft HiZ or Hard HiZ); nothing was changed"
        } else if has(|slot| slot.row.writable == Writable::Stopped) {
            "the motor is turning; stop it first; nothing was changed"
        } else {
            "it is busy; try again"
        }
    }
}
