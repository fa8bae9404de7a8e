//! A controller on the bench: a session, a virtual clock, and verbs that say what a test does.

use core::time::Duration;
use stepdrive_drive::smsd::{Config, Event, Memory, Session, Smsd, WordOrder};
use stepdrive_spec::modbus::{Exception, Reply, Request, Table};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, Operand};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::powerstep01 as scale;
use stepdrive_spec::smsd::registers::{Kind, REGISTERS, Reg, Register};
use stepdrive_spec::smsd::standard::{Firmware, VERSION_2};
use stepdrive_spec::time::Instant;

pub(crate) const PASSWORD: u64 = 0x0123_4567_89AB_CDEF;
pub(crate) const SECOND: Duration = Duration::from_secs(1);
/// What an instruction takes at least.
pub(crate) const MS: Duration = Duration::from_millis(1);
/// Microsteps to the full step as the controller leaves the factory.
pub(crate) const MICROSTEPS: i64 = 16;

/// A controller, one connection to it, and the time.
#[derive(Clone, Debug)]
pub(crate) struct Bench {
    pub(crate) drive: Smsd,
    pub(crate) session: Session,
    pub(crate) now: Instant,
    order: WordOrder,
    /// Wake-ups handled so far.
    pub(crate) wakes: u64,
}

pub(crate) fn config(model: Model) -> Config {
    Config {
        model,
        word_order: WordOrder::LowFirst,
        port: 5020,
        autonomous: false,
        firmware: Firmware::Modbus,
        protocol_version: VERSION_2,
    }
}

impl Bench {
    /// An SMSD-4.2LAN fresh from the factory, and a connection that is authorised.
    pub(crate) fn new() -> Bench {
        Bench::of(Model::Smsd42)
    }

    /// The same of either model.
    pub(crate) fn of(model: Model) -> Bench {
        Bench::with(config(model), Memory::factory(), 0)
    }

    /// Any controller, with the inputs at `levels`; the connection is authorised.
    pub(crate) fn with(config: Config, memory: Memory, levels: u8) -> Bench {
        let mut bench = Bench::locked(config, memory, levels);
        let password = bench.drive.memory().password;
        bench.log_in(password);
        bench
    }

    /// The same with a connection that is not authorised.
    pub(crate) fn locked(config: Config, memory: Memory, levels: u8) -> Bench {
        let drive = Smsd::power_up(Instant::ZERO, config, memory, levels);
        Bench { drive, session: Session::new(), now: Instant::ZERO, order: config.word_order, wakes: 0 }
    }

    /// Ready for motion in this microstep mode, with these limits.
    pub(crate) fn tuned(microstepping: i64, min: i64, max: i64, acc: i64, dec: i64) -> Bench {
        let mut bench = Bench::new();
        bench.write(Reg::Microstepping, microstepping);
        bench.write(Reg::MinSpeed, min);
        bench.write(Reg::MaxSpeed, max);
        bench.write(Reg::Acc, acc);
        bench.write(Reg::Dec, dec);
        bench
    }

    // ---- requests

    pub(crate) fn request(&mut self, request: &Request) -> Result<Reply, Exception> {
        self.drive.handle(self.now, &mut self.session, request)
    }

    /// `count` values from `address` on; bits as 0 and 1.
    pub(crate) fn read_at(&mut self, table: Table, address: u16, count: u16) -> Result<Vec<u16>, Exception> {
        let request = if table.is_bits() {
            Request::ReadBits { table, address, count }
        } else {
            Request::ReadWords { table, address, count }
        };
        match self.request(&request)? {
            Reply::Bits(bits) => Ok(bits.iter().map(u16::from).collect()),
            Reply::Words(words) => Ok(words.to_vec()),
            Reply::Written => panic!("a read answered as a write"),
        }
    }

    /// Writes holding registers with function code 10.
    pub(crate) fn write_at(&mut self, address: u16, values: &[u16]) -> Result<(), Exception> {
        let values = values.iter().copied().collect();
        self.request(&Request::WriteRegisters { address, values }).map(drop)
    }

    /// Writes one holding register with function code 06.
    pub(crate) fn write_one(&mut self, address: u16, value: u16) -> Result<(), Exception> {
        self.request(&Request::WriteRegister { address, value }).map(drop)
    }

    /// Writes coils with function code 0F.
    pub(crate) fn write_coils_at(&mut self, address: u16, values: &[bool]) -> Result<(), Exception> {
        let values = values.iter().copied().collect();
        self.request(&Request::WriteCoils { address, values }).map(drop)
    }

    /// The value of a register, 32 bits in one.
    pub(crate) fn read(&mut self, reg: Reg) -> i64 {
        self.read_nth(reg, 0)
    }

    /// The value of one of several registers in a row of the map.
    pub(crate) fn read_nth(&mut self, reg: Reg, index: u16) -> i64 {
        let row = reg.info();
        let width = row.kind.width();
        let words = self.read_at(row.table, row.address + index * width, width);
        self.join(row, &words.unwrap_or_else(|exception| panic!("{}: {exception}", row.name)))
    }

    fn join(&self, row: &Register, words: &[u16]) -> i64 {
        let value = match (words, self.order) {
            ([word], _) => u32::from(*word),
            ([low, high], WordOrder::LowFirst) | ([high, low], WordOrder::HighFirst) => {
                u32::from(*high) << 16 | u32::from(*low)
            }
            _ => panic!("{} words of {}", words.len(), row.name),
        };
        if row.kind == Kind::I32 { i64::from(value.cast_signed()) } else { i64::from(value) }
    }

    /// The words that carry `value` to this register.
    pub(crate) fn words(&self, row: &Register, value: i64) -> Vec<u16> {
        let [low, second, third, high, ..] = value.to_le_bytes();
        let (low, high) = (u16::from_le_bytes([low, second]), u16::from_le_bytes([third, high]));
        match (row.kind.width(), self.order) {
            (1, _) => vec![low],
            (_, WordOrder::LowFirst) => vec![low, high],
            (_, WordOrder::HighFirst) => vec![high, low],
        }
    }

    pub(crate) fn try_write(&mut self, reg: Reg, value: i64) -> Result<(), Exception> {
        let row = reg.info();
        if row.table == Table::Coils {
            return self.request(&Request::WriteCoil { address: row.address, value: value != 0 }).map(drop);
        }
        let words = self.words(row, value);
        self.write_at(row.address, &words)
    }

    /// Writes a register that takes the value.
    pub(crate) fn write(&mut self, reg: Reg, value: i64) {
        let written = self.try_write(reg, value);
        written.unwrap_or_else(|exception| panic!("{} = {value}: {exception}", reg.info().name));
    }

    /// Writes TRUE to a coil.
    pub(crate) fn trigger(&mut self, reg: Reg) {
        self.write(reg, 1);
    }

    /// Enters a password and asks for access; answers whether it was given.
    pub(crate) fn log_in(&mut self, password: u64) -> bool {
        self.enter(password, 0).expect("always open");
        self.session.is_authorised()
    }

    /// Enters a password with a value of `Password_CMD`, as two requests.
    pub(crate) fn enter(&mut self, password: u64, command: u16) -> Result<(), Exception> {
        for (reg, half) in [(Reg::PasswordLow32, password), (Reg::PasswordHigh32, password >> 32)] {
            self.write(reg, i64::try_from(half & 0xFFFF_FFFF).expect("32 bits"));
        }
        self.write_one(Reg::PasswordCmd.info().address, command)
    }

    /// Writes a code to `CMD`.
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

    // ---- signals and time

    pub(crate) fn input(&mut self, input: Input, level: bool) {
        self.drive.set_input(self.now, input, level);
    }

    /// Handles the next wake-up if it comes by `end`.
    pub(crate) fn step(&mut self, end: Instant) -> bool {
        let Some((at, _)) = self.drive.next_wake().filter(|(at, _)| *at <= end) else { return false };
        assert!(at >= self.now, "a wake-up at {at} is in the past of {}", self.now);
        self.now = at;
        self.drive.handle_wake(at);
        self.wakes += 1;
        let next = self.drive.next_wake();
        assert!(next.is_none_or(|(next, _)| next > at), "after {at} the next wake-up is at {next:?}");
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
            assert!(self.step(Instant::FAR_FUTURE), "nothing will happen any more: {}", self.flags());
        }
        self.now.since(start)
    }

    pub(crate) fn run_until_ready(&mut self) -> Duration {
        self.run_until(|bench| bench.drive.status(bench.now).ready)
    }

    /// The flags after each wake-up until `READY`, equal neighbours once.
    pub(crate) fn flags_until_ready(&mut self) -> Vec<String> {
        let mut seen = vec![self.flags()];
        while !self.drive.status(self.now).ready {
            assert!(self.step(Instant::FAR_FUTURE), "READY never comes");
            seen.push(self.flags());
        }
        seen.dedup();
        seen
    }

    // ---- programs

    /// Stores a program and its size as ch. 5 says.
    pub(crate) fn store(&mut self, area: u8, program: &[Instruction]) {
        self.write(Reg::NProg, i64::from(area));
        self.procedure(2);
        for (block, lines) in program.chunks(32).enumerate() {
            self.write(Reg::NStr, i64::try_from(block * 32).expect("small"));
            self.write(Reg::SectorSize, i64::try_from(lines.len()).expect("small"));
            let words: Vec<u16> = lines
                .iter()
                .flat_map(|line| self.words(Reg::CmdBuffer.info(), i64::from(line.word())))
                .collect();
            self.write_at(Reg::CmdBuffer.info().address, &words).expect("a buffer takes any words");
            self.procedure(1);
        }
        self.write(Reg::ProgSize, i64::try_from(program.len()).expect("small"));
        self.procedure(4);
    }

    /// Clears `B_COMPLETE`, runs a procedure of `MEM_CMD` and waits for its end.
    pub(crate) fn procedure(&mut self, code: i64) {
        self.write(Reg::BComplete, 0);
        self.write(Reg::MemCmd, code);
        self.run_until(|bench| bench.read(Reg::BComplete) == 1);
    }

    /// Stores a program in area 0 and starts it; its first line has had its effect then.
    pub(crate) fn start(&mut self, program: &[Instruction]) {
        self.store(0, program);
        self.command(Opcode::StartProgramMem0);
        self.settle();
    }

    /// Handles what is due now.
    pub(crate) fn settle(&mut self) {
        self.run_for(Duration::ZERO);
    }

    /// Runs a program from its start to its end; answers how long it took.
    pub(crate) fn run_program(&mut self, program: &[Instruction]) -> Duration {
        self.store(0, program);
        self.command(Opcode::StartProgramMem0);
        self.run_until_ended()
    }

    pub(crate) fn run_until_ended(&mut self) -> Duration {
        self.run_until(|bench| !bench.program_runs())
    }

    pub(crate) fn program_runs(&mut self) -> bool {
        self.read(Reg::ProgramRun) == 1
    }

    /// The memory area and line of the program.
    pub(crate) fn place(&mut self) -> (i64, i64) {
        (self.read(Reg::NProgram), self.read(Reg::NCommand))
    }

    // ---- inspection

    /// The names of the discrete inputs 1200 to 1209 that are TRUE, in their order.
    pub(crate) fn flags(&mut self) -> String {
        let bits = self.read_at(Table::DiscreteInputs, 0x1200, 10).expect("authorised");
        let rows = REGISTERS.iter().filter(|row| row.table == Table::DiscreteInputs);
        let set: Vec<&str> = rows.zip(bits).filter(|(_, bit)| *bit == 1).map(|(row, _)| row.name).collect();
        set.join(" ")
    }

    pub(crate) fn position(&mut self) -> i64 {
        self.read(Reg::AbsPos)
    }

    pub(crate) fn speed(&mut self) -> i64 {
        self.read(Reg::Speed)
    }

    pub(crate) fn cmd_error(&mut self) -> bool {
        self.read(Reg::CmdError) == 1
    }

    /// Asserts that `CMD_ERROR` was set, with this reason, and clears it.
    pub(crate) fn assert_refused(&mut self, reason: &str) {
        assert!(self.cmd_error(), "not refused; {reason} was expected");
        let event = self.drive.poll_event();
        let Some(Event::Refused(refusal)) = event else { panic!("{event:?} where a refusal was expected") };
        assert!(refusal.to_string().contains(reason), "{refusal} does not say {reason}");
        self.trigger(Reg::Clr);
    }

    /// All that the controller and the connection are.
    pub(crate) fn snapshot(&self) -> String {
        format!("{:?} {:?}", self.drive, self.session)
    }

    /// Asserts that `act` is answered with `exception` and changes nothing at all.
    pub(crate) fn assert_excepted(
        &mut self,
        exception: Exception,
        what: &str,
        act: impl FnOnce(&mut Bench) -> Result<(), Exception>,
    ) {
        let before = self.snapshot();
        assert_eq!(act(self), Err(exception), "{what}");
        assert_eq!(self.snapshot(), before, "{what}");
    }
}

/// A nanosecond less.
pub(crate) fn just_before(time: Duration) -> Duration {
    time.saturating_sub(Duration::from_nanos(1))
}

// ---- programs

/// An instruction with a number.
pub(crate) fn line(opcode: Opcode, operand: i32) -> Instruction {
    Instruction::with_position(opcode, operand)
}

/// An instruction without operand.
pub(crate) fn plain(opcode: Opcode) -> Instruction {
    line(opcode, 0)
}

/// A jump or call.
pub(crate) fn jump(opcode: Opcode, area: i32, target: i32) -> Instruction {
    line(opcode, area << 8 | target)
}

/// A loop over the next `instructions`.
pub(crate) fn repeat(instructions: i32, cycles: i32) -> Instruction {
    line(Opcode::LoopProgram, cycles << 10 | instructions)
}

/// Moves by one microstep, so that `ABS_POS` counts how often it was carried out. Takes its time.
pub(crate) fn count() -> Instruction {
    line(Opcode::MoveF, 1)
}

/// The end of a program.
pub(crate) fn end() -> Instruction {
    plain(Opcode::End)
}

// ---- the textbook

/// A move in full steps, from and to `min`, as the chip rounds its limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Textbook {
    pub(crate) min: f64,
    pub(crate) max: f64,
    pub(crate) acc: f64,
    pub(crate) dec: f64,
}

impl Textbook {
    pub(crate) fn of(min: i64, max: i64, acc: i64, dec: i64) -> Textbook {
        Textbook {
            min: scale::MIN_SPEED.round(min as f64),
            max: scale::MAX_SPEED.round(max as f64),
            acc: scale::ACCELERATION.round(acc as f64),
            dec: scale::ACCELERATION.round(dec as f64),
        }
    }

    /// The factory's limits.
    pub(crate) fn factory() -> Textbook {
        Textbook::of(0, 1000, 1000, 1000)
    }

    /// Seconds that a move of so many full steps takes.
    pub(crate) fn seconds(self, steps: f64) -> f64 {
        let Textbook { min, max, acc, dec } = self;
        let peak = ((2.0 * acc * dec * steps + (acc + dec) * min * min) / (acc + dec)).sqrt();
        if peak < max {
            return (peak - min) / acc + (peak - min) / dec;
        }
        let ramps = (max * max - min * min) / 2.0 * (1.0 / acc + 1.0 / dec);
        (max - min) * (1.0 / acc + 1.0 / dec) + (steps - ramps) / max
    }
}

/// Asserts that a time is what the textbook says, to a nanosecond and the rounding of a calculation in seconds.
pub(crate) fn assert_takes(found: Duration, seconds: f64) {
    let error = (found.as_secs_f64() - seconds).abs();
    assert!(error <= 2e-9 + 1e-12 * seconds, "took {found:?}, the textbook says {seconds} s");
}
