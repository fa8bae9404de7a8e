//! The operands of an instruction to its 22 data bits. Which operands there are and how far they go is read from the
//! instruction table.

use crate::diagnostic::{Code, Diagnostic};
use crate::fields::{self, Fields};
use crate::lex::{Kind, Token};
use crate::names;
use crate::parse::Statement;
use crate::value::{Constants, Value, superfluous};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, OpcodeInfo, Operand};
use stepdrive_spec::smsd::ring;

/// The bits of an 8-bit mask.
pub(crate) const MASK_MAX: u32 = u8::MAX as u32;
/// The bits of `Operand::Jump` that count: 7:0 the instruction, 9:8 the memory.
pub(crate) const JUMP_BITS: u32 = 0x3FF;
/// The most that either half of `Operand::Loop` holds: 9:0 instructions, 19:10 cycles.
pub(crate) const LOOP_MAX: u32 = 0x3FF;
/// Where the cycles of `Operand::Loop` begin.
pub(crate) const LOOP_CYCLES_SHIFT: u32 = 10;
/// The fields of a loop without braces.
pub(crate) const LOOP_FIELDS: [&str; 2] = ["cycles", "instructions"];

/// What the operands of a statement come to.
#[derive(Debug)]
pub(crate) enum Encoded {
    /// The data bits.
    Data(u32),
    /// A jump; its target may stand further down.
    Jump(Target),
    /// A loop whose body follows in braces.
    Body {
        /// How often it is repeated.
        cycles: u32,
    },
}

/// Where a jump goes. Without a memory it stays in its own.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Target {
    /// To a line by its number.
    Line(Option<u8>, u8),
    /// To a label.
    Label(Option<u8>, Token),
}

/// The data bits in the two halves of `Operand::Jump`.
pub(crate) fn jump_data(memory: u8, line: u8) -> u32 {
    u32::from(memory) << 8 | u32::from(line)
}

/// What may stand behind an instruction with such an operand, in words, as in `a number from 16 to 15600 full step/s`.
pub fn allowed_operand(operand: Operand) -> String {
    let inputs = Input::ALL.map(Input::name).join(", ");
    match operand {
        Operand::None => "nothing".to_owned(),
        Operand::Number { min, max, unit: "" } => format!("a number from {min} to {max}"),
        Operand::Number { min, max, unit: "ms" } => {
            format!("a time from {min} to {max} ms, as in 500ms, 2s, 1min")
        }
        Operand::Number { min, max, unit } => format!("a number from {min} to {max} {unit}"),
        Operand::Position => format!("a number of microsteps from {} to {}", ring::MIN, ring::MAX),
        Operand::Mask => format!("inputs joined by `|` ({inputs}), or a number from 0 to {MASK_MAX:#X}"),
        Operand::Input => format!("an input ({inputs}), or its number from 0 to {}", Input::ALL.len() - 1),
        Operand::Mode => fields::mode_example(),
        Operand::Jump => {
            "a label, a line, or either in another memory: `done`, `12`, `mem1:pick`, `mem1:12`".to_owned()
        }
        Operand::Loop => {
            format!("`10 {{` with the body behind it, or `cycles=10 instructions=3`, each up to {LOOP_MAX}")
        }
    }
}

/// Reads the operands of an instruction. One with a constant that could not be read is let pass: that is reported.
pub(crate) fn encode(
    text: &str,
    constants: &Constants,
    info: &'static OpcodeInfo,
    statement: &Statement,
) -> Result<Encoded, Diagnostic> {
    if constants.any_broken(text, &statement.operands) {
        return Ok(Encoded::Data(0));
    }
    let reader = Reader { text, constants, info, statement };
    match info.operand {
        Operand::None => reader.none(),
        Operand::Number { min, max, unit } => reader.number(min, max, unit),
        Operand::Position => reader.position(),
        Operand::Mask => reader.mask(),
        Operand::Input => reader.input(),
        Operand::Mode => Fields::read(text, constants, statement)?.mode().map(Encoded::Data),
        Operand::Jump => reader.jump(),
        Operand::Loop => reader.repeat(),
    }
}

struct Reader<'a> {
    text: &'a str,
    constants: &'a Constants,
    info: &'static OpcodeInfo,
    statement: &'a Statement,
}

impl Reader<'_> {
    fn none(&self) -> Result<Encoded, Diagnostic> {
        match self.statement.operands.first() {
            None => Ok(Encoded::Data(0)),
            Some(extra) => {
                let message = format!("`{}` takes no operand", self.info.name);
                Err(Diagnostic::new(Code::TooManyOperands, message).at(extra.span, "not expected here"))
            }
        }
    }

    fn number(&self, min: u32, max: u32, unit: &str) -> Result<Encoded, Diagnostic> {
        let value = self.value()?;
        let number = value.in_unit(unit).ok_or_else(|| self.wrong_unit(value))?;
        let in_range = u32::try_from(number).ok().filter(|number| (min..=max).contains(number));
        in_range.map(Encoded::Data).ok_or_else(|| self.out_of_range(number))
    }

    fn position(&self) -> Result<Encoded, Diagnostic> {
        let value = self.value()?;
        let number = value.plain().ok_or_else(|| self.wrong_unit(value))?;
        let in_range = i32::try_from(number).ok().filter(|number| (ring::MIN..=ring::MAX).contains(number));
        let position = in_range.ok_or_else(|| self.out_of_range(number))?;
        Ok(Encoded::Data(Instruction::with_position(self.info.opcode, position).data))
    }

    fn mask(&self) -> Result<Encoded, Diagnostic> {
        if self.statement.operands.is_empty() {
            return Err(self.missing());
        }
        let value = self.constants.joined(self.text, &self.statement.operands)?;
        if let Value::Inputs(mask) = value {
            return Ok(Encoded::Data(u32::from(mask)));
        }
        let number = value.plain().ok_or_else(|| self.wrong_unit(value))?;
        let in_range = u32::try_from(number).ok().filter(|number| *number <= MASK_MAX);
        in_range.map(Encoded::Data).ok_or_else(|| self.out_of_range(number))
    }

    fn input(&self) -> Result<Encoded, Diagnostic> {
        let value = self.value()?;
        if let Value::Inputs(mask) = value {
            let message = || format!("`{}` takes one input, not several", self.info.name);
            let one = mask.is_power_of_two().then(|| Encoded::Data(mask.trailing_zeros()));
            return one.ok_or_else(|| self.wrong(Code::WrongOperand, message(), "several inputs"));
        }
        let number = value.plain().ok_or_else(|| self.wrong_unit(value))?;
        let input = u16::try_from(number).ok().and_then(Input::from_number);
        input.map(|input| Encoded::Data(u32::from(input.number()))).ok_or_else(|| self.out_of_range(number))
    }

    fn jump(&self) -> Result<Encoded, Diagnostic> {
        let operands = self.statement.operands.as_slice();
        let (memory, target, extra) = match operands {
            [mem, colon, target, rest @ ..] if colon.kind == Kind::Colon => {
                (Some(self.memory(*mem)?), *target, rest.first())
            }
            [mem, colon] if colon.kind == Kind::Colon => {
                let diagnostic = Diagnostic::new(Code::MissingOperand, "nothing stands behind `:`");
                return Err(
                    self.hint(diagnostic.at(mem.span.around(colon.span), "expected a label or a line"))
                );
            }
            [target, rest @ ..] => (None, *target, rest.first()),
            [] => return Err(self.missing()),
        };
        if let Some(extra) = extra {
            return Err(self.hint(superfluous(self.text, *extra)));
        }
        let word = target.text(self.text);
        if names::memory(word).is_some() {
            let diagnostic =
                Diagnostic::new(Code::WrongOperand, format!("`{word}` is a memory, not a place in it"));
            let diagnostic = diagnostic.at(target.span, "which instruction?");
            return Err(diagnostic.help(format!("its first one is `{word}:0`")));
        }
        Ok(Encoded::Jump(match target.kind {
            Kind::Name => Target::Label(memory, target),
            Kind::Number
            | Kind::Directive
            | Kind::Colon
            | Kind::Equals
            | Kind::Bar
            | Kind::Open
            | Kind::Close => Target::Line(memory, self.line(target)?),
        }))
    }

    fn memory(&self, token: Token) -> Result<u8, Diagnostic> {
        let word = token.text(self.text);
        let Some(number) = names::memory(word) else {
            let message = format!("`{word}` is no memory");
            return Err(self
                .hint(Diagnostic::new(Code::WrongOperand, message).at(token.span, "expected mem0 to mem3")));
        };
        names::area(i64::from(number)).ok_or_else(|| {
            let message = format!("there is no memory {number}");
            Diagnostic::new(Code::OutOfRange, message).at(token.span, "a controller has mem0 to mem3")
        })
    }

    fn line(&self, token: Token) -> Result<u8, Diagnostic> {
        let value = self.constants.value(self.text, token)?;
        let number = value.plain().ok_or_else(|| self.wrong_unit(value))?;
        u8::try_from(number).map_err(|_| {
            let message = format!("there is no line {number}");
            Diagnostic::new(Code::OutOfRange, message).at(token.span, "lines are 0 to 254, and 255 the end")
        })
    }

    fn repeat(&self) -> Result<Encoded, Diagnostic> {
        let named = self.statement.operands.get(1).is_some_and(|second| second.kind == Kind::Equals);
        if self.statement.opens && !named {
            let value = self.value()?;
            let number = value.plain().ok_or_else(|| self.wrong_unit(value))?;
            let cycles = u32::try_from(number).ok().filter(|number| *number <= LOOP_MAX);
            return cycles.map(|cycles| Encoded::Body { cycles }).ok_or_else(|| self.out_of_range(number));
        }
        if self.statement.opens || !named && !self.statement.operands.is_empty() {
            let message = format!("`{}` has either braces or `instructions=`", self.info.name);
            return Err(self.wrong(Code::Syntax, message, "which instructions shall be repeated?"));
        }
        let fields = Fields::read(self.text, self.constants, self.statement)?;
        Ok(Encoded::Data(fields.repeat()?))
    }

    /// The only operand.
    fn value(&self) -> Result<Value, Diagnostic> {
        match self.statement.operands.as_slice() {
            [] => Err(self.missing()),
            [only] => self.constants.value(self.text, *only).map_err(|diagnostic| self.hint(diagnostic)),
            [_, extra, ..] => Err(self.hint(superfluous(self.text, *extra))),
        }
    }

    fn missing(&self) -> Diagnostic {
        let message = format!("`{}` needs an operand", self.info.name);
        self.wrong(Code::MissingOperand, message, "nothing stands behind it")
    }

    fn wrong_unit(&self, value: Value) -> Diagnostic {
        let message = format!("`{}` takes no such value", self.info.name);
        self.wrong(Code::WrongUnit, message, &format!("this is {}", value.kind()))
    }

    fn out_of_range(&self, number: i64) -> Diagnostic {
        let operand = self.statement.operands.first();
        let label = match operand.filter(|operand| operand.kind == Kind::Name) {
            Some(_) => format!("this is {number}"),
            None => String::new(),
        };
        let written = self.statement.operand_span().of(self.text);
        let message = format!("`{written}` is out of the range of `{}`", self.info.name);
        self.wrong(Code::OutOfRange, message, &label)
    }

    fn wrong(&self, code: Code, message: String, label: &str) -> Diagnostic {
        self.hint(Diagnostic::new(code, message).at(self.statement.operand_span(), label))
    }

    fn hint(&self, diagnostic: Diagnostic) -> Diagnostic {
        diagnostic.help(format!("`{}` takes {}", self.info.name, allowed_operand(self.info.operand)))
    }
}
