//! Lines sent as a person typed them, for a terminal.

use super::line::Heard;
use super::words::{self, takes};
use super::{Smd3Client, may_repeat};
use crate::error::Error;
use std::sync::atomic::Ordering;
use stepdrive_proto::smd3::{MAX_LINE, decode_line};
use stepdrive_spec::smd3::commands::{Command, Value};
use stepdrive_spec::smd3::errors::Error as Refusal;
use stepdrive_spec::smd3::flags::Flags;

/// What the drive answered to a line that was sent as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct RawReply {
    /// The reply without its end, with nothing in it that would disturb a terminal.
    pub text: String,
    /// The flags that it began with; `None` when the rest could not be understood.
    pub flags: Option<Flags>,
    /// The value, if it had one; or what the drive had against the line, in words.
    pub outcome: Result<Option<Value>, Error>,
}

impl Smd3Client {
    /// Sends a line as it is, right or wrong, once, and answers what the drive made of it. `line` comes without its end.
    ///
    /// # Errors
    /// [`Error::Usage`] when it is empty, too long or not printable ASCII: nothing was sent then. [`Error::Line`] when the
    /// drive cannot be reached or understood, and [`Error::Uncertain`] when that leaves open whether something was started.
    pub async fn send_line(&self, line: &str) -> Result<RawReply, Error> {
        check(line)?;
        let command = mnemonic(line);
        let request = decode_line(line.as_bytes()).ok().flatten();
        let mut wire = self.line.lock().await;
        // A refusal is read the same way whatever the command.
        let heard = wire.exchange_text(line, command.unwrap_or(Command::Ser)).await;
        self.upsets.store(wire.upsets(), Ordering::Relaxed);
        let Heard { text, reply } = match (heard, &request) {
            (Ok(heard), _) => heard,
            (Err(lost), Some(request)) if lost.sent && !may_repeat(request) => {
                return Err(self.uncertain(&mut wire, request, lost).await);
            }
            (Err(lost), _) => return Err(lost.cause.into()),
        };
        let reply = match reply {
            Ok(reply) => reply,
            Err(why) => {
                let outcome = Err(Error::Device(format!("{} was answered with this: {why}", line.trim())));
                return Ok(RawReply { text, flags: None, outcome });
            }
        };
        self.keep(reply.flags);
        let outcome = match (reply.outcome, request) {
            (Ok(value), _) => Ok(value),
            (Err(refusal), Some(request)) => {
                let found = self.look_into(&mut wire, refusal, reply.flags).await;
                Err(words::refused(&request, refusal, &found))
            }
            (Err(refusal), None) => Err(Error::Usage(malformed(line, refusal, command))),
        };
        Ok(RawReply { text, flags: Some(reply.flags), outcome })
    }
}

fn check(line: &str) -> Result<(), Error> {
    let printable = line.bytes().all(|byte| byte == b'\t' || (b' '..=b'~').contains(&byte));
    if line.trim().is_empty() || line.len() > MAX_LINE || !printable {
        return Err(Error::Usage(format!(
            "a line to the drive is 1 to {MAX_LINE} printable ASCII characters; nothing was sent"
        )));
    }
    Ok(())
}

/// The command at the start of a line, if there is one of that name.
fn mnemonic(line: &str) -> Option<Command> {
    Command::from_mnemonic(line.split(',').next().unwrap_or_default().trim())
}

/// What is wrong with a line that is no well-formed request.
fn malformed(line: &str, refusal: Refusal, command: Option<Command>) -> String {
    let head = format!("{} refused ({}, {})", line.trim(), refusal.code(), refusal.text());
    match command {
        Some(command) => format!("{head}: {command} takes {}", takes(command.info().kind)),
        None => format!("{head}: there is no such command"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_a_line_is_not_sent() {
        for line in ["", "  ", "STOP\r", "STOP\nRUNV,+", "VMAX,5\u{b0}", &"9".repeat(MAX_LINE + 1)] {
            assert_eq!(check(line).expect_err(line).exit_code(), 1);
        }
        assert_eq!(check("vmax , 5"), Ok(()));
    }

    #[test]
    fn a_line_that_is_no_request_is_told_what_would_be_one() {
        let told = |line: &str, refusal| malformed(line, refusal, mnemonic(line));
        assert_eq!(
            told("FOO", Refusal::UnknownCommand),
            "FOO refused (-4, Unknown command): there is no such command"
        );
        assert_eq!(
            told("vmax,fast", Refusal::ArgumentType),
            "vmax,fast refused (-101, Argument type): VMAX takes a number"
        );
        assert_eq!(
            told("STOP,1", Refusal::ArgumentCount),
            "STOP,1 refused (-102, Argument count): STOP takes no value"
        );
    }
}
