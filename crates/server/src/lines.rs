//! The lines of an SMD3, on a virtual COM port or over TCP.

use crate::drive::Drive;
use crate::link::Outgoing;
use crate::port::{Conversation, Next, Party, converse};
use crate::smd3::Smd3Station;
use crate::talk::{Heard, LineTalk};
use crate::tcp::Host;
use crate::traffic::Peer;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_proto::smd3::{LineReader, MAX_LINE};
use tokio::io::{AsyncRead, AsyncWrite};

/// A client over TCP that does not take its replies is disconnected after this time.
const UNREAD_REPLY_TIMEOUT: Duration = Duration::from_secs(10);

/// The most bytes that are kept of a line that does not end: more than any line has, so that those are too many as well.
const MOST_BEGUN: usize = 4 * MAX_LINE;

/// An SMD3, which takes lines.
#[derive(Clone)]
pub(crate) struct Lines(pub(crate) Arc<Smd3Station>);

impl Party for Lines {
    type Conversation = LineConversation;

    fn drive(&self) -> &Drive {
        self.0.drive()
    }

    fn meet(&self, peer: Peer) -> LineConversation {
        LineConversation::new(Arc::clone(&self.0), peer)
    }
}

impl Host for Lines {
    fn drive(&self) -> &Drive {
        self.0.drive()
    }

    async fn converse<T: AsyncRead + AsyncWrite + Unpin + Send>(&self, mut stream: T, peer: Peer) {
        // However it ends, there is nobody left to tell.
        let _ = converse(&mut stream, self.meet(peer), UNREAD_REPLY_TIMEOUT).await;
    }
}

/// One conversation, and the start of a line that is not whole yet.
pub(crate) struct LineConversation {
    station: Arc<Smd3Station>,
    /// The number of its connection in the rig.
    number: u64,
    reader: LineReader,
    talk: LineTalk,
    /// The bytes of a line that is not whole yet, if they are wanted.
    begun: Option<Vec<u8>>,
    /// The reply that is being made.
    reply: Outgoing,
}

impl Drop for LineConversation {
    fn drop(&mut self) {
        self.station.drive().shut(self.number);
    }
}

impl LineConversation {
    fn new(station: Arc<Smd3Station>, peer: Peer) -> LineConversation {
        let world = station.drive().world();
        let number = station.drive().open(None, peer);
        LineConversation {
            number,
            reader: LineReader::new(),
            talk: LineTalk::new(world.rig().seed, number),
            begun: None,
            reply: Outgoing::default(),
            station,
        }
    }
}

impl Conversation for LineConversation {
    fn greet(&mut self, _: &mut Outgoing) {}

    async fn take(&mut self, bytes: &mut &[u8], output: &mut Outgoing) -> Next {
        if self.reader.held() == 0 {
            let wanted = self.station.drive().world().keeps_bytes();
            self.begun = wanted.then(|| self.begun.take().unwrap_or_default());
        }
        loop {
            let before = *bytes;
            let line = self.reader.take(bytes);
            let taken = before.get(..before.len() - bytes.len()).unwrap_or(&[]);
            let raw = match &mut self.begun {
                None => taken,
                Some(begun) => {
                    begun.extend_from_slice(taken);
                    begun
                }
            };
            let Some(line) = line else {
                self.begun.iter_mut().for_each(|begun| begun.truncate(MOST_BEGUN));
                return Next::Listen;
            };
            let heard = self.station.hear(self.number, &mut self.talk, raw, line, &mut self.reply).await;
            if heard == Heard::Cut {
                return Next::End;
            }
            output.append(&mut self.reply);
            if let Some(begun) = &mut self.begun {
                begun.clear();
            }
        }
    }

    fn apply(&mut self) -> bool {
        true
    }

    fn patience(&self) -> Option<Duration> {
        None
    }

    fn waited(&mut self, _: Duration) {}
}
