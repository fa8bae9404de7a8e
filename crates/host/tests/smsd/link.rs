//! The controller's end of the link: requests in, replies out, and what may go wrong with each of them.

use crate::bench::Station;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_drive::smsd::Session;
use stepdrive_proto::modbus::{Adu, Refusal, Split, encode_refusal, split};
use stepdrive_spec::modbus::Exception;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
use tokio::time::sleep;

/// What becomes of one request and its reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// All is well.
    None,
    /// The request does not arrive.
    LoseRequest,
    /// The reply does not arrive.
    LoseReply,
    /// The reply is late, and so is all behind it.
    Delay(Duration),
    /// The reply comes together with the next one, ahead of it.
    Postpone,
    /// The reply comes twice.
    Twice,
    /// A reply to the request before comes first.
    StaleFirst,
    /// The reply bears another transaction.
    WrongTransaction,
    /// The reply bears another unit.
    WrongUnit,
    /// A frame of another protocol comes first.
    ForeignFirst,
    /// These bytes come instead of the reply.
    Garbage(Vec<u8>),
    /// Part of the reply comes, and then the connection is closed.
    Cut(usize),
    /// The reply comes in two parts.
    Halves(usize, Duration),
    /// The connection is closed before the request arrives.
    Close,
    /// The reply gives its register at this place another value.
    Register(usize, u16),
    /// The request is answered with this exception, and not looked at.
    Except(Exception),
}

/// Serves a connection until it ends.
pub(crate) async fn serve(station: Arc<Station>, stream: DuplexStream) {
    let mut line = station.line();
    let _open = Arc::clone(&station).opened();
    let talk = Talk { station, stream, session: Session::new(), input: Vec::new(), postponed: Vec::new() };
    tokio::select! {
        biased;
        _ = line.changed() => {}
        _ = talk.run() => {}
    }
}

struct Talk {
    station: Arc<Station>,
    stream: DuplexStream,
    session: Session,
    input: Vec<u8>,
    postponed: Vec<u8>,
}

impl Talk {
    /// Ends when the connection does, in any way.
    async fn run(mut self) -> Option<()> {
        loop {
            let frame = self.frame().await?;
            let fault = self.station.next_fault();
            if fault == Fault::LoseRequest {
                continue;
            }
            if fault == Fault::Close {
                return None;
            }
            let answer = if let Fault::Except(exception) = fault {
                Some(refuse(&frame, exception))
            } else {
                self.station.answer(&mut self.session, &frame)
            };
            let Some(reply) = answer else { continue };
            let mut bytes = std::mem::take(&mut self.postponed);
            self.reply(fault, reply, &mut bytes).await?;
            self.stream.write_all(&bytes).await.ok()?;
            if self.station.has_been_reconfigured() {
                return None;
            }
        }
    }

    /// The next whole frame.
    async fn frame(&mut self) -> Option<Vec<u8>> {
        loop {
            match split(&self.input) {
                Split::Frame { size, .. } => return Some(self.input.drain(..size).collect()),
                Split::Foreign { size, .. } => drop(self.input.drain(..size)),
                Split::Incomplete { .. } => match self.stream.read_buf(&mut self.input).await {
                    Ok(1..) => {}
                    Ok(0) | Err(_) => return None,
                },
                Split::Broken { .. } => return None,
            }
        }
    }

    /// What is to be sent for a reply; `None` when the connection ends with it.
    async fn reply(&mut self, fault: Fault, reply: Vec<u8>, bytes: &mut Vec<u8>) -> Option<()> {
        match fault {
            Fault::None | Fault::Except(_) => bytes.extend(reply),
            Fault::LoseRequest | Fault::LoseReply | Fault::Close => {}
            Fault::Delay(time) => {
                sleep(time).await;
                bytes.extend(reply);
            }
            Fault::Postpone => self.postponed = reply,
            Fault::Twice => bytes.extend([&reply[..], &reply].concat()),
            Fault::StaleFirst => bytes.extend([with(&reply, 1, -1), reply].concat()),
            Fault::WrongTransaction => bytes.extend(with(&reply, 0, 64)),
            Fault::WrongUnit => bytes.extend(with(&reply, 6, 1)),
            Fault::ForeignFirst => bytes.extend([with(&reply, 3, 1), reply].concat()),
            Fault::Register(place, value) => bytes.extend(with_register(reply, place, value)),
            Fault::Garbage(garbage) => bytes.extend(garbage),
            Fault::Cut(place) => {
                bytes.extend_from_slice(&reply[..place.min(reply.len())]);
                self.stream.write_all(bytes).await.ok()?;
                return None;
            }
            Fault::Halves(place, pause) => {
                let (first, second) = reply.split_at(place.min(reply.len()));
                bytes.extend_from_slice(first);
                self.stream.write_all(bytes).await.ok()?;
                sleep(pause).await;
                *bytes = second.to_vec();
            }
        }
        Some(())
    }
}

/// A frame with one of its bytes changed.
fn with(frame: &[u8], place: usize, by: i8) -> Vec<u8> {
    let mut frame = frame.to_vec();
    frame[place] = frame[place].wrapping_add_signed(by);
    frame
}

fn refuse(frame: &[u8], exception: Exception) -> Vec<u8> {
    let Split::Frame { frame, .. } = split(frame) else { panic!("a whole frame") };
    let mut reply = Adu::new();
    let refusal = Refusal { function: frame.pdu[0], exception };
    encode_refusal(&mut reply, frame.transaction, frame.unit, refusal);
    reply.to_vec()
}

/// A reply that gives registers with another value of one.
fn with_register(mut reply: Vec<u8>, place: usize, value: u16) -> Vec<u8> {
    let at = 9 + 2 * place;
    reply[at..at + 2].copy_from_slice(&value.to_be_bytes());
    reply
}
