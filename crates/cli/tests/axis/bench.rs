//! What the tests are written with: a rig with a controller of each family, `stepdrive.toml` for it, and `stepdrive` there.

use crate::rig::{self, Ran, ready, split};
use crate::up::Place;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command};

/// A linear stage on an SMSD and a rotary one on an SMD3. Rig time passes a hundred times as fast.
pub(crate) const BOTH: &str = r#"
[rig]
clock = "x100"
api = "127.0.0.1:0"

[[drive]]
name = "stage"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[drive.mechanics]
travel = [-2000.0, 20000.0]
[[drive.switch]]
input = "SET_ZERO"
closed = [-120.0, -100.0]

[[drive]]
name = "uhv"
model = "SMD3"
serial = "pty:uhv.tty"
serial_tcp = "127.0.0.1:0"
[drive.mechanics]
travel = [-5000.0, 5000.0]
[[drive.switch]]
input = "LIMIT_NEGATIVE"
closed = [-5000.0, -4800.0]
[[drive.switch]]
input = "LIMIT_POSITIVE"
closed = [400.0, 5000.0]
"#;

/// A rig that runs, with a `stepdrive.toml` beside it that names its axes `stage` and `uhv`.
pub(crate) struct Bench {
    pub(crate) rig: rig::Bench,
}

impl Bench {
    pub(crate) fn start() -> Bench {
        Bench::with("")
    }

    /// With rig time as it passes.
    pub(crate) fn in_real_time() -> Bench {
        let bench = Bench::start();
        bench.rig.rig("clock real").done();
        bench
    }

    /// With more lines in the section of `stage`.
    pub(crate) fn with(lines: &str) -> Bench {
        let bench = Bench { rig: rig::Bench::with(BOTH) };
        let (stage, uhv) = (bench.address(0), bench.address(1));
        let text = format!(
            "[axis.stage]\nuri = \"smsd+tcp://{stage}\"\nunit = \"mm\"\nper_turn = 5\nsteps_per_rev = 200\n\
             limits = [-10, 200]\n{lines}\n\n[axis.uhv]\nuri = \"smd3+tcp://{uhv}\"\nunit = \"turns\"\nsteps_per_rev = 200\n"
        );
        bench.write("stepdrive.toml", &text);
        bench
    }

    /// With `stage` at its USB port.
    pub(crate) fn over_usb() -> Bench {
        let lan = "modbus_tcp = \"127.0.0.1:0\"\n";
        let ports = format!("{lan}usb = \"pty:stage.usb\"\nusb_tcp = \"127.0.0.1:0\"\n");
        let bench = Bench { rig: rig::Bench::with(&BOTH.replace(lan, &ports)) };
        let port = bench.ready(0)["usb"].as_str().expect("a port").to_owned();
        let text = format!(
            "[axis.stage]\nuri = \"smsd+usb://{port}\"\nunit = \"mm\"\nper_turn = 5\nsteps_per_rev = 200\n\
             limits = [-10, 200]\nprofile = \"stage.profile.toml\"\n"
        );
        bench.write("stepdrive.toml", &text);
        bench
    }

    /// Where the drive with this number is reached over TCP.
    pub(crate) fn address(&self, number: usize) -> SocketAddr {
        self.rig.address(number)
    }

    /// What the line that said that the rig is ready said of a drive.
    pub(crate) fn ready(&self, number: usize) -> Value {
        ready(&self.rig.up)["drives"][number].clone()
    }

    /// Writes a file beside `stepdrive.toml`.
    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.rig.place.path(name), text).expect("written");
    }

    pub(crate) fn place(&self) -> &Place {
        &self.rig.place
    }

    /// `stepdrive` with these words, parted by spaces except between `'` and `'`, where `stepdrive.toml` is.
    pub(crate) fn command(&self, words: &str) -> Command {
        let mut command = self.place().command();
        command.args(split(words)).env("XDG_CONFIG_HOME", self.place().path("config"));
        command
    }

    /// Runs it to its end.
    pub(crate) fn run(&self, words: &str) -> Ran {
        Ran(self.command(words).output().expect("started"))
    }

    /// Runs it with `--json`, and reads the one line that it prints.
    #[track_caller]
    pub(crate) fn json(&self, words: &str) -> Value {
        let ran = self.run(&format!("{words} --json"));
        let text = ran.done();
        assert_eq!(text.lines().count(), 1, "{words}: {text}");
        serde_json::from_str(text).expect("JSON")
    }

    /// Starts it, and lets it run.
    pub(crate) fn start_command(&self, words: &str) -> Running {
        Running(Some(self.command(words).spawn().expect("started")))
    }

    /// Makes the limit switches of `uhv` count, and takes the place where `stage` stands as zero.
    pub(crate) fn make_ready(&self) {
        self.energise();
        self.run("zero -a stage").done();
        for name in ["L", "L-", "L+"] {
            self.run(&format!("set -a uhv {name} 1")).done();
        }
        self.run("zero -a uhv").done();
    }

    /// An SMSD is de-energised at power-up, and a stop holds its motor.
    pub(crate) fn energise(&self) {
        self.run("stop -a stage").done();
    }
}

/// A command that runs. It is killed when a test gives up.
pub(crate) struct Running(Option<Child>);

impl Running {
    /// Sends it a signal.
    pub(crate) fn signal(&self, signal: &str) {
        let id = self.0.as_ref().expect("it runs").id();
        let sent = Command::new("kill").args([format!("-{signal}"), id.to_string()]).status();
        assert!(sent.expect("there is a `kill`").success());
    }

    /// Waits for its end.
    pub(crate) fn end(mut self) -> Ran {
        Ran(self.0.take().expect("it runs").wait_with_output().expect("ended"))
    }

    /// Its next line on stdout.
    pub(crate) fn lines(&mut self) -> impl Iterator<Item = String> + use<> {
        let stdout = self.0.as_mut().and_then(|child| child.stdout.take()).expect("piped");
        BufReader::new(stdout).lines().map(|line| line.expect("text"))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            // It may have ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The names in an object of JSON.
pub(crate) fn keys(object: &Value) -> Vec<&str> {
    object.as_object().expect("an object").keys().map(String::as_str).collect()
}
