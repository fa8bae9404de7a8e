//! What can be looked at: the commands that answer a number, the flags, the signals, the current and the temperature.

use super::Smd3;
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, CommandInfo, Kind, Value};
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, FlagBits, STATUS_FLAGS};
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::time::Instant;

/// Something that can be looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// What a command reads as.
    Command(Command),
    /// The status flags of this set: 1 while one of them is set.
    Status(FlagBits),
    /// The error flags of this set.
    Error(FlagBits),
    /// Whether a signal is present.
    Signal(Signal),
    /// The current, in amperes: of each phase in bake, else at its peak.
    Current,
    /// The winding's temperature, °C, whatever the sensor shows.
    Temperature,
}

impl Quantity {
    /// All of them with their names: the commands that answer a number by their mnemonics, the flags that no such
    /// command is called like, and the signals. The flags `EXTEN` and `IDENT` are called like commands: the first is the
    /// signal `ENABLE`, the second the same as the command.
    pub(crate) fn all() -> impl Iterator<Item = (&'static str, Quantity)> {
        let commands = numbers().map(|row| (row.mnemonic, Quantity::Command(row.command)));
        let status = STATUS_FLAGS.iter().map(|row| (row.name, Quantity::Status(1 << row.bit)));
        let errors = ERROR_FLAGS.iter().map(|row| (row.name, Quantity::Error(1 << row.bit)));
        let flags = status.chain(errors).filter(|(name, _)| numbers().all(|row| row.mnemonic != *name));
        let signals = Signal::ALL.into_iter().map(|signal| (signal.name(), Quantity::Signal(signal)));
        let motor = [("CURRENT", Quantity::Current), ("TEMPERATURE", Quantity::Temperature)];
        commands.chain(flags).chain(signals).chain(motor)
    }

    /// Whether it may change between two wake-ups.
    pub(crate) fn flows(self) -> bool {
        let moving = [Command::Tmot, Command::Vact, Command::Pact, Command::Prel];
        match self {
            Quantity::Command(command) => moving.contains(&command),
            Quantity::Current | Quantity::Temperature => true,
            Quantity::Status(_) | Quantity::Error(_) | Quantity::Signal(_) => false,
        }
    }
}

/// The commands that answer a number.
fn numbers() -> impl Iterator<Item = &'static CommandInfo> {
    let read = |row: &&CommandInfo| matches!(row.access, Access::Read | Access::ReadWrite);
    COMMANDS.iter().filter(read).filter(|row| row.kind != Kind::Text)
}

impl Smd3 {
    /// The value of a quantity at `now`, which may lie between the last call and the next wake-up; flags and BOOL as 0
    /// and 1, `MODE` as its number. Of a controller that is switched off it is 0, but for the winding's temperature.
    pub fn look(&self, now: Instant, quantity: Quantity) -> f64 {
        let bit = |set: bool| f64::from(u8::from(set));
        match quantity {
            Quantity::Temperature => self.temperature(now),
            _ if !self.on => 0.0,
            Quantity::Command(command) => as_number(self.value(now, command.info())),
            Quantity::Status(flags) => bit(self.flags().status & flags != 0),
            Quantity::Error(flags) => bit(self.flags().error & flags != 0),
            Quantity::Signal(signal) => bit(self.present(signal)),
            Quantity::Current => self.current(now),
        }
    }
}

/// A value as a number; 0 for a text.
fn as_number(value: Value) -> f64 {
    match value {
        Value::Int(value) => value as f64,
        Value::Uint(value) => value as f64,
        Value::Float(value) => value,
        Value::Bool(value) | Value::Sign(value) => f64::from(u8::from(value)),
        Value::Mode(mode) => f64::from(mode.number()),
        Value::Text(_) | Value::FlagTable => 0.0,
    }
}
