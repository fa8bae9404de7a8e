//! The buffer in which a packet is built.

use super::packet::MAX_PACKET;
use super::stuffing::{ESCAPE, Framing, START, STOP, escape};
use arrayvec::ArrayVec;
use core::fmt;
use core::ops::Deref;

/// What fits: the longest packet with every byte escaped, between start and stop byte.
const CAPACITY: usize = 2 * MAX_PACKET + 2;

/// The bytes of one packet to be sent, as they go onto the line. Every encoder replaces what was in it, so one buffer
/// serves a line for ever.
///
/// It dereferences to the bytes.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct PacketBuf {
    bytes: ArrayVec<u8, CAPACITY>,
}

impl PacketBuf {
    /// A buffer without bytes.
    pub const fn new() -> PacketBuf {
        PacketBuf { bytes: ArrayVec::new_const() }
    }

    /// Empties the buffer.
    pub fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Puts a packet of these bytes, at most [`MAX_PACKET`], in the place of what was in it.
    pub(super) fn replace<'a>(&mut self, framing: Framing, packet: impl Iterator<Item = &'a u8>) {
        self.clear();
        match framing {
            Framing::Raw => packet.for_each(|byte| self.put(*byte)),
            Framing::Stuffed => {
                self.put(START);
                packet.for_each(|byte| self.put_stuffed(*byte));
                self.put(STOP);
            }
        }
    }

    fn put_stuffed(&mut self, byte: u8) {
        if let Some(escaped) = escape(byte) {
            self.put(ESCAPE);
            self.put(escaped);
        } else {
            self.put(byte);
        }
    }

    /// Appends a byte. There always is room; without room it would be left out.
    fn put(&mut self, byte: u8) {
        let _ = self.bytes.try_push(byte);
    }
}

impl Deref for PacketBuf {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes
    }
}

impl fmt::Debug for PacketBuf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PacketBuf({:02X?})", &**self)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    #[test]
    fn a_buffer_shows_its_bytes_and_compares_by_them() {
        let mut buf = PacketBuf::new();
        buf.replace(Framing::Stuffed, [0x01, 0xFA].iter());
        assert_eq!(std::format!("{buf:?}"), "PacketBuf([FA, 01, FE, 7A, FB])");
        assert_eq!(buf, buf.clone());
        assert_ne!(buf, PacketBuf::default());
    }

    #[test]
    fn the_longest_packet_has_room_with_every_byte_escaped() {
        let mut buf = PacketBuf::new();
        buf.replace(Framing::Stuffed, [ESCAPE; MAX_PACKET].iter());
        assert_eq!(buf.len(), CAPACITY);
        assert!(buf.ends_with(&[ESCAPE, 0x7E, STOP]));
        buf.clear();
        assert!(buf.is_empty());
    }
}
