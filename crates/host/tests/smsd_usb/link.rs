//! The controller's end of the link: packets in, packets out, and what may go wrong with each of them.

use crate::bench::Station;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_drive::smsd::StandardSession;
use stepdrive_host::smsd::Framing;
use stepdrive_proto::smsd::{PacketReader, STOP};
use stepdrive_spec::smsd::standard::{Answer, Code, LanParameters, Reply};
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
    /// The reply comes as the other of the types with a status.
    OtherType,
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
    /// The request is answered with this code, and not looked at.
    Refuse(Code),
    /// The reply has another value: an answer its data, LAN parameters their DHCP.
    Value(u32),
}

/// Serves a connection until it ends.
pub(crate) async fn serve(station: Arc<Station>, stream: DuplexStream) {
    let mut line = station.line();
    let _open = Arc::clone(&station).opened();
    let session = station.session();
    let reader = PacketReader::new(station.framing);
    let talk = Talk { station, stream, session, reader, input: Vec::new(), postponed: Vec::new() };
    tokio::select! {
        biased;
        _ = line.changed() => {}
        _ = talk.run() => {}
    }
}

struct Talk {
    station: Arc<Station>,
    stream: DuplexStream,
    session: StandardSession,
    reader: PacketReader,
    input: Vec<u8>,
    postponed: Vec<u8>,
}

impl Talk {
    /// Ends when the connection does, in any way.
    async fn run(mut self) -> Option<()> {
        let greeting = self.station.greeting();
        self.stream.write_all(&greeting).await.ok()?;
        loop {
            let mut packet = self.packet().await?;
            let fault = self.station.next_fault();
            if fault == Fault::LoseRequest {
                continue;
            }
            if fault == Fault::Close {
                return None;
            }
            if let Fault::CutRequest(keep) = fault {
                packet.truncate(keep);
            }
            if let Fault::DamageRequest(place, mask) = fault {
                damage(&mut packet, place, mask);
            }
            let replies = self.answers(&packet, &fault);
            let mut bytes = std::mem::take(&mut self.postponed);
            for (id, reply) in replies {
                self.reply(&fault, id, &reply, &mut bytes).await?;
            }
            self.stream.write_all(&bytes).await.ok()?;
            if self.station.has_moved() {
                return None;
            }
        }
    }

    /// The bytes of the next packet as they were sent.
    async fn packet(&mut self) -> Option<Vec<u8>> {
        loop {
            if let Some(size) = size(self.station.framing, &self.input) {
                return Some(self.input.drain(..size).collect());
            }
            match self.stream.read_buf(&mut self.input).await {
                Ok(1..) => {}
                Ok(0) | Err(_) => return None,
            }
        }
    }

    /// What the controller answers to these bytes.
    fn answers(&mut self, mut bytes: &[u8], fault: &Fault) -> Vec<(u8, Reply)> {
        let now = self.station.now();
        let mut replies = Vec::new();
        while let Some(taken) = self.reader.take(now, &mut bytes) {
            let reply = if let Fault::Refuse(code) = fault {
                Some(refusal(*code))
            } else {
                self.station.answer(&mut self.session, &taken)
            };
            replies.extend(reply.map(|reply| (taken.id, reply)));
        }
        replies
    }

    /// What is to be sent for a reply; `None` when the connection ends with it.
    async fn reply(&mut self, fault: &Fault, id: u8, reply: &Reply, bytes: &mut Vec<u8>) -> Option<()> {
        let good = self.station.encoded(id, reply);
        match fault {
            Fault::None
            | Fault::Refuse(_)
            | Fault::CutRequest(_)
            | Fault::DamageRequest(..)
            | Fault::LoseRequest
            | Fault::Close => bytes.extend(good),
            Fault::LoseReply => {}
            Fault::CutReply(keep) => bytes.extend(good.iter().take(*keep)),
            Fault::DamageReply(place, mask) => {
                let mut bad = good;
                damage(&mut bad, *place, *mask);
                bytes.extend(bad);
            }
            Fault::Delay(time) => {
                sleep(*time).await;
                bytes.extend(good);
            }
            Fault::Postpone => self.postponed = good,
            Fault::Twice => bytes.extend([&good[..], &good].concat()),
            Fault::StaleFirst => {
                bytes.extend(self.station.encoded(id.wrapping_sub(1), reply));
                bytes.extend(good);
            }
            Fault::WrongNumber => bytes.extend(self.station.encoded(id.wrapping_add(64), reply)),
            Fault::OtherType => bytes.extend(self.station.encoded(id, &other_type(reply))),
            Fault::Garbage(garbage) => bytes.extend(garbage),
            Fault::NoiseFirst(noise) => bytes.extend([&noise[..], &good].concat()),
            Fault::Value(value) => bytes.extend(self.station.encoded(id, &with_value(reply, *value))),
            Fault::Break(place) => {
                bytes.extend(good.iter().take(*place));
                self.stream.write_all(bytes).await.ok()?;
                return None;
            }
            Fault::Halves(place, pause) => {
                let (first, second) = good.split_at((*place).min(good.len()));
                bytes.extend_from_slice(first);
                self.stream.write_all(bytes).await.ok()?;
                sleep(*pause).await;
                *bytes = second.to_vec();
            }
        }
        Some(())
    }
}

/// How long the first packet is, if all of it is there.
fn size(framing: Framing, bytes: &[u8]) -> Option<usize> {
    let size = match framing {
        Framing::Stuffed => bytes.iter().position(|byte| *byte == STOP)? + 1,
        Framing::Raw => 6 + usize::from(u16::from_le_bytes([*bytes.get(4)?, *bytes.get(5)?])),
    };
    (bytes.len() >= size).then_some(size)
}

fn damage(packet: &mut [u8], place: usize, mask: u8) {
    let place = place % packet.len().max(1);
    if let Some(byte) = packet.get_mut(place) {
        *byte ^= mask.max(1);
    }
}

fn refusal(code: Code) -> Reply {
    let status = stepdrive_spec::smsd::status::Status::from_word(0x13);
    Reply::Response(Answer { status, code, data: 0 })
}

fn other_type(reply: &Reply) -> Reply {
    match reply {
        Reply::Response(answer) => Reply::Powerstep01(*answer),
        Reply::Powerstep01(answer) => Reply::Response(*answer),
        Reply::Memory { .. } | Reply::Lan(_) | Reply::Errors(_) | Reply::Versions(_) => reply.clone(),
    }
}

fn with_value(reply: &Reply, data: u32) -> Reply {
    match reply {
        Reply::Response(answer) => Reply::Response(Answer { data, ..*answer }),
        Reply::Powerstep01(answer) => Reply::Powerstep01(Answer { data, ..*answer }),
        Reply::Lan(lan) => Reply::Lan(LanParameters { dhcp: data.to_le_bytes()[0], ..*lan }),
        Reply::Memory { .. } | Reply::Errors(_) | Reply::Versions(_) => reply.clone(),
    }
}
