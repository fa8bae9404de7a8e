//! Requests: what a server reads and a client writes.

use super::buffer::LineBuf;
use super::{next_item, number};
use stepdrive_spec::smd3::commands::{Access, Command, CommandInfo, Kind, Request, Value};
use stepdrive_spec::smd3::errors::Error;

/// Reads the request in a line, which comes without its terminator; `None` when there is nothing in it but white space.
///
/// Capitals do not matter, nor do spaces and tabs around the mnemonic and the argument (manual, *Protocol*, *White
/// space*). The argument is of the command's type; whether it is within the command's range is for the drive to say.
/// A FLOAT is finite; one that is nearer to 0 than any other is 0.
///
/// ASSUMED: the order in which it is checked, which is that of the errors below.
///
/// # Errors
/// The first of these that applies:
/// * [`Error::UnknownCommand`]: no such mnemonic;
/// * [`Error::ArgumentCount`]: an argument to a command that takes none, or more than one; a comma with nothing behind it
///   is an argument too, an empty one;
/// * [`Error::UnableToGet`]: no argument to a command that can only be set;
/// * [`Error::ArgumentType`]: the argument is not of the command's type, as a fraction or an empty one for an INT, an
///   infinite FLOAT, `0x` without digits, bytes that are no printable ASCII;
/// * [`Error::ArgumentValidation`]: it is, but cannot be held: an INT or UINT of more than 64 bits, a FLOAT as 1e999; a
///   UINT other than `0` and `1` for a BOOL; characters other than `+` and `-` for a direction.
pub fn decode_line(line: &[u8]) -> Result<Option<Request>, Error> {
    let (mnemonic, arguments) = next_item(line);
    if mnemonic.is_empty() && arguments.is_none() {
        return Ok(None);
    }
    let command = core::str::from_utf8(mnemonic).ok().and_then(Command::from_mnemonic);
    let command = command.ok_or(Error::UnknownCommand)?;
    let info = command.info();
    let Some(arguments) = arguments else {
        check_count(info.access, false)?;
        return Ok(Some(Request { command, argument: None }));
    };
    let (argument, more) = next_item(arguments);
    if more.is_some() {
        return Err(Error::ArgumentCount);
    }
    check_count(info.access, true)?;
    Ok(Some(Request { command, argument: Some(parse(info.kind, argument)?) }))
}

/// Writes a line with the request into `out`.
///
/// # Errors
/// When the request is not well formed: the error with which a server would answer it, and `out` is as it was. That is an
/// argument where none belongs ([`Error::ArgumentCount`]), none where one does ([`Error::UnableToGet`]), one of another
/// type than the command's ([`Error::ArgumentType`]), and a FLOAT that is not finite ([`Error::ArgumentValidation`]).
pub fn encode_request(out: &mut LineBuf, request: &Request) -> Result<(), Error> {
    let info = request.command.info();
    check_count(info.access, request.argument.is_some())?;
    if let Some(argument) = request.argument {
        check_kind(info.kind, argument)?;
    }
    out.clear();
    put_request(out, info, request.argument);
    out.finish();
    Ok(())
}

/// Fails when a command is sent with an argument and takes none, or the other way round.
fn check_count(access: Access, has_argument: bool) -> Result<(), Error> {
    match (access, has_argument) {
        (Access::Read | Access::Action, true) => Err(Error::ArgumentCount),
        (Access::Write, false) => Err(Error::UnableToGet),
        (Access::ReadWrite, _) | (Access::Read | Access::Action, false) | (Access::Write, true) => Ok(()),
    }
}

/// Reads an argument of this type.
fn parse(kind: Kind, item: &[u8]) -> Result<Value, Error> {
    match kind {
        Kind::Int => number::int(item).map(Value::Int),
        Kind::Uint => number::uint(item).map(Value::Uint),
        Kind::Float => number::float(item).map(Value::Float),
        Kind::Bool => number::boolean(item).map(Value::Bool),
        Kind::Sign => number::sign(item).map(Value::Sign),
        // Of commands that take no argument.
        Kind::None | Kind::Text => Err(Error::ArgumentType),
    }
}

fn check_kind(kind: Kind, argument: Value) -> Result<(), Error> {
    match (kind, argument) {
        (Kind::Float, Value::Float(value)) if !value.is_finite() => Err(Error::ArgumentValidation),
        (Kind::Int, Value::Int(_))
        | (Kind::Uint, Value::Uint(_))
        | (Kind::Float, Value::Float(_))
        | (Kind::Bool, Value::Bool(_))
        | (Kind::Sign, Value::Sign(_)) => Ok(()),
        _ => Err(Error::ArgumentType),
    }
}

fn put_request(out: &mut LineBuf, info: &CommandInfo, argument: Option<Value>) {
    out.put(info.mnemonic.as_bytes());
    let Some(argument) = argument else { return };
    out.put(b",");
    match argument {
        Value::Int(value) => out.put_display(value),
        Value::Uint(value) => out.put_display(value),
        // As many digits as it takes to be read as the same number.
        Value::Float(value) => out.put_display(format_args!("{value:?}")),
        Value::Bool(value) => out.put_bit(value),
        Value::Sign(value) => out.put_sign(value),
        // No command takes one; `check_kind` refused it.
        Value::Text(_) | Value::Mode(_) | Value::FlagTable => {}
    }
}
