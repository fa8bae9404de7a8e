//! `stepdrive up`: brings a rig up and keeps it running.

use crate::rigs::{self, Rig};
use crate::{Failure, UpArgs, print};
use serde::Serialize;
use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;
use stepdrive_rig::file::{ControllerSection, DriveSection, SwitchSection};
use stepdrive_server::{Notice, Options, ServedDrive, Server};
use tokio::runtime;

/// The line of `--json`.
#[derive(Serialize)]
struct Ready {
    event: &'static str,
    drives: Vec<ReadyDrive>,
}

/// A drive in the line of `--json`.
#[derive(Serialize)]
struct ReadyDrive {
    name: String,
    model: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    modbus_tcp: Option<SocketAddr>,
    #[serde(skip_serializing_if = "Option::is_none")]
    serial: Option<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    serial_tcp: Option<SocketAddr>,
}

/// Brings up the rig and serves it until the process is asked to end.
pub(crate) fn up(args: &UpArgs) -> Result<(), Failure> {
    let rig = rigs::load(args)?;
    let runtime = runtime::Builder::new_multi_thread().enable_all().build();
    let runtime = runtime.map_err(|error| Failure::Failed(format!("cannot start threads: {error}")))?;
    let talk = Talk::start().map_err(|error| Failure::Failed(format!("cannot start threads: {error}")))?;
    let notify = talk.notify();
    runtime.block_on(async {
        // Asked for before anything is announced, so that a signal never finds the default of dying at once.
        let end =
            end_requested().map_err(|error| Failure::Failed(format!("cannot catch signals: {error}")))?;
        let server = Server::start(&rig.file, Options { state: rig.state.clone(), notify })
            .await
            .map_err(|error| Failure::Failed(error.to_string()))?;
        print(&if args.json { ready_line(server.drives())? } else { welcome(&rig, server.drives()) })?;
        end.await;
        server.stop().await;
        Ok(())
    })?;
    talk.finish();
    Ok(())
}

/// Waits for Ctrl-C or SIGTERM.
#[cfg(unix)]
fn end_requested() -> io::Result<impl Future<Output = ()>> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    })
}

/// Waits for Ctrl-C.
#[cfg(not(unix))]
fn end_requested() -> io::Result<impl Future<Output = ()>> {
    Ok(async {
        // When it cannot be caught, the default of dying at once is as good.
        let _ = tokio::signal::ctrl_c().await;
    })
}

/// Lines that wait for a stderr that nobody reads; those beyond are dropped.
const UNREAD_LINES: usize = 1000;

/// How long the end waits for the last lines to be read.
const LAST_LINES: Duration = Duration::from_secs(1);

/// Talks to the person at the terminal, in a thread of its own: a stderr that nobody reads must not hold up a drive.
struct Talk {
    lines: mpsc::SyncSender<String>,
    ended: mpsc::Receiver<()>,
}

impl Talk {
    fn start() -> io::Result<Talk> {
        let (lines, queue) = mpsc::sync_channel::<String>(UNREAD_LINES);
        let (ending, ended) = mpsc::channel();
        thread::Builder::new().name("talk".into()).spawn(move || {
            for line in queue {
                // Without a stderr there is nobody to tell.
                let _ = writeln!(io::stderr(), "{line}");
            }
            drop(ending);
        })?;
        Ok(Talk { lines, ended })
    }

    /// What the server tells its notices to.
    fn notify(&self) -> Box<dyn Fn(Notice) + Send + Sync> {
        let lines = self.lines.clone();
        Box::new(move |notice| {
            let _ = lines.try_send(notice.to_string());
        })
    }

    /// Waits a moment until what was said is written.
    fn finish(self) {
        drop(self.lines);
        let _ = self.ended.recv_timeout(LAST_LINES);
    }
}

fn ready_line(drives: &[ServedDrive]) -> Result<String, Failure> {
    let drive = |drive: &ServedDrive| {
        let ServedDrive { name, model, modbus_tcp, unit: _, serial, serial_tcp } = drive.clone();
        ReadyDrive { name, model, modbus_tcp, serial, serial_tcp }
    };
    let ready = Ready { event: "ready", drives: drives.iter().map(drive).collect() };
    let line = serde_json::to_string(&ready).map_err(|error| Failure::Failed(error.to_string()))?;
    Ok(line + "\n")
}

/// What runs where, and three things to try.
fn welcome(rig: &Rig, drives: &[ServedDrive]) -> String {
    let mut text = format!("stepdrive {}: {} is up.\n\n", env!("CARGO_PKG_VERSION"), rig.name);
    for (served, section) in drives.iter().zip(&rig.file.drives) {
        let ServedDrive { name, model, .. } = served;
        let _ = writeln!(text, "  {name}  {model}  {}", reached(served));
        let _ = writeln!(text, "  {:width$}  {}", "", mechanics(section), width = name.len());
    }
    let _ = writeln!(text, "\nNon-volatile memory: {}", rig.state.display());
    text.push_str(&things_to_try(drives));
    text.push_str("\nCtrl-C ends it.\n");
    text
}

/// Where a drive is reached.
fn reached(drive: &ServedDrive) -> String {
    let modbus = drive.modbus_tcp.zip(drive.unit).map(|(at, unit)| format!("Modbus TCP {at}, unit {unit}"));
    let serial = drive.serial.as_ref().map(|path| format!("serial port {}", path.display()));
    let serial_tcp = drive.serial_tcp.map(|at| format!("lines over TCP {at}"));
    [modbus, serial, serial_tcp].into_iter().flatten().collect::<Vec<String>>().join(", ")
}

/// Three things to try, with the first drive of each family.
fn things_to_try(drives: &[ServedDrive]) -> String {
    let mut things = Vec::new();
    if let Some((at, unit)) = drives.iter().find_map(|drive| drive.modbus_tcp.zip(drive.unit)) {
        let (host, port) = (reachable(at), at.port());
        things.push(format!(
            "ask it who it is, which needs no password (Debian: apt install mbpoll):
     mbpoll -m tcp -p {port} -a {unit} -0 -1 -t 3:hex -r 0x8001 -c 4 {host}"
        ));
        things.push(format!(
            "log in, find the zero switch, go there and back (pip install pymodbus):
     python3 examples/first_move.py {host} {port}"
        ));
    }
    if let Some(path) = drives.iter().find_map(|drive| drive.serial.as_ref()) {
        let path = path.display();
        things.push(format!(
            "talk to the SMD3 as to the real one: MODE,2 then RUNR,1000 then PACT (pip install pyserial):
     python3 -m serial.tools.miniterm --eol CRLF {path} 115200"
        ));
    }
    let program = std::env::args().next().unwrap_or_else(|| "stepdrive".to_owned());
    things.push(format!(
        "make a rig of your own:
     {program} example-rig > my-rig.toml && {program} up my-rig.toml"
    ));
    let mut text = "\nThings to try from another terminal:\n".to_owned();
    for (number, thing) in (1..).zip(things) {
        let _ = writeln!(text, "  {number}. {thing}");
    }
    text
}

/// The host under which an address is reached from here: a drive that listens on all addresses is reached at this one.
fn reachable(address: SocketAddr) -> IpAddr {
    match address.ip() {
        IpAddr::V4(host) if host.is_unspecified() => IpAddr::from(Ipv4Addr::LOCALHOST),
        IpAddr::V6(host) if host.is_unspecified() => IpAddr::from(Ipv6Addr::LOCALHOST),
        host @ (IpAddr::V4(_) | IpAddr::V6(_)) => host,
    }
}

/// What hangs on a drive, in one line.
fn mechanics(section: &DriveSection) -> String {
    let mut parts = vec![format!("{} steps/rev", section.steps_per_rev)];
    parts.push(match section.travel {
        Some([low, high]) => format!("travel {low} to {high} full steps"),
        None => "endless travel".to_owned(),
    });
    match &section.controller {
        ControllerSection::Smsd(smsd) => parts.extend(smsd.switches.iter().map(switch)),
        ControllerSection::Smd3(smd3) => parts.extend(smd3.switches.iter().map(switch)),
    }
    parts.join(", ")
}

fn switch<S: Display>(switch: &SwitchSection<S>) -> String {
    let [low, high] = switch.closed;
    format!("{} closed {low} to {high}", switch.input)
}
