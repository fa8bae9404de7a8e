//! The two models, what tells them apart, and the table of motors for voltage control.

use core::fmt;

/// A model of controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Model {
    /// SMSD-4.2LAN: up to 4.2 A a phase.
    Smsd42,
    /// SMSD-8.0LAN: up to 8.0 A a phase.
    Smsd80,
}

impl Model {
    /// Both.
    pub const ALL: [Model; 2] = [Model::Smsd42, Model::Smsd80];

    /// The maker's name, as on the front panel.
    pub const fn name(self) -> &'static str {
        match self {
            Model::Smsd42 => "SMSD-4.2LAN",
            Model::Smsd80 => "SMSD-8.0LAN",
        }
    }

    /// The model with this name.
    pub fn from_name(name: &str) -> Option<Model> {
        Model::ALL.into_iter().find(|model| model.name() == name)
    }

    /// `HW_MAJOR`, the device ID (App. A).
    pub const fn hw_major(self) -> u16 {
        match self {
            Model::Smsd42 => 6,
            Model::Smsd80 => 7,
        }
    }

    /// Highest `WORK_CURRENT`, in tenths of an ampere (ch. 4.1).
    pub const fn max_work_current(self) -> u16 {
        match self {
            Model::Smsd42 => 42,
            Model::Smsd80 => 80,
        }
    }

    /// Highest `MOTOR_TYPE`, as listed in [`MOTORS`] (ch. 4.1).
    pub const fn max_motor_type(self) -> u16 {
        match self {
            Model::Smsd42 => 45,
            Model::Smsd80 => 54,
        }
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// `HW_VER` (App. A).
pub const HW_VER: u16 = 1;
/// `FW_MAJOR`, `FW_MINOR`: firmware 1.3 (App. A).
pub const FIRMWARE: (u16, u16) = (1, 3);
/// `RM_MAJOR`, `RM_MINOR`: register map 4.3 (App. A).
pub const REGISTER_MAP: (u16, u16) = (4, 3);

/// A motor that voltage control knows by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motor {
    /// `MOTOR_TYPE` on the SMSD-4.2LAN; `None` where that model cannot drive it.
    pub type_42: Option<u16>,
    /// `MOTOR_TYPE` on the SMSD-8.0LAN.
    pub type_80: u16,
    /// Highest current a phase, in milliamperes.
    pub current_ma: u16,
    /// Resistance a phase, in milliohms.
    pub resistance_mohm: u32,
    /// Inductance a phase, in microhenries.
    pub inductance_uh: u32,
    /// Step angle, in tenths of a degree.
    pub step_angle_decideg: u8,
    /// The maker's name for it, often none.
    pub name: &'static str,
}

impl Motor {
    /// The motor's `MOTOR_TYPE` on `model`.
    pub const fn motor_type(&self, model: Model) -> Option<u16> {
        match model {
            Model::Smsd42 => self.type_42,
            Model::Smsd80 => Some(self.type_80),
        }
    }
}

const fn motor(
    type_42: Option<u16>,
    type_80: u16,
    current_ma: u16,
    resistance_mohm: u32,
    inductance_uh: u32,
    step_angle_decideg: u8,
    name: &'static str,
) -> Motor {
    Motor { type_42, type_80, current_ma, resistance_mohm, inductance_uh, step_angle_decideg, name }
}

/// The motors of ch. 4.1 (decimal commas read as points; the step angle 0.8 of type 6 stands as printed).
pub static MOTORS: [Motor; 55] = [
    motor(Some(0), 0, 0, 0, 0, 0, "no motor"),
    motor(Some(1), 1, 1330, 2100, 2500, 18, ""),
    motor(Some(2), 2, 1330, 2100, 4200, 9, ""),
    motor(Some(3), 3, 1200, 3300, 3400, 9, ""),
    motor(Some(4), 4, 1680, 1650, 3200, 18, ""),
    motor(Some(5), 5, 1680, 1640, 3200, 9, ""),
    motor(Some(6), 6, 1200, 3300, 2800, 8, ""),
    motor(Some(7), 7, 1680, 1650, 2800, 18, "SM4247"),
    motor(Some(8), 8, 1680, 1650, 4100, 9, ""),
    motor(Some(9), 9, 1200, 6000, 7000, 18, ""),
    motor(Some(10), 10, 1200, 12_100, 36_700, 9, ""),
    motor(Some(11), 11, 1560, 1800, 3600, 18, ""),
    motor(Some(12), 12, 1000, 16_700, 46_500, 18, ""),
    motor(Some(13), 13, 1500, 3600, 6000, 18, ""),
    motor(Some(14), 14, 1000, 5700, 5400, 18, ""),
    motor(Some(15), 15, 1000, 5700, 8000, 9, ""),
    motor(Some(16), 16, 2800, 700, 1400, 18, ""),
    motor(Some(17), 17, 2800, 700, 2200, 9, ""),
    motor(Some(18), 18, 1000, 6600, 8600, 18, ""),
    motor(Some(19), 19, 2800, 830, 2200, 18, ""),
    motor(Some(20), 20, 2800, 900, 3700, 9, ""),
    motor(Some(21), 21, 1000, 7400, 10_000, 18, ""),
    motor(Some(22), 22, 2000, 1800, 2500, 18, ""),
    motor(Some(23), 23, 2800, 900, 2500, 18, ""),
    motor(Some(24), 24, 1000, 8600, 14_000, 18, ""),
    motor(Some(25), 25, 2800, 1130, 3600, 18, "SM5776"),
    motor(Some(26), 26, 2800, 1130, 5600, 9, ""),
    motor(Some(27), 27, 2000, 1200, 4600, 18, ""),
    motor(Some(28), 28, 2000, 4800, 18_400, 18, ""),
    motor(Some(29), 29, 2000, 1500, 6800, 18, ""),
    motor(Some(30), 30, 2000, 6000, 7200, 18, ""),
    motor(Some(31), 31, 2800, 700, 3900, 18, ""),
    motor(Some(32), 32, 2800, 2800, 15_600, 18, ""),
    motor(Some(33), 33, 4200, 375, 3400, 18, "SM8680 in parallel"),
    motor(Some(34), 34, 4200, 1500, 13_600, 18, "SM8680 in series"),
    motor(Some(35), 35, 4200, 450, 6000, 18, ""),
    motor(Some(36), 36, 4200, 1800, 24_000, 18, ""),
    motor(Some(37), 37, 4200, 625, 8000, 18, ""),
    motor(Some(38), 38, 4200, 2500, 32_000, 18, ""),
    motor(None, 39, 6000, 600, 6500, 18, ""),
    motor(None, 40, 6200, 750, 9000, 18, ""),
    motor(None, 41, 5500, 900, 12_000, 18, ""),
    motor(None, 42, 6500, 800, 15_000, 18, ""),
    motor(None, 43, 8000, 670, 12_000, 18, "SM110201"),
    motor(Some(39), 44, 300, 32_000, 40_000, 18, ""),
    motor(Some(40), 45, 670, 8500, 7500, 18, ""),
    motor(Some(41), 46, 1680, 2300, 3400, 18, ""),
    motor(Some(42), 47, 3000, 1000, 3400, 18, ""),
    motor(Some(43), 48, 3000, 1450, 6500, 18, ""),
    motor(Some(44), 49, 3000, 1200, 6400, 18, ""),
    motor(Some(45), 50, 4500, 360, 3000, 18, ""),
    motor(None, 51, 6000, 600, 5700, 18, ""),
    motor(None, 52, 6200, 700, 8500, 18, ""),
    motor(None, 53, 8000, 800, 16_000, 18, ""),
    motor(None, 54, 6000, 800, 8700, 18, ""),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_model_numbers_its_motors_without_gap_from_no_motor_to_its_highest() {
        for model in Model::ALL {
            let mut expected = 0;
            for number in MOTORS.iter().filter_map(|motor| motor.motor_type(model)) {
                assert_eq!(number, expected, "{model}");
                expected += 1;
            }
            assert_eq!(expected, model.max_motor_type() + 1, "{model}");
        }
    }

    #[test]
    fn motors_that_only_the_larger_model_lists_want_more_than_the_smaller_one_gives() {
        for motor in MOTORS.iter().filter(|motor| motor.type_42.is_none()) {
            assert!(motor.current_ma > Model::Smsd42.max_work_current() * 100, "{motor:?}");
        }
    }

    #[test]
    fn names_lead_back_to_the_model() {
        for model in Model::ALL {
            assert_eq!(Model::from_name(model.name()), Some(model));
        }
        assert_eq!(Model::from_name("SMSD-1.5"), None);
    }
}
