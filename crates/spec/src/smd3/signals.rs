//! The signals at the drive's connectors: inputs and the joystick's buttons.

use core::fmt;

/// A signal that goes into the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Signal {
    /// The negative limit input; present = high level.
    LimitNegative = 0,
    /// The positive limit input; present = high level.
    LimitPositive = 1,
    /// The external enable input; present = energised.
    Enable = 2,
    /// The reset fault input: clears the error flags as `CLR` does when it comes.
    ResetFault = 3,
    /// The step input.
    Step = 4,
    /// The direction input; present = positive.
    Dir = 5,
    /// The joystick is plugged in.
    Joystick = 6,
    /// The joystick's clockwise button, which is the positive direction.
    JoystickCw = 7,
    /// The joystick's anticlockwise button.
    JoystickCcw = 8,
}

impl Signal {
    /// All of them.
    pub const ALL: [Signal; 9] = [
        Signal::LimitNegative,
        Signal::LimitPositive,
        Signal::Enable,
        Signal::ResetFault,
        Signal::Step,
        Signal::Dir,
        Signal::Joystick,
        Signal::JoystickCw,
        Signal::JoystickCcw,
    ];

    /// Its name in rig files and commands.
    pub const fn name(self) -> &'static str {
        match self {
            Signal::LimitNegative => "LIMIT_NEGATIVE",
            Signal::LimitPositive => "LIMIT_POSITIVE",
            Signal::Enable => "ENABLE",
            Signal::ResetFault => "RESET_FAULT",
            Signal::Step => "STEP",
            Signal::Dir => "DIR",
            Signal::Joystick => "JOYSTICK",
            Signal::JoystickCw => "JOYSTICK_CW",
            Signal::JoystickCcw => "JOYSTICK_CCW",
        }
    }

    /// The signal with this name.
    pub fn from_name(name: &str) -> Option<Signal> {
        Signal::ALL.into_iter().find(|signal| signal.name() == name)
    }

    /// Its bit in a set of signals.
    pub const fn bit(self) -> u16 {
        1 << self as u8
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The temperature sensor's wires.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sensor {
    /// Connected.
    #[default]
    Connected,
    /// Broken: TOPEN.
    Open,
    /// Short-circuited: TSHORT with an RTD; a thermocouple then shows ambient temperature (ASSUMED).
    Short,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_the_signal() {
        for signal in Signal::ALL {
            assert_eq!(Signal::from_name(signal.name()), Some(signal));
        }
        assert_eq!(Signal::from_name("IN0"), None);
    }
}
