//! What the tests are written with: a rig that runs, and `stepdrive rig` on it.

use crate::up::{Client, Place, Up, text};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{self, OpenptFlags};
use rustix::termios::{Winsize, tcsetwinsize};
use serde_json::Value;
use std::fs::File;
use std::io::Read;
use std::net::SocketAddr;
use std::process::{Command, Output};
use std::sync::mpsc;
use std::time::Duration;

/// Two SMSDs with a wire between them, and an SMD3. Time stands still.
pub(crate) const THREE: &str = r#"
[rig]
clock = "paused"
api = "127.0.0.1:0"

[[drive]]
name = "a"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[[drive.switch]]
input = "IN1"
closed = [300.0, 320.0]

[[drive]]
name = "b"
model = "SMSD-8.0LAN"
modbus_tcp = "127.0.0.1:0"

[[drive]]
name = "u"
model = "SMD3"
serial_tcp = "127.0.0.1:0"

[[wire]]
from = "a.relay"
to = "b.CONTINUE"
delay = "5ms"
"#;

/// A rig that runs, and the folder that it runs in.
pub(crate) struct Bench {
    pub(crate) place: Place,
    pub(crate) up: Up,
    api: String,
}

impl Bench {
    pub(crate) fn start() -> Bench {
        Bench::with(THREE)
    }

    pub(crate) fn with(rig: &str) -> Bench {
        let place = Place::with(rig);
        let up = place.up();
        Bench::of(place, up)
    }

    /// With more words behind `stepdrive up`.
    pub(crate) fn with_options(rig: &str, options: &[&str]) -> Bench {
        let place = Place::with(rig);
        let up = start(&place, options);
        Bench::of(place, up)
    }

    fn of(place: Place, up: Up) -> Bench {
        let api = ready(&up)["api"].as_str().expect("an API").to_owned();
        Bench { place, up, api }
    }

    /// The URL of its API.
    pub(crate) fn api(&self) -> &str {
        &self.api
    }

    /// `stepdrive rig --api …`.
    pub(crate) fn command(&self) -> Command {
        let mut command = self.place.command();
        command.args(["rig", "--api", &self.api]);
        command
    }

    /// Runs `stepdrive rig` with these words, parted by spaces except between `'` and `'`.
    pub(crate) fn rig(&self, words: &str) -> Ran {
        Ran(self.command().args(split(words)).output().expect("started"))
    }

    /// Runs it with `--json`, and reads what it prints.
    pub(crate) fn json(&self, words: &str) -> Value {
        let ran = self.rig(&format!("{words} --json"));
        assert_eq!(ran.code(), 0, "{words}: {}", ran.stderr());
        assert_eq!(ran.stdout().lines().count(), 1, "{words}: {}", ran.stdout());
        serde_json::from_str(ran.stdout()).expect("JSON")
    }

    /// What the rig says of the drive with this number.
    pub(crate) fn drive(&self, number: usize) -> Value {
        self.json("status")["drives"][number].clone()
    }

    /// Where the drive with this number is reached over TCP.
    pub(crate) fn address(&self, number: usize) -> SocketAddr {
        let ready = ready(&self.up);
        let drive = &ready["drives"][number];
        let address = drive["modbus_tcp"].as_str().or(drive["serial_tcp"].as_str()).expect("an address");
        address.parse().expect("an address")
    }

    /// A client of the SMSD with this number, logged in.
    pub(crate) fn client(&self, number: usize) -> Client {
        let mut client = Client::connect(self.address(number)).expect("reachable");
        client.log_in().expect("logged in");
        client
    }
}

/// Brings a rig up on the state folder `state`, with more words.
pub(crate) fn start(place: &Place, options: &[&str]) -> Up {
    Up::start(place.command().args(["up", "rig.toml", "--json", "--state", "state"]).args(options))
}

/// The line that said that it is ready.
pub(crate) fn ready(up: &Up) -> Value {
    serde_json::from_str(&up.ready).expect("JSON")
}

/// What ran.
pub(crate) struct Ran(pub(crate) Output);

impl Ran {
    pub(crate) fn code(&self) -> i32 {
        self.0.status.code().expect("not killed")
    }

    pub(crate) fn stdout(&self) -> &str {
        std::str::from_utf8(&self.0.stdout).expect("text")
    }

    pub(crate) fn stderr(&self) -> String {
        text(&self.0.stderr)
    }

    /// What it printed; it did what it was asked to.
    #[track_caller]
    pub(crate) fn done(&self) -> &str {
        assert_eq!((self.code(), self.stderr()), (0, String::new()), "{}", self.stdout());
        self.stdout()
    }

    /// What it said when it failed with this code, which is one line.
    #[track_caller]
    pub(crate) fn refused(&self, code: i32) -> String {
        let said = self.stderr();
        assert_eq!((self.code(), self.stdout()), (code, ""), "{said}");
        assert!(said.starts_with("stepdrive: ") && said.lines().count() == 1, "{said}");
        said.trim_end().trim_start_matches("stepdrive: ").to_owned()
    }
}

/// Waits for what comes soon.
#[track_caller]
pub(crate) fn until(mut it_is_so: impl FnMut() -> bool) {
    let (_hold, never) = mpsc::channel::<()>();
    let pause = || never.recv_timeout(Duration::from_millis(20)).is_err();
    assert!((0..500).any(|_| it_is_so() || !pause()), "it has not come for ten seconds");
}

/// Words as a shell parts them.
pub(crate) fn split(text: &str) -> Vec<String> {
    let parts = text.split('\'').enumerate();
    let words = parts.flat_map(|(number, part)| {
        let quoted = number % 2 == 1;
        let words: Vec<&str> = if quoted { vec![part] } else { part.split_whitespace().collect() };
        words.into_iter().map(str::to_owned)
    });
    words.collect()
}

/// A terminal of so many columns and lines, as the program sees it and as the person does.
pub(crate) fn terminal(columns: u16, lines: u16) -> (File, File) {
    let person = pty::openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
    pty::grantpt(&person).and_then(|()| pty::unlockpt(&person)).expect("usable");
    let name = pty::ptsname(&person, Vec::new()).expect("a name");
    let size = Winsize { ws_col: columns, ws_row: lines, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(&person, size).expect("set");
    let program = rustix::fs::open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).expect("usable");
    (program.into(), person.into())
}

/// Reads what a person sees on, until this is among it.
pub(crate) fn seen(person: &mut File, seen: &mut String, part: &str) {
    while !seen.contains(part) {
        let mut bytes = [0; 4096];
        let count = person.read(&mut bytes).expect("readable");
        seen.push_str(&String::from_utf8_lossy(&bytes[..count]));
    }
}
