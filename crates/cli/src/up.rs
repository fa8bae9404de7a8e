//! `stepdrive up`: brings a rig up and keeps it running.

use crate::panel::{of_rig, url};
use crate::rig::DEFAULT_API;
use crate::rigs::{self, Rig};
use crate::terminal::print;
use crate::{Failure, UpArgs};
use serde::Serialize;
use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;
use stepdrive_panel::Panel;
use stepdrive_rig::file::{ApiSection, ControllerSection, DriveSection, SwitchSection};
use stepdrive_server::{Notify, Options, Recording, ServedDrive, Server};
use tokio::runtime;

/// The line of `--json`.
#[derive(Serialize)]
struct Ready {
    event: &'static str,
    drives: Vec<ReadyDrive>,
    #[serde(skip_serializing_if = "Option::is_none")]
    api: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    panel: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    recording: Option<PathBuf>,
}

/// A drive in the line of `--json`.
#[derive(Serialize)]
struct ReadyDrive {
    name: String,
    model: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    modbus_tcp: Option<SocketAddr>,
    #[serde(skip_serializing_if = "Option::is_none")]
    standard_tcp: Option<SocketAddr>,
    #[serde(skip_serializing_if = "Option::is_none")]
    usb: Option<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    usb_tcp: Option<SocketAddr>,
    #[serde(skip_serializing_if = "Option::is_none")]
    serial: Option<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    serial_tcp: Option<SocketAddr>,
}

/// Brings up the rig and serves it until the process is asked to end.
pub(crate) fn up(args: &UpArgs) -> Result<(), Failure> {
    let mut rig = rigs::load(args)?;
    set_options(&mut rig, args)?;
    let runtime = runtime::Builder::new_multi_thread().enable_all().build();
    let runtime = runtime.map_err(|error| Failure::Failed(format!("cannot start threads: {error}")))?;
    let talk = Talk::start().map_err(|error| Failure::Failed(format!("cannot start threads: {error}")))?;
    runtime.block_on(async {
        // Asked for before anything is announced, so that a signal never finds the default of dying at once.
        let end =
            end_requested().map_err(|error| Failure::Failed(format!("cannot catch signals: {error}")))?;
        let mut panel: Option<Panel> = None;
        let server =
            Server::start_with(&rig.file, options(&rig, args, talk.notify()), |connector, drives| {
                panel.insert(of_rig(connector, drives, &rig.file.drives)).router()
            });
        let server = server.await.map_err(|error| Failure::Failed(error.to_string()))?;
        let up = Running { rig: &rig, server: &server, recording: args.record.as_deref() };
        print(&if args.json { up.ready_line()? } else { up.welcome() })?;
        end.await;
        if let Some(panel) = panel {
            panel.close().await;
        }
        server.stop().await;
        Ok::<(), Failure>(())
    })?;
    talk.finish();
    Ok(())
}

/// What the arguments say otherwise than the rig file.
fn set_options(rig: &mut Rig, args: &UpArgs) -> Result<(), Failure> {
    rig.file.clock = args.clock.unwrap_or(rig.file.clock);
    let Some(address) = args.api else { return Ok(()) };
    let token = rig.file.api.take().and_then(|api| api.token);
    if token.is_none() && !address.ip().to_canonical().is_loopback() {
        return Err(Failure::Usage(format!(
            "--api {address}: others could control the rig there; give it an api_token in its rig file, or take a loopback \
             address, as in 127.0.0.1:{}",
            address.port()
        )));
    }
    rig.file.api = Some(ApiSection { address, token });
    Ok(())
}

fn options(rig: &Rig, args: &UpArgs, notify: Notify) -> Options {
    let recording = args.record.clone().map(|file| Recording { file, rig: rig.text.clone() });
    Options { state: rig.state.clone(), recording, notify }
}

/// Waits for Ctrl-C or SIGTERM.
#[cfg(unix)]
pub(crate) fn end_requested() -> io::Result<impl Future<Output = ()>> {
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
pub(crate) fn end_requested() -> io::Result<impl Future<Output = ()>> {
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
    fn notify(&self) -> Notify {
        let lines = self.lines.clone();
        Arc::new(move |notice| {
            let _ = lines.try_send(notice.to_string());
        })
    }

    /// Waits a moment until what was said is written.
    fn finish(self) {
        drop(self.lines);
        let _ = self.ended.recv_timeout(LAST_LINES);
    }
}

/// A rig that is up.
struct Running<'a> {
    rig: &'a Rig,
    server: &'a Server,
    recording: Option<&'a Path>,
}

impl Running<'_> {
    /// The URL of its control API.
    fn api(&self) -> Option<String> {
        self.server.api().map(|at| format!("http://{}", SocketAddr::new(reachable(at), at.port())))
    }

    /// Where its panel is, for a browser.
    fn panel(&self) -> Option<String> {
        self.server.api().map(url)
    }

    fn ready_line(&self) -> Result<String, Failure> {
        let drive = |drive: &ServedDrive| {
            let ServedDrive {
                name,
                model,
                modbus_tcp,
                unit: _,
                standard_tcp,
                usb,
                usb_tcp,
                serial,
                serial_tcp,
            } = drive.clone();
            ReadyDrive { name, model, modbus_tcp, standard_tcp, usb, usb_tcp, serial, serial_tcp }
        };
        let drives = self.server.drives().iter().map(drive).collect();
        let recording = self.recording.map(Path::to_owned);
        let (api, panel) = (self.api(), self.panel());
        let ready = Ready { event: "ready", drives, api, panel, recording };
        let line = serde_json::to_string(&ready).map_err(|error| Failure::Failed(error.to_string()))?;
        Ok(line + "\n")
    }

    /// What runs where, and a few things to try.
    fn welcome(&self) -> String {
        let Running { rig, server, recording } = self;
        let mut text = format!("stepdrive {}: {} is up.\n\n", env!("CARGO_PKG_VERSION"), rig.name);
        for (served, section) in server.drives().iter().zip(&rig.file.drives) {
            let ServedDrive { name, model, .. } = served;
            let _ = writeln!(text, "  {name}  {model}  {}", reached(served));
            let _ = writeln!(text, "  {:width$}  {}", "", mechanics(section), width = name.len());
        }
        let _ = writeln!(text, "\nNon-volatile memory: {}", rig.state.display());
        let (api, panel) = (self.api(), self.panel());
        if let Some((api, panel)) = api.as_ref().zip(panel.as_ref()) {
            let _ = writeln!(text, "Panel: {panel}");
            let _ = writeln!(text, "Control API: {api}");
        }
        if let Some(recording) = recording {
            let _ = writeln!(text, "Recording: {}", recording.display());
        }
        text.push_str(&things_to_try(server.drives(), api.as_deref(), panel.as_deref()));
        text.push_str("\nCtrl-C ends it.\n");
        text
    }
}

/// Where a drive is reached.
fn reached(drive: &ServedDrive) -> String {
    let modbus = drive.modbus_tcp.zip(drive.unit).map(|(at, unit)| format!("Modbus TCP {at}, unit {unit}"));
    let standard = drive.standard_tcp.map(|at| format!("standard protocol on TCP {at}"));
    let usb = drive.usb.as_ref().map(|path| format!("USB {}", path.display()));
    let usb_tcp = drive.usb_tcp.map(|at| format!("USB over TCP {at}"));
    let serial = drive.serial.as_ref().map(|path| format!("serial port {}", path.display()));
    let serial_tcp = drive.serial_tcp.map(|at| format!("lines over TCP {at}"));
    [modbus, standard, usb, usb_tcp, serial, serial_tcp]
        .into_iter()
        .flatten()
        .collect::<Vec<String>>()
        .join(", ")
}

/// A few things to try, with the first drive of each family.
fn things_to_try(drives: &[ServedDrive], api: Option<&str>, panel: Option<&str>) -> String {
    let program = std::env::args().next().unwrap_or_else(|| "stepdrive".to_owned());
    let mut things = Vec::new();
    if let Some(panel) = panel {
        things.push(format!("see every drive move, and move it, in a browser:\n     {panel}"));
    }
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
    if let Some(api) = api {
        let at = if api == DEFAULT_API { String::new() } else { format!(" --api {api}") };
        things.push(format!(
            "see what the drives do, and control the rig:
     {program} rig{at} status
     {program} rig{at} watch"
        ));
    }
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
pub(crate) fn reachable(address: SocketAddr) -> IpAddr {
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
