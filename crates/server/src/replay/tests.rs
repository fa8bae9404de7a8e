//! Recordings made without sockets, at rig times that the tests choose.

use super::*;
use crate::control::Control;
use crate::drive::Drive;
use crate::link::Outgoing;
use crate::recording::{Header, RecordedDrive, Recorder, Via};
use crate::talk::{Heard, LineTalk, ModbusTalk, PacketTalk};
use crate::traffic::Peer;
use crate::world::World;
use proptest::prelude::*;
use std::fs;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_drive::smd3::Stored;
use stepdrive_drive::smsd::Memory;
use stepdrive_proto::modbus::{Adu, Split, encode_request, split};
use stepdrive_proto::smd3::{Line, LineReader};
use stepdrive_proto::smsd::{self, Framing, PacketBuf, PacketReader};
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::file::{ControllerSection, RigFile};
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{self, Counter};
use tempfile::TempDir;

/// Two SMSDs whose programs wait for each other by wires, and an SMD3 that gets warm.
const RIG: &str = r#"
    [rig]
    clock = "CLOCK"
    seed = 5
    [[drive]]
    name = "a"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:5020"
    autonomous = true
    [drive.mechanics]
    travel = [-40.0, 40.0]
    [[drive.switch]]
    input = "IN1"
    closed = [5.0, 9.0]
    [[drive]]
    name = "b"
    model = "SMSD-8.0LAN"
    modbus_tcp = "127.0.0.1:5021"
    autonomous = true
    [[drive]]
    name = "u"
    model = "SMD3"
    serial_tcp = "127.0.0.1:5022"
    [drive.mechanics]
    travel = [-100.0, 100.0]
    [[drive.switch]]
    input = "LIMIT_POSITIVE"
    closed = [50.0, 100.0]
    [drive.winding]
    time_constant = 1.0
    [[wire]]
    from = "a.relay"
    to = "b.CONTINUE"
    [[wire]]
    from = "b.relay"
    to = "a.CONTINUE"
    delay = "30us"
"#;

/// The clients are those of the drives in turn, then one of the first by USB.
const DRIVES: usize = 3;
const USB: usize = DRIVES;

/// Something that goes in at a rig time.
#[derive(Clone, Debug)]
enum Input {
    Says {
        client: usize,
        bytes: Vec<u8>,
    },
    Does(String),
    /// Something outside the rig goes wrong.
    Counts(Counter),
    /// Somebody looks, and nothing is recorded.
    Looks(usize),
}

/// A rig that is recorded.
struct Bench {
    world: Arc<World>,
    drives: Vec<Drive>,
    clients: Vec<Client>,
    folder: TempDir,
    /// The time and bytes of every reply.
    replies: Vec<(Instant, Vec<u8>)>,
}

struct Client {
    drive: usize,
    conn: u64,
    talk: Talk,
}

enum Talk {
    Modbus(ModbusTalk),
    Lines(LineTalk, Box<LineReader>),
    Packets(Box<PacketTalk>),
}

impl Bench {
    fn start(clock: &str) -> Bench {
        let text = RIG.replace("CLOCK", clock);
        let rig = RigFile::parse(&text).expect("a rig");
        let (mut machines, mut recorded) = (Vec::new(), Vec::new());
        for drive in &rig.drives {
            let (machine, record) = match &drive.controller {
                ControllerSection::Smsd(section) => {
                    let memory = memory();
                    let record = RecordedDrive::smsd(&drive.name, &memory);
                    (AnyMachine::Smsd(Box::new(section.power_up(drive, memory))), record)
                }
                ControllerSection::Smd3(section) => {
                    let record = RecordedDrive::smd3(&drive.name, &Stored::Nothing);
                    (AnyMachine::Smd3(Box::new(section.power_up(drive, Stored::Nothing))), record)
                }
            };
            machines.push(machine);
            recorded.push(record);
        }
        let folder = TempDir::new().expect("a temporary folder");
        let world = Arc::new(World::new(rig, machines));
        let header = Header::new(text, recorded);
        world.record(Recorder::create(&folder.path().join("recording"), &header).expect("a new file"));
        let drives: Vec<Drive> =
            (0..DRIVES).map(|number| Drive::new(Arc::clone(&world), number, Arc::new(|_| {}))).collect();
        let open = |number| Client::open(&drives, number, world.rig());
        let clients = (0..=USB).map(open).collect();
        Bench { world, drives, clients, folder, replies: Vec::new() }
    }

    fn put(&mut self, input: &Input) {
        match input {
            Input::Says { client, bytes } => self.say(*client, bytes),
            Input::Does(action) => Control::new(Arc::clone(&self.world)).act(action).expect("an action"),
            Input::Counts(counter) => self.drives[0].count(*counter),
            Input::Looks(drive) => self.world.visit(*drive, |_, _| ()),
        }
    }

    /// As a station does.
    fn say(&mut self, client: usize, bytes: &[u8]) {
        let client = &mut self.clients[client];
        let drive = &self.drives[client.drive];
        let (mut out, conn) = (Outgoing::default(), client.conn);
        let at = drive.visit(|group, member| {
            let heard = match &mut client.talk {
                Talk::Modbus(talk) => {
                    let Split::Frame { frame, .. } = split(bytes) else { panic!("no frame") };
                    talk.hear(group, member, &frame, &mut out)
                }
                Talk::Lines(talk, reader) => {
                    let mut rest = bytes;
                    let line: Line<'_> = reader.take(&mut rest).expect("a line");
                    talk.hear(group, member, line, &mut out).0
                }
                Talk::Packets(talk) => {
                    let mut reader = PacketReader::new(Framing::Stuffed);
                    let packet = reader.take(Instant::ZERO, &mut &*bytes).expect("a packet");
                    talk.hear(group, member, &packet, &mut out)
                }
            };
            drive.record(group, conn, bytes, &out, heard);
            group.now()
        });
        self.replies.push((at, out.bytes().to_vec()));
    }

    /// Ends the recording, and replays it.
    fn end(self) -> (Replayed, Vec<(Instant, Vec<u8>)>) {
        Control::new(Arc::clone(&self.world)).end_recording();
        let recording = fs::read(self.folder.path().join("recording")).expect("a recording");
        let replayed = replay(recording.as_slice()).expect("it can be replayed");
        assert!(replayed.identical && !replayed.cut_short, "{replayed}");
        (replayed, self.replies)
    }
}

impl Client {
    fn open(drives: &[Drive], number: usize, rig: &RigFile) -> Client {
        let usb = (number == USB).then_some(Via::Usb);
        let drive = if number == USB { 0 } else { number };
        let conn = drives[drive].open(usb, Peer::Panel);
        let talk = match (&rig.drives[drive].controller, usb) {
            (ControllerSection::Smsd(_), Some(via)) => {
                Talk::Packets(Box::new(PacketTalk::new(via, rig.seed, conn)))
            }
            (ControllerSection::Smsd(_), None) => Talk::Modbus(ModbusTalk::new(rig.seed, conn)),
            (ControllerSection::Smd3(_), _) => Talk::Lines(LineTalk::new(rig.seed, conn), Box::default()),
        };
        Client { drive, conn, talk }
    }
}

/// A program that waits for the other's relay, switches its own, moves, and begins again.
fn memory() -> Memory {
    let program = [
        (Opcode::SetWait, 1),
        (Opcode::WaitContinue, 0),
        (Opcode::SetRele, 0),
        (Opcode::MoveF, 40),
        (Opcode::ClrRele, 0),
        (Opcode::GotoProgram, 0),
    ];
    let words = program.map(|(opcode, position)| Instruction::with_position(opcode, position).word());
    let mut memory = Memory::factory();
    memory.load_program(0, &words);
    memory
}

fn frame(transaction: u16, unit: u8, request: &Request) -> Vec<u8> {
    let mut adu = Adu::new();
    encode_request(&mut adu, transaction, unit, request).expect("well formed");
    adu.to_vec()
}

fn write(reg: Reg, values: &[u16]) -> Request {
    Request::WriteRegisters { address: reg.info().address, values: values.iter().copied().collect() }
}

fn requests() -> impl Strategy<Value = Request> {
    let read =
        |reg: Reg, count| Request::ReadWords { table: reg.info().table, address: reg.info().address, count };
    prop_oneof![
        Just(write(Reg::PasswordLow32, &[0xCDEF, 0x89AB, 0x4567, 0x0123, 0])),
        (0..0x34_u16, 16..2000_u16, 0..600_u16)
            .prop_map(|(code, speed, position)| write(Reg::TargetSpeed, &[speed, position, 0, 0, code])),
        any::<bool>().prop_map(|value| Request::WriteCoil { address: Reg::Relay.info().address, value }),
        Just(read(Reg::AbsPos, 2)),
        Just(read(Reg::HwMajor, 4)),
    ]
}

fn packet(id: u8, request: &standard::Request) -> Vec<u8> {
    let mut buffer = PacketBuf::new();
    smsd::encode_request(&mut buffer, Framing::Stuffed, 2, id, request);
    buffer.to_vec()
}

/// What is said over USB: logging in, any instruction, programs, counters, and what is no packet.
fn packets() -> impl Strategy<Value = Vec<u8>> {
    use standard::Request;
    let word = |(opcode, data): (u8, u32)| data << 10 | u32::from(opcode) << 4;
    let instruction = (0..0x40_u8, prop_oneof![0..8_u32, 0..2000_u32, 0..0x40_0000_u32]).prop_map(word);
    let requests = prop_oneof![
        2 => Just(Request::Authorise(0x0123_4567_89AB_CDEF)),
        8 => instruction.prop_map(Request::Command),
        1 => Just(Request::WriteMemory { area: 1, words: [0x10, 0x190].into_iter().collect() }),
        1 => Just(Request::ReadMemory { area: 0 }),
        1 => Just(Request::GetErrors),
        1 => Just(Request::GetLan),
    ];
    prop_oneof![
        20 => (any::<u8>(), requests).prop_map(|(id, request)| packet(id, &request)),
        1 => Just(b"\xFA\xFB".to_vec()),
        1 => Just(b"\xFA\x01\xFE\xFB".to_vec()),
        1 => Just([&b"\xFA"[..], &[7; 3000], b"\xFB"].concat()),
    ]
}

fn lines() -> impl Strategy<Value = String> {
    prop_oneof![
        Just("RUNV,+\r"),
        Just("RUNV,-\n"),
        Just("STOP\r"),
        Just("SSTOP\r"),
        Just("TMOT\n"),
        Just("PACT\n"),
        Just("VMAX,400\n"),
        Just("BAKE,1\n"),
        Just("STORE\n"),
        Just("LOAD\n"),
        Just("CLR\n"),
        Just("nonsense\r"),
    ]
    .prop_map(str::to_owned)
}

fn actions() -> impl Strategy<Value = String> {
    prop_oneof![
        Just("input a.IN1 pulse 1ms x20 every 3ms"),
        Just("input b.CONTINUE 1 for 2ms"),
        Just("fault a.IN1 bounce"),
        Just("power a off for 5ms"),
        Just("power u off"),
        Just("power u on"),
        Just("wire a.relay b.CONTINUE cut"),
        Just("wire a.relay b.CONTINUE mend"),
        Just("fault b.reply-damage 50%"),
        Just("fault a.reply-id 50%"),
        Just("fault a.connection cut for 3ms"),
        Just("fault u.reply-drop 30%"),
        Just("fault u.thermocouple open for 9ms"),
        Just("fault u.temperature high"),
        Just("fault a.rotor blocked for 20ms"),
        Just("input u.JOYSTICK 1"),
        Just("input u.JOYSTICK_CW pulse 4ms"),
        Just("fault b.exception 06 50%"),
        Just("fault u.flash worn"),
        Just("fault b.motor short for 1ms"),
    ]
    .prop_map(str::to_owned)
}

fn inputs() -> impl Strategy<Value = Vec<(Duration, Input)>> {
    let says = (0..2_usize, any::<u16>(), prop_oneof![4 => Just(1_u8), 1 => Just(7)], requests());
    let input = prop_oneof![
        4 => says.prop_map(|(client, id, unit, request)| Input::Says { client, bytes: frame(id, unit, &request) }),
        3 => lines().prop_map(|line| Input::Says { client: 2, bytes: line.into_bytes() }),
        3 => packets().prop_map(|bytes| Input::Says { client: USB, bytes }),
        1 => prop_oneof![Just(Counter::TimeOut), Just(Counter::Fram)].prop_map(Input::Counts),
        2 => actions().prop_map(Input::Does),
        2 => (0..DRIVES).prop_map(Input::Looks),
    ];
    // Whole milliseconds, since each has to be an instant of every clock. Some things happen at one instant.
    let step = prop_oneof![1 => Just(0_u64), 3 => 1..40_u64, 1 => 100..3000_u64];
    prop::collection::vec((step.prop_map(Duration::from_millis), input), 1..60)
}

/// Lets the inputs go in while wall time passes by itself.
async fn run_by_wall_time(
    inputs: &[(Duration, Input)],
    clock: &str,
    speed: u32,
) -> (Replayed, Vec<(Instant, Vec<u8>)>) {
    let mut bench = Bench::start(clock);
    let keepers: Vec<_> = (0..bench.world.groups())
        .map(|group| {
            let world = Arc::clone(&bench.world);
            tokio::spawn(async move {
                loop {
                    world.wait(group).await;
                    world.visit_group(group, |_| ());
                }
            })
        })
        .collect();
    let mut at = Instant::ZERO;
    for (step, input) in inputs {
        tokio::time::advance(*step / speed).await;
        at = at + *step;
        assert_eq!(bench.world.clock().now(), at);
        bench.put(input);
    }
    for keeper in keepers {
        keeper.abort();
    }
    bench.end()
}

/// Lets the inputs go in on a clock that only jumps.
fn run_by_jumps(inputs: &[(Duration, Input)]) -> (Replayed, Vec<(Instant, Vec<u8>)>) {
    let mut bench = Bench::start("paused");
    let mut at = Instant::ZERO;
    for (step, input) in inputs {
        at = at + *step;
        bench.world.clock().jump_to(at).expect("forward");
        bench.put(input);
    }
    bench.end()
}

fn block_on<R>(run: impl Future<Output = R>) -> R {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
    runtime.expect("a runtime").block_on(run)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn the_same_inputs_by_rig_time_get_the_same_replies_at_every_speed_of_the_clock(inputs in inputs()) {
        let (real, replies) = block_on(run_by_wall_time(&inputs, "real", 1));
        for (other, others) in [block_on(run_by_wall_time(&inputs, "x1000", 1000)), run_by_jumps(&inputs)] {
            prop_assert_eq!(&others, &replies);
            prop_assert_eq!((&other.digest, &other.state), (&real.digest, &real.state));
        }
    }

    #[test]
    fn it_does_not_matter_into_how_many_steps_time_was_cut(
        inputs in inputs(),
        looks in prop::collection::vec((0..DRIVES, 0..3_000_000_000_u64), 0..40),
    ) {
        let inputs: Vec<_> = inputs.into_iter().filter(|(_, input)| !matches!(input, Input::Looks(_))).collect();
        let mut at = Duration::ZERO;
        let mut all: Vec<(Duration, Input)> = Vec::new();
        for (step, input) in &inputs {
            at += *step;
            all.push((at, input.clone()));
        }
        let within = u64::try_from(at.as_nanos()).unwrap_or(0) + 1;
        all.extend(looks.iter().map(|(drive, time)| (Duration::from_nanos(time % within), Input::Looks(*drive))));
        // Stable: what is recorded keeps its order.
        all.sort_by_key(|(at, _)| *at);
        let mut before = Duration::ZERO;
        let steps = all.into_iter().map(|(at, input)| (at.saturating_sub(std::mem::replace(&mut before, at)), input));
        let steps: Vec<_> = steps.collect();
        prop_assert_eq!(run_by_jumps(&inputs), run_by_jumps(&steps));
    }
}

#[test]
fn a_rig_that_cannot_keep_up_replays() {
    let mut bench = Bench::start("paused");
    let end = Instant::from_nanos(60_000_000);
    // More than a visit's budget, and the programs go on at the very instants of the pulses.
    for action in [
        "a.CONTINUE pulse 1us x30000 every 2us",
        "b.CONTINUE pulse 1us x30000 every 2us",
        "a.IN1 pulse 1us x20000 every 3us",
    ] {
        bench.put(&Input::Does(format!("input {action}")));
    }
    bench.world.clock().jump_to(end).expect("forward");
    let mut behind = 0;
    for id in 0..5 {
        let toggle = Request::WriteCoil { address: Reg::Relay.info().address, value: id % 2 == 0 };
        bench.say(0, &frame(id, 1, &toggle));
        behind += usize::from(bench.replies.last().is_some_and(|(at, _)| *at < end));
    }
    assert!(behind > 0);
    bench.end();
}

#[test]
fn actions_at_one_instant_replay_in_their_order_with_what_follows_from_each() {
    // The first lets a's program go on, whose relay lets b's go on, all in no time, before the second would hold b's up.
    let bench = Bench::start("paused");
    bench.world.clock().jump_to(Instant::from_nanos(7_000_000)).expect("forward");
    let rig = bench.world.rig().clone();
    bench.world.visit(0, |group, _| {
        for text in [
            "input a.CONTINUE 1",
            "input b.CONTINUE 0",
            "power a off",
            "power a on",
            "wire a.relay b.CONTINUE cut",
        ] {
            let action = stepdrive_rig::action::Action::parse(text, &rig).expect("an action");
            bench.world.apply_to(group, &action);
        }
    });
    bench.end();
}

#[test]
fn a_request_on_a_line_that_is_cut_and_one_that_was_not_stored_replay() {
    let mut bench = Bench::start("paused");
    bench.say(0, &frame(1, 1, &write(Reg::PasswordLow32, &[0xCDEF, 0x89AB, 0x4567, 0x0123, 0])));
    let request = frame(2, 1, &write(Reg::WorkCurrent, &[30]));
    bench.say(0, &request);
    let (drive, client) = (&bench.drives[0], &mut bench.clients[0]);
    drive.visit(|group, _| {
        let (Talk::Modbus(talk), Split::Frame { frame, .. }) = (&mut client.talk, split(&request)) else {
            return;
        };
        let mut out = Outgoing::default();
        out.push(&[1]);
        talk.not_stored(&frame, &mut out);
        assert_eq!(out.bytes()[7..], [0x90, 4]);
        drive.record_not_stored(group, client.conn, &[], &out);
    });
    bench.put(&Input::Does("fault a.connection cut".to_owned()));
    bench.say(0, &request);
    let (replayed, replies) = bench.end();
    assert_eq!(replayed.requests, 3);
    assert!(replies[2].1.is_empty());
}

#[test]
fn what_was_counted_and_a_packet_that_was_not_stored_replay() {
    let mut bench = Bench::start("paused");
    bench.world.clock().jump_to(Instant::from_nanos(2_000_000_000)).expect("forward");
    bench.say(USB, &packet(1, &standard::Request::Authorise(0x0123_4567_89AB_CDEF)));
    bench.say(USB, &packet(2, &standard::Request::SetPassword(7)));
    bench.put(&Input::Counts(Counter::Fram));
    let (drive, client) = (&bench.drives[0], &mut bench.clients[USB]);
    drive.visit(|group, member| {
        let Talk::Packets(talk) = &mut client.talk else { return };
        let mut out = Outgoing::default();
        out.push(&[1]);
        talk.not_stored(group, member, &mut out);
        assert_eq!(out.bytes()[9..10], [standard::Code::ErrorWrite.number()]);
        drive.record_not_stored(group, client.conn, &[], &out);
    });
    bench.say(USB, &packet(3, &standard::Request::GetErrors));
    let (_, replies) = bench.end();
    assert_eq!(replies[2].1[7 + 4 * Counter::Fram as usize], 1);
}

#[test]
fn a_recording_with_centuries_in_it_can_be_bounded() {
    let mut bench = Bench::start("paused");
    bench.put(&Input::Does("input a.CONTINUE pulse 1us x20000 every 2us".to_owned()));
    bench.world.clock().jump_to(Instant::from_nanos(30_000_000)).expect("forward");
    Control::new(Arc::clone(&bench.world)).end_recording();
    let recording = fs::read(bench.folder.path().join("recording")).expect("a recording");
    let error = replay_within(recording.as_slice(), 10_000).expect_err("too much");
    assert!(matches!(error, ReplayError::TooMuch { line: 7 }), "{error}");
    assert!(replay_within(recording.as_slice(), 1_000_000).is_ok_and(|replayed| replayed.identical));
}

#[test]
fn a_line_that_was_cut_is_told_from_one_that_did_not_answer() {
    let heard = [Heard::Taken, Heard::Cut];
    let replayed = heard.map(|heard| {
        let bench = Bench::start("paused");
        let request = frame(1, 9, &write(Reg::WorkCurrent, &[30]));
        let (drive, conn) = (&bench.drives[0], bench.clients[0].conn);
        drive.visit(|group, _| drive.record(group, conn, &request, &Outgoing::default(), heard));
        Control::new(Arc::clone(&bench.world)).end_recording();
        let recording = fs::read(bench.folder.path().join("recording")).expect("a recording");
        replay(recording.as_slice()).expect("it can be replayed")
    });
    assert!(replayed[0].identical);
    let first = replayed[1].first_difference.as_ref().expect("a difference");
    assert_eq!(
        (first.recorded.means.as_str(), first.replayed.means.as_str()),
        ("the connection was cut", "no reply")
    );
}
