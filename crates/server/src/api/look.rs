//! What can be seen of the rig.

use super::mechanism::mechanism;
use super::rows::{ClockRow, DriveDetail, DriveRow, FaultRow, InputRow, RigRow, WireRow};
use super::{Api, TheApi};
use crate::Control;
use axum::extract::State;
use stepdrive_drive::smd3::Smd3;
use stepdrive_drive::smsd::Smsd;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::fault::faults_of;
use stepdrive_rig::file::{DriveSection, RigFile, WireSection};
use stepdrive_rig::group::{Group, Member};
use stepdrive_rig::line::Family;
use stepdrive_rig::names::{AnyQuantity, AnySignal};
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, StatusFlag};
use stepdrive_spec::smsd::status::MotStatus;
use stepdrive_spec::time::Instant;
use stepdrive_web::{Named as PathNames, Problem, Reply};

/// The row of the faults that stands for one of each input with a switch.
const ANY_INPUT: &str = "INPUT";

pub(super) async fn rig(State(api): TheApi) -> Reply<RigRow> {
    Reply(api.look(View::All))
}

pub(super) async fn drive(
    State(api): TheApi,
    PathNames(name): PathNames<String>,
) -> Result<Reply<DriveDetail>, Problem> {
    let (number, _) = api.find_drive(&name)?;
    let detail = api.world.visit(number, |group, member| {
        let member = group.members().get(member)?;
        let section = api.control.rig().drives.get(number)?;
        let look =
            |quantity: AnyQuantity| (quantity.to_string(), member.machine().look(group.now(), quantity));
        let quantities = section.quantities().map(look).collect();
        Some(DriveDetail { drive: api.drive_alone(group.now(), member)?, quantities })
    });
    detail.map(Reply).ok_or_else(|| Problem::impossible(format!("there is no drive {name}")))
}

pub(super) async fn faults(State(api): TheApi) -> Reply<Vec<FaultRow>> {
    let drives = &api.control.rig().drives;
    let mut rows: Vec<Vec<FaultRow>> = drives.iter().map(|_| Vec::new()).collect();
    api.each_group(View::All, |group| {
        for member in group.members() {
            if let Some((rows, drive)) = rows.get_mut(member.drive()).zip(drives.get(member.drive())) {
                *rows = faults_of_member(drive, member);
            }
        }
    });
    Reply(rows.into_iter().flatten().collect())
}

/// What of a rig is looked at: always its clock and wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// All drives.
    All,
    /// One drive, with its mechanism.
    Drive(usize),
    /// No drive.
    NoDrives,
}

impl Api {
    /// The rig as it is now, looked at group by group.
    pub(super) fn look(&self, view: View) -> RigRow {
        let rig = self.control.rig();
        let mut drives: Vec<Option<DriveRow>> = rig.drives.iter().map(|_| None).collect();
        let mut wires: Vec<Option<WireRow>> = rig.wires.iter().map(|_| None).collect();
        self.each_group(view, |group| {
            for member in group.members() {
                put(&mut drives, member.drive(), self.drive_in(view, group.now(), member));
            }
            for (number, connected, level) in group.wires() {
                let wire = rig.wires.get(number);
                put(&mut wires, number, wire.map(|wire| wire_row(rig, wire, connected, level)));
            }
        });
        RigRow {
            now_ns: self.control.now().as_nanos(),
            clock: ClockRow::of(&self.control),
            drives: drives.into_iter().flatten().collect(),
            wires: wires.into_iter().flatten().collect(),
            playing: self.control.playing(),
        }
    }

    /// Looks at each group that has something to do with a view, as it is now. While a scenario is played all go forward
    /// together, and are looked at so.
    fn each_group(&self, view: View, mut look: impl FnMut(&Group)) {
        if self.control.playing().is_some() {
            self.world.visit_all(|groups| groups.iter().for_each(|group| look(group)));
            return;
        }
        let wired = self.wired.iter().enumerate();
        let seen = wired.filter(|(group, wired)| match view {
            View::All => true,
            View::Drive(drive) => **wired || self.world.group_of(drive) == *group,
            View::NoDrives => **wired,
        });
        seen.for_each(|(group, _)| self.world.visit_group(group, |group| look(group)));
    }

    fn drive_in(&self, view: View, now: Instant, member: &Member) -> Option<DriveRow> {
        match view {
            View::All => self.drive_row(now, member),
            View::Drive(number) if number == member.drive() => self.drive_alone(now, member),
            View::Drive(_) | View::NoDrives => None,
        }
    }

    fn drive_alone(&self, now: Instant, member: &Member) -> Option<DriveRow> {
        let section = self.control.rig().drives.get(member.drive())?;
        let mechanism = Some(mechanism(now, section, member));
        Some(DriveRow { mechanism, ..self.drive_row(now, member)? })
    }

    fn drive_row(&self, now: Instant, member: &Member) -> Option<DriveRow> {
        let served = self.drives.get(member.drive())?;
        let machine = member.machine();
        let levels = machine.inputs().map(|input| {
            let row = InputRow { level: machine.levels() & bit(input) != 0, forced: machine.forced(input) };
            (input.name(), row)
        });
        let outputs = machine.output_names().iter().enumerate();
        let (state, position, speed) = controller(now, machine);
        Some(DriveRow {
            name: served.name.clone(),
            model: served.model,
            powered: machine.powered(),
            state,
            position,
            speed,
            carriage: machine.look(now, AnyQuantity::Carriage),
            stalled: machine.look(now, AnyQuantity::Stalled) > 0.0,
            inputs: levels.collect(),
            outputs: outputs.map(|(bit, name)| (*name, machine.outputs() >> bit & 1 != 0)).collect(),
            faults: member.faults().collect(),
            modbus_tcp: served.modbus_tcp.map(|address| address.to_string()),
            standard_tcp: served.standard_tcp.map(|address| address.to_string()),
            usb: served.usb.as_ref().map(|path| path.display().to_string()),
            usb_tcp: served.usb_tcp.map(|address| address.to_string()),
            serial: served.serial.as_ref().map(|path| path.display().to_string()),
            serial_tcp: served.serial_tcp.map(|address| address.to_string()),
            mechanism: None,
        })
    }
}

impl ClockRow {
    pub(super) fn of(control: &Control) -> ClockRow {
        ClockRow { mode: control.clock().to_string(), speed_reached: control.speed_reached() }
    }
}

/// The bit of an input among the levels of a machine.
fn bit(input: AnySignal) -> u16 {
    match input {
        AnySignal::Smsd(input) => input.bit().into(),
        AnySignal::Smd3(signal) => signal.bit(),
    }
}

fn put<T>(rows: &mut [Option<T>], number: usize, row: Option<T>) {
    if let Some(place) = rows.get_mut(number) {
        *place = row;
    }
}

fn wire_row(rig: &RigFile, wire: &WireSection, connected: bool, level: bool) -> WireRow {
    let name = |drive: usize| rig.drives.get(drive).map_or("", |drive| &drive.name);
    WireRow {
        from: format!("{}.{}", name(wire.from), rig.output_name(wire.from, wire.output)),
        to: format!("{}.{}", name(wire.to), wire.input),
        delay_ns: u64::try_from(wire.delay.as_nanos()).unwrap_or(u64::MAX),
        invert: wire.invert,
        connected,
        level,
    }
}

/// What a controller does in a few words, its position in its own unit, and its speed in full steps a second.
fn controller(now: Instant, machine: &AnyMachine) -> (String, f64, f64) {
    if !machine.powered() {
        return ("OFF".to_owned(), 0.0, 0.0);
    }
    match machine {
        AnyMachine::Smsd(machine) => {
            let drive = machine.drive();
            (smsd_state(now, drive), drive.position(now).into(), drive.speed(now))
        }
        AnyMachine::Smd3(machine) => {
            let drive = machine.drive();
            (smd3_state(now, drive), drive.position(now), drive.speed(now))
        }
    }
}

/// What an SMSD does: the program that runs and its line, else the motion, else `HiZ`, `READY` or `BUSY`; and `CMD_ERROR`
/// if that is set.
fn smsd_state(now: Instant, drive: &Smsd) -> String {
    let (status, program) = (drive.status(now), drive.program());
    let doing = match status.motion {
        _ if program.running => format!("RUNNING PROGRAM {}:{}", program.place.area, program.place.line),
        MotStatus::Accelerating => "ACCELERATING".to_owned(),
        MotStatus::Decelerating => "DECELERATING".to_owned(),
        MotStatus::ConstantSpeed => "CONSTANT SPEED".to_owned(),
        MotStatus::Stopped if status.hi_z => "HiZ".to_owned(),
        MotStatus::Stopped if status.ready => "READY".to_owned(),
        MotStatus::Stopped => "BUSY".to_owned(),
    };
    if status.cmd_error { doing + ", CMD_ERROR" } else { doing }
}

/// What an SMD3 does: `BAKE`, `STANDBY`, `MOVING`, or `STOPPED` when it stands and does not say `STANDBY` yet; and the
/// error flags that are set.
fn smd3_state(now: Instant, drive: &Smd3) -> String {
    let flags = drive.flags();
    let doing = if StatusFlag::Bake.is_in(flags.status) {
        "BAKE"
    } else if StatusFlag::Standby.is_in(flags.status) {
        "STANDBY"
    } else if drive.speed(now) > 0.0 {
        "MOVING"
    } else {
        "STOPPED"
    };
    let errors = ERROR_FLAGS.iter().filter(|flag| flag.is_in(flags.error)).map(|flag| flag.name);
    std::iter::once(doing).chain(errors).collect::<Vec<&str>>().join(", ")
}

/// All faults that a drive can have.
fn faults_of_member(drive: &DriveSection, member: &Member) -> Vec<FaultRow> {
    let machine = member.machine();
    let switched: Vec<&str> =
        machine.inputs().filter(|input| machine.has_switch(*input)).map(AnySignal::name).collect();
    let active: Vec<(String, String)> = member.faults().collect();
    let row = |name: &str, settings: &str, about| {
        let setting = active.iter().find(|(other, _)| other == name);
        FaultRow {
            drive: drive.name.clone(),
            name: name.to_owned(),
            settings: settings.to_owned(),
            about,
            setting: setting.map_or("off", |(_, setting)| setting).to_owned(),
        }
    };
    let rows = faults_of(Family::of(drive)).flat_map(|(name, settings, about)| {
        let names = if name == ANY_INPUT { switched.clone() } else { vec![name] };
        names.into_iter().map(|name| row(name, &settings, about)).collect::<Vec<FaultRow>>()
    });
    rows.collect()
}
