//! What a person got wrong in a rig file, or in another TOML file, with its place.

use super::written::reworded;
use alloc::format;
use alloc::string::{String, ToString};
use core::fmt;
use core::ops::Range;

/// A mistake in a rig file.
pub type RigFileError = Mistake;

/// A mistake in a TOML file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// What is wrong, and what would be right.
    pub message: String,
    /// Line, from 1; `None` when it is the file as a whole.
    pub line: Option<usize>,
    /// Column in characters, from 1.
    pub column: Option<usize>,
    /// The line itself, and how many characters of it are meant.
    excerpt: Option<(String, usize)>,
}

impl Mistake {
    /// A mistake in a file's text: what `span` says of it, in bytes, is meant; `None` is the file as a whole.
    pub fn new(text: &str, span: Option<Range<usize>>, message: String) -> Mistake {
        let place = span.and_then(|span| {
            let before = text.get(..span.start)?;
            let line_start = before.rfind('\n').map_or(0, |at| at + 1);
            let line = text.get(line_start..)?.lines().next().unwrap_or("");
            // What is no text, as in a file that is no TOML at all, must not reach a terminal.
            let line: String =
                line.chars().map(|c| if c.is_control() && c != '\t' { '\u{FFFD}' } else { c }).collect();
            let column = text.get(line_start..span.start)?.chars().count() + 1;
            let meant =
                text.get(span).map_or(1, |part| part.lines().next().unwrap_or("").chars().count().max(1));
            Some((before.matches('\n').count() + 1, column, line, meant))
        });
        match place {
            None => Mistake { message, line: None, column: None, excerpt: None },
            Some((line, column, source, meant)) => {
                Mistake { message, line: Some(line), column: Some(column), excerpt: Some((source, meant)) }
            }
        }
    }

    /// What the library that reads TOML found wrong in a file's text, in plain words.
    pub fn of_toml(text: &str, error: &toml::de::Error) -> Mistake {
        Mistake::new(text, error.span(), reworded(error.message()))
    }

    /// The mistake as a person reads it: `FILE:LINE:COLUMN: message`, then the line with what is meant underlined.
    pub fn render(&self, file: &str) -> String {
        let (Some(line), Some(column), Some((source, meant))) = (self.line, self.column, &self.excerpt)
        else {
            return format!("{file}: {}", self.message);
        };
        let (pad, rule) = (" ".repeat(line.to_string().len()), "^".repeat(*meant));
        let indent = " ".repeat(column.saturating_sub(1));
        format!(
            "{file}:{line}:{column}: {}\n{pad} |\n{line} | {source}\n{pad} | {indent}{rule}",
            self.message
        )
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl core::error::Error for Mistake {}
