//! Requests: what a controller reads and a host writes.

use super::buffer::PacketBuf;
use super::data::{self, Data};
use super::packet::{Packet, encode_packet};
use super::stuffing::Framing;
use stepdrive_spec::smsd::standard::{Code, Firmware, Malformed, PacketType, Request};

/// Reads the request in a packet. The version of the packet may be any (sheet §5). Whether the values are in range is for
/// the controller to say; the firmware decides how long LAN parameters are.
///
/// # Errors
/// [`Malformed::Content`], of an attempt to log in [`Malformed::Packet`] (decision 25), with
/// * [`Code::ErrorNoCommand`]: there is no such type, or it is the one that is not for hosts;
/// * [`Code::ErrorLen`]: the data are not as long as the type has them.
pub fn decode_request(packet: &Packet<'_>, firmware: Firmware) -> Result<Request, Malformed> {
    let packet_type =
        PacketType::from_code(packet.packet_type).filter(|known| *known != PacketType::Response);
    let packet_type = packet_type.ok_or(Malformed::Content(Code::ErrorNoCommand))?;
    let is_log_in = packet_type == PacketType::Request;
    let wrong = if is_log_in { Malformed::Packet } else { Malformed::Content };
    request(packet_type, packet.data, firmware).ok_or(wrong(Code::ErrorLen))
}

/// Writes a packet with the request into `buf`.
pub fn encode_request(buf: &mut PacketBuf, framing: Framing, version: u8, id: u8, request: &Request) {
    let mut data = Data::default();
    match request {
        Request::Authorise(password) | Request::SetPassword(password) => data.put(&password.to_le_bytes()),
        Request::Command(word) => data.put_u32s(&[*word]),
        Request::WriteMemory { words, .. } => data.put_u32s(words),
        Request::SetLan(lan) => data.put_lan(lan),
        Request::ReadMemory { .. } | Request::GetLan | Request::GetErrors | Request::GetVersions => {}
    }
    encode_packet(buf, framing, &data.packet(version, request.packet_type().code(), id));
}

/// The request of this type; `None` when the data are not as long as the type has them.
fn request(packet_type: PacketType, data: &[u8], firmware: Firmware) -> Option<Request> {
    match packet_type {
        PacketType::Request => password(data).map(Request::Authorise),
        PacketType::Powerstep01 => data.try_into().ok().map(u32::from_le_bytes).map(Request::Command),
        PacketType::WriteMem0 => write_memory(0, data),
        PacketType::WriteMem1 => write_memory(1, data),
        PacketType::WriteMem2 => write_memory(2, data),
        PacketType::WriteMem3 => write_memory(3, data),
        PacketType::ReadMem0 => bare(data, Request::ReadMemory { area: 0 }),
        PacketType::ReadMem1 => bare(data, Request::ReadMemory { area: 1 }),
        PacketType::ReadMem2 => bare(data, Request::ReadMemory { area: 2 }),
        PacketType::ReadMem3 => bare(data, Request::ReadMemory { area: 3 }),
        PacketType::ConfigSet if data.len() != firmware.lan_size() => None,
        PacketType::ConfigSet => data::lan(data).map(Request::SetLan),
        PacketType::ConfigGet => bare(data, Request::GetLan),
        PacketType::PasswordSet => password(data).map(Request::SetPassword),
        PacketType::ErrorGet => bare(data, Request::GetErrors),
        PacketType::VersionGet => bare(data, Request::GetVersions),
        PacketType::Response => None,
    }
}

fn password(data: &[u8]) -> Option<u64> {
    data.try_into().ok().map(u64::from_le_bytes)
}

fn write_memory(area: u8, data: &[u8]) -> Option<Request> {
    data::words(data).map(|words| Request::WriteMemory { area, words })
}

/// A request that has no data.
fn bare(data: &[u8], request: Request) -> Option<Request> {
    data.is_empty().then_some(request)
}
