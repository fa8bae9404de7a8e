//! What was found out about the drive after something went wrong, as far as it answers.

use super::words::{error_flag_names, mode_text};
use stepdrive_spec::smd3::commands::Mode;
use stepdrive_spec::smd3::flags::{Flags, StatusFlag};

/// The state of the drive, as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Found {
    pub(super) flags: Flags,
    pub(super) velocity: Option<f64>,
    pub(super) position: Option<f64>,
    pub(super) mode: Option<Mode>,
}

impl Found {
    /// The state in words, for the error about a command whose reply was lost.
    pub(super) fn told(&self) -> String {
        let motion = match self.velocity {
            Some(velocity) if velocity != 0.0 => format!("the motor turns at {} Hz", velocity.abs()),
            Some(_) if StatusFlag::Standby.is_in(self.flags.status) => "the motor is in standby".to_owned(),
            Some(_) => "the motor stands, but is not in standby".to_owned(),
            None => return "its state could not be read afterwards".to_owned(),
        };
        let place = self.position.map_or_else(String::new, |position| format!(" at PACT {position}"));
        let mode = self.mode.map_or_else(String::new, |mode| format!(", in mode {}", mode_text(mode)));
        let faults = match self.flags.error {
            0 => String::new(),
            error => format!(", disabled by {}", error_flag_names(error)),
        };
        format!("{motion}{place}{mode}{faults}")
    }
}
