//! The rig that a recording begins with.

use super::ReplayError;
use crate::recording::{Header, RecordedDrive, unhex};
use stepdrive_drive::smd3::{Settings, Stored};
use stepdrive_drive::smsd::{Memory, Record};
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::file::{ControllerSection, DriveSection, RigFile};

/// Reads the rig file.
pub(super) fn parse(header: &Header) -> Result<RigFile, ReplayError> {
    let rig = RigFile::parse(&header.rig).map_err(|error| {
        let place =
            error.line.zip(error.column).map(|(line, column)| format!("its line {line}, column {column}: "));
        ReplayError::Rig(place.unwrap_or_default() + &error.message)
    })?;
    let (expected, found) =
        (rig.drives.iter().map(|drive| &drive.name), header.drives.iter().map(|drive| &drive.name));
    if expected.ne(found) {
        return Err(ReplayError::Rig("its drives are not those whose memory was recorded".to_owned()));
    }
    Ok(rig)
}

/// Switches the drives on, with what their memories held.
pub(super) fn power_up(rig: &RigFile, recorded: &[RecordedDrive]) -> Result<Vec<AnyMachine>, ReplayError> {
    rig.drives.iter().zip(recorded).map(|(drive, recorded)| power_up_drive(drive, recorded)).collect()
}

fn power_up_drive(drive: &DriveSection, recorded: &RecordedDrive) -> Result<AnyMachine, ReplayError> {
    let damaged = || ReplayError::Rig(format!("the recorded memory of {} is damaged", drive.name));
    match &drive.controller {
        ControllerSection::Smsd(section) => {
            let memory = memory(recorded).ok_or_else(damaged)?;
            let mut machine = section.power_up(drive, memory);
            if let Some(port) = recorded.port {
                machine.drive_mut().set_port(port);
            }
            Ok(AnyMachine::Smsd(Box::new(machine)))
        }
        ControllerSection::Smd3(section) => {
            let stored = stored(recorded).ok_or_else(damaged)?;
            Ok(AnyMachine::Smd3(Box::new(section.power_up(drive, stored))))
        }
    }
}

fn memory(recorded: &RecordedDrive) -> Option<Memory> {
    let mut memory = Memory::factory();
    let whole = recorded.memory.len() == Record::ALL.len() && !recorded.damaged;
    for (record, text) in Record::ALL.into_iter().zip(&recorded.memory) {
        memory.decode(record, &unhex(text)?).ok()?;
    }
    whole.then_some(memory)
}

fn stored(recorded: &RecordedDrive) -> Option<Stored> {
    match (recorded.memory.as_slice(), recorded.damaged) {
        ([], false) => Some(Stored::Nothing),
        ([], true) => Some(Stored::Damaged),
        ([text], false) => Settings::decode(&unhex(text)?).ok().map(Stored::Intact),
        _ => None,
    }
}
