//! Framing: where one ADU ends and the next begins, and the buffer in which one is built.

use core::fmt;
use core::ops::{Deref, RangeInclusive};

/// The longest ADU in bytes: 7 of header and 253 of PDU (Messaging Guide §3.1.2, Application Protocol §4.1).
pub const MAX_ADU: usize = 260;

/// Bytes up to the end of the length field, from where the length counts.
const LENGTH_END: usize = 6;
/// What the length field may say: the unit and at least a function code; the unit and at most 253 bytes of PDU.
const LENGTHS: RangeInclusive<u16> = 2..=254;
/// The protocol identifier of Modbus (Messaging Guide §3.1.3).
const MODBUS: u16 = 0;

/// A Modbus TCP frame whose bytes are all there (Messaging Guide §3.1.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Chosen by the client; the server copies it into the reply.
    pub transaction: u16,
    /// Which controller is meant; the server copies it into the reply.
    pub unit: u8,
    /// Function code and data, 1 to 253 bytes.
    pub pdu: &'a [u8],
}

/// What stands at the start of a stream of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split<'a> {
    /// The frame is not complete. Nothing can be said before `needed` bytes are there, counted from the start of the
    /// frame; `needed` is more than there are now and at most [`MAX_ADU`].
    Incomplete {
        /// Bytes from the start of the frame.
        needed: usize,
    },
    /// A frame.
    Frame {
        /// Its parts.
        frame: Frame<'a>,
        /// Bytes it took, header included; the next frame begins there.
        size: usize,
    },
    /// A frame of another protocol, to be passed over without an answer (Messaging Guide §4.4.2).
    Foreign {
        /// Its protocol identifier, not 0.
        protocol: u16,
        /// Bytes it took, header included; the next frame begins there.
        size: usize,
    },
    /// The length field cannot be true. Nobody can tell where the next frame begins: the connection has to be closed.
    Broken {
        /// What the length field says; not 2 to 254.
        length: u16,
    },
}

/// Looks for the frame at the start of `bytes`, which may hold less than one frame, or several.
///
/// A false length is told as soon as the length field is there, whatever protocol the frame claims to be of.
pub fn split(bytes: &[u8]) -> Split<'_> {
    let &[t0, t1, p0, p1, l0, l1, ref rest @ ..] = bytes else {
        return Split::Incomplete { needed: LENGTH_END };
    };
    let length = u16::from_be_bytes([l0, l1]);
    if !LENGTHS.contains(&length) {
        return Split::Broken { length };
    }
    let size = LENGTH_END.saturating_add(usize::from(length));
    let Some((&unit, pdu)) = rest.get(..usize::from(length)).and_then(<[u8]>::split_first) else {
        return Split::Incomplete { needed: size };
    };
    match u16::from_be_bytes([p0, p1]) {
        MODBUS => {
            Split::Frame { frame: Frame { transaction: u16::from_be_bytes([t0, t1]), unit, pdu }, size }
        }
        protocol => Split::Foreign { protocol, size },
    }
}

/// The bytes of one ADU to be sent. Every encoder replaces what was in it, so one buffer serves a connection for ever.
///
/// It dereferences to the bytes.
#[derive(Clone)]
pub struct Adu {
    bytes: [u8; MAX_ADU],
    len: usize,
}

impl Adu {
    /// A buffer without bytes.
    pub const fn new() -> Adu {
        Adu { bytes: [0; MAX_ADU], len: 0 }
    }

    /// Empties the buffer and writes the header and the function code. [`Adu::finish`] fills in the length.
    pub(super) fn begin(&mut self, transaction: u16, unit: u8, function: u8) {
        self.len = 0;
        self.put_word(transaction);
        self.put_word(MODBUS);
        self.put_word(0);
        self.put(&[unit, function]);
    }

    /// Appends a number of 16 bits.
    pub(super) fn put_word(&mut self, word: u16) {
        self.put(&word.to_be_bytes());
    }

    /// Appends bytes.
    pub(super) fn put(&mut self, bytes: &[u8]) {
        for (slot, byte) in self.grow(bytes.len()).iter_mut().zip(bytes) {
            *slot = *byte;
        }
    }

    /// Appends a byte count and then the bytes.
    pub(super) fn put_counted(&mut self, bytes: &[u8]) {
        self.put(&[byte_count(bytes.len())]);
        self.put(bytes);
    }

    /// Appends a byte count and then the words.
    pub(super) fn put_counted_words(&mut self, words: &[u16]) {
        let size = words.len().saturating_mul(2);
        self.put(&[byte_count(size)]);
        let (slots, _) = self.grow(size).as_chunks_mut();
        for (slot, word) in slots.iter_mut().zip(words) {
            *slot = word.to_be_bytes();
        }
    }

    /// Writes the length field; the ADU is then complete.
    pub(super) fn finish(&mut self) {
        let length = u16::try_from(self.len.saturating_sub(LENGTH_END)).unwrap_or(u16::MAX);
        let [_, _, _, _, high, low, ..] = &mut self.bytes;
        [*high, *low] = length.to_be_bytes();
    }

    /// Makes the ADU longer and hands out the new part. All PDUs of this crate have at most 252 bytes, so there always
    /// is room; without room the part would be empty.
    fn grow(&mut self, size: usize) -> &mut [u8] {
        let end = self.len.saturating_add(size);
        match self.bytes.get_mut(self.len..end) {
            Some(part) => {
                self.len = end;
                part
            }
            None => &mut [],
        }
    }
}

/// The byte count field for `size` bytes of data; there are at most 250.
fn byte_count(size: usize) -> u8 {
    u8::try_from(size).unwrap_or(u8::MAX)
}

impl Deref for Adu {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&self.bytes)
    }
}

impl Default for Adu {
    fn default() -> Adu {
        Adu::new()
    }
}

impl PartialEq for Adu {
    fn eq(&self, other: &Adu) -> bool {
        **self == **other
    }
}

impl Eq for Adu {}

impl fmt::Debug for Adu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Adu({:02X?})", &**self)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    //                          transaction protocol    length      unit  pdu
    const READ: [u8; 12] = [0x12, 0x34, 0x00, 0x00, 0x00, 0x06, 0x01, 0x03, 0x10, 0x00, 0x00, 0x02];
    //                             transaction protocol    length      unit  pdu
    const FOREIGN: [u8; 10] = [0x00, 0x01, 0x00, 0x05, 0x00, 0x04, 0x01, 0xAA, 0xBB, 0xCC];

    #[test]
    fn a_whole_frame_is_split_into_its_parts() {
        let frame = Frame { transaction: 0x1234, unit: 1, pdu: &[0x03, 0x10, 0x00, 0x00, 0x02] };
        assert_eq!(split(&READ), Split::Frame { frame, size: 12 });
    }

    #[test]
    fn bytes_behind_a_frame_are_left_for_the_next_call() {
        let two = [READ, READ].concat();
        assert!(matches!(split(&two), Split::Frame { size: 12, .. }));
    }

    #[test]
    fn a_cut_frame_needs_the_length_field_first_and_then_its_whole_size() {
        for cut in 0..6 {
            assert_eq!(split(&READ[..cut]), Split::Incomplete { needed: 6 }, "{cut} bytes");
        }
        for cut in 6..12 {
            assert_eq!(split(&READ[..cut]), Split::Incomplete { needed: 12 }, "{cut} bytes");
        }
    }

    #[test]
    fn a_frame_of_another_protocol_is_passed_over_once_it_is_whole() {
        assert_eq!(split(&FOREIGN[..9]), Split::Incomplete { needed: 10 });
        assert_eq!(split(&FOREIGN), Split::Foreign { protocol: 5, size: 10 });
    }

    #[test]
    fn a_length_that_cannot_be_true_is_told_as_soon_as_it_is_there() {
        for length in [0, 1, 255, 256, 0xFFFF] {
            let [high, low] = u16::to_be_bytes(length);
            assert_eq!(split(&[0, 0, 0, 0, high, low]), Split::Broken { length });
            assert_eq!(split(&[0, 0, 0, 5, high, low]), Split::Broken { length });
        }
    }

    #[test]
    fn the_shortest_and_the_longest_frame_are_frames() {
        assert!(matches!(split(&[0, 0, 0, 0, 0, 2, 1, 0x2B]), Split::Frame { size: 8, .. }));
        let mut longest = [0; MAX_ADU];
        longest[5] = 254;
        assert!(matches!(split(&longest), Split::Frame { size: MAX_ADU, .. }));
    }

    #[test]
    fn an_adu_shows_its_bytes_and_compares_by_them() {
        let mut adu = Adu::new();
        adu.begin(1, 1, 3);
        adu.finish();
        assert_eq!(std::format!("{adu:?}"), "Adu([00, 01, 00, 00, 00, 02, 01, 03])");
        assert_ne!(adu, Adu::default());
        assert_eq!(adu, adu.clone());
    }
}
