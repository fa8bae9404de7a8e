//! Puts a rig on the network: Modbus TCP, and the files that hold non-volatile memory.
//!
//! This is the shell around the cores, and the only place with a clock, sockets and files. It decides nothing about the
//! controllers: it carries bytes and time to them and their replies back.
//!
//! * [`Server`] starts a rig and says where its drives are reached.
//! * `clock` is where time comes from; `world` keeps the rig in step with it; [`Control`] is how both are controlled.
//! * `modbus` speaks to clients; [`store`] keeps what survives power-off.

mod api;
mod clock;
mod control;
mod drive;
mod flash;
mod lines;
mod link;
mod modbus;
mod pty;
pub mod recording;
pub mod replay;
pub mod scenario;
mod smd3;
mod smsd;
pub mod store;
mod talk;
mod world;

pub use control::{Control, Moved, Until};
pub use drive::Notify;

use drive::Drive;
use flash::Flash;
use lines::LineListener;
use recording::{Header, RecordedDrive, Recorder};
use smd3::Smd3Station;
use smsd::SmsdStation;
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use stepdrive_drive::smsd::Refusal;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::file::{ControllerSection, DriveSection, RigFile, SerialPort, Smd3Section, SmsdSection};
use store::{Saver, Store, StoreError};
use tokio::task::JoinSet;
use world::World;

/// How a rig is to be served.
pub struct Options {
    /// The folder for non-volatile memory; made when it is not there.
    pub state: PathBuf,
    /// Where everything that goes in is recorded; a file there is an error. `None` records nothing.
    pub recording: Option<Recording>,
    /// Is told what happens, as it happens. It has to return at once: the drive waits meanwhile.
    pub notify: Notify,
}

/// A recording that is to be made.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The file.
    pub file: PathBuf,
    /// The text of the rig file.
    pub rig: String,
}

impl fmt::Debug for Options {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Options").field("state", &self.state).finish_non_exhaustive()
    }
}

/// Something that the person at the server may want to know. It displays as one line.
#[derive(Debug)]
pub struct Notice {
    /// The drive it is about.
    pub drive: String,
    /// What happened.
    pub what: What,
}

/// What a [`Notice`] tells.
#[derive(Debug)]
pub enum What {
    /// A command was refused and `CMD_ERROR` set. Further refusals are not told before the flag is cleared.
    Refused(Refusal),
    /// A client was turned away because eight are connected.
    Full(SocketAddr),
    /// LAN parameters were applied, and the drive is reached here now.
    Moved(SocketAddr),
    /// LAN parameters were applied, but their port cannot be had: the drive stays where it was.
    CannotMove {
        /// The port wanted.
        to: SocketAddr,
        /// Why it cannot be had.
        error: io::Error,
    },
    /// Non-volatile memory could not be written: the client got exception 04.
    NotStored(StoreError),
    /// The flash of an SMD3 could not be written: `STORE` was answered with -5.
    StoreFailed(StoreError),
    /// Accepting connections failed for now.
    CannotAccept(io::Error),
    /// An SMD3 found its configuration damaged, and came up with the factory's and `CONFIGURATION ERROR`.
    DamagedConfiguration {
        /// Where the damaged one is kept.
        copy: PathBuf,
    },
    /// A virtual COM port failed and is served no more.
    SerialFailed(io::Error),
    /// The recording could not be written, and is not continued.
    RecordingFailed(String),
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.drive)?;
        match &self.what {
            What::Refused(refusal) => write!(f, "{refusal}"),
            What::Full(peer) => {
                write!(f, "{peer} turned away: 8 clients are connected, and the controller serves no more")
            }
            What::Moved(address) => write!(f, "network configuration applied; now on Modbus TCP {address}"),
            What::CannotMove { to, error } => {
                write!(
                    f,
                    "network configuration applied, but {to} cannot be listened on ({error}); staying on the old port"
                )
            }
            What::NotStored(error) => write!(f, "{error}; the client was answered with exception 04"),
            What::StoreFailed(error) => write!(f, "{error}; STORE was answered with -5 (Action failed)"),
            What::DamagedConfiguration { copy } => {
                write!(f, "the stored configuration is damaged; a copy is kept in {}", copy.display())
            }
            What::RecordingFailed(error) => {
                write!(
                    f,
                    "the recording cannot be written ({error}); what is in the file so far can be replayed"
                )
            }
            What::SerialFailed(error) => write!(f, "the serial port failed and is closed: {error}"),
            What::CannotAccept(error) => write!(f, "cannot accept connections for the moment: {error}"),
        }
    }
}

/// Why a rig could not be started. Each displays as one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// Non-volatile memory cannot be had.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// An address cannot be listened on.
    #[error("{drive}: cannot listen on {address}: {error}; {}", listen_advice(*.remembered))]
    Listen {
        /// The drive.
        drive: String,
        /// Its address.
        address: SocketAddr,
        /// `true` when its port is not that of the rig file: the drive's LAN parameters name it.
        remembered: bool,
        /// Why not.
        error: io::Error,
    },
    /// The control API cannot listen.
    #[error(
        "cannot listen on {address} for the control API: {error}; choose another `api` in the rig file, or end what \
             uses it"
    )]
    Api {
        /// Its address.
        address: SocketAddr,
        /// Why not.
        error: io::Error,
    },
    /// A virtual COM port cannot be made.
    #[error("{drive}: cannot make the serial port {}: {error}; name another place with serial = \"pty:PATH\"", path.display())]
    Serial {
        /// The drive.
        drive: String,
        /// Its name.
        path: PathBuf,
        /// Why not.
        error: io::Error,
    },
    /// A recording cannot be made.
    #[error("cannot record to {}: {error}; name a new file in a folder that exists", file.display())]
    Record {
        /// The file.
        file: PathBuf,
        /// Why not.
        error: io::Error,
    },
}

/// What a person can do about an address that cannot be listened on.
fn listen_advice(remembered: bool) -> &'static str {
    if remembered {
        "this port was set in the drive's LAN parameters: end what uses it, or choose another state folder with \
         --state DIR"
    } else {
        "choose another port in the rig file, or end what uses it"
    }
}

/// A drive that is being served, and where it was reached when the server started.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServedDrive {
    /// Its name in the rig.
    pub name: String,
    /// Its model.
    pub model: &'static str,
    /// An SMSD: where it listened for Modbus TCP.
    pub modbus_tcp: Option<SocketAddr>,
    /// An SMSD: the unit identifier it answered to.
    pub unit: Option<u8>,
    /// An SMD3: its virtual COM port.
    pub serial: Option<PathBuf>,
    /// An SMD3: where it took lines over TCP.
    pub serial_tcp: Option<SocketAddr>,
}

/// A running rig. Dropping it ends all its tasks; [`Server::stop`] also waits until they have ended.
#[derive(Debug)]
pub struct Server {
    drives: Vec<ServedDrive>,
    api: Option<SocketAddr>,
    control: Control,
    tasks: JoinSet<()>,
    store: Store,
    flashes: Vec<Flash>,
}

impl Server {
    /// Brings up the rig: reads its memory, listens at every address, then serves. Must be called in a tokio runtime
    /// with timers and I/O.
    ///
    /// # Errors
    /// When the memory cannot be read or an address cannot be listened on. Nothing is left running then.
    pub async fn start(rig: &RigFile, options: Options) -> Result<Server, StartError> {
        let mut store = Store::open(&options.state)?;
        let up = async {
            let api = listen_for_control(rig).await?;
            let (world, ready) = bring_up(rig, &options, &mut store).await?;
            Ok((world, ready, api))
        };
        match up.await {
            Ok((world, ready, api)) => Ok(Server::serve(world, ready, api, store, &options.notify)),
            Err(error) => {
                store.close().await;
                Err(error)
            }
        }
    }

    fn serve(
        world: Arc<World>,
        ready: Vec<ReadyDrive>,
        api: Option<api::Listener>,
        store: Store,
        notify: &Notify,
    ) -> Server {
        let mut tasks = JoinSet::new();
        let flashes = ready.iter().filter_map(ReadyDrive::flash).cloned().collect();
        let mut keepers: Vec<Vec<Keeper>> = (0..world.groups()).map(|_| Vec::new()).collect();
        let mut drives = Vec::new();
        for drive in ready {
            let group = world.group_of(drives.len());
            let (served, keeper) = drive.serve(&mut tasks);
            drives.push(served);
            if let Some(keepers) = keepers.get_mut(group) {
                keepers.push(keeper);
            }
        }
        for (group, keepers) in keepers.into_iter().enumerate() {
            tasks.spawn(keep_time(Arc::clone(&world), group, keepers));
        }
        if world.recorder().is_some() {
            tasks.spawn(keep_recording(Arc::clone(&world), Arc::clone(notify)));
        }
        let control = Control::new(Arc::clone(&world));
        let address = api.as_ref().map(api::Listener::address);
        if let Some(api) = api {
            tasks.spawn(api.serve(world, control.clone(), drives.clone(), Arc::clone(notify)));
        }
        Server { drives, api: address, control, tasks, store, flashes }
    }

    /// The drives, in the order of the rig file.
    pub fn drives(&self) -> &[ServedDrive] {
        &self.drives
    }

    /// Where the control API listens; `None` when the rig file asks for none.
    pub fn api(&self) -> Option<SocketAddr> {
        self.api
    }

    /// What controls the rig from within this process.
    pub fn control(&self) -> &Control {
        &self.control
    }

    /// Closes all connections and listeners, and returns when what clients were told is stored, the recording is whole,
    /// and the state folder is free for another server.
    pub async fn stop(mut self) {
        self.tasks.shutdown().await;
        for flash in &self.flashes {
            flash.close().await;
        }
        self.store.close().await;
        self.control.end_recording();
    }
}

/// Whoever sees to what happens in a drive without a client.
enum Keeper {
    Smsd(Arc<SmsdStation>),
    Smd3(Arc<Smd3Station>),
}

/// Lets what is due in a group happen when it is, for as long as it is served.
async fn keep_time(world: Arc<World>, group: usize, keepers: Vec<Keeper>) {
    loop {
        world.wait(group).await;
        for keeper in &keepers {
            match keeper {
                Keeper::Smsd(station) => station.look_after().await,
                Keeper::Smd3(station) => station.look_after().await,
            }
        }
    }
}

/// How often what was recorded is handed to the system.
const FLUSH: Duration = Duration::from_millis(200);

/// Hands what was recorded to the system now and then, until that fails.
async fn keep_recording(world: Arc<World>, notify: Notify) {
    while let Some(recorder) = world.recorder() {
        tokio::time::sleep(FLUSH).await;
        recorder.flush();
        if let Some(error) = recorder.error() {
            notify(Notice { drive: "the rig".to_owned(), what: What::RecordingFailed(error) });
            return;
        }
    }
}

/// A drive that is switched on and listens, but is not served yet.
enum ReadyDrive {
    Smsd { station: SmsdStation, listener: modbus::Listener },
    Smd3 { station: Smd3Station, pty: Option<OpenPty>, listener: Option<LineListener> },
}

/// A virtual COM port and its name.
type OpenPty = (pty::Pty, pty::PortName);

impl ReadyDrive {
    fn flash(&self) -> Option<&Flash> {
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

    fn serve(self, tasks: &mut JoinSet<()>) -> (ServedDrive, Keeper) {
        match self {
            ReadyDrive::Smsd { station, listener } => serve_smsd(station, listener, tasks),
            ReadyDrive::Smd3 { station, pty, listener } => serve_smd3(station, pty, listener, tasks),
        }
    }
}

fn serve_smsd(
    station: SmsdStation,
    listener: modbus::Listener,
    tasks: &mut JoinSet<()>,
) -> (ServedDrive, Keeper) {
    let served = ServedDrive {
        name: station.drive().name().to_owned(),
        model: station.model(),
        modbus_tcp: Some(listener.address()),
        unit: Some(station.unit()),
        serial: None,
        serial_tcp: None,
    };
    let station = Arc::new(station);
    tasks.spawn(listener.serve(Arc::clone(&station)));
    (served, Keeper::Smsd(station))
}

fn serve_smd3(
    station: Smd3Station,
    pty: Option<OpenPty>,
    listener: Option<LineListener>,
    tasks: &mut JoinSet<()>,
) -> (ServedDrive, Keeper) {
    let served = ServedDrive {
        name: station.drive().name().to_owned(),
        model: "SMD3",
        modbus_tcp: None,
        unit: None,
        serial: pty.as_ref().map(|(_, name)| name.path().to_owned()),
        serial_tcp: listener.as_ref().map(LineListener::address),
    };
    let station = Arc::new(station);
    if let Some((port, name)) = pty {
        let station = Arc::clone(&station);
        tasks.spawn(async move {
            // The name stands for as long as the port is served.
            let _name = name;
            lines::serve_pty(port, station).await;
        });
    }
    if let Some(listener) = listener {
        tasks.spawn(listener.serve(Arc::clone(&station)));
    }
    (served, Keeper::Smd3(station))
}

/// Where a drive's memory is kept.
enum Kept {
    Store(Saver),
    Flash { flash: Flash, damaged: Option<PathBuf> },
}

/// Lets the control API listen, if the rig file asks for it.
async fn listen_for_control(rig: &RigFile) -> Result<Option<api::Listener>, StartError> {
    let Some(section) = &rig.api else { return Ok(None) };
    let listener = api::Listener::bind(section).await;
    listener.map(Some).map_err(|error| StartError::Api { address: section.address, error })
}

/// Switches all drives on and lets them listen.
async fn bring_up(
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
    match (&section.controller, memory) {
        (ControllerSection::Smsd(smsd), Kept::Store(saver)) => {
            let mut station = SmsdStation::new(drive, smsd, saver);
            let listener = listen(&mut station).await?;
            Ok(ReadyDrive::Smsd { station, listener })
        }
        (ControllerSection::Smd3(smd3), Kept::Flash { flash, damaged }) => {
            if let Some(copy) = damaged {
                drive.tell(What::DamagedConfiguration { copy });
            }
            let pty = smd3.serial.as_ref().map(|port| open_pty(&section.name, port, state)).transpose()?;
            let listener = match smd3.serial_tcp {
                Some(address) => Some(listen_for_lines(&section.name, address).await?),
                None => None,
            };
            Ok(ReadyDrive::Smd3 { station: Smd3Station::new(drive, flash), pty, listener })
        }
        (ControllerSection::Smsd(_), Kept::Flash { .. }) | (ControllerSection::Smd3(_), Kept::Store(_)) => {
            unreachable!("a drive's memory is kept as its own family's is")
        }
    }
}

/// Makes a virtual COM port, in the state folder unless the rig names a place.
fn open_pty(drive: &str, port: &SerialPort, state: &Path) -> Result<OpenPty, StartError> {
    let SerialPort::Pty(path) = port;
    let path = path.as_ref().map_or_else(|| state.join(format!("{drive}.tty")), PathBuf::from);
    // Whoever is told the name may work in another folder.
    let path = std::path::absolute(&path).unwrap_or(path);
    pty::open(&path).map_err(|error| StartError::Serial { drive: drive.to_owned(), path, error })
}

async fn listen_for_lines(drive: &str, address: SocketAddr) -> Result<LineListener, StartError> {
    let listener = LineListener::bind(address).await;
    listener.map_err(|error| StartError::Listen {
        drive: drive.to_owned(),
        address,
        remembered: false,
        error,
    })
}

/// Listens where the drive's LAN parameters say, or else where its rig says, and tells the drive a port that the rig left
/// open.
async fn listen(station: &mut SmsdStation) -> Result<modbus::Listener, StartError> {
    let address = station.address();
    match modbus::Listener::bind(address).await {
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
