//! Puts a rig on the network and on serial ports, and keeps the files that hold non-volatile memory.
//!
//! This is the shell around the cores, and the only place with a clock, sockets and files. It decides nothing about the
//! controllers: it carries bytes and time to them and their replies back.
//!
//! * [`Server`] starts a rig and says where its drives are reached.
//! * `clock` is where time comes from; `world` keeps the rig in step with it; [`Control`] is how both are controlled.
//! * `modbus`, `lines` and `packets` speak to clients, on the ports of `tcp` and `pty`; [`store`] keeps what survives
//!   power-off.
//! * [`Connector`] connects to drives from within the process; `traffic` tells whoever listens what is said.

mod api;
mod clock;
mod connector;
mod control;
mod drive;
mod flash;
mod lines;
mod link;
mod modbus;
mod packets;
mod port;
mod pty;
mod ready;
pub mod recording;
pub mod replay;
pub mod scenario;
mod smd3;
mod smsd;
pub mod store;
mod talk;
mod tcp;
mod traffic;
mod world;

pub use connector::Connector;
pub use control::{Control, Moved, Until};
pub use drive::Notify;

use axum::Router;
use connector::{Connections, Station};
use flash::Flash;
use ready::ReadyDrive;
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_drive::smsd::Refusal;
use stepdrive_rig::file::RigFile;
use store::{Store, StoreError};
use tokio::io::DuplexStream;
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
    /// LAN parameters were applied, and the drive is reached over LAN here now.
    Moved(SocketAddr),
    /// LAN parameters were applied, but their port cannot be had: the drive stays where it was.
    CannotMove {
        /// The port wanted.
        to: SocketAddr,
        /// Why it cannot be had.
        error: io::Error,
    },
    /// Non-volatile memory could not be written.
    NotStored {
        /// Why not.
        error: StoreError,
        /// What the client was answered with; `None` when it was not for a client.
        answered: Option<&'static str>,
    },
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
            What::Moved(address) => write!(f, "network configuration applied; now on TCP {address}"),
            What::CannotMove { to, error } => {
                write!(
                    f,
                    "network configuration applied, but {to} cannot be listened on ({error}); staying on the old port"
                )
            }
            What::NotStored { error, answered: None } => write!(f, "{error}"),
            What::NotStored { error, answered: Some(answer) } => {
                write!(f, "{error}; the client was answered with {answer}")
            }
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
    #[error("{drive}: cannot make the serial port {}: {error}; name another place with {key} = \"pty:PATH\"", path.display())]
    Serial {
        /// The drive.
        drive: String,
        /// The key of the rig file that asks for it.
        key: &'static str,
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
    /// An SMSD on Modbus TCP: the unit identifier it answered to.
    pub unit: Option<u8>,
    /// An SMSD with the standard firmware: where it listened for the standard protocol.
    pub standard_tcp: Option<SocketAddr>,
    /// An SMSD: its virtual COM port, which stands for USB.
    pub usb: Option<PathBuf>,
    /// An SMSD: where it took over TCP what comes over USB.
    pub usb_tcp: Option<SocketAddr>,
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
    connections: Arc<Connections>,
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
        Server::start_with(rig, options, |_, _| Router::new()).await
    }

    /// The same, and serves beside the control API, to whoever may use that, what `more` makes: routes without fallbacks,
    /// of other paths. It is called once, when the drives are served and if the rig has an API.
    ///
    /// # Errors
    /// Those of [`Server::start`].
    pub async fn start_with(
        rig: &RigFile,
        options: Options,
        more: impl FnOnce(&Connector, &[ServedDrive]) -> Router,
    ) -> Result<Server, StartError> {
        let mut store = Store::open(&options.state)?;
        let up = async {
            let api = listen_for_control(rig).await?;
            let (world, ready) = ready::bring_up(rig, &options, &mut store).await?;
            Ok((world, ready, api))
        };
        match up.await {
            Ok((world, ready, api)) => Ok(Server::serve(world, ready, api, store, &options.notify, more)),
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
        more: impl FnOnce(&Connector, &[ServedDrive]) -> Router,
    ) -> Server {
        let mut tasks = JoinSet::new();
        let flashes = ready.iter().filter_map(ReadyDrive::flash).cloned().collect();
        let (drives, stations): (Vec<ServedDrive>, Vec<Station>) =
            ready.into_iter().map(|drive| drive.serve(&mut tasks)).unzip();
        for group in 0..world.groups() {
            let numbered = stations.iter().enumerate();
            let members = numbered.filter(|(drive, _)| world.group_of(*drive) == group);
            let members = members.map(|(_, station)| station.clone()).collect();
            tasks.spawn(keep_time(Arc::clone(&world), group, members));
        }
        let connections = Connections::new(stations);
        if world.recorder().is_some() {
            tasks.spawn(keep_recording(Arc::clone(&world), Arc::clone(notify)));
        }
        let control = Control::new(Arc::clone(&world));
        let address = api.as_ref().map(api::Listener::address);
        if let Some(api) = api {
            let more = more(&connections.connector(), &drives);
            tasks.spawn(api.serve(world, control.clone(), drives.clone(), Arc::clone(notify), more));
        }
        Server { drives, api: address, control, tasks, connections, store, flashes }
    }

    /// The drives, in the order of the rig file.
    pub fn drives(&self) -> &[ServedDrive] {
        &self.drives
    }

    /// Where the control API listens; `None` when the rig file asks for none.
    pub fn api(&self) -> Option<SocketAddr> {
        self.api
    }

    /// What makes connections to the drives from within this process.
    pub fn connector(&self) -> Connector {
        self.connections.connector()
    }

    /// Connects to a drive from within this process; see [`Connector::connect`].
    ///
    /// # Errors
    /// The drive cannot be reached now, or there is none with this number.
    pub fn line(&self, drive: usize) -> io::Result<DuplexStream> {
        self.connector().connect(drive)
    }

    /// What controls the rig from within this process.
    pub fn control(&self) -> &Control {
        &self.control
    }

    /// Closes all connections and listeners, and returns when what clients were told is stored, the recording is whole,
    /// and the state folder is free for another server.
    pub async fn stop(mut self) {
        self.tasks.shutdown().await;
        self.connections.stop().await;
        for flash in &self.flashes {
            flash.close().await;
        }
        self.store.close().await;
        self.control.end_recording();
    }
}

/// Lets what is due in a group happen when it is, for as long as it is served, and sees to what happens in its drives
/// without a client.
async fn keep_time(world: Arc<World>, group: usize, members: Vec<Station>) {
    loop {
        world.wait(group).await;
        for station in &members {
            station.look_after().await;
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

/// Lets the control API listen, if the rig file asks for it.
async fn listen_for_control(rig: &RigFile) -> Result<Option<api::Listener>, StartError> {
    let Some(section) = &rig.api else { return Ok(None) };
    let listener = api::Listener::bind(section).await;
    listener.map(Some).map_err(|error| StartError::Api { address: section.address, error })
}
