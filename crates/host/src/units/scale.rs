//! What one axis makes of user units: full steps, and the parts of a step that its controller counts.

use super::{Amount, Decimal, Speed, Unit, listed};
use crate::error::Error;

/// Most full steps to a turn.
const MOST_STEPS: u32 = 10_000;
/// Most teeth on either side of a gear.
const MOST_TEETH: u32 = 65_535;
/// Degrees in a turn.
const TURN_DEG: i128 = 360;
/// Billionths in one.
const BILLION: i128 = 1_000_000_000;

/// How an axis is measured: its unit, and how many full steps of the motor make one, exactly.
///
/// ```
/// use stepdrive_host::units::{Amount, Decimal, Scale};
///
/// // A screw of 5 mm on a motor of 200 steps: half a turn is 100 full steps, or 1600 microsteps of 1/16.
/// let scale = Scale::millimetres(Decimal::whole(5), 200)?;
/// assert_eq!(scale.counts(Amount::parse("2.5mm")?, 16)?.count, 1600);
/// # Ok::<(), stepdrive_host::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    unit: Unit,
    /// Travel for one turn of the output, of a linear axis.
    per_turn: Decimal,
    /// Full steps to a turn of the motor.
    steps_per_turn: u32,
    /// Turns of the motor to turns of the output.
    gear: (u32, u32),
    reversed: bool,
}

/// An amount as a controller counts it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// The nearest whole count; half-way it is the farther from 0.
    pub count: i64,
    /// `true` when the amount is exactly that.
    pub exact: bool,
}

impl Scale {
    /// An axis of which nothing is known but the motor's full steps: it is measured in those, and in nothing else.
    pub const STEPS: Scale =
        Scale { unit: Unit::Step, per_turn: Decimal::ZERO, steps_per_turn: 0, gear: (1, 1), reversed: false };

    /// An axis measured in turns, with a motor of `steps_per_turn` full steps, 1 to 10 000.
    ///
    /// # Errors
    /// [`Error::Usage`] when a number is out of range.
    pub fn turns(steps_per_turn: u32) -> Result<Scale, Error> {
        if !(1..=MOST_STEPS).contains(&steps_per_turn) {
            return Err(Error::Usage(format!(
                "a motor has 1 to {MOST_STEPS} full steps to the turn, not {steps_per_turn}"
            )));
        }
        Ok(Scale { unit: Unit::Turn, steps_per_turn, ..Scale::STEPS })
    }

    /// An axis measured in degrees, with a motor of `steps_per_turn` full steps.
    ///
    /// # Errors
    /// [`Error::Usage`] when a number is out of range.
    pub fn degrees(steps_per_turn: u32) -> Result<Scale, Error> {
        Ok(Scale { unit: Unit::Deg, ..Scale::turns(steps_per_turn)? })
    }

    /// An axis measured in millimetres, `per_turn` of them for a turn, with a motor of `steps_per_turn` full steps.
    ///
    /// # Errors
    /// [`Error::Usage`] when a number is out of range.
    pub fn millimetres(per_turn: Decimal, steps_per_turn: u32) -> Result<Scale, Error> {
        if per_turn <= Decimal::ZERO {
            return Err(Error::Usage(format!(
                "an axis goes more than 0 mm for a turn, not {per_turn}; turn it round with `reversed`"
            )));
        }
        Ok(Scale { unit: Unit::Mm, per_turn, ..Scale::turns(steps_per_turn)? })
    }

    /// The same behind a gear: so many turns of the motor make so many of the output.
    ///
    /// # Errors
    /// [`Error::Usage`] when a number is not within 1 to 65 535, or the axis is measured in steps alone.
    pub fn geared(self, motor: u32, output: u32) -> Result<Scale, Error> {
        if !(1..=MOST_TEETH).contains(&motor) || !(1..=MOST_TEETH).contains(&output) {
            return Err(Error::Usage(format!(
                "a gear is two numbers from 1 to {MOST_TEETH}, not {motor}:{output}"
            )));
        }
        if self.unit == Unit::Step {
            return Err(Error::Usage(format!(
                "an axis measured in steps has no use for a gear of {motor}:{output}; give it mm, deg or turns"
            )));
        }
        Ok(Scale { gear: (motor, output), ..self })
    }

    /// The same with the positive direction turned round.
    #[must_use]
    pub const fn reversed(self) -> Scale {
        Scale { reversed: !self.reversed, ..self }
    }

    /// The unit that the axis is measured in.
    pub const fn unit(&self) -> Unit {
        self.unit
    }

    /// Whether the positive direction is turned round.
    pub const fn is_reversed(&self) -> bool {
        self.reversed
    }

    /// The units that fit the axis.
    pub const fn units(&self) -> &'static [Unit] {
        match self.unit {
            Unit::Mm => &[Unit::Mm, Unit::Turn, Unit::Step],
            Unit::Deg => &[Unit::Deg, Unit::Turn, Unit::Step],
            Unit::Turn => &[Unit::Turn, Unit::Deg, Unit::Step],
            Unit::Step => &[Unit::Step],
        }
    }

    /// An amount as a controller counts it, `parts` to the full step, in the motor's direction.
    ///
    /// # Errors
    /// [`Error::Usage`] when the unit does not fit the axis, or the count is beyond 64 bits.
    pub fn counts(&self, amount: Amount, parts: u16) -> Result<Counts, Error> {
        let (steps, units) =
            self.steps_per(amount.unit).ok_or_else(|| self.misfit(&amount, amount.unit, ""))?;
        // At most 2^63 · (2^14 · 2^16 · 2^30) · 2^16, and 2^30 · (2^63 · 2^16): both below 2^127 with room to double.
        let (above, below) = reduced(steps * i128::from(parts), units);
        let exact_above = i128::from(amount.value.billionths()).checked_mul(above);
        let counts = exact_above.and_then(|above| divide(above, below.checked_mul(BILLION)?));
        let count = counts.and_then(|(count, exact)| Some((i64::try_from(count).ok()?, exact)));
        let (count, exact) =
            count.ok_or_else(|| Error::Usage(format!("{amount} is farther than any controller counts")))?;
        Ok(Counts { count: if self.reversed { count.saturating_neg() } else { count }, exact })
    }

    /// An amount in full steps and parts of them, in the motor's direction, as near as a double comes to it.
    ///
    /// # Errors
    /// [`Error::Usage`] when the unit does not fit the axis.
    pub fn full_steps(&self, amount: Amount) -> Result<f64, Error> {
        let (steps, units) =
            self.steps_per(amount.unit).ok_or_else(|| self.misfit(&amount, amount.unit, ""))?;
        let magnitude = amount.value.as_f64() * steps as f64 / units as f64;
        Ok(if self.reversed { -magnitude } else { magnitude })
    }

    /// A speed in full steps a second, without sign.
    ///
    /// # Errors
    /// [`Error::Usage`] when the unit does not fit the axis, or the speed is not above 0.
    pub fn steps_per_s(&self, speed: Speed) -> Result<f64, Error> {
        let (steps, units) =
            self.steps_per(speed.unit).ok_or_else(|| self.misfit(&speed, speed.unit, "/s"))?;
        if speed.value <= Decimal::ZERO {
            return Err(Error::Usage(format!(
                "a speed is above 0, not {speed}; the direction is said by itself"
            )));
        }
        Ok(speed.value.as_f64() * steps as f64 / units as f64)
    }

    /// Full steps in the motor's direction, or full steps a second, in the axis' unit and direction.
    pub fn from_steps(&self, full_steps: f64) -> f64 {
        let (steps, units) = self.steps_per(self.unit).unwrap_or((1, 1));
        let magnitude = full_steps * units as f64 / steps as f64;
        // A zero has no sign for people.
        if self.reversed && magnitude != 0.0 { -magnitude } else { magnitude }
    }

    /// Full steps in the motor's direction as an amount for people, to the millionth.
    pub fn amount(&self, full_steps: f64) -> Amount {
        let value = (self.from_steps(full_steps) * 1e6).round() / 1e6;
        Amount { value: Decimal::from_f64(value).unwrap_or_default(), unit: self.unit }
    }

    /// Full steps to so many of a unit, as a fraction; `None` when the unit does not fit.
    fn steps_per(&self, unit: Unit) -> Option<(i128, i128)> {
        if !self.units().contains(&unit) {
            return None;
        }
        let (motor, output) = (i128::from(self.gear.0), i128::from(self.gear.1));
        let turn = i128::from(self.steps_per_turn) * motor;
        Some(match unit {
            Unit::Mm => (turn * BILLION, i128::from(self.per_turn.billionths()) * output),
            Unit::Deg => (turn, TURN_DEG * output),
            Unit::Turn => (turn, output),
            Unit::Step => (1, 1),
        })
    }

    fn misfit(&self, what: &dyn std::fmt::Display, unit: Unit, behind: &str) -> Error {
        let hint = match self.unit {
            Unit::Step => "; give it a scale to use others",
            Unit::Mm | Unit::Deg | Unit::Turn => "",
        };
        let fitting = listed(self.units());
        Error::Usage(format!("{what}: {unit}{behind} do not fit this axis, which takes {fitting}{hint}"))
    }
}

/// The nearest whole number to a fraction, half-way the farther from 0, and whether it is exactly that.
fn divide(above: i128, below: i128) -> Option<(i128, bool)> {
    let (whole, rest) = (above.checked_div(below)?, above.checked_rem(below)?);
    let up = rest.unsigned_abs() >= below.unsigned_abs().checked_sub(rest.unsigned_abs())?;
    let nearest = if up { whole.checked_add(rest.signum())? } else { whole };
    Some((nearest, rest == 0))
}

/// A fraction in lowest terms.
fn reduced(above: i128, below: i128) -> (i128, i128) {
    let divisor = greatest_common_divisor(above, below).max(1);
    (above / divisor, below / divisor)
}

fn greatest_common_divisor(mut left: i128, mut right: i128) -> i128 {
    while right != 0 {
        (left, right) = (right, left % right);
    }
    left.abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn amount(text: &str) -> Amount {
        Amount::parse(text).expect("an amount")
    }

    fn screw() -> Scale {
        Scale::millimetres(Decimal::whole(5), 200).expect("a scale")
    }

    #[test]
    fn amounts_become_whole_parts_of_a_step() {
        for (scale, text, parts, count) in [
            (screw(), "2.5mm", 16, 1600),
            (screw(), "0.1mm", 128, 512),
            (screw(), "-3 turns", 1, -600),
            (screw(), "200 steps", 256, 51_200),
            (Scale::turns(200).expect("a scale"), "90 deg", 16, 800),
            (Scale::degrees(400).expect("a scale"), "0.9 deg", 1, 1),
            (Scale::STEPS, "-7 steps", 8, -56),
            (screw().reversed(), "2.5mm", 16, -1600),
        ] {
            assert_eq!(scale.counts(amount(text), parts), Ok(Counts { count, exact: true }), "{text}");
        }
    }

    #[test]
    fn a_gear_is_exact_even_where_its_ratio_has_no_end() {
        let geared = Scale::degrees(200).and_then(|scale| scale.geared(7, 1)).expect("a scale");
        assert_eq!(geared.counts(amount("360 deg"), 16), Ok(Counts { count: 22_400, exact: true }));
        assert_eq!(geared.counts(amount("3 turns"), 1), Ok(Counts { count: 4200, exact: true }));
        let third = Scale::millimetres(Decimal::whole(1), 200).and_then(|scale| scale.geared(1, 3));
        assert_eq!(third.expect("a scale").counts(amount("3mm"), 1), Ok(Counts { count: 200, exact: true }));
    }

    #[test]
    fn what_is_no_whole_count_is_rounded_and_says_so() {
        assert_eq!(screw().counts(amount("0.02mm"), 1), Ok(Counts { count: 1, exact: false }));
        assert_eq!(screw().counts(amount("0.0125mm"), 1), Ok(Counts { count: 1, exact: false }), "half-way");
        assert_eq!(screw().counts(amount("-0.0125mm"), 1), Ok(Counts { count: -1, exact: false }));
        assert_eq!(screw().counts(amount("0.012mm"), 1), Ok(Counts { count: 0, exact: false }));
    }

    #[test]
    fn a_unit_that_does_not_fit_is_refused_with_those_that_do() {
        let words = |result: Result<Counts, Error>| result.expect_err("refused").to_string();
        assert_eq!(
            words(screw().counts(amount("90 deg"), 16)),
            "90 deg: deg do not fit this axis, which takes mm, turns, steps"
        );
        assert_eq!(
            words(Scale::STEPS.counts(amount("1mm"), 16)),
            "1mm: mm do not fit this axis, which takes steps; give it a scale to use others"
        );
        let speed = Speed::parse("5 deg/s").expect("a speed");
        let words = screw().steps_per_s(speed).expect_err("refused").to_string();
        assert_eq!(words, "5 deg/s: deg/s do not fit this axis, which takes mm, turns, steps");
    }

    #[test]
    fn a_scale_that_makes_no_sense_is_refused() {
        assert!(Scale::turns(0).is_err() && Scale::turns(10_001).is_err());
        assert!(Scale::millimetres(Decimal::ZERO, 200).is_err());
        assert!(screw().geared(0, 1).is_err() && screw().geared(1, 65_536).is_err());
        assert!(Scale::STEPS.geared(2, 1).is_err());
    }

    #[test]
    fn speeds_are_above_zero_and_in_full_steps_a_second() {
        let steps = |text| screw().steps_per_s(Speed::parse(text).expect("a speed"));
        assert_eq!(steps("5mm/s"), Ok(200.0));
        assert_eq!(steps("0.5 turns/s"), Ok(100.0));
        assert_eq!(steps("412 Hz"), Ok(412.0));
        assert!(steps("0 Hz").is_err() && steps("-5mm/s").is_err());
    }

    #[test]
    fn positions_are_shown_in_the_unit_and_direction_of_the_axis() {
        assert_eq!(screw().amount(500.0).to_string(), "12.5mm");
        assert_eq!(screw().reversed().amount(500.0).to_string(), "-12.5mm");
        assert_eq!(screw().reversed().amount(0.0).to_string(), "0mm");
        assert_eq!(Scale::turns(3).expect("a scale").amount(1.0).to_string(), "0.333333 turns");
        assert_eq!(Scale::STEPS.amount(f64::NAN).to_string(), "0 steps");
    }

    fn any_scale() -> impl Strategy<Value = Scale> {
        let numbers = (1..=i64::MAX, 1..=MOST_STEPS, 1..=MOST_TEETH, 1..=MOST_TEETH, 0..4, any::<bool>());
        numbers.prop_map(|(per_turn, steps, motor, output, kind, reversed)| {
            let per_turn = Decimal::from_billionths(per_turn.into()).expect("in range");
            let scale = match kind {
                0 => Scale::millimetres(per_turn, steps).and_then(|scale| scale.geared(motor, output)),
                1 => Scale::degrees(steps).and_then(|scale| scale.geared(motor, output)),
                2 => Scale::turns(steps).and_then(|scale| scale.geared(motor, output)),
                _ => Ok(Scale::STEPS),
            };
            let scale = scale.expect("in range");
            if reversed { scale.reversed() } else { scale }
        })
    }

    proptest! {
        #[test]
        fn any_amount_on_any_scale_is_counted_or_refused(
            scale in any_scale(), parts in -i64::MAX..=i64::MAX, unit in 0_usize..4, micro in 1_u16..=256,
        ) {
            let value = Decimal::from_billionths(parts.into()).expect("in range");
            let _ = scale.counts(Amount::new(value, Unit::ALL[unit]), micro);
            let _ = scale.steps_per_s(Speed::new(value, Unit::ALL[unit]));
            let _ = scale.amount(parts as f64);
        }

        #[test]
        fn a_count_lies_within_half_a_part_of_the_amount(
            scale in any_scale(), thousandths in -1_000_000_i64..1_000_000, micro in 1_u16..=256,
        ) {
            let value = Decimal::from_billionths(i128::from(thousandths) * 1_000_000).expect("in range");
            if let Ok(counts) = scale.counts(Amount::new(value, scale.unit()), micro) {
                let steps = counts.count as f64 / f64::from(micro);
                let part = scale.from_steps(1.0 / f64::from(micro)).abs();
                let off = (scale.from_steps(steps) - value.as_f64()).abs();
                prop_assert!(off <= part * 0.5 + value.as_f64().abs() * 1e-12 + 1e-12, "{} off by {}", steps, off);
            }
        }
    }
}
