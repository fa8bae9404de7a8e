//! What every driver of an SMSD offers, whatever line it speaks over.

use super::commands::{Way, either};
use super::network::LanParameters;
use super::program::check_area;
use super::registers::Reading;
use super::settings::{Identity, model_of};
use super::snapshot::{ProgramState, Snapshot, State};
use crate::connect::BoxFuture;
use crate::direction::Direction;
use crate::error::Error;
use std::fmt;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::status::Status;

/// What a call comes to.
pub type Answer<'a, T> = BoxFuture<'a, Result<T, Error>>;

/// Told how many instructions are done.
pub type Progress<'a> = &'a mut (dyn FnMut(usize) + Send);

/// Something that can be sent, for [`Smsd::sent_for`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A value to a register.
    Write(Reg, i64),
    /// A command with its operand.
    Command(Opcode, Option<i64>),
}

/// An SMSD's host over one kind of line.
///
/// Values have the names and units of the register map wherever they come from. Every future may be dropped at any point.
/// Where no errors are told, they are those of [`Smsd::read_at`] for what reads and of [`Smsd::write_at`] for what writes.
pub trait Smsd: Send + Sync + fmt::Debug {
    // ---- the line

    /// What errors call the controller.
    fn name(&self) -> BoxFuture<'_, String>;

    /// How often it has connected. Another number than before: much may have happened to the controller meanwhile.
    fn connections(&self) -> BoxFuture<'_, u64>;

    /// Connects and logs in, unless that is done already. Nothing moves by it.
    ///
    /// # Errors
    /// [`Error::Line`] and [`Error::NotAuthorised`]; [`Error::Usage`] when it cannot be tried with this password.
    fn log_in(&self) -> Answer<'_, ()>;

    /// Closes the connection. The next request opens another.
    fn close(&self) -> BoxFuture<'_, ()>;

    /// What is sent for something, for people: a line for each request, its bytes in hexadecimal and what they say.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no way to send it.
    fn sent_for(&self, step: Step) -> Answer<'_, Vec<String>>;

    // ---- registers

    /// Whether a register can be read over this line, and tells something. Nothing is sent.
    ///
    /// # Errors
    /// [`Error::Usage`], which says why not.
    fn check_readable(&self, reg: Reg) -> Result<(), Error>;

    /// What a register that cannot be read over this line may hold: what was written to it last from here, or else what it
    /// holds at power-up.
    fn supposed(&self, reg: Reg) -> i64 {
        reg.info().default
    }

    /// Whether a register is only kept here when it is written, and goes out with the next command. By itself it is nothing
    /// to set then.
    fn keeps(&self, _reg: Reg) -> bool {
        false
    }

    /// Reads one of several registers in a row of the map, as an octet of `IP {}`. Bits read as 0 and 1.
    ///
    /// # Errors
    /// [`Error::Line`], [`Error::NotAuthorised`], [`Error::Device`]; [`Error::Usage`] when the row has not so many, or it
    /// cannot be read over this line.
    fn read_at(&self, reg: Reg, index: u16) -> Answer<'_, i64>;

    /// Reads a register; of several in a row of the map the first.
    fn read(&self, reg: Reg) -> Answer<'_, i64> {
        self.read_at(reg, 0)
    }

    /// Reads all registers of a row of the map.
    fn read_row(&self, reg: Reg) -> Answer<'_, Vec<i64>>;

    /// Reads registers, of several in a row of the map the first, in as few requests as can be. The values stand in the
    /// order of `regs`. Only those of one request are of the same moment.
    fn read_many<'a>(&'a self, regs: &'a [Reg]) -> Answer<'a, Vec<i64>>;

    /// Reads every register that can be read over this line and tells something, in the order of the map.
    fn read_all(&self) -> Answer<'_, Vec<Reading>>;

    /// Writes one of several registers in a row of the map. What acts is sent once and never repeated.
    ///
    /// # Errors
    /// [`Error::Usage`] when the register cannot be written over this line, or not with this value: nothing was sent then.
    /// [`Error::Refused`] when the controller refuses it, as while the motor turns. [`Error::Line`],
    /// [`Error::NotAuthorised`], [`Error::Device`]. [`Error::Partly`] when no reply came, however often it was written;
    /// [`Error::Uncertain`] when what acts was not answered.
    fn write_at(&self, reg: Reg, index: u16, value: i64) -> Answer<'_, ()>;

    /// Writes a register; of several in a row of the map the first.
    fn write(&self, reg: Reg, value: i64) -> Answer<'_, ()> {
        self.write_at(reg, 0, value)
    }

    /// Writes registers that hold a value. All are checked before anything is sent.
    ///
    /// # Errors
    /// Those of [`Smsd::write_at`]. A request refused leaves those before it written: the error names the registers that it
    /// is about.
    fn write_many<'a>(&'a self, values: &'a [(Reg, i64)]) -> Answer<'a, ()>;

    // ---- what the controller is, and how it stands

    /// What the controller says that it is.
    fn identity(&self) -> Answer<'_, Identity>;

    /// The model; `None` for one that the maker does not list, or of a controller that does not tell.
    fn model(&self) -> Answer<'_, Option<Model>> {
        Box::pin(async move {
            let hw_major = self.read(Reg::HwMajor).await?;
            Ok(u16::try_from(hw_major).ok().and_then(model_of))
        })
    }

    /// What the motor does and which inputs there are signals at.
    fn snapshot(&self) -> Answer<'_, Snapshot>;

    /// The status flags alone.
    fn status(&self) -> Answer<'_, Status> {
        Box::pin(async move {
            let word = self.read(Reg::StatusWord).await?;
            Ok(Status::from_word(u16::try_from(word).unwrap_or(0)))
        })
    }

    /// The user program.
    fn program(&self) -> Answer<'_, ProgramState>;

    /// Whether the relay is on.
    fn relay(&self) -> Answer<'_, bool> {
        Box::pin(async move { Ok(self.read(Reg::Relay).await? != 0) })
    }

    /// Switches the relay.
    fn set_relay(&self, on: bool) -> Answer<'_, ()> {
        self.write(Reg::Relay, on.into())
    }

    /// Motor, inputs, relay and program, one after another.
    fn state(&self) -> Answer<'_, State> {
        Box::pin(async move {
            let motor = self.snapshot().await?;
            let relay = self.relay().await?;
            Ok(State { motor, relay, program: self.program().await? })
        })
    }

    // ---- settings

    /// The motor configuration.
    fn motor_configuration(&self) -> Answer<'_, MotorConfiguration>;

    /// Sets the motor configuration, all of it in one request, and reads it back. The motor must be de-energised.
    ///
    /// # Errors
    /// Those of [`Smsd::write_at`]; [`Error::Differs`] when it does not read back as it was written.
    fn set_motor_configuration<'a>(&'a self, motor: &'a MotorConfiguration) -> Answer<'a, ()>;

    /// Changes the password, of the controller and of this driver. Connections that are logged in stay so. Where a lost
    /// reply leaves a doubt, the driver knows both from then on.
    fn change_password(&self, password: u64) -> Answer<'_, ()>;

    /// The LAN parameters as they are written down.
    ///
    /// # Errors
    /// Those of [`Smsd::read_at`]; [`Error::Device`] when one of them is out of its range.
    fn lan_parameters(&self) -> Answer<'_, LanParameters>;

    /// Stores the LAN parameters and puts them into effect: the controller closes all connections over LAN, and may be
    /// elsewhere afterwards.
    ///
    /// # Errors
    /// Those of [`Smsd::write_at`]; [`Error::Differs`] when they do not read back as they were written; [`Error::Partly`]
    /// when they were written, and may not be in effect.
    fn configure_lan<'a>(&'a self, lan: &'a LanParameters) -> Answer<'a, ()>;

    // ---- commands

    /// Carries out a command of `CMD`, with its operand where it has one: a speed, a position or displacement in
    /// microsteps, or the number of an input. It is sent once. Before any but stops and `STOP_PROGRAM_MEM` it is seen to
    /// that `CMD_ERROR` is clear.
    ///
    /// # Errors
    /// [`Error::Usage`] for a code that `CMD` does not take, or an operand that is out of range, missing or too many: nothing
    /// was sent. [`Error::Fault`] when `CMD_ERROR` was set before: nothing moves. [`Error::Refused`] when the command could
    /// not be carried out. [`Error::Uncertain`] when it was not answered. [`Error::Line`] and [`Error::NotAuthorised`] when
    /// the command was not sent; [`Error::Partly`] when only the outcome could not be read.
    fn command(&self, opcode: Opcode, operand: Option<i64>) -> Answer<'_, ()>;

    /// Lets a coil act, once.
    ///
    /// # Errors
    /// [`Error::Usage`] when it is none that acts. [`Error::Line`] and [`Error::NotAuthorised`] when it was not sent;
    /// [`Error::Uncertain`] when it was and there is no reply.
    fn trigger(&self, coil: Reg) -> Answer<'_, ()>;

    /// Turns at a speed in full steps per second until something stops it: `RUN_F`, `RUN_R`.
    ///
    /// # Errors
    /// Those of [`Smsd::command`], as for all commands below.
    fn run(&self, direction: Direction, speed: i64) -> Answer<'_, ()> {
        self.command(either(direction, Opcode::RunF, Opcode::RunR), Some(speed))
    }

    /// Moves by a displacement in microsteps, negative backward: `MOVE_F`. The motor must stand.
    fn move_by(&self, microsteps: i64) -> Answer<'_, ()> {
        self.command(Opcode::MoveF, Some(microsteps))
    }

    /// Goes to a position in microsteps: `GO_TO`, `GO_TO_F`, `GO_TO_R`. The motion before it must have ended.
    fn move_to(&self, position: i64, way: Way) -> Answer<'_, ()> {
        self.command(way.opcode(), Some(position))
    }

    /// Goes to position 0 the shorter way: `GO_ZERO`.
    fn go_zero(&self) -> Answer<'_, ()> {
        self.command(Opcode::GoZero, None)
    }

    /// Goes to the mark the shorter way: `GO_MARK`.
    fn go_mark(&self) -> Answer<'_, ()> {
        self.command(Opcode::GoMark, None)
    }

    /// Turns at `MAX_SPEED` until an input signals, then brakes: `GO_UNTIL_F`, `GO_UNTIL_R`.
    fn go_until(&self, direction: Direction, input: Input) -> Answer<'_, ()> {
        self.command(either(direction, Opcode::GoUntilF, Opcode::GoUntilR), Some(input.number().into()))
    }

    /// Turns until `SET_ZERO` signals, stops at once and takes the position as zero: `SCAN_ZERO_F`, `SCAN_ZERO_R`.
    fn scan_zero(&self, direction: Direction, speed: i64) -> Answer<'_, ()> {
        self.command(either(direction, Opcode::ScanZeroF, Opcode::ScanZeroR), Some(speed))
    }

    /// Turns until `IN1` signals, stops at once and remembers the position as the mark: `SCAN_MARK_F`, `SCAN_MARK_R`.
    fn scan_mark(&self, direction: Direction, speed: i64) -> Answer<'_, ()> {
        self.command(either(direction, Opcode::ScanMarkF, Opcode::ScanMarkR), Some(speed))
    }

    /// Turns until `IN1` signals, remembers that position as the mark and brakes: `SCAN_MARK2_F`, `SCAN_MARK2_R`.
    fn scan_mark_braking(&self, direction: Direction, speed: i64) -> Answer<'_, ()> {
        self.command(either(direction, Opcode::ScanMark2F, Opcode::ScanMark2R), Some(speed))
    }

    /// Brakes with `DEC` and holds: the coil `Soft STOP`.
    ///
    /// # Errors
    /// Those of [`Smsd::trigger`], as for all coils below.
    fn soft_stop(&self) -> Answer<'_, ()> {
        self.trigger(Reg::SoftStop)
    }

    /// Stops at once and holds: the coil `Hard STOP`.
    fn hard_stop(&self) -> Answer<'_, ()> {
        self.trigger(Reg::HardStop)
    }

    /// Brakes with `DEC` and de-energises: the coil `Soft HiZ`.
    fn soft_hi_z(&self) -> Answer<'_, ()> {
        self.trigger(Reg::SoftHiZ)
    }

    /// Stops at once and de-energises: the coil `Hard HiZ`.
    fn hard_hi_z(&self) -> Answer<'_, ()> {
        self.trigger(Reg::HardHiZ)
    }

    /// Clears `CMD_ERROR` and `SW_EVN`: the coil `CLR`.
    fn clear_flags(&self) -> Answer<'_, ()> {
        self.trigger(Reg::Clr)
    }

    /// Takes the present position as zero: the coil `Reset Pos`.
    fn reset_position(&self) -> Answer<'_, ()> {
        self.trigger(Reg::ResetPos)
    }

    /// Resets the motor chip: de-energised, position 0, drive parameters as at power-up. The coil `Reset powerSTEP01`.
    fn reset_motor_chip(&self) -> Answer<'_, ()> {
        self.trigger(Reg::ResetPowerstep01)
    }

    // ---- programs

    /// Stores a program of up to 255 instructions in memory area 0 to 3, and reads it back. What was there is erased.
    /// `progress` is told how many instructions have been written or read back so far: twice the length of the program at
    /// its end.
    ///
    /// # Errors
    /// Those of [`Smsd::write_at`]; [`Error::Usage`] when there is no such area or the program is too long;
    /// [`Error::Refused`] while the program in that area runs; [`Error::Differs`] when it does not read back as it was
    /// written; [`Error::Partly`] when part of it is in the memory.
    fn store_program_with<'a>(
        &'a self,
        area: u8,
        program: &'a [Instruction],
        progress: Progress<'a>,
    ) -> Answer<'a, ()>;

    /// The same without being told.
    fn store_program<'a>(&'a self, area: u8, program: &'a [Instruction]) -> Answer<'a, ()> {
        Box::pin(async move { self.store_program_with(area, program, &mut |_| {}).await })
    }

    /// The program in memory area 0 to 3. `progress` is told how many instructions have been read so far.
    ///
    /// # Errors
    /// Those of [`Smsd::write_at`]; [`Error::Usage`] when there is no such area; [`Error::Device`] when what is there is no
    /// program.
    fn fetch_program_with<'a>(&'a self, area: u8, progress: Progress<'a>) -> Answer<'a, Vec<Instruction>>;

    /// The same without being told.
    fn fetch_program(&self, area: u8) -> Answer<'_, Vec<Instruction>> {
        Box::pin(async move { self.fetch_program_with(area, &mut |_| {}).await })
    }

    /// Erases memory area 0 to 3, and reads back that it is empty.
    fn erase_program(&self, area: u8) -> Answer<'_, ()>;

    /// Starts the program in memory area 0 to 3; one that runs ends.
    ///
    /// # Errors
    /// Those of [`Smsd::command`]; [`Error::Usage`] when there is no such area.
    fn start_program(&self, area: u8) -> Answer<'_, ()> {
        Box::pin(async move {
            check_area(area)?;
            let code = Opcode::StartProgramMem0.code() + area;
            let opcode = Opcode::from_cmd(code.into()).unwrap_or(Opcode::StartProgramMem0);
            self.command(opcode, None).await
        })
    }

    /// Stops the program that runs; the motor goes on as it was.
    fn stop_program(&self) -> Answer<'_, ()> {
        self.command(Opcode::StopProgramMem, None)
    }
}

impl<S: Smsd + 'static> From<S> for Box<dyn Smsd> {
    fn from(driver: S) -> Box<dyn Smsd> {
        Box::new(driver)
    }
}
