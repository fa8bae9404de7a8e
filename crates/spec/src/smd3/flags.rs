//! The flags that begin every reply (manual, *Flags*).

/// A set of status flags (SFLAGS) or error flags (EFLAGS), as the 16 bits that are printed.
pub type FlagBits = u16;

/// One row of the table of flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlagInfo {
    /// The manual's name.
    pub name: &'static str,
    /// Its bit.
    pub bit: u8,
    /// What it says.
    pub about: &'static str,
}

impl FlagInfo {
    /// Whether it is in a set.
    pub const fn is_in(&self, bits: FlagBits) -> bool {
        bits & 1 << self.bit != 0
    }
}

macro_rules! flags {
    ($(#[doc = $doc:literal])+ $enum:ident, $table:ident, $count:literal: $($(#[doc = $about:literal])+ $flag:ident = $bit:literal, $name:literal;)+) => {
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum $enum { $($(#[doc = $about])+ $flag = $bit,)+ }

        $(#[doc = $doc])+
        /// By bit; bits that are not listed read as 0.
        pub static $table: [FlagInfo; $count] = [$(FlagInfo {
            name: $name,
            bit: $bit,
            about: concat!($($about,)+).trim_ascii_start(),
        },)+];

        impl $enum {
            /// The flag as a set with nothing else in it.
            pub const fn mask(self) -> FlagBits {
                1 << self as u8
            }

            /// Whether it is in a set.
            pub const fn is_in(self, bits: FlagBits) -> bool {
                bits & self.mask() != 0
            }
        }
    };
}

flags! {
    /// The status flags, SFLAGS: how it is now.
    StatusFlag, STATUS_FLAGS, 8:
    /// A joystick is plugged in.
    Jscon = 0, "JSCON";
    /// The negative limit input is active, its polarity taken into account, whether or not it is enabled.
    LimitNegative = 1, "LIMIT NEGATIVE";
    /// The positive limit input is active, its polarity taken into account, whether or not it is enabled.
    LimitPositive = 2, "LIMIT POSITIVE";
    /// The external enable input is energised. ASSUMED: whether or not it is used.
    Exten = 3, "EXTEN";
    /// The status indicator blinks.
    Ident = 4, "IDENT";
    /// The motor stands, and `TZW` has passed.
    Standby = 6, "STANDBY";
    /// Bake runs.
    Bake = 7, "BAKE";
    /// The motor turns at its target velocity.
    AtSpeed = 8, "ATSPEED";
}

flags! {
    /// The error flags, EFLAGS: latched until they are cleared, and the motor is disabled while there is one.
    ErrorFlag, ERROR_FLAGS, 7:
    /// The selected temperature sensor is short-circuited; not with a thermocouple.
    Tshort = 0, "TSHORT";
    /// The selected temperature sensor is open.
    Topen = 1, "TOPEN";
    /// The temperature was above 190 °C.
    Tovr = 2, "TOVR";
    /// A motor phase was short-circuited.
    MotorShort = 3, "MOTOR SHORT";
    /// The external enable input was used and not energised.
    ExternalDisable = 4, "EXTERNAL DISABLE";
    /// `ESTOP` was sent.
    EmergencyStop = 5, "EMERGENCY STOP";
    /// The stored configuration failed its check.
    ConfigurationError = 6, "CONFIGURATION ERROR";
}

/// Both sets, as every reply begins with them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Flags {
    /// SFLAGS.
    pub status: FlagBits,
    /// EFLAGS.
    pub error: FlagBits,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_those_of_the_manual() {
        assert_eq!(StatusFlag::Standby.mask(), 0x0040);
        assert_eq!(StatusFlag::AtSpeed.mask(), 0x0100);
        assert_eq!(ErrorFlag::Topen.mask(), 0x0002);
        assert!(ErrorFlag::EmergencyStop.is_in(0x0020));
    }

    #[test]
    fn tables_are_sorted_by_bit() {
        for table in [&STATUS_FLAGS[..], &ERROR_FLAGS[..]] {
            assert!(table.is_sorted_by(|left, right| left.bit < right.bit));
        }
    }
}
