//! Conversations over streams of bytes: virtual COM ports, and the same over TCP.

use crate::What;
use crate::drive::Drive;
use crate::link::Outgoing;
use crate::pty::Pty;
use crate::traffic::Peer;
use std::convert::Infallible;
use std::io;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::{Instant, timeout};

/// Bytes read at a time; it bounds how many replies are collected before they are sent.
const CHUNK: usize = 512;

/// What is said between a client and a drive, from when the client comes to when it leaves.
pub(crate) trait Conversation: Send {
    /// Says into `output` what a drive says before it is asked.
    fn greet(&mut self, output: &mut Outgoing);

    /// Takes bytes off `bytes`, and answers into `output` what they complete.
    fn take(&mut self, bytes: &mut &[u8], output: &mut Outgoing) -> impl Future<Output = Next> + Send;

    /// Puts network parameters into effect, after [`Next::Apply`]. `false` when that ends this conversation.
    fn apply(&mut self) -> bool;

    /// How long the start of a request may still wait for the rest of it; `None` for as long as it likes.
    fn patience(&self) -> Option<Duration>;

    /// So long was waited until more bytes came, or none.
    fn waited(&mut self, time: Duration);
}

/// How a conversation goes on once its output is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    /// With more bytes; all are taken.
    Listen,
    /// By [`Conversation::apply`], then with the bytes that are left.
    Apply,
    /// Not: the line is cut.
    End,
}

/// Whom the clients of a port speak to.
pub(crate) trait Party: Send + Sync {
    /// What is spoken.
    type Conversation: Conversation;

    /// The drive.
    fn drive(&self) -> &Drive;

    /// Begins with a client that has just come.
    fn meet(&self, peer: Peer) -> Self::Conversation;
}

/// How a conversation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// The client has left.
    Left,
    /// The line is cut.
    Cut,
}

/// Answers a client until it leaves or its line is cut. While it does not take its replies, for `patience` at most, nothing
/// more of what it says is taken.
pub(crate) async fn converse<T: AsyncRead + AsyncWrite + Unpin>(
    port: &mut T,
    mut conversation: impl Conversation,
    patience: Duration,
) -> io::Result<Ended> {
    let mut output = Outgoing::default();
    conversation.greet(&mut output);
    send(port, &mut output, patience).await?;
    let mut chunk = [0; CHUNK];
    loop {
        let count = receive(port, &mut conversation, &mut chunk).await?;
        if count == 0 {
            return Ok(Ended::Left);
        }
        let mut bytes = chunk.get(..count).unwrap_or(&[]);
        loop {
            let next = conversation.take(&mut bytes, &mut output).await;
            send(port, &mut output, patience).await?;
            match next {
                Next::Listen => break,
                Next::Apply if conversation.apply() => {}
                Next::Apply | Next::End => return Ok(Ended::Cut),
            }
        }
    }
}

/// Waits for more bytes; none when the client has left.
async fn receive<T: AsyncRead + Unpin>(
    port: &mut T,
    conversation: &mut impl Conversation,
    chunk: &mut [u8],
) -> io::Result<usize> {
    while let Some(patience) = conversation.patience() {
        let begun = Instant::now();
        let read = timeout(patience, port.read(chunk)).await;
        conversation.waited(begun.elapsed());
        if let Ok(read) = read {
            return read;
        }
    }
    port.read(chunk).await
}

/// Sends the collected replies.
async fn send<T: AsyncWrite + Unpin>(
    port: &mut T,
    output: &mut Outgoing,
    patience: Duration,
) -> io::Result<()> {
    for part in output.parts() {
        if !part.pause.is_zero() {
            tokio::time::sleep(part.pause).await;
        }
        timeout(patience, port.write_all(part.bytes)).await??;
    }
    output.clear();
    Ok(())
}

/// Serves a virtual COM port for as long as the drive is served.
pub(crate) async fn serve_pty(mut port: Pty, party: impl Party) {
    let Err(error) = serve_clients_of(&mut port, &party).await;
    party.drive().tell(What::SerialFailed(error));
}

/// One after the other: the last command of a client is carried out even when it has closed the port by then, and the
/// next client reads nothing that was meant for it. Only when the next one has opened the port before the last bytes are read
/// does nothing tell whose they are, and they are taken for the new one's.
async fn serve_clients_of(port: &mut Pty, party: &impl Party) -> Result<Infallible, io::Error> {
    loop {
        port.opened().await?;
        // A port is patient: what its client does not read waits until it closes. While the line is cut the client still
        // has the port open, and is heard again once that is mended.
        while converse(port, party.meet(Peer::Pty), Duration::MAX).await? == Ended::Cut {}
        port.reset().await?;
    }
}
