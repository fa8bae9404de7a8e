//! Recordings: everything that went into a rig, in a file that [`crate::replay`] runs again.
//!
//! A recording is text, a JSON object a line. The first line is the [`Header`]; each of the others is an [`Entry`], in the
//! order in which it happened to each group of drives. The last line of a whole recording has `end`. `docs/recordings.md`
//! says it at length.
//!
//! What happens to a group at one time happens in this order: all that was due by then, then the entries, with whatever
//! became due between two of them: see `World::visit`.

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use stepdrive_drive::smd3::Stored;
use stepdrive_drive::smsd::{Memory, Record};
use stepdrive_proto::smsd::Framing;
use stepdrive_rig::file::{DriveSection, RigFile};
use stepdrive_rig::group::{Group, Member};
use stepdrive_rig::names::AnyQuantity;
use stepdrive_spec::time::Instant;

/// The version of the format. Another one is not read.
pub const VERSION: u32 = 1;

/// What is gathered before it is handed to the system: some hundred requests.
const BUFFER: usize = 64 * 1024;

/// Who may read a recording: it has passwords in it.
const OWNER_ONLY: u32 = 0o600;

/// The first line: what the rig was when it was switched on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// [`VERSION`].
    pub stepdrive_recording: u32,
    /// The version of the program that made it.
    pub made_by: String,
    /// The rig file.
    pub rig: String,
    /// The drives, in the order of the rig file.
    pub drives: Vec<RecordedDrive>,
}

/// What a drive was when it was switched on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedDrive {
    /// Its name, for the reader.
    pub name: String,
    /// An SMSD: the port that it was told it is reached at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<u16>,
    /// What its memory held, record by record, in hexadecimal: all of an SMSD's; an SMD3's configuration, none when
    /// nothing was stored.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub memory: Vec<String>,
    /// An SMD3: what its flash held was damaged.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub damaged: bool,
}

impl Header {
    /// The header of a recording that this program makes.
    pub(crate) fn new(rig: String, drives: Vec<RecordedDrive>) -> Header {
        let made_by = env!("CARGO_PKG_VERSION").to_owned();
        Header { stepdrive_recording: VERSION, made_by, rig, drives }
    }
}

impl RecordedDrive {
    /// An SMSD with this memory.
    pub(crate) fn smsd(name: &str, memory: &Memory) -> RecordedDrive {
        let records = Record::ALL.iter().map(|record| hex(&memory.encode(*record))).collect();
        RecordedDrive { name: name.to_owned(), memory: records, ..RecordedDrive::default() }
    }

    /// An SMD3 with this in its flash.
    pub(crate) fn smd3(name: &str, stored: &Stored) -> RecordedDrive {
        let (memory, damaged) = match stored {
            Stored::Nothing => (Vec::new(), false),
            Stored::Intact(settings) => (vec![hex(&settings.encode())], false),
            Stored::Damaged => (Vec::new(), true),
        };
        RecordedDrive { name: name.to_owned(), memory, damaged, port: None }
    }
}

/// A line of a recording: something that happened at a time of the rig.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// When, in nanoseconds of rig time.
    pub t: u64,
    /// What.
    #[serde(flatten)]
    pub what: Happened,
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Happened {
    /// A client connected.
    Open {
        /// The number of its connection; no other client has the same.
        conn: u64,
        /// The number of the drive in the rig file, from 0.
        drive: usize,
        /// By what it came, if not by what every drive of the family has: Modbus of an SMSD, lines of an SMD3.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        via: Option<Via>,
        /// It was the panel, from within the process of the rig.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        panel: bool,
    },
    /// The drive spoke first: the standard firmware asks for the password.
    Greeted {
        /// The connection.
        conn: u64,
        /// The bytes as they left, in hexadecimal.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        tx: String,
    },
    /// A client's request, and what the drive's line gave back.
    Heard {
        /// The connection.
        conn: u64,
        /// The bytes of the request, in hexadecimal: a Modbus frame, a line with its end, or a packet as it came.
        rx: String,
        /// The bytes of the reply as they left, in hexadecimal; without pauses between them.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        tx: String,
        /// The connection was cut instead.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        cut: bool,
    },
    /// The disk failed when what the last request of this connection changed was to be stored. An SMD3 has in its flash
    /// what it had before.
    NotStored {
        /// The connection.
        conn: u64,
        /// What left instead of the reply, in hexadecimal.
        tx: String,
    },
    /// An SMSD was told of something that counts among its errors and came from outside the rig: a packet that stopped half
    /// way, a client too many, a disk that failed.
    Counted {
        /// The number of the drive in the rig file, from 0.
        drive: usize,
        /// The counter, as the maker calls it.
        counter: Cow<'static, str>,
    },
    /// A client left, or was disconnected.
    Shut {
        /// The connection.
        conn: u64,
    },
    /// Something was done to the rig, as in [`stepdrive_rig::action`].
    Do(String),
    /// The clock was set, or moved. Told for the reader: rig time is all that counts.
    Clock(String),
    /// The end: all groups were brought to this time.
    End {
        /// The state of the rig then; see `state_digest`.
        state: String,
        /// The sum of all that was written; see `Sum`.
        sum: String,
    },
}

/// By what a client of an SMSD came, when it was not Modbus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Via {
    /// USB, or what stands for it: packets with start, stop and escapes.
    Usb,
    /// The LAN of the standard firmware: packets without.
    Standard,
}

impl Via {
    /// How packets are told apart there.
    pub(crate) fn framing(self) -> Framing {
        match self {
            Via::Usb => Framing::Stuffed,
            Via::Standard => Framing::Raw,
        }
    }
}

impl Entry {
    /// Something at a time.
    pub(crate) fn new(at: Instant, what: Happened) -> Entry {
        Entry { t: at.as_nanos(), what }
    }

    /// An action at a time.
    pub(crate) fn action(at: Instant, text: String) -> Entry {
        Entry::new(at, Happened::Do(text))
    }

    /// When.
    pub(crate) fn at(&self) -> Instant {
        Instant::from_nanos(self.t)
    }
}

/// An object of two members: `t`, and after it what happened. By hand, since a flattened enum would pass over members
/// that it does not know.
impl<'de> Deserialize<'de> for Entry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Entry, D::Error> {
        deserializer.deserialize_map(EntryVisitor)
    }
}

struct EntryVisitor;

impl<'de> Visitor<'de> for EntryVisitor {
    type Value = Entry;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with `t` and what happened then")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entry, A::Error> {
        if map.next_key::<String>()?.as_deref() != Some("t") {
            return Err(A::Error::custom("an entry begins with `t`"));
        }
        let t = map.next_value()?;
        let what = Happened::deserialize(MapAccessDeserializer::new(&mut map))?;
        if map.next_key::<IgnoredAny>()?.is_some() {
            return Err(A::Error::custom("an entry has `t` and one thing that happened"));
        }
        Ok(Entry { t, what })
    }
}

/// The sum of a recording: SHA-256 over all its bytes before the last line, then over that line's time (8 bytes, low byte
/// first) and its state as it is written. It tells a recording that was changed from one that was not.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sum(Sha256);

impl Sum {
    /// Adds a line, with its end.
    pub(crate) fn add(&mut self, line: &[u8]) {
        self.0.update(line);
    }

    /// The sum of a recording that ends like this, in hexadecimal.
    pub(crate) fn end(&self, at: Instant, state: &str) -> String {
        let end = self.0.clone().chain_update(at.as_nanos().to_le_bytes()).chain_update(state);
        hex(&end.finalize())
    }
}

/// Writes a recording. What is written is handed to the system by [`Recorder::flush`], which is to be called a few times
/// a second.
#[derive(Debug)]
pub(crate) struct Recorder {
    out: Mutex<Out>,
}

#[derive(Debug)]
struct Out {
    file: BufWriter<File>,
    /// The line that is being made.
    line: Vec<u8>,
    sum: Sum,
    /// It has its last line. What a connection that is just being closed still says is no part of it.
    ended: bool,
    /// The first error. Nothing is written after it.
    failed: Option<io::Error>,
}

impl Recorder {
    /// Begins a recording. A file that is there already is not touched.
    pub(crate) fn create(path: &Path, header: &Header) -> io::Result<Recorder> {
        let file = OpenOptions::new().write(true).create_new(true).mode(OWNER_ONLY).open(path)?;
        let file = BufWriter::with_capacity(BUFFER, file);
        let mut out = Out { file, line: Vec::new(), sum: Sum::default(), ended: false, failed: None };
        out.write_line(header)?;
        out.file.flush()?;
        Ok(Recorder { out: Mutex::new(out) })
    }

    /// Adds a line.
    pub(crate) fn write(&self, entry: &Entry) {
        self.with(|out| out.write_line(entry));
    }

    /// Adds the last line. Nothing is written after it.
    pub(crate) fn end(&self, at: Instant, state: String) {
        self.with(|out| {
            let sum = out.sum.end(at, &state);
            out.write_line(&Entry::new(at, Happened::End { state, sum }))?;
            out.ended = true;
            out.file.flush()
        });
    }

    /// Hands what was written to the system, so that it survives the process.
    pub(crate) fn flush(&self) {
        self.with(|out| out.file.flush());
    }

    /// Why it could not be written on.
    pub(crate) fn error(&self) -> Option<String> {
        self.lock().failed.as_ref().map(ToString::to_string)
    }

    fn with(&self, act: impl FnOnce(&mut Out) -> io::Result<()>) {
        let mut out = self.lock();
        if out.failed.is_none()
            && !out.ended
            && let Err(error) = act(&mut out)
        {
            out.failed = Some(error);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Out> {
        self.out.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Out {
    fn write_line(&mut self, line: &impl Serialize) -> io::Result<()> {
        self.line.clear();
        serde_json::to_writer(&mut self.line, line)?;
        self.line.push(b'\n');
        self.sum.add(&self.line);
        self.file.write_all(&self.line)
    }
}

/// Bytes in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    let digit = |value: u8| char::from(if value < 10 { b'0' + value } else { b'a' - 10 + value });
    bytes.iter().flat_map(|byte| [digit(byte >> 4), digit(byte & 0xF)]).collect()
}

/// Bytes from hexadecimal; `None` when it is none.
pub(crate) fn unhex(text: &str) -> Option<Vec<u8>> {
    let (pairs, rest) = text.as_bytes().as_chunks::<2>();
    let bytes = pairs.iter().map(|[high, low]| Some(value(*high)? << 4 | value(*low)?)).collect();
    if rest.is_empty() { bytes } else { None }
}

fn value(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}

/// The state of a rig as a SHA-256 in hexadecimal: every quantity of every drive, what its memory holds, its inputs and
/// what is forced there, what is wrong with it, and the wires. The groups stand at one time.
pub(crate) fn state_digest<'a>(rig: &RigFile, groups: impl Iterator<Item = &'a Group>) -> String {
    let groups: Vec<&Group> = groups.collect();
    let members =
        |group: &&'a Group| group.members().iter().map(|member| (group.now(), member)).collect::<Vec<_>>();
    let mut members: Vec<(Instant, &Member)> = groups.iter().flat_map(members).collect();
    members.sort_by_key(|(_, member)| member.drive());
    let mut wires: Vec<(usize, bool, bool)> = groups.iter().flat_map(|group| group.wires()).collect();
    wires.sort_unstable();
    let mut digest = Sha256::new();
    for (now, member) in members {
        let section = rig.drives.get(member.drive());
        digest_member(&mut digest, now, member, section.into_iter().flat_map(DriveSection::quantities));
    }
    for (number, connected, level) in wires {
        digest.update((number as u64).to_le_bytes());
        digest.update([connected.into(), level.into()]);
    }
    hex(&digest.finalize())
}

fn digest_member(
    digest: &mut Sha256,
    now: Instant,
    member: &Member,
    quantities: impl Iterator<Item = AnyQuantity>,
) {
    let machine = member.machine();
    digest.update((member.drive() as u64).to_le_bytes());
    digest.update(machine.levels().to_le_bytes());
    for input in machine.inputs() {
        digest.update([machine.forced(input).map_or(2, u8::from)]);
    }
    for quantity in quantities {
        digest.update(machine.look(now, quantity).to_bits().to_le_bytes());
    }
    machine.for_each_record(&mut |record| digest_field(digest, record));
    for (name, setting) in member.faults() {
        digest_field(digest, name.as_bytes());
        digest_field(digest, setting.as_bytes());
    }
}

/// Adds a field so that what is in it cannot be taken for what comes before or after it.
fn digest_field(digest: &mut Sha256, field: &[u8]) {
    digest.update((field.len() as u64).to_le_bytes());
    digest.update(field);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(t: u64, what: Happened) -> Entry {
        Entry::new(Instant::from_nanos(t), what)
    }

    #[test]
    fn every_line_is_written_as_documented_and_read_back() {
        let [rx, tx] = ["5356", "30"].map(str::to_owned);
        let (state, sum) = ("ab".to_owned(), "cd".to_owned());
        for (entry, line) in [
            (
                at(0, Happened::Open { conn: 3, drive: 1, via: None, panel: false }),
                r#"{"t":0,"open":{"conn":3,"drive":1}}"#,
            ),
            (
                at(0, Happened::Open { conn: 3, drive: 1, via: None, panel: true }),
                r#"{"t":0,"open":{"conn":3,"drive":1,"panel":true}}"#,
            ),
            (
                at(0, Happened::Open { conn: 3, drive: 1, via: Some(Via::Usb), panel: false }),
                r#"{"t":0,"open":{"conn":3,"drive":1,"via":"usb"}}"#,
            ),
            (
                at(0, Happened::Open { conn: 3, drive: 1, via: Some(Via::Standard), panel: false }),
                r#"{"t":0,"open":{"conn":3,"drive":1,"via":"standard"}}"#,
            ),
            (
                at(1, Happened::Greeted { conn: 3, tx: tx.clone() }),
                r#"{"t":1,"greeted":{"conn":3,"tx":"30"}}"#,
            ),
            (at(1, Happened::Greeted { conn: 3, tx: String::new() }), r#"{"t":1,"greeted":{"conn":3}}"#),
            (
                at(2, Happened::Counted { drive: 1, counter: "ERROR_SOCKET".into() }),
                r#"{"t":2,"counted":{"drive":1,"counter":"ERROR_SOCKET"}}"#,
            ),
            (
                at(7, Happened::Heard { conn: 3, rx: rx.clone(), tx: tx.clone(), cut: false }),
                r#"{"t":7,"heard":{"conn":3,"rx":"5356","tx":"30"}}"#,
            ),
            (
                at(7, Happened::Heard { conn: 3, rx, tx: String::new(), cut: true }),
                r#"{"t":7,"heard":{"conn":3,"rx":"5356","cut":true}}"#,
            ),
            (at(8, Happened::NotStored { conn: 3, tx }), r#"{"t":8,"not-stored":{"conn":3,"tx":"30"}}"#),
            (at(9, Happened::Shut { conn: 3 }), r#"{"t":9,"shut":{"conn":3}}"#),
            (at(9, Happened::Do("power a off".to_owned())), r#"{"t":9,"do":"power a off"}"#),
            (at(u64::MAX, Happened::Clock("x10".to_owned())), r#"{"t":18446744073709551615,"clock":"x10"}"#),
            (at(1, Happened::End { state, sum }), r#"{"t":1,"end":{"state":"ab","sum":"cd"}}"#),
        ] {
            assert_eq!(serde_json::to_string(&entry).expect("written"), line);
            assert_eq!(serde_json::from_str::<Entry>(line).expect("read"), entry);
        }
    }

    #[test]
    fn hexadecimal_is_read_as_it_is_written_and_in_no_other_way() {
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(unhex(&hex(&all)), Some(all));
        assert_eq!((hex(&[0x0A, 0xF9]).as_str(), unhex("")), ("0af9", Some(Vec::new())));
        for none in ["0", "0A", "0g", " 00", "é"] {
            assert_eq!(unhex(none), None, "{none}");
        }
    }

    #[test]
    fn a_file_that_is_there_is_not_recorded_over() {
        let folder = tempfile::TempDir::new().expect("a temporary folder");
        let (file, header) = (folder.path().join("recording"), Header::new(String::new(), Vec::new()));
        Recorder::create(&file, &header).expect("a new file");
        let error = Recorder::create(&file, &header).expect_err("it is there");
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
    }

    #[test]
    fn nothing_is_written_after_the_end() {
        let folder = tempfile::TempDir::new().expect("a temporary folder");
        let file = folder.path().join("recording");
        let recorder = Recorder::create(&file, &Header::new(String::new(), Vec::new())).expect("a new file");
        recorder.end(Instant::ZERO, "ab".to_owned());
        let whole = std::fs::read(&file).expect("readable");
        recorder.write(&at(1, Happened::Shut { conn: 1 }));
        recorder.end(Instant::ZERO, "ab".to_owned());
        recorder.flush();
        assert_eq!(std::fs::read(&file).expect("readable"), whole);
        assert_eq!(recorder.error(), None);
    }
}
