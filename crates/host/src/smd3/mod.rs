//! The SMD3: its lines over serial or TCP.
//!
//! [`Smd3Client`] is the driver. `line` is the line and what is done when something goes wrong on it, `raw` lines sent as they
//! are typed, `typed` the commands by name, `words` what the drive says in words, `found` what is found out after a loss.

mod found;
mod line;
mod raw;
mod typed;
mod words;

use crate::connect::Connect;
use crate::error::{Error, LineError};
use crate::wire::Timeouts;
pub use raw::RawReply;
pub use typed::Smd3Status;

use found::Found;
use line::{Line, Lost};
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use stepdrive_proto::smd3::{LineBuf, encode_request};
use stepdrive_spec::smd3::commands::{Access, Command, Kind, Reply, Request, Value};
use stepdrive_spec::smd3::errors::Error as Refusal;
use stepdrive_spec::smd3::flags::Flags;
use tokio::sync::{Mutex, MutexGuard};

/// How often a request that may be sent again is sent.
const TRIES: usize = 3;

/// Set in [`Smd3Client::flags`] when flags have come.
const KNOWN: u64 = 1 << 32;

/// A driver of an SMD3, real or virtual.
///
/// It connects when it is first asked for something, and again after a loss. Nothing that it does by itself moves the motor
/// or changes a setting. Requests are sent one at a time, whoever asks; every call may be dropped at any point.
///
/// # When a reply is lost
///
/// What only reads, sets a value, or stops the motor is sent again. What starts motion, and what is not the same when it is
/// done twice (`CLR`, `LOAD`, `LOADFD`, `STORE`, `RUNB`, setting `PREL`), is not: the state is read, and the error is
/// [`Error::Uncertain`].
///
/// A reply that a well-formed request cannot have (-3, -4, -101, -102) counts as lost at first, since noise may have changed
/// the request. When it comes each time that the request is sent, the drive does not know the command.
///
/// # Errors
///
/// All calls fail with
/// * [`Error::Usage`] when the command does not take this; mostly nothing was sent then, and the error says so;
/// * [`Error::Line`] when the drive cannot be reached or understood;
/// * [`Error::Refused`] when the drive is in another mode or the motor turns (-1, -6);
/// * [`Error::Fault`] when the motor is disabled (-7);
/// * [`Error::Device`] when the drive failed to do it (-5), or does not know the command;
/// * [`Error::Differs`] when the value set is not the one sent;
/// * [`Error::Uncertain`] as above.
pub struct Smd3Client {
    name: String,
    line: Mutex<Line>,
    /// The flags of the last reply, and [`KNOWN`].
    flags: AtomicU64,
    upsets: AtomicU64,
}

impl Smd3Client {
    /// A driver of the drive that `connect` leads to. Nothing is opened yet.
    pub fn new(connect: impl Connect + 'static, timeouts: Timeouts) -> Smd3Client {
        let name = connect.name().to_owned();
        let line = Mutex::new(Line::new(Box::new(connect), timeouts));
        Smd3Client { name, line, flags: AtomicU64::new(0), upsets: AtomicU64::new(0) }
    }

    /// What errors call the drive.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The flags of the last reply; `None` before the first.
    pub fn last_flags(&self) -> Option<Flags> {
        let bits = self.flags.load(Ordering::Relaxed);
        let [low, high, error_low, error_high, ..] = bits.to_le_bytes();
        let (status, error) = (u16::from_le_bytes([low, high]), u16::from_le_bytes([error_low, error_high]));
        (bits & KNOWN != 0).then_some(Flags { status, error })
    }

    /// How often the line was opened or had to be put in order. Another number than before: something may have happened to
    /// the drive meanwhile.
    pub fn upsets(&self) -> u64 {
        self.upsets.load(Ordering::Relaxed)
    }

    /// Reads a value.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn get(&self, command: Command) -> Result<Value, Error> {
        if matches!(command.info().access, Access::Action) {
            return Err(Error::Usage(format!("{command} is done, not read; nothing was sent")));
        }
        let value = self.request(Request { command, argument: None }).await?;
        value.ok_or_else(|| self.lacks_value(command))
    }

    /// Reads a value as a number, BOOL as 0 and 1.
    ///
    /// # Errors
    /// See [`Smd3Client`]; [`Error::Usage`] when the command reads as a text.
    pub async fn get_number(&self, command: Command) -> Result<f64, Error> {
        number(self.get(command).await?)
            .ok_or_else(|| Error::Usage(format!("{command} reads as a text, not as a number")))
    }

    /// Sets a value, and answers what the drive has made of it: the nearest that it can.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn set(&self, command: Command, value: Value) -> Result<Value, Error> {
        if command.info().starts {
            return Err(Error::Usage(format!("{command} starts motion and is no setting; nothing was sent")));
        }
        let answered = self.request(Request { command, argument: Some(value) }).await?;
        // LP answers nothing on some drives.
        let set = answered.unwrap_or(value);
        if is_kept_exactly(command) && number(set) != number(value) {
            let (asked, set) = (words::value_text(value), words::value_text(set));
            return Err(Error::Differs(format!(
                "{command} was set to {asked}, and the drive answered {set}; read it again"
            )));
        }
        Ok(set)
    }

    /// Sets a value given as a number, BOOL as 0 or 1.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn set_number(&self, command: Command, number: f64) -> Result<Value, Error> {
        self.set(command, words::value_of(command, number)?).await
    }

    /// Does what takes no argument, as `STOP` or `CLR`.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn act(&self, command: Command) -> Result<(), Error> {
        if command.info().access != Access::Action {
            return Err(Error::Usage(format!("{command} is not done by itself; nothing was sent")));
        }
        self.request(Request { command, argument: None }).await.map(|_| ())
    }

    /// Sends any request, and answers the value of the reply, if it has one.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn request(&self, request: Request) -> Result<Option<Value>, Error> {
        self.ask(request).await.map(|(value, _)| value)
    }

    /// Sends any request, and answers the value of the reply, if it has one, and its flags.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn ask(&self, request: Request) -> Result<(Option<Value>, Flags), Error> {
        words::check(&request)?;
        let mut line = self.line.lock().await;
        let reply = match self.exchange(&mut line, &request).await {
            Ok(reply) => reply,
            Err(lost) if lost.sent && !may_repeat(&request) => {
                return Err(self.uncertain(&mut line, &request, lost).await);
            }
            Err(lost) => return Err(lost.cause.into()),
        };
        match reply.outcome {
            Ok(value) => Ok((value, reply.flags)),
            Err(refusal) => {
                let found = self.look_into(&mut line, refusal, reply.flags).await;
                Err(words::refused(&request, refusal, &found))
            }
        }
    }

    /// The line that a request is sent as, without its end.
    ///
    /// # Errors
    /// [`Error::Usage`] when the command does not take this.
    pub fn line_of(request: &Request) -> Result<String, Error> {
        words::check(request)?;
        let mut line = LineBuf::new();
        encode_request(&mut line, request)
            .map_err(|error| Error::Usage(format!("{} cannot be sent: {error}", request.command)))?;
        Ok(String::from_utf8_lossy(&line).trim_end().to_owned())
    }

    /// Sends a request, again where that is the same, and keeps the flags.
    async fn exchange(&self, line: &mut MutexGuard<'_, Line>, request: &Request) -> Result<Reply, Lost> {
        let mut tries = 1;
        let mut unknown = Vec::new();
        loop {
            let outcome = line.exchange(request).await;
            self.upsets.store(line.upsets(), Ordering::Relaxed);
            match outcome {
                Ok(reply) => {
                    self.keep(reply.flags);
                    return Ok(reply);
                }
                Err(Lost { unknown: Some(reply), .. }) if is_firm(&unknown, &reply) => {
                    line.believe();
                    self.keep(reply.flags);
                    return Ok(reply);
                }
                // What could not be sent at all is told at once; the next call tries again.
                Err(lost) if !lost.sent || !may_repeat(request) || tries >= TRIES => return Err(lost),
                Err(lost) => {
                    unknown.extend(lost.unknown);
                    tries += 1;
                }
            }
        }
    }

    /// Keeps the flags of a reply.
    fn keep(&self, flags: Flags) {
        let flags = u64::from(flags.error) << 16 | u64::from(flags.status);
        self.flags.store(flags | KNOWN, Ordering::Relaxed);
    }

    /// The error for a command that may or may not have been carried out.
    async fn uncertain(&self, line: &mut MutexGuard<'_, Line>, request: &Request, lost: Lost) -> Error {
        let mut found = Found { position: self.peek(line, Command::Pact).await, ..Found::default() };
        if found.position.is_some() {
            found.velocity = self.peek(line, Command::Vact).await;
            found.mode = self.peek_mode(line).await;
            found.flags = self.last_flags().unwrap_or_default();
        }
        Error::Uncertain { command: words::request_text(request), cause: lost.cause, state: found.told() }
    }

    /// What there is to say about a refusal beyond its number.
    async fn look_into(&self, line: &mut MutexGuard<'_, Line>, refusal: Refusal, flags: Flags) -> Found {
        let mut found = Found { flags, ..Found::default() };
        if refusal == Refusal::StopMotorFirst {
            found.velocity = self.peek(line, Command::Vact).await;
        } else if refusal == Refusal::NotPossibleInMode {
            found.mode = self.peek_mode(line).await;
        }
        found
    }

    /// A number for a message; `None` when it cannot be had.
    async fn peek(&self, line: &mut MutexGuard<'_, Line>, command: Command) -> Option<f64> {
        let reply = self.exchange(line, &Request { command, argument: None }).await.ok()?;
        number(reply.outcome.ok()??)
    }

    async fn peek_mode(
        &self,
        line: &mut MutexGuard<'_, Line>,
    ) -> Option<stepdrive_spec::smd3::commands::Mode> {
        let reply = self.exchange(line, &Request { command: Command::Mode, argument: None }).await.ok()?;
        if let Value::Mode(mode) = reply.outcome.ok()?? { Some(mode) } else { None }
    }

    fn lacks_value(&self, command: Command) -> Error {
        let what = format!("the reply to {command} lacks a value");
        LineError::Garbled { to: self.name.clone(), what }.into()
    }
}

impl fmt::Debug for Smd3Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Smd3Client")
            .field("name", &self.name)
            .field("flags", &self.last_flags())
            .finish_non_exhaustive()
    }
}

/// A value as a number, a mode as its own; `None` of a text.
pub(crate) fn number(value: Value) -> Option<f64> {
    match value {
        Value::Int(value) => Some(value as f64),
        Value::Uint(value) => Some(value as f64),
        Value::Float(value) => Some(value),
        Value::Bool(value) => Some(f64::from(u8::from(value))),
        Value::Mode(mode) => Some(f64::from(mode.number())),
        Value::Sign(_) | Value::Text(_) | Value::FlagTable => None,
    }
}

/// Whether the drive refuses a request as it did each time before, as often as it was sent.
fn is_firm(before: &[Reply], reply: &Reply) -> bool {
    before.len() + 1 >= TRIES && before.iter().all(|other| other.outcome == reply.outcome)
}

/// Whether sending a request twice is the same as sending it once, whatever happens between.
fn may_repeat(request: &Request) -> bool {
    match request.command.info().access {
        Access::Read => true,
        // PREL counts on while the motor turns.
        Access::ReadWrite => request.argument.is_none() || request.command != Command::Prel,
        Access::Write => !request.command.info().starts,
        Access::Action => matches!(request.command, Command::Stop | Command::Sstop | Command::Estop),
    }
}

/// Whether a setting is kept as it is sent, instead of being rounded to what the drive can make.
fn is_kept_exactly(command: Command) -> bool {
    matches!(command.info().kind, Kind::Bool | Kind::Uint) && command != Command::Res
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smd3::commands::COMMANDS;

    #[test]
    fn nothing_that_starts_motion_or_wears_the_flash_is_ever_sent_twice() {
        for row in &COMMANDS {
            let argument = (row.access == Access::Write).then_some(Value::Bool(true));
            let repeated = may_repeat(&Request { command: row.command, argument });
            let once = matches!(
                row.command,
                Command::Clr
                    | Command::Load
                    | Command::Store
                    | Command::Loadfd
                    | Command::Runb
                    | Command::Runv
            ) || matches!(row.command, Command::Runa | Command::Runr | Command::Runh);
            assert_eq!(repeated, !once, "{}", row.mnemonic);
            assert!(!row.starts || !repeated, "{}", row.mnemonic);
        }
        assert!(!may_repeat(&Request { command: Command::Prel, argument: Some(Value::Float(0.0)) }));
    }

    #[test]
    fn a_request_is_shown_as_the_line_that_it_is_sent_as() {
        let line = |command, argument| Smd3Client::line_of(&Request { command, argument });
        assert_eq!(line(Command::Vmax, Some(Value::Float(500.0))), Ok("VMAX,500.0".to_owned()));
        assert_eq!(line(Command::Stop, None), Ok("STOP".to_owned()));
        assert!(line(Command::Runa, None).is_err());
    }
}
