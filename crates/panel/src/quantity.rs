//! Positions, distances and speeds as clients send them.

use crate::member::Member;
use serde::{Deserialize, Deserializer, de};
use serde_json::Value;
use stepdrive_host::Error;
use stepdrive_host::units::{Amount, Decimal, Speed, Unit};

/// What a quantity is, for whoever has sent none.
const QUANTITY: &str = "a number in the unit of the axis or a text as \"30 mm\" is wanted";

/// A number in the axis' unit, or a text with a unit.
#[derive(Debug)]
pub(crate) enum Quantity {
    Number(f64),
    Text(String),
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Quantity, D::Error> {
        let found = match Value::deserialize(deserializer)? {
            Value::Number(number) => match number.as_f64() {
                Some(number) => return Ok(Quantity::Number(number)),
                None => "a number beyond all",
            },
            Value::String(text) => return Ok(Quantity::Text(text)),
            Value::Null => "null",
            Value::Bool(_) => "true or false",
            Value::Array(_) => "an array",
            Value::Object(_) => "an object",
        };
        Err(de::Error::custom(format_args!("{QUANTITY}, not {found}")))
    }
}

impl Quantity {
    /// It as a position or a distance of an axis.
    pub(crate) fn amount(&self, member: &Member) -> Result<Amount, Error> {
        let unit = member.axis().scale().unit();
        let of = |number| Ok(Amount { value: counted(number, unit)?, unit });
        match self {
            Quantity::Number(number) => of(*number),
            Quantity::Text(text) => bare(text).map_or_else(|| Amount::parse(text), of),
        }
    }

    /// It as a speed of an axis.
    pub(crate) fn speed(&self, member: &Member) -> Result<Speed, Error> {
        let unit = member.axis().scale().unit();
        let of = |number| Ok(Speed::new(counted(number, unit)?, unit));
        match self {
            Quantity::Number(number) => of(*number),
            Quantity::Text(text) => bare(text).map_or_else(|| Speed::parse(text), of),
        }
    }
}

/// The number that a text is, if it has no unit.
fn bare(text: &str) -> Option<f64> {
    text.trim().parse().ok()
}

/// A number of a unit, if it is within what can be counted.
pub(crate) fn counted(number: f64, unit: Unit) -> Result<Decimal, Error> {
    Decimal::from_f64(number).ok_or_else(|| {
        Error::Usage(format!("{} {unit} is out of range: ±9223372036 {unit}", shortly(number)))
    })
}

/// A number as people write it: not with hundreds of digits.
pub(crate) fn shortly(number: f64) -> String {
    let is_plain = number == 0.0 || (1e-6..1e15).contains(&number.abs()) || !number.is_finite();
    if is_plain { number.to_string() } else { format!("{number:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_shown_shortly() {
        for (number, shown) in
            [(0.0, "0"), (-2.5, "-2.5"), (1e308, "1e308"), (1e-9, "1e-9"), (1e6, "1000000")]
        {
            assert_eq!(shortly(number), shown);
        }
    }

    #[test]
    fn what_is_no_quantity_is_told() {
        for (json, found) in
            [("[1]", "an array"), ("null", "null"), ("true", "true or false"), ("{}", "an object")]
        {
            let error = serde_json::from_str::<Quantity>(json).expect_err("none").to_string();
            assert!(error.ends_with(&format!("is wanted, not {found}")), "{error}");
        }
    }
}
