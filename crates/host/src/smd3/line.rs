//! The line to the drive: one request in flight, and what is done when something goes wrong on it.
//!
//! The drive answers every line in the order in which they come. So after a reply was lost, or nobody waited for it, a
//! line is settled before it is used again: a line that cannot be taken for a command is sent, what is still to come is read
//! until its answer or until it is quiet, and a cheap query proves that requests and replies match again.

use super::number;
use crate::connect::Connect;
use crate::error::LineError;
use crate::units::shown;
use crate::wire::{Timeouts, Wire};
use std::time::Duration;
use stepdrive_proto::smd3::{LineBuf, ReplyError, decode_reply, encode_request, split_reply};
use stepdrive_spec::smd3::commands::{Command, FARTHEST, Reply, Request};
use stepdrive_spec::smd3::errors::Error as Refusal;
use tokio::time::Instant;

/// Ends whatever half a line the drive may hold so that it is none of its commands: behind `RUNA,10` it makes two
/// arguments, behind `STO` a mnemonic that does not exist, by itself an empty mnemonic. A bare CR LF would carry it out.
const SPOIL: &[u8] = b",?\r\n";

/// A line on which nothing has come for so long has nothing to come any more.
const QUIET: Duration = Duration::from_millis(100);

/// How often it is tried to settle a line before it is closed.
const ATTEMPTS: u32 = 3;

/// Why an exchange failed, and whether the drive may have taken the request.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lost {
    pub(super) cause: LineError,
    /// Some of the request has gone out.
    pub(super) sent: bool,
    /// What came refuses what is no command. Noise may have made such a line of the request, or the drive does not know it.
    pub(super) unknown: Option<Reply>,
}

impl Lost {
    fn new(cause: LineError, sent: bool) -> Lost {
        Lost { cause, sent, unknown: None }
    }
}

/// What came in reply to a line that was sent as it is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Heard {
    /// The reply, fit to be shown.
    pub(super) text: String,
    /// What it says, or why it cannot be understood; it begins with flags in any case.
    pub(super) reply: Result<Reply, ReplyError>,
}

/// The line.
#[derive(Debug)]
pub(super) struct Line {
    wire: Wire,
    /// The replies that come are those to what is sent. While a request is on its way this is `false`.
    settled: bool,
    /// How often it had to be settled.
    upsets: u64,
    /// How many [`SPOIL`]s have gone out to which no answer has come.
    spoils: u32,
}

impl Line {
    pub(super) fn new(connect: Box<dyn Connect>, timeouts: Timeouts) -> Line {
        Line { wire: Wire::new(connect, timeouts), settled: false, upsets: 0, spoils: 0 }
    }

    /// How often it had to be settled, the first time among them. Another number: much may have happened meanwhile.
    pub(super) fn upsets(&self) -> u64 {
        self.upsets
    }

    /// Sends a request and waits for its reply. May be dropped at any point.
    pub(super) async fn exchange(&mut self, request: &Request) -> Result<Reply, Lost> {
        let mut line = LineBuf::new();
        encode_request(&mut line, request).map_err(|error| self.unsendable(error))?;
        self.ready().await.map_err(|cause| Lost::new(cause, false))?;
        self.send(&line, request.command).await
    }

    /// Takes the last reply, which was none to a command, for what the drive has to say: the line is in order.
    pub(super) fn believe(&mut self) {
        self.settled = true;
        self.wire.prove();
    }

    /// Sends a line as it is, without its end, and waits for its reply, decoded as one to `command`. May be dropped at any
    /// point.
    pub(super) async fn exchange_text(&mut self, text: &str, command: Command) -> Result<Heard, Lost> {
        self.ready().await.map_err(|cause| Lost::new(cause, false))?;
        self.settled = false;
        self.wire.queue(format!("{text}\r\n").as_bytes());
        let received = self.receive_line(self.deadline()).await;
        let line = received.map_err(|cause| Lost::new(cause, true))?;
        let reply = decode_reply(&line, command);
        if reply == Err(ReplyError::Flags) {
            return Err(Lost::new(self.garbled(&line, ReplyError::Flags), true));
        }
        self.settled = true;
        self.wire.prove();
        Ok(Heard { text: shown_lines(&line), reply })
    }

    async fn send(&mut self, line: &[u8], command: Command) -> Result<Reply, Lost> {
        self.settled = false;
        self.wire.queue(line);
        let received = self.receive_line(self.deadline()).await;
        // A line that failed is closed, and knows no more whether something has gone out.
        let line = received.map_err(|cause| Lost::new(cause, true))?;
        match decode_reply(&line, command) {
            // Our requests are well formed: this may answer something else, as what settled the line.
            Ok(reply @ Reply { outcome: Err(refusal), .. }) if is_for_nonsense(refusal) => {
                let what = format!("{command} was answered {refusal}, as if it were no command");
                let cause = LineError::Garbled { to: self.wire.name().to_owned(), what };
                Err(Lost { cause, sent: true, unknown: Some(reply) })
            }
            Ok(reply) if is_impossible(command, &reply) => {
                let line = shown(&String::from_utf8_lossy(&line));
                let what = format!("{command} was answered `{line}`, a value that it cannot have");
                let cause = LineError::Garbled { to: self.wire.name().to_owned(), what };
                Err(Lost::new(cause, true))
            }
            Ok(reply) => {
                self.settled = true;
                self.wire.prove();
                Ok(reply)
            }
            Err(error) => Err(Lost::new(self.garbled(&line, error), true)),
        }
    }

    /// Makes the line one on which a request can be sent.
    async fn ready(&mut self) -> Result<(), LineError> {
        if self.settled && self.wire.look().await && self.wire.received().is_empty() {
            return Ok(());
        }
        if !self.settled && !self.wire.withdraw() {
            // Half a line has gone out. The rest must not follow: who sent it does not wait for it any more.
            self.wire.close();
        }
        self.settle().await
    }

    async fn settle(&mut self) -> Result<(), LineError> {
        self.settled = false;
        self.upsets += 1;
        let mut outcome = self.open_and_settle(QUIET).await;
        for _ in 1..ATTEMPTS {
            // What was open may turn out to be gone, and what comes may be left over.
            if !matches!(outcome, Err(LineError::Garbled { .. } | LineError::Lost { .. })) {
                break;
            }
            outcome = self.open_and_settle(self.wire.timeouts().reply).await;
        }
        if outcome.is_err() {
            self.wire.close();
        } else {
            self.settled = true;
            self.wire.prove();
        }
        outcome
    }

    /// Tries to settle the line, on which nothing more comes when nothing has come for a time.
    async fn open_and_settle(&mut self, quiet: Duration) -> Result<(), LineError> {
        self.wire.open().await?;
        self.wire.take(self.wire.received().len());
        self.wire.queue(SPOIL);
        self.spoils += 1;
        self.drain(quiet).await?;
        let query = Request { command: Command::Ser, argument: None };
        let mut line = LineBuf::new();
        encode_request(&mut line, &query).map_err(|error| self.unsendable(error).cause)?;
        self.wire.queue(&line);
        let line = self.receive_line(self.deadline()).await?;
        match decode_reply(&line, query.command) {
            Ok(Reply { outcome: Ok(_), .. }) if self.wire.received().is_empty() => Ok(()),
            Ok(_) => Err(self.garbled(&line, ReplyError::Unexpected)),
            Err(error) => Err(self.garbled(&line, error)),
        }
    }

    /// Reads until something has come and then nothing more for a time. For the shortest such time the answers to all
    /// [`SPOIL`]s will do: nothing that was asked before comes behind them.
    async fn drain(&mut self, quiet: Duration) -> Result<(), LineError> {
        let latest = self.deadline() + quiet;
        let mut deadline = self.deadline();
        let mut heard = false;
        // Who never stops talking is told apart by the query that follows.
        while Instant::now() < latest {
            match self.wire.receive(deadline).await {
                Ok(()) => deadline = latest.min(Instant::now() + quiet),
                Err(LineError::Silent { .. }) if heard => break,
                Err(error) => return Err(error),
            }
            heard = true;
            self.take_answers();
            if self.spoils == 0 && quiet == QUIET && self.wire.received().is_empty() {
                break;
            }
        }
        self.spoils = 0;
        Ok(())
    }

    /// Takes the whole lines that have come, and counts the answers to [`SPOIL`] among them.
    fn take_answers(&mut self) {
        while let Some((line, taken)) = split_reply(self.wire.received()) {
            self.spoils = self.spoils.saturating_sub(u32::from(is_answer_to_nonsense(line)));
            self.wire.take(taken);
        }
    }

    /// Waits for a whole line.
    async fn receive_line(&mut self, deadline: Instant) -> Result<Vec<u8>, LineError> {
        loop {
            if let Some((line, taken)) = split_reply(self.wire.received()) {
                let line = line.to_vec();
                self.wire.take(taken);
                return Ok(line);
            }
            self.wire.receive(deadline).await?;
        }
    }

    fn deadline(&self) -> Instant {
        Instant::now() + self.wire.timeouts().reply
    }

    fn garbled(&self, line: &[u8], error: ReplyError) -> LineError {
        let what = format!("{error} (`{}`)", shown(&String::from_utf8_lossy(line)));
        LineError::Garbled { to: self.wire.name().to_owned(), what }
    }

    /// A request that is not well formed. The client checks requests before, so this is a mistake of ours.
    fn unsendable(&self, error: Refusal) -> Lost {
        let what = format!("a request that cannot be sent: {error}");
        Lost::new(LineError::Garbled { to: self.wire.name().to_owned(), what }, false)
    }
}

/// A reply without what would disturb a terminal. The table of flags keeps its lines and tabs.
fn shown_lines(line: &[u8]) -> String {
    let tame = |c: char| if c.is_control() && !matches!(c, '\n' | '\t') { '\u{FFFD}' } else { c };
    String::from_utf8_lossy(line).chars().map(tame).collect()
}

/// Whether a reply gives a counter or the speed a value far from all that the drive can have.
fn is_impossible(command: Command, reply: &Reply) -> bool {
    let most = if matches!(command, Command::Pact | Command::Prel) {
        // It is printed with six digits, so the last place may be shown a little farther off.
        FARTHEST + 10.0
    } else if command == Command::Vact {
        2.0 * Command::Vmax.info().max
    } else {
        return false;
    };
    reply.outcome.ok().flatten().and_then(number).is_some_and(|value| value.abs() > most)
}

/// Whether a line refuses what is no command: with an error that none of our requests, which are well formed, can have.
fn is_answer_to_nonsense(line: &[u8]) -> bool {
    // The form of a reply's value does not matter here, so any command will do.
    matches!(decode_reply(line, Command::Ser), Ok(Reply { outcome: Err(refusal), .. }) if is_for_nonsense(refusal))
}

/// Whether this refuses what is no command, or no whole one.
fn is_for_nonsense(refusal: Refusal) -> bool {
    match refusal {
        Refusal::UnknownCommand | Refusal::UnableToGet | Refusal::ArgumentType | Refusal::ArgumentCount => {
            true
        }
        Refusal::StopMotorFirst
        | Refusal::ArgumentValidation
        | Refusal::ActionFailed
        | Refusal::NotPossibleInMode
        | Refusal::NotPossibleWhenMotorDisabled => false,
    }
}
