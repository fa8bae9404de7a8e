//! Where one packet of a stream ends and the next begins, on either end.

use super::packet::{self, HEADER, MAX_PACKET, Packet};
use super::stuffing::{ESCAPE, Framing, START, STOP, unescape};
use core::fmt;
use stepdrive_spec::smsd::standard::{Code, HALF_PACKET_TIMEOUT, MAX_DATA, Malformed};
use stepdrive_spec::time::Instant;

/// What came as a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken<'a> {
    /// `CMD_IDENTIFICATION`, also of what is no packet; 0 when it ended before.
    pub id: u8,
    /// The packet, or why it is none: always [`Malformed::Packet`].
    pub packet: Result<Packet<'a>, Malformed>,
    /// Its bytes without start, stop and escapes, at most [`MAX_PACKET`]; of a packet that is too long, the first ones.
    pub raw: &'a [u8],
}

/// Makes packets of the bytes that come on a line, however they are cut. It holds at most one packet, and after bytes that
/// are none it finds the next one.
///
/// * [`Framing::Stuffed`]: what is outside a packet is skipped, and so is a packet in which another one starts. What ends
///   is taken. ASSUMED: an escape that stands before none of the three bytes, or before the stop byte, is answered as a
///   wrong checksum.
/// * [`Framing::Raw`]: a length that cannot be true is told once; ASSUMED: then everything is skipped until nothing has
///   come for [`HALF_PACKET_TIMEOUT`].
///
/// On both, the start of a packet after which nothing comes for [`HALF_PACKET_TIMEOUT`] is dropped (decision 25).
///
/// ```
/// use stepdrive_proto::smsd::{Framing, PacketReader};
/// use stepdrive_spec::time::Instant;
///
/// let mut reader = PacketReader::new(Framing::Stuffed);
/// let mut ids = Vec::new();
/// for mut bytes in [&b"\xFA\xF1\x02"[..], b"\x0E\xFF\0", b"\0\xFB"] {
///     while let Some(taken) = reader.take(Instant::ZERO, &mut bytes) {
///         assert!(taken.packet.is_ok());
///         ids.push(taken.id);
///     }
/// }
/// assert_eq!(ids, [0xFF]);
/// ```
#[derive(Clone)]
pub struct PacketReader {
    framing: Framing,
    place: Place,
    /// Every escape in the packet so far was one.
    sound: bool,
    /// The packet so far, without escapes.
    bytes: [u8; MAX_PACKET],
    /// Its length; beyond [`MAX_PACKET`] it is too long.
    len: usize,
    /// When the last byte came; means nothing outside a packet.
    last: Instant,
}

/// Where in the stream the next byte stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Before a packet.
    Outside,
    /// In one.
    Inside,
    /// In one, behind an escape byte.
    Escaped,
    /// Among bytes of which nobody can tell where a packet begins.
    Lost,
}

impl PacketReader {
    /// A reader at the start of a stream.
    pub const fn new(framing: Framing) -> PacketReader {
        PacketReader {
            framing,
            place: Place::Outside,
            sound: true,
            bytes: [0; MAX_PACKET],
            len: 0,
            last: Instant::ZERO,
        }
    }

    /// Takes bytes, which have come at `now`, from the start of `bytes` up to the end of a packet, or all of them when no
    /// packet ends there. To be called until there are no more packets.
    ///
    /// Half a packet that is overdue is dropped first; to know about it, call [`PacketReader::expire`] before.
    pub fn take<'a>(&'a mut self, now: Instant, bytes: &mut &[u8]) -> Option<Taken<'a>> {
        if bytes.is_empty() {
            return None;
        }
        self.expire(now);
        self.last = now;
        match self.framing {
            Framing::Stuffed => self.take_stuffed(bytes),
            Framing::Raw => self.take_raw(bytes),
        }
    }

    /// Drops what was begun when nothing has come since for [`HALF_PACKET_TIMEOUT`]. True when that was half a packet; not
    /// when it was bytes to be skipped on a raw line.
    pub fn expire(&mut self, now: Instant) -> bool {
        if self.deadline().is_none_or(|deadline| now < deadline) {
            return false;
        }
        let half_packet = self.place != Place::Lost;
        self.begin(Place::Outside);
        half_packet
    }

    /// When [`PacketReader::expire`] would drop what was begun; `None` when nothing was.
    #[allow(clippy::arithmetic_side_effects, reason = "instants saturate")]
    pub fn deadline(&self) -> Option<Instant> {
        (!self.is_empty()).then(|| self.last + HALF_PACKET_TIMEOUT)
    }

    /// Whether the next byte stands outside any packet, and is not to be skipped on a raw line.
    pub fn is_empty(&self) -> bool {
        self.place == Place::Outside
    }

    fn take_stuffed(&mut self, bytes: &mut &[u8]) -> Option<Taken<'_>> {
        while let Some((&byte, rest)) = bytes.split_first() {
            *bytes = rest;
            match (self.place, byte) {
                (_, START) => self.begin(Place::Inside),
                (Place::Outside | Place::Lost, _) => {}
                (Place::Inside, STOP) => return Some(self.end()),
                (Place::Escaped, STOP) => {
                    self.sound = false;
                    return Some(self.end());
                }
                (Place::Inside, ESCAPE) => self.place = Place::Escaped,
                (Place::Inside, _) => self.keep(&[byte]),
                (Place::Escaped, _) => self.keep_escaped(byte),
            }
        }
        None
    }

    fn take_raw(&mut self, bytes: &mut &[u8]) -> Option<Taken<'_>> {
        if self.place == Place::Lost {
            *bytes = &[];
            return None;
        }
        self.place = Place::Inside;
        self.fill(HEADER, bytes);
        let length = packet::data_length(self.held())?;
        if length > MAX_DATA {
            return Some(self.lose());
        }
        let size = HEADER.saturating_add(length);
        self.fill(size, bytes);
        (self.len == size).then(|| self.end())
    }

    /// Starts anew, without bytes.
    fn begin(&mut self, place: Place) {
        self.place = place;
        self.sound = true;
        self.len = 0;
    }

    /// Keeps the next bytes of the packet.
    fn keep(&mut self, part: &[u8]) {
        let end = self.len.saturating_add(part.len());
        if let Some(room) = self.bytes.get_mut(self.len..end) {
            room.copy_from_slice(part);
        }
        self.len = end.min(MAX_PACKET.saturating_add(1));
    }

    /// Keeps the byte for which this one stands behind an escape byte.
    fn keep_escaped(&mut self, byte: u8) {
        let original = unescape(byte);
        self.sound &= original.is_some();
        self.keep(&[original.unwrap_or(byte)]);
        self.place = Place::Inside;
    }

    /// Takes bytes until it holds `size`, or all of them.
    fn fill(&mut self, size: usize, bytes: &mut &[u8]) {
        let missing = size.saturating_sub(self.len).min(bytes.len());
        if let Some((part, rest)) = bytes.split_at_checked(missing) {
            self.keep(part);
            *bytes = rest;
        }
    }

    /// The bytes that it holds.
    fn held(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&self.bytes)
    }

    /// The packet that has ended.
    fn end(&mut self) -> Taken<'_> {
        let (len, sound) = (self.len, self.sound);
        self.begin(Place::Outside);
        let Some(raw) = self.bytes.get(..len) else {
            return no_packet(&self.bytes);
        };
        Taken { id: packet::id(raw), packet: packet::decode(raw, sound), raw }
    }

    /// The header after which nobody can tell where the next packet begins.
    fn lose(&mut self) -> Taken<'_> {
        let len = self.len;
        self.begin(Place::Lost);
        no_packet(self.bytes.get(..len).unwrap_or_default())
    }
}

/// The start of what is too long for a packet.
fn no_packet(raw: &[u8]) -> Taken<'_> {
    Taken { id: packet::id(raw), packet: Err(Malformed::Packet(Code::ErrorLen)), raw }
}

impl fmt::Debug for PacketReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PacketReader({:?}, {:?}, {:02X?})", self.framing, self.place, self.held())
    }
}
