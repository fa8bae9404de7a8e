//! A drive at the end of a serial line in memory that can be made to fail, on virtual time.

use std::collections::VecDeque;
use std::future::{pending, poll_fn};
use std::io;
use std::pin::{Pin, pin};
use std::sync::{Arc, Mutex, MutexGuard};
use std::task::Poll;
use std::time::Duration;
use stepdrive_drive::smd3::{Config, Smd3, Stored};
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::{Connect, Timeouts, from_fn};
use stepdrive_proto::smd3::{Line, LineBuf, LineReader, decode_line, encode_reply};
use stepdrive_rig::machine::Machine;
use stepdrive_rig::mechanics::{Mechanics, Switch};
use stepdrive_spec::smd3::commands::{Access, Command};
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::time::Instant;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
use tokio::sync::watch;
use tokio::time::sleep;

pub(crate) const MS: Duration = Duration::from_millis(1);
pub(crate) const SECOND: Duration = Duration::from_secs(1);

/// Room on the line: less than some lines have bytes, so that those go out in pieces.
const ROOM: usize = 12;

/// What becomes of one line and its reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// All is well.
    None,
    /// The line does not arrive.
    LoseLine,
    /// The reply does not arrive.
    LoseReply,
    /// The reply is late.
    Delay(Duration),
    /// These bytes come instead of the reply.
    Instead(Vec<u8>),
    /// These bytes come, and the line is not looked at.
    Foreign(Vec<u8>),
    /// These bytes come before the reply.
    Before(Vec<u8>),
    /// These bytes come behind it.
    Behind(Vec<u8>),
    /// Only so many bytes of the reply come.
    Half(usize),
    /// So many bytes of the reply come, and the rest later.
    Pause(usize, Duration),
    /// The cable is unplugged before the line arrives.
    CutBefore,
    /// The cable is unplugged before the reply arrives.
    CutAfter,
}

/// A drive with its line. It is a serial one: what the drive has received of a line outlives the connection, and what was
/// sent before the port was closed comes before what is sent once it is open again.
pub(crate) struct Station {
    world: Mutex<World>,
    /// Held by the connection whose bytes come next, until it has no more for the moment.
    turn: tokio::sync::Mutex<()>,
    cuts: watch::Sender<u64>,
}

struct World {
    machine: Machine<Smd3>,
    began: tokio::time::Instant,
    reader: LineReader,
    faults: VecDeque<Fault>,
    otherwise: Fault,
    /// Lines that are answered with these bytes and not looked at.
    fixed: Vec<(String, Vec<u8>)>,
    unplugged: bool,
    /// The drive takes nothing off the line.
    deaf: bool,
    carried_out: Vec<Command>,
    /// The lines that have started motion, all of them.
    motions: Vec<String>,
    lines: Vec<String>,
    openings: u64,
}

impl World {
    fn now(&self) -> Instant {
        Instant::ZERO + self.began.elapsed()
    }

    /// What the drive answers to a line.
    fn answer(&mut self, line: &[u8]) -> Vec<u8> {
        let now = self.now();
        let request = decode_line(line);
        let reply = self.machine.handle(now, request);
        if let (Ok(Some(request)), Ok(_)) = (request, reply.outcome) {
            let acts = request.command.info().starts || request.command.info().access == Access::Action;
            self.carried_out.extend(acts.then_some(request.command));
            let motion = request.command.info().starts.then(|| String::from_utf8_lossy(line).into_owned());
            self.motions.extend(motion);
        }
        let mut out = LineBuf::new();
        encode_reply(&mut out, &reply);
        out.to_vec()
    }
}

impl Station {
    /// A drive fresh from the factory, whose carriage has no ends and no switches.
    pub(crate) fn new() -> Arc<Station> {
        Station::with(Vec::new())
    }

    /// The same with limit switches, which are closed between two places in full steps.
    pub(crate) fn with(switches: Vec<(Signal, [f64; 2])>) -> Arc<Station> {
        let switches =
            switches.into_iter().map(|(input, closed)| Switch::new(input, closed).expect("wide enough"));
        let machine = Machine::power_up(Mechanics::new(None, 0.0), switches.collect(), |signals| {
            Smd3::power_up(Instant::ZERO, Config::default(), Stored::Nothing, signals)
        });
        let world = World {
            machine,
            began: tokio::time::Instant::now(),
            reader: LineReader::new(),
            faults: VecDeque::new(),
            otherwise: Fault::None,
            fixed: Vec::new(),
            unplugged: false,
            deaf: false,
            carried_out: Vec::new(),
            motions: Vec::new(),
            lines: Vec::new(),
            openings: 0,
        };
        let (world, turn) = (Mutex::new(world), tokio::sync::Mutex::default());
        Arc::new(Station { world, turn, cuts: watch::Sender::new(0) })
    }

    fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().expect("no test panics with it")
    }

    /// A client of the drive.
    pub(crate) fn client(self: &Arc<Station>) -> Smd3Client {
        Smd3Client::new(self.reach(), Timeouts::default())
    }

    fn reach(self: &Arc<Station>) -> impl Connect + use<> {
        let station = Arc::clone(self);
        from_fn("uhv", move || std::future::ready(Arc::clone(&station).connect()))
    }

    fn connect(self: Arc<Station>) -> io::Result<DuplexStream> {
        let mut world = self.world();
        if world.unplugged {
            return Err(io::ErrorKind::NotFound.into());
        }
        world.openings += 1;
        drop(world);
        let (near, far) = tokio::io::duplex(ROOM);
        tokio::spawn(serve(self, far));
        Ok(near)
    }

    /// Opens the line for somebody who does not speak the protocol.
    pub(crate) fn raw(self: &Arc<Station>) -> Raw {
        let (near, far) = tokio::io::duplex(ROOM);
        tokio::spawn(serve(Arc::clone(self), far));
        Raw(near)
    }

    // ---- trouble

    /// What becomes of the next lines.
    pub(crate) fn faults(&self, faults: impl IntoIterator<Item = Fault>) {
        self.world().faults = faults.into_iter().collect();
    }

    /// What becomes of all lines for which nothing else is said.
    pub(crate) fn otherwise(&self, fault: Fault) {
        self.world().otherwise = fault;
    }

    /// Answers a line with these bytes from now on, as another drive might.
    pub(crate) fn otherwise_of(&self, line: &str, bytes: &[u8]) {
        let mut world = self.world();
        world.fixed.retain(|(other, _)| other != line);
        world.fixed.push((line.to_owned(), bytes.to_vec()));
    }

    /// Pulls the cable, or plugs it in.
    pub(crate) fn unplug(&self, unplugged: bool) {
        self.world().unplugged = unplugged;
        if unplugged {
            self.cut();
        }
    }

    /// Ends the connection; another may be opened at once.
    pub(crate) fn cut(&self) {
        self.cuts.send_modify(|cuts| *cuts += 1);
    }

    /// Lets the drive take nothing off the line, or go on.
    pub(crate) fn deafen(&self, deaf: bool) {
        self.world().deaf = deaf;
        self.cuts.send_modify(|_| ());
    }

    /// Switches the drive off and on.
    pub(crate) fn restart(&self) {
        self.machine(|machine, now| {
            machine.switch_off(now);
            machine.switch_on(now);
        });
        self.world().reader = LineReader::new();
    }

    // ---- the drive

    /// Does something with the machine at the present time.
    pub(crate) fn machine<R>(&self, act: impl FnOnce(&mut Machine<Smd3>, Instant) -> R) -> R {
        let mut world = self.world();
        let now = world.now();
        world.machine.advance(now);
        act(&mut world.machine, now)
    }

    /// Does something to the drive.
    pub(crate) fn change(&self, act: impl FnOnce(&mut Smd3, Instant)) {
        self.machine(|machine, now| machine.change(now, |drive| act(drive, now)));
    }

    /// `PACT` as it is.
    pub(crate) fn position(&self) -> f64 {
        self.machine(|machine, now| machine.drive().position(now))
    }

    /// `VACT` as it is.
    pub(crate) fn velocity(&self) -> f64 {
        self.machine(|machine, now| machine.drive().velocity(now))
    }

    /// A setting as it is.
    pub(crate) fn setting(&self, command: Command) -> f64 {
        self.machine(|machine, _| machine.drive().settings().get(command))
    }

    /// What has started motion or acted since this was last asked, in the drive itself.
    pub(crate) fn carried_out(&self) -> Vec<Command> {
        std::mem::take(&mut self.world().carried_out)
    }

    /// The lines that have started motion, ever.
    pub(crate) fn motions(&self) -> Vec<String> {
        self.world().motions.clone()
    }

    /// The lines that have arrived since this was last asked.
    pub(crate) fn lines(&self) -> Vec<String> {
        std::mem::take(&mut self.world().lines)
    }

    /// How often the line was opened.
    pub(crate) fn openings(&self) -> u64 {
        self.world().openings
    }
}

/// An end of the line without a driver.
pub(crate) struct Raw(DuplexStream);

impl Raw {
    pub(crate) async fn write(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).await.expect("open");
    }
}

/// Serves a connection until it ends.
async fn serve(station: Arc<Station>, stream: DuplexStream) {
    let mut cuts = station.cuts.subscribe();
    let before = *cuts.borrow_and_update();
    let cut = async move {
        while *cuts.borrow_and_update() == before {
            if cuts.changed().await.is_err() {
                pending::<()>().await;
            }
        }
    };
    tokio::select! {
        () = talk(&station, stream) => {}
        () = cut => {}
    }
}

/// Answers lines until the cable is cut, or all that came before the port was closed is taken.
async fn talk(station: &Station, mut stream: DuplexStream) {
    let mut notice = station.cuts.subscribe();
    let mut turn = None;
    loop {
        while station.world().deaf {
            if notice.changed().await.is_err() {
                return;
            }
        }
        let mut byte = [0];
        let count = {
            let mut read = pin!(stream.read(&mut byte));
            if let Some(count) = at_once(read.as_mut()).await {
                count
            } else {
                turn = None;
                read.await
            }
        };
        if count.unwrap_or(0) == 0 {
            return;
        }
        if turn.is_none() {
            turn = Some(station.turn.lock().await);
        }
        let mut rest = &byte[..];
        let line = match station.world().reader.take(&mut rest) {
            Some(Line::Text(line)) => line.to_vec(),
            Some(Line::TooLong) => b"too long".to_vec(),
            None => continue,
        };
        if reply(station, &mut stream, &line).await == Cable::Cut {
            return;
        }
    }
}

/// What a future gives now; `None` when it has to be waited for.
async fn at_once<T>(mut future: Pin<&mut impl Future<Output = T>>) -> Option<T> {
    poll_fn(|context| match future.as_mut().poll(context) {
        Poll::Ready(output) => Poll::Ready(Some(output)),
        Poll::Pending => Poll::Ready(None),
    })
    .await
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cable {
    Whole,
    Cut,
}

async fn reply(station: &Station, stream: &mut DuplexStream, line: &[u8]) -> Cable {
    let fault = {
        let mut world = station.world();
        let text = String::from_utf8_lossy(line).into_owned();
        let fixed = world.fixed.iter().find(|(line, _)| *line == text);
        let otherwise =
            fixed.map_or_else(|| world.otherwise.clone(), |(_, bytes)| Fault::Foreign(bytes.clone()));
        world.lines.push(text);
        world.faults.pop_front().unwrap_or(otherwise)
    };
    if fault == Fault::LoseLine {
        return Cable::Whole;
    }
    if fault == Fault::CutBefore {
        return Cable::Cut;
    }
    if let Fault::Foreign(bytes) = &fault {
        say(stream, bytes).await;
        return Cable::Whole;
    }
    let reply = station.world().answer(line);
    let bytes = match fault {
        Fault::LoseReply => return Cable::Whole,
        Fault::CutAfter => return Cable::Cut,
        Fault::Delay(time) => {
            sleep(time).await;
            reply
        }
        Fault::Instead(bytes) | Fault::Foreign(bytes) => bytes,
        Fault::Before(bytes) => [bytes, reply].concat(),
        Fault::Behind(bytes) => [reply, bytes].concat(),
        Fault::Half(count) => reply[..count.min(reply.len())].to_vec(),
        Fault::Pause(count, time) => {
            let (first, second) = reply.split_at(count.min(reply.len()));
            say(stream, first).await;
            sleep(time).await;
            second.to_vec()
        }
        Fault::None | Fault::LoseLine | Fault::CutBefore => reply,
    };
    say(stream, &bytes).await;
    Cable::Whole
}

/// Sends bytes to whoever has the port open. Without one they are lost.
async fn say(stream: &mut DuplexStream, bytes: &[u8]) {
    let _ = stream.write_all(bytes).await;
}
