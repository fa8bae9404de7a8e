//! `stepdrive up`: brings a rig up and keeps it running.

use crate::rigs::{self, Rig};
use crate::{Failure, UpArgs, print};
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::net::SocketAddr;
use stepdrive_rig::file::{DriveSection, RigFile};
use stepdrive_server::{Options, ServedDrive, Server};
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
    runtime.block_on(async {
        // Asked for before anything is announced, so that a signal never finds the default of dying at once.
        let end =
            end_requested().map_err(|error| Failure::Failed(format!("cannot catch signals: {error}")))?;
        let options =
            Options { state: rig.state.clone(), notify: Box::new(|notice| tell(&notice.to_string())) };
        let server =
            Server::start(&rig.file, options).await.map_err(|error| Failure::Failed(error.to_string()))?;
        print(&if args.json { ready_line(server.drives())? } else { welcome(&rig, server.drives()) })?;
        end.await;
        Ok(())
    })
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

/// Talks to the person at the terminal.
fn tell(line: &str) {
    // Without a stderr there is nobody to tell.
    let _ = writeln!(io::stderr(), "{line}");
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
        text.push_str(&things_to_try(first.modbus_tcp, &rig.file));
    }
    text.push_str("\nCtrl-C ends it.\n");
    text
}

fn things_to_try(address: SocketAddr, rig: &RigFile) -> String {
    let (host, port) = (address.ip(), address.port());
    let mine = match rig.drives.len() {
        1 => "make a rig of your own",
        _ => "make another rig",
    };
    format!(
        "
Three things to try from another terminal:
  1. ask it who it is, which needs no password (Debian: apt install mbpoll):
     mbpoll -m tcp -p {port} -a 1 -0 -1 -t 3:hex -r 0x8001 -c 4 {host}
  2. log in, find the zero switch, go there and back (pip install pymodbus):
     python3 examples/first_move.py {host} {port}
  3. {mine}:
     stepdrive example-rig > my-rig.toml && stepdrive up my-rig.toml
"
    )
}

/// What hangs on a drive, in one line.
fn mechanics(section: &DriveSection) -> String {
    let mut parts = vec![format!("{} steps/rev", section.motor.steps_per_rev.get_ref())];
    parts.push(match &section.mechanics.travel {
        Some(travel) => {
            let [low, high] = *travel.get_ref();
            format!("travel {low} to {high} full steps")
        }
        None => "endless travel".to_owned(),
    });
    for switch in &section.switches {
        let [low, high] = *switch.closed.get_ref();
        parts.push(format!("{} closed {low} to {high}", switch.input));
    }
    parts.join(", ")
}
