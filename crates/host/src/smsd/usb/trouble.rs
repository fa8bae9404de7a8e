//! What a controller answers when it does not do what was asked, in words.

use super::session::Trouble;
use crate::Error;
use crate::smsd::value::Slot;
use std::fmt;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Writable;
use stepdrive_spec::smsd::standard::{Answer, Code};
use stepdrive_spec::smsd::status::{MotStatus, Status};

/// What was asked for when trouble came.
#[derive(Clone, Debug)]
pub(super) enum Asked {
    /// To tell something.
    Read(String),
    /// To take something.
    Write {
        /// What, with its value.
        what: String,
        /// What it may be, as in `16 to 15600 full steps/s`.
        takes: Option<String>,
    },
    /// To take a program into a memory area.
    Store(u8),
    /// To do something.
    Act(String),
}

impl Asked {
    /// To read a register.
    pub(super) fn read(slot: Slot) -> Asked {
        Asked::Read(slot.to_string())
    }

    /// To write a value to a register.
    pub(super) fn write(slot: Slot, value: i64, model: Option<Model>) -> Asked {
        Asked::Write { what: format!("{slot} {value}"), takes: Some(slot.takes(model)) }
    }

    /// To take several values at once.
    pub(super) fn write_all(what: &str) -> Asked {
        Asked::Write { what: what.to_owned(), takes: None }
    }

    /// The trouble as an error. What acts is told in other words when it was not answered.
    pub(super) fn explain(&self, trouble: Trouble, controller: &str) -> Error {
        match trouble {
            Trouble::Told(error) => error,
            Trouble::NotSent(cause) | Trouble::Damaged(cause) => Error::Line(cause),
            Trouble::Unanswered(lost) => self.unanswered(Error::Line(lost.cause)),
            Trouble::Refused(answer) => self.refused(answer, controller),
        }
    }

    fn unanswered(&self, cause: Error) -> Error {
        let done = match self {
            Asked::Read(_) => return cause,
            Asked::Write { what, .. } => format!("whether {what} was written is not known"),
            Asked::Store(area) => format!("whether the program is in memory {area} is not known"),
            Asked::Act(what) => format!("whether {what} was carried out is not known"),
        };
        Error::Partly { done, cause: Box::new(cause) }
    }

    fn refused(&self, answer: Answer, controller: &str) -> Error {
        let code = Meaning(answer.code);
        if matches!(answer.code, Code::ErrorAccess | Code::ErrorAccessTimeout) {
            let unchanged = self.unchanged();
            return Error::NotAuthorised(format!("{controller} does not let one {self} ({code}){unchanged}"));
        }
        if answer.code == Code::ErrorNoCommand {
            return Error::Device(format!(
                "{controller} does not know how to {self} ({code}); is it an SMSD-4.2LAN or SMSD-8.0LAN?"
            ));
        }
        Error::Refused(format!("{controller} refused to {self} ({code}){}", self.because(answer.code)))
    }

    /// What stands against it.
    fn because(&self, code: Code) -> String {
        match self {
            Asked::Write { takes: Some(takes), .. } if code == Code::ErrorRange => {
                format!("; it takes {takes}; nothing was changed")
            }
            Asked::Store(_) if code == Code::ErrorWrite => {
                "; the program in that memory area is running, or a procedure of MEM_CMD is at work: stop the program, or wait; \
                 nothing was changed"
                    .to_owned()
            }
            Asked::Read(_) | Asked::Write { .. } | Asked::Store(_) | Asked::Act(_) => {
                self.unchanged().to_owned()
            }
        }
    }

    fn unchanged(&self) -> &'static str {
        match self {
            Asked::Read(_) => "",
            Asked::Write { .. } | Asked::Store(_) | Asked::Act(_) => "; nothing was changed",
        }
    }
}

impl fmt::Display for Asked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Asked::Read(what) => write!(f, "read {what}"),
            Asked::Write { what, .. } => write!(f, "write {what}"),
            Asked::Store(area) => write!(f, "write the program to memory {area}"),
            Asked::Act(what) => write!(f, "carry out {what}"),
        }
    }
}

/// A code by its name and what it means, as in `ERROR_RANGE: a value is out of its range`.
struct Meaning(Code);

impl fmt::Display for Meaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let about = self.0.about().trim_end_matches('.');
        let mut letters = about.chars();
        let first = letters.next().map(|first| first.to_ascii_lowercase());
        write!(f, "{}: {}{}", self.0, first.map(String::from).unwrap_or_default(), letters.as_str())
    }
}

/// Why the motor does not take a setting, which it says by `CMD_ERROR` alone. That flag may be an earlier command's; but
/// a setting is refused exactly while the motor's state forbids it.
pub(super) fn forbidden(writable: Writable, status: Status) -> Option<&'static str> {
    match writable {
        Writable::HiZ if !status.hi_z => {
            Some("the motor is energised; de-energise it first (Soft HiZ or Hard HiZ)")
        }
        Writable::Stopped if status.motion != MotStatus::Stopped => {
            Some("the motor is turning; stop it first")
        }
        Writable::Always | Writable::Stopped | Writable::HiZ => None,
    }
}

/// Whether the motor has taken a setting that was answered with this status.
pub(super) fn was_taken(writable: Writable, status: Status) -> bool {
    !status.cmd_error || forbidden(writable, status).is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::registers::Reg;

    fn told(asked: &Asked, code: Code) -> Error {
        let answer = Answer { status: Status::from_word(0x13), code, data: 0 };
        asked.explain(Trouble::Refused(answer), "stage")
    }

    #[test]
    fn a_code_is_told_by_its_name_and_meaning() {
        let slot = Slot::new(Reg::MaxSpeed, 0).expect("a register");
        assert_eq!(
            told(&Asked::write(slot, 5, None), Code::ErrorRange).to_string(),
            "stage refused to write MAX_SPEED 5 (ERROR_RANGE: a value is out of its range); \
             it takes 16 to 15600 full steps/s; nothing was changed"
        );
        assert_eq!(
            told(&Asked::Store(2), Code::ErrorWrite).to_string(),
            "stage refused to write the program to memory 2 (ERROR_WRITE: the memory cannot be written now); the program in \
             that memory area is running, or a procedure of MEM_CMD is at work: stop the program, or wait; nothing was changed"
        );
        assert_eq!(
            told(&Asked::Read("memory 1".to_owned()), Code::ErrorRead).to_string(),
            "stage refused to read memory 1 (ERROR_READ: the memory cannot be read)"
        );
    }

    #[test]
    fn the_exit_code_says_whose_fault_it_is() {
        let asked = Asked::Act("RUN_F".to_owned());
        for (code, exit) in [(Code::ErrorRange, 7), (Code::ErrorAccess, 6), (Code::ErrorNoCommand, 2)] {
            assert_eq!(told(&asked, code).exit_code(), exit, "{code}");
        }
    }
}
