//! One line to a controller, with what is on its way in both directions.
//!
//! Whatever a [`Wire`] does can be dropped at any point: bytes that went out are counted as they go, bytes that came in
//! are kept as they come, all of it in the `Wire` itself. So a request that somebody stopped waiting for leaves nothing
//! half known. What is to become of it is for the client to say: [`Wire::withdraw`] takes back what has not begun to
//! go out.

use crate::LineError;
use crate::connect::{Connect, Stream};
use std::fmt;
use std::future::poll_fn;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::runtime::{Handle, Id};
use tokio::time::{Instant, Sleep, sleep_until, timeout};

/// Room for what came in and was not taken yet; no reply of either family is half as long.
const ROOM: usize = 1024;
/// Least time between two attempts to connect of which the first led to nothing.
const FIRST_REST: Duration = Duration::from_millis(50);
/// Most time between two attempts.
const LONGEST_REST: Duration = Duration::from_secs(2);

/// How long things may take on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// To connect.
    pub connect: Duration,
    /// From a request to the end of its reply.
    pub reply: Duration,
}

impl Default for Timeouts {
    /// 3 s to connect, 1 s to reply.
    fn default() -> Timeouts {
        Timeouts { connect: Duration::from_secs(3), reply: Duration::from_secs(1) }
    }
}

/// A line that is opened when it is wanted.
pub(crate) struct Wire {
    connect: Box<dyn Connect>,
    timeouts: Timeouts,
    stream: Option<Box<dyn Stream>>,
    /// How often it was opened.
    openings: u64,
    /// No attempt to connect before.
    not_before: Option<Instant>,
    /// What the next attempt has to keep from the one after it.
    rest: Duration,
    /// Bytes to be sent; those before `sent` are.
    outgoing: Vec<u8>,
    sent: usize,
    /// Any byte of what was queued last has gone out.
    began: bool,
    /// Bytes that came are `incoming[taken..filled]`.
    incoming: Box<[u8; ROOM]>,
    taken: usize,
    filled: usize,
    alarm: Option<Alarm>,
}

/// Wakes at a deadline, or before: then it is set again. So one that was set for a request serves those that follow it, most
/// of which are answered long before, and setting it for each would cost more than the rest of waiting.
struct Alarm {
    sleep: Pin<Box<Sleep>>,
    /// Where it was set. In another runtime it might never wake.
    runtime: Id,
}

impl Wire {
    /// A line, not opened yet.
    pub(crate) fn new(connect: Box<dyn Connect>, timeouts: Timeouts) -> Wire {
        Wire {
            connect,
            timeouts,
            stream: None,
            openings: 0,
            not_before: None,
            rest: FIRST_REST,
            outgoing: Vec::new(),
            sent: 0,
            began: false,
            incoming: Box::new([0; ROOM]),
            taken: 0,
            filled: 0,
            alarm: None,
        }
    }

    /// What errors call the other end.
    pub(crate) fn name(&self) -> &str {
        self.connect.name()
    }

    /// How long things may take.
    pub(crate) fn timeouts(&self) -> Timeouts {
        self.timeouts
    }

    /// How often it has been opened: another number is another connection.
    pub(crate) fn openings(&self) -> u64 {
        self.openings
    }

    /// Opens the line if it is not open. Attempts that lead to nothing are 50 ms apart, then twice that each time, up to
    /// 2 s; [`Wire::prove`] ends that.
    ///
    /// # Errors
    /// [`LineError::Connect`].
    pub(crate) async fn open(&mut self) -> Result<(), LineError> {
        if self.stream.is_some() {
            return Ok(());
        }
        // In a box, as other things that are seldom done: the future of every request has room for all that it may do.
        Box::pin(self.reopen()).await
    }

    async fn reopen(&mut self) -> Result<(), LineError> {
        if let Some(at) = self.not_before {
            sleep_until(at).await;
        }
        self.not_before = Some(Instant::now() + self.rest);
        self.rest = LONGEST_REST.min(self.rest * 2);
        let patience = self.timeouts.connect;
        let why = match timeout(patience, self.connect.connect()).await {
            Ok(Ok(stream)) => {
                self.stream = Some(stream);
                self.openings += 1;
                return Ok(());
            }
            Ok(Err(error)) => error.to_string(),
            Err(_) => format!("no connection within {patience:?}"),
        };
        Err(LineError::Connect { to: self.name().to_owned(), why })
    }

    /// The other end is what it should be: after a loss it may be connected to again at once.
    pub(crate) fn prove(&mut self) {
        self.rest = FIRST_REST;
    }

    /// Closes the line and forgets what was on its way.
    pub(crate) fn close(&mut self) {
        self.stream = None;
        self.alarm = None;
        self.outgoing.clear();
        self.sent = 0;
        self.taken = 0;
        self.filled = 0;
    }

    /// Adds bytes to what is to be sent; [`Wire::receive`] sends them.
    pub(crate) fn queue(&mut self, bytes: &[u8]) {
        if self.sent == self.outgoing.len() {
            self.outgoing.clear();
            self.sent = 0;
            self.began = false;
        }
        self.outgoing.extend_from_slice(bytes);
    }

    /// Takes back what is to be sent. `false`, and nothing is taken back, when part of it has gone out already.
    pub(crate) fn withdraw(&mut self) -> bool {
        if self.sent > 0 && self.sent < self.outgoing.len() {
            return false;
        }
        self.outgoing.clear();
        self.sent = 0;
        true
    }

    /// Whether any byte of what was queued last has gone out, also when the line was closed since.
    pub(crate) fn has_sent(&self) -> bool {
        self.began
    }

    /// What has come and was not taken.
    pub(crate) fn received(&self) -> &[u8] {
        self.incoming.get(self.taken..self.filled).unwrap_or(&[])
    }

    /// Takes the first `count` bytes of what has come.
    pub(crate) fn take(&mut self, count: usize) {
        self.taken = self.filled.min(self.taken + count);
        if self.taken == self.filled {
            self.taken = 0;
            self.filled = 0;
        }
    }

    /// Sends what is to be sent, and waits until more has come, at most until `deadline`.
    ///
    /// # Errors
    /// [`LineError::Silent`] at the deadline: the line stays open, and what has not been sent is still to be.
    /// [`LineError::Lost`] and [`LineError::Garbled`] (there is no room for more) close it.
    pub(crate) async fn receive(&mut self, deadline: Instant) -> Result<(), LineError> {
        poll_fn(|context| match self.poll(context) {
            Poll::Ready(Ok(())) => Poll::Ready(Ok(())),
            Poll::Ready(Err(error)) => {
                self.close();
                Poll::Ready(Err(error))
            }
            Poll::Pending => self.poll_alarm(deadline, context).map(|()| Err(self.silent())),
        })
        .await
    }

    /// Ready at a deadline.
    fn poll_alarm(&mut self, deadline: Instant, context: &mut Context<'_>) -> Poll<()> {
        let runtime = Handle::current().id();
        let set = self.alarm.take().filter(|alarm| alarm.runtime == runtime);
        let alarm = self.alarm.insert(match set {
            Some(alarm) => alarm,
            None => Alarm { sleep: Box::pin(sleep_until(deadline)), runtime },
        });
        if alarm.sleep.deadline() > deadline {
            alarm.sleep.as_mut().reset(deadline);
        }
        while alarm.sleep.as_mut().poll(context).is_ready() {
            if alarm.sleep.deadline() >= deadline {
                return Poll::Ready(());
            }
            alarm.sleep.as_mut().reset(deadline);
        }
        Poll::Pending
    }

    /// Takes in what has come already, without waiting for it, and closes the line if its other end has done so.
    /// Answers whether it is open.
    pub(crate) async fn look(&mut self) -> bool {
        let come = poll_fn(|context| match self.poll_receive(context) {
            Poll::Ready(outcome) => Poll::Ready(Some(outcome)),
            Poll::Pending => Poll::Ready(None),
        });
        if let Some(Err(_)) = come.await {
            self.close();
        }
        self.stream.is_some()
    }

    fn poll(&mut self, context: &mut Context<'_>) -> Poll<Result<(), LineError>> {
        if self.sent < self.outgoing.len() {
            // While the other end takes nothing it may still have something to say.
            match self.poll_send(context) {
                Poll::Ready(Err(error)) => return Poll::Ready(Err(error)),
                Poll::Ready(Ok(())) | Poll::Pending => {}
            }
        }
        self.poll_receive(context)
    }

    fn poll_send(&mut self, context: &mut Context<'_>) -> Poll<Result<(), LineError>> {
        let Some(stream) = self.stream.as_mut() else { return Poll::Ready(Err(self.not_open())) };
        while let Some(rest @ [_, ..]) = self.outgoing.get(self.sent..) {
            match ready!(Pin::new(&mut *stream).poll_write(context, rest)) {
                Ok(0) => return Poll::Ready(Err(self.lost(&io::ErrorKind::WriteZero.into()))),
                Ok(count) => {
                    self.sent += count;
                    self.began = true;
                }
                Err(error) => return Poll::Ready(Err(self.lost(&error))),
            }
        }
        Poll::Ready(Ok(()))
    }

    fn poll_receive(&mut self, context: &mut Context<'_>) -> Poll<Result<(), LineError>> {
        self.make_room();
        let Some(stream) = self.stream.as_mut() else { return Poll::Ready(Err(self.not_open())) };
        let room = self.incoming.get_mut(self.filled..).unwrap_or(&mut []);
        if room.is_empty() {
            let what = format!("{ROOM} bytes without an end");
            return Poll::Ready(Err(LineError::Garbled { to: self.name().to_owned(), what }));
        }
        let mut buffer = ReadBuf::new(room);
        let outcome = ready!(Pin::new(stream).poll_read(context, &mut buffer));
        let count = buffer.filled().len();
        Poll::Ready(match outcome {
            Ok(()) if count == 0 => Err(self.ended()),
            Ok(()) => {
                self.filled += count;
                Ok(())
            }
            Err(error) => Err(self.lost(&error)),
        })
    }

    /// Moves what was not taken to the front.
    fn make_room(&mut self) {
        if self.taken > 0 {
            self.incoming.copy_within(self.taken..self.filled, 0);
            self.filled -= self.taken;
            self.taken = 0;
        }
    }

    fn lost(&self, error: &io::Error) -> LineError {
        LineError::lost(self.name(), error)
    }

    fn ended(&self) -> LineError {
        LineError::Lost { to: self.name().to_owned(), why: "the other end closed it".to_owned() }
    }

    fn silent(&self) -> LineError {
        LineError::Silent { to: self.name().to_owned(), after: self.timeouts.reply }
    }

    fn not_open(&self) -> LineError {
        LineError::Lost { to: self.name().to_owned(), why: "it is not open".to_owned() }
    }
}

impl fmt::Debug for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Wire")
            .field("to", &self.name())
            .field("open", &self.stream.is_some())
            .field("openings", &self.openings)
            .field("unsent", &self.outgoing.get(self.sent..).unwrap_or(&[]))
            .field("received", &self.received())
            .finish_non_exhaustive()
    }
}
