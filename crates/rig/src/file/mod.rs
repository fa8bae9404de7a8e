//! The rig file: TOML in, machines out.
//!
//! Everything but a drive's `name`, `model` and address has a default. What a person gets wrong is told with the file's
//! name, line and column.

mod checked;
mod clock;
mod mistake;
mod smsd;
mod wires;
mod written;

pub use clock::{ClockMode, ClockModeError};
pub use mistake::{Mistake, RigFileError};

use crate::machine::Machine;
use crate::mechanics::{Mechanics, Switch, Travel};
use crate::names::AnySignal;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;
use core::net::SocketAddr;
use core::time::Duration;
use stepdrive_drive::smd3::{self, Smd3, Stored, Thermal};
use stepdrive_drive::smsd::{Config, Memory, Smsd, WordOrder};
use stepdrive_spec::smd3::signals::{Sensor, Signal};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::Firmware;
use stepdrive_spec::time::Instant;

/// The rig that `stepdrive up` brings up when it is given none: an SMSD-4.2LAN named `stage` and an SMD3 named `uhv`,
/// commented.
pub const DEMO: &str = include_str!("../../demo.toml");

/// A rig.
#[derive(Clone, Debug)]
pub struct RigFile {
    /// How rig time passes when it begins.
    pub clock: ClockMode,
    /// Where it is controlled from; `None` when it is not.
    pub api: Option<ApiSection>,
    /// What bouncing switches and faults of the lines draw from: with the same seed they do the same.
    pub seed: u64,
    /// The drives; at least one.
    pub drives: Vec<DriveSection>,
    /// The wires between them.
    pub wires: Vec<WireSection>,
}

/// Where a rig is controlled from: `api` and `api_token`.
#[derive(Clone, PartialEq, Eq)]
pub struct ApiSection {
    /// Where it listens; port 0 takes a free one. Beyond loopback only with a token.
    pub address: SocketAddr,
    /// What a client must show: 16 to 256 printable ASCII characters without spaces.
    pub token: Option<String>,
}

/// A wire from an output of a drive to an input of another: `[[wire]]`.
///
/// Two drives may each drive the other, and that is no loop: no input switches a relay by itself. An instruction does, and
/// an instruction takes time, so a signal never chases itself round. It is how two controllers work in step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireSection {
    /// The drive at whose output it begins, by its place in the file.
    pub from: usize,
    /// The output, by its place in [`Controller::OUTPUTS`](stepdrive_drive::controller::Controller::OUTPUTS).
    pub output: u8,
    /// The drive at whose input it ends, by its place in the file; another one.
    pub to: usize,
    /// The input.
    pub input: AnySignal,
    /// How much later a change arrives.
    pub delay: Duration,
    /// Whether it arrives the other way round.
    pub invert: bool,
}

/// A drive: `[[drive]]`.
#[derive(Clone, Debug)]
pub struct DriveSection {
    /// Its name, unique in the rig: letters, digits, `-` and `_`, up to 32.
    pub name: String,
    /// Full steps in a turn of the motor, 1 to 10 000.
    pub steps_per_rev: u32,
    /// The hard ends of the travel, in full steps; `None` when the axis turns for ever.
    pub travel: Option<[f64; 2]>,
    /// Where the carriage stands at power-up, in full steps.
    pub start: f64,
    /// What is particular to the family of its controller.
    pub controller: ControllerSection,
}

/// What is particular to a family of controllers.
#[derive(Clone, Debug)]
pub enum ControllerSection {
    /// An SMSD.
    Smsd(SmsdSection),
    /// An SMD3.
    Smd3(Smd3Section),
}

/// An SMSD in a rig.
#[derive(Clone, Debug)]
pub struct SmsdSection {
    /// Its model.
    pub model: Model,
    /// How it is reached over LAN.
    pub lan: LanSection,
    /// Its virtual COM port, which stands for USB.
    pub usb: Option<SerialPort>,
    /// Where it takes over TCP what comes over USB; port 0 takes a free one.
    pub usb_tcp: Option<SocketAddr>,
    /// The version of the standard protocol, 1 or 2.
    pub protocol_version: u8,
    /// The order of the two words of a 32-bit value.
    pub word_order: WordOrder,
    /// Autonomous mode: the front panel shows "bF", and the program of `MODE_N_PROGRAMS` starts at power-up.
    pub autonomous: bool,
    /// `MODE_N_PROGRAMS` as set at the front panel, 0 to 3; `None` keeps the one it remembers.
    pub mode_n_programs: Option<u8>,
    /// The switches along the travel.
    pub switches: Vec<SwitchSection<Input>>,
}

/// How an SMSD is reached over LAN: `lan`, with `modbus_tcp` or `standard_tcp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LanSection {
    /// What it runs, and so what it speaks there: Modbus TCP, or the standard protocol.
    pub firmware: Firmware,
    /// Where it listens; port 0 takes a free one.
    pub address: SocketAddr,
}

/// An SMD3 in a rig. It has a virtual COM port, or takes its lines over TCP, or both.
#[derive(Clone, Debug)]
pub struct Smd3Section {
    /// Its virtual COM port.
    pub serial: Option<SerialPort>,
    /// Where it takes its lines over TCP; port 0 takes a free one.
    pub serial_tcp: Option<SocketAddr>,
    /// How the motor warms up.
    pub thermal: Thermal,
    /// The temperature sensor at power-up.
    pub sensor: Sensor,
    /// The switches along the travel.
    pub switches: Vec<SwitchSection<Signal>>,
}

/// A virtual COM port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SerialPort {
    /// A pseudo-terminal under this name; `None` leaves the name to whoever serves the rig.
    Pty(Option<String>),
}

/// A switch: `[[drive.switch]]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwitchSection<S> {
    /// The input it is wired to.
    pub input: S,
    /// From where to where it is closed, in full steps.
    pub closed: [f64; 2],
}

impl RigFile {
    /// Reads a rig.
    ///
    /// # Errors
    /// The first mistake found, with its place in `text`.
    pub fn parse(text: &str) -> Result<RigFile, RigFileError> {
        checked::parse(text)
    }

    /// The drives, by their place in the file, grouped by the wires that join them, directly or by others. Each group
    /// is in the order of the file, and so are the groups, by their first.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        wires::groups(self.drives.len(), &self.wires)
    }
}

impl fmt::Debug for ApiSection {
    /// Without the token, which is nobody's business.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let token = self.token.as_ref().map(|_| "(hidden)");
        f.debug_struct("ApiSection").field("address", &self.address).field("token", &token).finish()
    }
}

impl WireSection {
    /// From where to where it leads.
    fn joins(&self) -> (usize, u8, usize, AnySignal) {
        (self.from, self.output, self.to, self.input)
    }
}

impl DriveSection {
    /// What is particular to it, if it is an SMSD.
    pub fn smsd(&self) -> Option<&SmsdSection> {
        match &self.controller {
            ControllerSection::Smsd(section) => Some(section),
            ControllerSection::Smd3(_) => None,
        }
    }

    /// What is particular to it, if it is an SMD3.
    pub fn smd3(&self) -> Option<&Smd3Section> {
        match &self.controller {
            ControllerSection::Smsd(_) => None,
            ControllerSection::Smd3(section) => Some(section),
        }
    }

    /// The mechanics at power-up.
    fn mechanics(&self) -> Mechanics {
        Mechanics::new(self.travel.and_then(Travel::between), self.start)
    }
}

impl SmsdSection {
    /// The drive that this is part of, switched on with what its controller remembers.
    pub fn power_up(&self, drive: &DriveSection, mut memory: Memory) -> Machine<Smsd> {
        memory.mode_n_programs = self.mode_n_programs.unwrap_or(memory.mode_n_programs);
        let config = Config {
            model: self.model,
            word_order: self.word_order,
            port: self.lan.address.port(),
            autonomous: self.autonomous,
            firmware: self.lan.firmware,
            protocol_version: self.protocol_version,
        };
        Machine::power_up(drive.mechanics(), switches(&self.switches), |signals| {
            let [levels, _] = signals.to_le_bytes();
            Smsd::power_up(Instant::ZERO, config, memory, levels)
        })
    }
}

impl Smd3Section {
    /// The drive that this is part of, switched on with what its flash holds.
    pub fn power_up(&self, drive: &DriveSection, stored: Stored) -> Machine<Smd3> {
        let config = smd3::Config { thermal: self.thermal, ..smd3::Config::default() };
        Machine::power_up(drive.mechanics(), switches(&self.switches), |signals| {
            let mut drive = Smd3::power_up(Instant::ZERO, config, stored, signals);
            drive.set_sensor(Instant::ZERO, self.sensor);
            drive
        })
    }
}

fn switches<S: Copy>(sections: &[SwitchSection<S>]) -> Vec<Switch<S>> {
    sections.iter().filter_map(|section| Switch::new(section.input, section.closed)).collect()
}
