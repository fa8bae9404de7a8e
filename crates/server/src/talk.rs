//! What is said on a connection, without the socket: requests in, replies out, and the trouble of the line in between.
//!
//! The server's transports and [`crate::replay`] go through here alike, so that what was recorded from a socket can be
//! answered again without one.

use crate::link::{Fate, Link, Outgoing, Protocol};
use crate::recording::Via;
use crate::world::settle;
use stepdrive_drive::smd3::Stored;
use stepdrive_drive::smsd::{Session, Smsd, StandardSession};
use stepdrive_proto::modbus::{self, Adu, Frame};
use stepdrive_proto::smd3::{self, Line, LineBuf};
use stepdrive_proto::smsd::{PacketBuf, Taken, decode_request, encode_greeting, encode_reply};
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::group::Group;
use stepdrive_rig::line::LineFaults;
use stepdrive_rig::machine::Machine;
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smd3::commands::{self, Command, Request};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smsd::standard::{Answer, Code, Counter, Reply};

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
                let answered = match &modbus::decode_request(pdu) {
                    Ok(request) => group.change(member, |machine, now| {
                        let machine = machine.smsd_mut().filter(|machine| machine.powered())?;
                        if unit != 0 && unit != 255 && unit != machine.drive().unit() {
                            return None;
                        }
                        modbus::encode_reply(
                            reply,
                            transaction,
                            unit,
                            request,
                            &machine.handle(now, session, request),
                        );
                        Some(())
                    }),
                    Err(refusal) => {
                        modbus::encode_refusal(reply, transaction, unit, *refusal);
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
        match modbus::decode_request(pdu) {
            Ok(request) => {
                modbus::encode_reply(&mut self.reply, transaction, unit, &request, &Err(exception));
            }
            Err(refusal) => modbus::encode_refusal(&mut self.reply, transaction, unit, refusal),
        }
    }
}

/// What is wrong on a drive's line, and how many outages it has had.
fn line_of(group: &Group, member: usize) -> Option<(LineFaults, u32)> {
    group.members().get(member).map(|member| (*member.line(), member.outages()))
}

/// Whether a drive is on and answers to this unit identifier.
fn is_meant(group: &Group, member: usize, unit: u8) -> bool {
    standing(group, member).is_some_and(|machine| unit == 0 || unit == 255 || unit == machine.drive().unit())
}

/// Lets an SMSD count an error that has its cause outside the rig. One that is off counts nothing.
pub(crate) fn count(group: &mut Group, member: usize, counter: Counter) {
    settle(group);
    let machine = group.machine_mut(member).and_then(AnyMachine::smsd_mut);
    if let Some(machine) = machine.filter(|machine| machine.powered()) {
        machine.drive_mut().count(counter);
    }
}

/// A client of an SMSD by the standard protocol.
#[derive(Debug)]
pub(crate) struct PacketTalk {
    via: Via,
    session: StandardSession,
    link: Link,
    reply: PacketBuf,
    /// The identification of the last reply.
    id: u8,
    /// How many outages the drive had had when the session began. Another one ends it.
    outages: Option<u32>,
}

impl PacketTalk {
    /// A client that has just connected.
    pub(crate) fn new(via: Via, seed: u64, connection: u64) -> PacketTalk {
        PacketTalk {
            via,
            session: session(via),
            link: Link::new(Protocol::Packets, seed, connection),
            reply: PacketBuf::new(),
            id: 0,
            outages: None,
        }
    }

    /// What the drive says over LAN before it is asked, into `out`: it asks for the password.
    pub(crate) fn greet(&mut self, group: &mut Group, member: usize, out: &mut Outgoing) {
        settle(group);
        let Some((faults, outages)) = line_of(group, member) else { return };
        self.outages = Some(outages);
        if let Some(machine) = standing(group, member) {
            encode_greeting(&mut self.reply, machine.drive().protocol_version());
            self.link.reply(&faults, &self.reply, out);
        }
    }

    /// Answers a packet at the present time of the group, into `out`. What is due by then happens first.
    pub(crate) fn hear(
        &mut self,
        group: &mut Group,
        member: usize,
        packet: &Taken<'_>,
        out: &mut Outgoing,
    ) -> Heard {
        settle(group);
        let Some((faults, outages)) = line_of(group, member) else { return Heard::Taken };
        if *self.outages.get_or_insert(outages) != outages {
            if self.via == Via::Standard {
                return Heard::Cut;
            }
            // A serial port stays open while its drive has no supply, but nobody is logged in any more.
            (self.session, self.outages) = (session(self.via), Some(outages));
        }
        match self.link.request(&faults) {
            Fate::Cut => return Heard::Cut,
            // Packets have no exceptions to refuse with.
            Fate::Swallow | Fate::Refuse(_) => return Heard::Taken,
            Fate::Deliver => {}
        }
        self.id = packet.id ^ self.link.change_of_id(&faults);
        let (framing, id) = (self.via.framing(), self.id);
        let (session, buffer) = (&mut self.session, &mut self.reply);
        let answered = group.change(member, |machine, now| {
            let machine = machine.smsd_mut().filter(|machine| machine.powered())?;
            let firmware = machine.drive().firmware();
            let request = match &packet.packet {
                Ok(packet) => decode_request(packet, firmware),
                Err(malformed) => Err(*malformed),
            };
            let reply = machine.handle_standard(now, session, request.as_ref().map_err(|error| *error))?;
            encode_reply(buffer, framing, machine.drive().protocol_version(), id, &reply);
            Some(())
        });
        if answered.flatten().is_some() {
            self.link.reply(&faults, &self.reply, out);
        }
        Heard::Taken
    }

    /// What the last packet changed or showed could not be stored: its answer is `ERROR_WRITE`, if it was answered at all.
    pub(crate) fn not_stored(&mut self, group: &Group, member: usize, out: &mut Outgoing) {
        let Some(machine) = standing(group, member).filter(|_| !out.is_empty()) else { return };
        let status = machine.drive().status(group.now());
        let reply = Reply::Response(Answer { status, code: Code::ErrorWrite, data: 0 });
        let version = machine.drive().protocol_version();
        encode_reply(&mut self.reply, self.via.framing(), version, self.id, &reply);
        out.clear();
        out.push(&self.reply);
    }
}

fn session(via: Via) -> StandardSession {
    match via {
        Via::Usb => StandardSession::usb(),
        Via::Standard => StandardSession::lan(),
    }
}

/// An SMSD that has its supply.
fn standing(group: &Group, member: usize) -> Option<&Machine<Smsd>> {
    let machine = group.members().get(member).and_then(|member| member.machine().smsd());
    machine.filter(|machine| machine.powered())
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
            smd3::encode_reply(reply, &machine.handle(now, line));
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
        smd3::encode_reply(
            &mut self.reply,
            &commands::Reply { flags: flags.unwrap_or_default(), outcome: Err(error) },
        );
        out.clear();
        out.push(&self.reply);
    }
}
