//! Modbus TCP: a connection.

use crate::drive::Drive;
use crate::link::Outgoing;
use crate::smsd::SmsdStation;
use crate::talk::{Heard, ModbusTalk};
use crate::tcp::Host;
use crate::traffic::Peer;
use std::future::poll_fn;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::Poll;
use stepdrive_proto::modbus::{Split, split};
use stepdrive_spec::smsd::standard::Counter;
use stepdrive_spec::smsd::timing::{HALF_FRAME_TIMEOUT, UNREAD_REPLY_TIMEOUT};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::timeout;

/// What a request is answered with whose changes cannot be stored.
const REFUSAL: &str = "exception 04";

/// Bytes of requests held for a connection: some dozens of pipelined requests, or the longest frame many times over.
const INPUT: usize = 2048;

/// Bytes of replies collected before they are sent, so that pipelined requests are answered in few packets.
const OUTPUT: usize = 4096;

/// The LAN of an SMSD that speaks Modbus.
#[derive(Clone)]
pub(crate) struct Modbus(pub(crate) Arc<SmsdStation>);

impl Host for Modbus {
    fn drive(&self) -> &Drive {
        self.0.drive()
    }

    async fn converse<T: AsyncRead + AsyncWrite + Unpin + Send>(&self, stream: T, peer: Peer) {
        // However it ends, there is nobody left to tell.
        let _ = Connection::new(stream, peer, Arc::clone(&self.0)).serve().await;
    }

    async fn moved(&self) -> SocketAddr {
        self.0.moved().await
    }

    fn turned_away(&self) {
        self.0.drive().count(Counter::Socket);
    }
}

/// A client's connection.
struct Connection<T> {
    station: Arc<SmsdStation>,
    /// Its number in the rig.
    number: u64,
    stream: T,
    talk: ModbusTalk,
    input: Box<[u8; INPUT]>,
    /// How much of `input` is filled.
    filled: usize,
    /// The reply that is being made.
    reply: Outgoing,
    /// Replies to be sent.
    output: Outgoing,
}

impl<T> Drop for Connection<T> {
    fn drop(&mut self) {
        self.station.drive().shut(self.number);
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> Connection<T> {
    fn new(stream: T, peer: Peer, station: Arc<SmsdStation>) -> Connection<T> {
        let number = station.drive().open(None, peer);
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
            if duties.store && !self.station.store(Some(REFUSAL)).await {
                self.station.refuse(self.number, &mut self.talk, raw, &frame, &mut self.reply);
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
            let stream = &mut self.stream;
            let sent = poll_fn(|cx| Poll::Ready(Pin::new(&mut *stream).poll_write(cx, part.bytes))).await;
            let sent = match sent {
                Poll::Ready(sent) => sent?,
                Poll::Pending => 0,
            };
            if let Some(rest @ [_, ..]) = part.bytes.get(sent..) {
                timeout(UNREAD_REPLY_TIMEOUT, self.stream.write_all(rest)).await??;
            }
        }
        self.output.clear();
        Ok(())
    }
}
