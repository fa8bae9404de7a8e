//! The number formats of the powerSTEP01, the motor chip in the controller.
//!
//! The registers of the controller hold whole numbers, and read back what was written. The motion itself runs with what
//! the chip can represent: its time base is a tick of 250 ns, and its speeds and accelerations are multiples of powers
//! of two per tick (powerSTEP01 data sheet, register descriptions). `MAX_SPEED` 1000 therefore turns at 1007.08 steps/s.
//!
//! All speeds are in full steps per second and all accelerations in full steps per second squared, whatever the microstep mode.

/// How one register of the chip counts: `physical = (raw + offset) / per_unit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Raw counts per physical unit.
    per_unit: f64,
    /// Added to the raw count before it is scaled.
    offset: f64,
    /// Lowest raw value that a physical value is turned into.
    min: u32,
    /// Highest raw value.
    max: u32,
}

/// Speed of RUN and of the profile, 20 bits of 2^-28 per tick: 0.0149 steps/s.
pub const SPEED: Scale = Scale { per_unit: 67.108_864, offset: 0.0, min: 0, max: (1 << 20) - 1 };
/// `ACC` and `DEC`, 12 bits of 2^-40 per tick squared: 14.55 steps/s². The highest code means "at once" and is avoided.
pub const ACCELERATION: Scale = Scale { per_unit: 0.068_719_476_736, offset: 0.0, min: 1, max: 0xFFE };
/// `MAX_SPEED`, 10 bits of 2^-18 per tick: 15.26 steps/s.
pub const MAX_SPEED: Scale = Scale { per_unit: 0.065_536, offset: 0.0, min: 1, max: 0x3FF };
/// `MIN_SPEED`, 12 bits of 2^-24 per tick: 0.238 steps/s.
pub const MIN_SPEED: Scale = Scale { per_unit: 4.194_304, offset: 0.0, min: 0, max: 0xFFF };
/// `FS_SPD`, 10 bits of 2^-18 per tick, and half a count more: 15.26 steps/s.
pub const FS_SPEED: Scale = Scale { per_unit: 0.065_536, offset: 0.5, min: 0, max: 0x3FF };

impl Scale {
    /// The chip's count for a physical value: the nearest, within the register's range.
    pub fn encode(self, physical: f64) -> u32 {
        // A float above the range of u32 becomes u32::MAX and a negative one 0, so the clamp below holds for any input.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
        let raw = (physical * self.per_unit + 0.5) as u32;
        raw.clamp(self.min, self.max)
    }

    /// The physical value of a chip's count.
    pub fn decode(self, raw: u32) -> f64 {
        (f64::from(raw) + self.offset) / self.per_unit
    }

    /// The physical value that the chip works with when asked for this one.
    pub fn round(self, physical: f64) -> f64 {
        self.decode(self.encode(physical))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(left: f64, right: f64) -> bool {
        (left - right).abs() < 0.005
    }

    #[test]
    fn rounding_gives_the_multiples_that_the_data_sheet_prints() {
        assert!(near(SPEED.round(800.0), 800.0));
        assert!(near(MAX_SPEED.round(1000.0), 1007.08));
        assert!(near(MAX_SPEED.round(16.0), 15.26));
        assert!(near(MIN_SPEED.round(950.0), 950.10));
        assert!(near(ACCELERATION.round(1000.0), 1004.08));
        assert!(near(ACCELERATION.round(15.0), 14.55));
    }

    #[test]
    fn the_highest_values_of_the_manual_stay_inside_the_registers() {
        assert_eq!(ACCELERATION.encode(59_000.0), 0xFD6);
        assert_eq!(MAX_SPEED.encode(15_600.0), 1022);
        assert_eq!(SPEED.encode(15_600.0), 1_046_898);
        assert_eq!(FS_SPEED.encode(15_600.0), 1022);
    }

    #[test]
    fn a_value_out_of_range_is_clamped() {
        assert_eq!(ACCELERATION.encode(0.0), 1);
        assert_eq!(ACCELERATION.encode(1e300), 0xFFE);
        assert_eq!(SPEED.encode(-5.0), 0);
    }
}
