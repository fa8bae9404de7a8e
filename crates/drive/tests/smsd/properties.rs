//! What holds whatever clients ask, whatever the inputs do, and however time passes.

use crate::bench::{Bench, PASSWORD, SECOND, config};
use crate::standard::requests::packet;
use core::time::Duration;
use proptest::collection::vec;
use proptest::prelude::*;
use stepdrive_drive::smsd::{Config, Session, StandardSession, WordOrder};
use stepdrive_spec::modbus::{Exception, Reply, Request, Table};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{REGISTERS, Reg};
use stepdrive_spec::smsd::ring;
use stepdrive_spec::smsd::standard::{self, Malformed};
use stepdrive_spec::smsd::status::{MotStatus, Status};

/// Something that happens to a controller.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "a test has a few dozen of them")]
enum Happening {
    /// A request of one of two clients: `true` is the one that was authorised at first.
    Request(bool, Request),
    /// A packet of the standard protocol, over USB or over LAN.
    Packet(bool, Result<standard::Request, Malformed>),
    Input(Input, bool),
    StepClock,
    Short(bool),
    Overheat(bool),
    /// Off, so many nanoseconds, and on with the inputs so and the front panel so.
    PowerCycle(u64, u8, bool),
    Pass(u64),
}

/// How a controller answers.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "a test has a few dozen of them")]
enum Answer {
    Modbus(Result<Reply, Exception>),
    Standard(Option<standard::Reply>),
}

/// The clients besides the one of the bench.
#[derive(Clone, Debug)]
struct Others {
    modbus: Session,
    usb: StandardSession,
    lan: StandardSession,
}

/// Addresses near the listed ones, and a few from anywhere.
fn address() -> impl Strategy<Value = u16> {
    let row = prop::sample::select(&REGISTERS[..]);
    let near = (row, 0..4_u16).prop_map(|(row, off)| row.address.wrapping_add(off));
    prop_oneof![8 => near, 1 => any::<u16>()]
}

fn table() -> impl Strategy<Value = Table> {
    prop::sample::select(vec![
        Table::Coils,
        Table::DiscreteInputs,
        Table::InputRegisters,
        Table::HoldingRegisters,
    ])
}

fn read() -> impl Strategy<Value = Request> {
    (table(), address(), 1..30_u16).prop_map(|(table, address, count)| {
        if table.is_bits() {
            Request::ReadBits { table, address, count }
        } else {
            Request::ReadWords { table, address, count }
        }
    })
}

/// A write that is mostly refused, for one reason or another.
fn wild_write() -> impl Strategy<Value = Request> {
    let word = prop_oneof![0..64_u16, any::<u16>()];
    prop_oneof![
        (address(), word.clone()).prop_map(|(address, value)| Request::WriteRegister { address, value }),
        (address(), vec(word, 1..12)).prop_map(|(address, values)| Request::WriteRegisters {
            address,
            values: values.into_iter().collect()
        }),
        (address(), any::<bool>()).prop_map(|(address, value)| Request::WriteCoil { address, value }),
        (address(), vec(any::<bool>(), 1..9)).prop_map(|(address, values)| Request::WriteCoils {
            address,
            values: values.into_iter().collect()
        }),
    ]
}

/// A write of a value that is within the range of its register.
fn valid_write() -> impl Strategy<Value = Request> {
    let rows: Vec<_> = REGISTERS.iter().filter(|row| row.table == Table::HoldingRegisters).collect();
    (prop::sample::select(rows), any::<prop::sample::Index>()).prop_map(|(row, index)| {
        let (min, max) = row.range(Model::Smsd42);
        let span = usize::try_from(max - min).expect("not negative").saturating_add(1);
        let value = min + i64::try_from(index.index(span)).expect("within 32 bits");
        let [low, second, third, high, ..] = value.to_le_bytes();
        let words = [u16::from_le_bytes([low, second]), u16::from_le_bytes([third, high])];
        let values = words.into_iter().take(row.kind.width().into()).collect();
        Request::WriteRegisters { address: row.address, values }
    })
}

/// A command, with a speed, a position and an input that it can use, in one write.
fn command() -> impl Strategy<Value = Request> {
    let codes: Vec<u16> =
        INSTRUCTIONS.iter().filter(|info| info.in_cmd).map(|info| info.code.into()).collect();
    let position = prop_oneof![-5000..5000_i32, ring::MIN..=ring::MAX];
    (15..3000_u16, position, 0..9_u16, prop::sample::select(codes)).prop_map(
        |(speed, position, input, code)| {
            let bytes = position.to_le_bytes();
            let [low, high] =
                [u16::from_le_bytes([bytes[0], bytes[1]]), u16::from_le_bytes([bytes[2], bytes[3]])];
            let values = [speed, low, high, input, code].into_iter().collect();
            Request::WriteRegisters { address: Reg::TargetSpeed.info().address, values }
        },
    )
}

/// What is done to a controller from outside.
fn trouble() -> impl Strategy<Value = Happening> {
    prop_oneof![
        Just(Happening::StepClock),
        prop::bool::weighted(0.3).prop_map(Happening::Short),
        prop::bool::weighted(0.3).prop_map(Happening::Overheat),
        (0..2_000_000_000_u64, any::<u8>(), any::<bool>())
            .prop_map(|(off, levels, autonomous)| Happening::PowerCycle(off, levels, autonomous)),
    ]
}

fn happening() -> impl Strategy<Value = Happening> {
    let write = prop_oneof![2 => wild_write(), 2 => valid_write(), 5 => command()];
    let request = prop_oneof![1 => read(), 3 => write];
    let pass = prop_oneof![0..3_u64, 0..5_000_000_u64, 0..2_000_000_000_u64];
    prop_oneof![
        6 => (prop::bool::weighted(0.95), request).prop_map(|(first, request)| Happening::Request(first, request)),
        4 => (any::<bool>(), packet()).prop_map(|(usb, packet)| Happening::Packet(usb, packet)),
        1 => (prop::sample::select(&Input::ALL[..]), any::<bool>())
            .prop_map(|(input, level)| Happening::Input(input, level)),
        1 => trouble(),
        3 => pass.prop_map(Happening::Pass),
    ]
}

fn instruction() -> impl Strategy<Value = Instruction> {
    let opcodes: Vec<Opcode> = INSTRUCTIONS.iter().map(|info| info.opcode).collect();
    let data = prop_oneof![0..40_i32, 15..3000_i32, -3000..0_i32, any::<i32>()];
    (prop::sample::select(opcodes), data).prop_map(|(opcode, data)| Instruction::with_position(opcode, data))
}

/// A controller with programs in two of its memories, before anything has happened, and other clients; somebody has logged
/// in over USB.
fn prepared(order: WordOrder, programs: &[Vec<Instruction>; 2]) -> (Bench, Others) {
    let config = Config { word_order: order, ..config(Model::Smsd42) };
    let mut bench = Bench::with(config, stepdrive_drive::smsd::Memory::factory(), 0);
    for (area, program) in (0..).zip(programs) {
        bench.store(area, program);
    }
    bench.run_for(SECOND);
    let mut usb = StandardSession::usb();
    bench.drive.handle_standard(bench.now, &mut usb, Ok(&standard::Request::Authorise(PASSWORD)));
    assert!(usb.is_authorised());
    (bench, Others { modbus: Session::new(), usb, lan: StandardSession::lan() })
}

fn word_order() -> impl Strategy<Value = WordOrder> {
    prop::sample::select(vec![WordOrder::LowFirst, WordOrder::HighFirst])
}

fn programs() -> impl Strategy<Value = [Vec<Instruction>; 2]> {
    [vec(instruction(), 1..20), vec(instruction(), 1..20)]
}

/// Lets it happen, and answers what the controller answered.
fn happen(bench: &mut Bench, others: &mut Others, happening: &Happening) -> Option<Answer> {
    match happening {
        Happening::Request(first, request) => {
            if !first {
                core::mem::swap(&mut bench.session, &mut others.modbus);
            }
            let reply = bench.request(request);
            if !first {
                core::mem::swap(&mut bench.session, &mut others.modbus);
            }
            return Some(Answer::Modbus(reply));
        }
        Happening::Packet(usb, packet) => {
            let session = if *usb { &mut others.usb } else { &mut others.lan };
            let packet = packet.as_ref().map_err(|malformed| *malformed);
            return Some(Answer::Standard(bench.drive.handle_standard(bench.now, session, packet)));
        }
        Happening::Input(input, level) => bench.input(*input, *level),
        Happening::StepClock => bench.drive.step_clock(bench.now),
        Happening::Short(shorted) => bench.drive.short_motor(bench.now, *shorted),
        Happening::Overheat(overheated) => bench.drive.overheat(bench.now, *overheated),
        Happening::PowerCycle(off, levels, autonomous) => {
            bench.drive.set_panel(*autonomous, Some(levels % 4));
            bench.drive.switch_off(bench.now);
            bench.run_for(Duration::from_nanos(*off));
            bench.drive.switch_on(bench.now, *levels);
            // The first packet that comes ends a login from before.
            for session in [&mut others.usb, &mut others.lan] {
                bench.drive.handle_standard(bench.now, session, Ok(&standard::Request::GetVersions));
                assert!(!session.is_authorised());
            }
        }
        Happening::Pass(nanos) => bench.run_for(Duration::from_nanos(*nanos)),
    }
    None
}

/// Whether what happened, so answered, must have changed nothing. An attempt to log in may always change the session.
fn must_change_nothing(happening: &Happening, answer: Option<&Answer>) -> bool {
    match answer {
        None => false,
        Some(Answer::Modbus(reply)) => matches!(reply, Err(_) | Ok(Reply::Bits(_) | Reply::Words(_))),
        Some(Answer::Standard(reply)) => match reply {
            Some(standard::Reply::Response(answer)) => {
                let login = matches!(happening, Happening::Packet(_, Ok(standard::Request::Authorise(_))));
                answer.code.is_error() && !(login && answer.code == standard::Code::ErrorAccess)
            }
            Some(standard::Reply::Powerstep01(_)) => false,
            Some(
                standard::Reply::Memory { .. }
                | standard::Reply::Lan(_)
                | standard::Reply::Errors(_)
                | standard::Reply::Versions(_),
            )
            | None => true,
        },
    }
}

/// Whether this is the speed of a step by the step input, in whichever microstep mode.
fn is_step(speed: f64) -> bool {
    (0..=7).any(|mode| speed.to_bits() == (4e6 / f64::from(1 << mode)).to_bits())
}

/// What holds at every instant.
fn check(bench: &mut Bench) {
    let due = bench.drive.next_wake();
    assert!(due.is_none_or(|(at, _)| at >= bench.now), "{due:?} is in the past of {}", bench.now);
    let status = bench.drive.status(bench.now);
    let position = bench.drive.position(bench.now);
    assert!((ring::MIN..=ring::MAX).contains(&position));
    assert!(bench.drive.rotor(bench.now).abs() < 1 << 52);
    let speed = bench.drive.speed(bench.now);
    assert!((0.0..=15_625.0).contains(&speed) || is_step(speed), "{speed}");
    assert!(!status.hi_z || status.motion == MotStatus::Stopped, "de-energised and turning");
    assert!(speed <= 0.0 || status.motion != MotStatus::Stopped || is_step(speed), "{speed} while stopped");
    assert!(speed <= 0.0 || !status.hi_z, "{speed} while de-energised");
    assert!(status.ready || !status.hi_z, "busy and de-energised");
    if bench.session.is_authorised() {
        check_registers(bench, status, position);
    }
}

/// The registers that show the same thing in two ways agree.
fn check_registers(bench: &mut Bench, status: Status, position: i32) {
    let word = bench.read(Reg::StatusWord);
    assert_eq!(word, i64::from(status.word()));
    let comes_by_itself = bench.drive.next_wake().is_some();
    assert!(status.ready || comes_by_itself || bench.read(Reg::Wait) != 0, "READY would never come");
    let bits = bench.read_at(Table::DiscreteInputs, 0x1200, 10).expect("authorised");
    let motion = |motion| u16::from(status.motion == motion);
    let [stop, constant, acc, dec] =
        [MotStatus::Stopped, MotStatus::ConstantSpeed, MotStatus::Accelerating, MotStatus::Decelerating]
            .map(motion);
    let [hi_z, ready, sw_f, sw_evn, dir, cmd_error] =
        [status.hi_z, status.ready, status.sw_f, status.sw_evn, status.forward, status.cmd_error]
            .map(u16::from);
    assert_eq!(bits, [hi_z, stop, constant, acc, dec, ready, sw_f, sw_evn, dir, cmd_error]);
    assert_eq!(bench.position(), i64::from(position));
    assert!(bench.read(Reg::ElPos) < 512);
    let within = |reg: Reg, value: i64| {
        let (min, max) = reg.info().range(Model::Smsd42);
        (min..=max).contains(&value)
    };
    for row in REGISTERS.iter().filter(|row| row.id != Reg::Cmd && row.kind.width() == 1) {
        let value = bench.read(row.id);
        assert!(within(row.id, value), "{} reads {value}", row.name);
    }
}

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(cases(192))]

    #[test]
    fn nothing_breaks_a_controller(
        order in word_order(),
        programs in programs(),
        happenings in vec(happening(), 1..60),
    ) {
        let (mut bench, mut others) = prepared(order, &programs);
        for happening in &happenings {
            happen(&mut bench, &mut others, happening);
            check(&mut bench);
        }
    }

    #[test]
    fn reads_and_refusals_change_nothing(
        order in word_order(),
        programs in programs(),
        happenings in vec(happening(), 1..60),
    ) {
        let (mut bench, mut others) = prepared(order, &programs);
        for happening in &happenings {
            let before = (bench.snapshot(), format!("{others:?}"));
            let answer = happen(&mut bench, &mut others, happening);
            if must_change_nothing(happening, answer.as_ref()) {
                prop_assert_eq!((bench.snapshot(), format!("{others:?}")), before, "{:?}", happening);
            }
        }
    }

    #[test]
    fn the_same_happenings_have_the_same_outcome(
        order in word_order(),
        programs in programs(),
        happenings in vec(happening(), 1..60),
    ) {
        let run = || {
            let (mut bench, mut others) = prepared(order, &programs);
            let replies: Vec<_> =
                happenings.iter().map(|happening| happen(&mut bench, &mut others, happening)).collect();
            (replies, bench.snapshot())
        };
        prop_assert_eq!(run(), run());
    }

    #[test]
    fn time_in_pieces_is_the_same_time(
        programs in programs(),
        happenings in vec(happening(), 1..40),
        cuts in vec(0..1_000_000_000_u64, 1..10),
    ) {
        let (mut whole, mut others) = prepared(WordOrder::LowFirst, &programs);
        let (mut pieces, mut same_others) = (whole.clone(), others.clone());
        for happening in &happenings {
            let reply = happen(&mut whole, &mut others, happening);
            if let Happening::Pass(nanos) = happening {
                let end = pieces.now + Duration::from_nanos(*nanos);
                for cut in &cuts {
                    let rest = end.since(pieces.now);
                    pieces.run_for(rest.min(Duration::from_nanos(*cut)));
                    pieces.drive.handle_wake(pieces.now);
                }
                let rest = end.since(pieces.now);
                pieces.run_for(rest);
            } else {
                prop_assert_eq!(reply, happen(&mut pieces, &mut same_others, happening));
            }
            prop_assert_eq!(whole.drive.status(whole.now), pieces.drive.status(pieces.now));
            prop_assert_eq!(whole.drive.rotor(whole.now), pieces.drive.rotor(pieces.now));
        }
    }
}
