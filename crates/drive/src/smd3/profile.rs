//! The profile: what shapes a motion, as limits of the motion in units of the position.

use core::time::Duration;
use stepdrive_motion::{Direction, Limits, STEEPEST};
use stepdrive_spec::smd3::units::F_CLK;

/// Units of the position to the full step.
pub(super) const UNITS: i64 = 256;
const UNITS_PER_STEP: f64 = 256.0;

/// `SSTOP` stands within this time (manual).
const SOFT_STOP_SECONDS: f64 = 1.0;

/// ASSUMED: how fast an external step is carried out, in full steps a second: a 1/256 step to the clock.
const STEP_SPEED: f64 = F_CLK / UNITS_PER_STEP;

/// The settings that shape a motion, in full steps and seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Profile {
    pub(super) amax: f64,
    pub(super) dmax: f64,
    pub(super) vstart: f64,
    pub(super) vstop: f64,
    pub(super) vmax: f64,
    pub(super) tzw: Duration,
}

impl Profile {
    /// Velocity mode: ramps from and to standstill, without `VSTART`, `VSTOP` and `TZW`.
    pub(super) fn velocity(&self, dec: f64) -> Limits {
        Limits {
            start: 0.0,
            stop: 0.0,
            max: self.vmax * UNITS_PER_STEP,
            acc: self.amax * UNITS_PER_STEP,
            dec: dec * UNITS_PER_STEP,
            zero_wait: Duration::ZERO,
        }
    }

    /// Positioning mode: everything applies.
    pub(super) fn positioning(&self) -> Limits {
        Limits {
            start: self.vstart * UNITS_PER_STEP,
            stop: self.vstop * UNITS_PER_STEP,
            zero_wait: self.tzw,
            ..self.velocity(self.dmax)
        }
    }

    /// At `VSTART` without ramps.
    pub(super) fn crawling(&self) -> Limits {
        uniform(self.vstart * UNITS_PER_STEP, self.tzw)
    }
}

/// The limits of external steps.
pub(super) fn external_steps() -> Limits {
    uniform(STEP_SPEED * UNITS_PER_STEP, Duration::ZERO)
}

/// Where `SSTOP` stands, and the limits that take it there, from a count and a speed in units: the farthest full step
/// that constant deceleration reaches within the time; where there is none, the next full step, at a speed that reaches
/// it in time.
pub(super) fn soft_stop(count: i64, speed: f64, direction: Direction) -> (i64, Limits) {
    #[allow(clippy::cast_possible_truncation, reason = "`as` saturates, and a speed is below 1e9")]
    let reach = (speed * SOFT_STOP_SECONDS / 2.0) as i64;
    let farthest = full_step_up_to(direction.step(count, reach), direction);
    let units = farthest.saturating_sub(count).saturating_abs();
    // The axis stands a fraction of a unit past its count, which the deceleration must not need.
    if ahead(count, farthest, direction) && units >= 2 {
        let length = units.saturating_sub(1) as f64;
        let dec = speed * speed / (2.0 * length);
        return (farthest, Limits { start: 0.0, stop: 0.0, dec, ..uniform(speed, Duration::ZERO) });
    }
    let next = full_step_up_to(direction.step(count, UNITS), direction);
    let length = next.saturating_sub(count).saturating_abs() as f64;
    // One unit a second more than needed, so that rounding does not make it late.
    (next, uniform(speed.max(length / SOFT_STOP_SECONDS + 1.0), Duration::ZERO))
}

/// One speed, from the first unit to the last.
fn uniform(speed: f64, zero_wait: Duration) -> Limits {
    Limits { start: speed, stop: speed, max: speed, acc: STEEPEST, dec: STEEPEST, zero_wait }
}

/// The last full step up to `count`, going in `direction`.
fn full_step_up_to(count: i64, direction: Direction) -> i64 {
    let past = count.rem_euclid(UNITS);
    match direction {
        Direction::Forward => count.saturating_sub(past),
        Direction::Reverse if past == 0 => count,
        Direction::Reverse => count.saturating_add(UNITS.saturating_sub(past)),
    }
}

fn ahead(from: i64, to: i64, direction: Direction) -> bool {
    from != to && Direction::towards(from, to) == direction
}

#[cfg(test)]
mod tests {
    use super::*;
    use Direction::{Forward, Reverse};

    #[test]
    fn the_last_full_step_is_the_nearest_that_is_not_passed() {
        assert_eq!(full_step_up_to(700, Forward), 512);
        assert_eq!(full_step_up_to(512, Forward), 512);
        assert_eq!(full_step_up_to(-700, Reverse), -512);
        assert_eq!(full_step_up_to(-512, Reverse), -512);
        assert_eq!(full_step_up_to(700, Reverse), 768);
    }
}
