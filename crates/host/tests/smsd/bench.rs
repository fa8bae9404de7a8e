//! A controller at the end of a link in memory, its client, and verbs that say what a test does.

use crate::link::{Fault, serve};
use std::collections::VecDeque;
use std::future::pending;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use stepdrive_drive::smsd::{Config, Event, Memory, Quantity, Session, Smsd, WordOrder as DriveOrder};
use stepdrive_host::smsd::{SmsdClient, SmsdOptions, WordOrder};
use stepdrive_host::{Connect, Error, from_fn};
use stepdrive_proto::modbus::{Adu, Split, decode_request, encode_refusal, encode_reply, split};
use stepdrive_rig::machine::Machine;
use stepdrive_rig::mechanics::Mechanics;
use stepdrive_spec::modbus::{Reply, Request, Table};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, Reg, Register};
use stepdrive_spec::smsd::standard::{Firmware, VERSION_2};
use stepdrive_spec::time::Instant;
use tokio::io::DuplexStream;
use tokio::sync::watch;

pub(crate) const MS: Duration = Duration::from_millis(1);
pub(crate) const SECOND: Duration = Duration::from_secs(1);

/// Room on the link: less than a long request, so that some go out in pieces.
const ROOM: usize = 64;
/// Bytes of a request that reads, or writes one register or coil.
pub(crate) const REQUEST: usize = 12;

/// Something that acted, in the drive.
pub(crate) type Act = (Reg, u16);

/// A controller with its line.
pub(crate) struct Station {
    world: Mutex<World>,
    /// Changes when all connections are to end.
    line: watch::Sender<u64>,
}

struct World {
    machine: Machine<Smsd>,
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
    reconfigured: bool,
    /// The next request comes from somebody who has not logged in.
    forgetful: bool,
    /// Connections that the controller's end has not done with.
    open: u32,
    acts: Vec<Act>,
    requests: u64,
    attempts: Vec<tokio::time::Instant>,
}

impl Station {
    fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().expect("no test panics with it")
    }

    /// Answers a frame; `None` when it is for another unit.
    pub(crate) fn answer(&self, session: &mut Session, frame: &[u8]) -> Option<Vec<u8>> {
        let mut world = self.world();
        world.requests += 1;
        if std::mem::take(&mut world.forgetful) {
            *session = Session::new();
        }
        let Split::Frame { frame, .. } = split(frame) else { panic!("a whole frame") };
        if ![0, 255, world.machine.drive().unit()].contains(&frame.unit) || !world.machine.powered() {
            return None;
        }
        let mut reply = Adu::new();
        match decode_request(frame.pdu) {
            Ok(request) => {
                let now = world.now();
                let outcome = world.machine.handle(now, session, &request);
                if outcome == Ok(Reply::Written) {
                    world.acts.extend(act(&request));
                }
                encode_reply(&mut reply, frame.transaction, frame.unit, &request, &outcome);
                while let Some(event) = world.machine.drive_mut().poll_event() {
                    world.reconfigured |= event == Event::NetworkConfigured;
                }
            }
            Err(refusal) => encode_refusal(&mut reply, frame.transaction, frame.unit, refusal),
        }
        Some(reply.to_vec())
    }

    pub(crate) fn next_fault(&self) -> Fault {
        let mut world = self.world();
        let otherwise = world.otherwise.clone();
        world.faults.pop_front().unwrap_or(otherwise)
    }

    pub(crate) fn has_been_reconfigured(&self) -> bool {
        std::mem::take(&mut self.world().reconfigured)
    }

    pub(crate) fn line(&self) -> watch::Receiver<u64> {
        self.line.subscribe()
    }

    /// Counts a connection for as long as what this returns is kept.
    pub(crate) fn opened(self: Arc<Station>) -> Open {
        self.world().open += 1;
        Open(self)
    }

    async fn connect(self: Arc<Station>) -> io::Result<DuplexStream> {
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

/// A connection as its far end sees it.
pub(crate) struct Open(Arc<Station>);

impl Drop for Open {
    fn drop(&mut self) {
        self.0.world().open -= 1;
    }
}

impl World {
    fn now(&self) -> Instant {
        Instant::ZERO + self.began.elapsed()
    }
}

/// What a request that was carried out has let act.
fn act(request: &Request) -> Option<Act> {
    let (table, address, value) = match request {
        Request::WriteCoil { address, value } => (Table::Coils, *address, u16::from(*value)),
        Request::WriteRegister { address, value } => (Table::HoldingRegisters, *address, *value),
        Request::WriteRegisters { .. }
        | Request::WriteCoils { .. }
        | Request::ReadBits { .. }
        | Request::ReadWords { .. } => return None,
    };
    let row = Register::at(table, address)?;
    // Logging in is asked for as often as it takes.
    let logs_in = row.id == Reg::PasswordCmd && value == 0;
    let acts = row.access == Access::Trigger || matches!(row.id, Reg::Cmd | Reg::MemCmd | Reg::PasswordCmd);
    (acts && !logs_in).then_some((row.id, value))
}

/// A controller and its client.
pub(crate) struct Bench {
    pub(crate) station: Arc<Station>,
    pub(crate) client: SmsdClient,
}

impl Bench {
    /// An SMSD-4.2LAN fresh from the factory, and a client that knows as much.
    pub(crate) fn new() -> Bench {
        Bench::of(WordOrder::LowFirst, SmsdOptions::default())
    }

    /// The same, logged in.
    pub(crate) async fn ready() -> Bench {
        let bench = Bench::new();
        bench.client.log_in().await.expect("the factory's password");
        bench
    }

    /// A controller with this word order, and any client.
    pub(crate) fn of(order: WordOrder, options: SmsdOptions) -> Bench {
        Bench::with(Model::Smsd42, order, Memory::factory(), options)
    }

    pub(crate) fn with(model: Model, order: WordOrder, memory: Memory, options: SmsdOptions) -> Bench {
        let word_order = match order {
            WordOrder::LowFirst => DriveOrder::LowFirst,
            WordOrder::HighFirst => DriveOrder::HighFirst,
        };
        let config = Config {
            model,
            word_order,
            port: 502,
            autonomous: false,
            firmware: Firmware::Modbus,
            protocol_version: VERSION_2,
        };
        let machine = Machine::power_up(Mechanics::new(None, 0.0), Vec::new(), |_| {
            Smsd::power_up(Instant::ZERO, config, memory, 0)
        });
        let world = World {
            machine,
            began: tokio::time::Instant::now(),
            faults: VecDeque::new(),
            otherwise: Fault::None,
            refusing: 0,
            room: ROOM,
            hanging: false,
            reconfigured: false,
            forgetful: false,
            open: 0,
            acts: Vec::new(),
            requests: 0,
            attempts: Vec::new(),
        };
        let station = Arc::new(Station { world: Mutex::new(world), line: watch::Sender::new(0) });
        let client = SmsdClient::new(reach(&station), options);
        Bench { station, client }
    }

    /// Another client of the same controller.
    pub(crate) fn another(&self, options: SmsdOptions) -> SmsdClient {
        SmsdClient::new(reach(&self.station), options)
    }

    // ---- trouble

    /// What becomes of the next requests.
    pub(crate) fn faults(&self, faults: impl IntoIterator<Item = Fault>) {
        self.station.world().faults = faults.into_iter().collect();
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
    pub(crate) fn change<R>(&self, act: impl FnOnce(&mut Smsd, Instant) -> R) -> R {
        let mut world = self.station.world();
        let now = world.now();
        world.machine.change(now, |drive| act(drive, now))
    }

    pub(crate) fn machine<R>(&self, act: impl FnOnce(&mut Machine<Smsd>, Instant) -> R) -> R {
        let mut world = self.station.world();
        let now = world.now();
        act(&mut world.machine, now)
    }

    /// What has acted since this was last asked.
    pub(crate) fn acts(&self) -> Vec<Act> {
        std::mem::take(&mut self.station.world().acts)
    }

    /// How many requests have arrived since this was last asked.
    pub(crate) fn requests(&self) -> u64 {
        std::mem::take(&mut self.station.world().requests)
    }

    /// How many connections the controller's end has not done with. One that the client has left may still hold what
    /// the client sent.
    pub(crate) fn open(&self) -> u32 {
        self.station.world().open
    }

    /// When it was tried to connect, since this was last asked.
    pub(crate) fn attempts(&self) -> Vec<tokio::time::Instant> {
        std::mem::take(&mut self.station.world().attempts)
    }
}

fn reach(station: &Arc<Station>) -> impl Connect + use<> {
    let station = Arc::clone(station);
    from_fn("stage", move || Arc::clone(&station).connect())
}

/// The text of an error.
pub(crate) fn text<T: std::fmt::Debug>(outcome: Result<T, Error>) -> String {
    outcome.expect_err("trouble was expected").to_string()
}

/// Runs something and answers how long it took.
pub(crate) async fn timed<T>(what: impl Future<Output = T>) -> (T, Duration) {
    let began = tokio::time::Instant::now();
    let outcome = what.await;
    (outcome, began.elapsed())
}
