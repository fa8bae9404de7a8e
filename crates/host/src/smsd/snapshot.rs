//! How a controller stands.

use super::client::SmsdClient;
use super::value::{Run, Slot};
use crate::Error;
use std::fmt;
use std::sync::LazyLock;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::registers::{REGISTERS, Reg};
use stepdrive_spec::smsd::status::{MotStatus, Status};

/// What a [`Snapshot`] is made of.
static MOTOR: LazyLock<Vec<Slot>> = LazyLock::new(|| between(Reg::Speed, Reg::Inputs));

/// What a controller's motor does, of one moment: one request reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// `STATUS`.
    pub status: Status,
    /// `ABS_POS`, in microsteps.
    pub position: i32,
    /// `SPEED`, in full steps per second.
    pub speed: u16,
    /// `EL_POS`: bits 8:7 full step, 6:0 microstep in 1/128.
    pub el_pos: u16,
    /// `Inputs`, a bit each.
    pub inputs: u8,
}

impl Snapshot {
    /// Whether the motor turns.
    pub fn is_moving(&self) -> bool {
        self.status.motion != MotStatus::Stopped
    }

    /// Whether there is a signal at an input.
    pub fn input(&self, input: Input) -> bool {
        self.inputs & input.bit() != 0
    }
}

impl fmt::Display for Snapshot {
    /// As in `the motor turns forward at 500 full steps/s (gaining speed), position 1234 microsteps, READY 0`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let way = if self.status.forward { "forward" } else { "backward" };
        let speed = self.speed;
        match self.status.motion {
            MotStatus::Stopped if self.status.hi_z => write!(f, "the motor stands, de-energised"),
            MotStatus::Stopped => write!(f, "the motor stands, energised"),
            MotStatus::Accelerating => {
                write!(f, "the motor turns {way} at {speed} full steps/s (gaining speed)")
            }
            MotStatus::Decelerating => {
                write!(f, "the motor turns {way} at {speed} full steps/s (losing speed)")
            }
            MotStatus::ConstantSpeed => write!(f, "the motor turns {way} at {speed} full steps/s"),
        }?;
        write!(f, ", position {} microsteps, READY {}", self.position, u8::from(self.status.ready))?;
        if self.status.cmd_error { f.write_str(", CMD_ERROR is set") } else { Ok(()) }
    }
}

/// The user program as it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProgramState {
    /// `PROGRAM_RUN`; `None` where the line does not tell.
    pub running: Option<bool>,
    /// `N_PROGRAM`: the memory area of the program that runs, or ran last.
    pub area: u16,
    /// `N_COMMAND`: its line.
    pub line: u16,
    /// `MODE_N_PROGRAMS`: the program that autonomous mode runs.
    pub autonomous: u16,
}

/// All that changes by itself or by commands. Its parts are read one after another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// The motor and the inputs.
    pub motor: Snapshot,
    /// The relay output.
    pub relay: bool,
    /// The user program.
    pub program: ProgramState,
}

impl SmsdClient {
    /// What the motor does and which inputs there are signals at, in one request.
    ///
    /// # Errors
    /// Those of [`SmsdClient::read_at`].
    pub async fn snapshot(&self) -> Result<Snapshot, Error> {
        let values = self.read_run(Run { slots: &MOTOR }).await?;
        let value = |reg: Reg| {
            MOTOR.iter().zip(&values).find(|(slot, _)| slot.row.id == reg).map_or(0, |(_, value)| *value)
        };
        let word = |reg: Reg| u16::try_from(value(reg)).unwrap_or(u16::MAX);
        Ok(Snapshot {
            status: Status::from_word(word(Reg::StatusWord)),
            position: i32::try_from(value(Reg::AbsPos)).unwrap_or(i32::MAX),
            speed: word(Reg::Speed),
            el_pos: word(Reg::ElPos),
            inputs: word(Reg::Inputs).to_le_bytes()[0],
        })
    }

    /// The user program, in two requests.
    ///
    /// # Errors
    /// Those of [`SmsdClient::read_at`].
    pub async fn program(&self) -> Result<ProgramState, Error> {
        let regs = [Reg::ProgramRun, Reg::NProgram, Reg::NCommand, Reg::ModeNPrograms];
        let values = self.read_many(&regs).await?;
        let value =
            |place: usize| values.get(place).and_then(|value| u16::try_from(*value).ok()).unwrap_or(0);
        Ok(ProgramState {
            running: Some(value(0) != 0),
            area: value(1),
            line: value(2),
            autonomous: value(3),
        })
    }
}

/// The registers of the map from one to another.
pub(super) fn between(first: Reg, last: Reg) -> Vec<Slot> {
    let rows = REGISTERS.iter().filter(|row| (first..=last).contains(&row.id));
    rows.flat_map(Slot::all).collect()
}
