//! A controller at the end of a link in memory, its client, and verbs that say what a test does.

use crate::link::{Fault, serve};
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use stepdrive_drive::smsd::{Config, Event, Memory, Quantity, Smsd as Drive, StandardSession, WordOrder};
use stepdrive_host::smsd::{Framing, Smsd, SmsdOptions, SmsdUsbClient};
use stepdrive_host::{Connect, Error, from_fn};
use stepdrive_proto::smsd::{PacketBuf, Taken, decode_request, encode_greeting, encode_reply};
use stepdrive_rig::machine::Machine;
use stepdrive_rig::mechanics::Mechanics;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Answer, Firmware, Reply, Request, VERSION_2};
use stepdrive_spec::time::Instant;
use tokio::io::DuplexStream;
use tokio::sync::watch;

pub(crate) const MS: Duration = Duration::from_millis(1);
pub(crate) const SECOND: Duration = Duration::from_secs(1);

/// Room on the link: less than a long request, so that some go out in pieces.
const ROOM: usize = 64;

/// Something that acted, in the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Act {
    Instruction(Opcode),
    Password,
}

/// What a test wants of its controller.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setup {
    pub(crate) model: Model,
    pub(crate) framing: Framing,
    pub(crate) firmware: Firmware,
    pub(crate) version: u8,
    pub(crate) options: SmsdOptions,
}

impl Default for Setup {
    /// An SMSD-4.2LAN fresh from the factory at its USB port, and a client that knows as much.
    fn default() -> Setup {
        Setup {
            model: Model::Smsd42,
            framing: Framing::Stuffed,
            firmware: Firmware::Modbus,
            version: VERSION_2,
            options: SmsdOptions::default(),
        }
    }
}

impl Setup {
    /// The same over TCP, with the standard firmware.
    pub(crate) fn raw() -> Setup {
        Setup { framing: Framing::Raw, firmware: Firmware::Standard, ..Setup::default() }
    }
}

/// A controller with its line.
pub(crate) struct Station {
    world: Mutex<World>,
    pub(crate) framing: Framing,
    firmware: Firmware,
    version: u8,
    /// Changes when all connections are to end.
    line: watch::Sender<u64>,
}

struct World {
    machine: Machine<Drive>,
    began: tokio::time::Instant,
    /// What is to become of the next requests.
    faults: VecDeque<Fault>,
    /// What becomes of the others.
    otherwise: Fault,
    /// How many attempts to connect are refused.
    refusing: u32,
    /// Room on the next connections, each way.
    room: usize,
    reconfigured: bool,
    /// The next request comes from somebody who has not logged in.
    forgetful: bool,
    /// Connections over TCP do not begin with a greeting.
    rude: bool,
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

    pub(crate) fn now(&self) -> Instant {
        self.world().now()
    }

    pub(crate) fn session(&self) -> StandardSession {
        if self.framing == Framing::Raw { StandardSession::lan() } else { StandardSession::usb() }
    }

    /// What a new connection begins with.
    pub(crate) fn greeting(&self) -> Vec<u8> {
        let mut packet = PacketBuf::new();
        if self.framing == Framing::Raw && !self.world().rude {
            encode_greeting(&mut packet, self.version);
        }
        packet.to_vec()
    }

    /// Answers a packet.
    pub(crate) fn answer(&self, session: &mut StandardSession, taken: &Taken<'_>) -> Option<Reply> {
        let mut world = self.world();
        world.requests += 1;
        if std::mem::take(&mut world.forgetful) {
            *session = self.session();
        }
        let request = taken.packet.and_then(|packet| decode_request(&packet, self.firmware));
        let now = world.now();
        let reply = world.machine.handle_standard(now, session, request.as_ref().map_err(|error| *error))?;
        if let Ok(request) = &request {
            world.acts.extend(act(request, &reply));
        }
        while let Some(event) = world.machine.drive_mut().poll_event() {
            world.reconfigured |= event == Event::NetworkConfigured;
        }
        Some(reply)
    }

    /// A reply on the wire.
    pub(crate) fn encoded(&self, id: u8, reply: &Reply) -> Vec<u8> {
        let mut packet = PacketBuf::new();
        encode_reply(&mut packet, self.framing, self.version, id, reply);
        packet.to_vec()
    }

    pub(crate) fn next_fault(&self) -> Fault {
        let mut world = self.world();
        let otherwise = world.otherwise.clone();
        world.faults.pop_front().unwrap_or(otherwise)
    }

    /// Whether the connection ends because the controller has new LAN parameters.
    pub(crate) fn has_moved(&self) -> bool {
        std::mem::take(&mut self.world().reconfigured) && self.framing == Framing::Raw
    }

    pub(crate) fn line(&self) -> watch::Receiver<u64> {
        self.line.subscribe()
    }

    /// Counts a connection for as long as what this returns is kept.
    pub(crate) fn opened(self: Arc<Station>) -> Open {
        self.world().open += 1;
        Open(self)
    }

    fn connect(self: Arc<Station>) -> io::Result<DuplexStream> {
        let room = {
            let mut world = self.world();
            world.attempts.push(tokio::time::Instant::now());
            if world.refusing > 0 {
                world.refusing -= 1;
                return Err(io::ErrorKind::ConnectionRefused.into());
            }
            world.room
        };
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
fn act(request: &Request, reply: &Reply) -> Option<Act> {
    match (request, reply) {
        (Request::Command(word), Reply::Powerstep01(_)) => {
            let opcode = Instruction::from_word(*word).expect("it was carried out").opcode;
            let name = opcode.name();
            let acts = !name.starts_with("GET_") || opcode == Opcode::GetStatusAndClr;
            let acts = acts && !name.starts_with("SET_") && !name.ends_with("_RELE");
            (acts && opcode != Opcode::StatusInEvent).then_some(Act::Instruction(opcode))
        }
        (Request::SetPassword(_), Reply::Response(Answer { code, .. })) if !code.is_error() => {
            Some(Act::Password)
        }
        _ => None,
    }
}

/// A controller and its client.
pub(crate) struct Bench {
    pub(crate) station: Arc<Station>,
    pub(crate) client: SmsdUsbClient,
}

impl Bench {
    pub(crate) fn new() -> Bench {
        Bench::of(&Setup::default())
    }

    /// A controller at its USB port, a client logged in.
    pub(crate) async fn ready() -> Bench {
        Bench::ready_as(&Setup::default()).await
    }

    pub(crate) async fn ready_as(setup: &Setup) -> Bench {
        let bench = Bench::of(setup);
        bench.client.log_in().await.expect("the factory's password");
        bench
    }

    pub(crate) fn of(setup: &Setup) -> Bench {
        let config = Config {
            model: setup.model,
            word_order: WordOrder::LowFirst,
            port: 502,
            autonomous: false,
            firmware: setup.firmware,
            protocol_version: setup.version,
        };
        let machine = Machine::power_up(Mechanics::new(None, 0.0), Vec::new(), |_| {
            Drive::power_up(Instant::ZERO, config, Memory::factory(), 0)
        });
        let world = World {
            machine,
            began: tokio::time::Instant::now(),
            faults: VecDeque::new(),
            otherwise: Fault::None,
            refusing: 0,
            room: ROOM,
            reconfigured: false,
            forgetful: false,
            rude: false,
            open: 0,
            acts: Vec::new(),
            requests: 0,
            attempts: Vec::new(),
        };
        let station = Arc::new(Station {
            world: Mutex::new(world),
            framing: setup.framing,
            firmware: setup.firmware,
            version: setup.version,
            line: watch::Sender::new(0),
        });
        let client = SmsdUsbClient::new(reach(&station), setup.framing, setup.options);
        Bench { station, client }
    }

    /// Another client of the same controller.
    pub(crate) fn another(&self, options: SmsdOptions) -> SmsdUsbClient {
        SmsdUsbClient::new(reach(&self.station), self.station.framing, options)
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

    /// The controller forgets who is logged in, and keeps the connections.
    pub(crate) fn forget_sessions(&self) {
        self.station.world().forgetful = true;
    }

    pub(crate) fn greet_nobody(&self) {
        self.station.world().rude = true;
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
    pub(crate) fn acts(&self) -> Vec<Act> {
        std::mem::take(&mut self.station.world().acts)
    }

    /// How many packets have arrived since this was last asked.
    pub(crate) fn requests(&self) -> u64 {
        std::mem::take(&mut self.station.world().requests)
    }

    /// How many connections the controller's end has not done with.
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
    from_fn("stage", move || std::future::ready(Arc::clone(&station).connect()))
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
