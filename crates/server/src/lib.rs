//! Puts a rig on the network: Modbus TCP, and the files that hold non-volatile memory.
//!
//! This is the shell around the cores, and the only place with a clock, sockets and files. It decides nothing about the
//! controllers: it carries bytes and time to them and their replies back.
//!
//! * [`Server`] starts a rig and says where its drives are reached.
//! * `clock` is where time comes from; `station` keeps one machine in step with it.
//! * `modbus` speaks to clients; [`store`] keeps what survives power-off.

mod clock;
mod flash;
mod lines;
mod modbus;
mod pty;
mod smd3;
mod smsd;
mod station;
pub mod store;

use clock::Clock;
use flash::Flash;
use lines::LineListener;
use smd3::Smd3Station;
use smsd::SmsdStation;
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stepdrive_drive::smsd::Refusal;
use stepdrive_rig::file::{ControllerSection, RigFile, SerialPort};
use stepdrive_spec::smsd::models::Model;
use store::{Store, StoreError};
use tokio::task::JoinSet;

/// How a rig is to be served.
pub struct Options {
    /// The folder for non-volatile memory; made when it is not there.
    pub state: PathBuf,
    /// Is told what happens, as it happens. It has to return at once: the drive waits meanwhile.
    pub notify: Box<dyn Fn(Notice) + Send + Sync>,
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
        match bring_up(rig, &options.state, &mut store, &Arc::from(options.notify)).await {
            Ok(ready) => {
                let mut tasks = JoinSet::new();
                let flashes = ready.iter().filter_map(ReadyDrive::flash).cloned().collect();
                let drives = ready.into_iter().map(|ready| ready.serve(&mut tasks)).collect();
                Ok(Server { drives, tasks, store, flashes })
            }
            Err(error) => {
                store.close().await;
                Err(error)
            }
        }
    }

    /// The drives, in the order of the rig file.
    pub fn drives(&self) -> &[ServedDrive] {
        &self.drives
    }

    /// Closes all connections and listeners, and returns when what clients were told is stored and the state folder is
    /// free for another server.
    pub async fn stop(mut self) {
        self.tasks.shutdown().await;
        for flash in &self.flashes {
            flash.close().await;
        }
        self.store.close().await;
    }
}

/// A drive that is switched on and listens, but is not served yet.
enum ReadyDrive {
    Smsd { model: Model, station: SmsdStation, listener: modbus::Listener },
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

    fn serve(self, tasks: &mut JoinSet<()>) -> ServedDrive {
        match self {
            ReadyDrive::Smsd { model, station, listener } => serve_smsd(model, station, listener, tasks),
            ReadyDrive::Smd3 { station, pty, listener } => serve_smd3(station, pty, listener, tasks),
        }
    }
}

fn serve_smsd(
    model: Model,
    station: SmsdStation,
    listener: modbus::Listener,
    tasks: &mut JoinSet<()>,
) -> ServedDrive {
    let served = ServedDrive {
        name: station.name().to_owned(),
        model: model.name(),
        modbus_tcp: Some(listener.address()),
        unit: Some(station.unit()),
        serial: None,
        serial_tcp: None,
    };
    let station = Arc::new(station);
    tasks.spawn(Arc::clone(&station).keep_time());
    tasks.spawn(listener.serve(station));
    served
}

fn serve_smd3(
    station: Smd3Station,
    pty: Option<OpenPty>,
    listener: Option<LineListener>,
    tasks: &mut JoinSet<()>,
) -> ServedDrive {
    let served = ServedDrive {
        name: station.name().to_owned(),
        model: "SMD3",
        modbus_tcp: None,
        unit: None,
        serial: pty.as_ref().map(|(_, name)| name.path().to_owned()),
        serial_tcp: listener.as_ref().map(LineListener::address),
    };
    let station = Arc::new(station);
    tasks.spawn(Arc::clone(&station).keep_time());
    if let Some((port, name)) = pty {
        let station = Arc::clone(&station);
        tasks.spawn(async move {
            // The name stands for as long as the port is served.
            let _name = name;
            lines::serve_pty(port, station).await;
        });
    }
    if let Some(listener) = listener {
        tasks.spawn(listener.serve(station));
    }
    served
}

/// Switches all drives on and lets them listen.
async fn bring_up(
    rig: &RigFile,
    state: &Path,
    store: &mut Store,
    notify: &station::Notify,
) -> Result<Vec<ReadyDrive>, StartError> {
    let clock = Clock::start(rig.clock);
    let mut ready = Vec::new();
    for drive in &rig.drives {
        let notify = Arc::clone(notify);
        ready.push(match &drive.controller {
            ControllerSection::Smsd(section) => {
                let mut station = SmsdStation::power_up(drive, section, clock, store, notify)?;
                let listener = listen(&mut station).await?;
                ReadyDrive::Smsd { model: section.model, station, listener }
            }
            ControllerSection::Smd3(section) => {
                let station = Smd3Station::power_up(drive, section, clock, state, notify)?;
                let pty =
                    section.serial.as_ref().map(|port| open_pty(&drive.name, port, state)).transpose()?;
                let listener = match section.serial_tcp {
                    Some(address) => Some(listen_for_lines(&drive.name, address).await?),
                    None => None,
                };
                ReadyDrive::Smd3 { station, pty, listener }
            }
        });
    }
    Ok(ready)
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
            Err(StartError::Listen { drive: station.name().to_owned(), address, remembered, error })
        }
    }
}
