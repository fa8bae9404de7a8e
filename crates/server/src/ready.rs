//! Drives that are switched on and listen, but are not served yet.

use crate::connector::Station;
use crate::drive::Drive;
use crate::flash::Flash;
use crate::lines::Lines;
use crate::modbus::Modbus;
use crate::packets::{Standard, Usb};
use crate::port::{Party, serve_pty};
use crate::pty::{self, PortName, Pty};
use crate::recording::{Header, RecordedDrive, Recorder};
use crate::smd3::Smd3Station;
use crate::smsd::SmsdStation;
use crate::store::{Saver, Store};
use crate::tcp::{Host, Listener};
use crate::world::World;
use crate::{Options, Recording, ServedDrive, StartError, What};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::file::{ControllerSection, DriveSection, RigFile, SerialPort, Smd3Section, SmsdSection};
use stepdrive_spec::smsd::standard::Firmware;
use tokio::task::JoinSet;

/// A drive that is switched on and listens.
pub(crate) enum ReadyDrive {
    Smsd { station: Box<SmsdStation>, lan: Listener, usb: Ports },
    Smd3 { station: Smd3Station, serial: Ports },
}

/// A virtual COM port, and where over TCP is said what is said there; either may be missing.
#[derive(Default)]
pub(crate) struct Ports {
    pty: Option<(Pty, PortName)>,
    tcp: Option<Listener>,
}

impl ReadyDrive {
    /// The flash of an SMD3.
    pub(crate) fn flash(&self) -> Option<&Flash> {
        match self {
            ReadyDrive::Smsd { .. } => None,
            ReadyDrive::Smd3 { station, .. } => Some(station.flash()),
        }
    }

    /// What it was when it was switched on; nobody has been served yet.
    fn recorded(&self) -> RecordedDrive {
        match self {
            ReadyDrive::Smsd { station, .. } => station.recorded(),
            ReadyDrive::Smd3 { station, .. } => station.recorded(),
        }
    }

    /// Begins to serve it.
    pub(crate) fn serve(self, tasks: &mut JoinSet<()>) -> (ServedDrive, Station) {
        match self {
            ReadyDrive::Smsd { station, lan, usb } => serve_smsd(*station, lan, usb, tasks),
            ReadyDrive::Smd3 { station, serial } => serve_smd3(station, serial, tasks),
        }
    }
}

fn serve_smsd(
    station: SmsdStation,
    lan: Listener,
    usb: Ports,
    tasks: &mut JoinSet<()>,
) -> (ServedDrive, Station) {
    let on = |firmware| station.firmware() == firmware;
    let served = ServedDrive {
        name: station.drive().name().to_owned(),
        model: station.model(),
        modbus_tcp: on(Firmware::Modbus).then(|| lan.address()),
        unit: on(Firmware::Modbus).then(|| station.unit()),
        standard_tcp: on(Firmware::Standard).then(|| lan.address()),
        usb: usb.path(),
        usb_tcp: usb.address(),
        serial: None,
        serial_tcp: None,
    };
    let station = Arc::new(station);
    match station.firmware() {
        Firmware::Modbus => tasks.spawn(lan.serve(Modbus(Arc::clone(&station)))),
        Firmware::Standard => tasks.spawn(lan.serve(Standard(Arc::clone(&station)))),
    };
    usb.serve(&Usb(Arc::clone(&station)), tasks);
    (served, Station::Smsd(station))
}

fn serve_smd3(station: Smd3Station, serial: Ports, tasks: &mut JoinSet<()>) -> (ServedDrive, Station) {
    let served = ServedDrive {
        name: station.drive().name().to_owned(),
        model: "SMD3",
        modbus_tcp: None,
        unit: None,
        standard_tcp: None,
        usb: None,
        usb_tcp: None,
        serial: serial.path(),
        serial_tcp: serial.address(),
    };
    let station = Arc::new(station);
    serial.serve(&Lines(Arc::clone(&station)), tasks);
    (served, Station::Smd3(station))
}

impl Ports {
    /// Makes the port, under its `usual` name unless the rig gives it another, and listens at `tcp`. The drive and the key of
    /// the rig file are for errors.
    async fn open(
        drive: &str,
        key: &'static str,
        port: Option<&SerialPort>,
        usual: PathBuf,
        tcp: Option<SocketAddr>,
    ) -> Result<Ports, StartError> {
        let pty = port.map(|port| open_pty(drive, key, port, usual)).transpose()?;
        let Some(address) = tcp else { return Ok(Ports { pty, tcp: None }) };
        let failed =
            |error| StartError::Listen { drive: drive.to_owned(), address, remembered: false, error };
        Ok(Ports { pty, tcp: Some(Listener::bind(address).await.map_err(failed)?) })
    }

    fn path(&self) -> Option<PathBuf> {
        self.pty.as_ref().map(|(_, name)| name.path().to_owned())
    }

    fn address(&self) -> Option<SocketAddr> {
        self.tcp.as_ref().map(Listener::address)
    }

    fn serve(self, party: &(impl Party + Host), tasks: &mut JoinSet<()>) {
        if let Some((port, name)) = self.pty {
            let party = party.clone();
            tasks.spawn(async move {
                // The name stands for as long as the port is served.
                let _name = name;
                serve_pty(port, party).await;
            });
        }
        if let Some(listener) = self.tcp {
            tasks.spawn(listener.serve(party.clone()));
        }
    }
}

/// Where a drive's memory is kept.
enum Kept {
    Store(Saver),
    Flash { flash: Flash, damaged: Option<PathBuf> },
}

/// Switches all drives on and lets them listen.
pub(crate) async fn bring_up(
    rig: &RigFile,
    options: &Options,
    store: &mut Store,
) -> Result<(Arc<World>, Vec<ReadyDrive>), StartError> {
    let (mut machines, mut kept) = (Vec::new(), Vec::new());
    for drive in &rig.drives {
        let (machine, memory) = match &drive.controller {
            ControllerSection::Smsd(section) => power_up_smsd(drive, section, store)?,
            ControllerSection::Smd3(section) => power_up_smd3(drive, section, &options.state)?,
        };
        machines.push(machine);
        kept.push(memory);
    }
    let world = Arc::new(World::new(rig.clone(), machines));
    let mut ready = Vec::new();
    for (number, (section, memory)) in rig.drives.iter().zip(kept).enumerate() {
        let drive = Drive::new(Arc::clone(&world), number, Arc::clone(&options.notify));
        ready.push(get_ready(drive, section, memory, &options.state).await?);
    }
    if let Some(Recording { file, rig }) = &options.recording {
        let drives = ready.iter().map(ReadyDrive::recorded).collect();
        let created = Recorder::create(file, &Header::new(rig.clone(), drives));
        world.record(created.map_err(|error| StartError::Record { file: file.clone(), error })?);
    }
    Ok((world, ready))
}

fn power_up_smsd(
    drive: &DriveSection,
    section: &SmsdSection,
    store: &mut Store,
) -> Result<(AnyMachine, Kept), StartError> {
    let saver = store.saver(&drive.name, section.model);
    let memory = store.load(&drive.name, section.model)?;
    Ok((AnyMachine::Smsd(Box::new(section.power_up(drive, memory))), Kept::Store(saver)))
}

fn power_up_smd3(
    drive: &DriveSection,
    section: &Smd3Section,
    state: &Path,
) -> Result<(AnyMachine, Kept), StartError> {
    let flash = Flash::new(state, &drive.name);
    let (stored, damaged) = flash.load()?;
    let machine = AnyMachine::Smd3(Box::new(section.power_up(drive, stored)));
    Ok((machine, Kept::Flash { flash, damaged }))
}

/// Lets a drive listen.
async fn get_ready(
    drive: Drive,
    section: &DriveSection,
    memory: Kept,
    state: &Path,
) -> Result<ReadyDrive, StartError> {
    let name = &section.name;
    match (&section.controller, memory) {
        (ControllerSection::Smsd(smsd), Kept::Store(saver)) => {
            let mut station = SmsdStation::new(drive, smsd, saver);
            let lan = listen(&mut station).await?;
            let usual = state.join(format!("{name}.usb"));
            let usb = Ports::open(name, "usb", smsd.usb.as_ref(), usual, smsd.usb_tcp).await?;
            Ok(ReadyDrive::Smsd { station: Box::new(station), lan, usb })
        }
        (ControllerSection::Smd3(smd3), Kept::Flash { flash, damaged }) => {
            if let Some(copy) = damaged {
                drive.tell(What::DamagedConfiguration { copy });
            }
            let usual = state.join(format!("{name}.tty"));
            let serial = Ports::open(name, "serial", smd3.serial.as_ref(), usual, smd3.serial_tcp).await?;
            Ok(ReadyDrive::Smd3 { station: Smd3Station::new(drive, flash), serial })
        }
        (ControllerSection::Smsd(_), Kept::Flash { .. }) | (ControllerSection::Smd3(_), Kept::Store(_)) => {
            unreachable!("a drive's memory is kept as its own family's is")
        }
    }
}

/// Makes a virtual COM port, under its usual name unless the rig gives it another.
fn open_pty(
    drive: &str,
    key: &'static str,
    port: &SerialPort,
    usual: PathBuf,
) -> Result<(Pty, PortName), StartError> {
    let SerialPort::Pty(path) = port;
    let path = path.as_ref().map_or(usual, PathBuf::from);
    // Whoever is told the name may work in another folder.
    let path = std::path::absolute(&path).unwrap_or(path);
    pty::open(&path).map_err(|error| StartError::Serial { drive: drive.to_owned(), key, path, error })
}

/// Listens where the drive's LAN parameters say, or else where its rig says, and tells the drive a port that the rig left
/// open.
async fn listen(station: &mut SmsdStation) -> Result<Listener, StartError> {
    let address = station.address();
    match Listener::bind(address).await {
        Ok(listener) => {
            if address.port() == 0 {
                station.set_rig_port(listener.address().port());
            }
            Ok(listener)
        }
        Err(error) => {
            let remembered = station.lan_port().is_some();
            Err(StartError::Listen { drive: station.drive().name().to_owned(), address, remembered, error })
        }
    }
}
