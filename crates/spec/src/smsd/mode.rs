//! The motor configuration: control type, motor, microstep, currents (ch. 4.1; `SET_MODE`, App. B).

/// The motor configuration as registers 0x110A to 0x110E and the instruction `SET_MODE` hold it.
///
/// The values are the registers' codes; [`super::registers`] has their ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorConfiguration {
    /// `CURRENT_OR_VOLTAGE`: 0 voltage control, 1 current control.
    pub current_or_voltage: u16,
    /// `MOTOR_TYPE`: the motor in voltage control, as numbered in [`super::models::MOTORS`].
    pub motor_type: u16,
    /// `MICROSTEPPING`: 0 to 7 for full steps to 1/128.
    pub microstepping: u16,
    /// `WORK_CURRENT`: operating current in tenths of an ampere.
    pub work_current: u16,
    /// `STOP_CURRENT`: holding current, 0 to 3 for 25, 50, 75, 100 % of the operating current.
    pub stop_current: u16,
}

impl MotorConfiguration {
    /// ASSUMED: as it leaves the factory; current control, no motor, 1/16, 1.0 A, 50 %.
    pub const FACTORY: MotorConfiguration = MotorConfiguration {
        current_or_voltage: 1,
        motor_type: 0,
        microstepping: 4,
        work_current: 10,
        stop_current: 1,
    };

    /// The configuration in the 22 data bits of `SET_MODE`: bit 0 control, 6:1 motor, 9:7 microstep, 16:10 current,
    /// 18:17 holding current. The values may be out of their ranges; the bits above 18 are ignored.
    pub const fn from_data(data: u32) -> MotorConfiguration {
        MotorConfiguration {
            current_or_voltage: (data & 1) as u16,
            motor_type: (data >> 1 & 0x3F) as u16,
            microstepping: (data >> 7 & 7) as u16,
            work_current: (data >> 10 & 0x7F) as u16,
            stop_current: (data >> 17 & 3) as u16,
        }
    }

    /// The configuration as the data bits of `SET_MODE`.
    pub const fn data(self) -> u32 {
        (self.current_or_voltage as u32 & 1)
            | (self.motor_type as u32 & 0x3F) << 1
            | (self.microstepping as u32 & 7) << 7
            | (self.work_current as u32 & 0x7F) << 10
            | (self.stop_current as u32 & 3) << 17
    }

    /// How many microsteps make a full step: 1 to 128.
    pub const fn microsteps_per_step(self) -> u16 {
        1 << (self.microstepping & 7)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_set_mode_words_decode_to_what_they_mean() {
        let mode = MotorConfiguration::from_data(10_813);
        let expected = MotorConfiguration {
            current_or_voltage: 1,
            motor_type: 30,
            microstepping: 4,
            work_current: 10,
            stop_current: 0,
        };
        assert_eq!(mode, expected);
        assert_eq!(mode.data(), 10_813);
        let other = MotorConfiguration::from_data(133_250);
        assert_eq!((other.current_or_voltage, other.motor_type, other.microstepping), (0, 1, 1));
        assert_eq!((other.work_current, other.stop_current), (2, 1));
    }

    #[test]
    fn the_microstep_code_is_a_power_of_two() {
        let of = |microstepping| MotorConfiguration { microstepping, ..MotorConfiguration::FACTORY };
        assert_eq!(of(0).microsteps_per_step(), 1);
        assert_eq!(of(4).microsteps_per_step(), 16);
        assert_eq!(of(7).microsteps_per_step(), 128);
    }
}
