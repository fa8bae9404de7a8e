//! The numbers that the drive can make: its motion core counts in fractions of a clock of 12 MHz.
//!
//! A setting is rounded to the nearest of them, and that is what is answered (manual, *Comma separation*; decision 37).
//! Frequencies are full steps per second whatever the resolution; positions are full steps, in fractions of 1/256.

/// ASSUMED: the clock of the motion core, in Hz. The successor's published delays fit exactly this.
pub const F_CLK: f64 = 12e6;

/// The resolutions that `RES` takes: microsteps to the full step.
pub const RESOLUTIONS: [u16; 6] = [8, 16, 32, 64, 128, 256];

/// ASSUMED: steps of current to the ampere.
pub const CURRENT_STEPS: f64 = 32.0;

/// A quantity that the drive holds as a whole number of equal parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// One part, in the quantity's unit.
    pub part: f64,
    /// The least number of parts.
    pub min: u32,
    /// The greatest number of parts.
    pub max: u32,
}

impl Grid {
    /// The nearest value that the drive can make.
    pub fn round(self, value: f64) -> f64 {
        // `as` saturates: what is not a number or negative becomes 0, what is too large the greatest.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
        let parts = (value / self.part + 0.5) as u32;
        f64::from(parts.clamp(self.min, self.max)) * self.part
    }

    /// The greatest value.
    pub fn greatest(self) -> f64 {
        f64::from(self.max) * self.part
    }
}

/// Velocities at a resolution, Hz: parts of f/2^24/RES.
fn velocity(resolution: u16, max: u32) -> Grid {
    Grid { part: F_CLK / 16_777_216.0 / f64::from(resolution), min: 1, max }
}

/// `VMAX` at a resolution, Hz.
pub fn vmax(resolution: u16) -> Grid {
    velocity(resolution, (1 << 23) - 512)
}

/// `VSTART` and `VSTOP` at a resolution, Hz.
pub fn vstart(resolution: u16) -> Grid {
    velocity(resolution, (1 << 18) - 1)
}

/// `AMAX` and `DMAX` at a resolution, Hz/s: parts of f²/2^41/RES.
pub fn acceleration(resolution: u16) -> Grid {
    Grid { part: F_CLK * F_CLK / 2_199_023_255_552.0 / f64::from(resolution), min: 1, max: 65_535 }
}

/// `TZW`, seconds: parts of 512/f.
pub const ZERO_WAIT: Grid = Grid { part: 512.0 / F_CLK, min: 0, max: 65_535 };

/// `PDDEL`, milliseconds: parts of 2^18/f.
pub const POWER_DOWN_DELAY: Grid = Grid { part: 262_144.0 / F_CLK * 1e3, min: 0, max: 255 };

/// `IHD`, milliseconds: parts of 2^18/f.
pub const HOLD_DELAY: Grid = Grid { part: 262_144.0 / F_CLK * 1e3, min: 0, max: 15 };

/// `IR`, `IA`, `IH`, amperes.
pub const CURRENT: Grid = Grid { part: 1.0 / CURRENT_STEPS, min: 0, max: 32 };

/// `THIGH`, Hz: the drive holds the time of a 1/256 step in clocks, so what it can make is f/256/n.
pub fn round_thigh(value: f64) -> f64 {
    let highest = F_CLK / 256.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    let clocks = (highest / value + 0.5) as u32;
    highest / f64::from(clocks.clamp(1, (1 << 20) - 1))
}

/// The resolution nearest to a number; of two as near the higher.
pub fn nearest_resolution(value: u32) -> u16 {
    let distance = |resolution: &u16| u32::from(*resolution).abs_diff(value);
    RESOLUTIONS.into_iter().rev().min_by_key(distance).unwrap_or(256)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(left: f64, right: f64) -> bool {
        (left / right - 1.0).abs() < 1e-5
    }

    #[test]
    fn the_parts_are_those_of_the_motion_cores_registers() {
        assert!(near(vmax(256).part, 0.002_793_97));
        assert!(near(vmax(8).greatest(), 749_954.0));
        assert!(near(vstart(256).greatest(), 732.42));
        assert!(near(acceleration(256).part, 0.255_795));
        assert!(near(acceleration(8).greatest(), 536_434.0));
        assert!(near(ZERO_WAIT.greatest(), 2.796_16));
    }

    #[test]
    fn delays_round_to_the_values_that_are_read_back() {
        assert!(near(POWER_DOWN_DELAY.round(100.0), 109.227));
        assert!(near(HOLD_DELAY.round(20.0), 21.845_3));
        assert!(near(POWER_DOWN_DELAY.greatest(), 5570.56));
    }

    #[test]
    fn thigh_is_a_whole_part_of_its_highest() {
        assert!(near(round_thigh(200.0), 200.320_5));
        assert!(round_thigh(0.0) > 0.0 && round_thigh(f64::NAN) > 0.0);
    }

    #[test]
    fn a_resolution_between_two_is_the_nearer() {
        assert_eq!(nearest_resolution(100), 128);
        assert_eq!(nearest_resolution(90), 64);
        assert_eq!(nearest_resolution(96), 128);
        assert_eq!(nearest_resolution(256), 256);
    }

    #[test]
    fn no_number_makes_rounding_leave_the_grid() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0, 1e300] {
            let rounded = vmax(64).round(value);
            assert!(rounded >= vmax(64).part && rounded <= vmax(64).greatest(), "{value}");
        }
    }
}
