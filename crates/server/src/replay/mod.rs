//! Recordings run again, without sockets and as fast as this computer can.
//!
//! Everything that went in goes in again, at the same rig time, in the same order; every reply, and the state at the end,
//! is compared with what was recorded.

mod error;
mod player;
mod rig;
mod source;
mod words;

#[cfg(test)]
mod tests;

pub use error::ReplayError;

use crate::recording::Happened;
use player::{Outcome, Player};
use serde::Serialize;
use source::{Line, Source};
use std::fmt;
use std::io::BufRead;
use stepdrive_spec::time::Instant;

/// What came of a recording that was run again. It displays as a few lines for people.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Replayed {
    /// The version of the program that made the recording. Another one may answer differently, and count more in a state.
    pub made_by: String,
    /// How many entries there were.
    pub entries: usize,
    /// How many of them were requests.
    pub requests: usize,
    /// The rig time of the recording's end, in nanoseconds; `None` when it was cut short.
    pub end: Option<u64>,
    /// Whether the recording has no end, as after a kill: replies were compared, the state could not be.
    pub cut_short: bool,
    /// Whether the file was changed after it was recorded. Unknown, and `false`, when it was cut short.
    pub altered: bool,
    /// How many replies, and states at the end, differ.
    pub differences: usize,
    /// The first of them.
    pub first_difference: Option<Difference>,
    /// Whether the file is as it was recorded, as far as that is known, and nothing differs.
    pub identical: bool,
    /// The state of the rig at the end, or as far as the recording goes; a SHA-256 in hexadecimal.
    pub state: String,
    /// The whole run in one number: a SHA-256, in hexadecimal, over every reply with its connection and rig time, and over
    /// `state`. It is the same on any machine.
    pub digest: String,
}

/// Where a replay differs from what was recorded.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The line of the recording, from 1.
    pub line: usize,
    /// The rig time, in nanoseconds.
    pub t: u64,
    /// The drive's name; empty when it is the state of the rig at the end.
    pub drive: String,
    /// The request.
    pub request: Said,
    /// What the recording has.
    pub recorded: Said,
    /// What it was answered now.
    pub replayed: Said,
}

/// Bytes, and what they say.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Said {
    /// In hexadecimal; of a state its digest.
    pub bytes: String,
    /// For people.
    pub means: String,
}

/// Runs a recording again.
///
/// # Errors
/// What cannot be run, and in which line: the file is no recording, of another version, or broken before its last line.
pub fn replay(source: impl BufRead) -> Result<Replayed, ReplayError> {
    replay_within(source, u64::MAX)
}

/// Runs a recording again, as [`replay`], as long as no more than `most` things happen in the rig by themselves: for
/// recordings of which nobody knows where they come from, since an hour of them may be centuries of rig time.
///
/// # Errors
/// As of [`replay`], and [`ReplayError::TooMuch`].
pub fn replay_within(source: impl BufRead, most: u64) -> Result<Replayed, ReplayError> {
    let mut source = Source::new(source);
    let header = source.header()?;
    let mut player = Player::new(rig::parse(&header)?, &header, most)?;
    let mut ended = None;
    let mut entries = 0;
    while let Some(Line { number, entry, sum_before }) = source.next_entry()? {
        if ended.is_some() {
            return Err(ReplayError::entry(number, "nothing comes after the end"));
        }
        entries += 1;
        if let Happened::End { state, sum } = &entry.what {
            player.end(number, entry.at(), state)?;
            ended = Some((entry.t, *sum != sum_before.end(entry.at(), state)));
        } else {
            player.play(number, entry.at(), &entry.what)?;
        }
    }
    let Outcome { requests, differences, first_difference, state, digest } = player.finish(source.lines())?;
    let (end, altered) = ended.unzip();
    let altered = altered.unwrap_or(false);
    Ok(Replayed {
        made_by: header.made_by,
        entries,
        requests,
        end,
        cut_short: end.is_none(),
        altered,
        differences,
        first_difference,
        identical: differences == 0 && !altered,
        state,
        digest,
    })
}

impl fmt::Display for Replayed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {}",
            counted(self.entries, ["entry", "entries"]),
            counted(self.requests, ["request", "requests"])
        )?;
        match self.end {
            Some(end) => writeln!(f, ", up to {} of rig time", Instant::from_nanos(end))?,
            None => writeln!(f, "; the recording was cut short, so that its end cannot be compared")?,
        }
        if self.altered {
            writeln!(f, "the recording was changed after it was made: its sum is wrong")?;
        }
        match (&self.first_difference, self.cut_short) {
            (None, false) => writeln!(f, "every reply and the state at the end are identical")?,
            (None, true) => writeln!(f, "every reply is identical")?,
            (Some(first), _) => {
                writeln!(
                    f,
                    "not identical: {}; the first:",
                    counted(self.differences, ["difference", "differences"])
                )?;
                first.fmt(f)?;
                if self.made_by != env!("CARGO_PKG_VERSION") {
                    writeln!(f, "it was recorded by stepdrive {}, another version than this", self.made_by)?;
                }
            }
        }
        write!(f, "digest {}", self.digest)
    }
}

/// A number and its noun.
fn counted(number: usize, [one, many]: [&str; 2]) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = Instant::from_nanos(self.t);
        let drive = if self.drive.is_empty() { "the rig" } else { &self.drive };
        writeln!(f, "  line {}, at {at}, {drive}: {}", self.line, self.request.means)?;
        if !self.request.bytes.is_empty() {
            writeln!(f, "  request   {}", self.request.bytes)?;
        }
        writeln!(f, "  recorded  {}", self.recorded)?;
        writeln!(f, "  replayed  {}", self.replayed)
    }
}

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.bytes.is_empty(), self.means.is_empty()) {
            (true, _) => f.write_str(&self.means),
            (false, true) => f.write_str(&self.bytes),
            (false, false) => write!(f, "{}  {}", self.bytes, self.means),
        }
    }
}
