//! Connections to drives from within this process.

use crate::drive::{Drive, Reach};
use crate::lines::Lines;
use crate::modbus::Modbus;
use crate::packets::Standard;
use crate::smd3::Smd3Station;
use crate::smsd::SmsdStation;
use crate::tcp::Host as _;
use crate::traffic::Peer;
use std::fmt;
use std::io::{self, ErrorKind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use stepdrive_spec::smsd::standard::Firmware;
use tokio::io::{AsyncRead, AsyncWrite, DuplexStream, duplex};
use tokio::sync::watch;
use tokio::task::JoinSet;

/// Bytes that wait on the way to a drive, and on the way back, before whoever sends more has to wait.
const ROOM: usize = 8192;

/// A drive that is served, as whoever speaks to it needs it.
#[derive(Clone)]
pub(crate) enum Station {
    Smsd(Arc<SmsdStation>),
    Smd3(Arc<Smd3Station>),
}

/// Makes connections to the drives of a running rig from within its process. Clones make connections to the same one.
///
/// Such a connection is one more client of its drive: it speaks what the drive speaks on its first line, is recorded, and
/// meets the same faults as one over TCP: it ends when the drive loses its supply or its line is cut. But it does not come
/// through the drive's network chip, so it takes none of its eight sockets, and stays when that is set up anew for somebody
/// else.
#[derive(Clone)]
pub struct Connector(Weak<Connections>);

/// The connections that there are. They end when this is dropped.
pub(crate) struct Connections(Mutex<Option<Live>>);

/// What there is until the rig stops.
struct Live {
    /// In the order of the rig file.
    stations: Vec<Station>,
    tasks: JoinSet<()>,
}

impl fmt::Debug for Connector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Connector").finish_non_exhaustive()
    }
}

impl fmt::Debug for Connections {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Connections").finish_non_exhaustive()
    }
}

impl Connector {
    /// Connects to the drive with this number in the rig file, from 0: Modbus TCP to an SMSD, packets of the standard
    /// protocol to one with the standard firmware, lines to an SMD3. Must be called in a tokio runtime.
    ///
    /// # Errors
    /// The drive cannot be reached now, as it is without its supply or its line is cut; the rig has stopped; there is no such
    /// drive.
    pub fn connect(&self, drive: usize) -> io::Result<DuplexStream> {
        let stopped = || io::Error::new(ErrorKind::NotConnected, "the rig has stopped");
        let connections = self.0.upgrade().ok_or_else(stopped)?;
        connections.lock().as_mut().ok_or_else(stopped)?.connect(drive)
    }
}

impl Connections {
    /// None yet, to these drives.
    pub(crate) fn new(stations: Vec<Station>) -> Arc<Connections> {
        Arc::new(Connections(Mutex::new(Some(Live { stations, tasks: JoinSet::new() }))))
    }

    /// What makes them.
    pub(crate) fn connector(self: &Arc<Connections>) -> Connector {
        Connector(Arc::downgrade(self))
    }

    /// Ends all of them and lets go of the drives; there are no more.
    pub(crate) async fn stop(&self) {
        let live = self.lock().take();
        if let Some(mut live) = live {
            live.tasks.shutdown().await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, Option<Live>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Live {
    fn connect(&mut self, drive: usize) -> io::Result<DuplexStream> {
        let station = self.stations.get(drive).ok_or_else(|| {
            io::Error::new(ErrorKind::NotFound, format!("the rig has no drive {drive}; they count from 0"))
        })?;
        if !station.drive().is_reachable() {
            let name = station.drive().name();
            let message = format!("{name} cannot be reached: it is without its supply, or its line is cut");
            return Err(io::Error::new(ErrorKind::ConnectionRefused, message));
        }
        // From here on, and not from when the task begins.
        let line = station.drive().watch();
        let (ours, theirs) = duplex(ROOM);
        while self.tasks.try_join_next().is_some() {}
        self.tasks.spawn(station.clone().serve(ours, line));
        Ok(theirs)
    }
}

impl Station {
    pub(crate) fn drive(&self) -> &Drive {
        match self {
            Station::Smsd(station) => station.drive(),
            Station::Smd3(station) => station.drive(),
        }
    }

    /// Sees to what has happened in the drive without a client.
    pub(crate) async fn look_after(&self) {
        match self {
            Station::Smsd(station) => station.look_after().await,
            Station::Smd3(station) => station.look_after().await,
        }
    }

    /// Serves a connection until the client leaves, or the drive cannot be reached any more.
    async fn serve(self, stream: DuplexStream, mut line: watch::Receiver<Reach>) {
        let outages = line.borrow_and_update().outages;
        tokio::select! {
            () = self.converse(stream) => {}
            // The drive outlives this, so that there is always somebody to tell.
            _ = line.wait_for(|reach| reach.outages != outages) => {}
        }
    }

    async fn converse(&self, stream: impl AsyncRead + AsyncWrite + Unpin + Send) {
        match self {
            Station::Smsd(station) => match station.firmware() {
                Firmware::Modbus => Modbus(Arc::clone(station)).converse(stream, Peer::Panel).await,
                Firmware::Standard => Standard(Arc::clone(station)).converse(stream, Peer::Panel).await,
            },
            Station::Smd3(station) => Lines(Arc::clone(station)).converse(stream, Peer::Panel).await,
        }
    }
}
