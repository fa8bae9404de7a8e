//! Requests and replies for people.

use stepdrive_proto::modbus::{Frame, ReplyError, Split, decode_reply, decode_request, split};
use stepdrive_proto::smsd::{self, Framing, Packet, PacketReader, Taken};
use stepdrive_spec::modbus::{Reply, Request, Table};
use stepdrive_spec::smsd::instructions::Instruction;
use stepdrive_spec::smsd::registers::Register;
use stepdrive_spec::smsd::standard::{self, Firmware, Malformed};
use stepdrive_spec::time::Instant;

/// What is spoken on a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tongue {
    /// Modbus TCP.
    Modbus,
    /// The packets of the standard protocol.
    Packets(Framing),
    /// The lines of an SMD3.
    Lines,
}

/// What a request says.
pub(super) fn request(tongue: Tongue, bytes: &[u8]) -> String {
    match (tongue, split(bytes)) {
        (Tongue::Lines, _) => line(bytes),
        (Tongue::Packets(framing), _) => packet(framing, bytes, |packet| match packet_request(packet) {
            Ok(request) => said_request(&request),
            Err(malformed) => format!("type {}: {}", packet.packet_type, malformed.code()),
        }),
        (Tongue::Modbus, Split::Frame { frame, .. }) => {
            let Frame { unit, pdu, .. } = frame;
            match decode_request(pdu) {
                Ok(request) => format!("unit {unit}, {}", modbus_request(&request)),
                Err(refusal) => {
                    format!("unit {unit}, function {:02X}: {}", refusal.function, refusal.exception)
                }
            }
        }
        (Tongue::Modbus, Split::Incomplete { .. } | Split::Foreign { .. } | Split::Broken { .. }) => {
            String::new()
        }
    }
}

/// What a reply to a request says.
pub(super) fn reply(tongue: Tongue, request: &[u8], bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "no reply".to_owned();
    }
    match tongue {
        Tongue::Lines => line(bytes),
        Tongue::Packets(framing) => packet(framing, bytes, |reply| packet_reply(framing, request, reply)),
        Tongue::Modbus => {
            modbus_reply(request, bytes).unwrap_or_else(|| "no Modbus reply to this request".to_owned())
        }
    }
}

/// What the first packet of these bytes says.
fn packet(framing: Framing, bytes: &[u8], say: impl FnOnce(&Packet<'_>) -> String) -> String {
    match PacketReader::new(framing).take(Instant::ZERO, &mut &*bytes) {
        Some(Taken { packet: Ok(packet), .. }) => say(&packet),
        Some(Taken { packet: Err(malformed), .. }) => format!("no packet: {}", malformed.code()),
        None => "no packet".to_owned(),
    }
}

/// The request in a packet, whichever firmware it is for.
fn packet_request(packet: &Packet<'_>) -> Result<standard::Request, Malformed> {
    let request = smsd::decode_request(packet, Firmware::Modbus);
    request.or_else(|malformed| smsd::decode_request(packet, Firmware::Standard).map_err(|_| malformed))
}

/// A request without passwords, which are nobody's business.
fn said_request(request: &standard::Request) -> String {
    let name = request.packet_type().info().name;
    match request {
        standard::Request::Command(word) => match Instruction::from_word(*word) {
            Ok(instruction) => format!("{} {}", instruction.opcode, instruction.position()),
            Err(error) => format!("{word:08X}: {error}"),
        },
        standard::Request::WriteMemory { words, .. } => format!("{name}, {} instructions", words.len()),
        standard::Request::SetLan(lan) => format!("{name}, {lan:?}"),
        standard::Request::Authorise(_)
        | standard::Request::ReadMemory { .. }
        | standard::Request::GetLan
        | standard::Request::SetPassword(_)
        | standard::Request::GetErrors
        | standard::Request::GetVersions => name.to_owned(),
    }
}

fn packet_reply(framing: Framing, request: &[u8], packet: &Packet<'_>) -> String {
    if packet.is_greeting() {
        return "the call to log in".to_owned();
    }
    let mut reader = PacketReader::new(framing);
    let asked = reader.take(Instant::ZERO, &mut &*request);
    let renamed = asked.is_some_and(|asked| asked.id != packet.id);
    // What is no request is answered with a status structure, as this one is.
    let asked = asked.and_then(|asked| packet_request(&asked.packet.ok()?).ok());
    let said = match smsd::decode_reply(packet, &asked.unwrap_or(standard::Request::GetVersions)) {
        Ok(standard::Reply::Response(answer) | standard::Reply::Powerstep01(answer)) => {
            format!("{}, status {:02X}, data {}", answer.code, answer.status.word(), answer.data)
        }
        Ok(standard::Reply::Memory { words, .. }) => format!("{} instructions", words.len()),
        Ok(standard::Reply::Lan(lan)) => format!("{lan:?}"),
        Ok(standard::Reply::Errors(counters)) => format!("{counters:?}"),
        Ok(standard::Reply::Versions(versions)) => format!("{versions:?}"),
        Err(error) => error.to_string(),
    };
    if renamed { format!("{said}, under identification {}", packet.id) } else { said }
}

/// A line as it is typed.
fn line(bytes: &[u8]) -> String {
    bytes.trim_ascii().escape_ascii().to_string()
}

fn modbus_request(request: &Request) -> String {
    match request {
        Request::ReadBits { table, address, count } | Request::ReadWords { table, address, count } => {
            format!("read {count} of {}", place(*table, *address))
        }
        Request::WriteCoil { address, value } => {
            format!("write {} to {}", u8::from(*value), place(Table::Coils, *address))
        }
        Request::WriteRegister { address, value } => {
            format!("write {value} to {}", place(Table::HoldingRegisters, *address))
        }
        Request::WriteCoils { address, values } => {
            format!("write {values:?} to {}", place(Table::Coils, *address))
        }
        Request::WriteRegisters { address, values } => {
            format!("write {:?} to {}", values.as_slice(), place(Table::HoldingRegisters, *address))
        }
    }
}

/// A register as the makers' tables have it: its table, address and name.
fn place(table: Table, address: u16) -> String {
    let name = Register::at(table, address).map(|row| {
        let number = (address - row.address) / row.kind.width();
        format!(" ({})", row.name.replace("{}", &number.to_string()))
    });
    format!("{} {address:04X}{}", table.abbreviation(), name.unwrap_or_default())
}

fn modbus_reply(request: &[u8], reply: &[u8]) -> Option<String> {
    let (Split::Frame { frame: asked, .. }, Split::Frame { frame, .. }) = (split(request), split(reply))
    else {
        return None;
    };
    let Ok(request) = decode_request(asked.pdu) else {
        return Some(format!("function {:02X} refused", frame.pdu.first().copied().unwrap_or(0)));
    };
    let said = match decode_reply(frame.pdu, &request) {
        Ok(Reply::Bits(bits)) => format!("{bits:?}"),
        Ok(Reply::Words(words)) => format!("{:?}", words.as_slice()),
        Ok(Reply::Written) => "written".to_owned(),
        Err(ReplyError::Exception(exception)) => exception.to_string(),
        Err(malformed) => malformed.to_string(),
    };
    let renamed = asked.transaction != frame.transaction;
    Some(if renamed { format!("{said}, under transaction {}", frame.transaction) } else { said })
}
