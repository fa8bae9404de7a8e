//! What was said, in words.

use super::{By, Fate, Said, lines, modbus, packets};
use crate::recording::hex;
use serde::Serialize;
use stepdrive_proto::smsd::Framing;
use stepdrive_rig::file::{DriveSection, RigFile};
use stepdrive_spec::smsd::standard::Firmware;

/// The most bytes of a request or reply that are shown.
const MOST_SHOWN: usize = 1100;

/// A request or a reply, as those who watch are told it.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Row {
    /// The rig time.
    pub(crate) t_ns: u64,
    /// The drive's name.
    pub(crate) drive: String,
    /// The number of the client's connection.
    pub(crate) conn: u64,
    /// See [`By`].
    pub(crate) by: &'static str,
    /// See [`super::Peer`].
    pub(crate) peer: String,
    /// Who it was said to: `drive` or `client`.
    pub(crate) to: &'static str,
    /// The bytes.
    pub(crate) hex: String,
    /// What they mean.
    pub(crate) text: String,
    /// Whether it is an error, or means nothing.
    pub(crate) bad: bool,
}

/// What a request or a reply means, and whether it is bad.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Meaning {
    pub(crate) text: String,
    pub(crate) bad: bool,
}

impl Meaning {
    /// All is well.
    pub(crate) fn good(text: impl Into<String>) -> Meaning {
        Meaning { text: text.into(), bad: false }
    }

    /// It is an error, or means nothing.
    pub(crate) fn bad(text: impl Into<String>) -> Meaning {
        Meaning { text: text.into(), bad: true }
    }
}

/// The rows of something that was said: the request, if there was one, and what it was answered with, if anything.
pub(crate) fn words(rig: &RigFile, said: &Said) -> Vec<Row> {
    let Some(drive) = rig.drives.get(said.client.drive) else { return Vec::new() };
    let (request, reply) = meanings(drive, said);
    let asked = (!said.request.is_empty() && said.fate != Fate::NotStored).then_some(&said.request);
    let answered = (!said.reply.is_empty()).then_some(&said.reply);
    let row = |to, bytes: &[u8], Meaning { text, bad }| Row {
        t_ns: said.at.as_nanos(),
        drive: drive.name.clone(),
        conn: said.client.conn,
        by: said.client.by.name(),
        peer: said.client.peer.to_string(),
        to,
        hex: hex(bytes.get(..MOST_SHOWN).unwrap_or(bytes)),
        text,
        bad,
    };
    let asked = asked.map(|bytes| row("drive", bytes, with_fate(request, said.fate)));
    let answered = answered.map(|bytes| row("client", bytes, with_fate(reply, said.fate)));
    asked.into_iter().chain(answered).collect()
}

fn meanings(drive: &DriveSection, said: &Said) -> (Meaning, Meaning) {
    let Said { request, reply, client, .. } = said;
    let firmware = drive.smsd().map_or(Firmware::default(), |smsd| smsd.lan.firmware);
    match client.by {
        By::Modbus => {
            let order = drive.smsd().map(|smsd| smsd.word_order).unwrap_or_default();
            modbus::meanings(order, request, reply)
        }
        By::Usb => packets::meanings(Framing::Stuffed, firmware, request, reply),
        By::Lan => packets::meanings(Framing::Raw, firmware, request, reply),
        By::Serial => lines::meanings(request, reply),
    }
}

fn with_fate(Meaning { text, bad }: Meaning, fate: Fate) -> Meaning {
    match fate {
        Fate::Taken => Meaning { text, bad },
        Fate::Cut => Meaning::bad(format!("{text} (not heard: the line is cut)")),
        Fate::NotStored => {
            Meaning::bad(format!("{text} (instead of the reply before: the memory cannot be written)"))
        }
    }
}
