//! User units: what people write, as `12.5mm` or `by -3 turns`, and the scale that makes steps of it.

mod decimal;
mod scale;

pub use decimal::{Decimal, NotDecimal};
pub use scale::{Counts, Scale};

use crate::error::Error;
use std::fmt;

/// A unit that a person measures an axis in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Unit {
    /// Millimetres of a linear axis.
    Mm,
    /// Degrees of a rotary axis.
    Deg,
    /// Turns of what the motor drives: of the motor itself where there is no gear, else of the gear's output.
    Turn,
    /// Full steps of the motor.
    Step,
}

impl Unit {
    /// All of them.
    pub const ALL: [Unit; 4] = [Unit::Mm, Unit::Deg, Unit::Turn, Unit::Step];

    /// How it is written behind a number of several.
    pub const fn name(self) -> &'static str {
        match self {
            Unit::Mm => "mm",
            Unit::Deg => "deg",
            Unit::Turn => "turns",
            Unit::Step => "steps",
        }
    }

    /// How it is written behind a 1.
    const fn singular(self) -> &'static str {
        match self {
            Unit::Mm | Unit::Deg => self.name(),
            Unit::Turn => "turn",
            Unit::Step => "step",
        }
    }

    /// What stands between a number and it.
    const fn space(self) -> &'static str {
        if matches!(self, Unit::Mm) { "" } else { " " }
    }

    /// The unit of this name: `mm`, `deg` or `°`, `turn` or `turns`, `step` or `steps`.
    pub fn from_name(name: &str) -> Option<Unit> {
        let named = |unit: &Unit| name == unit.name() || name == unit.singular();
        Unit::ALL.into_iter().find(named).or_else(|| (name == "°").then_some(Unit::Deg))
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Units as a list for people: `mm, turns, steps`.
fn listed(units: &[Unit]) -> String {
    units.iter().map(|unit| unit.name()).collect::<Vec<_>>().join(", ")
}

/// A distance or a position with its unit. It displays as `12.5mm`, `-3 turns`, `90 deg`, `1 step`, and what is displayed is
/// read as the same amount.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Amount {
    /// How many.
    pub value: Decimal,
    /// Of what.
    pub unit: Unit,
}

impl Amount {
    /// So many of a unit.
    pub const fn new(value: Decimal, unit: Unit) -> Amount {
        Amount { value, unit }
    }

    /// So many of a unit, to the nearest billionth.
    ///
    /// # Errors
    /// [`Error::Usage`] when the number is not within ±9 223 372 036.
    pub fn of(value: f64, unit: Unit) -> Result<Amount, Error> {
        let value = Decimal::from_f64(value)
            .ok_or_else(|| Error::Usage(format!("{value} {unit} is out of range: ±9223372036 {unit}")))?;
        Ok(Amount { value, unit })
    }

    /// Reads a number and a unit, with or without a space between.
    ///
    /// # Errors
    /// [`Error::Usage`], which says what is wrong with the text.
    pub fn parse(text: &str) -> Result<Amount, Error> {
        let (number, unit) = split_number(text.trim());
        let value = decimal(text, number)?;
        if unit.is_empty() {
            return Err(Error::Usage(format!(
                "`{}` lacks a unit, as in `{number} steps`; units are {}",
                shown(text),
                listed(&Unit::ALL)
            )));
        }
        let unit = Unit::from_name(unit).ok_or_else(|| unknown_unit(unit, ""))?;
        Ok(Amount { value, unit })
    }
}

impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let one = self.value.billionths().unsigned_abs() == Decimal::whole(1).billionths().unsigned_abs();
        let name = if one { self.unit.singular() } else { self.unit.name() };
        f.pad(&format!("{}{}{name}", self.value, self.unit.space()))
    }
}

/// A speed with its unit. It displays as `5mm/s`, `0.5 turns/s`, `200 steps/s`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Speed {
    /// How many in a second.
    pub value: Decimal,
    /// Of what.
    pub unit: Unit,
}

impl Speed {
    /// So many of a unit in a second.
    pub const fn new(value: Decimal, unit: Unit) -> Speed {
        Speed { value, unit }
    }

    /// Reads a number and a unit followed by `/s`, or `Hz` for full steps a second.
    ///
    /// # Errors
    /// [`Error::Usage`], which says what is wrong with the text.
    pub fn parse(text: &str) -> Result<Speed, Error> {
        let (number, unit) = split_number(text.trim());
        let value = decimal(text, number)?;
        if unit == "Hz" {
            return Ok(Speed { value, unit: Unit::Step });
        }
        let unit = unit.strip_suffix("/s").ok_or_else(|| {
            Error::Usage(format!("`{}` is no speed; write one as `{number} steps/s`, or in Hz", shown(text)))
        })?;
        let unit = Unit::from_name(unit.trim_end()).ok_or_else(|| unknown_unit(unit, "/s"))?;
        Ok(Speed { value, unit })
    }
}

impl fmt::Display for Speed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&format!("{}{}{}/s", self.value, self.unit.space(), self.unit.name()))
    }
}

/// Where a move goes. It displays as `to 12.5mm` or `by -3 turns`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Goal {
    /// To a position.
    To(Amount),
    /// So far from where the axis stands.
    By(Amount),
}

impl Goal {
    /// Reads `to` or `by` and an amount.
    ///
    /// # Errors
    /// [`Error::Usage`], which says what is wrong with the text.
    pub fn parse(text: &str) -> Result<Goal, Error> {
        let (word, amount) = text.trim().split_once(char::is_whitespace).unwrap_or((text.trim(), ""));
        match word {
            "to" => Amount::parse(amount).map(Goal::To),
            "by" => Amount::parse(amount).map(Goal::By),
            _ => Err(Error::Usage(format!(
                "`{}` does not say whether to go `to` a position or `by` a distance, as in `by {}`",
                shown(text),
                Amount::parse(text).map_or_else(|_| "200 steps".to_owned(), |amount| amount.to_string())
            ))),
        }
    }

    /// The amount in it.
    pub const fn amount(self) -> Amount {
        match self {
            Goal::To(amount) | Goal::By(amount) => amount,
        }
    }
}

impl fmt::Display for Goal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Goal::To(amount) => f.pad(&format!("to {amount}")),
            Goal::By(amount) => f.pad(&format!("by {amount}")),
        }
    }
}

/// The number at the start of a text, and what stands behind it without white space before it.
fn split_number(text: &str) -> (&str, &str) {
    let end = text.find(|c: char| !matches!(c, '0'..='9' | '.' | '+' | '-')).unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    (number, unit.trim_start())
}

fn decimal(text: &str, number: &str) -> Result<Decimal, Error> {
    Decimal::parse(number).map_err(|why| {
        if number.is_empty() {
            return Error::Usage(format!("`{}` does not begin with a number, as in `12.5mm`", shown(text)));
        }
        Error::Usage(format!("`{}` cannot be used: {why}", shown(number)))
    })
}

fn unknown_unit(unit: &str, behind: &str) -> Error {
    let known = Unit::ALL.map(|unit| format!("{unit}{behind}")).join(", ");
    Error::Usage(format!("the unit `{}` is unknown; it is one of {known}", shown(unit)))
}

/// A text of somebody else for a message: short, and without what a terminal would act on.
pub(crate) fn shown(text: &str) -> String {
    let mut shown: String = text.chars().take(60).flat_map(char::escape_debug).collect();
    if text.chars().nth(60).is_some() {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn amount(text: &str) -> Amount {
        Amount::parse(text).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn amounts_are_read_with_and_without_a_space_and_display_as_people_write_them() {
        for (text, value, unit, display) in [
            ("12.5mm", "12.5", Unit::Mm, "12.5mm"),
            ("-3 turns", "-3", Unit::Turn, "-3 turns"),
            ("0.5 turn", "0.5", Unit::Turn, "0.5 turns"),
            ("-1turn", "-1", Unit::Turn, "-1 turn"),
            ("90 deg", "90", Unit::Deg, "90 deg"),
            ("90°", "90", Unit::Deg, "90 deg"),
            ("+200 steps", "200", Unit::Step, "200 steps"),
            (" 1 step ", "1", Unit::Step, "1 step"),
        ] {
            let expected = Amount::new(Decimal::parse(value).expect("a number"), unit);
            assert_eq!(amount(text), expected, "{text}");
            assert_eq!(expected.to_string(), display);
        }
    }

    #[test]
    fn what_is_wrong_with_an_amount_is_said() {
        for (text, words) in [
            ("12.5", "`12.5` lacks a unit, as in `12.5 steps`; units are mm, deg, turns, steps"),
            ("12.5 mn", "the unit `mn` is unknown; it is one of mm, deg, turns, steps"),
            ("mm", "`mm` does not begin with a number, as in `12.5mm`"),
            ("1.2.3mm", "`1.2.3` cannot be used: it is no decimal number, as in 12.5"),
            ("99999999999 steps", "`99999999999` cannot be used: it is not within ±9223372036"),
            ("", "`` does not begin with a number, as in `12.5mm`"),
        ] {
            assert_eq!(Amount::parse(text), Err(Error::Usage(words.to_owned())), "{text}");
        }
    }

    #[test]
    fn a_goal_says_whether_it_is_a_position_or_a_distance() {
        assert_eq!(Goal::parse("to 12.5mm"), Ok(Goal::To(amount("12.5mm"))));
        assert_eq!(Goal::parse(" by  90 deg"), Ok(Goal::By(amount("90 deg"))));
        let words =
            "`3 turns` does not say whether to go `to` a position or `by` a distance, as in `by 3 turns`";
        assert_eq!(Goal::parse("3 turns"), Err(Error::Usage(words.to_owned())));
        assert!(Goal::parse("to").is_err() && Goal::parse("").is_err());
    }

    #[test]
    fn speeds_have_a_unit_each_second() {
        let speed = |value, unit| Ok(Speed::new(Decimal::whole(value), unit));
        assert_eq!(Speed::parse("5mm/s"), speed(5, Unit::Mm));
        assert_eq!(Speed::parse("1 turn/s"), speed(1, Unit::Turn));
        assert_eq!(Speed::parse("412 Hz"), speed(412, Unit::Step));
        assert!(Speed::parse("5mm").is_err() && Speed::parse("5 furlongs/s").is_err());
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "\\PC*") {
            let _ = (Amount::parse(&text), Speed::parse(&text), Goal::parse(&text));
        }

        #[test]
        fn near_misses_do_not_panic(text in "(to|by)? ?[-+0-9.]{0,12} ?(mm|deg|°|turns?|steps?|Hz|/s|x){0,2}") {
            let _ = (Amount::parse(&text), Speed::parse(&text), Goal::parse(&text));
        }

        #[test]
        fn what_is_displayed_is_read_as_the_same(parts in -i64::MAX..=i64::MAX, unit in 0_usize..4) {
            let value = Decimal::from_billionths(parts.into()).expect("in range");
            let amount = Amount::new(value, Unit::ALL[unit]);
            let speed = Speed::new(value, Unit::ALL[unit]);
            prop_assert_eq!(Amount::parse(&amount.to_string()), Ok(amount));
            prop_assert_eq!(Speed::parse(&speed.to_string()), Ok(speed));
            prop_assert_eq!(Goal::parse(&Goal::By(amount).to_string()), Ok(Goal::By(amount)));
        }
    }
}
