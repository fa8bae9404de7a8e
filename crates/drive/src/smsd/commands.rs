//! What the `CMD` register, the coils and programs can make the controller do (ch. 4.2; decisions 8, 18 to 21).

use super::Smsd;
use super::inputs::{Arrival, Seek};
use super::powerstep01::{Parameters, PowerStep01};
use Direction::{Forward, Reverse};
use core::fmt;
use stepdrive_motion::Direction;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Opcode, Operand};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::ring;
use stepdrive_spec::smsd::standard::Counter;
use stepdrive_spec::smsd::timing::{CALL_DEPTH, LOOP_DEPTH};
use stepdrive_spec::time::Instant;

/// The registers that give `CMD` its parameters, and `CMD` itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct CommandRegisters {
    pub(super) target_speed: u16,
    /// May be out of the range of positions when it was written in halves.
    pub(super) target_pos: i32,
    pub(super) target_input: u16,
    pub(super) cmd: u16,
}

impl CommandRegisters {
    pub(super) fn power_up() -> CommandRegisters {
        let target_speed = u16::try_from(Reg::TargetSpeed.info().default).unwrap_or(u16::MAX);
        CommandRegisters { target_speed, target_pos: 0, target_input: 0, cmd: 0 }
    }
}

/// A line of a user program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The memory area, 0 to 3.
    pub area: u8,
    /// The line in it, from 0; 255 is past its end.
    pub line: u16,
}

impl Place {
    /// The line that the data bits of a jump name: bits 7:0 the line, 9:8 the memory area. The bits above are ignored.
    pub(super) fn from_data(data: u32) -> Place {
        let [line, area, ..] = data.to_le_bytes();
        Place { area: area & 3, line: line.into() }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "mem{}:{}", self.area, self.line)
    }
}

/// A command or an instruction of a program that was not carried out: it set `CMD_ERROR`, ended the program that it
/// stood in, and changed nothing else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The command; `None` when a word of a program is none.
    pub opcode: Option<Opcode>,
    /// Why.
    pub why: Why,
    /// The line of the program; `None` when it came from the host.
    pub place: Option<Place>,
}

/// Why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// It wants a standing motor, and the motor turns at so many full steps per second.
    Turning(u16),
    /// It wants the motion before it to have ended.
    NotReady,
    /// It wants a de-energised motor.
    Energised,
    /// It names an input that does not exist.
    NoSuchInput(i32),
    /// Its value is out of range.
    OutOfRange {
        /// The value.
        value: i32,
        /// The lowest that is allowed.
        min: i32,
        /// The highest.
        max: i32,
    },
    /// It sets a motor configuration that this model does not have.
    NoSuchMode,
    /// It does not belong into a program.
    NotInProgram,
    /// A word of the program is no instruction.
    NotAnInstruction(u32),
    /// There is no call to return from.
    NoCall,
    /// Too many subprograms have not returned.
    TooManyCalls,
    /// Too many loops have not ended.
    TooManyLoops,
}

impl Why {
    /// Whether its operand is why: it would not be carried out in any state.
    pub(super) fn is_operand(self) -> bool {
        matches!(self, Why::OutOfRange { .. } | Why::NoSuchInput(_) | Why::NoSuchMode)
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = self.place {
            write!(f, "program ended at {place}: ")?;
        }
        if let Some(opcode) = self.opcode {
            write!(f, "{opcode} refused: ")?;
        }
        self.why.fmt(f)
    }
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Why::Turning(speed) => {
                write!(f, "the motor is turning (SPEED {speed}); stop it first, or use GO_TO or RUN")
            }
            Why::NotReady => {
                write!(f, "the motion before it has not ended (READY is 0); wait for READY or stop the motor")
            }
            Why::Energised => write!(f, "the motor is energised (HiZ is 0); SOFT_HI_Z or HARD_HI_Z first"),
            Why::NoSuchInput(number) => {
                write!(
                    f,
                    "there is no input {number}; inputs are 0 to 7, for IN0, IN1, SET_ZERO ... CONTINUE"
                )
            }
            Why::OutOfRange { value, min, max } => {
                write!(f, "its value {value} is not within {min} to {max}")
            }
            Why::NoSuchMode => write!(f, "this model has no such motor or current; see the register table"),
            Why::NotInProgram => write!(f, "it answers the host and has no place in a program"),
            Why::NotAnInstruction(word) => write!(f, "the word {word:#010X} is no instruction"),
            Why::NoCall => write!(f, "no CALL_PROGRAM has been made that it could return from"),
            Why::TooManyCalls => {
                write!(f, "{CALL_DEPTH} subprograms have not returned yet, and more cannot be open")
            }
            Why::TooManyLoops => write!(f, "{LOOP_DEPTH} loops have not ended yet, and more cannot be open"),
        }
    }
}

impl Smsd {
    /// Carries out the command that was written to `CMD`, with the parameters in the registers.
    pub(super) fn command(&mut self, now: Instant, opcode: Opcode) {
        self.registers.cmd = u16::from(opcode.code());
        let operand = match opcode.info().operand {
            Operand::Number { .. } => i32::from(self.registers.target_speed),
            Operand::Position => self.registers.target_pos,
            Operand::Input => i32::from(self.registers.target_input),
            Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => 0,
        };
        if let Err(why) = self.execute(now, opcode, operand) {
            self.refuse(Refusal { opcode: Some(opcode), why, place: None });
        }
    }

    /// Sets `CMD_ERROR`, counts, and tells the world if the flag was clear before.
    pub(super) fn refuse(&mut self, refusal: Refusal) {
        self.count(Counter::CommandPowerstep01);
        if refusal.place.is_some() {
            self.count(Counter::WorkProgram);
        }
        if self.motor.raise_command_error() {
            self.refusal = Some(refusal);
        }
    }

    /// Carries out a command, or an instruction that acts on the motor or the controller. What is wrong with the operand is
    /// found before what the motor's state does not allow.
    #[allow(clippy::too_many_lines, reason = "one line an instruction, in the order of what they do")]
    pub(super) fn execute(&mut self, now: Instant, opcode: Opcode, operand: i32) -> Result<(), Why> {
        match opcode {
            Opcode::RunF => self.run(now, Forward, operand)?,
            Opcode::RunR => self.run(now, Reverse, operand)?,
            Opcode::MoveF => self.move_by(now, i64::from(position(operand)?))?,
            Opcode::MoveR => self.move_by(now, -i64::from(position(operand)?))?,
            Opcode::GoToF => self.go_to(now, position(operand)?, ring::forward)?,
            Opcode::GoToR => self.go_to(now, position(operand)?, ring::reverse)?,
            Opcode::GoTo => self.go_to(now, position(operand)?, ring::shortest)?,
            Opcode::GoZero => self.go_to(now, 0, ring::shortest)?,
            Opcode::GoMark => self.go_to(now, self.motor.mark(), ring::shortest)?,
            Opcode::GoUntilF => self.go_until(now, Forward, operand)?,
            Opcode::GoUntilR => self.go_until(now, Reverse, operand)?,
            Opcode::ScanZeroF => self.scan(now, Input::SetZero, Arrival::Zero, Forward, operand)?,
            Opcode::ScanZeroR => self.scan(now, Input::SetZero, Arrival::Zero, Reverse, operand)?,
            Opcode::ScanMarkF => self.scan(now, Input::In1, Arrival::Mark, Forward, operand)?,
            Opcode::ScanMarkR => self.scan(now, Input::In1, Arrival::Mark, Reverse, operand)?,
            Opcode::ScanMark2F => self.scan(now, Input::In1, Arrival::MarkAndBrake, Forward, operand)?,
            Opcode::ScanMark2R => self.scan(now, Input::In1, Arrival::MarkAndBrake, Reverse, operand)?,
            Opcode::SoftStop => self.stop(now, PowerStep01::soft_stop),
            Opcode::HardStop => self.stop(now, PowerStep01::hard_stop),
            Opcode::SoftHiZ => self.stop(now, PowerStep01::soft_hi_z),
            Opcode::HardHiZ => self.stop(now, PowerStep01::hard_hi_z),
            Opcode::ResetPos => self.motor.reset_position(now),
            Opcode::ResetPowerstep01 => self.reset_motor_chip(now),
            Opcode::SetMode => self.set_mode(now, operand.cast_unsigned())?,
            Opcode::SetMinSpeed => self.set_standing(now, opcode, operand, |chip| &mut chip.min_speed)?,
            Opcode::SetMaxSpeed => self.set(now, opcode, operand, |chip| &mut chip.max_speed)?,
            Opcode::SetAcc => self.set_standing(now, opcode, operand, |chip| &mut chip.acc)?,
            Opcode::SetDec => self.set_standing(now, opcode, operand, |chip| &mut chip.dec)?,
            Opcode::SetFsSpeed => self.set(now, opcode, operand, |chip| &mut chip.fs_speed)?,
            Opcode::SetMaskEvent => self.set_mask(now, operand.to_le_bytes()[0]),
            Opcode::SetRele => self.relay = true,
            Opcode::ClrRele => self.relay = false,
            Opcode::StartProgramMem0 => self.start_program(now, 0),
            Opcode::StartProgramMem1 => self.start_program(now, 1),
            Opcode::StartProgramMem2 => self.start_program(now, 2),
            Opcode::StartProgramMem3 => self.start_program(now, 3),
            Opcode::StopProgramMem => self.stop_program(),
            // The interpreter carries these out itself; `CMD` does not take them.
            Opcode::End
            | Opcode::SetWait
            | Opcode::SetWait2
            | Opcode::WaitIn0
            | Opcode::WaitIn1
            | Opcode::WaitContinue
            | Opcode::GotoProgram
            | Opcode::GotoProgramIfIn0
            | Opcode::GotoProgramIfIn1
            | Opcode::GotoProgramIfZero
            | Opcode::GotoProgramIfInZero
            | Opcode::LoopProgram
            | Opcode::CallProgram
            | Opcode::ReturnProgram
            // These answer the host over USB; in a program they are an error (decision 23).
            | Opcode::GetSpeed
            | Opcode::StatusInEvent
            | Opcode::GetMode
            | Opcode::GetAbsPos
            | Opcode::GetElPos
            | Opcode::GetStatusAndClr
            | Opcode::GetRele
            | Opcode::StepClock
            | Opcode::StopUsb
            | Opcode::GetMinSpeed
            | Opcode::GetMaxSpeed
            | Opcode::GetStack => return Err(Why::NotInProgram),
        }
        Ok(())
    }

    /// `STEP_CLOCK`: hands the standing motor to `EN`, `STEP` and `DIR`. While `EN` is present it is energised, and each
    /// signal that comes to `STEP` moves it by a microstep, forward while `DIR` is present; a masked input is not there.
    /// Motion commands, stops and a reset of the motor chip take the motor back. A turning motor sets `CMD_ERROR`.
    ///
    /// Neither `CMD` nor a program takes this command: it belongs to the standard binary protocol.
    pub fn step_clock(&mut self, now: Instant) {
        if let Err(why) = self.standing(now) {
            return self.refuse(Refusal { opcode: Some(Opcode::StepClock), why, place: None });
        }
        self.seek = None;
        self.motor.begin_step_clock(now, self.inputs.signals(Input::En));
        self.release_program(now);
    }

    /// Ends whatever the motor does, in one of the four ways.
    pub(super) fn stop(&mut self, now: Instant, how: impl FnOnce(&mut PowerStep01, Instant)) {
        self.seek = None;
        how(&mut self.motor, now);
    }

    /// `RESET_POWERSTEP01`: always accepted (decision 21). The position, the mark, the flags and `MIN_SPEED` to
    /// `FS_SPEED` are as at power-up; mask, relay, targets and programs belong to the controller and stay.
    pub(super) fn reset_motor_chip(&mut self, now: Instant) {
        self.seek = None;
        self.motor.reset(now);
    }

    fn standing(&self, now: Instant) -> Result<(), Why> {
        self.motor.standing(now).then_some(()).ok_or_else(|| Why::Turning(self.motor.whole_speed(now)))
    }

    /// Sets a parameter of the motor chip.
    fn set(
        &mut self,
        now: Instant,
        opcode: Opcode,
        operand: i32,
        parameter: impl FnOnce(&mut Parameters) -> &mut u16,
    ) -> Result<(), Why> {
        let value = number(opcode, operand)?;
        self.motor.set_parameters(now, |chip| *parameter(chip) = value);
        Ok(())
    }

    /// Sets a parameter that the chip takes while the motor stands.
    fn set_standing(
        &mut self,
        now: Instant,
        opcode: Opcode,
        operand: i32,
        parameter: impl FnOnce(&mut Parameters) -> &mut u16,
    ) -> Result<(), Why> {
        let _: u16 = number(opcode, operand)?;
        self.standing(now)?;
        self.set(now, opcode, operand, parameter)
    }

    /// `SET_MODE`.
    fn set_mode(&mut self, now: Instant, data: u32) -> Result<(), Why> {
        let mode = MotorConfiguration::from_data(data);
        if !self.fits(Reg::MotorType, mode.motor_type) || !self.fits(Reg::WorkCurrent, mode.work_current) {
            return Err(Why::NoSuchMode);
        }
        if self.motor.energised() {
            return Err(Why::Energised);
        }
        self.configure_motor(now, |present| *present = mode);
        Ok(())
    }

    fn run(&mut self, now: Instant, direction: Direction, operand: i32) -> Result<(), Why> {
        let speed = f64::from(number::<u16>(Opcode::RunF, operand)?);
        self.seek = None;
        self.motor.run(now, direction, speed);
        Ok(())
    }

    fn move_by(&mut self, now: Instant, displacement: i64) -> Result<(), Why> {
        self.standing(now)?;
        self.motor.move_by(now, displacement);
        Ok(())
    }

    fn go_to(&mut self, now: Instant, target: i32, way: fn(i32, i32) -> i64) -> Result<(), Why> {
        if !self.ready() {
            return Err(Why::NotReady);
        }
        self.motor.move_by(now, way(self.motor.position(now), target));
        Ok(())
    }

    fn go_until(&mut self, now: Instant, direction: Direction, operand: i32) -> Result<(), Why> {
        let number = u16::try_from(operand).map_err(|_| Why::NoSuchInput(operand))?;
        let input = Input::from_number(number).ok_or(Why::NoSuchInput(operand))?;
        self.seek(now, Seek { input, arrival: Arrival::Brake }, direction, f64::INFINITY);
        Ok(())
    }

    fn scan(
        &mut self,
        now: Instant,
        input: Input,
        arrival: Arrival,
        direction: Direction,
        operand: i32,
    ) -> Result<(), Why> {
        let speed = f64::from(number::<u16>(Opcode::ScanZeroF, operand)?);
        self.seek(now, Seek { input, arrival }, direction, speed);
        Ok(())
    }
}

/// A numeric operand, if it is within the range that the instruction's row gives.
pub(super) fn number<T: TryFrom<i32>>(opcode: Opcode, value: i32) -> Result<T, Why> {
    let (min, max) = match opcode.info().operand {
        Operand::Number { min, max, .. } => (min.cast_signed(), max.cast_signed()),
        Operand::None
        | Operand::Position
        | Operand::Mask
        | Operand::Input
        | Operand::Mode
        | Operand::Jump
        | Operand::Loop => (i32::MIN, i32::MAX),
    };
    let within = (min..=max).contains(&value).then_some(value).and_then(|value| T::try_from(value).ok());
    within.ok_or(Why::OutOfRange { value, min, max })
}

/// A position or displacement operand in microsteps.
fn position(operand: i32) -> Result<i32, Why> {
    let (min, max) = (ring::MIN, ring::MAX);
    (min..=max).contains(&operand).then_some(operand).ok_or(Why::OutOfRange { value: operand, min, max })
}
