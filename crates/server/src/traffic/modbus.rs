//! Modbus in words: `FC03 read ABS_POS, SPEED`, `FC06 CMD = MOVE_F`.

use super::words::Meaning;
use stepdrive_drive::smsd::WordOrder;
use stepdrive_proto::modbus::{Frame, ReplyError, Split, decode_reply, decode_request, split};
use stepdrive_spec::modbus::{Reply, Request, Table};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::{Access, Kind, Limits, Reg, Register};
use stepdrive_spec::smsd::status::{MotStatus, Status};

/// The most registers of a request or reply that are named.
const MOST_NAMED: usize = 12;

/// A request in a frame, and the reply to it in another.
pub(crate) fn meanings(order: WordOrder, request: &[u8], reply: &[u8]) -> (Meaning, Meaning) {
    let Split::Frame { frame, .. } = split(request) else {
        return (Meaning::bad("no Modbus frame"), Meaning::bad("a reply to no frame"));
    };
    match decode_request(frame.pdu) {
        Ok(asked) => {
            (Meaning::good(request_text(order, &asked)), reply_meaning(order, &frame, &asked, reply))
        }
        Err(refusal) => {
            let function = frame.pdu.first().copied().unwrap_or(0);
            let answer = Meaning::bad(format!("FC{function:02X} {}", refusal.exception));
            (Meaning::bad(format!("FC{function:02X}, not well formed")), answer)
        }
    }
}

fn request_text(order: WordOrder, request: &Request) -> String {
    let function = request.function();
    let (table, address) = place(request);
    let said = match request {
        Request::ReadBits { count, .. } | Request::ReadWords { count, .. } => {
            format!(
                "read {}",
                listed(Cells { table, order, address, end: end(address, *count) }.map(|cell| cell.name))
            )
        }
        Request::WriteCoil { value, .. } => values(order, table, address, &[u16::from(*value)]),
        Request::WriteRegister { value, .. } => values(order, table, address, &[*value]),
        Request::WriteCoils { values: bits, .. } => {
            values(order, table, address, &bits.iter().map(u16::from).collect::<Vec<u16>>())
        }
        Request::WriteRegisters { values: words, .. } => values(order, table, address, words),
    };
    format!("FC{function:02X} {said}")
}

fn reply_meaning(order: WordOrder, asked: &Frame<'_>, request: &Request, reply: &[u8]) -> Meaning {
    let Split::Frame { frame, size } = split(reply) else { return Meaning::bad("no Modbus frame") };
    if frame.transaction != asked.transaction {
        let (found, expected) = (frame.transaction, asked.transaction);
        return Meaning::bad(format!("a reply with transaction {found:#06X}, not {expected:#06X}"));
    }
    let (table, address) = place(request);
    let text = match decode_reply(frame.pdu, request) {
        Ok(Reply::Words(words)) => values(order, table, address, &words),
        Ok(Reply::Bits(bits)) => {
            values(order, table, address, &bits.iter().map(u16::from).collect::<Vec<u16>>())
        }
        Ok(Reply::Written) => format!("FC{:02X} written", request.function()),
        Err(ReplyError::Exception(exception)) => {
            return Meaning::bad(format!("FC{:02X} {exception}", request.function()));
        }
        Err(error) => return Meaning::bad(error.to_string()),
    };
    match reply.len() - size {
        0 => Meaning::good(text),
        more => Meaning::bad(format!("{text}, and {more} more bytes")),
    }
}

/// Where what a request is about begins.
fn place(request: &Request) -> (Table, u16) {
    match request {
        Request::ReadBits { table, address, .. } | Request::ReadWords { table, address, .. } => {
            (*table, *address)
        }
        Request::WriteCoil { address, .. } | Request::WriteCoils { address, .. } => (Table::Coils, *address),
        Request::WriteRegister { address, .. } | Request::WriteRegisters { address, .. } => {
            (Table::HoldingRegisters, *address)
        }
    }
}

fn end(address: u16, count: u16) -> u32 {
    u32::from(address) + u32::from(count)
}

/// Names and values from an address on; of a row of values.
fn values(order: WordOrder, table: Table, address: u16, words: &[u16]) -> String {
    let count = u16::try_from(words.len()).unwrap_or(u16::MAX);
    let cells = Cells { table, order, address, end: end(address, count) };
    let mut left = words;
    listed(cells.map(|cell| {
        let (now, rest) = left.split_at_checked(cell.width).unwrap_or((left, &[]));
        left = rest;
        format!("{} = {}", cell.name, cell.value(order, now))
    }))
}

/// Items with commas between them, not too many.
fn listed(items: impl Iterator<Item = String>) -> String {
    let mut items: Vec<String> = items.collect();
    let more = items.len().saturating_sub(MOST_NAMED);
    items.truncate(MOST_NAMED);
    let listed = items.join(", ");
    if more == 0 { listed } else { format!("{listed} and {more} more") }
}

/// The registers that lie at a row of addresses.
struct Cells {
    table: Table,
    order: WordOrder,
    address: u16,
    /// The first address behind the row.
    end: u32,
}

/// A register, or half of one, or an address at which there is none.
struct Cell {
    name: String,
    /// How many addresses it takes.
    width: usize,
    /// Its row in the map.
    row: Option<&'static Register>,
    is_whole: bool,
}

impl Iterator for Cells {
    type Item = Cell;

    fn next(&mut self) -> Option<Cell> {
        let address = self.address;
        let left = self.end.checked_sub(address.into()).filter(|left| *left > 0)?;
        let cell = cell(self.table, address, left, self.order);
        self.address = address.saturating_add(u16::try_from(cell.width).unwrap_or(1));
        // Behind the last address there is no other.
        if self.address == address {
            self.end = 0;
        }
        Some(cell)
    }
}

/// What lies at an address, when `left` addresses are looked at from there on.
fn cell(table: Table, address: u16, left: u32, order: WordOrder) -> Cell {
    let Some(row) = Register::at(table, address) else {
        return Cell {
            name: format!("{} {address:#06X}", table.abbreviation()),
            width: 1,
            row: None,
            is_whole: true,
        };
    };
    let (width, offset) = (row.kind.width(), address - row.address);
    let name = row.name.replace("{}", &(offset / width).to_string());
    let is_whole = offset.is_multiple_of(width) && u32::from(width) <= left;
    if is_whole {
        return Cell { name, width: width.into(), row: Some(row), is_whole };
    }
    let is_low = offset.is_multiple_of(width) == (order == WordOrder::LowFirst);
    let half = if is_low { "low" } else { "high" };
    Cell { name: format!("{name} ({half} word)"), width: 1, row: Some(row), is_whole }
}

impl Cell {
    fn value(&self, order: WordOrder, words: &[u16]) -> String {
        let value = match (words, order) {
            ([word], _) => u32::from(*word),
            ([low, high], WordOrder::LowFirst) | ([high, low], WordOrder::HighFirst) => {
                u32::from(*high) << 16 | u32::from(*low)
            }
            _ => return "?".to_owned(),
        };
        match self.row {
            Some(row) if row.access == Access::Secret => "(secret)".to_owned(),
            Some(_) if !self.is_whole => value.to_string(),
            Some(row) if row.limits == Limits::Commands => command(value),
            Some(row) if row.id == Reg::StatusWord => {
                format!("{value:#06X} ({})", flags(Status::from_word(words.first().copied().unwrap_or(0))))
            }
            Some(row) if row.hex => format!("{value:#X}"),
            Some(row) if row.kind == Kind::I32 => value.cast_signed().to_string(),
            Some(_) | None => value.to_string(),
        }
    }
}

/// The instruction that the `CMD` register takes under a code.
fn command(code: u32) -> String {
    let opcode = u16::try_from(code).ok().and_then(Opcode::from_cmd);
    opcode.map_or_else(|| format!("{code:#X}"), |opcode| opcode.name().to_owned())
}

/// The flags of a status that are set, as the maker calls them.
pub(crate) fn flags(status: Status) -> String {
    let motion = match status.motion {
        MotStatus::Stopped => "STOP",
        MotStatus::Accelerating => "ACC",
        MotStatus::Decelerating => "DEC",
        MotStatus::ConstantSpeed => "CONST_SPEED",
    };
    let flags = [
        (status.hi_z, "HiZ"),
        (true, motion),
        (status.ready, "READY"),
        (status.sw_f, "SW_F"),
        (status.sw_evn, "SW_EVN"),
        (status.forward, "DIR"),
        (status.cmd_error, "CMD_ERROR"),
    ];
    flags.into_iter().filter(|(set, _)| *set).map(|(_, name)| name).collect::<Vec<&str>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use WordOrder::{HighFirst, LowFirst};

    /// A frame of transaction 1 to unit 1.
    fn frame(pdu: &[u8]) -> Vec<u8> {
        let length = u8::try_from(1 + pdu.len()).expect("short");
        [&[0, 1, 0, 0, 0, length, 1], pdu].concat()
    }

    fn said(order: WordOrder, request: &[u8], reply: &[u8]) -> (String, String) {
        let (request, reply) = meanings(order, &frame(request), &frame(reply));
        assert!(!request.bad && !reply.bad, "{request:?} {reply:?}");
        (request.text, reply.text)
    }

    #[test]
    fn registers_are_read_and_written_by_name() {
        let position = |order| said(order, &[4, 0x10, 0, 0, 3], &[4, 6, 0, 100, 0xFF, 0xFE, 0xFF, 0xFF]);
        assert_eq!(
            position(LowFirst),
            ("FC04 read SPEED, ABS_POS".into(), "SPEED = 100, ABS_POS = -2".into())
        );
        assert_eq!(position(HighFirst).1, "SPEED = 100, ABS_POS = -65537");
        let (request, reply) = said(LowFirst, &[6, 0x11, 9, 0, 0x10], &[6, 0x11, 9, 0, 0x10]);
        assert_eq!((request.as_str(), reply.as_str()), ("FC06 CMD = MOVE_F", "FC06 written"));
    }

    #[test]
    fn flags_and_coils_have_their_names() {
        let (request, reply) = said(LowFirst, &[2, 0x12, 0, 0, 3], &[2, 1, 0b101]);
        assert_eq!(request, "FC02 read HiZ, STOP, CONST_SPEED");
        assert_eq!(reply, "HiZ = 1, STOP = 0, CONST_SPEED = 1");
        let coil = [5, 0x14, 3, 0xFF, 0];
        assert_eq!(said(LowFirst, &coil, &coil).0, "FC05 Soft STOP = 1");
        let (_, status) = said(LowFirst, &[4, 0x10, 4, 0, 1], &[4, 2, 0, 0x92]);
        assert_eq!(status, "STATUS = 0x0092 (STOP READY DIR CMD_ERROR)");
    }

    #[test]
    fn a_password_is_not_shown_whole_or_by_halves() {
        let secret = stepdrive_spec::smsd::registers::REGISTERS
            .iter()
            .find(|row| row.access == Access::Secret)
            .expect("a secret register");
        let [high, low] = secret.address.to_be_bytes();
        for pdu in [&[16, high, low, 0, 2, 4, 0x12, 0x34, 0x56, 0x78][..], &[6, high, low, 0x12, 0x34]] {
            let (request, _) = meanings(LowFirst, &frame(pdu), &[]);
            assert!(request.text.contains("(secret)") && !request.text.contains("4660"), "{}", request.text);
        }
    }

    #[test]
    fn what_no_register_holds_is_told_by_its_address() {
        let (request, _) = meanings(LowFirst, &frame(&[3, 0xFF, 0xFE, 0, 2]), &[]);
        assert_eq!(request.text, "FC03 read HR 0xFFFE, HR 0xFFFF");
        let (half, _) = meanings(LowFirst, &frame(&[4, 0x10, 2, 0, 1]), &[]);
        assert_eq!(half.text, "FC04 read ABS_POS (high word)");
    }

    #[test]
    fn refusals_and_replies_to_nothing_are_bad() {
        let request = frame(&[6, 0x11, 9, 0, 0x10]);
        for (reply, text) in [
            (frame(&[0x86, 6]), "FC06 Modbus exception 06 (server device busy)"),
            (vec![9, 9, 0, 0, 0, 3, 1, 0x86, 6], "a reply with transaction 0x0909, not 0x0001"),
            (vec![1, 2, 3], "no Modbus frame"),
            ([frame(&[6, 0x11, 9, 0, 0x10]), vec![7]].concat(), "FC06 written, and 1 more bytes"),
        ] {
            assert_eq!(meanings(LowFirst, &request, &reply).1, Meaning::bad(text));
        }
        let (unknown, answer) = meanings(LowFirst, &frame(&[0x2B, 14, 1, 0]), &frame(&[0xAB, 1]));
        assert_eq!(unknown, Meaning::bad("FC2B, not well formed"));
        assert_eq!(answer, Meaning::bad("FC2B Modbus exception 01 (illegal function)"));
    }

    #[test]
    fn long_lists_are_cut_short_and_the_last_address_ends_them() {
        let (request, _) = meanings(LowFirst, &frame(&[3, 0x90, 0, 0, 125]), &[]);
        assert!(request.text.ends_with("and 113 more"), "{}", request.text);
    }
}
