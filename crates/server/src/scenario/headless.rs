//! Scenarios without a server: on virtual time, as fast as this computer can.

use super::player::Player;
use super::{Report, Scenario};
use crate::Recording;
use crate::control::Control;
use crate::recording::{Header, RecordedDrive, Recorder};
use crate::world::World;
use std::io;
use std::sync::Arc;
use stepdrive_drive::smd3::Stored;
use stepdrive_drive::smsd::Memory;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::file::{ClockMode, ControllerSection, DriveSection, RigFile};
use stepdrive_spec::time::Instant;

/// Plays a scenario on a rig of its own, whose drives remember nothing. No socket is opened, no file is read, and the same
/// scenario always has the same report.
pub fn run_headless(rig: &RigFile, scenario: &Scenario) -> Report {
    play(&world(rig), scenario)
}

/// Plays a scenario as [`run_headless`] does, and records it.
///
/// # Errors
/// The recording cannot be made, or is not whole.
pub fn record_headless(rig: &RigFile, scenario: &Scenario, recording: &Recording) -> io::Result<Report> {
    let drives = rig.drives.iter().map(recorded).collect();
    let recorder = Recorder::create(&recording.file, &Header::new(recording.rig.clone(), drives))?;
    let world = Arc::new(world(rig));
    world.record(recorder);
    let report = play(&world, scenario);
    Control::new(Arc::clone(&world)).end_recording();
    match world.recorder().and_then(Recorder::error) {
        Some(error) => Err(io::Error::other(error)),
        None => Ok(report),
    }
}

fn play(world: &World, scenario: &Scenario) -> Report {
    let mut player = Player::headless(scenario.clone());
    world.visit_all(|groups| {
        while !player.is_over() {
            player.go_on(world, groups, Instant::FAR_FUTURE, &mut u32::MAX.clone());
        }
    });
    player.report()
}

/// A rig that has just been switched on, with a clock that stands.
fn world(rig: &RigFile) -> World {
    let rig = RigFile { clock: ClockMode::Paused, ..rig.clone() };
    let machines = rig.drives.iter().map(machine).collect();
    World::new(rig, machines)
}

fn machine(drive: &DriveSection) -> AnyMachine {
    match &drive.controller {
        ControllerSection::Smsd(section) => {
            AnyMachine::Smsd(Box::new(section.power_up(drive, Memory::factory())))
        }
        ControllerSection::Smd3(section) => {
            AnyMachine::Smd3(Box::new(section.power_up(drive, Stored::Nothing)))
        }
    }
}

fn recorded(drive: &DriveSection) -> RecordedDrive {
    match &drive.controller {
        ControllerSection::Smsd(section) => {
            let port = Some(section.lan.address.port());
            RecordedDrive { port, ..RecordedDrive::smsd(&drive.name, &Memory::factory()) }
        }
        ControllerSection::Smd3(_) => RecordedDrive::smd3(&drive.name, &Stored::Nothing),
    }
}
