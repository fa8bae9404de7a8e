//! A connection to a controller: packets out, packets in, and whether it is logged in.

use super::login::Login;
use crate::connect::Connect;
use crate::smsd::options::SmsdOptions;
use crate::smsd::session::Lost;
use crate::wire::Wire;
use crate::{Error, LineError};
use std::time::Duration;
use stepdrive_proto::smsd::{Framing, Packet, PacketBuf, PacketReader, Taken, decode_reply, encode_request};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::standard::{
    Answer, Code, HALF_PACKET_TIMEOUT, Reply, Request, VERSION_2, exists_in,
};
use stepdrive_spec::time;
use tokio::time::{Instant, sleep_until};

/// What the way there may add to the time that the controller keeps half a packet.
const MARGIN: Duration = Duration::from_millis(50);

/// Why a request has not the reply that was hoped for.
#[derive(Debug)]
pub(super) enum Trouble {
    /// Not a byte of it has gone out.
    NotSent(LineError),
    /// It went out, as far as anybody can tell, and its reply did not come.
    Unanswered(Lost),
    /// It arrived damaged: the controller has not looked at it.
    Damaged(LineError),
    /// The controller answered with an error. Nothing has changed there.
    Refused(Answer),
    /// It was not sent, for a reason that is in words already.
    Told(Error),
}

/// What a packet that came is to the request that waits for its reply.
#[allow(clippy::large_enum_variant, reason = "there is one at a time, and it is taken apart at once")]
enum Found {
    /// Its reply.
    Reply(Reply),
    /// Its reply, which cannot be understood.
    Broken(String),
    /// The controller's invitation to log in.
    Greeting,
    /// Not its reply.
    Other,
    /// A sign that nothing that follows on this connection can be trusted.
    Astray(String),
}

/// A connection, opened when it is wanted.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) wire: Wire,
    pub(super) login: Login,
    framing: Framing,
    reader: PacketReader,
    request: PacketBuf,
    /// Of the request that went out last, never 0. Whatever bears another number is no answer to it.
    id: u8,
    /// The protocol version of the controller, as its packets say.
    version: Option<u8>,
    /// Which opening of the wire all below is about.
    opening: u64,
    /// The controller has spoken first, as it does over TCP, or was waited for long enough.
    greeted: bool,
    /// Each request on this connection has its reply, so that nothing that is still to come belongs to an earlier one.
    settled: bool,
    /// The last request was not answered in time.
    silent: bool,
    /// When the last request was given to the line.
    sent: Instant,
}

impl Session {
    pub(super) fn new(connect: Box<dyn Connect>, framing: Framing, options: &SmsdOptions) -> Session {
        Session {
            wire: Wire::new(connect, options.timeouts),
            login: Login::new(options.password),
            framing,
            reader: PacketReader::new(framing),
            request: PacketBuf::new(),
            id: 0,
            version: None,
            opening: 0,
            greeted: false,
            settled: true,
            silent: false,
            sent: Instant::now(),
        }
    }

    /// What errors call the controller.
    pub(super) fn name(&self) -> String {
        self.wire.name().to_owned()
    }

    /// The protocol version of the controller, once it has said anything.
    pub(super) fn version(&self) -> Option<u8> {
        self.version
    }

    /// Whether a new configuration of the LAN ends this connection.
    pub(super) fn is_over_lan(&self) -> bool {
        self.framing == Framing::Raw
    }

    /// Sees to it that the connection is open, that nothing of an earlier request is on it, and, where that is wanted,
    /// that it is logged in.
    pub(super) async fn prepare(&mut self, logged_in: bool) -> Result<(), Trouble> {
        self.clear_away().await;
        self.wire.open().await.map_err(Trouble::NotSent)?;
        if self.opening != self.wire.openings() {
            self.begin();
        }
        if self.framing == Framing::Raw {
            self.settle_raw().await?;
        }
        if logged_in && !self.login.inside {
            // In a box: the future of every request has room for all that it may do.
            Box::pin(self.log_in()).await?;
        }
        Ok(())
    }

    /// Drops what is left of a request that somebody stopped waiting for. One that has not begun to go out never will;
    /// one that has gone out in part is ended by closing the connection, since its rest, sent late, might start a motion
    /// that nobody expects any more.
    async fn clear_away(&mut self) {
        if !self.wire.withdraw() {
            self.wire.close();
        }
        if !self.wire.look().await || self.opening != self.wire.openings() {
            return;
        }
        let mut astray = false;
        while let Some(found) = self.next(None) {
            self.greeted |= matches!(found, Found::Greeting);
            astray |= matches!(found, Found::Astray(_));
        }
        if astray || self.framing == Framing::Raw && !self.reader.is_empty() {
            // What comes next may begin anywhere.
            self.wire.close();
        }
    }

    /// A new connection: nothing is known of it.
    fn begin(&mut self) {
        self.opening = self.wire.openings();
        self.reader = PacketReader::new(self.framing);
        self.login.inside = false;
        self.greeted = false;
        self.settled = true;
        self.silent = false;
    }

    /// Over TCP the controller speaks first; and where packets have no marks, what follows a damaged one may be taken for
    /// its rest until the controller has dropped it.
    async fn settle_raw(&mut self) -> Result<(), Trouble> {
        if !self.greeted {
            self.wait_for_greeting().await?;
        }
        if !self.settled {
            sleep_until(self.sent + HALF_PACKET_TIMEOUT + MARGIN).await;
        }
        Ok(())
    }

    /// One that does not come is done without: whoever is there will say whether it can be spoken to.
    async fn wait_for_greeting(&mut self) -> Result<(), Trouble> {
        let deadline = Instant::now() + self.wire.timeouts().reply;
        while !self.greeted {
            match self.next(None) {
                Some(Found::Greeting) => self.greeted = true,
                Some(Found::Astray(what)) => {
                    self.wire.close();
                    return Err(Trouble::NotSent(self.garbled(what)));
                }
                Some(_) => {}
                None => match self.wire.receive(deadline).await {
                    Ok(()) => {}
                    Err(LineError::Silent { .. }) => self.greeted = true,
                    Err(error) => return Err(Trouble::NotSent(error)),
                },
            }
        }
        Ok(())
    }

    /// Sends a request and waits for its reply. The connection is open.
    pub(super) async fn exchange(&mut self, request: &Request) -> Result<Reply, Trouble> {
        self.check_version(request)?;
        // Never 0: that is the number of the greeting, and of answers to what has none.
        self.id = self.id.checked_add(1).unwrap_or(1);
        let version = self.version.unwrap_or(VERSION_2);
        encode_request(&mut self.request, self.framing, version, self.id, request);
        self.wire.queue(&self.request);
        let settled = std::mem::replace(&mut self.settled, false);
        self.sent = Instant::now();
        let deadline = self.sent + self.wire.timeouts().reply;
        let reply = self.wait_for_reply(request, deadline).await?;
        self.silent = false;
        self.wire.prove();
        self.judge(reply, settled)
    }

    async fn wait_for_reply(&mut self, request: &Request, deadline: Instant) -> Result<Reply, Trouble> {
        loop {
            match self.next(Some(request)) {
                Some(Found::Reply(reply)) => return Ok(reply),
                Some(Found::Broken(what)) => return Err(self.lost(self.garbled(what))),
                Some(Found::Astray(what)) => {
                    self.wire.close();
                    return Err(self.lost(self.garbled(what)));
                }
                Some(Found::Greeting | Found::Other) => {}
                None => {
                    if let Err(error) = self.wire.receive(deadline).await {
                        return Err(self.unanswered(error));
                    }
                }
            }
        }
    }

    /// What a reply comes to. `settled`: nothing else was still to be answered when its request went out.
    fn judge(&mut self, reply: Reply, settled: bool) -> Result<Reply, Trouble> {
        let (Reply::Response(answer) | Reply::Powerstep01(answer)) = &reply else {
            self.settled = true;
            return Ok(reply);
        };
        let code = answer.code;
        if matches!(code, Code::ErrorXor | Code::ErrorLen) {
            let cause = self.garbled(format!("{code}: what was sent to it arrived damaged"));
            // A packet before this one may have been damaged so that it bore this one's number.
            if !settled {
                return Err(self.lost(cause));
            }
            self.settled = true;
            return Err(Trouble::Damaged(cause));
        }
        self.settled = true;
        if code.is_error() { Err(Trouble::Refused(*answer)) } else { Ok(reply) }
    }

    /// Takes the next packet out of what came. `None` when there is no whole one.
    fn next(&mut self, request: Option<&Request>) -> Option<Found> {
        let received = self.wire.received();
        let mut rest = received;
        // For the reader no time passes: half a reply may take as long as the whole.
        let taken = self.reader.take(time::Instant::ZERO, &mut rest);
        let found = taken.map(|taken| match &taken {
            Taken { packet: Ok(packet), .. } => {
                self.version = Some(packet.version);
                identify(packet, self.id, request)
            }
            Taken { packet: Err(malformed), .. } if self.framing == Framing::Raw => {
                Found::Astray(format!("a packet that is damaged ({})", malformed.code()))
            }
            Taken { id, packet: Err(malformed), .. } if request.is_some() && *id == self.id => {
                Found::Broken(format!("a packet that is damaged ({})", malformed.code()))
            }
            Taken { packet: Err(_), .. } => Found::Other,
        });
        let taken = received.len() - rest.len();
        self.wire.take(taken);
        found
    }

    /// Instructions that the controller does not have are not sent to it.
    fn check_version(&self, request: &Request) -> Result<(), Trouble> {
        let Some(version) = self.version else { return Ok(()) };
        let words = match request {
            Request::Command(word) => std::slice::from_ref(word),
            Request::WriteMemory { words, .. } => words.as_slice(),
            Request::Authorise(_)
            | Request::ReadMemory { .. }
            | Request::SetLan(_)
            | Request::GetLan
            | Request::SetPassword(_)
            | Request::GetErrors
            | Request::GetVersions => return Ok(()),
        };
        let opcodes = words.iter().filter_map(|word| Instruction::from_word(*word).ok());
        let missing = |opcode: &Opcode| !exists_in(*opcode, version);
        match opcodes.map(|instruction| instruction.opcode).find(missing) {
            None => Ok(()),
            Some(opcode) => Err(Trouble::Told(Error::Usage(format!(
                "{} speaks version {version} of the protocol, which has no {opcode}; nothing was sent",
                self.name()
            )))),
        }
    }

    /// A connection that was silent once may have lost one reply, and what is asked on it next is asked behind the
    /// request that was lost. After twice, or half a packet without marks, another one is better.
    fn unanswered(&mut self, error: LineError) -> Trouble {
        let is_silence = matches!(error, LineError::Silent { .. });
        let trouble = if self.wire.has_sent() { self.lost(error) } else { Trouble::NotSent(error) };
        if !is_silence {
            return trouble;
        }
        let half_sent = !self.wire.withdraw();
        let half_come = self.framing == Framing::Raw && !self.reader.is_empty();
        if self.silent || half_sent || half_come || matches!(trouble, Trouble::NotSent(_)) {
            self.wire.close();
        }
        self.silent = true;
        trouble
    }

    fn lost(&self, cause: LineError) -> Trouble {
        Trouble::Unanswered(Lost { cause, connection: self.wire.openings() })
    }

    fn garbled(&self, what: String) -> LineError {
        LineError::Garbled { to: self.wire.name().to_owned(), what }
    }
}

/// What a whole packet is to a request with this number.
fn identify(packet: &Packet<'_>, id: u8, request: Option<&Request>) -> Found {
    if packet.is_greeting() {
        return Found::Greeting;
    }
    match request {
        Some(request) if packet.id == id => match decode_reply(packet, request) {
            Ok(reply) => Found::Reply(reply),
            Err(error) => Found::Broken(error.to_string()),
        },
        _ => Found::Other,
    }
}
