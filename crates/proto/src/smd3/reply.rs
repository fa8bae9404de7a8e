//! Replies: what a server writes and a client reads.

use super::buffer::LineBuf;
use super::{TERMINATOR, next_item, number, trim};
use core::fmt;
use stepdrive_spec::smd3::commands::{Access, Command, Kind, Mode, Reply, Value};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, FlagBits, Flags, STATUS_FLAGS};
use stepdrive_spec::smd3::text::Text;

/// Between the lines of the table of flags. ASSUMED: LF alone, so that CR LF ends the whole reply, as it ends every other,
/// and none but the whole.
const TABLE_LINE_END: &[u8] = b"\n";

/// Writes a line with the reply into `out`: `SFLAGS,EFLAGS`, `SFLAGS,EFLAGS,value` or `SFLAGS,EFLAGS,error`.
///
/// ASSUMED: the table of flags is one item of many lines. Each of the status flags and then of the error flags has one,
/// with the flag's name, a tab, and 0 or 1. A LF stands between two lines; behind the last comes CR LF as in any reply.
///
/// A FLOAT has the form of C's `%.5E`, as `1.23000E+04`.
pub fn encode_reply(out: &mut LineBuf, reply: &Reply) {
    out.clear();
    out.put_hex(reply.flags.status);
    out.put(b",");
    out.put_hex(reply.flags.error);
    match reply.outcome {
        Ok(None) => {}
        Ok(Some(value)) => {
            out.put(b",");
            put_value(out, value, reply.flags);
        }
        Err(error) => {
            out.put(b",");
            out.put_display(error);
        }
    }
    out.finish();
}

/// Looks for the reply at the start of what a client has received: its line without the terminator, and the count of
/// bytes that it took with it. `None` as long as CR LF has not come.
///
/// A reply of this crate has at most [`MAX_LINE`](super::MAX_LINE) bytes, so a client need not wait for longer ones.
pub fn split_reply(bytes: &[u8]) -> Option<(&[u8], usize)> {
    let end = bytes.windows(TERMINATOR.len()).position(|window| window == TERMINATOR)?;
    Some((bytes.get(..end)?, end.saturating_add(TERMINATOR.len())))
}

/// Reads the reply to `command` from a line without its terminator.
///
/// A drive's refusal is a reply as well: [`Reply::outcome`] is then the error. Flags are read with or without leading
/// zeros, capitals and white space do not matter, the words behind the number of a mode or an error are not compared, and
/// an item behind the flags is passed over in the reply to `RUNA` and `RUNR`, where the manual's examples print one. The
/// value of `LP` may be there or not.
///
/// # Errors
/// When the bytes are no reply to the command.
pub fn decode_reply(line: &[u8], command: Command) -> Result<Reply, ReplyError> {
    let (status, rest) = next_item(line);
    let (error, item) = next_item(rest.ok_or(ReplyError::Flags)?);
    let flags = Flags { status: flag_bits(status)?, error: flag_bits(error)? };
    let outcome = match item.map(trim) {
        Some(item) if is_error(item) => Err(decode_error(item)?),
        item => Ok(decode_value(item, command)?),
    };
    Ok(Reply { flags, outcome })
}

/// Why bytes are no reply to a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyError {
    /// It does not begin with two sets of flags.
    Flags,
    /// It has no value, and the command is answered with one.
    Missing {
        /// The value's type.
        expected: Kind,
    },
    /// It has a value, and the command is answered with none.
    Unexpected,
    /// The value is not of the command's type.
    Value {
        /// The command's type.
        expected: Kind,
    },
    /// It is an error of a number that the manual does not list.
    UnknownError {
        /// The number.
        code: i16,
    },
    /// It is an error whose number cannot be one.
    ErrorNumber,
}

impl fmt::Display for ReplyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ReplyError::Flags => write!(f, "the reply does not begin with two sets of flags"),
            ReplyError::Missing { expected } => {
                write!(f, "the reply lacks a value of type {}", expected.name())
            }
            ReplyError::Unexpected => write!(f, "the reply has a value, and none was expected"),
            ReplyError::Value { expected } => {
                write!(f, "the value in the reply is not of type {}", expected.name())
            }
            ReplyError::UnknownError { code } => write!(f, "the reply is an error of unknown number, {code}"),
            ReplyError::ErrorNumber => write!(f, "the reply is an error whose number is out of range"),
        }
    }
}

impl core::error::Error for ReplyError {}

fn put_value(out: &mut LineBuf, value: Value, flags: Flags) {
    match value {
        Value::Int(value) => out.put_display(value),
        Value::Uint(value) => out.put_display(value),
        Value::Float(value) => out.put_float(value),
        Value::Bool(value) => out.put_bit(value),
        Value::Sign(value) => out.put_sign(value),
        Value::Text(text) => out.put(text.as_str().as_bytes()),
        Value::Mode(mode) => {
            out.put_display(mode.number());
            out.put(b" (");
            out.put(mode.name().as_bytes());
            out.put(b")");
        }
        Value::FlagTable => put_table(out, flags),
    }
}

fn put_table(out: &mut LineBuf, flags: Flags) {
    let status = STATUS_FLAGS.iter().map(|row| (row, flags.status));
    let error = ERROR_FLAGS.iter().map(|row| (row, flags.error));
    let mut line_end: &[u8] = b"";
    for (row, bits) in status.chain(error) {
        out.put(line_end);
        out.put(row.name.as_bytes());
        out.put(b"\t");
        out.put_bit(row.is_in(bits));
        line_end = TABLE_LINE_END;
    }
}

/// Reads a set of flags: `0x` and up to four digits, leading zeros not counted.
fn flag_bits(item: &[u8]) -> Result<FlagBits, ReplyError> {
    if !matches!(item, [b'0', b'x' | b'X', ..]) {
        return Err(ReplyError::Flags);
    }
    let bits = number::uint(item).map_err(|_| ReplyError::Flags)?;
    FlagBits::try_from(bits).map_err(|_| ReplyError::Flags)
}

/// Whether an item is an error: a negative number and text in brackets. ASSUMED: no value has that form.
fn is_error(item: &[u8]) -> bool {
    let [b'-', rest @ ..] = item else { return false };
    let mut words = rest.splitn(2, |byte| *byte == b' ');
    let digits = words.next().unwrap_or_default();
    let text = words.next().unwrap_or_default();
    !digits.is_empty() && digits.iter().all(u8::is_ascii_digit) && text.starts_with(b"(")
}

fn decode_error(item: &[u8]) -> Result<Error, ReplyError> {
    let code = number::int(first_word(item)).ok().and_then(|code| i16::try_from(code).ok());
    let code = code.ok_or(ReplyError::ErrorNumber)?;
    Error::from_code(code).ok_or(ReplyError::UnknownError { code })
}

/// Reads the item behind the flags.
fn decode_value(item: Option<&[u8]>, command: Command) -> Result<Option<Value>, ReplyError> {
    let info = command.info();
    match (info.access, item) {
        (Access::Read | Access::ReadWrite, Some(item)) => parse(item, command).map(Some),
        (Access::Read | Access::ReadWrite, None) => Err(ReplyError::Missing { expected: info.kind }),
        (Access::Write | Access::Action, None) => Ok(None),
        (Access::Write, Some(_)) if has_stray_item(command) => Ok(None),
        (Access::Write, Some(item)) if !info.starts => parse(item, command).map(Some),
        (Access::Write | Access::Action, Some(_)) => Err(ReplyError::Unexpected),
    }
}

/// Whether the manual's examples print an item in the reply that means nothing.
fn has_stray_item(command: Command) -> bool {
    matches!(command, Command::Runa | Command::Runr)
}

/// Reads a value of the command's type.
fn parse(item: &[u8], command: Command) -> Result<Value, ReplyError> {
    let expected = command.info().kind;
    let value = match (command, expected) {
        (Command::Mode, _) => mode(item),
        (Command::Flags, _) => (!item.is_empty()).then_some(Value::FlagTable),
        (_, Kind::Int) => number::int(item).ok().map(Value::Int),
        (_, Kind::Uint) => number::uint(item).ok().map(Value::Uint),
        (_, Kind::Float) => number::float(item).ok().map(Value::Float),
        (_, Kind::Bool) => number::boolean(item).ok().map(Value::Bool),
        (_, Kind::Sign) => number::sign(item).ok().map(Value::Sign),
        (_, Kind::Text) => core::str::from_utf8(item).ok().and_then(Text::new).map(Value::Text),
        (_, Kind::None) => None,
    };
    value.ok_or(ReplyError::Value { expected })
}

/// Reads the number of a mode; its name may follow.
fn mode(item: &[u8]) -> Option<Value> {
    let number = u32::try_from(number::uint(first_word(item)).ok()?).ok()?;
    Mode::from_number(number).map(Value::Mode)
}

/// What stands before the first space.
fn first_word(item: &[u8]) -> &[u8] {
    item.split(|byte| *byte == b' ').next().unwrap_or_default()
}
