//! A machine from a rig file, a session, a virtual clock, and verbs that say what a test does.

use core::time::Duration;
use stepdrive_drive::smsd::{Memory, Session, Smsd};
use stepdrive_rig::file::RigFile;
use stepdrive_rig::machine::Machine;
use stepdrive_spec::modbus::{Exception, Reply, Request, Table};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, Operand};
use stepdrive_spec::smsd::powerstep01 as scale;
use stepdrive_spec::smsd::registers::{Kind, Reg};
use stepdrive_spec::time::Instant;

pub(crate) const SECOND: Duration = Duration::from_secs(1);
pub(crate) const MS: Duration = Duration::from_millis(1);

/// A machine, a connection to it that is authorised, and the time.
#[derive(Clone, Debug)]
pub(crate) struct Bench {
    pub(crate) machine: Machine<Smsd>,
    pub(crate) session: Session,
    pub(crate) now: Instant,
    /// Wake-ups handled so far.
    pub(crate) wakes: u64,
}

/// The drive of a rig that has only one, with these further lines in its file.
fn drive(lines: &str, memory: Memory) -> Machine<Smsd> {
    let text = format!(
        "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:5020\"\n{lines}"
    );
    let file = RigFile::parse(&text).unwrap_or_else(|error| panic!("{}", error.render("rig")));
    let drive = &file.drives[0];
    drive.smsd().expect("an SMSD").power_up(drive, memory)
}

impl Bench {
    /// A machine fresh from the factory, with these further lines in its rig file.
    pub(crate) fn new(lines: &str) -> Bench {
        Bench::remembering(lines, Memory::factory())
    }

    /// The same with a controller that remembers something.
    pub(crate) fn remembering(lines: &str, memory: Memory) -> Bench {
        let machine = drive(lines, memory);
        let mut bench = Bench { machine, session: Session::new(), now: Instant::ZERO, wakes: 0 };
        let values = [0xCDEF, 0x89AB, 0x4567, 0x0123, 0].into_iter().collect();
        let logged_in = bench.request(&Request::WriteRegisters { address: 0x2100, values });
        assert_eq!(logged_in, Ok(Reply::Written));
        bench
    }

    // ---- requests

    pub(crate) fn request(&mut self, request: &Request) -> Result<Reply, Exception> {
        self.machine.handle(self.now, &mut self.session, request)
    }

    pub(crate) fn read(&mut self, reg: Reg) -> i64 {
        let (table, address, count) = (reg.info().table, reg.info().address, reg.info().kind.width());
        let request = if table.is_bits() {
            Request::ReadBits { table, address, count }
        } else {
            Request::ReadWords { table, address, count }
        };
        match self.request(&request).expect("listed") {
            Reply::Bits(bits) => i64::from(bits.get(0) == Some(true)),
            Reply::Words(words) => {
                let high = words.get(1).copied().unwrap_or(0);
                let value = u32::from(high) << 16 | u32::from(words[0]);
                if reg.info().kind == Kind::I32 { value.cast_signed().into() } else { value.into() }
            }
            Reply::Written => panic!("a read answered as a write"),
        }
    }

    pub(crate) fn write(&mut self, reg: Reg, value: i64) {
        let address = reg.info().address;
        let request = if reg.info().table == Table::Coils {
            Request::WriteCoil { address, value: value != 0 }
        } else {
            let [low, second, third, high, ..] = value.to_le_bytes();
            let words = [u16::from_le_bytes([low, second]), u16::from_le_bytes([third, high])];
            let values = words.into_iter().take(reg.info().kind.width().into()).collect();
            Request::WriteRegisters { address, values }
        };
        assert_eq!(self.request(&request), Ok(Reply::Written), "{} = {value}", reg.info().name);
    }

    pub(crate) fn command(&mut self, opcode: Opcode) {
        self.write(Reg::Cmd, i64::from(opcode.code()));
    }

    /// Gives a command its operand, then the command.
    pub(crate) fn order(&mut self, opcode: Opcode, operand: i64) {
        match opcode.info().operand {
            Operand::Number { .. } => self.write(Reg::TargetSpeed, operand),
            Operand::Position => self.write(Reg::TargetPos, operand),
            Operand::Input => self.write(Reg::TargetInput, operand),
            Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => {
                panic!("{opcode} takes no operand from a register")
            }
        }
        self.command(opcode);
    }

    /// Moves and waits until it is done.
    pub(crate) fn go(&mut self, opcode: Opcode, operand: i64) {
        self.order(opcode, operand);
        self.run_until_ready();
    }

    /// Stores a program of up to 32 lines in area 0.
    pub(crate) fn store(&mut self, program: &[Instruction]) {
        let words = program.iter().flat_map(|line| {
            let [low, second, third, high] = line.word().to_le_bytes();
            [u16::from_le_bytes([low, second]), u16::from_le_bytes([third, high])]
        });
        let values = words.collect();
        let address = Reg::CmdBuffer.info().address;
        assert_eq!(self.request(&Request::WriteRegisters { address, values }), Ok(Reply::Written));
        let lines = i64::try_from(program.len()).expect("small");
        self.write(Reg::SectorSize, lines);
        self.write(Reg::ProgSize, lines);
        for procedure in [1, 4] {
            self.write(Reg::MemCmd, procedure);
            self.run_for(2 * MS);
        }
    }

    // ---- time

    /// Handles the next wake-up if it comes by `end`.
    pub(crate) fn step(&mut self, end: Instant) -> bool {
        let Some(at) = self.machine.next_wake().filter(|at| *at <= end) else { return false };
        assert!(at >= self.now, "a wake-up at {at} is in the past of {}", self.now);
        self.now = at;
        self.machine.advance(at);
        self.wakes += 1;
        assert!(self.machine.next_wake().is_none_or(|next| next > at));
        true
    }

    pub(crate) fn run_for(&mut self, time: Duration) {
        let end = self.now + time;
        while self.step(end) {}
        self.now = end;
    }

    /// Lets time jump from wake-up to wake-up until `done`; answers how long that took.
    pub(crate) fn run_until(&mut self, done: impl Fn(&mut Bench) -> bool) -> Duration {
        let start = self.now;
        while !done(self) {
            assert!(self.step(Instant::FAR_FUTURE), "nothing will happen any more");
        }
        self.now.since(start)
    }

    pub(crate) fn run_until_ready(&mut self) -> Duration {
        self.run_until(|bench| bench.machine.drive().status(bench.now).ready)
    }

    // ---- inspection

    pub(crate) fn position(&mut self) -> i64 {
        self.read(Reg::AbsPos)
    }

    /// Where the carriage is, in full steps.
    pub(crate) fn carriage(&self) -> f64 {
        self.machine.carriage(self.now)
    }

    pub(crate) fn stalled(&self) -> bool {
        self.machine.stalled(self.now)
    }
}

/// A switch in a rig file.
pub(crate) fn switch(input: &str, low: f64, high: f64) -> String {
    format!("[[drive.switch]]\ninput = \"{input}\"\nclosed = [{low:?}, {high:?}]\n")
}

/// The mechanics in a rig file.
pub(crate) fn travel(low: f64, high: f64, start: f64) -> String {
    format!("[drive.mechanics]\ntravel = [{low:?}, {high:?}]\nstart = {start:?}\n")
}

/// The seconds in which a motor that starts from 0 with the factory's `ACC` and cruises at `speed` covers `steps`.
pub(crate) fn textbook_seconds(speed: i64, steps: f64) -> f64 {
    let acc = scale::ACCELERATION.round(1000.0);
    let cruise = scale::SPEED.round(speed as f64).min(scale::MAX_SPEED.round(1000.0));
    let ramp = cruise * cruise / (2.0 * acc);
    if steps < ramp { (2.0 * steps / acc).sqrt() } else { cruise / acc + (steps - ramp) / cruise }
}

/// Asserts that a time is what the textbook says, to the nanosecond.
pub(crate) fn assert_takes(found: Duration, seconds: f64) {
    let error = (found.as_secs_f64() - seconds).abs();
    assert!(error <= 2e-9, "took {found:?}, the textbook says {seconds} s");
}
