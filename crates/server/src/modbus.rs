//! Modbus TCP: a listener for each drive, a task for each connection.

use crate::What;
use crate::link::Outgoing;
use crate::smsd::SmsdStation;
use crate::talk::{Heard, ModbusTalk};
use socket2::{SockRef, TcpKeepalive};
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_proto::modbus::{Split, split};
use stepdrive_spec::smsd::timing::{HALF_FRAME_TIMEOUT, MAX_CONNECTIONS, UNREAD_REPLY_TIMEOUT};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio::time::timeout;

/// How long a peer that has vanished may keep its socket before the kernel starts asking for it.
const KEEPALIVE: Duration = Duration::from_mins(1);

/// How long accepting rests after it has failed, as when the process has no file descriptors left.
const ACCEPT_REST: Duration = Duration::from_millis(100);

/// How long a connection waits for a socket when all are taken. A client that leaves and comes back at once, or whose
/// place another one takes, is seen to come before it is seen to leave.
const LEAVING: Duration = Duration::from_millis(100);

/// Bytes of requests held for a connection: some dozens of pipelined requests, or the longest frame many times over.
const INPUT: usize = 2048;

/// Bytes of replies collected before they are sent, so that pipelined requests are answered in few packets.
const OUTPUT: usize = 4096;

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
    pub(crate) async fn serve(mut self, station: Arc<SmsdStation>) {
        let mut connections = Connections::new(Arc::clone(&station));
        let mut line = station.drive().watch();
        let mut outages = line.borrow_and_update().outages;
        loop {
            tokio::select! {
                accepted = self.socket.accept() => match accepted {
                    Ok((stream, peer)) => connections.admit(stream, peer),
                    Err(error) => {
                        station.drive().tell(What::CannotAccept(error));
                        tokio::time::sleep(ACCEPT_REST).await;
                    }
                },
                _ = line.changed() => if outages != line.borrow_and_update().outages {
                    outages = line.borrow().outages;
                    connections.close_all().await;
                },
                () = station.reconfigured() => {
                    // The network chip is set up anew: all its sockets are closed.
                    connections.close_all().await;
                    self.move_to(station.address(), &station).await;
                }
            }
        }
    }

    /// Listens at another address. When that cannot be had, the old one stays: a drive that nobody can reach is worse.
    async fn move_to(&mut self, address: SocketAddr, station: &SmsdStation) {
        if address.port() == self.address.port() || address.port() == 0 {
            return;
        }
        match Listener::bind(address).await {
            Ok(listener) => {
                *self = listener;
                station.drive().tell(What::Moved(self.address));
            }
            Err(error) => station.drive().tell(What::CannotMove { to: address, error }),
        }
    }
}

/// The clients of one drive.
struct Connections {
    station: Arc<SmsdStation>,
    tasks: JoinSet<()>,
    /// The sockets of the network chip.
    sockets: Arc<Semaphore>,
}

impl Connections {
    fn new(station: Arc<SmsdStation>) -> Connections {
        let sockets = Arc::new(Semaphore::new(MAX_CONNECTIONS));
        Connections { station, tasks: JoinSet::new(), sockets }
    }

    /// Serves a connection, or closes it when all sockets are taken.
    fn admit(&mut self, stream: TcpStream, peer: SocketAddr) {
        while self.tasks.try_join_next().is_some() {}
        if !self.station.drive().is_reachable() {
            return;
        }
        if self.tasks.len() >= 2 * MAX_CONNECTIONS {
            self.station.drive().tell(What::Full(peer));
            return;
        }
        let (station, sockets) = (Arc::clone(&self.station), Arc::clone(&self.sockets));
        self.tasks.spawn(async move {
            let Ok(Ok(_socket)) = timeout(LEAVING, sockets.acquire()).await else {
                station.drive().tell(What::Full(peer));
                return;
            };
            // Without these the connection still works, a little slower or a little longer.
            let _ = stream.set_nodelay(true);
            let _ = SockRef::from(&stream).set_tcp_keepalive(&TcpKeepalive::new().with_time(KEEPALIVE));
            let connection = Connection::new(stream, Arc::clone(&station));
            // However it ends, there is nobody left to tell.
            let _ = connection.serve().await;
        });
    }

    /// Closes all connections.
    async fn close_all(&mut self) {
        self.tasks.shutdown().await;
    }
}

/// A client's connection.
struct Connection {
    station: Arc<SmsdStation>,
    /// Its number in the rig.
    number: u64,
    stream: TcpStream,
    talk: ModbusTalk,
    input: Box<[u8; INPUT]>,
    /// How much of `input` is filled.
    filled: usize,
    /// The reply that is being made.
    reply: Outgoing,
    /// Replies to be sent.
    output: Outgoing,
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.station.drive().shut(self.number);
    }
}

impl Connection {
    fn new(stream: TcpStream, station: Arc<SmsdStation>) -> Connection {
        let number = station.drive().open();
        let seed = station.drive().world().rig().seed;
        Connection {
            station,
            number,
            stream,
            talk: ModbusTalk::new(seed, number),
            input: Box::new([0; INPUT]),
            filled: 0,
            reply: Outgoing::default(),
            output: Outgoing::default(),
        }
    }

    /// Answers requests until the client leaves, falls silent in the middle of one, stops taking replies, or sends what
    /// cannot be Modbus.
    async fn serve(mut self) -> io::Result<()> {
        loop {
            self.receive().await?;
            let intact = self.answer().await?;
            self.send().await?;
            if !intact {
                return Ok(());
            }
        }
    }

    /// Waits for more bytes.
    async fn receive(&mut self) -> io::Result<()> {
        let room = self.input.get_mut(self.filled..).unwrap_or(&mut []);
        let read = self.stream.read(room);
        let count = if self.filled == 0 { read.await? } else { timeout(HALF_FRAME_TIMEOUT, read).await?? };
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        self.filled += count;
        Ok(())
    }

    /// Answers every whole frame in the input and keeps the rest. `false` when the connection is over: its stream cannot
    /// be followed any more, its line is cut, or the network chip is set up anew.
    async fn answer(&mut self) -> io::Result<bool> {
        let mut taken = 0;
        let intact = loop {
            let bytes = self.input.get(taken..self.filled).unwrap_or(&[]);
            let (frame, size) = match split(bytes) {
                Split::Incomplete { .. } => break true,
                Split::Broken { .. } => break false,
                Split::Foreign { size, .. } => {
                    taken += size;
                    continue;
                }
                Split::Frame { frame, size } => (frame, size),
            };
            taken += size;
            let raw = bytes.get(..size).unwrap_or(&[]);
            let (heard, duties) =
                self.station.hear(self.number, &mut self.talk, raw, &frame, &mut self.reply);
            if heard == Heard::Cut {
                break false;
            }
            if duties.store && self.station.store().await.is_err() {
                self.station.refuse(self.number, &mut self.talk, &frame, &mut self.reply);
            }
            self.output.append(&mut self.reply);
            if duties.reconfigure {
                self.send().await?;
                self.station.reconfigure();
                break false;
            } else if self.output.len() >= OUTPUT {
                self.send().await?;
            }
        };
        self.input.copy_within(taken..self.filled, 0);
        self.filled -= taken;
        Ok(intact)
    }

    /// Sends the collected replies.
    async fn send(&mut self) -> io::Result<()> {
        for part in self.output.parts() {
            if !part.pause.is_zero() {
                tokio::time::sleep(part.pause).await;
            }
            // Most replies fit into the socket's buffer, so that no timer is needed.
            let sent = match self.stream.try_write(part.bytes) {
                Ok(sent) => sent,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => 0,
                Err(error) => return Err(error),
            };
            if let Some(rest @ [_, ..]) = part.bytes.get(sent..) {
                timeout(UNREAD_REPLY_TIMEOUT, self.stream.write_all(rest)).await??;
            }
        }
        self.output.clear();
        Ok(())
    }
}
