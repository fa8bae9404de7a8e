//! A program's text, and places in it.

use crate::diagnostic::{Code, Diagnostic};
use serde::Serialize;

/// Text longer than this is refused: four full memories with a comment on every line take a tenth of it.
pub const MAX_TEXT_BYTES: usize = 1 << 20;

/// A stretch of the text, in bytes, `end` behind the last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Span {
    /// The first byte.
    pub start: usize,
    /// The first byte behind it.
    pub end: usize,
}

impl Span {
    /// From `start` to just before `end`.
    pub const fn new(start: usize, end: usize) -> Span {
        Span { start, end }
    }

    /// The shortest one around both.
    pub(crate) fn around(self, other: Span) -> Span {
        Span { start: self.start.min(other.start), end: self.end.max(other.end) }
    }

    /// What it covers; empty when it does not fit the text.
    pub fn of(self, text: &str) -> &str {
        text.get(self.start..self.end).unwrap_or("")
    }
}

/// A place as people count: both from 1, the column in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LineColumn {
    /// The line.
    pub line: usize,
    /// The character within the line.
    pub column: usize,
}

/// A program's text with the name under which messages show it.
#[derive(Clone, Debug)]
pub struct SourceFile {
    name: String,
    text: String,
    line_starts: Vec<usize>,
}

impl SourceFile {
    /// The text under a name, usually its path.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> SourceFile {
        let text = text.into();
        let behind_newlines =
            text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
        let line_starts = std::iter::once(0).chain(behind_newlines).collect();
        SourceFile { name: name.into(), text, line_starts }
    }

    /// The text from the bytes of a file.
    ///
    /// # Errors
    /// [`Code::NotText`] when they are not UTF-8, [`Code::TooLarge`] above [`MAX_TEXT_BYTES`].
    pub fn from_bytes(name: impl Into<String>, bytes: Vec<u8>) -> Result<SourceFile, Diagnostic> {
        if bytes.len() > MAX_TEXT_BYTES {
            return Err(too_large(bytes.len()));
        }
        match String::from_utf8(bytes) {
            Ok(text) => Ok(SourceFile::new(name, text)),
            Err(error) => Err(not_text(error.utf8_error().valid_up_to())),
        }
    }

    /// The name under which messages show it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The line and column of a byte; that of the end for one behind it.
    pub fn line_column(&self, offset: usize) -> LineColumn {
        let line = self.line_starts.partition_point(|start| *start <= offset).max(1);
        let start = self.line_start(line);
        let before = self.text.as_bytes().get(start..offset.min(self.text.len())).unwrap_or(&[]);
        // Every character has one byte that does not continue another.
        let column = before.iter().filter(|byte| (**byte & 0xC0) != 0x80).count() + 1;
        LineColumn { line, column }
    }

    /// The bytes of a line, counted from 1, without what ends it; empty at the end for a line that is not there.
    pub fn line(&self, line: usize) -> Span {
        let start = self.line_start(line);
        let end = self.line_starts.get(line).map_or(self.text.len(), |next| next - 1);
        let span = Span::new(start, end);
        Span::new(start, end - usize::from(span.of(&self.text).ends_with('\r')))
    }

    /// How many lines it has; at least 1.
    pub fn line_count(&self) -> usize {
        self.line_starts.len()
    }

    fn line_start(&self, line: usize) -> usize {
        self.line_starts.get(line.saturating_sub(1)).copied().unwrap_or(self.text.len())
    }
}

pub(crate) fn too_large(bytes: usize) -> Diagnostic {
    Diagnostic::new(Code::TooLarge, format!("the text has {bytes} bytes, which cannot be a program"))
        .help(format!("a text may have {MAX_TEXT_BYTES} bytes; four full memories take far less"))
}

fn not_text(offset: usize) -> Diagnostic {
    Diagnostic::new(Code::NotText, format!("this is not text: byte {offset} is not UTF-8"))
        .help("a built image or a read-out of a controller is shown by `dump`")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_leads_to_its_line_and_its_character() {
        let file = SourceFile::new("x", "a\r\nüb\n");
        assert_eq!(file.line_count(), 3);
        assert_eq!(file.line_column(0), LineColumn { line: 1, column: 1 });
        assert_eq!(file.line_column(5), LineColumn { line: 2, column: 2 });
        assert_eq!(file.line_column(999), LineColumn { line: 3, column: 1 });
        assert_eq!(file.line(1), Span::new(0, 1));
        assert_eq!(file.line(2).of(file.text()), "üb");
        assert_eq!(file.line(9), Span::new(7, 7));
    }

    #[test]
    fn bytes_that_are_not_text_and_files_too_large_are_refused() {
        let refused = |bytes| SourceFile::from_bytes("x", bytes).map_err(|diagnostic| diagnostic.code);
        assert_eq!(refused(vec![b'E', 0xFF]).err(), Some(Code::NotText));
        assert_eq!(refused(vec![b' '; MAX_TEXT_BYTES + 1]).err(), Some(Code::TooLarge));
        assert!(refused(vec![b' '; MAX_TEXT_BYTES]).is_ok());
    }
}
