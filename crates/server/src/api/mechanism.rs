//! What hangs on a drive, for those who draw it. All places are full steps on the travel.

use serde::Serialize;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::file::{ControllerSection, DriveSection};
use stepdrive_rig::group::Member;
use stepdrive_rig::names::AnyQuantity;
use stepdrive_spec::time::Instant;

/// The mechanics of a drive.
#[derive(PartialEq, Serialize)]
pub(super) struct MechanismRow {
    steps_per_rev: u32,
    /// The hard ends; `None` when it turns for ever.
    travel: Option<[f64; 2]>,
    switches: Vec<SwitchRow>,
    carriage: f64,
    /// The place at which the controller's position would be 0; `None` without its supply.
    zero: Option<f64>,
    /// The place of `MARK`; of an SMSD with its supply only.
    mark: Option<f64>,
    /// Where the motion under way ends as it is planned.
    target: Option<f64>,
    stalled: bool,
}

/// A switch along the travel.
#[derive(PartialEq, Serialize)]
struct SwitchRow {
    input: &'static str,
    closed: [f64; 2],
}

/// The mechanics of a drive as they are at `now`.
pub(super) fn mechanism(now: Instant, section: &DriveSection, member: &Member) -> MechanismRow {
    let machine = member.machine();
    let carriage = machine.look(now, AnyQuantity::Carriage);
    let counted = machine.powered().then(|| Counted::of(now, machine));
    MechanismRow {
        steps_per_rev: section.steps_per_rev,
        travel: section.travel,
        switches: switches(section),
        carriage,
        zero: counted.map(|Counted { position, .. }| carriage - position),
        mark: counted.and_then(|Counted { position, mark }| Some(carriage - position + mark?)),
        target: machine.destination(now),
        stalled: machine.look(now, AnyQuantity::Stalled) > 0.0,
    }
}

fn switches(section: &DriveSection) -> Vec<SwitchRow> {
    let row = |input, closed| SwitchRow { input, closed };
    match &section.controller {
        ControllerSection::Smsd(smsd) => {
            smsd.switches.iter().map(|switch| row(switch.input.name(), switch.closed)).collect()
        }
        ControllerSection::Smd3(smd3) => {
            smd3.switches.iter().map(|switch| row(switch.input.name(), switch.closed)).collect()
        }
    }
}

/// What a controller counts, in full steps.
#[derive(Clone, Copy)]
struct Counted {
    position: f64,
    mark: Option<f64>,
}

impl Counted {
    fn of(now: Instant, machine: &AnyMachine) -> Counted {
        match machine {
            AnyMachine::Smsd(machine) => {
                let drive = machine.drive();
                let full_steps = |microsteps: i32| {
                    f64::from(microsteps) / f64::from(drive.memory().motor.microsteps_per_step())
                };
                let (position, mark) = (full_steps(drive.position(now)), full_steps(drive.mark()));
                Counted { position, mark: Some(mark) }
            }
            AnyMachine::Smd3(machine) => Counted { position: machine.drive().position(now), mark: None },
        }
    }
}
