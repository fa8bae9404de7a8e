//! A controller, its line and its client, and verbs that say what a test does.

use super::link::{Fault, serve};
use std::collections::VecDeque;
use std::fmt::Debug;
use std::future::pending;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use stepdrive_drive::smsd::{Config, Event, Memory, Quantity, Smsd as Drive};
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_host::{Connect, Error, from_fn};
use stepdrive_rig::machine::Machine;
use stepdrive_rig::mechanics::Mechanics;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::time::Instant;
use tokio::io::DuplexStream;
use tokio::sync::watch;

pub(crate) const MS: Duration = Duration::from_millis(1);
pub(crate) const SECOND: Duration = Duration::from_secs(1);

/// Room on the link: less than a long request, so that some go out in pieces.
const ROOM: usize = 64;

/// What is spoken on the link.
pub(crate) trait Protocol: Debug + Send + Sync + Sized + 'static {
    type Client: Smsd;
    /// Something that acted, in the drive.
    type Act: Copy + Debug + PartialEq + Send;
    /// What the controller knows of a connection.
    type Session: Send;
    type Reply: Send + Sync;

    fn client(&self, reach: impl Connect + 'static, options: SmsdOptions) -> Self::Client;

    fn session(&self) -> Self::Session;

    /// What a new connection begins with.
    fn greeting(&self) -> Vec<u8> {
        Vec::new()
    }

    /// How long the first request is, if all of it is there.
    fn size(&self, bytes: &[u8]) -> Option<usize>;

    /// What the controller answers to the bytes of a request, and notes of it.
    fn answers(
        &self,
        world: &mut World<Self>,
        session: &mut Self::Session,
        bytes: &[u8],
        fault: &Fault,
    ) -> Vec<Self::Reply>;

    /// A reply on the wire.
    fn wire(&self, reply: &Self::Reply) -> Vec<u8>;

    /// The same under another number.
    fn renumbered(&self, reply: &Self::Reply, by: i8) -> Vec<u8>;

    /// What a fault of this protocol alone makes of a reply.
    fn spoilt(&self, reply: &Self::Reply, fault: &Fault) -> Vec<u8>;

    /// Whether new LAN parameters end a connection.
    fn is_over_lan(&self) -> bool;
}

/// A controller with its line.
pub(crate) struct Station<P: Protocol> {
    pub(crate) protocol: P,
    world: Mutex<World<P>>,
    /// Changes when all connections are to end.
    line: watch::Sender<u64>,
}

/// A controller, what is to go wrong, and what has happened.
pub(crate) struct World<P: Protocol> {
    pub(crate) machine: Machine<Drive>,
    began: tokio::time::Instant,
    /// What is to become of the next requests.
    faults: VecDeque<Fault>,
    /// What becomes of the others.
    otherwise: Fault,
    /// How many attempts to connect are refused.
    refusing: u32,
    /// Room on the next connections, each way.
    room: usize,
    /// Attempts to connect come to no end.
    hanging: bool,
    /// The next request comes from somebody who has not logged in.
    forgetful: bool,
    /// Connections that the controller's end has not done with.
    pub(crate) open: u32,
    /// Those of them on which it waits until the client reads.
    pub(crate) sending: u32,
    pub(crate) acts: Vec<P::Act>,
    pub(crate) requests: u64,
    attempts: Vec<tokio::time::Instant>,
}

impl<P: Protocol> World<P> {
    fn new(machine: Machine<Drive>) -> World<P> {
        World {
            machine,
            began: tokio::time::Instant::now(),
            faults: VecDeque::new(),
            otherwise: Fault::None,
            refusing: 0,
            room: ROOM,
            hanging: false,
            forgetful: false,
            open: 0,
            sending: 0,
            acts: Vec::new(),
            requests: 0,
            attempts: Vec::new(),
        }
    }

    pub(crate) fn now(&self) -> Instant {
        Instant::ZERO + self.began.elapsed()
    }

    /// Whether the controller is to forget who is logged in.
    pub(crate) fn forgets(&mut self) -> bool {
        std::mem::take(&mut self.forgetful)
    }
}

impl<P: Protocol> Station<P> {
    fn world(&self) -> MutexGuard<'_, World<P>> {
        self.world.lock().expect("no test panics with it")
    }

    pub(crate) fn answers(&self, session: &mut P::Session, bytes: &[u8], fault: &Fault) -> Vec<P::Reply> {
        self.protocol.answers(&mut self.world(), session, bytes, fault)
    }

    pub(crate) fn next_fault(&self) -> Fault {
        let mut world = self.world();
        let otherwise = world.otherwise.clone();
        world.faults.pop_front().unwrap_or(otherwise)
    }

    /// Whether a connection ends because the controller has new LAN parameters.
    pub(crate) fn has_moved(&self) -> bool {
        let mut world = self.world();
        let events = std::iter::from_fn(|| world.machine.drive_mut().poll_event());
        let configured = events.filter(|event| *event == Event::NetworkConfigured).count();
        configured > 0 && self.protocol.is_over_lan()
    }

    pub(crate) fn line(&self) -> watch::Receiver<u64> {
        self.line.subscribe()
    }

    /// Counts a connection for as long as what this returns is kept.
    pub(crate) fn count(self: Arc<Station<P>>, number: Number<P>) -> Counted<P> {
        *number(&mut self.world()) += 1;
        Counted(self, number)
    }

    async fn connect(self: Arc<Station<P>>) -> io::Result<DuplexStream> {
        let (hanging, room) = {
            let mut world = self.world();
            world.attempts.push(tokio::time::Instant::now());
            if world.refusing > 0 {
                world.refusing -= 1;
                return Err(io::ErrorKind::ConnectionRefused.into());
            }
            (world.hanging, world.room)
        };
        if hanging {
            pending::<()>().await;
        }
        let (near, far) = tokio::io::duplex(room);
        tokio::spawn(serve(self, far));
        Ok(near)
    }
}

type Number<P> = fn(&mut World<P>) -> &mut u32;

/// A connection as its far end sees it.
pub(crate) struct Counted<P: Protocol>(Arc<Station<P>>, Number<P>);

impl<P: Protocol> Drop for Counted<P> {
    fn drop(&mut self) {
        *self.1(&mut self.0.world()) -= 1;
    }
}

/// A controller and its client.
pub(crate) struct Bench<P: Protocol> {
    pub(crate) station: Arc<Station<P>>,
    pub(crate) client: P::Client,
}

impl<P: Protocol> Bench<P> {
    pub(crate) fn begin(protocol: P, config: Config, memory: Memory, options: SmsdOptions) -> Bench<P> {
        let machine = Machine::power_up(Mechanics::new(None, 0.0), Vec::new(), |_| {
            Drive::power_up(Instant::ZERO, config, memory, 0)
        });
        let world = Mutex::new(World::new(machine));
        let station = Arc::new(Station { protocol, world, line: watch::Sender::new(0) });
        let client = station.protocol.client(reach(&station), options);
        Bench { station, client }
    }

    /// The same, logged in.
    pub(crate) async fn logged_in(self) -> Bench<P> {
        self.client.log_in().await.expect("the factory's password");
        self
    }

    /// Another client of the same controller.
    pub(crate) fn another(&self, options: SmsdOptions) -> P::Client {
        self.station.protocol.client(reach(&self.station), options)
    }

    // ---- trouble

    /// What becomes of the next requests.
    pub(crate) fn faults(&self, faults: impl IntoIterator<Item = Fault>) {
        self.station.world().faults = faults.into_iter().collect();
    }

    /// What becomes of the request that comes behind so many others.
    pub(crate) fn fault_behind(&self, others: usize, fault: Fault) {
        self.faults(std::iter::repeat_n(Fault::None, others).chain([fault]));
    }

    /// What becomes of all requests for which nothing else is said.
    pub(crate) fn otherwise(&self, fault: Fault) {
        self.station.world().otherwise = fault;
    }

    pub(crate) fn refuse_connections(&self, count: u32) {
        self.station.world().refusing = count;
    }

    pub(crate) fn let_connections_hang(&self, hanging: bool) {
        self.station.world().hanging = hanging;
    }

    /// The controller forgets who is logged in, and keeps the connections.
    pub(crate) fn forget_sessions(&self) {
        self.station.world().forgetful = true;
    }

    /// Ends all connections.
    pub(crate) fn cut(&self) {
        self.station.line.send_modify(|cuts| *cuts += 1);
    }

    /// How many bytes fit on the next connections, each way.
    pub(crate) fn make_room(&self, room: usize) {
        self.station.world().room = room;
    }

    /// The line is good again, and whatever was going to happen on it does not.
    pub(crate) fn heal(&self) {
        self.faults([]);
        self.otherwise(Fault::None);
        self.refuse_connections(0);
        self.let_connections_hang(false);
    }

    // ---- the controller

    /// What the controller shows at present.
    pub(crate) fn look(&self, reg: Reg, index: u16) -> i64 {
        let mut world = self.station.world();
        let now = world.now();
        world.machine.advance(now);
        let value = world.machine.drive().look(now, Quantity::Register(reg, index));
        format!("{value}").parse().expect("registers are whole numbers")
    }

    /// Does something to the controller.
    pub(crate) fn change<R>(&self, act: impl FnOnce(&mut Drive, Instant) -> R) -> R {
        let mut world = self.station.world();
        let now = world.now();
        world.machine.change(now, |drive| act(drive, now))
    }

    pub(crate) fn machine<R>(&self, act: impl FnOnce(&mut Machine<Drive>, Instant) -> R) -> R {
        let mut world = self.station.world();
        let now = world.now();
        act(&mut world.machine, now)
    }

    /// The instruction words in a memory area.
    pub(crate) fn held(&self, area: u8) -> Vec<u32> {
        self.change(|drive, _| {
            let area = drive.memory().area(area.into());
            area.words()[..usize::from(area.size())].to_vec()
        })
    }

    /// What has acted since this was last asked.
    pub(crate) fn acts(&self) -> Vec<P::Act> {
        std::mem::take(&mut self.station.world().acts)
    }

    /// How many requests the controller has looked at since this was last asked.
    pub(crate) fn requests(&self) -> u64 {
        std::mem::take(&mut self.station.world().requests)
    }

    /// How many connections the controller's end has not done with. One that the client has left may still hold what
    /// the client sent.
    pub(crate) fn open(&self) -> u32 {
        self.station.world().open
    }

    /// Whether replies that the client does not read keep the controller from the requests behind them.
    pub(crate) fn is_choked(&self) -> bool {
        self.station.world().sending > 0
    }

    /// When it was tried to connect, since this was last asked.
    pub(crate) fn attempts(&self) -> Vec<tokio::time::Instant> {
        std::mem::take(&mut self.station.world().attempts)
    }
}

fn reach<P: Protocol>(station: &Arc<Station<P>>) -> impl Connect + use<P> {
    let station = Arc::clone(station);
    from_fn("stage", move || Arc::clone(&station).connect())
}

/// The text of an error.
pub(crate) fn text<T: Debug>(outcome: Result<T, Error>) -> String {
    outcome.expect_err("trouble was expected").to_string()
}

/// Runs something and answers how long it took.
pub(crate) async fn timed<T>(what: impl Future<Output = T>) -> (T, Duration) {
    let began = tokio::time::Instant::now();
    let outcome = what.await;
    (outcome, began.elapsed())
}
