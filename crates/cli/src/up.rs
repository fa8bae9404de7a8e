//! `stepdrive up`: brings a rig up and keeps it running.

use crate::rigs::{self, Rig};
use crate::{Failure, UpArgs, print};
use serde::Serialize;
use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;
use stepdrive_rig::file::{ControllerSection, DriveSection, RigFile, SwitchSection};
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
    modbus_tcp: SocketAddr,
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
        let ServedDrive { name, model, modbus_tcp, .. } = drive;
        ReadyDrive { name: name.clone(), model: model.name(), modbus_tcp: *modbus_tcp }
    };
    let ready = Ready { event: "ready", drives: drives.iter().map(drive).collect() };
    let line = serde_json::to_string(&ready).map_err(|error| Failure::Failed(error.to_string()))?;
    Ok(line + "\n")
}

/// What runs where, and three things to try.
fn welcome(rig: &Rig, drives: &[ServedDrive]) -> String {
    let mut text = format!("stepdrive {}: {} is up.\n\n", env!("CARGO_PKG_VERSION"), rig.name);
    for (served, section) in drives.iter().zip(&rig.file.drives) {
        let ServedDrive { name, model, modbus_tcp, unit } = served;
        let _ = writeln!(text, "  {name}  {model}  Modbus TCP {modbus_tcp}, unit {unit}");
        let _ = writeln!(text, "  {:width$}  {}", "", mechanics(section), width = name.len());
    }
    let _ = writeln!(text, "\nNon-volatile memory: {}", rig.state.display());
    if let Some(first) = drives.first() {
        text.push_str(&things_to_try(first, &rig.file));
    }
    text.push_str("\nCtrl-C ends it.\n");
    text
}

fn things_to_try(first: &ServedDrive, rig: &RigFile) -> String {
    let (unit, port) = (first.unit, first.modbus_tcp.port());
    // A drive that listens on all addresses is reached at this one.
    let host = match first.modbus_tcp.ip() {
        IpAddr::V4(host) if host.is_unspecified() => IpAddr::from(Ipv4Addr::LOCALHOST),
        IpAddr::V6(host) if host.is_unspecified() => IpAddr::from(Ipv6Addr::LOCALHOST),
        host @ (IpAddr::V4(_) | IpAddr::V6(_)) => host,
    };
    let mine = match rig.drives.len() {
        1 => "make a rig of your own",
        _ => "make another rig",
    };
    format!(
        "
Three things to try from another terminal:
  1. ask it who it is, which needs no password (Debian: apt install mbpoll):
     mbpoll -m tcp -p {port} -a {unit} -0 -1 -t 3:hex -r 0x8001 -c 4 {host}
  2. log in, find the zero switch, go there and back (pip install pymodbus):
     python3 examples/first_move.py {host} {port}
  3. {mine}:
     stepdrive example-rig > my-rig.toml && stepdrive up my-rig.toml
"
    )
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
    }
    parts.join(", ")
}

fn switch<S: Display>(switch: &SwitchSection<S>) -> String {
    let [low, high] = switch.closed;
    format!("{} closed {low} to {high}", switch.input)
}
