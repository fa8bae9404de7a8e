//! The controller's end of the link: requests in, replies out, and what may go wrong with each of them.

use super::station::{Protocol, Station};
use std::sync::Arc;
use std::time::Duration;
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::standard::Code;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
use tokio::time::sleep;

/// What becomes of one request and its reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// All is well.
    None,
    /// The request does not arrive.
    LoseRequest,
    /// Only so many bytes of the request arrive.
    CutRequest(usize),
    /// A byte of the request arrives as another.
    DamageRequest(usize, u8),
    /// The reply does not arrive.
    LoseReply,
    /// Only so many bytes of the reply arrive.
    CutReply(usize),
    /// A byte of the reply arrives as another.
    DamageReply(usize, u8),
    /// The reply is late, and so is all behind it.
    Delay(Duration),
    /// The reply comes together with the next one, ahead of it.
    Postpone,
    /// The reply comes twice.
    Twice,
    /// The reply comes first under the number before.
    StaleFirst,
    /// The reply bears another number.
    WrongNumber,
    /// These bytes come instead of the reply.
    Garbage(Vec<u8>),
    /// These bytes come ahead of the reply.
    NoiseFirst(Vec<u8>),
    /// Part of the reply comes, and then the connection is closed.
    Break(usize),
    /// The reply comes in two parts.
    Halves(usize, Duration),
    /// The connection is closed before the request arrives.
    Close,

    // ---- Modbus
    /// The reply bears another unit.
    WrongUnit,
    /// A frame of another protocol comes first.
    ForeignFirst,
    /// The reply gives its register at this place another value.
    Register(usize, u16),
    /// The request is answered with this exception, and not looked at.
    Except(Exception),

    // ---- the standard protocol
    /// The reply comes as the other of the types with a status.
    OtherType,
    /// The request is answered with this code, and not looked at.
    Refuse(Code),
    /// The reply has another value: an answer its data, LAN parameters their DHCP.
    Value(u32),
}

/// Serves a connection until it ends.
pub(crate) async fn serve<P: Protocol>(station: Arc<Station<P>>, stream: DuplexStream) {
    let mut line = station.line();
    let _open = Arc::clone(&station).count(|world| &mut world.open);
    let session = station.protocol.session();
    let talk = Talk { station, stream, session, input: Vec::new(), postponed: Vec::new() };
    tokio::select! {
        biased;
        _ = line.changed() => {}
        _ = talk.run() => {}
    }
}

struct Talk<P: Protocol> {
    station: Arc<Station<P>>,
    stream: DuplexStream,
    session: P::Session,
    input: Vec<u8>,
    postponed: Vec<u8>,
}

impl<P: Protocol> Talk<P> {
    /// Ends when the connection does, in any way.
    async fn run(mut self) -> Option<()> {
        let greeting = self.station.protocol.greeting();
        self.send(&greeting).await?;
        loop {
            let mut request = self.request().await?;
            let fault = self.station.next_fault();
            if fault == Fault::LoseRequest {
                continue;
            }
            if fault == Fault::Close {
                return None;
            }
            if let Fault::CutRequest(keep) = fault {
                request.truncate(keep);
            }
            if let Fault::DamageRequest(place, mask) = fault {
                damage(&mut request, place, mask);
            }
            let replies = self.station.answers(&mut self.session, &request, &fault);
            let mut bytes = std::mem::take(&mut self.postponed);
            for reply in replies {
                self.reply(&fault, &reply, &mut bytes).await?;
            }
            self.send(&bytes).await?;
            if self.station.has_moved() {
                return None;
            }
        }
    }

    /// Sends something, as soon as the client has read enough of what came before.
    async fn send(&mut self, bytes: &[u8]) -> Option<()> {
        let _sending = Arc::clone(&self.station).count(|world| &mut world.sending);
        self.stream.write_all(bytes).await.ok()
    }

    /// The bytes of the next request as they were sent.
    async fn request(&mut self) -> Option<Vec<u8>> {
        loop {
            if let Some(size) = self.station.protocol.size(&self.input) {
                return Some(self.input.drain(..size).collect());
            }
            match self.stream.read_buf(&mut self.input).await {
                Ok(1..) => {}
                Ok(0) | Err(_) => return None,
            }
        }
    }

    /// What is to be sent for a reply; `None` when the connection ends with it.
    async fn reply(&mut self, fault: &Fault, reply: &P::Reply, bytes: &mut Vec<u8>) -> Option<()> {
        let protocol = &self.station.protocol;
        let mut good = protocol.wire(reply);
        match fault {
            Fault::None
            | Fault::LoseRequest
            | Fault::CutRequest(_)
            | Fault::DamageRequest(..)
            | Fault::Close
            | Fault::Except(_)
            | Fault::Refuse(_) => bytes.extend(good),
            Fault::LoseReply => {}
            Fault::CutReply(keep) => bytes.extend(good.iter().take(*keep)),
            Fault::DamageReply(place, mask) => {
                damage(&mut good, *place, *mask);
                bytes.extend(good);
            }
            Fault::Delay(time) => {
                sleep(*time).await;
                bytes.extend(good);
            }
            Fault::Postpone => self.postponed = good,
            Fault::Twice => bytes.extend(good.repeat(2)),
            Fault::StaleFirst => bytes.extend([protocol.renumbered(reply, -1), good].concat()),
            Fault::WrongNumber => bytes.extend(protocol.renumbered(reply, 64)),
            Fault::Garbage(garbage) => bytes.extend(garbage),
            Fault::NoiseFirst(noise) => bytes.extend([&noise[..], &good].concat()),
            Fault::Break(place) => {
                bytes.extend(good.iter().take(*place));
                self.send(bytes).await?;
                return None;
            }
            Fault::Halves(place, pause) => {
                let (first, second) = good.split_at((*place).min(good.len()));
                bytes.extend_from_slice(first);
                self.send(bytes).await?;
                sleep(*pause).await;
                *bytes = second.to_vec();
            }
            Fault::ForeignFirst => bytes.extend([protocol.spoilt(reply, fault), good].concat()),
            Fault::WrongUnit | Fault::Register(..) | Fault::OtherType | Fault::Value(_) => {
                bytes.extend(protocol.spoilt(reply, fault));
            }
        }
        Some(())
    }
}

fn damage(bytes: &mut [u8], place: usize, mask: u8) {
    let place = place % bytes.len().max(1);
    if let Some(byte) = bytes.get_mut(place) {
        *byte ^= mask.max(1);
    }
}
