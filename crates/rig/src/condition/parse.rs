//! The text of a condition, read.

use super::{Comparison, ConditionError, LONGEST, Node, Term, is_too_long, too_long};
use crate::file::RigFile;
use crate::names::{NameError, shown};
use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// The most parentheses within each other.
const DEEPEST: usize = 32;

/// The largest hexadecimal number: up to here all whole numbers are exact.
const LARGEST_HEX: u64 = 1 << 53;

/// Reads a condition as a tree.
pub(super) fn parse(text: &str, rig: &RigFile) -> Result<Node, ConditionError> {
    if is_too_long(text) {
        return Err(too_long(LONGEST + 1, ""));
    }
    let mut parser = Parser { text, at: 0, depth: 0, rig };
    let root = parser.any()?;
    match parser.next_char() {
        None => Ok(root),
        Some(')') => Err(parser.mistake_here("there is no ( for this )")),
        Some(_) => Err(parser.mistake_here("expected && or || or the end of the condition")),
    }
}

/// How far a text has been read.
struct Parser<'a> {
    text: &'a str,
    /// In bytes.
    at: usize,
    /// How many parentheses are open.
    depth: usize,
    rig: &'a RigFile,
}

impl<'a> Parser<'a> {
    /// One or more with `||` between.
    fn any(&mut self) -> Result<Node, ConditionError> {
        let mut parts = vec![self.all()?];
        while self.take_operator("||", "or") {
            parts.push(self.all()?);
        }
        Ok(joined(parts, parts_of_any, Node::Any))
    }

    /// One or more with `&&` between.
    fn all(&mut self) -> Result<Node, ConditionError> {
        let mut parts = vec![self.negated()?];
        while self.take_operator("&&", "and") {
            parts.push(self.negated()?);
        }
        Ok(joined(parts, parts_of_all, Node::All))
    }

    /// Something with any number of `!` before it.
    fn negated(&mut self) -> Result<Node, ConditionError> {
        self.skip_space();
        let start = self.at;
        let mut signs = 0;
        while self.take_not() {
            signs += 1;
        }
        let parenthesised = self.next_char() == Some('(');
        let part = if parenthesised { self.parenthesised()? } else { self.atom()? };
        if signs > 0 && !parenthesised && matches!(part, Node::Compared(..)) {
            let message =
                format!("is this for the quantity or the comparison? For the latter, write !({part})");
            return Err(self.mistake(start..start + 1, message));
        }
        Ok(if signs % 2 == 1 { negation(part) } else { part })
    }

    fn parenthesised(&mut self) -> Result<Node, ConditionError> {
        if self.depth == DEEPEST {
            let message = format!("more than {DEEPEST} parentheses within each other");
            return Err(self.mistake(self.at..self.at + 1, message));
        }
        let opened = self.at;
        self.at += 1;
        self.depth += 1;
        let part = self.any()?;
        self.depth -= 1;
        match self.next_char() {
            Some(')') => self.at += 1,
            Some(_) => return Err(self.mistake_here("expected && or || or )")),
            None => return Err(self.mistake(opened..opened + 1, "there is no ) for this (")),
        }
        Ok(part)
    }

    /// A quantity, perhaps compared with a number.
    fn atom(&mut self) -> Result<Node, ConditionError> {
        let term = self.term()?;
        let Some(comparison) = self.take_comparison() else { return Ok(Node::Set(term)) };
        Ok(Node::Compared(term, comparison, self.number()?))
    }

    fn term(&mut self) -> Result<Term, ConditionError> {
        self.skip_space();
        let drive = self.take_word();
        let part = self.at + 1..self.at + 1 + quantity_name(self.text.get(self.at + 1..).unwrap_or(""));
        if drive.is_empty() || !self.rest().starts_with('.') || part.is_empty() {
            return Err(self.mistake(drive, "expected a quantity of a drive, as in stage.READY"));
        }
        self.at = part.end;
        let unknown = |span: &Range<usize>, error: NameError| self.mistake(span.clone(), error.message);
        let number = self.rig.find_drive(self.slice(&drive)).map_err(|error| unknown(&drive, error))?;
        let quantity = self.rig.find_quantity(number, self.slice(&part));
        let quantity = quantity.map_err(|error| unknown(&part, error))?;
        let drive_name = self.rig.drives.get(number).map_or_else(String::new, |drive| drive.name.clone());
        Ok(Term { drive: number, drive_name, quantity })
    }

    fn take_comparison(&mut self) -> Option<Comparison> {
        self.skip_space();
        let found = Comparison::ALL.into_iter().find(|comparison| self.rest().starts_with(comparison.sign()));
        if let Some(comparison) = found {
            self.at += comparison.sign().len();
        } else if self.rest().starts_with('=') {
            self.at += 1;
            return Some(Comparison::Equal);
        }
        found
    }

    fn number(&mut self) -> Result<f64, ConditionError> {
        self.skip_space();
        let in_number = |c: char| is_in_word(c) || c == '.';
        let length = self.rest().find(|c| !in_number(c)).unwrap_or(self.rest().len());
        let span = self.at..self.at + length;
        let text = self.slice(&span);
        if text.is_empty() {
            return Err(self.mistake_here("expected a number, as in stage.SPEED >= 100"));
        }
        let number = number(text).ok_or_else(|| {
            let message = format!("`{}` is no number, as in stage.SPEED >= 100", shown(text));
            self.mistake(span.clone(), message)
        })?;
        self.at = span.end;
        Ok(number)
    }

    fn take_operator(&mut self, sign: &str, word: &str) -> bool {
        self.skip_space();
        let length = if self.rest().starts_with(sign) {
            sign.len()
        } else if self.next_word().eq_ignore_ascii_case(word) {
            word.len()
        } else {
            return false;
        };
        self.at += length;
        true
    }

    /// A drive may be called `not`.
    fn take_not(&mut self) -> bool {
        self.skip_space();
        let word = self.next_word();
        let is_drive = self.rest().get(word.len()..).is_some_and(|rest| rest.starts_with('.'));
        if self.rest().starts_with('!') {
            self.at += 1;
        } else if word.eq_ignore_ascii_case("not") && !is_drive {
            self.at += word.len();
        } else {
            return false;
        }
        true
    }

    /// Goes behind the next word, and says where it is.
    fn take_word(&mut self) -> Range<usize> {
        let start = self.at;
        self.at += word(self.rest());
        start..self.at
    }

    fn next_word(&self) -> &'a str {
        self.slice(&(self.at..self.at + word(self.rest())))
    }

    /// Goes to what comes next and looks at it.
    fn next_char(&mut self) -> Option<char> {
        self.skip_space();
        self.rest().chars().next()
    }

    fn skip_space(&mut self) {
        self.at = self.text.len() - self.rest().trim_start().len();
    }

    fn rest(&self) -> &'a str {
        self.text.get(self.at..).unwrap_or("")
    }

    fn slice(&self, span: &Range<usize>) -> &'a str {
        self.text.get(span.clone()).unwrap_or("")
    }

    fn mistake_here(&self, message: &str) -> ConditionError {
        let length = self.rest().chars().next().map_or(1, char::len_utf8);
        self.mistake(self.at..self.at + length, message)
    }

    fn mistake(&self, span: Range<usize>, message: impl Into<String>) -> ConditionError {
        let before = self.slice(&(0..span.start)).chars().count();
        let meant = self.slice(&span).chars().count().max(1);
        ConditionError { column: before + 1, message: message.into(), meant }
    }
}

/// Several parts as one, and one as it is. What is itself several of that kind is taken apart.
fn joined(parts: Vec<Node>, inner: fn(Node) -> Vec<Node>, join: fn(Vec<Node>) -> Node) -> Node {
    let mut parts: Vec<Node> = parts.into_iter().flat_map(inner).collect();
    if parts.len() == 1 { parts.remove(0) } else { join(parts) }
}

fn parts_of_any(part: Node) -> Vec<Node> {
    if let Node::Any(parts) = part { parts } else { vec![part] }
}

fn parts_of_all(part: Node) -> Vec<Node> {
    if let Node::All(parts) = part { parts } else { vec![part] }
}

fn negation(part: Node) -> Node {
    if let Node::Not(inner) = part { *inner } else { Node::Not(Box::new(part)) }
}

/// How long the word is with which a text begins. Names of drives have `-` in them.
fn word(text: &str) -> usize {
    text.find(|c| !is_in_word(c)).unwrap_or(text.len())
}

/// How long the name of a quantity is with which a text begins. An SMD3 has `L+` and `L-`.
fn quantity_name(text: &str) -> usize {
    text.find(|c| !is_in_word(c) && c != '+').unwrap_or(text.len())
}

fn is_in_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '-'
}

/// The number that is written so.
fn number(text: &str) -> Option<f64> {
    if text.eq_ignore_ascii_case("true") {
        return Some(1.0);
    }
    if text.eq_ignore_ascii_case("false") {
        return Some(0.0);
    }
    let (sign, digits) = text.strip_prefix('-').map_or((1.0, text), |digits| (-1.0, digits));
    let hexadecimal = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X"));
    let size = hexadecimal.map_or_else(|| decimal_number(digits), hexadecimal_number)?;
    Some(sign * size)
}

fn hexadecimal_number(digits: &str) -> Option<f64> {
    let plain = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    let number = plain.then(|| u64::from_str_radix(digits, 16).ok()).flatten()?;
    (number <= LARGEST_HEX).then_some(number as f64)
}

fn decimal_number(digits: &str) -> Option<f64> {
    let (whole, decimals) = digits.split_once('.').unwrap_or((digits, "0"));
    let plain = |digits: &str| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    let number: f64 = (plain(whole) && plain(decimals)).then(|| digits.parse().ok()).flatten()?;
    number.is_finite().then_some(number)
}
