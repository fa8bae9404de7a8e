//! The state of a rig as a person reads it.

use super::state::{Clock, DriveDetail, DriveState, Fault, Input, Ordered, RigState, Wire, time};
use super::table::{Align, Column, number, table, text};

/// The columns of the table of drives.
const DRIVE_COLUMNS: [Column; 7] = [
    ("DRIVE", Align::Left),
    ("MODEL", Align::Left),
    ("STATE", Align::Left),
    ("POSITION", Align::Right),
    ("SPEED", Align::Right),
    ("SIGNALS", Align::Left),
    ("FAULTS", Align::Left),
];

/// A rig, in lines.
pub(super) struct Picture {
    /// How its time passes.
    pub(super) clock: String,
    /// The headings of the drives.
    pub(super) heading: String,
    /// The drives, and whether something is wrong with each.
    pub(super) drives: Vec<(String, bool)>,
    /// The wires.
    pub(super) wires: Vec<String>,
}

/// The whole rig.
pub(super) fn picture(rig: &RigState) -> Picture {
    let rows: Vec<[String; 7]> = rig.drives.iter().map(cells).collect();
    let mut lines = table(DRIVE_COLUMNS, &rows);
    let drives = lines.split_off(1).into_iter().zip(rig.drives.iter().map(is_wrong)).collect();
    Picture {
        clock: clock_line(rig),
        heading: lines.concat(),
        drives,
        wires: if rig.wires.is_empty() { Vec::new() } else { wires(&rig.wires) },
    }
}

impl Picture {
    /// Its lines, without the difference between good and bad.
    pub(super) fn text(&self) -> String {
        let mut lines = vec![self.clock.clone(), String::new(), self.heading.clone()];
        lines.extend(self.drives.iter().map(|(line, _)| line.clone()));
        if !self.wires.is_empty() {
            lines.push(String::new());
            lines.extend(self.wires.iter().cloned());
        }
        text(&lines)
    }
}

fn clock_line(rig: &RigState) -> String {
    let playing = rig.playing.as_ref().map(|name| format!(", playing {name}")).unwrap_or_default();
    format!("{}, rig time {}{playing}", clock(&rig.clock), time(rig.now_ns))
}

/// How time passes, and whether this computer keeps up.
pub(super) fn clock(clock: &Clock) -> String {
    // Below this it is no longer a matter of when one looks.
    let behind = clock.speed_reached.filter(|reached| *reached < 0.95);
    let behind = behind.map(|reached| format!(" (this computer reaches {:.0} % of it)", reached * 100.0));
    format!("clock {}{}", clock.mode, behind.unwrap_or_default())
}

fn cells(drive: &DriveState) -> [String; 7] {
    [
        drive.name.clone(),
        drive.model.clone(),
        state(drive),
        number(drive.position),
        number(drive.speed),
        signals(drive),
        faults(&drive.faults),
    ]
}

/// What a drive does.
fn state(drive: &DriveState) -> String {
    if !drive.powered {
        return "no power".to_owned();
    }
    let stalled = if drive.stalled { ", stalled" } else { "" };
    format!("{}{stalled}", drive.state)
}

fn is_wrong(drive: &DriveState) -> bool {
    !drive.powered || drive.stalled || !drive.faults.0.is_empty()
}

/// The inputs that are high or forced, and the outputs that are on.
fn signals(drive: &DriveState) -> String {
    let inputs = drive.inputs.0.iter().filter(|(_, input)| input.level || input.forced.is_some());
    let inputs = inputs.map(|(name, of)| format!("{name}={}", input(of)));
    let outputs = drive.outputs.0.iter().filter(|(_, on)| *on).map(|(name, _)| format!("{name} on"));
    inputs.chain(outputs).collect::<Vec<String>>().join(", ")
}

fn input(input: &Input) -> String {
    let forced = if input.forced.is_some() { " forced" } else { "" };
    format!("{}{forced}", u8::from(input.level))
}

fn faults(faults: &Ordered<String>) -> String {
    faults.0.iter().map(|(name, setting)| format!("{name} {setting}")).collect::<Vec<String>>().join(", ")
}

/// A drive in a line of its own, as it is told when it has changed.
pub(super) fn change(drive: &DriveState) -> String {
    let mut parts = vec![
        drive.name.clone(),
        state(drive),
        format!("position {}", number(drive.position)),
        format!("speed {}", number(drive.speed)),
    ];
    parts.extend([signals(drive), faults(&drive.faults)].into_iter().filter(|part| !part.is_empty()));
    parts.join("  ")
}

/// All that there is to know of a drive.
pub(super) fn detail(detail: &DriveDetail) -> String {
    let drive = &detail.state;
    let mut rows = vec![
        ["drive".to_owned(), format!("{}, {}", drive.name, drive.model)],
        ["state".to_owned(), state(drive)],
        ["carriage".to_owned(), format!("{} full steps", number(drive.carriage))],
    ];
    let reached = [
        ("Modbus TCP", &drive.modbus_tcp),
        ("standard protocol on TCP", &drive.standard_tcp),
        ("USB", &drive.usb),
        ("USB over TCP", &drive.usb_tcp),
        ("serial", &drive.serial),
        ("lines over TCP", &drive.serial_tcp),
    ];
    for (how, place) in reached {
        rows.extend(place.as_ref().map(|place| [how.to_owned(), place.clone()]));
    }
    rows.extend(drive.inputs.0.iter().map(|(name, of)| [format!("input {name}"), input(of)]));
    let on = |on: bool| if on { "on" } else { "off" }.to_owned();
    rows.extend(drive.outputs.0.iter().map(|(name, is)| [format!("output {name}"), on(*is)]));
    rows.extend(drive.faults.0.iter().map(|(name, setting)| [format!("fault {name}"), setting.clone()]));
    rows.extend(detail.quantities.0.iter().map(|(name, value)| [name.clone(), quantity(value)]));
    let lines = table([("", Align::Left), ("", Align::Left)], &rows);
    text(&lines[1..])
}

fn quantity(value: &serde_json::Value) -> String {
    value.as_f64().map_or_else(|| value.to_string(), number)
}

/// The wires of a rig.
pub(super) fn wires(wires: &[Wire]) -> Vec<String> {
    let columns = ["WIRE", "", "STATE", "LEVEL", "DELAY", ""].map(|heading| (heading, Align::Left));
    let row = |wire: &Wire| {
        let state = if wire.connected { "whole" } else { "cut" };
        let invert = if wire.invert { "inverted" } else { "" };
        let level = u8::from(wire.level).to_string();
        let cells = [wire.from.as_str(), wire.to.as_str(), state, &level, &time(wire.delay_ns), invert];
        cells.map(str::to_owned)
    };
    let rows: Vec<[String; 6]> = wires.iter().map(row).collect();
    table(columns, &rows)
}

/// The faults that the drives of a rig can have.
pub(super) fn fault_list(faults: &[Fault]) -> Vec<String> {
    let columns = ["FAULT", "NOW", "SETTINGS", "WHAT IT IS"].map(|heading| (heading, Align::Left));
    let row = |fault: &Fault| {
        let Fault { drive, name, settings, about, setting } = fault;
        [format!("{drive}.{name}"), setting.clone(), settings.clone(), about.clone()]
    };
    let rows: Vec<[String; 4]> = faults.iter().map(row).collect();
    table(columns, &rows)
}
