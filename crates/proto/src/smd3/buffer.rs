//! The buffer in which a line is built.

use super::reader::MAX_LINE;
use super::{TERMINATOR, float};
use core::fmt::{self, Write};
use core::ops::Deref;

/// What fits: a line and its terminator.
const CAPACITY: usize = MAX_LINE + TERMINATOR.len();

/// The bytes of one request or reply to be sent. Every encoder replaces what was in it, so one buffer serves a port for
/// ever.
///
/// It dereferences to the bytes.
#[derive(Clone)]
pub struct LineBuf {
    bytes: [u8; CAPACITY],
    len: usize,
}

impl LineBuf {
    /// A buffer without bytes.
    pub const fn new() -> LineBuf {
        LineBuf { bytes: [0; CAPACITY], len: 0 }
    }

    /// Empties the buffer.
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    /// Appends bytes. All lines of this crate are shorter than [`MAX_LINE`]; what did not fit would be left out.
    pub(super) fn put(&mut self, bytes: &[u8]) {
        let end = self.len.saturating_add(bytes.len());
        if let Some(room) = self.bytes.get_mut(self.len..end) {
            room.copy_from_slice(bytes);
            self.len = end;
        }
    }

    /// Appends what the value displays as.
    pub(super) fn put_display(&mut self, value: impl fmt::Display) {
        // `write_str` below does not fail.
        let _ = write!(self, "{value}");
    }

    /// Appends 0 or 1.
    pub(super) fn put_bit(&mut self, bit: bool) {
        self.put(if bit { b"1" } else { b"0" });
    }

    /// Appends `+` or `-`.
    pub(super) fn put_sign(&mut self, positive: bool) {
        self.put(if positive { b"+" } else { b"-" });
    }

    /// Appends a set of flags: `0x` and four digits (manual, *Argument types*).
    pub(super) fn put_hex(&mut self, bits: u16) {
        let digit = |shift: u8| {
            let nibble = bits.checked_shr(shift.into()).unwrap_or(0) & 0xF;
            b"0123456789ABCDEF".get(usize::from(nibble)).copied().unwrap_or(b'0')
        };
        self.put(&[b'0', b'x', digit(12), digit(8), digit(4), digit(0)]);
    }

    /// Appends a number in scientific format.
    pub(super) fn put_float(&mut self, value: f64) {
        float::put(self, value);
    }

    /// Appends the terminator; the line is then complete.
    pub(super) fn finish(&mut self) {
        self.put(TERMINATOR);
    }
}

impl Write for LineBuf {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.put(text.as_bytes());
        Ok(())
    }
}

impl Deref for LineBuf {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&self.bytes)
    }
}

impl Default for LineBuf {
    fn default() -> LineBuf {
        LineBuf::new()
    }
}

impl PartialEq for LineBuf {
    fn eq(&self, other: &LineBuf) -> bool {
        **self == **other
    }
}

impl Eq for LineBuf {}

impl fmt::Debug for LineBuf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "LineBuf(\"{}\")", self.escape_ascii())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    #[test]
    fn a_buffer_shows_its_bytes_and_compares_by_them() {
        let mut line = LineBuf::new();
        line.put_hex(0x01AF);
        line.finish();
        assert_eq!(std::format!("{line:?}"), r#"LineBuf("0x01AF\r\n")"#);
        assert_eq!(line, line.clone());
        assert_ne!(line, LineBuf::default());
    }

    #[test]
    fn what_does_not_fit_is_left_out() {
        let mut line = LineBuf::new();
        line.put(&[b'x'; MAX_LINE]);
        line.put(b"abc");
        line.finish();
        assert_eq!(line.len(), CAPACITY);
        assert!(line.ends_with(b"x\r\n"));
    }
}
