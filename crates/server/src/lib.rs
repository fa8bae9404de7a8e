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
use stepdrive_rig::file::{DriveSection, RigFile};
use stepdrive_spec::smsd::models::Model;
use store::{Store, StoreError};
use tokio::task::JoinSet;

/// How a rig is to be served.
pub struct Options {
    /// The folder for non-volatile memory; made when it is not there.
    pub state: PathBuf,
    /// Is told what happens, as it happens.
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
    #[error(
        "{drive}: cannot listen on {address}: {error}; choose another port in the rig file, or end what uses it"
    )]
    Listen {
        /// The drive.
        drive: String,
        /// Its address.
        address: SocketAddr,
        /// Why not.
        error: io::Error,
    },
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

/// A running rig. Dropping it ends all its tasks; what clients were told is stored by then.
#[derive(Debug)]
pub struct Server {
    drives: Vec<ServedDrive>,
    _tasks: JoinSet<()>,
}

impl Server {
    /// Brings up the rig: reads its memory, listens at every address, then serves. Must be called in a tokio runtime
    /// with timers and I/O.
    ///
    /// # Errors
    /// When the memory cannot be read or an address cannot be listened on. Nothing is left running then.
    pub async fn start(rig: &RigFile, options: Options) -> Result<Server, StartError> {
        let store = Store::open(&options.state)?;
        let notify: station::Notify = Arc::from(options.notify);
        let clock = Clock::start(rig.rig.clock);
        let mut listening = Vec::new();
        for section in &rig.drives {
            let station = Station::power_up(section, clock, &store, Arc::clone(&notify))?;
            let listener = listen(section, &station).await?;
            listening.push((section, station, listener));
        }
        let mut tasks = JoinSet::new();
        let mut drives = Vec::new();
        for (section, station, listener) in listening {
            drives.push(ServedDrive {
                name: section.name.get_ref().clone(),
                model: section.model,
                modbus_tcp: listener.address(),
                unit: station.unit(),
            });
            let station = Arc::new(station);
            tasks.spawn(Arc::clone(&station).keep_time());
            tasks.spawn(listener.serve(station));
        }
        Ok(Server { drives, _tasks: tasks })
    }

    /// The drives, in the order of the rig file.
    pub fn drives(&self) -> &[ServedDrive] {
        &self.drives
    }
}

/// Listens where the drive's LAN parameters say, or else where its rig says, and tells the drive its port.
async fn listen(section: &DriveSection, station: &Station) -> Result<modbus::Listener, StartError> {
    let wanted = station.address();
    match modbus::Listener::bind(wanted).await {
        Ok(listener) => {
            if section.modbus_tcp.get_ref().port() == 0 {
                station.set_port(listener.address().port());
            }
            Ok(listener)
        }
        Err(error) => {
            Err(StartError::Listen { drive: section.name.get_ref().clone(), address: wanted, error })
        }
    }
}
