//! The standard protocol of an SMSD: over USB, which is a virtual COM port or stands for one over TCP, and over the LAN of
//! the standard firmware.

use crate::drive::Drive;
use crate::link::Outgoing;
use crate::port::{Conversation, Next, Party, converse};
use crate::recording::Via;
use crate::smsd::SmsdStation;
use crate::talk::{Heard, PacketTalk};
use crate::tcp::Host;
use crate::traffic::Peer;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_proto::smsd::{ESCAPE, Framing, PacketReader, START};
use stepdrive_spec::smsd::standard::Counter;
use stepdrive_spec::smsd::timing::UNREAD_REPLY_TIMEOUT;
use stepdrive_spec::time::Instant;
use tokio::io::{AsyncRead, AsyncWrite};

/// What a packet is answered with whose changes cannot be stored.
const REFUSAL: &str = "ERROR_WRITE";

/// The USB of an SMSD.
#[derive(Clone)]
pub(crate) struct Usb(pub(crate) Arc<SmsdStation>);

/// The LAN of an SMSD with the standard firmware.
#[derive(Clone)]
pub(crate) struct Standard(pub(crate) Arc<SmsdStation>);

impl Party for Usb {
    type Conversation = PacketConversation;

    fn drive(&self) -> &Drive {
        self.0.drive()
    }

    fn meet(&self, peer: Peer) -> PacketConversation {
        PacketConversation::new(Arc::clone(&self.0), Via::Usb, peer)
    }
}

impl Host for Usb {
    fn drive(&self) -> &Drive {
        self.0.drive()
    }

    async fn converse<T: AsyncRead + AsyncWrite + Unpin + Send>(&self, mut stream: T, peer: Peer) {
        // However it ends, there is nobody left to tell.
        let _ = converse(&mut stream, self.meet(peer), UNREAD_REPLY_TIMEOUT).await;
    }
}

impl Host for Standard {
    fn drive(&self) -> &Drive {
        self.0.drive()
    }

    async fn converse<T: AsyncRead + AsyncWrite + Unpin + Send>(&self, mut stream: T, peer: Peer) {
        let conversation = PacketConversation::new(Arc::clone(&self.0), Via::Standard, peer);
        let _ = converse(&mut stream, conversation, UNREAD_REPLY_TIMEOUT).await;
    }

    async fn moved(&self) -> SocketAddr {
        self.0.moved().await
    }

    fn turned_away(&self) {
        self.0.drive().count(Counter::Socket);
    }
}

/// One conversation, and the start of a packet that is not whole yet.
pub(crate) struct PacketConversation {
    station: Arc<SmsdStation>,
    /// The number of its connection in the rig.
    number: u64,
    via: Via,
    reader: PacketReader,
    talk: PacketTalk,
    /// How long was waited for bytes so far, which is the time of `reader`. What a drive takes to answer is not its client's
    /// silence.
    waited: Duration,
    /// What is not a whole packet yet, if it is wanted.
    begun: Option<Begun>,
    /// The reply that is being made.
    reply: Outgoing,
}

impl Drop for PacketConversation {
    fn drop(&mut self) {
        self.station.drive().shut(self.number);
    }
}

impl PacketConversation {
    fn new(station: Arc<SmsdStation>, via: Via, peer: Peer) -> PacketConversation {
        let world = station.drive().world();
        let number = station.drive().open(Some(via), peer);
        PacketConversation {
            number,
            via,
            reader: PacketReader::new(via.framing()),
            talk: PacketTalk::new(via, world.rig().seed, number),
            waited: Duration::ZERO,
            begun: None,
            reply: Outgoing::default(),
            station,
        }
    }
}

impl Conversation for PacketConversation {
    fn greet(&mut self, output: &mut Outgoing) {
        // Over USB it waits to be asked.
        if self.via == Via::Standard {
            self.station.greet(self.number, &mut self.talk, &mut self.reply);
            output.append(&mut self.reply);
        }
    }

    async fn take(&mut self, bytes: &mut &[u8], output: &mut Outgoing) -> Next {
        if self.reader.is_empty() {
            let wanted = self.station.drive().world().keeps_bytes();
            self.begun = wanted.then(|| self.begun.take().unwrap_or_default());
        }
        loop {
            let before = *bytes;
            let packet = self.reader.take(time(self.waited), bytes);
            let taken = before.get(..before.len() - bytes.len()).unwrap_or(&[]);
            if let Some(begun) = &mut self.begun {
                begun.add(self.via.framing(), taken);
            }
            let Some(packet) = packet else {
                let is_empty = self.reader.is_empty();
                self.begun.iter_mut().for_each(|begun| begun.keep(is_empty));
                return Next::Listen;
            };
            let raw = self.begun.as_ref().map_or(&[][..], |begun| &begun.0);
            let (heard, duties) =
                self.station.hear_packet(self.number, &mut self.talk, raw, &packet, &mut self.reply);
            self.begun.iter_mut().for_each(|begun| begun.0.clear());
            if heard == Heard::Cut {
                return Next::End;
            }
            if duties.store && !self.station.store(Some(REFUSAL)).await {
                self.station.refuse_packet(self.number, &mut self.talk, &mut self.reply);
            }
            output.append(&mut self.reply);
            if duties.reconfigure {
                return Next::Apply;
            }
        }
    }

    fn apply(&mut self) -> bool {
        self.station.reconfigure();
        self.via == Via::Usb
    }

    fn patience(&self) -> Option<Duration> {
        let deadline = Duration::from_nanos(self.reader.deadline()?.as_nanos());
        Some(deadline.saturating_sub(self.waited))
    }

    fn waited(&mut self, time_passed: Duration) {
        self.waited += time_passed;
        let dropped = self.reader.expire(time(self.waited));
        if self.reader.is_empty() {
            self.begun.iter_mut().for_each(|begun| begun.0.clear());
        }
        if dropped {
            self.station.drive().count(Counter::TimeOut);
        }
    }
}

fn time(waited: Duration) -> Instant {
    Instant::from_nanos(u64::try_from(waited.as_nanos()).unwrap_or(u64::MAX))
}

/// The bytes of a packet as they came, for the recording.
#[derive(Default)]
struct Begun(Vec<u8>);

impl Begun {
    /// The most bytes that are kept of what does not end: more than any packet has, so that those are too many as well.
    const MOST: usize = 4096;

    /// Adds bytes. Before the last start byte nothing belongs to the packet.
    fn add(&mut self, framing: Framing, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
        if framing == Framing::Stuffed
            && let Some(start) = self.0.iter().rposition(|byte| *byte == START)
        {
            self.0.drain(..start);
        }
    }

    /// Keeps what may still become a packet: nothing when the reader is outside of any.
    fn keep(&mut self, is_outside: bool) {
        self.0.truncate(if is_outside { 0 } else { Begun::MOST });
        // Not to make an escape of what comes next.
        if self.0.len() == Begun::MOST && self.0.last() == Some(&ESCAPE) {
            self.0.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is recorded of a stream that comes in these chunks.
    fn recorded(framing: Framing, chunks: &[&[u8]]) -> Vec<Vec<u8>> {
        let (mut reader, mut begun, mut packets) = (PacketReader::new(framing), Begun::default(), Vec::new());
        for chunk in chunks {
            let mut rest = *chunk;
            loop {
                let before = rest;
                let is_packet = reader.take(Instant::ZERO, &mut rest).is_some();
                begun.add(framing, &before[..before.len() - rest.len()]);
                if !is_packet {
                    begun.keep(reader.is_empty());
                    break;
                }
                packets.push(std::mem::take(&mut begun.0));
            }
        }
        packets
    }

    #[test]
    fn a_packet_is_recorded_from_its_start_to_its_stop_however_it_comes() {
        let noise = [7; 1000];
        let stream =
            [&noise[..], b"\xFB\xFA\x01\x02\xFA\xF1\x02\x0E\xFE\x7E\0\0\xFB", &noise[..], b"\xFA\xFB"]
                .concat();
        let expected = [&b"\xFA\xF1\x02\x0E\xFE\x7E\0\0\xFB"[..], b"\xFA\xFB"];
        assert_eq!(recorded(Framing::Stuffed, &[&stream]), expected);
        for size in 1..20 {
            let chunks: Vec<&[u8]> = stream.chunks(size).collect();
            assert_eq!(recorded(Framing::Stuffed, &chunks), expected, "{size}");
        }
    }

    #[test]
    fn what_never_ends_is_not_kept_and_is_too_long_all_the_same() {
        let stream = [&b"\xFA"[..], &b"\xFE\x7A".repeat(50_000), b"\xFB"].concat();
        for size in [1, 3, 512] {
            let chunks: Vec<&[u8]> = stream.chunks(size).collect();
            let packets = recorded(Framing::Stuffed, &chunks);
            assert_eq!(packets.len(), 1);
            assert!(packets[0].len() <= Begun::MOST + size, "{}", packets[0].len());
            let read = |mut bytes: &[u8]| {
                let mut reader = PacketReader::new(Framing::Stuffed);
                let taken = reader.take(Instant::ZERO, &mut bytes).expect("an end");
                (taken.id, taken.packet.expect_err("too long"))
            };
            assert_eq!(read(&packets[0]), read(&stream));
        }
    }

    #[test]
    fn bytes_that_are_skipped_after_an_impossible_length_are_not_kept() {
        let header = b"\0\x02\x00\x07\xFF\xFF";
        let stream = [&header[..], &[1; 5000], header].concat();
        let chunks: Vec<&[u8]> = stream.chunks(512).collect();
        assert_eq!(recorded(Framing::Raw, &chunks), [header]);
    }
}
