//! The transports of an SMD3: a virtual COM port, and lines over TCP.

use crate::What;
use crate::link::Outgoing;
use crate::pty::Pty;
use crate::smd3::Smd3Station;
use crate::talk::{Heard, LineTalk};
use socket2::{SockRef, TcpKeepalive};
use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_proto::smd3::LineReader;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio::time::timeout;

/// Clients served over TCP at a time. A COM port has one; several are allowed here, and their lines are taken in turn.
const MAX_CLIENTS: usize = 8;

/// A client over TCP that does not take its replies is disconnected after this time.
const UNREAD_REPLY_TIMEOUT: Duration = Duration::from_secs(10);

/// How long a peer that has vanished may keep its place before the kernel starts asking for it.
const KEEPALIVE: Duration = Duration::from_mins(1);

/// How long accepting rests after it has failed, as when the process has no file descriptors left.
const ACCEPT_REST: Duration = Duration::from_millis(100);

/// Bytes read at a time; it bounds how many replies are collected before they are sent.
const CHUNK: usize = 512;

/// One conversation: the start of a line that is not whole yet, and replies that are not sent yet.
struct Conversation<'a> {
    station: &'a Smd3Station,
    /// The number of its connection in the rig.
    number: u64,
    reader: LineReader,
    talk: LineTalk,
    /// The bytes of a line that is not whole yet, if they are recorded.
    begun: Option<Vec<u8>>,
    /// The reply that is being made.
    reply: Outgoing,
    output: Outgoing,
}

impl Drop for Conversation<'_> {
    fn drop(&mut self) {
        self.station.drive().shut(self.number);
    }
}

impl Conversation<'_> {
    fn new(station: &Smd3Station) -> Conversation<'_> {
        let world = station.drive().world();
        let number = station.drive().open();
        Conversation {
            station,
            number,
            reader: LineReader::new(),
            talk: LineTalk::new(world.rig().seed, number),
            begun: world.recorder().map(|_| Vec::new()),
            reply: Outgoing::default(),
            output: Outgoing::default(),
        }
    }

    /// Answers every line that these bytes complete. `false` when the line is cut.
    async fn take(&mut self, mut bytes: &[u8]) -> bool {
        loop {
            let before = bytes;
            let line = self.reader.take(&mut bytes);
            let taken = before.get(..before.len() - bytes.len()).unwrap_or(&[]);
            let raw = match &mut self.begun {
                None => taken,
                Some(begun) => {
                    begun.extend_from_slice(taken);
                    begun
                }
            };
            let Some(line) = line else { return true };
            let heard = self.station.hear(self.number, &mut self.talk, raw, line, &mut self.reply).await;
            if heard == Heard::Cut {
                return false;
            }
            self.output.append(&mut self.reply);
            if let Some(begun) = &mut self.begun {
                begun.clear();
            }
        }
    }

    /// Sends the collected replies.
    async fn send<T: AsyncWrite + Unpin>(&mut self, port: &mut T, patience: Duration) -> io::Result<()> {
        for part in self.output.parts() {
            if !part.pause.is_zero() {
                tokio::time::sleep(part.pause).await;
            }
            timeout(patience, port.write_all(part.bytes)).await??;
        }
        self.output.clear();
        Ok(())
    }
}

/// How a conversation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    /// The client has left.
    Left,
    /// The line is cut.
    Cut,
}

/// Answers a client's lines until it leaves or its line is cut. While it does not take its replies, no more of its lines
/// are taken.
async fn converse<T: AsyncRead + AsyncWrite + Unpin>(
    port: &mut T,
    station: &Smd3Station,
    patience: Duration,
) -> io::Result<Ended> {
    let mut conversation = Conversation::new(station);
    let mut chunk = [0; CHUNK];
    loop {
        let count = port.read(&mut chunk).await?;
        if count == 0 {
            return Ok(Ended::Left);
        }
        let intact = conversation.take(chunk.get(..count).unwrap_or(&[])).await;
        conversation.send(port, patience).await?;
        if !intact {
            return Ok(Ended::Cut);
        }
    }
}

/// Serves a virtual COM port for as long as the drive is served.
pub(crate) async fn serve_pty(mut port: Pty, station: Arc<Smd3Station>) {
    let Err(error) = serve_clients_of(&mut port, &station).await;
    station.drive().tell(What::SerialFailed(error));
}

/// One after the other: the last command of a client is carried out even when it has closed the port by then, and the
/// next client reads nothing that was meant for it.
async fn serve_clients_of(port: &mut Pty, station: &Smd3Station) -> Result<Infallible, io::Error> {
    loop {
        port.opened().await?;
        // A port is patient: what its client does not read waits until it closes. While the line is cut the client still
        // has the port open, and is heard again once that is mended.
        while converse(port, station, Duration::MAX).await? == Ended::Cut {}
        port.reset()?;
    }
}

/// A socket that takes lines for one drive.
pub(crate) struct LineListener {
    socket: TcpListener,
    address: SocketAddr,
}

impl LineListener {
    /// Listens at `address`; port 0 takes a free one.
    pub(crate) async fn bind(address: SocketAddr) -> io::Result<LineListener> {
        let socket = TcpListener::bind(address).await?;
        let address = socket.local_addr()?;
        Ok(LineListener { socket, address })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves the drive's clients for as long as the drive is served.
    pub(crate) async fn serve(self, station: Arc<Smd3Station>) {
        let mut clients = JoinSet::new();
        let mut line = station.drive().watch();
        let mut outages = line.borrow_and_update().outages;
        loop {
            tokio::select! {
                accepted = self.socket.accept() => match accepted {
                    Ok((stream, peer)) => admit(stream, peer, &mut clients, &station),
                    Err(error) => {
                        station.drive().tell(What::CannotAccept(error));
                        tokio::time::sleep(ACCEPT_REST).await;
                    }
                },
                _ = line.changed() => if outages != line.borrow_and_update().outages {
                    outages = line.borrow().outages;
                    clients.shutdown().await;
                },
            }
        }
    }
}

fn admit(mut stream: TcpStream, peer: SocketAddr, clients: &mut JoinSet<()>, station: &Arc<Smd3Station>) {
    while clients.try_join_next().is_some() {}
    if !station.drive().is_reachable() {
        return;
    }
    if clients.len() >= MAX_CLIENTS {
        station.drive().tell(What::Full(peer));
        return;
    }
    let station = Arc::clone(station);
    clients.spawn(async move {
        // Without these the connection still works, a little slower or a little longer.
        let _ = stream.set_nodelay(true);
        let _ = SockRef::from(&stream).set_tcp_keepalive(&TcpKeepalive::new().with_time(KEEPALIVE));
        // However it ends, there is nobody left to tell.
        let _ = converse(&mut stream, &station, UNREAD_REPLY_TIMEOUT).await;
    });
}
