//! The lines of a recording.

use super::ReplayError;
use crate::recording::{Entry, Header, Sum, VERSION};
use serde::Deserialize;
use std::io::BufRead;

/// A recording that is being read.
pub(super) struct Source<R> {
    file: R,
    /// The bytes of the line that was read last.
    line: Vec<u8>,
    /// How many lines were read.
    lines: usize,
    sum: Sum,
}

/// An entry, and where it stands.
pub(super) struct Line {
    /// From 1.
    pub(super) number: usize,
    pub(super) entry: Entry,
    /// The sum of all lines before.
    pub(super) sum_before: Sum,
}

/// What every version of the format begins with.
#[derive(Deserialize)]
struct AnyHeader {
    stepdrive_recording: u64,
    made_by: Option<String>,
}

impl<R: BufRead> Source<R> {
    pub(super) fn new(file: R) -> Source<R> {
        Source { file, line: Vec::new(), lines: 0, sum: Sum::default() }
    }

    /// How many lines there were.
    pub(super) fn lines(&self) -> usize {
        self.lines
    }

    /// The first line.
    pub(super) fn header(&mut self) -> Result<Header, ReplayError> {
        if !self.read()? {
            return Err(ReplayError::NoRecording("it is empty".to_owned()));
        }
        self.sum.add(&self.line);
        let no_recording = |error: serde_json::Error| ReplayError::NoRecording(error.to_string());
        let AnyHeader { stepdrive_recording, made_by } =
            serde_json::from_slice(&self.line).map_err(no_recording)?;
        if stepdrive_recording != u64::from(VERSION) {
            return Err(ReplayError::Version { version: stepdrive_recording, made_by });
        }
        serde_json::from_slice(&self.line).map_err(no_recording)
    }

    /// The next line; `None` after the last that is whole.
    pub(super) fn next_entry(&mut self) -> Result<Option<Line>, ReplayError> {
        if !self.read()? {
            return Ok(None);
        }
        match serde_json::from_slice(&self.line) {
            Ok(entry) => {
                let sum_before = self.sum.clone();
                self.sum.add(&self.line);
                Ok(Some(Line { number: self.lines, entry, sum_before }))
            }
            // Whoever wrote it was ended in the middle of it.
            Err(_) if self.line.last() != Some(&b'\n') => Ok(None),
            Err(error) => {
                Err(ReplayError::entry(self.lines, format!("this is no entry of a recording: {error}")))
            }
        }
    }

    /// Reads a line; `false` when there is none.
    fn read(&mut self) -> Result<bool, ReplayError> {
        self.line.clear();
        self.lines += 1;
        let read = self.file.read_until(b'\n', &mut self.line);
        read.map(|count| count > 0).map_err(|error| ReplayError::Read { line: self.lines, error })
    }
}
