//! The transports of an SMD3: a virtual COM port, and lines over TCP.

use crate::What;
use crate::pty::Pty;
use crate::smd3::Smd3Station;
use socket2::{SockRef, TcpKeepalive};
use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_proto::smd3::{LineBuf, LineReader};
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
struct Conversation {
    reader: LineReader,
    reply: LineBuf,
    output: Vec<u8>,
}

impl Conversation {
    fn new() -> Conversation {
        Conversation { reader: LineReader::new(), reply: LineBuf::new(), output: Vec::new() }
    }

    /// Answers every line that these bytes complete.
    async fn take(&mut self, mut bytes: &[u8], station: &Smd3Station) {
        while let Some(line) = self.reader.take(&mut bytes) {
            station.answer(line, &mut self.reply).await;
            self.output.extend_from_slice(&self.reply);
        }
    }
}

/// Answers a client's lines until it leaves. While it does not take its replies, no more of its lines are taken.
async fn converse<T: AsyncRead + AsyncWrite + Unpin>(
    port: &mut T,
    station: &Smd3Station,
    patience: Duration,
) -> io::Result<()> {
    let mut conversation = Conversation::new();
    let mut chunk = [0; CHUNK];
    loop {
        let count = port.read(&mut chunk).await?;
        if count == 0 {
            return Ok(());
        }
        conversation.take(chunk.get(..count).unwrap_or(&[]), station).await;
        if !conversation.output.is_empty() {
            timeout(patience, port.write_all(&conversation.output)).await??;
            conversation.output.clear();
        }
    }
}

/// Serves a virtual COM port for as long as the drive is served.
pub(crate) async fn serve_pty(mut port: Pty, station: Arc<Smd3Station>) {
    let Err(error) = serve_clients_of(&mut port, &station).await;
    station.tell(What::SerialFailed(error));
}

/// One after the other: the last command of a client is carried out even when it has closed the port by then, and the
/// next client reads nothing that was meant for it.
async fn serve_clients_of(port: &mut Pty, station: &Smd3Station) -> Result<Infallible, io::Error> {
    loop {
        port.opened().await?;
        // A port is patient: what its client does not read waits until it closes.
        converse(port, station, Duration::MAX).await?;
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
        loop {
            match self.socket.accept().await {
                Ok((stream, peer)) => admit(stream, peer, &mut clients, &station),
                Err(error) => {
                    station.tell(What::CannotAccept(error));
                    tokio::time::sleep(ACCEPT_REST).await;
                }
            }
        }
    }
}

fn admit(mut stream: TcpStream, peer: SocketAddr, clients: &mut JoinSet<()>, station: &Arc<Smd3Station>) {
    while clients.try_join_next().is_some() {}
    if clients.len() >= MAX_CLIENTS {
        station.tell(What::Full(peer));
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
