//! The lines of the SMD3.

use stepdrive_proto::smd3::{
    Line, LineBuf, LineReader, MAX_LINE, decode_line, decode_reply, encode_reply, encode_request, split_reply,
};
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, Kind, Mode, Reply, Request, Value};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::Flags;
use stepdrive_spec::smd3::text::Text;

/// What a client sends on one port: the lines do not depend on how the bytes were cut, what is understood means the same
/// encoded again, the client understands the reply, and the line behind it all is understood. Read as what a drive
/// sends, a reply that is understood means the same encoded again.
///
/// # Panics
/// When that does not hold.
pub fn smd3_lines(data: &[u8]) {
    let bytes = [data, b"\r\nSTOP\r\n"].concat();
    let at_once = lines(&bytes, bytes.len());
    for chunk in [1, 7, MAX_LINE] {
        assert_eq!(lines(&bytes, chunk), at_once, "cut to {chunk} bytes");
    }
    for line in at_once.iter().flatten() {
        means_the_same_encoded_again(line);
        is_answered(line);
        is_read_by_a_client(line);
    }
    let stop = Request { command: Command::Stop, argument: None };
    let last = at_once.last().and_then(Option::as_deref).expect("a line that is not too long");
    assert_eq!(decode_line(last), Ok(Some(stop)));
}

/// The lines in some bytes cut to chunks; `None` is one that is too long.
fn lines(bytes: &[u8], chunk: usize) -> Vec<Option<Vec<u8>>> {
    let mut reader = LineReader::new();
    let mut lines = Vec::new();
    for mut bytes in bytes.chunks(chunk) {
        while let Some(line) = reader.take(&mut bytes) {
            lines.push(match line {
                Line::Text(line) => Some(line.to_vec()),
                Line::TooLong => None,
            });
        }
        assert!(bytes.is_empty() && reader.held() <= MAX_LINE);
    }
    lines
}

fn means_the_same_encoded_again(line: &[u8]) {
    assert!(line.len() <= MAX_LINE && !line.iter().any(|byte| matches!(byte, b'\r' | b'\n')));
    let Ok(Some(request)) = decode_line(line) else { return };
    let mut out = LineBuf::new();
    assert_eq!(encode_request(&mut out, &request), Ok(()));
    assert_eq!(decode_line(out.trim_ascii_end()), Ok(Some(request)));
}

/// A drive that makes up its answers: the client reads what was answered.
fn is_answered(line: &[u8]) {
    let (command, outcome) = match decode_line(line) {
        Ok(Some(request)) => (request.command, Ok(made_up(&request))),
        Ok(None) => (Command::Stop, Ok(None)),
        Err(error) => (Command::Stop, Err(error)),
    };
    let [first, last] = [line.first(), line.last()].map(|byte| u16::from(byte.copied().unwrap_or(0)));
    let reply = Reply { flags: Flags { status: first, error: last << 8 }, outcome };
    assert_eq!(read_back(&reply, command), reply);
}

/// A value that is printed with all its digits.
fn made_up(request: &Request) -> Option<Value> {
    let info = request.command.info();
    if matches!(info.access, Access::Write | Access::Action) {
        return None;
    }
    Some(match (request.command, info.kind) {
        (Command::Mode, _) => Value::Mode(Mode::Bake),
        (Command::Flags, _) => Value::FlagTable,
        (_, Kind::Text) => Value::Text(Text::new("20168-001").expect("one item")),
        (_, Kind::Float) => Value::Float(-123.456),
        (_, Kind::Bool) => Value::Bool(true),
        _ => Value::Uint(7),
    })
}

fn read_back(reply: &Reply, command: Command) -> Reply {
    let mut out = LineBuf::new();
    encode_reply(&mut out, reply);
    let (line, size) = split_reply(&out).expect("a whole reply");
    assert!(size == out.len() && line.len() <= MAX_LINE);
    decode_reply(line, command).expect("a reply to the command")
}

/// A client that takes the line for the reply to every command in turn.
fn is_read_by_a_client(line: &[u8]) {
    for row in &COMMANDS {
        match decode_reply(line, row.command) {
            Ok(reply) => {
                let again = read_back(&reply, row.command);
                assert_eq!(read_back(&again, row.command), again);
                assert_eq!(without_value(again), without_value(reply));
            }
            Err(why) => assert!(!why.to_string().is_empty()),
        }
    }
}

/// A reply but for the digits that a number loses when it is printed.
fn without_value(reply: Reply) -> (Flags, Result<bool, Error>) {
    (reply.flags, reply.outcome.map(|value| value.is_some()))
}
