//! What can be wrong with a drive, switched on and off at run time.

use crate::any::AnyMachine;
use crate::contacts::SwitchFault;
use crate::file::{ControllerSection, DriveSection, RigFile};
use crate::line::{Family, LINE_FAULTS, LineFaults};
use crate::names::{AnySignal, shown};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use stepdrive_spec::smd3::signals::Sensor;
use stepdrive_spec::time::Instant;

/// The temperature that an overheated SMD3's winding is held at, °C: above the trip of 190.
pub const OVERHEATED_C: f64 = 200.0;

/// A row of the table of faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultRow {
    /// Its name. `INPUT` stands for the name of any input with a switch.
    pub name: &'static str,
    /// Its settings besides `off`.
    pub settings: &'static [&'static str],
    /// The families that can have it; `None` for both.
    pub family: Option<Family>,
    /// What it is, in one line.
    pub about: &'static str,
}

/// The faults of machines; those of their lines are in [`LINE_FAULTS`].
pub const MACHINE_FAULTS: [FaultRow; 6] = [
    FaultRow {
        name: "INPUT",
        settings: &["stuck-open", "stuck-closed", "bounce"],
        family: None,
        about: "the switches of this input never close, never open, or close and open several times",
    },
    FaultRow {
        name: "rotor",
        settings: &["blocked"],
        family: None,
        about: "the rotor is held where it is; the steps meanwhile are lost",
    },
    FaultRow {
        name: "motor",
        settings: &["short"],
        family: None,
        about: "the motor's phases are short-circuited: an SMSD goes HiZ, an SMD3 shows a short",
    },
    FaultRow {
        name: "temperature",
        settings: &["high"],
        family: None,
        about: "an SMSD's power stage shuts down; an SMD3's winding is at 200 °C",
    },
    FaultRow {
        name: "thermocouple",
        settings: &["open", "short"],
        family: Some(Family::Smd3),
        about: "the temperature sensor is broken or short-circuited",
    },
    FaultRow {
        name: "flash",
        settings: &["worn", "damaged"],
        family: Some(Family::Smd3),
        about: "STORE fails with -5; or what is stored reads as damaged by LOAD and at power-up",
    },
];

/// Every fault that a drive of a family can have, as name, settings and what it is.
pub fn faults_of(family: Family) -> impl Iterator<Item = (&'static str, String, &'static str)> {
    let machine =
        MACHINE_FAULTS.iter().map(|row| (row.name, row.settings.join(" | "), row.family, row.about));
    let line = LINE_FAULTS.iter().map(|row| (row.name, row.settings.to_string(), row.family, row.about));
    machine
        .chain(line)
        .filter(move |(_, _, only, _)| only.is_none_or(|only| only == family))
        .map(|(name, settings, _, about)| (name, settings, about))
}

/// A fault and its setting.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The switches of an input.
    Switch(AnySignal, SwitchFault),
    /// The rotor is held.
    Rotor(bool),
    /// The motor's phases are short-circuited.
    Motor(bool),
    /// Too hot.
    Temperature(bool),
    /// The temperature sensor of an SMD3.
    Thermocouple(Sensor),
    /// The flash of an SMD3.
    Flash(Flash),
    /// A fault of the line, by its name and setting in [`LINE_FAULTS`].
    Line(&'static str, String),
}

/// The state of a flash memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flash {
    /// It works.
    #[default]
    Good,
    /// It cannot be written.
    Worn,
    /// It does not read as it was written.
    Damaged,
}

impl Fault {
    /// A fault of the drive with this number by name and setting, as in `rotor` and `blocked`.
    ///
    /// # Errors
    /// What is wrong, and what there is.
    pub fn parse(rig: &RigFile, number: usize, name: &str, setting: &str) -> Result<Fault, String> {
        let Some(drive) = rig.drives.get(number) else { return Err(format!("there is no drive {number}")) };
        let family = Family::of(drive);
        if let Ok(input) = rig.find_input(number, name) {
            return switch(drive, input, setting);
        }
        if let Some(row) = LINE_FAULTS.iter().find(|row| row.name == name) {
            let tried = LineFaults::default().set(row.name, setting, family);
            return tried
                .map(|()| Fault::Line(row.name, setting.to_string()))
                .map_err(|error| error.to_string());
        }
        let row = MACHINE_FAULTS.iter().find(|row| row.name == name).ok_or_else(|| unknown(drive, name))?;
        if row.family.is_some_and(|only| only != family) {
            return Err(format!(
                "{} cannot have the fault {name}: its controller has no such part",
                drive.name
            ));
        }
        match (name, setting) {
            ("rotor", "blocked" | "off") => Ok(Fault::Rotor(setting == "blocked")),
            ("motor", "short" | "off") => Ok(Fault::Motor(setting == "short")),
            ("temperature", "high" | "off") => Ok(Fault::Temperature(setting == "high")),
            ("thermocouple", "open") => Ok(Fault::Thermocouple(Sensor::Open)),
            ("thermocouple", "short") => Ok(Fault::Thermocouple(Sensor::Short)),
            ("thermocouple", "off") => Ok(Fault::Thermocouple(Sensor::Connected)),
            ("flash", "worn") => Ok(Fault::Flash(Flash::Worn)),
            ("flash", "damaged") => Ok(Fault::Flash(Flash::Damaged)),
            ("flash", "off") => Ok(Fault::Flash(Flash::Good)),
            _ => Err(unknown_setting(name, setting, row.settings)),
        }
    }

    /// Its name and setting.
    pub fn text(&self) -> (String, String) {
        let either = |name: &str, setting: &str, on: bool| {
            (name.to_string(), if on { setting } else { "off" }.to_string())
        };
        match self {
            Fault::Switch(input, fault) => (input.to_string(), switch_setting(*fault).to_string()),
            Fault::Rotor(blocked) => either("rotor", "blocked", *blocked),
            Fault::Motor(shorted) => either("motor", "short", *shorted),
            Fault::Temperature(high) => either("temperature", "high", *high),
            Fault::Thermocouple(Sensor::Connected) => either("thermocouple", "", false),
            Fault::Thermocouple(Sensor::Open) => either("thermocouple", "open", true),
            Fault::Thermocouple(Sensor::Short) => either("thermocouple", "short", true),
            Fault::Flash(Flash::Good) => either("flash", "", false),
            Fault::Flash(Flash::Worn) => either("flash", "worn", true),
            Fault::Flash(Flash::Damaged) => either("flash", "damaged", true),
            Fault::Line(name, setting) => ((*name).to_string(), setting.clone()),
        }
    }

    /// The same fault, switched off.
    #[must_use]
    pub fn off(&self) -> Fault {
        match self {
            Fault::Switch(input, _) => Fault::Switch(*input, SwitchFault::None),
            Fault::Rotor(_) => Fault::Rotor(false),
            Fault::Motor(_) => Fault::Motor(false),
            Fault::Temperature(_) => Fault::Temperature(false),
            Fault::Thermocouple(_) => Fault::Thermocouple(Sensor::Connected),
            Fault::Flash(_) => Fault::Flash(Flash::Good),
            Fault::Line(name, _) => Fault::Line(name, "off".to_string()),
        }
    }
}

fn switch(drive: &DriveSection, input: AnySignal, setting: &str) -> Result<Fault, String> {
    let fault = match setting {
        "off" => SwitchFault::None,
        "stuck-open" => SwitchFault::StuckOpen,
        "stuck-closed" => SwitchFault::StuckClosed,
        "bounce" => SwitchFault::Bouncing,
        _ => {
            return Err(unknown_setting(
                &input.to_string(),
                setting,
                &["stuck-open", "stuck-closed", "bounce"],
            ));
        }
    };
    if has_switch(drive, input) {
        return Ok(Fault::Switch(input, fault));
    }
    let name = &drive.name;
    Err(format!("{name} has no switch on {input}; to force the input itself: input {name}.{input} 1"))
}

fn has_switch(drive: &DriveSection, input: AnySignal) -> bool {
    match (&drive.controller, input) {
        (ControllerSection::Smsd(section), AnySignal::Smsd(input)) => {
            section.switches.iter().any(|switch| switch.input == input)
        }
        (ControllerSection::Smd3(section), AnySignal::Smd3(input)) => {
            section.switches.iter().any(|switch| switch.input == input)
        }
        (ControllerSection::Smsd(_), AnySignal::Smd3(_))
        | (ControllerSection::Smd3(_), AnySignal::Smsd(_)) => false,
    }
}

fn switch_setting(fault: SwitchFault) -> &'static str {
    match fault {
        SwitchFault::None => "off",
        SwitchFault::StuckOpen => "stuck-open",
        SwitchFault::StuckClosed => "stuck-closed",
        SwitchFault::Bouncing => "bounce",
    }
}

fn unknown(drive: &DriveSection, name: &str) -> String {
    let names: Vec<&str> = faults_of(Family::of(drive)).map(|(name, ..)| name).collect();
    let names = names.join(", ");
    format!(
        "unknown fault `{}` of {}; there are {names} (INPUT: an input with a switch)",
        shown(name),
        drive.name
    )
}

fn unknown_setting(name: &str, setting: &str, settings: &[&str]) -> String {
    format!("the fault {name} cannot be `{}`; it is {} or off", shown(setting), settings.join(", "))
}

/// What is wrong with a drive.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    line: LineFaults,
    /// All that are on, but those of the line; at most one of a name.
    machine: Vec<Fault>,
}

impl Faults {
    /// What is wrong on its line.
    pub fn line(&self) -> &LineFaults {
        &self.line
    }

    /// All that are on, of this machine, by name and setting.
    pub(crate) fn active(&self, machine: &AnyMachine) -> impl Iterator<Item = (String, String)> {
        // A STORE writes over the damage.
        let mended = machine.smd3().is_some_and(|machine| !machine.drive().store_damaged());
        let on =
            self.machine.iter().filter(move |fault| !(mended && **fault == Fault::Flash(Flash::Damaged)));
        let line = self.line.describe().map(|(name, setting)| (name.to_string(), setting));
        on.map(Fault::text).chain(line)
    }

    /// Switches a fault of a machine on or off at `now`.
    pub(crate) fn set(&mut self, now: Instant, machine: &mut AnyMachine, fault: &Fault) {
        if let Fault::Line(name, setting) = fault {
            // A setting that is none was refused when it was read.
            let _ = self.line.set(name, setting, family(machine));
            return;
        }
        put_in_force(now, machine, fault);
        let (name, setting) = fault.text();
        self.machine.retain(|other| other.text().0 != name);
        if setting != "off" {
            self.machine.push(fault.clone());
        }
    }
}

fn put_in_force(now: Instant, machine: &mut AnyMachine, fault: &Fault) {
    match (fault, machine) {
        (Fault::Switch(input, fault), machine) => drop(machine.set_switch_fault(now, *input, *fault)),
        (Fault::Rotor(blocked), machine) => machine.block_rotor(now, *blocked),
        (Fault::Motor(shorted), AnyMachine::Smsd(machine)) => {
            machine.change(now, |drive| drive.short_motor(now, *shorted));
        }
        (Fault::Motor(shorted), AnyMachine::Smd3(machine)) => {
            machine.change(now, |drive| drive.short_motor(now, *shorted));
        }
        (Fault::Temperature(high), AnyMachine::Smsd(machine)) => {
            machine.change(now, |drive| drive.overheat(now, *high));
        }
        (Fault::Temperature(high), AnyMachine::Smd3(machine)) => {
            machine.change(now, |drive| drive.heat(now, high.then_some(OVERHEATED_C)));
        }
        (Fault::Thermocouple(sensor), AnyMachine::Smd3(machine)) => {
            machine.change(now, |drive| drive.set_sensor(now, *sensor));
        }
        (Fault::Flash(flash), AnyMachine::Smd3(machine)) => machine.change(now, |drive| {
            drive.wear_flash(*flash == Flash::Worn);
            drive.damage_store(*flash == Flash::Damaged);
        }),
        (Fault::Thermocouple(_) | Fault::Flash(_), AnyMachine::Smsd(_)) | (Fault::Line(..), _) => {}
    }
}

fn family(machine: &AnyMachine) -> Family {
    match machine {
        AnyMachine::Smsd(_) => Family::Smsd,
        AnyMachine::Smd3(_) => Family::Smd3,
    }
}

impl Family {
    /// The family of a drive's controller.
    pub fn of(drive: &DriveSection) -> Family {
        match drive.controller {
            ControllerSection::Smsd(_) => Family::Smsd,
            ControllerSection::Smd3(_) => Family::Smd3,
        }
    }
}
