//! Soft limits: where an axis may go, in its own unit.

use crate::error::Error;
use crate::units::Decimal;

/// The lowest and the highest position that an axis may be sent to, in its unit, or none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SoftLimits(Option<(Decimal, Decimal)>);

impl SoftLimits {
    /// None.
    pub const OFF: SoftLimits = SoftLimits(None);

    /// Limits; 0 and 0 is none.
    ///
    /// # Errors
    /// [`Error::Usage`] when the first is not below the second.
    pub fn new(low: Decimal, high: Decimal) -> Result<SoftLimits, Error> {
        if low == Decimal::ZERO && high == Decimal::ZERO {
            return Ok(SoftLimits::OFF);
        }
        if low >= high {
            return Err(Error::Usage(format!(
                "soft limits are [{low}, {high}]; the first must be below the second, or both 0 for none"
            )));
        }
        Ok(SoftLimits(Some((low, high))))
    }

    /// The lowest and the highest position, if there are any.
    pub const fn range(self) -> Option<(Decimal, Decimal)> {
        self.0
    }

    /// Whether a position lies within them.
    pub fn allow(self, position: Decimal) -> bool {
        self.0.is_none_or(|(low, high)| (low..=high).contains(&position))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_hold_both_ends_and_zero_and_zero_is_none() {
        let limits = SoftLimits::new(Decimal::whole(-5), Decimal::whole(100)).expect("in order");
        let allowed = |text| limits.allow(Decimal::parse(text).expect("a number"));
        assert!(allowed("-5") && allowed("100") && !allowed("-5.000001") && !allowed("100.000001"));
        assert_eq!(SoftLimits::new(Decimal::ZERO, Decimal::ZERO), Ok(SoftLimits::OFF));
        assert!(SoftLimits::OFF.allow(Decimal::whole(i32::MAX)));
        assert!(SoftLimits::new(Decimal::whole(5), Decimal::whole(5)).is_err());
    }
}
