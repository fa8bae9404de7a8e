//! What is wrong with a program, as values. [`crate::render()`] prints them, [`crate::report()`] resolves them for machines.

use crate::source::Span;
use serde::{Serialize, Serializer};
use std::fmt;

/// More errors than this, or more warnings, are counted and not kept.
pub const MAX_DIAGNOSTICS: usize = 100;

/// A message, remark or line of help longer than this many bytes loses its middle.
const LONGEST_TEXT: usize = 240;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// No program comes out.
    Error,
    /// The program is built, but probably does not do what was meant.
    Warning,
}

macro_rules! codes {
    ($($(#[doc = $about:literal])+ $severity:ident $code:ident = $name:literal;)+) => {
        /// Which rule was broken. The names are stable: scripts may look for them.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Code { $($(#[doc = $about])+ $code,)+ }

        impl Code {
            /// All of them, errors first.
            pub const ALL: &[Code] = &[$(Code::$code),+];

            /// Its name, as in `unknown-instruction`.
            pub const fn name(self) -> &'static str {
                match self { $(Code::$code => $name,)+ }
            }

            /// How bad it is.
            pub const fn severity(self) -> Severity {
                match self { $(Code::$code => Severity::$severity,)+ }
            }

            /// What it means, in one sentence.
            pub const fn about(self) -> &'static str {
                match self { $(Code::$code => concat!($($about,)+).trim_ascii_start(),)+ }
            }
        }
    };
}

codes! {
    /// The file is not UTF-8 text.
    Error NotText = "not-text";
    /// The text is longer than a program can be.
    Error TooLarge = "too-large";
    /// A character that the language does not use.
    Error UnexpectedCharacter = "unexpected-character";
    /// The line does not have the form of any statement.
    Error Syntax = "syntax";
    /// No instruction has this name.
    Error UnknownInstruction = "unknown-instruction";
    /// No directive has this name.
    Error UnknownDirective = "unknown-directive";
    /// The controller answers this instruction over USB only; a program that meets it stops with an error.
    Error NotInPrograms = "not-in-programs";
    /// An operand is missing.
    Error MissingOperand = "missing-operand";
    /// There is more on the line than the statement takes.
    Error TooManyOperands = "too-many-operands";
    /// An operand of another kind is needed here.
    Error WrongOperand = "wrong-operand";
    /// A number that cannot be read.
    Error BadNumber = "bad-number";
    /// A value with a unit that does not fit here.
    Error WrongUnit = "wrong-unit";
    /// A value outside the range that the controller takes.
    Error OutOfRange = "out-of-range";
    /// A field that this instruction does not have.
    Error UnknownField = "unknown-field";
    /// A field that this instruction needs is missing.
    Error MissingField = "missing-field";
    /// A field is given twice.
    Error DuplicateField = "duplicate-field";
    /// No constant or input has this name.
    Error UnknownName = "unknown-name";
    /// No label in that memory has this name.
    Error UnknownLabel = "unknown-label";
    /// The name is already taken by another line.
    Error DuplicateName = "duplicate-name";
    /// The language uses this name itself.
    Error ReservedName = "reserved-name";
    /// The memory already has its instructions.
    Error DuplicateMemory = "duplicate-memory";
    /// More instructions than a memory holds.
    Error MemoryFull = "memory-full";
    /// A loop without its closing brace.
    Error UnclosedLoop = "unclosed-loop";
    /// A closing brace without its loop.
    Error UnopenedLoop = "unopened-loop";

    /// More was found than is shown.
    Warning TooMany = "too-many";
    /// A word that is no instruction; the controller refuses to store it.
    Warning NotAnInstruction = "not-an-instruction";
    /// A raw word whose instruction ends a program with an error.
    Warning RefusedInstruction = "refused-instruction";
    /// A label just before the end of a loop: a jump to it leaves the loop.
    Warning LabelAtLoopEnd = "label-at-loop-end";
    /// No path leads to these instructions.
    Warning Unreachable = "unreachable";
    /// A loop that can neither end nor wait for anything.
    Warning EndlessLoop = "endless-loop";
    /// The program runs past the last instruction of its memory, which ends it.
    Warning RunsPastEnd = "runs-past-end";
    /// A jump behind the last instruction of a memory, which ends the program.
    Warning JumpPastEnd = "jump-past-end";
    /// A jump into a memory that is empty here.
    Warning EmptyMemory = "empty-memory";
    /// The motor must stand still for this instruction, and may be turning.
    Warning MotorMayTurn = "motor-may-turn";
    /// The phases must be de-energised for this instruction, and may be energised.
    Warning MayBeEnergised = "may-be-energised";
    /// A `RETURN_PROGRAM` that is reached without a `CALL_PROGRAM`.
    Warning ReturnWithoutCall = "return-without-call";
    /// A subroutine that may call itself before it returns.
    Warning RecursiveCall = "recursive-call";
    /// Calls within calls, deeper than the controller goes.
    Warning CallTooDeep = "call-too-deep";
    /// Loops within loops, deeper than the controller goes.
    Warning LoopTooDeep = "loop-too-deep";
    /// A loop that repeats nothing, or no times.
    Warning IdleLoop = "idle-loop";
    /// A loop body that reaches behind the end of the memory.
    Warning LoopPastEnd = "loop-past-end";
    /// A loop body that ends inside another loop.
    Warning LoopsCross = "loops-cross";
    /// A jump from outside into the body of a loop.
    Warning JumpIntoLoop = "jump-into-loop";
    /// The memory has little room left.
    Warning NearlyFull = "nearly-full";
    /// The value is beyond what this model of controller takes.
    Warning BeyondModel = "beyond-model";
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Serialize for Code {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// An instruction of the controller by where it lies; shown as `mem0:12`, as a jump has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct Place {
    /// The memory, 0 to 3.
    pub memory: u8,
    /// The line within it, 0 to 254; up to 255 as the target of a jump.
    pub line: u8,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "mem{}:{}", self.memory, self.line)
    }
}

/// A remark on one place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// Where in the text; `None` for a program that has none.
    pub span: Option<Span>,
    /// Which instruction; `None` where the remark is on something else.
    pub place: Option<Place>,
    /// The remark, a few words; may be empty.
    pub text: String,
}

/// A change that probably repairs it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suggestion {
    /// What to replace.
    pub span: Span,
    /// By what.
    pub replacement: String,
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Which rule was broken.
    pub code: Code,
    /// What happened, to what.
    pub message: String,
    /// Where: the culprit first, then what else matters.
    pub labels: Vec<Label>,
    /// What is allowed, what to do.
    pub help: Vec<String>,
    /// A change that probably repairs it.
    pub suggestion: Option<Suggestion>,
}

impl Diagnostic {
    /// A finding that points nowhere yet.
    pub fn new(code: Code, message: impl Into<String>) -> Diagnostic {
        Diagnostic {
            code,
            message: clipped(message.into()),
            labels: Vec::new(),
            help: Vec::new(),
            suggestion: None,
        }
    }

    /// How bad it is.
    pub const fn severity(&self) -> Severity {
        self.code.severity()
    }

    /// The same with a remark on a place of the text. The first one is the culprit.
    #[must_use]
    pub fn at(mut self, span: Span, text: impl Into<String>) -> Diagnostic {
        self.labels.push(Label { span: Some(span), place: None, text: clipped(text.into()) });
        self
    }

    /// The same with a line of help.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Diagnostic {
        self.help.push(clipped(text.into()));
        self
    }

    /// The same with a replacement for a misspelt word.
    #[must_use]
    pub fn suggest(mut self, span: Span, replacement: Option<String>) -> Diagnostic {
        if let Some(replacement) = replacement {
            self.help.push(format!("did you mean `{replacement}`?"));
            self.suggestion = Some(Suggestion { span, replacement });
        }
        self
    }

    fn start(&self) -> Option<(Option<Span>, Option<Place>)> {
        self.labels.first().map(|label| (label.span, label.place))
    }
}

/// The text without its middle when it is very long: a misspelt word may have a million letters.
fn clipped(text: String) -> String {
    if text.len() <= LONGEST_TEXT {
        return text;
    }
    let (head, tail) =
        (text.floor_char_boundary(LONGEST_TEXT / 2), text.ceil_char_boundary(text.len() - LONGEST_TEXT / 4));
    format!("{}…{}", text.get(..head).unwrap_or(""), text.get(tail..).unwrap_or(""))
}

/// Collects findings, up to [`MAX_DIAGNOSTICS`] errors and as many warnings.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    kept: Vec<Diagnostic>,
    errors: usize,
    warnings: usize,
}

impl Findings {
    pub(crate) fn push(&mut self, diagnostic: Diagnostic) {
        let count = match diagnostic.severity() {
            Severity::Error => &mut self.errors,
            Severity::Warning => &mut self.warnings,
        };
        *count += 1;
        if *count <= MAX_DIAGNOSTICS {
            self.kept.push(diagnostic);
        }
    }

    /// Keeps the error of a result and gives back its value.
    pub(crate) fn note<T>(&mut self, result: Result<T, Diagnostic>) -> Option<T> {
        result.map_err(|diagnostic| self.push(diagnostic)).ok()
    }

    pub(crate) fn has_errors(&self) -> bool {
        self.errors > 0
    }

    /// In the order of the text, with a closing line when some were dropped.
    pub(crate) fn finish(mut self) -> Vec<Diagnostic> {
        self.kept.sort_by_key(Diagnostic::start);
        let dropped = self.errors + self.warnings - self.kept.len();
        if dropped > 0 {
            let message = format!("{dropped} more findings are not shown");
            self.kept
                .push(Diagnostic::new(Code::TooMany, message).help("see to these first, then look again"));
        }
        self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_of_the_codes_are_unique_and_errors_stand_first() {
        for code in Code::ALL {
            assert_eq!(Code::ALL.iter().filter(|other| other.name() == code.name()).count(), 1, "{code}");
            assert!(code.about().ends_with('.'), "{code}");
        }
        assert!(Code::ALL.iter().is_sorted_by_key(|code| code.severity()));
    }

    #[test]
    fn what_does_not_fit_is_counted() {
        let mut findings = Findings::default();
        for _ in 0..MAX_DIAGNOSTICS + 3 {
            findings.push(Diagnostic::new(Code::Syntax, "x"));
        }
        let kept = findings.finish();
        assert_eq!(kept.len(), MAX_DIAGNOSTICS + 1);
        assert_eq!(kept.last().map(|one| one.message.as_str()), Some("3 more findings are not shown"));
    }
}
