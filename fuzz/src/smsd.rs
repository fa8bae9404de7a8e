//! An SMSD on a stage: whatever happens to it, it answers, and what it says of itself holds together.
//!
//! The bytes are things that happen, one after another. The first byte of each says what:
//!
//! | first byte | then |
//! |---|---|
//! | bits 3:0 = 0 to 2 | a read: table in bits 5:4, address (2 bytes, high first), count (1) |
//! | 3 to 5 | holding registers: how many (1, taken modulo 124), address (2), the registers (2 each) |
//! | 6 | a coil: address (2), value in bit 4 |
//! | 7 | coils: address (2), how many (1, 1 to 8), their values (1) |
//! | 8 to 9 | `CMD` with its parameters: speed (2), position (3), input (1), code (1) |
//! | 10 | an input: its number in bits 6:4, its level in bit 7 |
//! | 11 with bits 5:4 = 0 | the other of two connections asks from here on |
//! | 11 with 1 | an instruction by the standard protocol: its word (4, low byte first) |
//! | 11 with 2 | a program by the standard protocol for the memory in bits 7:6: how many words (1, modulo 32), the words |
//! | 11 with 3 | by the standard protocol, as bits 7:6 say: a program is read, the LAN parameters, the counters, a login |
//! | 12 to 15 | time: 16 to the power of bits 6:4, times a byte (1), in nanoseconds; at most four seconds |
//!
//! It begins a second after power-up. Both connections are authorised at first, and so is the line of the standard protocol. What is cut off at the end of the bytes does not happen.

use core::time::Duration;
use stepdrive_drive::smsd::{Config, Memory, Session, Smsd, StandardSession, WordOrder};
use stepdrive_rig::machine::Machine;
use stepdrive_rig::mechanics::{Mechanics, Switch, Travel};
use stepdrive_spec::modbus::{Reply, Request, Table};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::ring;
use stepdrive_spec::smsd::standard::{self, Firmware, VERSION_2};
use stepdrive_spec::smsd::status::MotStatus;
use stepdrive_spec::time::Instant;

/// The ends of the travel, in full steps.
const TRAVEL: [f64; 2] = [-300.0, 300.0];

/// The switches along it.
const SWITCHES: [(Input, [f64; 2]); 4] = [
    (Input::SetZero, [-120.0, -100.0]),
    (Input::In1, [30.4, 30.6]),
    (Input::Sw, [80.0, 90.0]),
    (Input::Sw, [85.0, 300.0]),
];

/// The most time that passes in one go, in nanoseconds: a program may have an instruction every millisecond.
const LONGEST: u64 = 4_000_000_000;

/// The most time that passes in all.
const END: Instant = Instant::from_nanos(60_000_000_000);

const PASSWORD: u64 = 0x0123_4567_89AB_CDEF;

/// Something that happens.
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
enum Happening {
    Request(Request),
    Standard(standard::Request),
    Signal(Input, bool),
    OtherConnection,
    Pass(Duration),
}

/// Things that happen to an SMSD on a stage with switches, as the module's documentation says: the drive answers, reads
/// and refused requests change nothing, no wake-up is in the past, the flags agree with each other, the carriage stays
/// on its travel, and the same things in smaller steps of time have the same outcome.
///
/// # Panics
/// When that does not hold.
pub fn smsd_drive(data: &[u8]) {
    let (mut stage, mut stepwise) = (Stage::power_up(), Stage::power_up());
    let mut rest = data;
    while let Some(happening) = take(&mut rest) {
        if stage.now >= END {
            return;
        }
        stage.happen(&happening);
        if let Happening::Pass(time) = happening {
            let end = stepwise.now + time;
            stepwise.step_until(end);
        } else {
            stepwise.happen(&happening);
        }
        stage.check();
        stepwise.check();
        assert_eq!(stage.sight(), stepwise.sight());
    }
}

/// The next thing that happens; `None` when the bytes are used up or end in the middle of one.
fn take(rest: &mut &[u8]) -> Option<Happening> {
    let [first] = *chunk(rest)?;
    let bits = |count: u8| first >> 4 & ((1 << count) - 1);
    let request = match first & 0xF {
        0..=2 => take_read(rest, bits(2))?,
        3..=5 => {
            let [count, high, low] = *chunk(rest)?;
            let words = (0..count % 124).map_while(|_| chunk(rest).map(|word| u16::from_be_bytes(*word)));
            Request::WriteRegisters { address: u16::from_be_bytes([high, low]), values: words.collect() }
        }
        6 => Request::WriteCoil { address: u16::from_be_bytes(*chunk(rest)?), value: bits(1) == 1 },
        7 => {
            let [high, low, count, values] = *chunk(rest)?;
            let values = (0..=count % 8).map(|bit| values >> bit & 1 == 1).collect();
            Request::WriteCoils { address: u16::from_be_bytes([high, low]), values }
        }
        8 | 9 => {
            let [fast, slow, top, middle, low, input, code] = *chunk(rest)?;
            let position = i32::from_be_bytes([top, middle, low, 0]) >> 8;
            let [low, second, third, high] = position.to_le_bytes();
            let position = [u16::from_le_bytes([low, second]), u16::from_le_bytes([third, high])];
            let speed = u16::from_be_bytes([fast, slow]);
            let values = [speed, position[0], position[1], input.into(), code.into()];
            Request::WriteRegisters {
                address: Reg::TargetSpeed.info().address,
                values: values.into_iter().collect(),
            }
        }
        10 => {
            let input = Input::from_number(bits(3).into())?;
            return Some(Happening::Signal(input, first & 0x80 != 0));
        }
        11 if bits(2) == 0 => return Some(Happening::OtherConnection),
        11 => return take_standard(rest, bits(2), first >> 6).map(Happening::Standard),
        _ => {
            let [count] = *chunk(rest)?;
            let nanos = (u64::from(count) << (4 * bits(3))).min(LONGEST);
            return Some(Happening::Pass(Duration::from_nanos(nanos)));
        }
    };
    Some(Happening::Request(request))
}

fn take_read(rest: &mut &[u8], table: u8) -> Option<Request> {
    let [high, low, count] = *chunk(rest)?;
    let address = u16::from_be_bytes([high, low]);
    let count = u16::from(count % 125) + 1;
    Some(match table {
        0 => Request::ReadBits { table: Table::Coils, address, count },
        1 => Request::ReadBits { table: Table::DiscreteInputs, address, count },
        2 => Request::ReadWords { table: Table::InputRegisters, address, count },
        _ => Request::ReadWords { table: Table::HoldingRegisters, address, count },
    })
}

/// A request by the standard protocol of this kind; `which` says more of it.
fn take_standard(rest: &mut &[u8], kind: u8, which: u8) -> Option<standard::Request> {
    Some(match (kind, which) {
        (1, _) => standard::Request::Command(u32::from_le_bytes(*chunk(rest)?)),
        (2, area) => {
            let [count] = *chunk(rest)?;
            let words = (0..count % 32).map_while(|_| chunk(rest).map(|word| u32::from_le_bytes(*word)));
            standard::Request::WriteMemory { area, words: words.collect() }
        }
        (_, 0) => standard::Request::ReadMemory { area: 0 },
        (_, 1) => standard::Request::GetLan,
        (_, 2) => standard::Request::GetErrors,
        _ => standard::Request::Authorise(PASSWORD),
    })
}

fn chunk<'a, const N: usize>(rest: &mut &'a [u8]) -> Option<&'a [u8; N]> {
    let (chunk, behind) = rest.split_first_chunk()?;
    *rest = behind;
    Some(chunk)
}

/// A drive on its stage, with two connections and the time.
struct Stage {
    machine: Machine<Smsd>,
    session: Session,
    other: Session,
    standard: StandardSession,
    now: Instant,
}

impl Stage {
    fn power_up() -> Stage {
        let config = Config {
            model: Model::Smsd42,
            word_order: WordOrder::LowFirst,
            port: 502,
            autonomous: true,
            firmware: Firmware::Modbus,
            protocol_version: VERSION_2,
        };
        let switches = SWITCHES.iter().filter_map(|(input, closed)| Switch::new(*input, *closed)).collect();
        let mechanics = Mechanics::new(Travel::between(TRAVEL), 0.0);
        let machine = Machine::power_up(mechanics, switches, |signals| {
            Smsd::power_up(Instant::ZERO, config, Memory::factory(), signals.to_le_bytes()[0])
        });
        let (session, other, standard) = (Session::new(), Session::new(), StandardSession::lan());
        let mut stage = Stage { machine, session, other, standard, now: Instant::ZERO };
        stage.happen(&Happening::Pass(standard::AUTHORISATION_REST));
        stage.standard(&standard::Request::Authorise(PASSWORD));
        assert!(stage.standard.is_authorised());
        for _ in 0..2 {
            let values = [0xCDEF, 0x89AB, 0x4567, 0x0123, 0].into_iter().collect();
            let address = Reg::PasswordLow32.info().address;
            stage.request(&Request::WriteRegisters { address, values });
            core::mem::swap(&mut stage.session, &mut stage.other);
        }
        stage
    }

    fn happen(&mut self, happening: &Happening) {
        match happening {
            Happening::Request(request) => self.request(request),
            Happening::Standard(request) => self.standard(request),
            Happening::Signal(input, present) => self.machine.set_signal(self.now, *input, *present),
            Happening::OtherConnection => core::mem::swap(&mut self.session, &mut self.other),
            Happening::Pass(time) => {
                self.now = self.now + *time;
                self.machine.advance(self.now);
            }
        }
    }

    /// Lets time pass from wake-up to wake-up.
    fn step_until(&mut self, end: Instant) {
        while let Some(at) = self.machine.next_wake().filter(|at| *at <= end) {
            assert!(at >= self.now, "{at} is in the past of {}", self.now);
            self.now = at;
            self.machine.advance(at);
            assert!(self.machine.next_wake().is_none_or(|next| next > at));
        }
        self.now = end;
    }

    fn request(&mut self, request: &Request) {
        self.look_at_the_rotor();
        let before = self.sight();
        let outcome = self.machine.handle(self.now, &mut self.session, request);
        let counts = match (request, &outcome) {
            (Request::ReadBits { count, .. }, Ok(Reply::Bits(bits))) => bits.len() == *count,
            (Request::ReadWords { count, .. }, Ok(Reply::Words(words))) => words.len() == usize::from(*count),
            (Request::ReadBits { .. } | Request::ReadWords { .. }, Ok(_)) => false,
            (_, outcome) => !matches!(outcome, Ok(Reply::Bits(_) | Reply::Words(_))),
        };
        assert!(counts, "{request:?} was answered {outcome:?}");
        if !matches!(outcome, Ok(Reply::Written)) {
            assert_eq!(self.sight(), before, "{request:?}");
        }
        self.take_what_is_there();
    }

    fn standard(&mut self, request: &standard::Request) {
        self.look_at_the_rotor();
        let before = self.sight();
        let reply = self.machine.handle_standard(self.now, &mut self.standard, Ok(request));
        let reply = reply.expect("STOP_USB does not silence a line over LAN");
        let login = matches!(request, standard::Request::Authorise(_));
        if !login && !matches!(reply, standard::Reply::Powerstep01(_)) && !done(&reply) {
            assert_eq!(self.sight(), before, "{request:?}");
        }
        self.take_what_is_there();
    }

    /// A stall that has begun meanwhile is counted before something is asked.
    fn look_at_the_rotor(&mut self) {
        self.machine.change(self.now, |_| ());
    }

    /// Whoever stores and listens takes what is there.
    fn take_what_is_there(&mut self) {
        while self.machine.drive_mut().poll_event().is_some() {}
        while self.machine.drive_mut().take_unsaved().is_some() {}
    }

    /// All that the drive, the connections and the carriage are.
    fn sight(&self) -> String {
        let (drive, place) = (self.machine.drive(), self.machine.carriage(self.now));
        let sessions = (&self.session, &self.other, &self.standard);
        format!("{drive:?} {sessions:?} {place} {:?}", self.machine.next_wake())
    }

    fn check(&self) {
        let (drive, now) = (self.machine.drive(), self.now);
        assert!(self.machine.next_wake().is_none_or(|at| at >= now));
        let (status, speed) = (drive.status(now), drive.speed(now));
        assert!((ring::MIN..=ring::MAX).contains(&drive.position(now)));
        assert!((0.0..=15_625.0).contains(&speed) || is_step(speed), "{speed}");
        assert!(speed <= 0.0 || status.motion != MotStatus::Stopped || is_step(speed));
        assert!(!status.hi_z || (status.motion == MotStatus::Stopped && status.ready));
        let place = self.machine.carriage(now);
        assert!((TRAVEL[0]..=TRAVEL[1]).contains(&place), "{place}");
        for (input, closed) in SWITCHES {
            let closed = (closed[0]..=closed[1]).contains(&place);
            assert!(!closed || drive.inputs() & input.bit() != 0, "{input} at {place}");
        }
        self.check_status_word(drive);
    }

    /// The status word is what the discrete inputs say one by one.
    fn check_status_word(&self, drive: &Smsd) {
        if !self.session.is_authorised() {
            return;
        }
        let (mut drive, mut session) = (drive.clone(), self.session);
        let flags = Request::ReadBits { table: Table::DiscreteInputs, address: 0x1200, count: 10 };
        let Ok(Reply::Bits(flags)) = drive.handle(self.now, &mut session, &flags) else {
            panic!("the flags cannot be read")
        };
        let flags: Vec<bool> = flags.iter().collect();
        let status = drive.status(self.now);
        let is = |motion| status.motion == motion;
        let motion =
            [MotStatus::Stopped, MotStatus::ConstantSpeed, MotStatus::Accelerating, MotStatus::Decelerating];
        assert_eq!(flags[0], status.hi_z);
        assert_eq!(flags[1..5], motion.map(is));
        assert_eq!(flags[5..], [status.ready, status.sw_f, status.sw_evn, status.forward, status.cmd_error]);
    }
}

/// Whether this is the speed of a step by the step input, in whichever microstep mode.
fn is_step(speed: f64) -> bool {
    (0..=7).any(|mode| speed.to_bits() == (4e6 / f64::from(1 << mode)).to_bits())
}

/// Whether something was set or stored.
fn done(reply: &standard::Reply) -> bool {
    matches!(reply, standard::Reply::Response(answer) if !answer.code.is_error())
}
