//! Operands by name: `SET_MODE control=current …`, `LOOP_PROGRAM cycles=10 instructions=3`.

use crate::diagnostic::{Code, Diagnostic};
use crate::lex::{Kind, Token};
use crate::names;
use crate::operand::{LOOP_CYCLES_SHIFT, LOOP_FIELDS, LOOP_MAX, allowed_operand};
use crate::parse::{Head, Statement};
use crate::source::Span;
use crate::value::{Constants, Value};
use stepdrive_spec::smsd::instructions::Operand;
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

/// The fields of `SET_MODE`, in the order of its bits.
pub(crate) const MODE_FIELDS: [&str; 5] = ["control", "motor", "microstep", "current", "hold"];
/// The values of `control`, by their code in `CURRENT_OR_VOLTAGE` (ch. 4.1).
pub(crate) const CONTROLS: [&str; 2] = ["voltage", "current"];
/// One step of `WORK_CURRENT` (ch. 4.1).
const CURRENT_STEP_MA: i64 = 100;
/// One step of `STOP_CURRENT`, whose code 0 is one step (ch. 4.1).
const HOLD_STEP_PERCENT: i64 = 25;

/// A configuration as `SET_MODE` has it in a text.
pub(crate) fn mode_text(mode: MotorConfiguration) -> String {
    let control = CONTROLS.get(usize::from(mode.current_or_voltage)).copied().unwrap_or("");
    let microstep = match mode.microsteps_per_step() {
        1 => "1".to_owned(),
        parts => format!("1/{parts}"),
    };
    let (amperes, tenths) = (mode.work_current / 10, mode.work_current % 10);
    let hold = (i64::from(mode.stop_current) + 1) * HOLD_STEP_PERCENT;
    let motor = mode.motor_type;
    format!("control={control} motor={motor} microstep={microstep} current={amperes}.{tenths}A hold={hold}%")
}

/// `true` when every part of the configuration is in the range of the larger model.
pub(crate) fn mode_is_listed(mode: MotorConfiguration) -> bool {
    let within = |reg, value: u16| code(reg, Some(value.into())).is_some();
    within(Reg::MotorType, mode.motor_type)
        && within(Reg::Microstepping, mode.microstepping)
        && within(Reg::WorkCurrent, mode.work_current)
        && within(Reg::StopCurrent, mode.stop_current)
}

/// What stands behind `SET_MODE`, by example.
pub(crate) fn mode_example() -> String {
    format!("all of `{}`", mode_text(MotorConfiguration::FACTORY))
}

/// The fields of a statement.
pub(crate) struct Fields<'a> {
    text: &'a str,
    constants: &'a Constants,
    statement: &'a Statement,
    /// Name and value.
    given: Vec<(Token, Token)>,
}

impl<'a> Fields<'a> {
    /// Takes the operands apart.
    pub(crate) fn read(
        text: &'a str,
        constants: &'a Constants,
        statement: &'a Statement,
    ) -> Result<Fields<'a>, Diagnostic> {
        let mut given: Vec<(Token, Token)> = Vec::new();
        let mut rest = statement.operands.as_slice();
        while let [name, more @ ..] = rest {
            let [equals, value, more @ ..] = more else { return Err(not_a_field(text, statement, *name)) };
            if name.kind != Kind::Name || equals.kind != Kind::Equals {
                return Err(not_a_field(text, statement, *name));
            }
            let same = |other: &(Token, Token)| other.0.text(text).eq_ignore_ascii_case(name.text(text));
            if let Some((first, _)) = given.iter().copied().find(same) {
                return Err(Diagnostic::new(
                    Code::DuplicateField,
                    format!("`{}` is given twice", name.text(text)),
                )
                .at(name.span, "here again")
                .at(first.span, "first here"));
            }
            known(text, statement, *name)?;
            given.push((*name, *value));
            rest = more;
        }
        Ok(Fields { text, constants, statement, given })
    }

    /// The data bits of `SET_MODE`.
    pub(crate) fn mode(&self) -> Result<u32, Diagnostic> {
        self.complete(&MODE_FIELDS, &mode_example())?;
        let mode = MotorConfiguration {
            current_or_voltage: self.control()?,
            motor_type: self.motor()?,
            microstepping: self.microstep()?,
            work_current: self.current()?,
            stop_current: self.hold()?,
        };
        Ok(mode.data())
    }

    /// The data bits of a loop.
    pub(crate) fn repeat(&self) -> Result<u32, Diagnostic> {
        self.complete(&LOOP_FIELDS, "`cycles=10 instructions=3`")?;
        let half = |name| {
            let (value, span) = self.value(name)?;
            let number = value.plain().filter(|number| (0..=i64::from(LOOP_MAX)).contains(number));
            number.ok_or_else(|| self.wrong(name, span, &format!("a number from 0 to {LOOP_MAX}")))
        };
        let (cycles, instructions) = (half("cycles")?, half("instructions")?);
        Ok(u32::try_from(cycles << LOOP_CYCLES_SHIFT | instructions).unwrap_or(0))
    }

    fn complete(&self, names: &[&str], example: &str) -> Result<(), Diagnostic> {
        let missing: Vec<&str> = names.iter().copied().filter(|name| self.field(name).is_none()).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let message = format!("`{}` lacks {}", self.statement.word.text(self.text), missing.join(", "));
        let diagnostic =
            Diagnostic::new(Code::MissingField, message).at(self.statement.span(), "not complete");
        Err(diagnostic.help(format!("it takes {example}")))
    }

    fn control(&self) -> Result<u16, Diagnostic> {
        let token = self.field("control").unwrap_or(self.statement.word);
        let word = token.text(self.text);
        let code =
            (0..).zip(CONTROLS).find(|(_, name)| name.eq_ignore_ascii_case(word)).map(|(code, _)| code);
        code.ok_or_else(|| self.wrong("control", token.span, "`current` or `voltage`"))
    }

    fn motor(&self) -> Result<u16, Diagnostic> {
        let (value, span) = self.value("motor")?;
        let (min, max) = Reg::MotorType.info().range(Model::Smsd80);
        code(Reg::MotorType, value.plain())
            .ok_or_else(|| self.wrong("motor", span, &format!("a motor's number from {min} (none) to {max}")))
    }

    fn microstep(&self) -> Result<u16, Diagnostic> {
        let (value, span) = self.value("microstep")?;
        let parts = if let Value::Part(parts) = value {
            parts
        } else {
            value.plain().filter(|one| *one == 1).unwrap_or(0)
        };
        let power = u64::try_from(parts).ok().filter(|parts| parts.is_power_of_two());
        let exponent = power.map(|parts| i64::from(parts.trailing_zeros()));
        code(Reg::Microstepping, exponent).ok_or_else(|| {
            self.wrong("microstep", span, "1 (full steps), 1/2, 1/4, 1/8, 1/16, 1/32, 1/64 or 1/128")
        })
    }

    fn current(&self) -> Result<u16, Diagnostic> {
        let (value, span) = self.value("current")?;
        let ma = if let Value::Current(ma) = value { Some(ma) } else { None };
        let steps = ma.filter(|ma| ma % CURRENT_STEP_MA == 0).map(|ma| ma / CURRENT_STEP_MA);
        let (min, max) = Reg::WorkCurrent.info().range(Model::Smsd80);
        let allowed = format!("0.1A steps from {}A to {}A, as in 1.5A", tenths(min), tenths(max));
        code(Reg::WorkCurrent, steps).ok_or_else(|| self.wrong("current", span, &allowed))
    }

    fn hold(&self) -> Result<u16, Diagnostic> {
        let (value, span) = self.value("hold")?;
        let percent = if let Value::Percent(percent) = value { Some(percent) } else { None };
        let steps = percent.filter(|percent| percent % HOLD_STEP_PERCENT == 0);
        code(Reg::StopCurrent, steps.map(|percent| percent / HOLD_STEP_PERCENT - 1))
            .ok_or_else(|| self.wrong("hold", span, "25%, 50%, 75% or 100%"))
    }

    fn field(&self, name: &str) -> Option<Token> {
        let given = self.given.iter().find(|(known, _)| known.text(self.text).eq_ignore_ascii_case(name));
        given.map(|(_, value)| *value)
    }

    fn value(&self, name: &str) -> Result<(Value, Span), Diagnostic> {
        let token = self.field(name).unwrap_or(self.statement.word);
        Ok((self.constants.value(self.text, token)?, token.span))
    }

    fn wrong(&self, name: &str, span: Span, allowed: &str) -> Diagnostic {
        let message = format!("`{name}` cannot be {}", span.of(self.text));
        Diagnostic::new(Code::OutOfRange, message).at(span, "").help(format!("`{name}` is {allowed}"))
    }
}

/// The number as a code of the register, when it is in its range on the larger model.
fn code(reg: Reg, number: Option<i64>) -> Option<u16> {
    let (min, max) = reg.info().range(Model::Smsd80);
    number.filter(|number| (min..=max).contains(number)).and_then(|number| u16::try_from(number).ok())
}

fn tenths(value: i64) -> String {
    format!("{}.{}", value / 10, value % 10)
}

/// The names that a statement with fields knows.
pub(crate) fn names_of(operand: Operand) -> &'static [&'static str] {
    match operand {
        Operand::Mode => &MODE_FIELDS,
        Operand::Loop => &LOOP_FIELDS,
        Operand::None
        | Operand::Number { .. }
        | Operand::Position
        | Operand::Mask
        | Operand::Input
        | Operand::Jump => &[],
    }
}

fn known(text: &str, statement: &Statement, name: Token) -> Result<(), Diagnostic> {
    let Head::Instruction(info) = statement.head else { return Ok(()) };
    let (word, known) = (name.text(text), names_of(info.operand));
    if known.iter().any(|known| known.eq_ignore_ascii_case(word)) {
        return Ok(());
    }
    Err(Diagnostic::new(Code::UnknownField, format!("`{}` has no field `{word}`", info.name))
        .at(name.span, "not a field")
        .suggest(name.span, names::nearest(word, known.iter().copied()))
        .help(format!("its fields are {}", known.join(", "))))
}

fn not_a_field(text: &str, statement: &Statement, token: Token) -> Diagnostic {
    let message = format!("expected a field, found `{}`", token.text(text));
    let diagnostic = Diagnostic::new(Code::Syntax, message).at(token.span, "a field is `name=value`");
    let Head::Instruction(info) = statement.head else { return diagnostic };
    diagnostic.help(format!("`{}` takes {}", info.name, allowed_operand(info.operand)))
}
