//! What can go wrong, by whose fault it is.

use std::io;
use std::time::Duration;

/// Why something was not done. Each displays as one sentence that says what happened, to what, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// What was asked for makes no sense for this axis: a name, a value, a unit.
    #[error("{0}")]
    Usage(String),
    /// The line: nothing answers, or what does cannot be understood.
    #[error(transparent)]
    Line(#[from] LineError),
    /// The controller wants a password, or another one.
    #[error("{0}")]
    NotAuthorised(String),
    /// A limit or interlock says no, ours or the controller's. Nothing was done.
    #[error("{0}")]
    Refused(String),
    /// A fault is latched in the drive.
    #[error("{0}")]
    Fault(String),
    /// The controller answered with an error of its own that is none of the above.
    #[error("{0}")]
    Device(String),
    /// A command that starts motion was sent and its reply was lost. It was not sent again; the state that was read
    /// afterwards, if it could be, says what became of it.
    #[error("{command} was sent, but its reply was lost ({cause}); it was not sent again: {state}")]
    Uncertain {
        /// The command.
        command: String,
        /// What became of the reply.
        cause: LineError,
        /// What was found out afterwards.
        state: String,
    },
    /// What was read back is not what was written.
    #[error("{0}")]
    Differs(String),
    /// Something that takes several steps came to a halt between them.
    #[error("{cause}; {done}")]
    Partly {
        /// What was done up to there, or may have been.
        done: String,
        /// Why it went no further.
        cause: Box<Error>,
    },
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// It cannot be opened.
    #[error("cannot connect to {to}: {why}")]
    Connect {
        /// Where to.
        to: String,
        /// Why not.
        why: String,
    },
    /// It ended.
    #[error("the connection to {to} was lost: {why}")]
    Lost {
        /// Where to.
        to: String,
        /// How.
        why: String,
    },
    /// Nothing came in time.
    #[error("{to} did not answer within {after:?}")]
    Silent {
        /// Where to.
        to: String,
        /// How long was waited.
        after: Duration,
    },
    /// What came is no answer.
    #[error("{to} answered with what cannot be understood: {what}")]
    Garbled {
        /// Where to.
        to: String,
        /// What came.
        what: String,
    },
}

impl Error {
    /// The exit code of a command that ends with this error, as `stepdrive` documents them.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Usage(_) => 1,
            Error::Device(_) => 2,
            Error::Line(_) | Error::Uncertain { .. } => 5,
            Error::NotAuthorised(_) => 6,
            Error::Refused(_) => 7,
            Error::Fault(_) => 8,
            Error::Differs(_) => 10,
            Error::Partly { cause, .. } => cause.exit_code(),
        }
    }
}

impl LineError {
    /// What an error of the operating system is on a line that was open.
    pub(crate) fn lost(to: &str, error: &io::Error) -> LineError {
        LineError::Lost { to: to.to_owned(), why: error.to_string() }
    }
}
