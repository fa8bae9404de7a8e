//! The commands, in one table, and the vocabulary in which one reaches the drive and is answered (manual, *Quick
//! reference* and *Command reference*).

use super::errors::Error;
use super::flags::Flags;
use super::text::Text;
use core::fmt;

/// The type of an argument, and of the value answered (manual, *Argument types*).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// None.
    None,
    /// INT: a whole number with or without sign.
    Int,
    /// UINT: a whole number without sign, also in hexadecimal.
    Uint,
    /// FLOAT: a real number.
    Float,
    /// BOOL: 0 or 1.
    Bool,
    /// STRING that is `+` or `-`.
    Sign,
    /// STRING that is only read.
    Text,
}

impl Kind {
    /// Its name in the manual; empty for [`Kind::None`].
    pub const fn name(self) -> &'static str {
        match self {
            Kind::None => "",
            Kind::Int => "INT",
            Kind::Uint => "UINT",
            Kind::Float => "FLOAT",
            Kind::Bool => "BOOL",
            Kind::Sign | Kind::Text => "STRING",
        }
    }
}

/// What can be done with a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read: the bare mnemonic is answered with the value.
    Read,
    /// Read, or set with one argument; both are answered with the value.
    ReadWrite,
    /// Set with one argument; the bare mnemonic is an error.
    Write,
    /// The bare mnemonic does it; there is no argument.
    Action,
}

/// A mode of operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Mode {
    /// The step and direction inputs move the motor.
    StepDirection = 0,
    /// An edge of the step input starts and stops the motor.
    TriggeredVelocity = 1,
    /// Commands move the motor.
    Remote = 2,
    /// The joystick moves the motor.
    Joystick = 3,
    /// The motor's phases warm it.
    Bake = 4,
    /// The motor looks for a limit switch.
    Home = 5,
}

impl Mode {
    /// All six, by number.
    pub const ALL: [Mode; 6] =
        [Mode::StepDirection, Mode::TriggeredVelocity, Mode::Remote, Mode::Joystick, Mode::Bake, Mode::Home];

    /// Its number.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The mode with this number.
    pub fn from_number(number: u32) -> Option<Mode> {
        Mode::ALL.into_iter().find(|mode| u32::from(mode.number()) == number)
    }

    /// ASSUMED, but for `Remote`: the name that is answered behind the number, as the manual's list prints it.
    pub const fn name(self) -> &'static str {
        match self {
            Mode::StepDirection => "Step/direction",
            Mode::TriggeredVelocity => "Step/direction triggered velocity",
            Mode::Remote => "Remote",
            Mode::Joystick => "Joystick",
            Mode::Bake => "Bake",
            Mode::Home => "Home",
        }
    }
}

/// One row of the table of commands.
#[derive(Clone, Copy, Debug)]
pub struct CommandInfo {
    /// Which command.
    pub command: Command,
    /// What is sent.
    pub mnemonic: &'static str,
    /// What can be done with it.
    pub access: Access,
    /// The type of its argument or value.
    pub kind: Kind,
    /// The least argument that is taken. Of a profile's quantities the resolution sets closer limits; see
    /// [`super::units`].
    pub min: f64,
    /// The greatest.
    pub max: f64,
    /// Unit, as in `Hz/s`; empty for a plain number.
    pub unit: &'static str,
    /// Its value as it leaves the factory, before rounding.
    pub default: f64,
    /// `true` when `STORE` keeps it.
    pub stored: bool,
    /// `true` when it wants the motor in standby to be set or carried out.
    pub standby: bool,
    /// The mode that it belongs to.
    pub mode: Option<Mode>,
    /// `true` when it starts motion or bake, which a disabled motor refuses.
    pub starts: bool,
    /// What it is.
    pub about: &'static str,
    /// The reading we chose where the manual leaves one open; empty when it does not.
    pub note: &'static str,
}

const fn row(mnemonic: &'static str, access: Access, kind: Kind) -> CommandInfo {
    CommandInfo {
        command: Command::Ser,
        mnemonic,
        access,
        kind,
        min: 0.0,
        max: 0.0,
        unit: "",
        default: 0.0,
        stored: false,
        standby: false,
        mode: None,
        starts: false,
        about: "",
        note: "",
    }
}

const fn read(mnemonic: &'static str, kind: Kind) -> CommandInfo {
    row(mnemonic, Access::Read, kind)
}

const fn action(mnemonic: &'static str) -> CommandInfo {
    row(mnemonic, Access::Action, Kind::None)
}

const fn write(mnemonic: &'static str, kind: Kind) -> CommandInfo {
    row(mnemonic, Access::Write, kind)
}

/// A setting that `STORE` keeps.
const fn setting(mnemonic: &'static str, kind: Kind, default: f64) -> CommandInfo {
    CommandInfo { default, stored: true, max: 1.0, ..row(mnemonic, Access::ReadWrite, kind) }
}

impl CommandInfo {
    const fn within(self, min: f64, max: f64) -> CommandInfo {
        CommandInfo { min, max, ..self }
    }

    const fn unit(self, unit: &'static str) -> CommandInfo {
        CommandInfo { unit, ..self }
    }

    const fn standby(self) -> CommandInfo {
        CommandInfo { standby: true, ..self }
    }

    const fn starts(self, mode: Mode) -> CommandInfo {
        CommandInfo { mode: Some(mode), starts: true, ..self }
    }

    const fn not_stored(self) -> CommandInfo {
        CommandInfo { stored: false, ..self }
    }

    const fn note(self, note: &'static str) -> CommandInfo {
        CommandInfo { note, ..self }
    }
}

/// The most that a position command goes, in full steps: 2^23 - 1.
pub const FARTHEST: f64 = 8_388_607.0;
/// The least that a position counter shows, in full steps: -2^23.
pub const LOWEST_POSITION: f64 = -8_388_608.0;
/// ASSUMED: the highest `VMAX` that is taken, in Hz.
pub const HIGHEST_VMAX: f64 = 15_000.0;
/// Bigger than the registers hold at any resolution; the resolution's own limit counts.
const REGISTER: f64 = 1e6;

macro_rules! commands {
    ($($(#[doc = $about:literal])+ $command:ident => $row:expr;)+) => {
        /// A command of the drive. [`Command::info`] is its row of the table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Command { $($(#[doc = $about])+ $command,)+ }

        /// How many commands there are.
        const ROWS: usize = [$(Command::$command,)+].len();

        /// Every command, in the order of the manual's quick reference.
        pub static COMMANDS: [CommandInfo; ROWS] = [$(
            CommandInfo { command: Command::$command, about: concat!($($about,)+).trim_ascii_start(), ..$row },
        )+];
    };
}

commands! {
    /// Serial number.
    Ser => read("SER", Kind::Text).note("ASSUMED format: 20168-001");
    /// Firmware version.
    Fw => read("FW", Kind::Text).note("ASSUMED: 20168.1, as the manual names versions");
    /// Clears the error flags whose cause is gone.
    Clr => action("CLR");
    /// Loads the stored configuration.
    Load => action("LOAD").standby().note("ASSUMED: wants standby, since it may change RES and MODE");
    /// Stores the configuration, so that it survives power-off.
    Store => action("STORE").note("settings, not the position (decision 36)");
    /// Loads the factory's configuration.
    Loadfd => action("LOADFD").standby().note("ASSUMED: wants standby; STORE keeps it");
    /// Blinks the status indicator.
    Ident => setting("IDENT", Kind::Bool, 0.0).not_stored();
    /// Mode of operation; answered with its name.
    Mode => setting("MODE", Kind::Uint, 2.0).within(0.0, 5.0).standby();
    /// Joystick mode: 0 single step, 1 continuous.
    Jsmode => setting("JSMODE", Kind::Uint, 0.0).standby();
    /// Switches to joystick mode when a joystick is plugged in, and back.
    Autojs => setting("AUTOJS", Kind::Bool, 1.0);
    /// Uses the external enable input.
    Exten => setting("EXTEN", Kind::Bool, 0.0);
    /// Table of all flags.
    Flags => read("FLAGS", Kind::Text).note("ASSUMED layout: a line a flag, name, tab, 0 or 1");

    /// Turns at `VMAX` in a direction until it is stopped.
    Runv => write("RUNV", Kind::Sign).starts(Mode::Remote);
    /// Goes to a position.
    Runa => write("RUNA", Kind::Int).within(-FARTHEST, FARTHEST).unit("full step").starts(Mode::Remote);
    /// Goes so many steps from where it is.
    Runr => write("RUNR", Kind::Int).within(-FARTHEST, FARTHEST).unit("full step").standby().starts(Mode::Remote);
    /// Starts bake.
    Runb => action("RUNB").starts(Mode::Bake);
    /// Looks for the limit switch in a direction, and takes it as zero.
    Runh => write("RUNH", Kind::Sign).starts(Mode::Home).note("the procedure is decision 31");
    /// Stops with `DMAX`; ends bake.
    Stop => action("STOP");
    /// Stops within a second on a full step, whatever the profile.
    Sstop => action("SSTOP");
    /// Stops at once and disables the motor.
    Estop => action("ESTOP");

    /// Temperature sensor: 0 thermocouple, 1 RTD.
    Tsel => setting("TSEL", Kind::Uint, 0.0).note("numbers as the maker lists them");
    /// Temperature of the winding.
    Tmot => read("TMOT", Kind::Float).unit("°C");
    /// Run current.
    Ir => setting("IR", Kind::Float, 1.0).unit("A").note("ASSUMED range and default");
    /// Current while the speed changes.
    Ia => setting("IA", Kind::Float, 1.0).unit("A").note("ASSUMED range and default");
    /// Current at standstill.
    Ih => setting("IH", Kind::Float, 0.1).unit("A").note("ASSUMED range and default");
    /// Time from standstill until the current is lowered.
    Pddel => setting("PDDEL", Kind::Float, 100.0).within(0.0, 5570.56).unit("ms").note("ASSUMED default");
    /// Time of each step in which the current is lowered.
    Ihd => setting("IHD", Kind::Float, 20.0).within(0.0, 327.68).unit("ms").note("ASSUMED default");
    /// At standstill without current: 0 normal, 1 freewheeling, 2 phases shorted.
    F => setting("F", Kind::Uint, 0.0).within(0.0, 2.0);
    /// Microsteps to the full step: 8, 16, 32, 64, 128, 256.
    Res => setting("RES", Kind::Uint, 256.0).within(8.0, 256.0).standby().note("rounded to the nearest of them");

    /// Enables the limit inputs as a whole.
    L => setting("L", Kind::Bool, 0.0);
    /// Enables the positive limit input.
    LPlus => setting("L+", Kind::Bool, 1.0);
    /// Enables the negative limit input.
    LMinus => setting("L-", Kind::Bool, 1.0);
    /// Polarity of the positive limit input: 0 active high, 1 active low.
    LpPlus => setting("LP+", Kind::Bool, 0.0);
    /// Polarity of the negative limit input: 0 active high, 1 active low.
    LpMinus => setting("LP-", Kind::Bool, 0.0);
    /// Polarity of both limit inputs.
    Lp => write("LP", Kind::Bool).within(0.0, 1.0);
    /// How a limit stops the motor: 0 at once, 1 with the profile.
    Lsm => setting("LSM", Kind::Bool, 0.0);

    /// Acceleration.
    Amax => setting("AMAX", Kind::Float, 1000.0).within(1.0, REGISTER).unit("Hz/s").note("ASSUMED default");
    /// Deceleration.
    Dmax => setting("DMAX", Kind::Float, 1000.0).within(1.0, REGISTER).unit("Hz/s").note("ASSUMED default");
    /// Speed at which a ramp begins; at most `VSTOP`.
    Vstart => setting("VSTART", Kind::Float, 10.0).within(0.0, REGISTER).unit("Hz").note("above 0. ASSUMED default");
    /// Speed at which a ramp ends.
    Vstop => setting("VSTOP", Kind::Float, 10.0).within(0.0, REGISTER).unit("Hz").note("above 0. ASSUMED default");
    /// Target speed.
    Vmax => setting("VMAX", Kind::Float, 1000.0).within(0.0, HIGHEST_VMAX).unit("Hz").note("above 0. ASSUMED default");
    /// Actual speed, negative in the negative direction.
    Vact => read("VACT", Kind::Float).unit("Hz");
    /// Actual position.
    Pact => CommandInfo { default: 0.0, ..row("PACT", Access::ReadWrite, Kind::Float) }
        .within(LOWEST_POSITION, FARTHEST).unit("full step").standby();
    /// Relative position, a second counter.
    Prel => row("PREL", Access::ReadWrite, Kind::Float).within(LOWEST_POSITION, FARTHEST).unit("full step");
    /// Time at standstill before the next motion.
    Tzw => setting("TZW", Kind::Float, 0.0).within(0.0, 2.796_16).unit("s").note("seconds, as the manual says");
    /// Speed below which the motor is driven in microsteps.
    Thigh => setting("THIGH", Kind::Float, 500.0).within(0.0, 46_875.0).unit("Hz").note("above 0. ASSUMED default");

    /// Edges of the step input that make a step: 0 rising, 1 both.
    Edge => setting("EDGE", Kind::Uint, 0.0);
    /// A step of the step input is: 0 a step of the resolution, 1 a full step.
    Interp => setting("INTERP", Kind::Uint, 0.0);

    /// Temperature that bake keeps.
    Baket => setting("BAKET", Kind::Uint, 150.0).within(0.0, 200.0).unit("°C").note("ASSUMED range and default");
}

/// The sections of the manual's quick reference, in its order: a name, and the first command in it. Settings stand in all
/// but Movement.
pub const SECTIONS: [(&str, Command); 7] = [
    ("General", Command::Ser),
    ("Movement", Command::Runv),
    ("Motor", Command::Tsel),
    ("Limit inputs", Command::L),
    ("Profile", Command::Amax),
    ("Step and direction", Command::Edge),
    ("Bake", Command::Baket),
];

impl Command {
    /// Its row of the table.
    pub fn info(self) -> &'static CommandInfo {
        let [first, ..] = &COMMANDS;
        // The enum numbers the rows, so the lookup always succeeds; a table test holds that.
        COMMANDS.get(usize::from(self as u8)).unwrap_or(first)
    }

    /// The section of the manual's quick reference that it stands in.
    pub fn section(self) -> &'static str {
        let [(general, _), ..] = SECTIONS;
        SECTIONS.iter().rfind(|(_, first)| self >= *first).map_or(general, |(name, _)| *name)
    }

    /// The command with this mnemonic, in capitals or not.
    pub fn from_mnemonic(mnemonic: &str) -> Option<Command> {
        let row = COMMANDS.iter().find(|row| row.mnemonic.eq_ignore_ascii_case(mnemonic))?;
        Some(row.command)
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.info().mnemonic)
    }
}

/// An argument, or a value that is answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// INT.
    Int(i64),
    /// UINT.
    Uint(u64),
    /// FLOAT; finite in an argument.
    Float(f64),
    /// BOOL.
    Bool(bool),
    /// STRING `+` (`true`) or `-`.
    Sign(bool),
    /// STRING that is only answered.
    Text(Text),
    /// A mode, answered as its number and name.
    Mode(Mode),
    /// The table of flags, made of the flags of the reply.
    FlagTable,
}

/// A line that was understood: the argument is of the command's [`Kind`], and there exactly when it must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// What to do.
    pub command: Command,
    /// The argument; `None` reads, or does what takes none.
    pub argument: Option<Value>,
}

/// What the drive answers to a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reply {
    /// The flags, after the command was carried out.
    pub flags: Flags,
    /// The value, if there is one, or why it was not carried out.
    pub outcome: Result<Option<Value>, Error>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_documented_and_found_by_its_mnemonic() {
        for row in &COMMANDS {
            assert!(!row.about.is_empty(), "{}", row.mnemonic);
            assert_eq!(Command::from_mnemonic(row.mnemonic), Some(row.command));
            assert_eq!(row.command.info().mnemonic, row.mnemonic);
        }
        assert_eq!(Command::from_mnemonic("runv"), Some(Command::Runv));
        assert_eq!(Command::from_mnemonic("RUN"), None);
        assert_eq!(Command::from_mnemonic(""), None);
    }

    #[test]
    fn the_quick_reference_has_49_mnemonics() {
        assert_eq!(COMMANDS.len(), 49);
    }

    #[test]
    fn defaults_lie_in_their_ranges() {
        for row in COMMANDS.iter().filter(|row| row.access == Access::ReadWrite) {
            assert!(row.min < row.max && (row.min..=row.max).contains(&row.default), "{}", row.mnemonic);
        }
    }
}
