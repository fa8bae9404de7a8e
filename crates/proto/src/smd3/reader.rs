//! Where one line that reaches a server ends and the next begins.

use super::request::decode_line;
use core::{fmt, mem};
use stepdrive_spec::smd3::commands::Request;
use stepdrive_spec::smd3::errors::Error;

/// The longest line in bytes, its terminator not counted (decision 27).
pub const MAX_LINE: usize = 256;

/// A line that has ended, without its terminator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line<'a> {
    /// At most [`MAX_LINE`] bytes.
    Text(&'a [u8]),
    /// More than that; they are gone.
    TooLong,
}

impl Line<'_> {
    /// Reads the request in the line; see [`decode_line`].
    ///
    /// ASSUMED: a line that is too long is answered as an argument of the wrong type (decision 27).
    ///
    /// # Errors
    /// Those of [`decode_line`], and [`Error::ArgumentType`] for a line that is too long.
    pub fn decode(self) -> Result<Option<Request>, Error> {
        match self {
            Line::Text(line) => decode_line(line),
            Line::TooLong => Err(Error::ArgumentType),
        }
    }
}

/// Makes lines of the bytes that a client sends, however they are cut. It holds at most one line.
///
/// CR LF ends a line. ASSUMED: so does a lone CR or a lone LF (decision 27). CR ends it at once; a LF that comes next
/// belongs to that CR, whenever it comes.
///
/// ```
/// use stepdrive_proto::smd3::{Line, LineReader};
///
/// let mut reader = LineReader::new();
/// let mut lines = Vec::new();
/// for mut bytes in [&b"STO"[..], b"P\r", b"\nVMAX\n"] {
///     while let Some(Line::Text(line)) = reader.take(&mut bytes) {
///         lines.push(line.to_vec());
///     }
/// }
/// assert_eq!(lines, [b"STOP", b"VMAX"]);
/// ```
#[derive(Clone)]
pub struct LineReader {
    /// The start of a line whose end has not come.
    bytes: [u8; MAX_LINE],
    /// Its length; beyond [`MAX_LINE`] it is too long, and `bytes` mean nothing.
    len: usize,
    /// The last byte was a CR.
    after_cr: bool,
}

impl LineReader {
    /// A reader at the start of a line.
    pub const fn new() -> LineReader {
        LineReader { bytes: [0; MAX_LINE], len: 0, after_cr: false }
    }

    /// Takes bytes from the start of `bytes` up to the end of a line, or all of them when no line ends there. To be
    /// called until there are no more lines.
    pub fn take<'a, 'b: 'a>(&'a mut self, bytes: &mut &'b [u8]) -> Option<Line<'a>> {
        if let [first, rest @ ..] = *bytes
            && mem::take(&mut self.after_cr)
            && *first == b'\n'
        {
            *bytes = rest;
        }
        let end = bytes.iter().position(|byte| matches!(byte, b'\r' | b'\n')).unwrap_or(bytes.len());
        let (part, rest) = bytes.split_at_checked(end)?;
        let Some((terminator, rest)) = rest.split_first() else {
            self.keep(part);
            *bytes = rest;
            return None;
        };
        self.after_cr = *terminator == b'\r';
        *bytes = rest;
        Some(self.end(part))
    }

    /// How many bytes it holds of a line whose end has not come.
    pub fn held(&self) -> usize {
        self.len.min(MAX_LINE)
    }

    /// Keeps the next part of a line for later.
    fn keep(&mut self, part: &[u8]) {
        let end = self.len.saturating_add(part.len());
        if let Some(room) = self.bytes.get_mut(self.len..end) {
            room.copy_from_slice(part);
        }
        self.len = end.min(MAX_LINE.saturating_add(1));
    }

    /// The line that ends with this part.
    fn end<'a>(&'a mut self, part: &'a [u8]) -> Line<'a> {
        if self.len == 0 && part.len() <= MAX_LINE {
            return Line::Text(part);
        }
        self.keep(part);
        self.bytes.get(..mem::take(&mut self.len)).map_or(Line::TooLong, Line::Text)
    }
}

impl Default for LineReader {
    fn default() -> LineReader {
        LineReader::new()
    }
}

impl fmt::Debug for LineReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let held = self.bytes.get(..self.held()).unwrap_or_default();
        write!(f, "LineReader(\"{}\")", held.escape_ascii())
    }
}
