//! Puts a rig on the network: Modbus TCP, and the files that hold non-volatile memory.
//!
//! This is the shell around the cores, and the only place with a clock, sockets and files. It decides nothing about the
//! controllers: it carries bytes and time to them and their replies back.
//!
//! * [`Server`] starts a rig and says where its drives are reached.
//! * `clock` is where time comes from; `station` keeps one machine in step with it.
//! * `modbus` speaks to clients; [`store`] keeps what survives power-off.

mod clock;
mod modbus;
mod station;
pub mod store;

use clock::Clock;
use station::Station;
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use stepdrive_drive::smsd::Refusal;
use stepdrive_rig::file::{ControllerSection, RigFile};
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
    /// Accepting connections failed for now.
    CannotAccept(io::Error),
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.drive)?;
        match &self.what {
            What::Refused(refusal) => write!(f, "{refusal}"),
            What::Full(peer) => {
                write!(
                    f,
                    "{peer} turned away: 8 clients are connected, and the controller has no more sockets"
                )
            }
            What::Moved(address) => write!(f, "network configuration applied; now on Modbus TCP {address}"),
            What::CannotMove { to, error } => {
                write!(
                    f,
                    "network configuration applied, but {to} cannot be listened on ({error}); staying on the old port"
                )
            }
            What::NotStored(error) => write!(f, "{error}; the client was answered with exception 04"),
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

/// A drive that is being served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServedDrive {
    /// Its name in the rig.
    pub name: String,
    /// Its model.
    pub model: Model,
    /// Where it listened when the server started.
    pub modbus_tcp: SocketAddr,
    /// The unit identifier it answered to then.
    pub unit: u8,
}

/// A running rig. Dropping it ends all its tasks; [`Server::stop`] also waits until they have ended.
#[derive(Debug)]
pub struct Server {
    drives: Vec<ServedDrive>,
    tasks: JoinSet<()>,
    store: Store,
}

impl Server {
    /// Brings up the rig: reads its memory, listens at every address, then serves. Must be called in a tokio runtime
    /// with timers and I/O.
    ///
    /// # Errors
    /// When the memory cannot be read or an address cannot be listened on. Nothing is left running then.
    pub async fn start(rig: &RigFile, options: Options) -> Result<Server, StartError> {
        let mut store = Store::open(&options.state)?;
        match bring_up(rig, &mut store, &Arc::from(options.notify)).await {
            Ok(ready) => {
                let mut tasks = JoinSet::new();
                let drives = ready.into_iter().map(|ready| ready.serve(&mut tasks)).collect();
                Ok(Server { drives, tasks, store })
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
        self.store.close().await;
    }
}

/// A drive that is switched on and listens, but is not served yet.
struct ReadyDrive {
    model: Model,
    station: Station,
    listener: modbus::Listener,
}

impl ReadyDrive {
    fn serve(self, tasks: &mut JoinSet<()>) -> ServedDrive {
        let ReadyDrive { model, station, listener } = self;
        let served = ServedDrive {
            name: station.name().to_owned(),
            model,
            modbus_tcp: listener.address(),
            unit: station.unit(),
        };
        let station = Arc::new(station);
        tasks.spawn(Arc::clone(&station).keep_time());
        tasks.spawn(listener.serve(station));
        served
    }
}

/// Switches all drives on and lets them listen.
async fn bring_up(
    rig: &RigFile,
    store: &mut Store,
    notify: &station::Notify,
) -> Result<Vec<ReadyDrive>, StartError> {
    let clock = Clock::start(rig.clock);
    let mut ready = Vec::new();
    for drive in &rig.drives {
        let ControllerSection::Smsd(section) = &drive.controller;
        let mut station = Station::power_up(drive, section, clock, store, Arc::clone(notify))?;
        let listener = listen(&mut station).await?;
        ready.push(ReadyDrive { model: section.model, station, listener });
    }
    Ok(ready)
}

/// Listens where the drive's LAN parameters say, or else where its rig says, and tells the drive a port that the rig left
/// open.
async fn listen(station: &mut Station) -> Result<modbus::Listener, StartError> {
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
