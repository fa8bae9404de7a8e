//! Why a recording cannot be run.

use crate::recording::VERSION;
use std::io;

/// Why a recording cannot be run. Each displays as one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It cannot be read.
    #[error("line {line}: the recording cannot be read: {error}")]
    Read {
        /// The line, from 1.
        line: usize,
        /// Why not.
        error: io::Error,
    },
    /// It is none.
    #[error(
        "line 1: this is no recording of stepdrive, which begins with {{\"stepdrive_recording\":…}}: {0}"
    )]
    NoRecording(String),
    /// It is of another version of the format.
    #[error(
        "line 1: this is a recording in version {version} of the format, and this stepdrive reads version {VERSION}; \
         replay it with the stepdrive that made it{}",
        who_made_it(.made_by.as_deref())
    )]
    Version {
        /// Its version.
        version: u64,
        /// The version of the program that made it, when it says so.
        made_by: Option<String>,
    },
    /// The rig that it begins with cannot be had.
    #[error("line 1: the rig of the recording: {0}")]
    Rig(String),
    /// An entry is none, or cannot have happened.
    #[error("line {line}: {what}")]
    Entry {
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// More would happen than was allowed.
    #[error("line {line}: more happens in the rig up to this time than was allowed")]
    TooMuch {
        /// The line, from 1.
        line: usize,
    },
}

impl ReplayError {
    pub(super) fn entry(line: usize, what: impl Into<String>) -> ReplayError {
        ReplayError::Entry { line, what: what.into() }
    }
}

fn who_made_it(version: Option<&str>) -> String {
    version.map_or_else(String::new, |version| format!(", {}", version.escape_debug()))
}
