//! `stepdrive ports`: where controllers may be found on this computer.

use crate::Failure;
use crate::rig::table::{Align, table, text};
use crate::rig::{Answering, At, DriveState, look_at};
use crate::rigs::state_folder;
use crate::terminal::{print, print_json, tell};
use crate::up::reachable;
use serde::Serialize;
use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use stepdrive_host::serial_ports;
use stepdrive_host::uri::{DEFAULT_UNIT, Target};

/// Where the system gives serial ports names that stay the same.
const BY_ID: &str = "/dev/serial/by-id";

/// How the names of virtual COM ports end in a state folder.
const SMSD_PORT: &str = "usb";
const SMD3_PORT: &str = "tty";

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive ports
  stepdrive ports --json | jq -r '.serial_ports[].target'

The serial ports of this computer, the virtual ones of rigs in the platform's state folder, and the drives of the rig that
answers at --api. A TARGET goes behind -a. Nothing is sent to any serial port.")]
pub(crate) struct PortsArgs {
    #[command(flatten)]
    at: At,
    /// Print JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// A serial port.
#[derive(Debug, PartialEq, Eq, Serialize)]
struct Port {
    path: String,
    /// What `-a` takes.
    target: String,
    /// `usb`, `virtual`, `built-in`.
    kind: &'static str,
    /// What the system knows of what is behind it; may be empty.
    about: String,
}

/// A rig that answers.
#[derive(Debug, Serialize)]
struct Rig {
    api: String,
    drives: Vec<Drive>,
}

/// A drive of a rig.
#[derive(Debug, PartialEq, Eq, Serialize)]
struct Drive {
    name: String,
    model: String,
    /// What `-a` takes, each way to reach it.
    targets: Vec<String>,
}

/// All that was found.
#[derive(Debug, Serialize)]
struct Found {
    serial_ports: Vec<Port>,
    rigs: Vec<Rig>,
}

/// Shows where controllers may be found.
pub(crate) fn ports(args: &PortsArgs) -> Result<(), Failure> {
    let mut all_ports = system_ports();
    all_ports.extend(state_folder().map(|folder| virtual_ports(&folder)).unwrap_or_default());
    let (api, answering) = look_at(&args.at)?;
    let rigs = match answering {
        Answering::Rig(drives) => vec![Rig { api, drives: drives.iter().map(drive).collect() }],
        Answering::Closed(why) => {
            tell(&format!("the rig at {api} lets nobody look: {why}"));
            Vec::new()
        }
        Answering::Nothing => Vec::new(),
    };
    let found = Found { serial_ports: all_ports, rigs };
    if args.json {
        return print_json(&found);
    }
    if found.serial_ports.is_empty() && found.rigs.is_empty() {
        return print("no serial port and no rig was found on this computer\n");
    }
    print(&shown(&found))
}

fn shown(found: &Found) -> String {
    let of_port = |port: &Port| {
        let what = if port.about.is_empty() {
            port.kind.to_owned()
        } else {
            format!("{}, {}", port.kind, port.about)
        };
        [port.target.clone(), what]
    };
    let of_drive = |rig: &Rig, drive: &Drive| {
        let what = format!("{}, an {} of the rig at {}", drive.name, drive.model, rig.api);
        drive.targets.iter().map(|target| [target.clone(), what.clone()]).collect::<Vec<_>>()
    };
    let drives = found.rigs.iter().flat_map(|rig| rig.drives.iter().flat_map(|drive| of_drive(rig, drive)));
    let rows: Vec<[String; 2]> = found.serial_ports.iter().map(of_port).chain(drives).collect();
    text(&table([("TARGET", Align::Left), ("WHAT", Align::Left)], &rows))
}

fn drive(drive: &DriveState) -> Drive {
    let place =
        |text: &String| text.parse::<SocketAddr>().ok().map(|at| (reachable(at).to_string(), at.port()));
    let smsd = drive.modbus_tcp.as_ref().and_then(place);
    let smsd = smsd.map(|(host, port)| Target::Smsd { host, port, unit: DEFAULT_UNIT, word_order: None });
    let standard = drive.standard_tcp.as_ref().and_then(place);
    let standard = standard.map(|(host, port)| Target::SmsdStandard { host, port });
    let usb = drive.usb.clone().map(|path| Target::SmsdUsb { path });
    let usb_tcp = drive.usb_tcp.as_ref().and_then(place);
    let usb_tcp = usb_tcp.map(|(host, port)| Target::SmsdUsbTcp { host, port });
    let serial = drive.serial.clone().map(|path| Target::Smd3Serial { path });
    let lines = drive.serial_tcp.as_ref().and_then(place);
    let lines = lines.map(|(host, port)| Target::Smd3Tcp { host, port });
    let targets = [smsd, standard, usb, usb_tcp, serial, lines];
    let targets = targets.into_iter().flatten().map(|target| target.to_string());
    Drive { name: drive.name.clone(), model: drive.model.clone(), targets: targets.collect() }
}

/// The ports that the system has.
fn system_ports() -> Vec<Port> {
    let found = serial_ports().unwrap_or_else(|error| {
        tell(&format!("the system does not tell its serial ports: {error}"));
        Vec::new()
    });
    let names = stable_names(Path::new(BY_ID));
    found.iter().map(|path| system_port(path, &names)).collect()
}

fn system_port(path: &Path, names: &[(PathBuf, String)]) -> Port {
    let about = names.iter().find(|(device, _)| device == path).map(|(_, name)| name.clone());
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let usb = about.is_some() || file.starts_with("ttyACM") || file.starts_with("ttyUSB");
    port(path, if usb { "usb" } else { "built-in" }, about.unwrap_or_default())
}

fn port(path: &Path, kind: &'static str, about: String) -> Port {
    let shown = path.display().to_string();
    let target = if path.extension().is_some_and(|extension| extension == SMSD_PORT) {
        Target::SmsdUsb { path: shown.clone() }
    } else {
        Target::Smd3Serial { path: shown.clone() }
    };
    Port { target: target.to_string(), path: shown, kind, about }
}

/// The devices behind the names that stay the same, and these names.
fn stable_names(folder: &Path) -> Vec<(PathBuf, String)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let named = entries.filter_map(|entry| {
        let device = entry.path().canonicalize().ok()?;
        Some((device, entry.file_name().to_string_lossy().into_owned()))
    });
    let mut found: Vec<(PathBuf, String)> = named.collect();
    found.sort();
    found
}

/// The virtual COM ports of rigs that run: names in their state folders that lead to a device.
fn virtual_ports(state: &Path) -> Vec<Port> {
    let files =
        |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<PathBuf> =
        files(state).flat_map(|folder| files(&folder)).filter(|file| is_port(file)).collect();
    found.sort();
    found.iter().map(|path| port(path, "virtual", drive_name(path))).collect()
}

fn is_port(file: &Path) -> bool {
    // A name whose rig has ended leads nowhere.
    let is_named = file.extension().is_some_and(|extension| extension == SMSD_PORT || extension == SMD3_PORT);
    is_named && file.is_symlink() && file.exists()
}

/// The drive that a virtual port is of.
fn drive_name(path: &Path) -> String {
    let rig = path.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
    let drive = path.file_stem().unwrap_or_default().to_string_lossy();
    format!("{drive} of the rig {rig}")
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;
    use tempfile::TempDir;

    #[test]
    fn names_that_lead_nowhere_are_no_ports() {
        let state = TempDir::new().expect("a folder");
        let rig = state.path().join("demo");
        fs::create_dir(&rig).expect("made");
        symlink("/dev/null", rig.join("uhv.tty")).expect("made");
        symlink("/dev/pts/no-such", rig.join("gone.tty")).expect("made");
        symlink("/dev/null", rig.join("stage.usb")).expect("made");
        fs::write(rig.join("file.tty"), "").expect("written");
        fs::write(state.path().join("lock"), "").expect("written");
        let [usb, port] = virtual_ports(state.path()).try_into().expect("two");
        assert_eq!((usb.kind, usb.about.as_str()), ("virtual", "stage of the rig demo"));
        assert!(usb.target.starts_with("smsd+usb:///") && usb.target.ends_with("/demo/stage.usb"));
        assert_eq!((port.kind, port.about.as_str()), ("virtual", "uhv of the rig demo"));
        assert!(port.target.starts_with("smd3+serial:///") && port.target.ends_with("/demo/uhv.tty"));
        assert!(virtual_ports(&state.path().join("none")).is_empty());
    }

    #[test]
    fn a_port_is_known_by_the_name_that_stays_the_same() {
        let folder = TempDir::new().expect("a folder");
        symlink("/dev/null", folder.path().join("usb-AML_SMD3_20168-001")).expect("made");
        let names = stable_names(folder.path());
        let port = system_port(Path::new("/dev/null"), &names);
        assert_eq!((port.kind, port.about.as_str()), ("usb", "usb-AML_SMD3_20168-001"));
        assert_eq!(system_port(Path::new("/dev/ttyACM0"), &[]).kind, "usb");
        assert_eq!(system_port(Path::new("/dev/ttyS0"), &[]).kind, "built-in");
    }
}
