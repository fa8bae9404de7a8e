//! What is said between clients and drives, for whoever watches.
//!
//! A [`Tap`] sits where conversations pass. While nobody watches it costs one look at a number; else what was said is
//! put as it is into the queue of each who watches, and it is they who put it into words ([`words`]).

pub(crate) mod lines;
pub(crate) mod modbus;
pub(crate) mod packets;
mod words;

pub(crate) use words::{Row, words};

use std::collections::BTreeMap;
use std::fmt;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use stepdrive_spec::time::Instant;
use tokio::sync::mpsc;

/// The most that waits for somebody who watches. What comes when so much does is counted, and lost.
const MOST_WAITING: usize = 4096;

/// What a client speaks, and by which way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum By {
    /// Modbus TCP, to an SMSD.
    Modbus,
    /// Packets over USB or what stands for it, to an SMSD.
    Usb,
    /// Packets over the LAN of the standard firmware, to an SMSD.
    Lan,
    /// Lines, to an SMD3.
    Serial,
}

impl By {
    /// What it is called.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            By::Modbus => "modbus",
            By::Usb => "usb",
            By::Lan => "lan",
            By::Serial => "serial",
        }
    }
}

/// Who a client is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Peer {
    /// A program that came over TCP.
    Tcp(SocketAddr),
    /// Whoever has opened the virtual COM port.
    Pty,
    /// The panel, within this process.
    Panel,
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Peer::Tcp(address) => write!(f, "{address}"),
            Peer::Pty => f.write_str("pty"),
            Peer::Panel => f.write_str("panel"),
        }
    }
}

/// A client's connection to a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Client {
    /// The number of the connection.
    pub(crate) conn: u64,
    /// The number of the drive in the rig file.
    pub(crate) drive: usize,
    /// What it speaks.
    pub(crate) by: By,
    /// Who it is.
    pub(crate) peer: Peer,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    /// It was taken.
    Taken,
    /// The line was cut, or the connection over already.
    Cut,
    /// What it changed could not be stored; the reply stands for one that did not leave.
    NotStored,
}

/// Something that was said.
#[derive(Clone, Debug)]
pub(crate) struct Said {
    /// The rig time.
    pub(crate) at: Instant,
    /// With whom.
    pub(crate) client: Client,
    /// The request as it came; empty where the drive spoke by itself.
    pub(crate) request: Vec<u8>,
    /// The reply as it left; empty where there was none.
    pub(crate) reply: Vec<u8>,
    /// What became of the request.
    pub(crate) fate: Fate,
}

/// Where conversations can be overheard.
#[derive(Debug, Default)]
pub(crate) struct Tap {
    /// How many watch.
    watched: AtomicUsize,
    watchers: Mutex<Vec<Watcher>>,
    /// The clients that are connected, by the numbers of their connections.
    clients: Mutex<BTreeMap<u64, Client>>,
}

/// Somebody who watches.
#[derive(Debug)]
struct Watcher {
    /// Only this drive, if one is named.
    drive: Option<usize>,
    queue: mpsc::Sender<Said>,
    lost: Arc<AtomicU64>,
}

/// What is overheard, until it is dropped.
#[derive(Debug)]
pub(crate) struct Overheard {
    tap: Arc<Tap>,
    queue: mpsc::Receiver<Said>,
    lost: Arc<AtomicU64>,
}

impl Tap {
    /// Whether anybody watches.
    pub(crate) fn is_watched(&self) -> bool {
        self.watched.load(Ordering::Relaxed) != 0
    }

    /// A client has connected.
    pub(crate) fn open(&self, client: Client) {
        lock(&self.clients).insert(client.conn, client);
    }

    /// A client has left.
    pub(crate) fn shut(&self, conn: u64) {
        lock(&self.clients).remove(&conn);
    }

    /// Tells those who watch that something was said on a connection.
    pub(crate) fn say(&self, at: Instant, conn: u64, request: &[u8], reply: &[u8], fate: Fate) {
        if self.is_watched() {
            self.tell(at, conn, request, reply, fate);
        }
    }

    #[cold]
    fn tell(&self, at: Instant, conn: u64, request: &[u8], reply: &[u8], fate: Fate) {
        let Some(client) = lock(&self.clients).get(&conn).copied() else { return };
        for watcher in lock(&self.watchers).iter() {
            if watcher.drive.is_some_and(|drive| drive != client.drive) {
                continue;
            }
            let said = Said { at, client, request: request.to_vec(), reply: reply.to_vec(), fate };
            if let Err(mpsc::error::TrySendError::Full(_)) = watcher.queue.try_send(said) {
                watcher.lost.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Overhears what is said to one drive, or to all, from now on.
    pub(crate) fn overhear(self: &Arc<Tap>, drive: Option<usize>) -> Overheard {
        let (sender, queue) = mpsc::channel(MOST_WAITING);
        let lost = Arc::default();
        let mut watchers = lock(&self.watchers);
        watchers.push(Watcher { drive, queue: sender, lost: Arc::clone(&lost) });
        self.watched.store(watchers.len(), Ordering::Relaxed);
        Overheard { tap: Arc::clone(self), queue, lost }
    }
}

impl Overheard {
    /// Waits for something to be said.
    pub(crate) async fn next(&mut self) -> Option<Said> {
        self.queue.recv().await
    }

    /// What else has been said.
    pub(crate) fn waiting(&mut self) -> Option<Said> {
        self.queue.try_recv().ok()
    }

    /// How much was lost since this was last asked.
    pub(crate) fn lost(&self) -> u64 {
        self.lost.swap(0, Ordering::Relaxed)
    }
}

impl Drop for Overheard {
    fn drop(&mut self) {
        self.queue.close();
        let mut watchers = lock(&self.tap.watchers);
        watchers.retain(|watcher| !watcher.queue.is_closed());
        self.tap.watched.store(watchers.len(), Ordering::Relaxed);
    }
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(conn: u64, drive: usize) -> Client {
        Client { conn, drive, by: By::Modbus, peer: Peer::Panel }
    }

    fn conns(overheard: &mut Overheard) -> Vec<u64> {
        std::iter::from_fn(|| overheard.waiting()).map(|said| said.client.conn).collect()
    }

    #[test]
    fn each_hears_the_drive_that_it_watches_and_from_then_on() {
        let tap = Arc::new(Tap::default());
        tap.open(client(1, 0));
        tap.open(client(2, 1));
        tap.say(Instant::ZERO, 1, b"early", b"", Fate::Taken);
        let (mut all, mut second) = (tap.overhear(None), tap.overhear(Some(1)));
        for conn in [1, 2, 1, 7] {
            tap.say(Instant::ZERO, conn, b"a", b"b", Fate::Taken);
        }
        assert_eq!((conns(&mut all), conns(&mut second)), (vec![1, 2, 1], vec![2]));
        tap.shut(1);
        tap.say(Instant::ZERO, 1, b"late", b"", Fate::Taken);
        assert_eq!(conns(&mut all), Vec::<u64>::new());
    }

    #[test]
    fn nobody_watches_any_more_when_the_last_has_gone() {
        let tap = Arc::new(Tap::default());
        assert!(!tap.is_watched());
        let (first, second) = (tap.overhear(None), tap.overhear(Some(3)));
        assert!(tap.is_watched());
        drop(first);
        assert!(tap.is_watched());
        drop(second);
        assert!(!tap.is_watched() && lock(&tap.watchers).is_empty());
    }

    #[test]
    fn what_does_not_fit_is_counted() {
        let tap = Arc::new(Tap::default());
        tap.open(client(1, 0));
        let mut all = tap.overhear(None);
        for _ in 0..MOST_WAITING + 3 {
            tap.say(Instant::ZERO, 1, b"a", b"b", Fate::Taken);
        }
        assert_eq!((all.lost(), all.lost()), (3, 0));
        assert_eq!(conns(&mut all).len(), MOST_WAITING);
    }
}
