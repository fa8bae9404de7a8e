//! A connection to a controller: requests out, replies in, and whether it is logged in.

use super::login::{Login, Standing};
use super::options::SmsdOptions;
use crate::connect::Connect;
use crate::wire::Wire;
use crate::{Error, LineError};
use stepdrive_proto::modbus::{Adu, ReplyError, Split, decode_reply, encode_request, split};
use stepdrive_spec::modbus::{Exception, Reply, Request};
use tokio::time::Instant;

/// Why a request has no reply.
#[derive(Debug)]
pub(super) enum Trouble {
    /// Not a byte of it has gone out.
    NotSent(LineError),
    /// It went out, as far as anybody can tell, and its reply did not come.
    Unanswered(Lost),
    /// The controller refused it. Nothing has changed there.
    Exception(Exception),
    /// It was not sent, for a reason that is in words already.
    Told(Error),
}

/// A reply that did not come.
#[derive(Debug)]
pub(super) struct Lost {
    pub(super) cause: LineError,
    /// The connection that the request went out on. What is asked on the same is asked behind it.
    pub(super) connection: u64,
}

/// A connection, opened when it is wanted.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) wire: Wire,
    pub(super) login: Login,
    unit: u8,
    /// Of the request that went out last. Whatever bears another number is no answer to it.
    transaction: u16,
    request: Adu,
    /// What came last in reply. It stays here until somebody wants it, since it has room for the most that Modbus allows.
    reply: Reply,
    /// Which opening of the wire `login` and `silent` are about.
    opening: u64,
    /// The last request was not answered in time.
    silent: bool,
}

impl Session {
    pub(super) fn new(connect: Box<dyn Connect>, options: &SmsdOptions) -> Session {
        Session {
            wire: Wire::new(connect, options.timeouts),
            login: Login::new(options),
            unit: options.unit,
            transaction: 0,
            request: Adu::new(),
            reply: Reply::Written,
            opening: 0,
            silent: false,
        }
    }

    /// What errors call the controller.
    pub(super) fn name(&self) -> String {
        format!("{} (unit {})", self.wire.name(), self.unit)
    }

    /// From now on another unit is meant.
    pub(super) fn set_unit(&mut self, unit: u8) {
        self.unit = unit;
    }

    pub(super) fn unit(&self) -> u8 {
        self.unit
    }

    /// Sees to it that the connection is open, that nothing of an earlier request is on it, and, where that is wanted,
    /// that it is logged in.
    pub(super) async fn prepare(&mut self, logged_in: bool) -> Result<(), Trouble> {
        self.clear_away().await;
        self.wire.open().await.map_err(Trouble::NotSent)?;
        if self.opening != self.wire.openings() {
            self.opening = self.wire.openings();
            self.login.standing = Standing::Outside;
            self.silent = false;
        }
        if logged_in && self.login.standing != Standing::Inside {
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
        if !self.wire.look().await {
            return;
        }
        loop {
            let size = match split(self.wire.received()) {
                Split::Frame { size, .. } | Split::Foreign { size, .. } => size,
                Split::Incomplete { .. } if self.wire.received().is_empty() => return,
                // Half a frame, or garbage that looks like one: what comes next may begin anywhere.
                Split::Incomplete { .. } | Split::Broken { .. } => return self.wire.close(),
            };
            self.wire.take(size);
        }
    }

    /// Sends a request and waits for its reply. The connection is open.
    pub(super) async fn exchange(&mut self, request: &Request) -> Result<&Reply, Trouble> {
        self.transaction = self.transaction.wrapping_add(1);
        let encoded = encode_request(&mut self.request, self.transaction, self.unit, request);
        encoded.map_err(|refusal| Trouble::Told(Error::Usage(refusal.to_string())))?;
        self.wire.queue(&self.request);
        let deadline = Instant::now() + self.wire.timeouts().reply;
        while !self.has_reply_to(request)? {
            if let Err(error) = self.wire.receive(deadline).await {
                return Err(self.unanswered(error));
            }
        }
        Ok(&self.reply)
    }

    /// Keeps the reply and is `true`, if it is there. Frames that are no answer to the request are dropped.
    fn has_reply_to(&mut self, request: &Request) -> Result<bool, Trouble> {
        loop {
            let (size, answer) = match split(self.wire.received()) {
                Split::Incomplete { .. } => return Ok(false),
                Split::Broken { length } => {
                    return Err(self.garbled(format!("a frame whose length field is {length}")));
                }
                Split::Frame { frame, size }
                    if frame.transaction == self.transaction && frame.unit == self.unit =>
                {
                    (size, Some(decode_reply(frame.pdu, request).map(|reply| self.reply = reply)))
                }
                Split::Frame { size, .. } | Split::Foreign { size, .. } => (size, None),
            };
            self.wire.take(size);
            let Some(answer) = answer else { continue };
            return match answer {
                Ok(()) => {
                    self.proved();
                    Ok(true)
                }
                Err(ReplyError::Exception(exception)) => {
                    self.proved();
                    Err(Trouble::Exception(exception))
                }
                Err(error) => Err(self.garbled(error.to_string())),
            };
        }
    }

    fn proved(&mut self) {
        self.silent = false;
        self.wire.prove();
    }

    /// What came cannot be followed, and so neither can what comes next on this connection.
    fn garbled(&mut self, what: String) -> Trouble {
        self.wire.close();
        self.lost(LineError::Garbled { to: self.wire.name().to_owned(), what })
    }

    /// A connection that was silent once may have lost one reply, and what is asked on it next is asked behind the
    /// request that was lost. After twice, or half a frame, another one is better.
    fn unanswered(&mut self, error: LineError) -> Trouble {
        let LineError::Silent { after, .. } = error else { return self.sent_or_not(error) };
        let error = LineError::Silent { to: self.name(), after };
        let trouble = self.sent_or_not(error);
        let in_halves = !self.wire.received().is_empty() || !self.wire.withdraw();
        if self.silent || in_halves || matches!(trouble, Trouble::NotSent(_)) {
            self.wire.close();
        }
        self.silent = true;
        trouble
    }

    fn sent_or_not(&self, error: LineError) -> Trouble {
        if self.wire.has_sent() { self.lost(error) } else { Trouble::NotSent(error) }
    }

    fn lost(&self, cause: LineError) -> Trouble {
        Trouble::Unanswered(Lost { cause, connection: self.wire.openings() })
    }
}
