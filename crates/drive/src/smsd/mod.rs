//! The SMSD-4.2LAN and SMSD-8.0LAN.
//!
//! [`Smsd`] is the controller. Its parts have a file each, named as in the data sheets (`stepdrive_spec::smsd`):
//! `registers` the register map, `commands` what `CMD` and programs can do, `powerstep01` the motor chip,
//! `inputs` the signals, `programs` the memory areas and the procedures of `MEM_CMD`, `access` authorisation,
//! `memory` what survives power-off, `interpreter` running programs, `power` the supply and the front panel,
//! `standard` the requests of the standard binary protocol and `immediate` the instructions among them, `counters` its
//! counters of errors, `quantities` what can be looked at.

mod access;
mod commands;
mod counters;
mod immediate;
mod inputs;
mod interpreter;
mod memory;
mod power;
mod powerstep01;
mod programs;
mod quantities;
mod registers;
mod standard;

pub use access::{Session, StandardSession};
pub use commands::{Place, Refusal, Why};
pub use memory::{Area, DamagedRecord, Lan, Memory, Record, RecordBytes};
pub use quantities::Quantity;

use access::Logins;
use commands::CommandRegisters;
use counters::Counters;
use inputs::{Inputs, Seek};
use interpreter::Interpreter;
use powerstep01::PowerStep01;
use programs::Programs;
use stepdrive_motion::{Direction, Phase};
use stepdrive_spec::modbus::{Exception, Reply, Request};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::Firmware;
use stepdrive_spec::smsd::status::{MotStatus, Status};
use stepdrive_spec::time::Instant;

/// Which half of a 32-bit value stands at the lower address (decision 2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WordOrder {
    /// The low word.
    #[default]
    LowFirst,
    /// The high word.
    HighFirst,
}

/// What a controller is, apart from what it remembers.
#[derive(Clone, Copy, Debug)]
pub struct Config {
    /// The model.
    pub model: Model,
    /// The order of the two words of a 32-bit value.
    pub word_order: WordOrder,
    /// The TCP port that the controller is reached at while its LAN parameters name none: what `Port` (0x7017) then
    /// reads as.
    pub port: u16,
    /// Autonomous mode ("bF" at the front panel): the program of `MODE_N_PROGRAMS` starts at power-up.
    pub autonomous: bool,
    /// What it runs: decides the form of the LAN parameters of the standard protocol.
    pub firmware: Firmware,
    /// The version of the standard protocol, 1 or 2; the instructions 0x3A to 0x3E came with 2.
    pub protocol_version: u8,
}

/// Why a controller wants to be woken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timer {
    /// The motion enters another phase or ends.
    Motion,
    /// A `MEM_CMD` procedure ends.
    Memory,
    /// The next instruction of the user program is due.
    Program,
}

/// Something that happened in the controller and that the world outside may act on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// LAN parameters were put into effect: the controller wants to be reached at these from now on.
    NetworkConfigured,
    /// `CMD_ERROR` was set. Further refusals before the flag is cleared are not told.
    Refused(Refusal),
}

/// A user program as it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Program {
    /// `PROGRAM_RUN`.
    pub running: bool,
    /// The line that runs, or ran last: `N_PROGRAM` and `N_COMMAND`.
    pub place: Place,
    /// How many instructions have run since power-up.
    pub executed: u64,
    /// The inputs that it waits for, a bit each.
    pub waiting: u8,
}

/// A controller.
///
/// # How to use one
///
/// Calls carry the time, which must not run backward.
///
/// * **In**: [`Smsd::handle`] for a request by Modbus and [`Smsd::handle_standard`] for one by the standard protocol,
///   [`Smsd::set_input`] for a signal, [`Smsd::short_motor`] and
///   [`Smsd::overheat`] for what goes wrong.
/// * **Time**: [`Smsd::next_wake`] says when [`Smsd::handle_wake`] wants to be called. Every wake-up that is due must be
///   handled before something else goes in with a later time.
/// * **Out**: after each call, drain [`Smsd::poll_event`]; when [`Smsd::memory_generation`] has grown, store what
///   [`Smsd::take_unsaved`] names before the reply is sent, so that what a client has seen survives power-off.
/// * **Look**: everything else takes `&self` and changes nothing.
#[derive(Clone, Debug)]
pub struct Smsd {
    config: Config,
    /// It has its supply.
    on: bool,
    memory: Memory,
    unsaved: memory::Unsaved,
    motor: PowerStep01,
    inputs: Inputs,
    seek: Option<Seek>,
    registers: CommandRegisters,
    programs: Programs,
    interpreter: Interpreter,
    lan: Lan,
    relay: bool,
    logins: Logins,
    counters: Counters,
    refusal: Option<Refusal>,
    network_configured: bool,
}

impl Smsd {
    /// Switches a controller on at `now`: de-energised, ready, at position 0, relay off, the inputs at `levels` (a bit
    /// each). In autonomous mode its program starts.
    pub fn power_up(now: Instant, config: Config, memory: Memory, levels: u8) -> Smsd {
        let mut drive = Smsd {
            config,
            on: false,
            lan: memory.lan,
            unsaved: memory::Unsaved::default(),
            motor: PowerStep01::power_up(memory.motor.microsteps_per_step()),
            inputs: Inputs::power_up(levels),
            seek: None,
            registers: CommandRegisters::power_up(),
            programs: Programs::power_up(),
            interpreter: Interpreter::default(),
            relay: false,
            logins: Logins::power_up(now),
            counters: Counters::default(),
            refusal: None,
            network_configured: false,
            memory,
        };
        drive.switch_on(now, levels);
        drive
    }

    /// Answers a request at `now`.
    ///
    /// # Errors
    /// The exception to answer with. Nothing has changed then.
    pub fn handle(
        &mut self,
        now: Instant,
        session: &mut Session,
        request: &Request,
    ) -> Result<Reply, Exception> {
        let reply = self.carry_out(now, session, request);
        self.release_program(now);
        reply
    }

    fn carry_out(
        &mut self,
        now: Instant,
        session: &mut Session,
        request: &Request,
    ) -> Result<Reply, Exception> {
        match request {
            Request::ReadBits { table, address, count } => {
                self.read_bits(now, session, *table, *address, *count).map(Reply::Bits)
            }
            Request::ReadWords { table, address, count } => {
                self.read_words(now, session, *table, *address, *count).map(Reply::Words)
            }
            Request::WriteCoil { address, value } => {
                self.write_coils(now, session, *address, &[*value].into_iter().collect())?;
                Ok(Reply::Written)
            }
            Request::WriteCoils { address, values } => {
                self.write_coils(now, session, *address, values)?;
                Ok(Reply::Written)
            }
            Request::WriteRegister { address, value } => {
                self.write_words(now, session, *address, &[*value])?;
                Ok(Reply::Written)
            }
            Request::WriteRegisters { address, values } => {
                self.write_words(now, session, *address, values)?;
                Ok(Reply::Written)
            }
        }
    }

    /// When the controller next wants [`Smsd::handle_wake`] called, and why. `None` while nothing will happen by itself.
    pub fn next_wake(&self) -> Option<(Instant, Timer)> {
        let motion = self.motor.next_wake().map(|at| (at, Timer::Motion));
        let memory = self.programs.next_wake().map(|at| (at, Timer::Memory));
        let program = self.interpreter.next_wake().map(|at| (at, Timer::Program));
        [motion, memory, program].into_iter().flatten().min_by_key(|(at, _)| *at)
    }

    /// Does what was due up to `now`, each thing at its own instant.
    pub fn handle_wake(&mut self, now: Instant) {
        while let Some((at, timer)) = self.next_wake().filter(|(at, _)| *at <= now) {
            match timer {
                Timer::Motion => {
                    self.motor.handle_wake(at);
                    self.release_program(at);
                }
                Timer::Memory => self.finish_memory_procedure(),
                Timer::Program => self.run_instruction(at),
            }
        }
    }

    /// The next thing that the world outside may act on.
    pub fn poll_event(&mut self) -> Option<Event> {
        if core::mem::take(&mut self.network_configured) {
            return Some(Event::NetworkConfigured);
        }
        self.refusal.take().map(Event::Refused)
    }

    /// What survives power-off, as it stands.
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Grows with every change of [`Smsd::memory`].
    pub fn memory_generation(&self) -> u64 {
        self.unsaved.generation()
    }

    /// Names the next record of [`Smsd::memory`] that has changed since it was last named here.
    pub fn take_unsaved(&mut self) -> Option<Record> {
        self.unsaved.take()
    }

    /// Says where the controller is really reached while its LAN parameters name no port.
    pub fn set_port(&mut self, port: u16) {
        self.config.port = port;
    }

    /// The Modbus unit identifier in effect.
    pub fn unit(&self) -> u8 {
        self.memory.lan.id
    }

    /// What it runs, which decides what it speaks over LAN.
    pub fn firmware(&self) -> Firmware {
        self.config.firmware
    }

    /// The version of the standard protocol that it speaks, 1 or 2.
    pub fn protocol_version(&self) -> u8 {
        self.config.protocol_version
    }

    /// The model.
    pub fn model(&self) -> Model {
        self.config.model
    }

    /// Whether it has its supply.
    pub fn is_on(&self) -> bool {
        self.on
    }

    /// `true` when the relay is on.
    pub fn relay(&self) -> bool {
        self.relay
    }

    /// The user program as it stands.
    pub fn program(&self) -> Program {
        Program {
            running: self.interpreter.is_running(),
            place: self.interpreter.place(),
            executed: self.interpreter.executed(),
            waiting: self.interpreter.waiting(),
        }
    }

    /// The levels of the inputs, a bit each.
    pub fn inputs(&self) -> u8 {
        self.inputs.levels()
    }

    /// The status word at `now`.
    pub fn status(&self, now: Instant) -> Status {
        let motion = match self.motor.phase(now) {
            Phase::Stopped => MotStatus::Stopped,
            Phase::Accelerating => MotStatus::Accelerating,
            Phase::Decelerating => MotStatus::Decelerating,
            Phase::Constant => MotStatus::ConstantSpeed,
        };
        Status {
            hi_z: !self.motor.energised(),
            ready: self.ready(),
            sw_f: self.inputs.level(Input::Sw),
            sw_evn: self.motor.switch_event(),
            forward: self.motor.direction() == Direction::Forward,
            motion,
            cmd_error: self.motor.command_error(),
        }
    }

    /// `ABS_POS` at `now`, in microsteps.
    pub fn position(&self, now: Instant) -> i32 {
        self.motor.position(now)
    }

    /// The mark: the position that `SCAN_MARK` and the like have remembered, in microsteps.
    pub fn mark(&self) -> i32 {
        self.motor.mark()
    }

    /// `SPEED` at `now`, in full steps per second.
    pub fn speed(&self, now: Instant) -> f64 {
        self.motor.speed(now)
    }

    /// Where the rotor would be at `now` if nothing held it, in [`crate::controller::ROTOR_UNITS`] to the full step, from where it
    /// was at power-up. Between two calls that change the controller or handle a wake-up it goes one way only.
    pub fn rotor(&self, now: Instant) -> i64 {
        self.motor.rotor(now)
    }

    /// The direction in which the rotor turns now, or turned last.
    pub fn direction(&self) -> Direction {
        self.motor.direction()
    }

    /// The instant at which the rotor, as it turns now, first reaches or passes `position`; `None` when it will not
    /// before the next wake-up changes its course.
    pub fn when_rotor_reaches(&self, position: i64) -> Option<Instant> {
        self.motor.when_rotor_reaches(position)
    }

    /// Where the rotor will be when the motion in progress ends as it is planned, if nothing holds it; `None` when there is
    /// none, and of a run.
    pub fn destination(&self) -> Option<i64> {
        self.motor.destination()
    }

    fn ready(&self) -> bool {
        self.motor.ready() && self.seek.is_none()
    }
}
