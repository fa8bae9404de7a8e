//! A packet: its header, its checksum, and whether its bytes are one.

use super::buffer::PacketBuf;
use super::stuffing::Framing;
use stepdrive_spec::smsd::standard::{Code, MAX_DATA, Malformed, PacketType};

/// Bytes before the data (sheet §2).
pub(super) const HEADER: usize = 6;

/// The longest packet in bytes, without start, stop and escapes: header and data.
pub const MAX_PACKET: usize = HEADER + MAX_DATA;

/// A packet whose checksum and length are right (sheet §2). What is in it may be anything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<'a> {
    /// `VER`: the sender's version of the protocol.
    pub version: u8,
    /// `CMD_TYPE`, the code of a [`PacketType`] or another number.
    pub packet_type: u8,
    /// `CMD_IDENTIFICATION`: chosen by the host, and echoed by the controller.
    pub id: u8,
    /// `DATA`, at most [`MAX_DATA`] bytes.
    pub data: &'a [u8],
}

impl Packet<'_> {
    /// Whether it is what the controller sends when a TCP connection is made: a call to log in (sheet §5). Its version is
    /// that of the controller.
    pub const fn is_greeting(&self) -> bool {
        self.packet_type == PacketType::Request.code() && self.data.is_empty()
    }
}

/// `XOR_SUM` of a packet, from the bytes behind it: 0xFF and all of them added modulo 256, every bit inverted (sheet §2).
/// All bytes of a packet, the checksum included, add up to 0, and so have the checksum 0.
pub fn checksum(bytes: &[u8]) -> u8 {
    inverted_sum(bytes.iter())
}

fn inverted_sum<'a>(bytes: impl Iterator<Item = &'a u8>) -> u8 {
    !bytes.fold(0xFF_u8, |sum, byte| sum.wrapping_add(*byte))
}

/// Writes a packet into `buf`. Data beyond [`MAX_DATA`] bytes are left out.
pub fn encode_packet(buf: &mut PacketBuf, framing: Framing, packet: &Packet<'_>) {
    let data = packet.data.get(..MAX_DATA).unwrap_or(packet.data);
    let [low, high] = u16::try_from(data.len()).unwrap_or(u16::MAX).to_le_bytes();
    let header = [packet.version, packet.packet_type, packet.id, low, high];
    let behind_sum = || header.iter().chain(data);
    let sum = inverted_sum(behind_sum());
    buf.replace(framing, [sum].iter().chain(behind_sum()));
}

/// `CMD_IDENTIFICATION` of a packet of these bytes; 0 when they do not get that far.
pub(super) fn id(bytes: &[u8]) -> u8 {
    bytes.get(3).copied().unwrap_or(0)
}

/// `LENGTH_DATA` of a packet of these bytes; `None` when they do not get that far.
pub(super) fn data_length(bytes: &[u8]) -> Option<usize> {
    let &[_, _, _, _, low, high, ..] = bytes else { return None };
    Some(u16::from_le_bytes([low, high]).into())
}

/// The packet of these bytes, which come without start, stop and escapes. `sound` is whether every escape among them was
/// one.
///
/// # Errors
/// The first of these that applies; ASSUMED: in that order.
/// * [`Code::ErrorLen`]: fewer bytes than a header;
/// * [`Code::ErrorXor`]: the checksum is wrong, or not `sound`;
/// * [`Code::ErrorLen`]: another number of bytes of data than the header says.
pub(super) fn decode(bytes: &[u8], sound: bool) -> Result<Packet<'_>, Malformed> {
    let &[_, version, packet_type, id, _, _, ref data @ ..] = bytes else {
        return Err(Malformed::Packet(Code::ErrorLen));
    };
    if !sound || checksum(bytes) != 0 {
        return Err(Malformed::Packet(Code::ErrorXor));
    }
    if data_length(bytes) != Some(data.len()) {
        return Err(Malformed::Packet(Code::ErrorLen));
    }
    Ok(Packet { version, packet_type, id, data })
}
