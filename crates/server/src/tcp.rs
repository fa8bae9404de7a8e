//! The TCP ports of a drive: a listener for each, a task for each connection.

use crate::What;
use crate::drive::{Drive, Reach};
use crate::traffic::Peer;
use socket2::{SockRef, TcpKeepalive};
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_spec::smsd::timing::MAX_CONNECTIONS;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::timeout;

/// How long a peer that has vanished may keep its socket before the kernel starts asking for it.
const KEEPALIVE: Duration = Duration::from_mins(1);

/// How long accepting rests after it has failed, as when the process has no file descriptors left.
const ACCEPT_REST: Duration = Duration::from_millis(100);

/// How long a connection waits for a socket when all are taken. A client that leaves and comes back at once, or whose
/// place another one takes, is seen to come before it is seen to leave.
const LEAVING: Duration = Duration::from_millis(100);

/// Who serves the connections of a listener: [`MAX_CONNECTIONS`] at a time, as many as an SMSD's network chip has sockets.
pub(crate) trait Host: Clone + Send + Sync + 'static {
    /// The drive that is reached here.
    fn drive(&self) -> &Drive;

    /// Speaks with a client until it leaves, or its line is cut.
    fn converse<T>(&self, stream: T, peer: Peer) -> impl Future<Output = ()> + Send
    where
        T: AsyncRead + AsyncWrite + Unpin + Send;

    /// Waits until the drive wants to be reached anew, maybe elsewhere: all connections are closed then.
    fn moved(&self) -> impl Future<Output = SocketAddr> + Send {
        std::future::pending()
    }

    /// A client was turned away.
    fn turned_away(&self) {}
}

/// A socket that takes the connections of one drive.
pub(crate) struct Listener {
    socket: TcpListener,
    address: SocketAddr,
}

impl Listener {
    /// Listens at `address`; port 0 takes a free one.
    pub(crate) async fn bind(address: SocketAddr) -> io::Result<Listener> {
        let socket = TcpListener::bind(address).await?;
        let address = socket.local_addr()?;
        Ok(Listener { socket, address })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves the drive's clients until it is dropped.
    pub(crate) async fn serve(mut self, host: impl Host) {
        let mut connections = Connections::new(host.clone());
        loop {
            tokio::select! {
                accepted = self.socket.accept() => match accepted {
                    Ok((stream, peer)) => {
                        // A client that was closed by the chip being set up may be back before this was.
                        let stayed = match already(host.moved()).await {
                            Some(address) => !self.set_up(address, &mut connections).await,
                            None => true,
                        };
                        if stayed {
                            connections.admit(stream, peer).await;
                        }
                    }
                    Err(error) => {
                        host.drive().tell(What::CannotAccept(error));
                        tokio::time::sleep(ACCEPT_REST).await;
                    }
                },
                _ = connections.line.changed() => connections.end_with_line().await,
                address = host.moved() => {
                    self.set_up(address, &mut connections).await;
                }
            }
        }
    }

    /// Sets the network chip up anew: all its sockets are closed. `true` when it listens at another address then. When that
    /// cannot be had, the old one stays: a drive that nobody can reach is worse.
    async fn set_up(&mut self, address: SocketAddr, connections: &mut Connections<impl Host>) -> bool {
        connections.close_all().await;
        if address.port() == self.address.port() || address.port() == 0 {
            return false;
        }
        let drive = connections.host.drive();
        match Listener::bind(address).await {
            Ok(listener) => {
                *self = listener;
                drive.tell(What::Moved(self.address));
                true
            }
            Err(error) => {
                drive.tell(What::CannotMove { to: address, error });
                false
            }
        }
    }
}

/// What a future gives without waiting.
async fn already<T>(future: impl Future<Output = T>) -> Option<T> {
    tokio::select! {
        biased;
        output = future => Some(output),
        () = std::future::ready(()) => None,
    }
}

/// The clients of one drive.
struct Connections<H> {
    host: H,
    tasks: JoinSet<()>,
    /// The places for them.
    sockets: Arc<Semaphore>,
    /// Whether there can be any.
    line: watch::Receiver<Reach>,
    /// The outages that they have seen.
    outages: u32,
}

impl<H: Host> Connections<H> {
    fn new(host: H) -> Connections<H> {
        let sockets = Arc::new(Semaphore::new(MAX_CONNECTIONS));
        let mut line = host.drive().watch();
        let outages = line.borrow_and_update().outages;
        Connections { host, tasks: JoinSet::new(), sockets, line, outages }
    }

    /// Serves a connection, or closes it when all sockets are taken.
    async fn admit(&mut self, stream: TcpStream, peer: SocketAddr) {
        let is_reachable = self.host.drive().is_reachable();
        // An outage ends those that came before it; this one may have come because it is over.
        self.end_with_line().await;
        while self.tasks.try_join_next().is_some() {}
        if !is_reachable {
            return;
        }
        if self.tasks.len() >= 2 * MAX_CONNECTIONS {
            turn_away(&self.host, peer);
            return;
        }
        let (host, sockets) = (self.host.clone(), Arc::clone(&self.sockets));
        // Taken here and not in the task, as tasks do not begin in the order in which clients come.
        let free = Arc::clone(&sockets).try_acquire_owned().ok();
        self.tasks.spawn(async move {
            let socket = match free {
                Some(socket) => Some(socket),
                None => timeout(LEAVING, sockets.acquire_owned()).await.ok().and_then(Result::ok),
            };
            let Some(_socket) = socket else {
                turn_away(&host, peer);
                return;
            };
            // Without these the connection still works, a little slower or a little longer.
            let _ = stream.set_nodelay(true);
            let _ = SockRef::from(&stream).set_tcp_keepalive(&TcpKeepalive::new().with_time(KEEPALIVE));
            host.converse(stream, Peer::Tcp(peer)).await;
        });
    }

    /// Closes all connections if the drive could not be reached meanwhile.
    async fn end_with_line(&mut self) {
        let outages = self.line.borrow_and_update().outages;
        if std::mem::replace(&mut self.outages, outages) != outages {
            self.close_all().await;
        }
    }

    /// Closes all connections.
    async fn close_all(&mut self) {
        self.tasks.shutdown().await;
    }
}

fn turn_away(host: &impl Host, peer: SocketAddr) {
    host.turned_away();
    host.drive().tell(What::Full(peer));
}
