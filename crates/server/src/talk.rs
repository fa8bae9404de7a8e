//! What is said on a connection, without the socket: requests in, replies out, and the trouble of the line in between.
//!
//! The server's transports and [`crate::replay`] go through here alike, so that what was recorded from a socket can be
//! answered again without one.

use crate::link::{Fate, Link, Outgoing, Protocol};
use crate::world::settle;
use stepdrive_drive::smd3::Stored;
use stepdrive_drive::smsd::Session;
use stepdrive_proto::modbus::{Adu, Frame, decode_request, encode_refusal, encode_reply};
use stepdrive_proto::smd3::{Line, LineBuf, encode_reply as encode_line_reply};
use stepdrive_rig::group::Group;
use stepdrive_rig::line::LineFaults;
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smd3::commands::{Command, Reply, Request};
use stepdrive_spec::smd3::errors::Error;

/// How a drive's line takes a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// It was taken. The reply, if there is one, is in the outgoing bytes.
    Taken,
    /// The connection is gone.
    Cut,
}

/// A client of an SMSD.
#[derive(Debug)]
pub(crate) struct ModbusTalk {
    session: Session,
    link: Link,
    reply: Adu,
    /// How many outages the drive had had when the first request came. Another one ends the connection, also when it is
    /// over before anybody has seen to it.
    outages: Option<u32>,
}

impl ModbusTalk {
    /// A client that has just connected.
    pub(crate) fn new(seed: u64, connection: u64) -> ModbusTalk {
        ModbusTalk {
            session: Session::new(),
            link: Link::new(Protocol::Modbus, seed, connection),
            reply: Adu::new(),
            outages: None,
        }
    }

    /// Answers a frame at the present time of the group, into `out`. What is due by then happens first.
    pub(crate) fn hear(
        &mut self,
        group: &mut Group,
        member: usize,
        frame: &Frame<'_>,
        out: &mut Outgoing,
    ) -> Heard {
        settle(group);
        let Some((faults, outages)) = line_of(group, member) else { return Heard::Taken };
        if *self.outages.get_or_insert(outages) != outages {
            return Heard::Cut;
        }
        let Frame { transaction, unit, pdu } = *frame;
        match self.link.request(&faults) {
            Fate::Cut => return Heard::Cut,
            Fate::Swallow => return Heard::Taken,
            Fate::Refuse(exception) => self.refuse(frame, exception),
            Fate::Deliver => {
                let (session, reply) = (&mut self.session, &mut self.reply);
                // By reference, since a request or a reply has room for the most that Modbus allows, and moving it copies
                // all.
                let answered = match &decode_request(pdu) {
                    Ok(request) => group.change(member, |machine, now| {
                        let machine = machine.smsd_mut().filter(|machine| machine.powered())?;
                        if unit != 0 && unit != 255 && unit != machine.drive().unit() {
                            return None;
                        }
                        encode_reply(
                            reply,
                            transaction,
                            unit,
                            request,
                            &machine.handle(now, session, request),
                        );
                        Some(())
                    }),
                    Err(refusal) => {
                        encode_refusal(reply, transaction, unit, *refusal);
                        Some(is_meant(group, member, unit).then_some(()))
                    }
                };
                if answered.flatten().is_none() {
                    return Heard::Taken;
                }
            }
        }
        self.link.reply(&faults, &self.reply, out);
        Heard::Taken
    }

    /// What the last frame changed or showed could not be stored: its answer is exception 04, if it was answered at all.
    pub(crate) fn not_stored(&mut self, frame: &Frame<'_>, out: &mut Outgoing) {
        if out.is_empty() {
            return;
        }
        self.refuse(frame, Exception::ServerDeviceFailure);
        out.clear();
        out.push(&self.reply);
    }

    fn refuse(&mut self, frame: &Frame<'_>, exception: Exception) {
        let Frame { transaction, unit, pdu } = *frame;
        match decode_request(pdu) {
            Ok(request) => encode_reply(&mut self.reply, transaction, unit, &request, &Err(exception)),
            Err(refusal) => encode_refusal(&mut self.reply, transaction, unit, refusal),
        }
    }
}

/// What is wrong on a drive's line, and how many outages it has had.
fn line_of(group: &Group, member: usize) -> Option<(LineFaults, u32)> {
    group.members().get(member).map(|member| (*member.line(), member.outages()))
}

/// Whether a drive is on and answers to this unit identifier.
fn is_meant(group: &Group, member: usize, unit: u8) -> bool {
    let machine = group.members().get(member).and_then(|member| member.machine().smsd());
    machine.is_some_and(|machine| {
        machine.powered() && (unit == 0 || unit == 255 || unit == machine.drive().unit())
    })
}

/// A client of an SMD3.
#[derive(Debug)]
pub(crate) struct LineTalk {
    link: Link,
    reply: LineBuf,
}

impl LineTalk {
    /// A client that has just connected.
    pub(crate) fn new(seed: u64, connection: u64) -> LineTalk {
        LineTalk { link: Link::new(Protocol::Lines, seed, connection), reply: LineBuf::new() }
    }

    /// Answers a line at the present time of the group, into `out`. What is due by then happens first. What the flash held
    /// before a `STORE` is returned.
    pub(crate) fn hear(
        &mut self,
        group: &mut Group,
        member: usize,
        line: Line<'_>,
        out: &mut Outgoing,
    ) -> (Heard, Option<Stored>) {
        settle(group);
        let Some((faults, _)) = line_of(group, member) else { return (Heard::Taken, None) };
        match self.link.request(&faults) {
            Fate::Cut => return (Heard::Cut, None),
            // An SMD3 has no exceptions to refuse with.
            Fate::Swallow | Fate::Refuse(_) => return (Heard::Taken, None),
            Fate::Deliver => {}
        }
        let line = line.decode();
        let may_store = matches!(line, Ok(Some(Request { command: Command::Store, .. })));
        let reply = &mut self.reply;
        let answered = group.change(member, |machine, now| {
            let machine = machine.smd3_mut().filter(|machine| machine.powered())?;
            let generation = machine.drive().memory_generation();
            let before = may_store.then(|| *machine.drive().stored());
            encode_line_reply(reply, &machine.handle(now, line));
            Some(before.filter(|_| machine.drive().memory_generation() != generation))
        });
        let Some(stored) = answered.flatten() else { return (Heard::Taken, None) };
        self.link.reply(&faults, &self.reply, out);
        (Heard::Taken, stored)
    }

    /// The last line was a `STORE` that failed: the flash still holds what it held before, and the answer is -5 with the
    /// flags as they are now, if the line gave one at all.
    pub(crate) fn undo_store(
        &mut self,
        group: &mut Group,
        member: usize,
        before: &Stored,
        out: &mut Outgoing,
    ) {
        if let Some(machine) = group.machine_mut(member).and_then(|machine| machine.smd3_mut()) {
            machine.drive_mut().undo_store(*before);
        }
        if !out.is_empty() {
            self.fail(group, member, Error::ActionFailed, out);
        }
    }

    fn fail(&mut self, group: &Group, member: usize, error: Error, out: &mut Outgoing) {
        let flags =
            group.members().get(member).and_then(|member| Some(member.machine().smd3()?.drive().flags()));
        encode_line_reply(&mut self.reply, &Reply { flags: flags.unwrap_or_default(), outcome: Err(error) });
        out.clear();
        out.push(&self.reply);
    }
}
