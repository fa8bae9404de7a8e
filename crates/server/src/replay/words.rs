//! Requests and replies for people.

use stepdrive_proto::modbus::{Frame, ReplyError, Split, decode_reply, decode_request, split};
use stepdrive_rig::line::Family;
use stepdrive_spec::modbus::{Reply, Request, Table};
use stepdrive_spec::smsd::registers::Register;

/// What a request says.
pub(super) fn request(family: Family, bytes: &[u8]) -> String {
    match (family, split(bytes)) {
        (Family::Smd3, _) => line(bytes),
        (Family::Smsd, Split::Frame { frame, .. }) => {
            let Frame { unit, pdu, .. } = frame;
            match decode_request(pdu) {
                Ok(request) => format!("unit {unit}, {}", modbus_request(&request)),
                Err(refusal) => {
                    format!("unit {unit}, function {:02X}: {}", refusal.function, refusal.exception)
                }
            }
        }
        (Family::Smsd, Split::Incomplete { .. } | Split::Foreign { .. } | Split::Broken { .. }) => {
            String::new()
        }
    }
}

/// What a reply to a request says.
pub(super) fn reply(family: Family, request: &[u8], bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "no reply".to_owned();
    }
    match family {
        Family::Smd3 => line(bytes),
        Family::Smsd => {
            modbus_reply(request, bytes).unwrap_or_else(|| "no Modbus reply to this request".to_owned())
        }
    }
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
