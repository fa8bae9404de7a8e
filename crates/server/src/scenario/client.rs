//! A scenario's own connection to a drive: bytes in and out, as on a socket, and into the recording.

use super::send::{Sending, Sent, login, read_flag};
use crate::link::Outgoing;
use crate::recording::{Entry, Happened, hex};
use crate::talk::{Heard, LineTalk, ModbusTalk};
use crate::world::World;
use std::fmt::Display;
use stepdrive_drive::smsd::WordOrder;
use stepdrive_proto::modbus::{Adu, ReplyError, Split, decode_reply, encode_request, split};
use stepdrive_proto::smd3::{Line, decode_reply as decode_line_reply, split_reply};
use stepdrive_rig::group::Group;
use stepdrive_spec::modbus::{Exception, Reply, Request};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::time::Instant;

/// The unit identifier that says "whoever listens here".
const ANY_UNIT: u8 = 255;

/// What ends a line. CR LF does as well, but a line ends at its CR.
const LINE_END: u8 = b'\r';

/// A connection to a drive.
#[derive(Debug)]
pub(super) struct Client {
    drive: usize,
    number: u64,
    talk: Talk,
}

#[derive(Debug)]
enum Talk {
    Modbus { talk: Box<ModbusTalk>, transaction: u16 },
    Lines(Box<LineTalk>),
}

/// The drive that a client speaks to, at its present time.
pub(super) struct Peer<'a> {
    pub(super) world: &'a World,
    pub(super) group: &'a mut Group,
    /// Which member of the group it is.
    pub(super) member: usize,
}

impl Peer<'_> {
    fn name(&self, drive: usize) -> String {
        self.world.rig().drives.get(drive).map(|drive| drive.name.clone()).unwrap_or_default()
    }

    fn word_order(&self, drive: usize) -> Option<WordOrder> {
        Some(self.world.rig().drives.get(drive)?.smsd()?.word_order)
    }
}

impl Client {
    /// Connects to a drive; to an SMSD it logs in. What went wrong is said.
    pub(super) fn connect(peer: &mut Peer<'_>, drive: usize, password: u64) -> (Client, Result<(), String>) {
        let number = peer.world.new_connection();
        let seed = peer.world.rig().seed;
        peer.world.write(|| {
            Entry::new(peer.group.now(), Happened::Open { conn: number, drive, via: None, panel: false })
        });
        let Some(order) = peer.word_order(drive) else {
            let talk = Talk::Lines(Box::new(LineTalk::new(seed, number)));
            return (Client { drive, number, talk }, Ok(()));
        };
        let talk = Talk::Modbus { talk: Box::new(ModbusTalk::new(seed, number)), transaction: 0 };
        let mut client = Client { drive, number, talk };
        let logged_in = client.log_in(peer, password, order);
        (client, logged_in)
    }

    /// The drive that it is connected to.
    pub(super) fn drive(&self) -> usize {
        self.drive
    }

    /// Leaves.
    pub(super) fn shut(self, world: &World, now: Instant) {
        world.write(|| Entry::new(now, Happened::Shut { conn: self.number }));
    }

    /// Sends, and sees whether it is taken as it is to be.
    pub(super) fn send(&mut self, peer: &mut Peer<'_>, sending: &Sending) -> Result<(), String> {
        match &sending.what {
            Sent::Line(line, wanted) => as_wanted(self.say(peer, line)?, *wanted),
            Sent::Write(request, wanted) => as_wanted(self.ask(peer, request)?.map(drop), *wanted),
            Sent::Command(requests, refused) => {
                for request in requests {
                    as_wanted(self.ask(peer, request)?.map(drop), None)?;
                }
                match (self.flag(peer, Reg::CmdError)?, refused) {
                    (true, false) => {
                        Err("CMD_ERROR is set: it was refused now, or a command before was".to_owned())
                    }
                    (false, true) => Err("it was not refused with CMD_ERROR".to_owned()),
                    (true, true) | (false, false) => Ok(()),
                }
            }
        }
    }

    fn log_in(&mut self, peer: &mut Peer<'_>, password: u64, order: WordOrder) -> Result<(), String> {
        as_wanted(self.ask(peer, &login(password, order))?.map(drop), None)?;
        if self.flag(peer, Reg::AccessFlag)? {
            return Ok(());
        }
        let name = peer.name(self.drive);
        Err(format!("{name} does not accept the password; give its own as password = \"0x…\" at the top"))
    }

    fn flag(&mut self, peer: &mut Peer<'_>, flag: Reg) -> Result<bool, String> {
        match self.ask(peer, &read_flag(flag))? {
            Ok(Reply::Bits(bits)) => Ok(bits.get(0) == Some(true)),
            Ok(Reply::Words(_) | Reply::Written) => Ok(false),
            Err(exception) => Err(refusal(exception)),
        }
    }

    /// Sends a request to an SMSD.
    fn ask(&mut self, peer: &mut Peer<'_>, request: &Request) -> Result<Result<Reply, Exception>, String> {
        let Talk::Modbus { talk, transaction } = &mut self.talk else {
            return Err(no_answer(peer, self.drive));
        };
        *transaction = transaction.wrapping_add(1);
        let (sent, mut adu, mut out) = (*transaction, Adu::new(), Outgoing::new());
        if encode_request(&mut adu, sent, ANY_UNIT, request).is_err() {
            return Err("it is no request of Modbus".to_owned());
        }
        let Split::Frame { frame, .. } = split(&adu) else { return Err(no_answer(peer, self.drive)) };
        let heard = talk.hear(peer.group, peer.member, &frame, &mut out);
        self.record(peer, &adu, &out, heard);
        let Split::Frame { frame, .. } = split(out.bytes()) else { return Err(no_answer(peer, self.drive)) };
        if frame.transaction != sent {
            return Err(format!("the answer has transaction identifier {}, not {sent}", frame.transaction));
        }
        match decode_reply(frame.pdu, request) {
            Ok(reply) => Ok(Ok(reply)),
            Err(ReplyError::Exception(exception)) => Ok(Err(exception)),
            Err(error) => Err(error.to_string()),
        }
    }

    /// Sends a line to an SMD3.
    fn say(
        &mut self,
        peer: &mut Peer<'_>,
        line: &str,
    ) -> Result<Result<(), stepdrive_spec::smd3::errors::Error>, String> {
        let Talk::Lines(talk) = &mut self.talk else { return Err(no_answer(peer, self.drive)) };
        let line = line.as_bytes();
        let mut out = Outgoing::new();
        let (heard, _) = talk.hear(peer.group, peer.member, Line::Text(line), &mut out);
        self.record(peer, &[line, &[LINE_END]].concat(), &out, heard);
        let Some((reply, _)) = split_reply(out.bytes()) else { return Err(no_answer(peer, self.drive)) };
        // What is refused because there is no such command is answered as any other is.
        let request = Line::Text(line).decode().ok().flatten();
        let command = request.map_or(Command::Clr, |request| request.command);
        match decode_line_reply(reply, command) {
            Ok(reply) => Ok(reply.outcome.map(drop)),
            Err(error) => Err(format!("{error}: {}", reply.escape_ascii())),
        }
    }

    fn record(&self, peer: &Peer<'_>, rx: &[u8], out: &Outgoing, heard: Heard) {
        peer.world.write(|| {
            let (rx, tx, cut) = (hex(rx), hex(out.bytes()), heard == Heard::Cut);
            Entry::new(peer.group.now(), Happened::Heard { conn: self.number, rx, tx, cut })
        });
    }
}

/// That nothing came back, and why that may be.
fn no_answer(peer: &Peer<'_>, drive: usize) -> String {
    let name = peer.name(drive);
    let on = peer.group.members().get(peer.member).is_some_and(|member| member.machine().powered());
    if on { format!("{name} gave no answer") } else { format!("{name} gave no answer: it is switched off") }
}

fn refusal(refused: impl Display) -> String {
    format!("it was refused: {refused}")
}

/// Whether something was taken, or refused, as it is to be.
fn as_wanted<E: Display + PartialEq>(outcome: Result<(), E>, wanted: Option<E>) -> Result<(), String> {
    match (outcome, wanted) {
        (Ok(()), None) => Ok(()),
        (Ok(()), Some(wanted)) => Err(format!("it was taken, and not refused with {wanted}")),
        (Err(refused), None) => Err(refusal(refused)),
        (Err(refused), Some(wanted)) if refused == wanted => Ok(()),
        (Err(refused), Some(wanted)) => Err(format!("it was refused with {refused}, and not {wanted}")),
    }
}
