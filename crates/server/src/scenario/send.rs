//! What a step sends to a drive, as a client would: read here, sent by [`super::client`].

use stepdrive_drive::smsd::WordOrder;
use stepdrive_proto::smd3::{Line, MAX_LINE};
use stepdrive_rig::file::{RigFile, SmsdSection};
use stepdrive_rig::names::split;
use stepdrive_spec::modbus::{Exception, Request, Table, Words};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, OpcodeInfo, Operand};
use stepdrive_spec::smsd::registers::{Access, Kind, REGISTERS, Reg, Register};
use stepdrive_spec::smsd::standard::Firmware;

/// What is between what is sent and the refusal that is expected.
const EXPECTING: &str = " expecting ";

const LINE_USAGE: &str = "a line is sent so: line DRIVE LINE [expecting ERROR], as in line uhv RUNR,1000";
const WRITE_USAGE: &str = "a register is written so: write DRIVE.REGISTER VALUE [expecting EXCEPTION], as in write stage.MAX_SPEED 800";
const COMMAND_USAGE: &str = "a command is given so: command DRIVE COMMAND [OPERAND] [expecting CMD_ERROR], as in command stage GO_TO 5000";

/// Something that is sent to a drive.
#[derive(Clone, Debug)]
pub(super) struct Sending {
    /// The drive.
    pub(super) drive: usize,
    /// What.
    pub(super) what: Sent,
}

/// What is sent, and how it is to be taken.
#[derive(Clone, Debug)]
pub(super) enum Sent {
    /// A line to an SMD3, which it takes, or refuses with this.
    Line(String, Option<Error>),
    /// A request to an SMSD, which it takes, or refuses with this.
    Write(Box<Request>, Option<Exception>),
    /// The operand of a command, if it has one, then the command. `true` when it is refused with `CMD_ERROR`.
    Command(Vec<Request>, bool),
}

impl Sending {
    /// Reads what stands behind `line`.
    pub(super) fn line(text: &str, rig: &RigFile) -> Result<Sending, String> {
        let (text, expecting) = expected(text);
        let (name, line) = text.split_once(char::is_whitespace).ok_or(LINE_USAGE)?;
        let (drive, line) = (rig.find_drive(name).map_err(|error| error.message)?, line.trim());
        if rig.drives.get(drive).is_none_or(|drive| drive.smd3().is_none()) {
            return Err(format!("{name} is an SMSD, which takes no lines; see write and command"));
        }
        let wanted = expecting.map(error).transpose()?;
        if line.len() > MAX_LINE || !line.bytes().all(|byte| byte == b' ' || byte.is_ascii_graphic()) {
            return Err(format!("a line is at most {MAX_LINE} printable ASCII characters"));
        }
        match Line::Text(line.as_bytes()).decode() {
            Ok(None) => Err(LINE_USAGE.to_owned()),
            Err(refusal) if wanted.is_none() => Err(format!(
                "the drive will refuse this with {refusal}; if that is the point, add: expecting {}",
                refusal.code()
            )),
            Ok(Some(_)) | Err(_) => Ok(Sending { drive, what: Sent::Line(line.to_owned(), wanted) }),
        }
    }

    /// Reads what stands behind `write`.
    pub(super) fn write(text: &str, rig: &RigFile) -> Result<Sending, String> {
        let (text, expecting) = expected(text);
        let words: Vec<&str> = text.split_whitespace().collect();
        let (target, value) = match *words.as_slice() {
            [target] => (target, None),
            [target, value] => (target, Some(value)),
            _ => return Err(WRITE_USAGE.to_owned()),
        };
        let (name, register) = split(target).map_err(|error| error.message)?;
        let (drive, section) = smsd(name, rig)?;
        let (row, index) = register_of(register, name)?;
        let value = match value {
            Some(value) => number(value)?,
            None if row.access == Access::Trigger => 1,
            None => return Err(WRITE_USAGE.to_owned()),
        };
        let wanted = expecting.map(exception).transpose()?;
        check_value(row, section, value, wanted.is_some())?;
        let request = write_request(row, index, value, section.word_order);
        Ok(Sending { drive, what: Sent::Write(Box::new(request), wanted) })
    }

    /// Reads what stands behind `command`.
    pub(super) fn command(text: &str, rig: &RigFile) -> Result<Sending, String> {
        let (text, expecting) = expected(text);
        let words: Vec<&str> = text.split_whitespace().collect();
        let (name, command, operand) = match *words.as_slice() {
            [name, command] => (name, command, None),
            [name, command, operand] => (name, command, Some(operand)),
            _ => return Err(COMMAND_USAGE.to_owned()),
        };
        let refused = match expecting {
            None => false,
            Some("CMD_ERROR") => true,
            Some(_) => return Err("a command that is refused sets CMD_ERROR: expecting CMD_ERROR".to_owned()),
        };
        let (drive, section) = smsd(name, rig)?;
        let info = command_of(command)?;
        let operand = operand.map(|operand| operand_request(info, operand, section, refused)).transpose()?;
        let request = write_request(Reg::Cmd.info(), 0, info.code.into(), section.word_order);
        Ok(Sending { drive, what: Sent::Command(operand.into_iter().chain([request]).collect(), refused) })
    }
}

/// What is sent, and the refusal that is expected.
fn expected(text: &str) -> (&str, Option<&str>) {
    match text.rsplit_once(EXPECTING) {
        Some((sent, expecting)) => (sent.trim(), Some(expecting.trim())),
        None => (text, None),
    }
}

fn error(text: &str) -> Result<Error, String> {
    text.parse().ok().and_then(Error::from_code).ok_or_else(|| {
        let codes: Vec<String> = Error::ALL.iter().map(|error| error.code().to_string()).collect();
        format!("a line is refused with one of {}", codes.join(", "))
    })
}

fn exception(text: &str) -> Result<Exception, String> {
    let code = text.parse().ok().filter(|code| (1..=127).contains(code));
    code.map(Exception::from_code)
        .ok_or_else(|| "a request is refused with a Modbus exception: 1, 2, 3, 4 or 6".to_owned())
}

fn smsd<'a>(name: &str, rig: &'a RigFile) -> Result<(usize, &'a SmsdSection), String> {
    let drive = rig.find_drive(name).map_err(|error| error.message)?;
    let section = rig.drives.get(drive).and_then(|drive| drive.smsd());
    let section = section.ok_or_else(|| format!("{name} is an SMD3, which has no registers; see line"))?;
    if section.lan.firmware == Firmware::Standard {
        return Err(format!(
            "{name} has the standard firmware, which has no registers; leave out its lan = \"standard\""
        ));
    }
    Ok((drive, section))
}

/// A register that can be written, and the number within its row.
fn register_of(name: &str, drive: &str) -> Result<(&'static Register, u16), String> {
    let writable = REGISTERS.iter().filter(|row| row.access != Access::Read);
    let all = writable.flat_map(|row| (0..row.count).map(move |index| (row, index)));
    let mut found = all.filter(|(row, index)| full_name(row, *index).eq_ignore_ascii_case(name));
    found.next().ok_or_else(|| {
        let told = REGISTERS.iter().any(|row| full_name(row, 0).eq_ignore_ascii_case(name));
        let name: String = name.chars().filter(|c| !c.is_control()).take(40).collect();
        if told {
            format!("the register `{name}` of `{drive}` can only be read")
        } else {
            format!("unknown register `{name}` of `{drive}`; they are called as in docs/registers.md, with _ for a space")
        }
    })
}

fn full_name(row: &Register, index: u16) -> String {
    row.name.replace("{}", &index.to_string()).replace(' ', "_")
}

fn number(text: &str) -> Result<i64, String> {
    let digits = text.strip_prefix("0x").filter(|digits| digits.bytes().all(|byte| byte.is_ascii_hexdigit()));
    let number = match digits {
        Some(digits) => i64::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    };
    number.ok_or_else(|| "a value is a whole number, as in -5000 or 0x1F".to_owned())
}

/// Whether a value can be sent, and whether it will be taken, unless a refusal is expected.
fn check_value(row: &Register, section: &SmsdSection, value: i64, refused: bool) -> Result<(), String> {
    let (min, max) = if refused { whole_range(row.kind) } else { row.range(section.model) };
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(format!("{} is {min} to {max}, not {value}", full_name(row, 0)))
}

/// All that a register of this kind can be sent.
const fn whole_range(kind: Kind) -> (i64, i64) {
    match kind {
        Kind::Bit => (0, 1),
        Kind::U16 => (0, 0xFFFF),
        Kind::U32 => (0, 0xFFFF_FFFF),
        Kind::I32 => (i32::MIN as i64, i32::MAX as i64),
    }
}

fn write_request(row: &Register, index: u16, value: i64, order: WordOrder) -> Request {
    let address = row.address + index * row.kind.width();
    // Two's complement; what does not fit was refused.
    let [a, b, c, d, ..] = value.to_le_bytes();
    let (low, high) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
    match row.kind {
        Kind::Bit => Request::WriteCoil { address, value: value != 0 },
        Kind::U16 => Request::WriteRegister { address, value: low },
        Kind::U32 | Kind::I32 => {
            Request::WriteRegisters { address, values: two_words(low, high, order).into_iter().collect() }
        }
    }
}

fn two_words(low: u16, high: u16, order: WordOrder) -> [u16; 2] {
    match order {
        WordOrder::LowFirst => [low, high],
        WordOrder::HighFirst => [high, low],
    }
}

/// The request that logs in with a password.
pub(super) fn login(password: u64, order: WordOrder) -> Request {
    let word = |shift: u32| u16::try_from(password >> shift & 0xFFFF).unwrap_or(0);
    let mut values = Words::new();
    values.extend(two_words(word(0), word(16), order));
    values.extend(two_words(word(32), word(48), order));
    values.push(0);
    Request::WriteRegisters { address: Reg::PasswordLow32.info().address, values }
}

/// The request that reads a flag.
pub(super) fn read_flag(flag: Reg) -> Request {
    Request::ReadBits { table: Table::DiscreteInputs, address: flag.info().address, count: 1 }
}

fn command_of(name: &str) -> Result<&'static OpcodeInfo, String> {
    let called = |row: &&OpcodeInfo| {
        let names = [row.name, row.alias];
        names.into_iter().any(|known| !known.is_empty() && known.eq_ignore_ascii_case(name))
    };
    let row = INSTRUCTIONS.iter().find(called);
    row.filter(|row| row.in_cmd).ok_or_else(|| {
        let names: Vec<&str> = INSTRUCTIONS.iter().filter(|row| row.in_cmd).map(|row| row.name).collect();
        let name: String = name.chars().filter(|c| !c.is_control()).take(40).collect();
        match row {
            Some(_) => format!("CMD does not take {name}; it takes {}", names.join(", ")),
            None => format!("unknown command `{name}`; there are {}", names.join(", ")),
        }
    })
}

/// The request that writes a command's operand.
fn operand_request(
    info: &OpcodeInfo,
    text: &str,
    section: &SmsdSection,
    refused: bool,
) -> Result<Request, String> {
    let register = match info.operand {
        Operand::Position => Reg::TargetPos,
        Operand::Number { .. } => Reg::TargetSpeed,
        Operand::Input => Reg::TargetInput,
        Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => {
            return Err(format!("{} has no operand", info.name));
        }
    };
    let value = if register == Reg::TargetInput { input_number(info, text, refused)? } else { number(text)? };
    // The register itself must take it; the command may refuse it later.
    check_value(register.info(), section, value, false)?;
    Ok(write_request(register.info(), 0, value, section.word_order))
}

/// The number of an input, by its name or as it is. One that does not exist is for a command that is refused.
fn input_number(info: &OpcodeInfo, text: &str, refused: bool) -> Result<i64, String> {
    let named = Input::from_name(&text.to_ascii_uppercase()).map(|input| input.number().into());
    let value = named.or_else(|| number(text).ok().filter(|value| refused || (0..=7).contains(value)));
    value.ok_or_else(|| {
        format!("{} takes an input, {} or 0 to 7", info.name, Input::ALL.map(Input::name).join(", "))
    })
}
