//! Replies: what a controller writes and a host reads.

use super::buffer::PacketBuf;
use super::data::{self, Data};
use super::packet::{Packet, encode_packet};
use super::stuffing::Framing;
use core::fmt;
use stepdrive_spec::smsd::standard::{Answer, COUNTERS, Code, PacketType, Reply, Request, Versions};
use stepdrive_spec::smsd::status::Status;

/// Writes a packet with the reply into `buf`. `version` is the controller's own, `id` the one of the request. Memory areas
/// above 3 count as 3.
pub fn encode_reply(buf: &mut PacketBuf, framing: Framing, version: u8, id: u8, reply: &Reply) {
    let mut data = Data::default();
    match reply {
        Reply::Response(answer) | Reply::Powerstep01(answer) => put_answer(&mut data, answer),
        Reply::Memory { words, .. } => data.put_u32s(words),
        Reply::Lan(lan) => data.put_lan(lan),
        Reply::Errors(counters) => data.put_u32s(counters),
        Reply::Versions(versions) => put_versions(&mut data, versions),
    }
    encode_packet(buf, framing, &data.packet(version, packet_type(reply).code(), id));
}

/// Writes what the controller sends first on a TCP connection into `buf`, raw: a call to log in, whose version tells the
/// host that of the controller (sheet §5).
pub fn encode_greeting(buf: &mut PacketBuf, version: u8) {
    let greeting = Packet { version, packet_type: PacketType::Request.code(), id: 0, data: &[] };
    encode_packet(buf, Framing::Raw, &greeting);
}

/// Reads the reply to `request` in a packet. Whether the identification is that of the request is for the caller to
/// compare.
///
/// A status structure may come for any request, as [`Reply::Response`] or [`Reply::Powerstep01`]: real controllers do not
/// agree on which (sheet §4). Anything else has to have the type of the request. LAN parameters have a unit identifier
/// when they are as long as those that do. The upper byte of the status is reserved and ignored.
///
/// # Errors
/// When the packet is no reply to the request.
pub fn decode_reply(packet: &Packet<'_>, request: &Request) -> Result<Reply, ReplyError> {
    let found = packet.packet_type;
    if found == PacketType::Response.code() {
        return answer(packet.data).map(Reply::Response);
    }
    if found == PacketType::Powerstep01.code() {
        return answer(packet.data).map(Reply::Powerstep01);
    }
    let values = if found == request.packet_type().code() { values(request, packet.data) } else { None };
    values.unwrap_or(Err(ReplyError::Type { found }))
}

/// Why a packet is no reply to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyError {
    /// Its type is not one that answers the request.
    Type {
        /// `CMD_TYPE` of the packet.
        found: u8,
    },
    /// The data are too short or too long.
    Length {
        /// What the data are to be.
        expected: &'static str,
        /// Bytes that they have.
        found: usize,
    },
    /// `ERROR_OR_COMMAND` is a number that nobody has described.
    UnknownCode {
        /// The number.
        code: u8,
        /// The status that came with it.
        status: Status,
        /// `RETURN_DATA` that came with it.
        data: u32,
    },
}

impl fmt::Display for ReplyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ReplyError::Type { found } => match PacketType::from_code(*found) {
                Some(known) => write!(
                    f,
                    "the reply is a packet of type {found}, {}, which does not answer the request",
                    known.info().name
                ),
                None => write!(f, "the reply is a packet of unknown type, {found}"),
            },
            ReplyError::Length { expected, found } => {
                write!(f, "the reply has {found} bytes of data, and {expected} were expected")
            }
            ReplyError::UnknownCode { code, .. } => {
                write!(
                    f,
                    "the reply has an unknown code, {code}: the controller may be newer than this driver"
                )
            }
        }
    }
}

impl core::error::Error for ReplyError {}

/// The type of the packet that carries a reply.
fn packet_type(reply: &Reply) -> PacketType {
    match reply {
        Reply::Response(_) => PacketType::Response,
        Reply::Powerstep01(_) => PacketType::Powerstep01,
        Reply::Memory { area, .. } => Request::ReadMemory { area: *area }.packet_type(),
        Reply::Lan(_) => PacketType::ConfigGet,
        Reply::Errors(_) => PacketType::ErrorGet,
        Reply::Versions(_) => PacketType::VersionGet,
    }
}

/// The values that a request reads; `None` when it is answered with a status structure only.
fn values(request: &Request, data: &[u8]) -> Option<Result<Reply, ReplyError>> {
    let (reply, expected) = match request {
        Request::ReadMemory { area } => {
            let memory = |words| Reply::Memory { area: *area, words };
            (data::words(data).map(memory), "at most 1020, a multiple of 4,")
        }
        Request::GetLan => (data::lan(data).map(Reply::Lan), "25 or 26"),
        Request::GetErrors => (counters(data).map(Reply::Errors), "68"),
        Request::GetVersions => (versions(data).map(Reply::Versions), "9"),
        Request::Authorise(_)
        | Request::Command(_)
        | Request::WriteMemory { .. }
        | Request::SetLan(_)
        | Request::SetPassword(_) => return None,
    };
    Some(reply.ok_or(ReplyError::Length { expected, found: data.len() }))
}

/// Reads a status structure (sheet §6).
fn answer(data: &[u8]) -> Result<Answer, ReplyError> {
    let &[low, high, code, d0, d1, d2, d3] = data else {
        return Err(ReplyError::Length { expected: "7", found: data.len() });
    };
    let status = Status::from_word(u16::from_le_bytes([low, high]));
    let data = u32::from_le_bytes([d0, d1, d2, d3]);
    let code = Code::from_number(code).ok_or(ReplyError::UnknownCode { code, status, data })?;
    Ok(Answer { status, code, data })
}

fn put_answer(data: &mut Data, answer: &Answer) {
    data.put_u16(answer.status.word());
    data.put(&[answer.code.number()]);
    data.put_u32s(&[answer.data]);
}

fn counters(data: &[u8]) -> Option<[u32; COUNTERS]> {
    data::words(data)?.as_slice().try_into().ok()
}

fn versions(data: &[u8]) -> Option<Versions> {
    let &[h0, h1, h2, h3, f0, f1, f2, f3, protocol] = data else { return None };
    let pair = |low: [u8; 2], high: [u8; 2]| [u16::from_le_bytes(low), u16::from_le_bytes(high)];
    Some(Versions { hardware: pair([h0, h1], [h2, h3]), firmware: pair([f0, f1], [f2, f3]), protocol })
}

fn put_versions(data: &mut Data, versions: &Versions) {
    versions.hardware.iter().chain(&versions.firmware).for_each(|number| data.put_u16(*number));
    data.put(&[versions.protocol]);
}
