//! The lines of an SMD3 in words: the reply `0x0040,0x0000,1.23000E+04` is `1.23000E+04 [STANDBY]`.

use super::words::Meaning;
use stepdrive_proto::smd3::{Line, MAX_LINE, decode_line, decode_reply, split_reply};
use stepdrive_spec::smd3::commands::{Command, Value};
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, Flags, STATUS_FLAGS};

/// A request in a line, and the reply to it in another, both with their ends.
pub(crate) fn meanings(request: &[u8], reply: &[u8]) -> (Meaning, Meaning) {
    let line = request.trim_ascii();
    let asked = if line.len() > MAX_LINE { Line::TooLong.decode() } else { decode_line(line) };
    let text = line.get(..MAX_LINE).unwrap_or(line).escape_ascii().to_string();
    let meant = match asked {
        Ok(_) => Meaning::good(text),
        Err(_) => Meaning::bad(text),
    };
    // A line without a command is answered with the flags alone or with an error, as this one is.
    let command = asked.ok().flatten().map_or(Command::Clr, |request| request.command);
    (meant, reply_meaning(command, reply))
}

fn reply_meaning(command: Command, reply: &[u8]) -> Meaning {
    let Some((line, size)) = split_reply(reply) else { return Meaning::bad("a line without its end") };
    let decoded = match decode_reply(line, command) {
        Ok(reply) => reply,
        Err(error) => return Meaning::bad(error.to_string()),
    };
    let flags = flags(decoded.flags);
    let meaning = match decoded.outcome {
        Ok(None) => Meaning::good(format!("OK{flags}")),
        Ok(Some(Value::FlagTable)) => Meaning::good(format!("the table of flags{flags}")),
        Ok(Some(_)) => Meaning::good(format!("{}{flags}", item(line))),
        Err(error) => Meaning::bad(format!("{error}{flags}")),
    };
    match reply.len() - size {
        0 => meaning,
        more => Meaning::bad(format!("{}, and {more} more bytes", meaning.text)),
    }
}

/// The item behind the flags, as it came.
fn item(line: &[u8]) -> String {
    let item = line.splitn(3, |byte| *byte == b',').nth(2).unwrap_or_default();
    item.trim_ascii().escape_ascii().to_string()
}

/// The flags that are set, in brackets; nothing when none is.
fn flags(flags: Flags) -> String {
    let status = STATUS_FLAGS.iter().filter(|flag| flag.is_in(flags.status));
    let error = ERROR_FLAGS.iter().filter(|flag| flag.is_in(flags.error));
    let set: Vec<&str> = status.chain(error).map(|flag| flag.name).collect();
    if set.is_empty() { String::new() } else { format!(" [{}]", set.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replies_have_their_flags_by_name() {
        for (request, reply, meant) in [
            ("VMAX,500\r\n", "0x0040,0x0000,5.00000E+02\r\n", Meaning::good("5.00000E+02 [STANDBY]")),
            ("runv,+\r", "0x0100,0x0000\r\n", Meaning::good("OK [ATSPEED]")),
            ("STOP\n", "0x0000,0x0000\r\n", Meaning::good("OK")),
            ("\r\n", "0x0000,0x0000\r\n", Meaning::good("OK")),
            ("MODE\r\n", "0x0040,0x0000,2 (Remote)\r\n", Meaning::good("2 (Remote) [STANDBY]")),
            (
                "RUNV,+\r\n",
                "0x0040,0x0022,-7 (Not possible when motor disabled)\r\n",
                Meaning::bad("-7 (Not possible when motor disabled) [STANDBY, TOPEN, EMERGENCY STOP]"),
            ),
            ("STOP\n", "0x0000,0x0000\r\n00\r\n", Meaning::bad("OK, and 4 more bytes")),
            ("STOP\n", "0x00", Meaning::bad("a line without its end")),
        ] {
            let (asked, answered) = meanings(request.as_bytes(), reply.as_bytes());
            assert_eq!((asked, answered), (Meaning::good(request.trim()), meant), "{request:?}");
        }
    }

    #[test]
    fn a_line_that_is_no_request_is_bad_and_shown_tamely() {
        let (asked, answered) = meanings(b"\x1B[2J\r\n", b"0x0000,0x0000,-4 (Unknown command)\r\n");
        assert_eq!(asked, Meaning::bad("\\x1b[2J"));
        assert_eq!(answered, Meaning::bad("-4 (Unknown command)"));
        let (asked, _) = meanings(&[b'A'; 300], b"");
        assert!(asked.bad && asked.text.len() == MAX_LINE);
    }
}
