//! The error codes of a refused command (manual, *Error codes*).

use core::fmt;

/// Why a command was not carried out. It displays as the drive prints it, as in `-1 (Stop motor first)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Error {
    /// The motor must be in standby first.
    StopMotorFirst,
    /// The argument is outside what is allowed.
    ArgumentValidation,
    /// The command can only be written.
    UnableToGet,
    /// ASSUMED: no such mnemonic. The manual's list skips the number -4 and has no other for it.
    UnknownCommand,
    /// It failed inside the drive, as when the flash cannot be written.
    ActionFailed,
    /// The command belongs to another mode.
    NotPossibleInMode,
    /// The command starts motion, and the motor is disabled.
    NotPossibleWhenMotorDisabled,
    /// The argument is of the wrong type.
    ArgumentType,
    /// Too few or too many arguments.
    ArgumentCount,
}

impl Error {
    /// All of them.
    pub const ALL: [Error; 9] = [
        Error::StopMotorFirst,
        Error::ArgumentValidation,
        Error::UnableToGet,
        Error::UnknownCommand,
        Error::ActionFailed,
        Error::NotPossibleInMode,
        Error::NotPossibleWhenMotorDisabled,
        Error::ArgumentType,
        Error::ArgumentCount,
    ];

    /// The number.
    pub const fn code(self) -> i16 {
        match self {
            Error::StopMotorFirst => -1,
            Error::ArgumentValidation => -2,
            Error::UnableToGet => -3,
            Error::UnknownCommand => -4,
            Error::ActionFailed => -5,
            Error::NotPossibleInMode => -6,
            Error::NotPossibleWhenMotorDisabled => -7,
            Error::ArgumentType => -101,
            Error::ArgumentCount => -102,
        }
    }

    /// The text behind the number.
    pub const fn text(self) -> &'static str {
        match self {
            Error::StopMotorFirst => "Stop motor first",
            Error::ArgumentValidation => "Argument validation",
            Error::UnableToGet => "Unable to get",
            Error::UnknownCommand => "Unknown command",
            Error::ActionFailed => "Action failed",
            Error::NotPossibleInMode => "Not possible in mode",
            Error::NotPossibleWhenMotorDisabled => "Not possible when motor disabled",
            Error::ArgumentType => "Argument type",
            Error::ArgumentCount => "Argument count",
        }
    }

    /// The error with this number.
    pub fn from_code(code: i16) -> Option<Error> {
        Error::ALL.into_iter().find(|error| error.code() == code)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.code(), self.text())
    }
}

impl core::error::Error for Error {}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn errors_print_as_in_the_manual() {
        assert_eq!(Error::StopMotorFirst.to_string(), "-1 (Stop motor first)");
        assert_eq!(Error::ArgumentCount.to_string(), "-102 (Argument count)");
    }

    #[test]
    fn every_error_is_found_by_its_number() {
        for error in Error::ALL {
            assert_eq!(Error::from_code(error.code()), Some(error));
        }
        assert_eq!(Error::from_code(0), None);
    }
}
