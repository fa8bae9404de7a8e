//! Conditions: what a rig is run until, what a scenario waits for and expects.
//!
//! `stage.READY && (uhv.TMOT > 140 || !uhv.BAKE)`: a quantity of a drive is true when it is not 0, or is compared with a
//! number by `>`, `>=`, `<`, `<=`, `==` (also `=`) or `!=`. A number is decimal, may be negative, or is hexadecimal as
//! `0x1F`; `true` is 1 and `false` is 0. `!`, `&&` and `||`, or `not`, `and` and `or`, bind in this order, and
//! parentheses go before. `!` before a comparison is refused: it is easily taken to be for the quantity alone.

mod parse;

use crate::file::RigFile;
use crate::names::AnyQuantity;
use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

/// The most characters of a condition.
const LONGEST: usize = 1000;

/// A condition on the quantities of a rig's drives.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    root: Node,
    drives: Vec<usize>,
    flows: bool,
}

/// A condition, or a part of one.
#[derive(Clone, Debug, PartialEq)]
enum Node {
    /// It is not 0.
    Set(Term),
    Compared(Term, Comparison, f64),
    Not(Box<Node>),
    /// All of two or more, none of which is itself an `All`.
    All(Vec<Node>),
    /// One at least of two or more, none of which is itself an `Any`.
    Any(Vec<Node>),
}

/// A quantity of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Term {
    drive: usize,
    drive_name: String,
    quantity: AnyQuantity,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Comparison {
    Above,
    AtLeast,
    Below,
    AtMost,
    Equal,
    Unequal,
}

/// A mistake in a condition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConditionError {
    /// Where, in characters, from 1.
    pub column: usize,
    /// What is wrong, and what would be right.
    pub message: String,
    /// How many characters are meant; 0 when it is the condition as a whole.
    meant: usize,
}

impl Condition {
    /// Reads a condition for this rig.
    ///
    /// # Errors
    /// The first mistake in it. It has at most 1000 characters, and at most 32 parentheses within each other.
    pub fn parse(text: &str, rig: &RigFile) -> Result<Condition, ConditionError> {
        let condition = Condition::of(parse::parse(text, rig)?);
        if is_too_long(&format!("{condition}")) {
            return Err(too_long(1, ", written out with spaces"));
        }
        Ok(condition)
    }

    fn of(root: Node) -> Condition {
        let mut terms = Vec::new();
        root.collect_terms(&mut terms);
        let flows = terms.iter().any(|term| term.quantity.flows());
        let mut drives: Vec<usize> = terms.iter().map(|term| term.drive).collect();
        drives.sort_unstable();
        drives.dedup();
        Condition { root, drives, flows }
    }

    /// Whether it holds with the values that `look` gives, of a drive by its place in the rig file. Only as many are
    /// asked for as it takes.
    pub fn holds(&self, look: &mut impl FnMut(usize, AnyQuantity) -> f64) -> bool {
        self.root.holds(look)
    }

    /// The drives that it looks at, by their place in the rig file: each once, in order.
    pub fn drives(&self) -> impl Iterator<Item = usize> {
        self.drives.iter().copied()
    }

    /// Whether a quantity in it may change between two events; see [`AnyQuantity::flows`].
    pub fn flows(&self) -> bool {
        self.flows
    }
}

impl Node {
    fn holds(&self, look: &mut impl FnMut(usize, AnyQuantity) -> f64) -> bool {
        match self {
            Node::Set(term) => term.is(Comparison::Unequal, 0.0, look),
            Node::Compared(term, comparison, number) => term.is(*comparison, *number, look),
            Node::Not(part) => !part.holds(look),
            Node::All(parts) => parts.iter().all(|part| part.holds(look)),
            Node::Any(parts) => parts.iter().any(|part| part.holds(look)),
        }
    }

    fn collect_terms<'a>(&'a self, terms: &mut Vec<&'a Term>) {
        match self {
            Node::Set(term) | Node::Compared(term, ..) => terms.push(term),
            Node::Not(part) => part.collect_terms(terms),
            Node::All(parts) | Node::Any(parts) => parts.iter().for_each(|part| part.collect_terms(terms)),
        }
    }
}

impl Term {
    fn is(
        &self,
        comparison: Comparison,
        number: f64,
        look: &mut impl FnMut(usize, AnyQuantity) -> f64,
    ) -> bool {
        comparison.holds(look(self.drive, self.quantity), number)
    }
}

impl Comparison {
    /// All of them; where one sign begins like another, the longer is first.
    const ALL: [Comparison; 6] = [
        Comparison::AtLeast,
        Comparison::AtMost,
        Comparison::Equal,
        Comparison::Unequal,
        Comparison::Above,
        Comparison::Below,
    ];

    const fn sign(self) -> &'static str {
        match self {
            Comparison::Above => ">",
            Comparison::AtLeast => ">=",
            Comparison::Below => "<",
            Comparison::AtMost => "<=",
            Comparison::Equal => "==",
            Comparison::Unequal => "!=",
        }
    }

    #[allow(clippy::float_cmp, reason = "equal means equal; registers are whole numbers")]
    fn holds(self, value: f64, number: f64) -> bool {
        match self {
            Comparison::Above => value > number,
            Comparison::AtLeast => value >= number,
            Comparison::Below => value < number,
            Comparison::AtMost => value <= number,
            Comparison::Equal => value == number,
            Comparison::Unequal => value != number,
        }
    }
}

impl fmt::Display for Condition {
    /// In the normal form, which [`Condition::parse`] reads back as the same condition: names as the rig has them, signs
    /// instead of words, and no more parentheses than it takes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.root)
    }
}

impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Node::Set(term) => write!(f, "{term}"),
            Node::Compared(term, comparison, number) => write!(f, "{term} {} {number}", comparison.sign()),
            Node::Not(part) => match &**part {
                Node::Set(term) => write!(f, "!{term}"),
                Node::Compared(..) | Node::Not(_) | Node::All(_) | Node::Any(_) => write!(f, "!({part})"),
            },
            Node::All(parts) => joined(f, parts, " && "),
            Node::Any(parts) => joined(f, parts, " || "),
        }
    }
}

/// Writes parts in a row; a part that is an `Any` can only be one of an `All`, and needs parentheses there.
fn joined(f: &mut fmt::Formatter<'_>, parts: &[Node], between: &str) -> fmt::Result {
    for (number, part) in parts.iter().enumerate() {
        if number > 0 {
            f.write_str(between)?;
        }
        match part {
            Node::Any(_) => write!(f, "({part})")?,
            Node::Set(_) | Node::Compared(..) | Node::Not(_) | Node::All(_) => write!(f, "{part}")?,
        }
    }
    Ok(())
}

impl fmt::Display for Term {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.drive_name, self.quantity)
    }
}

impl ConditionError {
    /// The mistake as a person reads it: `column COLUMN: message`, then the condition with what is meant underlined.
    pub fn render(&self, text: &str) -> String {
        if self.meant == 0 || text.trim().is_empty() {
            return format!("{self}");
        }
        let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let (indent, rule) = (" ".repeat(self.column.saturating_sub(1)), "^".repeat(self.meant));
        format!("{self}\n  |\n  | {line}\n  | {indent}{rule}")
    }
}

impl fmt::Display for ConditionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "column {}: {}", self.column, self.message)
    }
}

impl core::error::Error for ConditionError {}

fn is_too_long(text: &str) -> bool {
    text.chars().nth(LONGEST).is_some()
}

fn too_long(column: usize, how: &str) -> ConditionError {
    let message = format!("a condition has at most {LONGEST} characters{how}");
    ConditionError { column, message, meant: 0 }
}
