//! Numbers, units, constants.

use crate::diagnostic::{Code, Diagnostic};
use crate::lex::{Kind, Token};
use crate::names;
use std::collections::BTreeMap;
use stepdrive_spec::smsd::inputs::Input;

/// Digits that a number may have; more than any operand needs and few enough for the sums below.
const MOST_DIGITS: usize = 12;
/// Digits behind the point.
const MOST_DECIMALS: usize = 6;

/// A value as it was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Value {
    /// A plain number.
    Plain(i64),
    /// A time in milliseconds.
    Time(i64),
    /// A current in milliamperes.
    Current(i64),
    /// A share in percent.
    Percent(i64),
    /// One part of so many.
    Part(i64),
    /// Inputs, a bit each.
    Inputs(u8),
}

impl Value {
    /// The number, when it has no unit.
    pub(crate) const fn plain(self) -> Option<i64> {
        if let Value::Plain(number) = self { Some(number) } else { None }
    }

    /// The number as one of an operand that counts in `unit`.
    pub(crate) fn in_unit(self, unit: &str) -> Option<i64> {
        if let Value::Time(ms) = self { (unit == "ms").then_some(ms) } else { self.plain() }
    }

    /// What it is, for messages.
    pub(crate) const fn kind(self) -> &'static str {
        match self {
            Value::Plain(_) => "a plain number",
            Value::Time(_) => "a time",
            Value::Current(_) => "a current",
            Value::Percent(_) => "a percentage",
            Value::Part(_) => "a fraction",
            Value::Inputs(_) => "an input",
        }
    }
}

/// A unit, what it makes of a number, and how many of the smallest step it has.
struct Unit {
    suffix: &'static str,
    value: fn(i64) -> Value,
    factor: i64,
    /// The smallest step, for messages.
    step: &'static str,
}

const UNITS: [Unit; 8] = [
    Unit { suffix: "", value: Value::Plain, factor: 1, step: "1: it is no whole number" },
    Unit { suffix: "ms", value: Value::Time, factor: 1, step: "1ms" },
    Unit { suffix: "s", value: Value::Time, factor: 1000, step: "1ms" },
    Unit { suffix: "min", value: Value::Time, factor: 60_000, step: "1ms" },
    Unit { suffix: "h", value: Value::Time, factor: 3_600_000, step: "1ms" },
    Unit { suffix: "mA", value: Value::Current, factor: 1, step: "1mA" },
    Unit { suffix: "A", value: Value::Current, factor: 1000, step: "1mA" },
    Unit { suffix: "%", value: Value::Percent, factor: 1, step: "1%" },
];

/// A unit as it is written properly, when this is one.
pub(crate) fn canonical_unit(suffix: &str) -> Option<&'static str> {
    UNITS.iter().map(|unit| unit.suffix).find(|known| known.eq_ignore_ascii_case(suffix))
}

/// The constants of a file.
#[derive(Debug, Default)]
pub(crate) struct Constants {
    /// By name; without value when that could not be read.
    values: BTreeMap<String, (Option<Value>, Token)>,
}

impl Constants {
    /// Where the constant was set.
    pub(crate) fn token(&self, name: &str) -> Option<Token> {
        self.values.get(&names::key(name)).map(|(_, token)| *token)
    }

    pub(crate) fn set(&mut self, name: &str, value: Option<Value>, token: Token) {
        self.values.insert(names::key(name), (value, token));
    }

    /// `true` when one of the words is a constant whose value could not be read.
    pub(crate) fn any_broken(&self, text: &str, tokens: &[Token]) -> bool {
        let broken = |name| matches!(self.values.get(&names::key(name)), Some((None, _)));
        tokens.iter().any(|token| token.kind == Kind::Name && broken(token.text(text)))
    }

    /// The value that a word stands for: a number, an input, a constant.
    pub(crate) fn value(&self, text: &str, token: Token) -> Result<Value, Diagnostic> {
        let word = token.text(text);
        if token.kind == Kind::Number {
            return number(word).map_err(|problem| {
                Diagnostic::new(Code::BadNumber, format!("`{word}` cannot be read as a number"))
                    .at(token.span, problem)
                    .help("numbers are 800, -1_500, 0x1F, 500ms, 2s, 1min, 1.5A, 50%, 1/16")
            });
        }
        if token.kind != Kind::Name {
            let message = format!("expected a value, found `{word}`");
            return Err(Diagnostic::new(Code::Syntax, message).at(token.span, "not a value"));
        }
        if let Some(input) = names::input(word) {
            return Ok(Value::Inputs(input.bit()));
        }
        let known = self.values.get(&names::key(word)).map(|(value, _)| value.unwrap_or(Value::Plain(0)));
        known.ok_or_else(|| self.unknown(word, token))
    }

    /// The value of words joined by `|`. Only inputs can be joined.
    pub(crate) fn joined(&self, text: &str, tokens: &[Token]) -> Result<Value, Diagnostic> {
        let [first, more @ ..] = tokens else { return Ok(Value::Inputs(0)) };
        let mut sum = self.value(text, *first)?;
        let mut rest = more;
        while let [bar, next, more @ ..] = rest {
            if bar.kind != Kind::Bar {
                return Err(superfluous(text, *bar));
            }
            sum = match (sum, self.value(text, *next)?) {
                (Value::Inputs(left), Value::Inputs(right)) => Value::Inputs(left | right),
                (Value::Inputs(_), _) => return Err(not_an_input(text, *next)),
                _ => return Err(not_an_input(text, *first)),
            };
            rest = more;
        }
        match rest {
            [last] if last.kind == Kind::Bar => {
                let diagnostic = Diagnostic::new(Code::MissingOperand, "nothing stands behind `|`");
                Err(diagnostic.at(last.span, "expected an input"))
            }
            [last] => Err(superfluous(text, *last)),
            _ => Ok(sum),
        }
    }

    fn unknown(&self, word: &str, token: Token) -> Diagnostic {
        let known = self.values.keys().map(String::as_str);
        let inputs: Vec<&str> = Input::ALL.iter().map(|input| input.name()).collect();
        Diagnostic::new(Code::UnknownName, format!("there is no constant or input `{word}`"))
            .at(token.span, "not known here")
            .suggest(token.span, names::nearest(word, inputs.into_iter().chain(known)))
            .help("a constant is set above its first use, as in `.const fast = 800`")
    }
}

/// A word too many.
pub(crate) fn superfluous(text: &str, token: Token) -> Diagnostic {
    let message = format!("`{}` is one operand too many", token.text(text));
    Diagnostic::new(Code::TooManyOperands, message).at(token.span, "not expected here")
}

fn not_an_input(text: &str, token: Token) -> Diagnostic {
    let message = format!("only inputs can be joined by `|`, and `{}` is none", token.text(text));
    Diagnostic::new(Code::WrongOperand, message)
        .at(token.span, "not an input")
        .help("write `IN0 | SET_ZERO`, or one number")
}

/// A number with its unit, or what is wrong with it.
fn number(word: &str) -> Result<Value, String> {
    let (negative, digits) = match word.split_at_checked(1) {
        Some(("-", rest)) => (true, rest),
        Some(("+", rest)) => (false, rest),
        _ => (false, word),
    };
    let sign = if negative { -1 } else { 1 };
    let hex = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X"));
    if let Some(hex) = hex {
        return Ok(Value::Plain(sign * whole(hex, 16)?));
    }
    if let Some((one, parts)) = digits.split_once('/') {
        return match (whole(one, 10)?, whole(parts, 10)?) {
            (1, parts) if !negative && parts > 0 => Ok(Value::Part(parts)),
            _ => Err("a fraction is 1/2, 1/4, …".to_owned()),
        };
    }
    let end = digits.find(|letter: char| !(letter.is_ascii_digit() || matches!(letter, '_' | '.')));
    let (digits, suffix) = digits.split_at_checked(end.unwrap_or(digits.len())).unwrap_or((digits, ""));
    let unit = UNITS.iter().find(|unit| unit.suffix.eq_ignore_ascii_case(suffix));
    let unit = unit.ok_or_else(|| format!("`{suffix}` is no unit"))?;
    Ok((unit.value)(sign * scaled(digits, unit)?))
}

fn scaled(digits: &str, unit: &Unit) -> Result<i64, String> {
    let Some((before, behind)) = digits.split_once('.') else { return Ok(whole(digits, 10)? * unit.factor) };
    let behind = behind.trim_end_matches('0');
    if behind.len() > MOST_DECIMALS {
        return Err(format!("finer than {}", unit.step));
    }
    let places = u32::try_from(behind.len()).unwrap_or(0);
    let fraction = if behind.is_empty() { 0 } else { whole(behind, 10)? } * unit.factor;
    let one = 10_i64.pow(places);
    if fraction % one != 0 {
        return Err(format!("finer than {}", unit.step));
    }
    Ok(whole(before, 10)? * unit.factor + fraction / one)
}

fn whole(digits: &str, base: u32) -> Result<i64, String> {
    let plain: String = digits.chars().filter(|digit| *digit != '_').take(MOST_DIGITS + 1).collect();
    if plain.len() > MOST_DIGITS {
        return Err("far too large".to_owned());
    }
    match i64::from_str_radix(&plain, base) {
        Ok(number) if plain.bytes().all(|digit| digit.is_ascii_alphanumeric()) => Ok(number),
        _ => Err("not a number".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_signs_bases_separators_and_units() {
        assert_eq!(number("-1_500"), Ok(Value::Plain(-1500)));
        assert_eq!(number("+0x1F"), Ok(Value::Plain(31)));
        assert_eq!(number("500ms"), Ok(Value::Time(500)));
        assert_eq!(number("1.5S"), Ok(Value::Time(1500)));
        assert_eq!(number("1min"), Ok(Value::Time(60_000)));
        assert_eq!(number("0.50h"), Ok(Value::Time(1_800_000)));
        assert_eq!(number("1.5A"), Ok(Value::Current(1500)));
        assert_eq!(number("50%"), Ok(Value::Percent(50)));
        assert_eq!(number("1/16"), Ok(Value::Part(16)));
        assert_eq!(number("2.0"), Ok(Value::Plain(2)));
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for word in [
            "1.5",
            "0x",
            "0xG",
            "1/0",
            "-1/2",
            "3/4",
            "5kg",
            "--5",
            "1.2.3s",
            "0.0001s",
            "9999999999999",
            "_",
        ] {
            assert!(number(word).is_err(), "{word}");
        }
    }
}
