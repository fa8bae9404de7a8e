//! A rig to which everything that was recorded happens again.

use super::words::{self, Tongue};
use super::{Difference, ReplayError, Said, rig};
use crate::link::Outgoing;
use crate::recording::{Happened, Header, Via, hex, state_digest, unhex};
use crate::talk::{Heard, LineTalk, ModbusTalk, PacketTalk, count};
use crate::world::{SLICE, build, is_settled, places};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use stepdrive_drive::smd3::Stored;
use stepdrive_proto::modbus::{Split, split};
use stepdrive_proto::smd3::LineReader;
use stepdrive_proto::smsd::PacketReader;
use stepdrive_rig::action::Action;
use stepdrive_rig::file::{ControllerSection, DriveSection, RigFile};
use stepdrive_rig::group::Group;
use stepdrive_spec::smsd::standard::{COUNTER_ROWS, Firmware};
use stepdrive_spec::time::Instant;

/// The latest time that an entry may have, some 292 years: behind it lies the end of representable time, where whatever
/// waits comes at once and for ever.
const LATEST: Instant = Instant::from_nanos(u64::MAX / 2);

/// A rig, and who is connected to it.
pub(super) struct Player {
    rig: RigFile,
    groups: Vec<Group>,
    /// For each drive the number of its group, and which member of it.
    places: Vec<(usize, usize)>,
    connections: BTreeMap<u64, Connection>,
    /// How many things may still happen by themselves.
    left: u64,
    /// The latest time that was reached.
    latest: Instant,
    requests: usize,
    replies: Sha256,
    differences: usize,
    first_difference: Option<Difference>,
}

/// What came of it.
pub(super) struct Outcome {
    pub(super) requests: usize,
    pub(super) differences: usize,
    pub(super) first_difference: Option<Difference>,
    pub(super) state: String,
    pub(super) digest: String,
}

/// A client.
struct Connection {
    drive: usize,
    talk: Talk,
    /// Its last request.
    request: Vec<u8>,
    /// The last reply.
    out: Outgoing,
}

enum Talk {
    Modbus(ModbusTalk),
    Packets(Box<PacketTalk>, Via),
    Lines {
        talk: LineTalk,
        reader: Box<LineReader>,
        /// What the flash held before the last line, if that was a `STORE`.
        before: Option<Box<Stored>>,
    },
}

/// A reply, as it was recorded or as it is now.
struct Reply<'a> {
    bytes: &'a [u8],
    cut: bool,
}

/// Where in the recording something stands.
#[derive(Clone, Copy)]
struct At {
    line: usize,
    t: Instant,
}

impl Player {
    /// A rig that has just been switched on, in which no more than `most` things may happen by themselves.
    pub(super) fn new(rig: RigFile, header: &Header, most: u64) -> Result<Player, ReplayError> {
        let groups = build(&rig, rig::power_up(&rig, &header.drives)?);
        Ok(Player {
            places: places(&rig, &groups),
            rig,
            groups,
            connections: BTreeMap::new(),
            left: most,
            latest: Instant::ZERO,
            requests: 0,
            replies: Sha256::new(),
            differences: 0,
            first_difference: None,
        })
    }

    /// Lets happen what happened.
    pub(super) fn play(&mut self, line: usize, t: Instant, what: &Happened) -> Result<(), ReplayError> {
        let at = At { line, t };
        match what {
            Happened::Open { conn, drive, via, panel: _ } => self.open(at, *conn, *drive, *via),
            Happened::Greeted { conn, tx } => self.greet(at, *conn, &bytes(at, tx)?),
            Happened::Counted { drive, counter } => self.count(at, *drive, counter),
            Happened::Shut { conn } => self.shut(at, *conn),
            Happened::Heard { conn, rx, tx, cut } => {
                let (rx, tx) = (bytes(at, rx)?, bytes(at, tx)?);
                self.hear(at, *conn, rx, &Reply { bytes: &tx, cut: *cut })
            }
            Happened::NotStored { conn, tx } => self.not_stored(at, *conn, &bytes(at, tx)?),
            Happened::Do(text) => self.act(at, text),
            // Told for the reader. The end is not played but judged.
            Happened::Clock(_) | Happened::End { .. } => Ok(()),
        }
    }

    /// Brings all groups to the end, and compares the state.
    pub(super) fn end(&mut self, line: usize, t: Instant, recorded: &str) -> Result<(), ReplayError> {
        self.bring_all_to(At { line, t })?;
        let replayed = self.state();
        if replayed != recorded {
            let said = |bytes: &str| Said { bytes: bytes.to_owned(), means: String::new() };
            let request = Said { bytes: String::new(), means: "the state at the end".to_owned() };
            let (recorded, replayed) = (said(recorded), said(&replayed));
            let drive = String::new();
            self.differ(Difference { line, t: t.as_nanos(), drive, request, recorded, replayed });
        }
        Ok(())
    }

    /// Brings all groups to the latest time, and says what came of it all.
    pub(super) fn finish(mut self, line: usize) -> Result<Outcome, ReplayError> {
        self.bring_all_to(At { line, t: self.latest })?;
        let state = self.state();
        let digest = hex(&self.replies.chain_update(&state).finalize());
        let Player { requests, differences, first_difference, .. } = self;
        Ok(Outcome { requests, differences, first_difference, state, digest })
    }

    fn open(&mut self, at: At, conn: u64, drive: usize, via: Option<Via>) -> Result<(), ReplayError> {
        let seed = self.rig.seed;
        let section = self.section(at, drive)?;
        let talk = match (&section.controller, via) {
            (ControllerSection::Smsd(smsd), None) if smsd.lan.firmware == Firmware::Modbus => {
                Talk::Modbus(ModbusTalk::new(seed, conn))
            }
            (ControllerSection::Smsd(_), Some(Via::Usb)) => packets(Via::Usb, seed, conn),
            (ControllerSection::Smsd(smsd), Some(Via::Standard))
                if smsd.lan.firmware == Firmware::Standard =>
            {
                packets(Via::Standard, seed, conn)
            }
            (ControllerSection::Smd3(_), None) => {
                let (talk, reader) = (LineTalk::new(seed, conn), Box::default());
                Talk::Lines { talk, reader, before: None }
            }
            (ControllerSection::Smsd(_) | ControllerSection::Smd3(_), _) => {
                let what = format!("{} cannot be reached in this way", section.name);
                return Err(ReplayError::entry(at.line, what));
            }
        };
        self.group(at, drive)?;
        let connection = Connection { drive, talk, request: Vec::new(), out: Outgoing::default() };
        match self.connections.insert(conn, connection) {
            None => Ok(()),
            Some(_) => Err(ReplayError::entry(at.line, format!("connection {conn} is open already"))),
        }
    }

    fn section(&self, at: At, drive: usize) -> Result<&DriveSection, ReplayError> {
        self.rig.drives.get(drive).ok_or_else(|| {
            ReplayError::entry(at.line, format!("the rig has no drive {drive}; they count from 0"))
        })
    }

    fn greet(&mut self, at: At, conn: u64, tx: &[u8]) -> Result<(), ReplayError> {
        let mut connection = self.take(at, conn)?;
        let (group, member) = self.group(at, connection.drive)?;
        connection.greet(at.line, group, member)?;
        self.compare(at, conn, &connection, &Reply { bytes: tx, cut: false }, false);
        self.connections.insert(conn, connection);
        Ok(())
    }

    fn count(&mut self, at: At, drive: usize, name: &str) -> Result<(), ReplayError> {
        self.section(at, drive)?;
        let counter = COUNTER_ROWS.iter().find(|(_, other, _)| *other == name);
        let (counter, ..) = counter.ok_or_else(|| {
            ReplayError::entry(at.line, format!("there is no counter {}", name.escape_debug()))
        })?;
        let (group, member) = self.group(at, drive)?;
        count(group, member, *counter);
        Ok(())
    }

    fn shut(&mut self, at: At, conn: u64) -> Result<(), ReplayError> {
        let connection = self.take(at, conn)?;
        self.group(at, connection.drive).map(|_| ())
    }

    fn hear(&mut self, at: At, conn: u64, rx: Vec<u8>, recorded: &Reply<'_>) -> Result<(), ReplayError> {
        let mut connection = self.take(at, conn)?;
        let (group, member) = self.group(at, connection.drive)?;
        connection.request = rx;
        let heard = connection.hear(at.line, group, member)?;
        self.requests += 1;
        self.compare(at, conn, &connection, recorded, heard == Heard::Cut);
        self.connections.insert(conn, connection);
        Ok(())
    }

    fn not_stored(&mut self, at: At, conn: u64, tx: &[u8]) -> Result<(), ReplayError> {
        let mut connection = self.take(at, conn)?;
        let (group, member) = self.group(at, connection.drive)?;
        connection.not_stored(at.line, group, member)?;
        self.compare(at, conn, &connection, &Reply { bytes: tx, cut: false }, false);
        self.connections.insert(conn, connection);
        Ok(())
    }

    fn act(&mut self, at: At, text: &str) -> Result<(), ReplayError> {
        let action =
            Action::parse(text, &self.rig).map_err(|error| ReplayError::entry(at.line, error.to_string()))?;
        let drive = action.drive(&self.rig).unwrap_or(0);
        self.group(at, drive)?.0.apply(&action);
        Ok(())
    }

    /// Takes a connection out, to be put back.
    fn take(&mut self, at: At, conn: u64) -> Result<Connection, ReplayError> {
        let connection = self.connections.remove(&conn);
        connection.ok_or_else(|| ReplayError::entry(at.line, format!("connection {conn} is not open")))
    }

    /// The group of a drive, brought up to a time, and which member the drive is.
    fn group(&mut self, at: At, drive: usize) -> Result<(&mut Group, usize), ReplayError> {
        let (number, member) = self.places.get(drive).copied().unwrap_or_default();
        self.bring_to(at, number)?;
        let group = self.groups.get_mut(number);
        group.map(|group| (group, member)).ok_or_else(|| ReplayError::entry(at.line, "the rig has no drives"))
    }

    fn bring_all_to(&mut self, at: At) -> Result<(), ReplayError> {
        (0..self.groups.len()).try_for_each(|number| self.bring_to(at, number))
    }

    /// Lets everything happen in a group that is due up to a time.
    fn bring_to(&mut self, At { line, t }: At, number: usize) -> Result<(), ReplayError> {
        let Some(group) = self.groups.get_mut(number) else { return Ok(()) };
        if t > LATEST {
            return Err(ReplayError::entry(
                line,
                format!("no rig has run for so long: the latest time is {LATEST}"),
            ));
        }
        if t < group.now() {
            let what =
                format!("this is at {t}, and the line before it of the same drives was at {}", group.now());
            return Err(ReplayError::entry(line, what));
        }
        self.latest = self.latest.max(t);
        loop {
            let slice = u32::try_from(self.left).map_or(SLICE, |left| left.min(SLICE));
            let mut unused = slice;
            if group.advance(t, &mut unused) >= t && is_settled(group) {
                self.left -= u64::from(slice - unused);
                return Ok(());
            }
            self.left -= u64::from(slice - unused);
            if self.left == 0 {
                return Err(ReplayError::TooMuch { line });
            }
        }
    }

    /// Compares the last reply of a connection with the recorded one.
    fn compare(&mut self, at: At, conn: u64, connection: &Connection, recorded: &Reply<'_>, cut: bool) {
        let replayed = Reply { bytes: connection.out.bytes(), cut };
        self.add_to_digest(at.t, conn, &replayed);
        if replayed.bytes == recorded.bytes && replayed.cut == recorded.cut {
            return;
        }
        let Connection { drive, talk, request, .. } = connection;
        let (tongue, drive) = (talk.tongue(), self.rig.drives.get(*drive));
        let asked = Said { bytes: hex(request), means: words::request(tongue, request) };
        self.differ(Difference {
            line: at.line,
            t: at.t.as_nanos(),
            drive: drive.map(|drive| drive.name.clone()).unwrap_or_default(),
            request: asked,
            recorded: recorded.said(tongue, request),
            replayed: replayed.said(tongue, request),
        });
    }

    fn differ(&mut self, difference: Difference) {
        self.differences += 1;
        self.first_difference.get_or_insert(difference);
    }

    fn add_to_digest(&mut self, t: Instant, conn: u64, reply: &Reply<'_>) {
        self.replies.update(t.as_nanos().to_le_bytes());
        self.replies.update(conn.to_le_bytes());
        self.replies.update([u8::from(reply.cut)]);
        self.replies.update((reply.bytes.len() as u64).to_le_bytes());
        self.replies.update(reply.bytes);
    }

    fn state(&self) -> String {
        state_digest(&self.rig, self.groups.iter())
    }
}

impl Connection {
    /// Answers the request into `out`.
    fn hear(&mut self, line: usize, group: &mut Group, member: usize) -> Result<Heard, ReplayError> {
        let Connection { talk, request, out, .. } = self;
        out.clear();
        match talk {
            Talk::Modbus(talk) => {
                let Split::Frame { frame, size } = split(request) else {
                    return Err(ReplayError::entry(line, "rx is no Modbus frame"));
                };
                whole(line, size == request.len())?;
                let heard = talk.hear(group, member, &frame, out);
                forget_events(group, member);
                Ok(heard)
            }
            Talk::Packets(talk, via) => {
                let (mut reader, mut rest) = (PacketReader::new(via.framing()), request.as_slice());
                let Some(packet) = reader.take(Instant::ZERO, &mut rest) else {
                    return Err(ReplayError::entry(line, "rx is no whole packet"));
                };
                whole(line, rest.is_empty())?;
                let heard = talk.hear(group, member, &packet, out);
                forget_events(group, member);
                Ok(heard)
            }
            Talk::Lines { talk, reader, before } => {
                let mut rest = request.as_slice();
                let Some(text) = reader.take(&mut rest) else {
                    return Err(ReplayError::entry(line, "rx is no whole line"));
                };
                whole(line, rest.is_empty())?;
                let (heard, stored) = talk.hear(group, member, text, out);
                *before = stored.map(Box::new);
                Ok(heard)
            }
        }
    }

    /// Says into `out` what the drive says before it is asked.
    fn greet(&mut self, line: usize, group: &mut Group, member: usize) -> Result<(), ReplayError> {
        let Connection { talk, out, .. } = self;
        out.clear();
        match talk {
            Talk::Packets(talk, Via::Standard) => talk.greet(group, member, out),
            Talk::Packets(_, Via::Usb) | Talk::Modbus(_) | Talk::Lines { .. } => {
                return Err(ReplayError::entry(line, "on this connection the drive does not speak first"));
            }
        }
        Ok(())
    }

    /// What the last request changed or showed could not be stored: the answer in `out` is another one.
    fn not_stored(&mut self, line: usize, group: &mut Group, member: usize) -> Result<(), ReplayError> {
        let Connection { talk, request, out, .. } = self;
        match talk {
            Talk::Modbus(talk) => {
                let Split::Frame { frame, .. } = split(request) else {
                    return Err(ReplayError::entry(
                        line,
                        "there was no request whose changes could be stored",
                    ));
                };
                talk.not_stored(&frame, out);
            }
            Talk::Packets(talk, _) => talk.not_stored(group, member, out),
            Talk::Lines { talk, before, .. } => {
                let Some(before) = before.take() else {
                    return Err(ReplayError::entry(line, "the last line of this connection was no STORE"));
                };
                talk.undo_store(group, member, &before, out);
            }
        }
        Ok(())
    }
}

impl Talk {
    fn tongue(&self) -> Tongue {
        match self {
            Talk::Modbus(_) => Tongue::Modbus,
            Talk::Packets(_, via) => Tongue::Packets(via.framing()),
            Talk::Lines { .. } => Tongue::Lines,
        }
    }
}

fn packets(via: Via, seed: u64, conn: u64) -> Talk {
    Talk::Packets(Box::new(PacketTalk::new(via, seed, conn)), via)
}

/// What an SMSD tells the world outside is for nobody here.
fn forget_events(group: &mut Group, member: usize) {
    if let Some(machine) = group.machine_mut(member).and_then(|machine| machine.smsd_mut()) {
        while machine.drive_mut().poll_event().is_some() {}
    }
}

impl Reply<'_> {
    fn said(&self, tongue: Tongue, request: &[u8]) -> Said {
        let means = if self.cut {
            "the connection was cut".to_owned()
        } else {
            words::reply(tongue, request, self.bytes)
        };
        Said { bytes: hex(self.bytes), means }
    }
}

fn whole(line: usize, is_whole: bool) -> Result<(), ReplayError> {
    if is_whole { Ok(()) } else { Err(ReplayError::entry(line, "rx is more than one request")) }
}

fn bytes(at: At, text: &str) -> Result<Vec<u8>, ReplayError> {
    unhex(text)
        .ok_or_else(|| ReplayError::entry(at.line, "rx and tx are bytes in hexadecimal, two digits each"))
}
