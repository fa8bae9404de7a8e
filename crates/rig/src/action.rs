//! What can be done to a rig while it runs, and how it is written.
//!
//! | text | meaning |
//! |---|---|
//! | `input DRIVE.INPUT 1` / `0` / `release` | force an input, or leave it to what is wired to it |
//! | `input DRIVE.INPUT pulse 5ms` | a pulse; `x200 every 10ms` behind it makes a train of them |
//! | `fault DRIVE.FAULT SETTING` | a fault as in [`crate::fault`]; `off` ends it |
//! | `power DRIVE off` / `on` | take the supply away, or bring it back |
//! | `panel DRIVE LA` / `bF` | the mode at an SMSD's front panel; a program number 0 to 3 may follow |
//! | `wire DRIVE.OUTPUT DRIVE.INPUT cut` / `mend` | a wire of the rig file |
//!
//! All but pulses, panels and wires may end with `for DURATION`: then it is taken back by itself.
//! The same words are used in scenarios, in the control API, on the command line and in recordings.

use crate::any::AnyMachine;
use crate::duration;
use crate::fault::Fault;
use crate::file::RigFile;
use crate::names::{self, AnySignal, shown};
use crate::pulses::Train;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;
use stepdrive_spec::time::Instant;

/// The most pulses in a train.
const MOST_PULSES: u32 = 1_000_000;

/// Something to do to a rig.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Something to do to a drive.
    Drive {
        /// Its number in the rig file, from 0.
        drive: usize,
        /// What to do.
        change: Change,
        /// After which time it is taken back; `None` leaves it. See [`Change::back`].
        back_after: Option<Duration>,
    },
    /// A wire is cut or mended.
    Wire {
        /// Its number in the rig file, from 0.
        wire: usize,
        /// Whether it is connected from now on.
        connected: bool,
    },
}

/// Something to do to a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Change {
    /// A signal at an input.
    Input {
        /// The input.
        input: AnySignal,
        /// The signal.
        to: InputChange,
    },
    /// A fault, on or off.
    Fault(Fault),
    /// The supply.
    Power(bool),
    /// An SMSD's front panel: it is in effect from the next power-up on.
    Panel {
        /// "bF": a program starts at power-up.
        autonomous: bool,
        /// `MODE_N_PROGRAMS`, 0 to 3; `None` leaves it.
        program: Option<u8>,
    },
}

/// A signal at an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputChange {
    /// Forced to a level.
    Force(bool),
    /// Left to what is wired to it.
    Release,
    /// Pulses.
    Pulse(Train),
}

/// An action that is none. It displays as one line that says what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ActionError(String);

impl fmt::Display for ActionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for ActionError {}

impl Change {
    /// What takes it back; `None` for what cannot be.
    pub fn back(&self) -> Option<Change> {
        match self {
            Change::Input { input, to: InputChange::Force(_) } => {
                Some(Change::Input { input: *input, to: InputChange::Release })
            }
            Change::Fault(fault) => Some(Change::Fault(fault.off())),
            Change::Power(on) => Some(Change::Power(!on)),
            Change::Input { to: InputChange::Release | InputChange::Pulse(_), .. } | Change::Panel { .. } => {
                None
            }
        }
    }
}

impl InputChange {
    pub(crate) fn apply(self, now: Instant, machine: &mut AnyMachine, input: AnySignal) {
        match self {
            InputChange::Force(level) => machine.force(now, input, Some(level)),
            InputChange::Release => machine.force(now, input, None),
            InputChange::Pulse(train) => machine.pulse(now, input, train),
        }
    }
}

impl Action {
    /// Reads an action for this rig.
    ///
    /// # Errors
    /// What is wrong with it, and what there is.
    pub fn parse(text: &str, rig: &RigFile) -> Result<Action, ActionError> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let (words, back_after) = match words.as_slice() {
            [rest @ .., "for", time] => (rest, Some(time_of(time)?)),
            all => (all, None),
        };
        let action = match words {
            ["input", target, change @ ..] => input(rig, target, change)?,
            ["fault", target, setting @ ..] => fault(rig, target, &setting.join(" "))?,
            ["power", drive, "on"] => to_drive(rig.find_drive(drive)?, Change::Power(true)),
            ["power", drive, "off"] => to_drive(rig.find_drive(drive)?, Change::Power(false)),
            ["power", ..] => return Err("the power is switched so: power DRIVE on|off [for DURATION]".into()),
            ["panel", drive, mode, program @ ..] => panel(rig, drive, mode, program)?,
            ["panel", ..] => return Err("the front panel is set so: panel DRIVE LA|bF [PROGRAM]".into()),
            ["wire", from, to, state] => wire(rig, from, to, state)?,
            ["wire", ..] => return Err("a wire is cut so: wire DRIVE.OUTPUT DRIVE.INPUT cut|mend".into()),
            [other, ..] => {
                return Err(format!(
                    "unknown action `{}`; there are input, fault, power, panel, wire",
                    shown(other)
                )
                .into());
            }
            [] => return Err("there is no action; as in: input stage.IN0 1".into()),
        };
        action.with_end(back_after)
    }

    /// The drive that it is done to; a wire's first.
    pub fn drive(&self, rig: &RigFile) -> Option<usize> {
        match self {
            Action::Drive { drive, .. } => Some(*drive),
            Action::Wire { wire, .. } => rig.wires.get(*wire).map(|wire| wire.from),
        }
    }

    /// The action as it is written for this rig; [`Action::parse`] reads it back.
    pub fn text(&self, rig: &RigFile) -> String {
        let name = |drive: usize| rig.drives.get(drive).map_or("", |drive| &drive.name);
        match self {
            Action::Wire { wire, connected } => {
                let Some(wire) = rig.wires.get(*wire) else { return String::new() };
                let output = rig.output_name(wire.from, wire.output);
                let state = if *connected { "mend" } else { "cut" };
                format!("wire {}.{output} {}.{} {state}", name(wire.from), name(wire.to), wire.input)
            }
            Action::Drive { drive, change, back_after } => {
                let text = change.text(name(*drive));
                back_after.map_or(text.clone(), |after| format!("{text} for {}", duration::display(after)))
            }
        }
    }

    fn with_end(mut self, end: Option<Duration>) -> Result<Action, ActionError> {
        let Some(end) = end else { return Ok(self) };
        match &mut self {
            Action::Drive { change, back_after, .. } if change.back().is_some() => *back_after = Some(end),
            Action::Drive { .. } | Action::Wire { .. } => {
                return Err("`for` goes with forced inputs, faults and the power: this cannot be taken back by itself".into());
            }
        }
        Ok(self)
    }
}

impl Change {
    fn text(&self, drive: &str) -> String {
        match self {
            Change::Input { input, to: InputChange::Force(level) } => {
                format!("input {drive}.{input} {}", u8::from(*level))
            }
            Change::Input { input, to: InputChange::Release } => format!("input {drive}.{input} release"),
            Change::Input { input, to: InputChange::Pulse(train) } => {
                let Train { count, width, period } = train;
                let single = format!("input {drive}.{input} pulse {}", duration::display(*width));
                if *train == Train::single(*width) {
                    return single;
                }
                format!("{single} x{count} every {}", duration::display(*period))
            }
            Change::Fault(fault) => {
                let (name, setting) = fault.text();
                format!("fault {drive}.{name} {setting}")
            }
            Change::Power(on) => format!("power {drive} {}", if *on { "on" } else { "off" }),
            Change::Panel { autonomous, program } => {
                let mode = if *autonomous { "bF" } else { "LA" };
                let program = program.map_or(String::new(), |program| format!(" {program}"));
                format!("panel {drive} {mode}{program}")
            }
        }
    }
}

fn to_drive(drive: usize, change: Change) -> Action {
    Action::Drive { drive, change, back_after: None }
}

fn input(rig: &RigFile, target: &str, change: &[&str]) -> Result<Action, ActionError> {
    let (drive, name) = names::split(target)?;
    let drive = rig.find_drive(drive)?;
    let input = rig.find_input(drive, name)?;
    let to = match change {
        ["0"] => InputChange::Force(false),
        ["1"] => InputChange::Force(true),
        ["release"] => InputChange::Release,
        ["pulse", width] => InputChange::Pulse(Train::single(width_of(width)?)),
        ["pulse", width, count, "every", period] => InputChange::Pulse(train(width, count, period)?),
        _ => {
            let usage = "an input is set so: input DRIVE.INPUT 1|0|release|pulse WIDTH [xCOUNT every PERIOD]";
            return Err(usage.into());
        }
    };
    Ok(to_drive(drive, Change::Input { input, to }))
}

fn train(width: &str, count: &str, period: &str) -> Result<Train, ActionError> {
    let (width, period) = (width_of(width)?, time_of(period)?);
    let count = count.strip_prefix('x').and_then(|count| count.parse().ok());
    let count = count.filter(|count| (1..=MOST_PULSES).contains(count)).ok_or_else(|| {
        ActionError::from(format!(
            "the number of pulses is x1 to x{MOST_PULSES}, as in: pulse 5ms x200 every 10ms"
        ))
    })?;
    if period <= width {
        return Err("pulses come farther apart than they are wide, as in: pulse 5ms x200 every 10ms".into());
    }
    Ok(Train { count, width, period })
}

fn width_of(text: &str) -> Result<Duration, ActionError> {
    let width = time_of(text)?;
    if width.is_zero() { Err("a pulse of no width is none".into()) } else { Ok(width) }
}

fn time_of(text: &str) -> Result<Duration, ActionError> {
    duration::parse(text).map_err(|error| error.to_string().into())
}

fn fault(rig: &RigFile, target: &str, setting: &str) -> Result<Action, ActionError> {
    let (name, fault) = names::split(target)?;
    let drive = rig.find_drive(name)?;
    Ok(to_drive(drive, Change::Fault(Fault::parse(rig, drive, fault, setting)?)))
}

fn panel(rig: &RigFile, name: &str, mode: &str, program: &[&str]) -> Result<Action, ActionError> {
    let drive = rig.find_drive(name)?;
    if rig.drives.get(drive).is_none_or(|drive| drive.smsd().is_none()) {
        return Err(format!("{name} is an SMD3, which has no front panel with LA and bF").into());
    }
    let autonomous = match mode {
        "LA" => false,
        "bF" => true,
        other => return Err(format!("the front panel shows LA or bF, not `{}`", shown(other)).into()),
    };
    let program = match program {
        [] => None,
        [number] => Some(number.parse().ok().filter(|number| *number <= 3).ok_or_else(|| {
            ActionError::from(format!("the program at the front panel is 0 to 3, not `{}`", shown(number)))
        })?),
        _ => return Err("the front panel is set so: panel DRIVE LA|bF [PROGRAM]".into()),
    };
    Ok(to_drive(drive, Change::Panel { autonomous, program }))
}

fn wire(rig: &RigFile, from: &str, to: &str, state: &str) -> Result<Action, ActionError> {
    let connected = match state {
        "mend" => true,
        "cut" => false,
        other => {
            return Err(format!("a wire is cut or mended (`cut`, `mend`), not `{}`", shown(other)).into());
        }
    };
    let ((from_drive, output), (to_drive, input)) = (names::split(from)?, names::split(to)?);
    let (from_drive, to_drive) = (rig.find_drive(from_drive)?, rig.find_drive(to_drive)?);
    let (output, input) = (rig.find_output(from_drive, output)?, rig.find_input(to_drive, input)?);
    let wire = rig.wires.iter().position(|wire| {
        (wire.from, wire.output, wire.to, wire.input) == (from_drive, output, to_drive, input)
    });
    let wire =
        wire.ok_or_else(|| ActionError::from(format!("the rig file has no wire from {from} to {to}")))?;
    Ok(Action::Wire { wire, connected })
}

impl From<names::NameError> for ActionError {
    fn from(error: names::NameError) -> ActionError {
        ActionError(error.to_string())
    }
}

impl From<String> for ActionError {
    fn from(message: String) -> ActionError {
        ActionError(message)
    }
}

impl From<&str> for ActionError {
    fn from(message: &str) -> ActionError {
        ActionError(message.to_string())
    }
}
