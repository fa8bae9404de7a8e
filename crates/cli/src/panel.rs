//! `stepdrive panel`: axes in a browser.

use crate::Failure;
use crate::axis::{Found, Opened, Reach, Record, Remembered, find_all, measured};
use crate::terminal::{print, print_json, tell};
use crate::up::{end_requested, reachable};
use serde_json::json;
use std::future::ready;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stepdrive_host::axis::{DriveAxis, Motor, Smd3Motor, SmsdMotor};
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::SmsdOptions;
use stepdrive_host::uri::Target;
use stepdrive_host::{Timeouts, from_fn};
use stepdrive_panel::{Controller, Panel, PanelAxis};
use stepdrive_rig::file::DriveSection;
use stepdrive_server::{Connector, ServedDrive};
use stepdrive_web::{Guard, Listener, Site};
use tokio::runtime;

/// The variable of the environment in which the token may stand.
const TOKEN_VARIABLE: &str = "STEPDRIVE_PANEL_TOKEN";

/// How long a token may be. It is guessed more easily than it is typed when it is shorter.
const TOKEN_LENGTH: std::ops::RangeInclusive<usize> = 16..=256;

/// Where the API is described, for what is asked for elsewhere.
const DOCUMENT: &str = "GET /v1/axes/openapi.json";

/// Which axes are shown, and where.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive panel                          all axes of stepdrive.toml, on http://127.0.0.1:5081/
  stepdrive panel stage 192.168.1.2:502    these two
  stepdrive panel --listen 0.0.0.0:5081 --token-file token.txt

The page shows every axis and drives it: jog, move, home, settings, programs. A jog ends 500 ms after the browser was last heard
of. `stepdrive up` serves the same page for its rig, at the address of its API.

Beyond this computer it is served only with a token, 16 to 256 printable characters in a file or in STEPDRIVE_PANEL_TOKEN, which
the page asks for. The connection is not encrypted.")]
pub(crate) struct PanelArgs {
    /// The axes, each a name or a URI as `--axis` of the other commands takes; all of stepdrive.toml by default.
    #[arg(value_name = "NAME|URI")]
    names: Vec<String>,
    /// The same, as the other commands take it.
    #[arg(short, long, value_name = "NAME|URI")]
    axis: Vec<String>,
    /// Where it is served; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:5081")]
    listen: SocketAddr,
    /// The file that holds the token which clients must show.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    #[command(flatten)]
    reach: Reach,
}

/// Serves the panel until the process is asked to end.
pub(crate) fn panel(args: &PanelArgs) -> Result<(), Failure> {
    let names: Vec<String> = args.names.iter().chain(&args.axis).cloned().collect();
    let found = find_all(&names, &args.reach)?;
    check_unlike(&found)?;
    let guard = guard(args)?;
    let opened = found.into_iter().map(|found| found.open(&args.reach));
    let opened = opened.collect::<Result<Vec<Opened>, Failure>>()?;
    let runtime = runtime::Builder::new_multi_thread().enable_all().build();
    let runtime = runtime.map_err(|error| Failure::Failed(format!("cannot start threads: {error}")))?;
    runtime.block_on(serve(args, opened, guard))
}

async fn serve(args: &PanelArgs, opened: Vec<Opened>, guard: Guard) -> Result<(), Failure> {
    // Asked for before anything is announced, so that a signal never finds the default of dying at once.
    let end = end_requested().map_err(|error| Failure::Failed(format!("cannot catch signals: {error}")))?;
    let listener = Listener::bind(args.listen).await.map_err(|error| cannot_listen(args.listen, &error))?;
    let (names, axes): (Vec<_>, Vec<PanelAxis>) = opened.into_iter().map(shown).unzip();
    let panel = Panel::new(axes);
    let site = Site::new(panel.router(), guard, DOCUMENT);
    announce(args, listener.address(), &names)?;
    tokio::select! {
        _ = listener.serve(site, |error| tell(&format!("the panel cannot take connections for now: {error}"))) => {}
        () = end => {}
    }
    panel.close().await;
    Ok(())
}

/// An axis as the panel takes it; its name and where it is.
fn shown(opened: Opened) -> ((String, String), PanelAxis) {
    let name = opened.name().to_owned();
    let target = opened.found.target.to_string();
    let (controller, record) = opened.into_parts();
    let axis = PanelAxis {
        name: name.clone(),
        is_virtual: false,
        target: target.clone(),
        controller,
        keeper: Some(Box::new(Remembered::new(record))),
        simulated_as: None,
    };
    ((name, target), axis)
}

/// The unit that every controller answers to besides its own, so that a new one of its own changes nothing.
const ANY_UNIT: u8 = 255;

/// A panel over the drives of a rig in this process.
pub(crate) fn of_rig(connector: &Connector, drives: &[ServedDrive], sections: &[DriveSection]) -> Panel {
    let drives = drives.iter().zip(sections).enumerate();
    Panel::new(
        drives
            .filter_map(|(number, (drive, section))| in_process(connector, number, drive, section))
            .collect(),
    )
}

fn in_process(
    connector: &Connector,
    number: usize,
    drive: &ServedDrive,
    section: &DriveSection,
) -> Option<PanelAxis> {
    let target = target(drive)?;
    let record = Record::of(&target);
    let connector = connector.clone();
    let line = from_fn(&drive.name, move || ready(connector.connect(number)));
    let controller = if let Some(options) = target.smsd_options() {
        let driver = target.smsd(line, SmsdOptions { unit: ANY_UNIT, ..options })?;
        Controller::Smsd(axis(SmsdMotor::new(&drive.name, driver), &target, &record))
    } else {
        let client = Smd3Client::new(line, Timeouts::default());
        Controller::Smd3(axis(Smd3Motor::new(client), &target, &record))
    };
    Some(PanelAxis {
        name: drive.name.clone(),
        is_virtual: true,
        target: target.to_string(),
        controller,
        keeper: Some(Box::new(Remembered::new(record))),
        simulated_as: Some(section.clone()),
    })
}

/// An axis with the scale and the limits of `stepdrive.toml`, if it stands there.
fn axis<M: Motor>(motor: M, target: &Target, record: &Record) -> Arc<DriveAxis<M>> {
    let axis = DriveAxis::new(motor).with_trust(record.state());
    Arc::new(match measured(target) {
        Some((scale, limits)) => axis.with_scale(scale).with_limits(limits),
        None => axis,
    })
}

/// Where other programs reach a drive.
fn target(drive: &ServedDrive) -> Option<Target> {
    let place = |at: SocketAddr| (reachable(at).to_string(), at.port());
    if let Some((host, port)) = drive.modbus_tcp.map(place) {
        return Some(Target::Smsd { host, port, unit: drive.unit.unwrap_or(1), word_order: None });
    } else if let Some((host, port)) = drive.standard_tcp.map(place) {
        return Some(Target::SmsdStandard { host, port });
    } else if let Some((host, port)) = drive.serial_tcp.map(place) {
        return Some(Target::Smd3Tcp { host, port });
    }
    Some(Target::Smd3Serial { path: drive.serial.as_ref()?.display().to_string() })
}

/// Says where it is.
fn announce(args: &PanelArgs, at: SocketAddr, axes: &[(String, String)]) -> Result<(), Failure> {
    let url = url(at);
    if args.reach.json {
        let axes: Vec<_> =
            axes.iter().map(|(name, target)| json!({ "name": name, "target": target })).collect();
        return print_json(&json!({ "event": "ready", "panel": url, "axes": axes }));
    }
    let axes: String =
        axes.iter().map(|(name, target)| format!("  {name}  {target}\n")).collect::<Vec<_>>().concat();
    print(&format!("The panel: {url}\n\n{axes}\nCtrl-C ends it, and any jog.\n"))
}

/// The address of a panel, for a browser.
pub(crate) fn url(at: SocketAddr) -> String {
    format!("http://{}/", SocketAddr::new(reachable(at), at.port()))
}

fn cannot_listen(at: SocketAddr, error: &std::io::Error) -> Failure {
    Failure::Failed(format!("cannot serve the panel on {at}: {error}; choose another address with --listen"))
}

/// Two axes of the same name could not be told apart, and of two at one port only one would ever be reached.
fn check_unlike(found: &[Found]) -> Result<(), Failure> {
    for (number, axis) in found.iter().enumerate() {
        let others = || found.iter().take(number);
        if others().any(|other| other.name.eq_ignore_ascii_case(&axis.name)) {
            return Err(Failure::Usage(format!("{} is named twice; name each axis once", axis.name)));
        }
        let Some(port) = port_of(&axis.target) else { continue };
        if let Some(other) = others().find(|other| port_of(&other.target) == Some(port)) {
            return Err(Failure::Usage(format!(
                "{} and {} are both at {port}; a port is for one axis at a time: name one of them",
                other.name, axis.name
            )));
        }
    }
    Ok(())
}

/// The serial port of a target, if it has one.
fn port_of(target: &Target) -> Option<&str> {
    match target {
        Target::SmsdUsb { path } | Target::Smd3Serial { path } => Some(path),
        Target::Smsd { .. }
        | Target::SmsdUsbTcp { .. }
        | Target::SmsdStandard { .. }
        | Target::Smd3Tcp { .. } => None,
    }
}

/// Who may ask.
fn guard(args: &PanelArgs) -> Result<Guard, Failure> {
    match token(args.token_file.as_deref())? {
        Some(token) => Ok(Guard::with_token(&token, "the token of stepdrive panel")),
        None if args.listen.ip().to_canonical().is_loopback() => Ok(Guard::open()),
        None => Err(Failure::Usage(format!(
            "--listen {}: others could move the axes there; give a token with --token-file or {TOKEN_VARIABLE}, or take a \
             loopback address, as in 127.0.0.1:{}",
            args.listen,
            args.listen.port()
        ))),
    }
}

#[allow(clippy::disallowed_methods, reason = "a token stands in no argument, which others see")]
fn token(file: Option<&Path>) -> Result<Option<String>, Failure> {
    let (text, whence) = match file {
        Some(file) => {
            let text = std::fs::read_to_string(file).map_err(|error| {
                Failure::Usage(format!("cannot read {}, which is to hold the token: {error}", file.display()))
            })?;
            (text, file.display().to_string())
        }
        None => match std::env::var(TOKEN_VARIABLE) {
            Ok(text) => (text, TOKEN_VARIABLE.to_owned()),
            Err(std::env::VarError::NotPresent) => return Ok(None),
            Err(error @ std::env::VarError::NotUnicode(_)) => {
                return Err(Failure::Usage(format!("{TOKEN_VARIABLE} is no token: {error}")));
            }
        },
    };
    let text = text.trim();
    if TOKEN_LENGTH.contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_graphic()) {
        return Ok(Some(text.to_owned()));
    }
    let (least, most) = (TOKEN_LENGTH.start(), TOKEN_LENGTH.end());
    Err(Failure::Usage(format!(
        "what {whence} holds is no token: that is {least} to {most} printable ASCII characters without spaces"
    )))
}
