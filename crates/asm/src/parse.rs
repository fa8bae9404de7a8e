//! Lines of words to statements. What a statement's operands mean is not looked at here.

use crate::diagnostic::{Code, Diagnostic, Findings};
use crate::lex::{self, Kind, Token, Words};
use crate::names;
use crate::source::{SourceFile, Span};
use stepdrive_spec::smsd::instructions::{OpcodeInfo, Operand};

/// The directives and what they are for.
pub(crate) const DIRECTIVES: [(&str, Head); 3] =
    [(".mem", Head::Memory), (".const", Head::Constant), (".word", Head::Word)];

/// What a statement is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Head {
    /// `.mem 1`: the instructions that follow belong to that memory.
    Memory,
    /// `.const fast = 800`.
    Constant,
    /// `.word 0x19060`: an instruction as a number.
    Word,
    /// An instruction by its name.
    Instruction(&'static OpcodeInfo),
    /// `}`: the end of a loop.
    Close,
    /// A line that could not be read; already reported.
    Broken,
}

/// One statement: `.mem 1`, `MOVE_F 3200`, `LOOP_PROGRAM 3 {`, `}`.
#[derive(Debug)]
pub(crate) struct Statement {
    pub(crate) head: Head,
    /// The word that says what it is.
    pub(crate) word: Token,
    pub(crate) operands: Vec<Token>,
    /// `true` when it ends with `{`.
    pub(crate) opens: bool,
}

impl Statement {
    /// From its first word to its last operand.
    pub(crate) fn span(&self) -> Span {
        self.operands.last().map_or(self.word.span, |last| self.word.span.around(last.span))
    }

    /// All operands; behind the first word when there are none.
    pub(crate) fn operand_span(&self) -> Span {
        match (self.operands.first(), self.operands.last()) {
            (Some(first), Some(last)) => first.span.around(last.span),
            _ => self.word.span,
        }
    }
}

/// One line of the text.
#[derive(Debug)]
pub(crate) struct Line {
    pub(crate) span: Span,
    pub(crate) label: Option<Token>,
    pub(crate) statement: Option<Statement>,
    pub(crate) comment: Option<Span>,
}

/// The lines of a text. Each wrong one is reported once, and comes out as far as it could be read.
pub(crate) fn parse(source: &SourceFile, findings: &mut Findings) -> Vec<Line> {
    (1..=source.line_count()).map(|number| parse_line(source.text(), source.line(number), findings)).collect()
}

fn parse_line(text: &str, span: Span, findings: &mut Findings) -> Line {
    // A byte order mark is no part of the first line.
    let marked = span.of(text).starts_with('\u{FEFF}');
    let span = Span::new(span.start + if marked { '\u{FEFF}'.len_utf8() } else { 0 }, span.end);
    let Words { tokens, comment, error } = lex::words(text, span);
    let (label, tokens) = match tokens.as_slice() {
        [name, colon, rest @ ..] if name.kind == Kind::Name && colon.kind == Kind::Colon => {
            (Some(*name), rest)
        }
        all => (None, all),
    };
    let statement = tokens.split_first().map(|(word, rest)| {
        let read = if error.is_some() { None } else { findings.note(read_statement(text, *word, rest)) };
        read.unwrap_or_else(|| broken(*word, rest))
    });
    if let Some(error) = error {
        findings.push(error);
    }
    Line { span, label, statement, comment }
}

fn broken(word: Token, rest: &[Token]) -> Statement {
    let count = |kind| rest.iter().filter(|token| token.kind == kind).count();
    let head = if word.kind == Kind::Close { Head::Close } else { Head::Broken };
    Statement { head, word, operands: Vec::new(), opens: count(Kind::Open) > count(Kind::Close) }
}

fn read_statement(text: &str, word: Token, rest: &[Token]) -> Result<Statement, Diagnostic> {
    let (rest, opens) = match rest {
        [rest @ .., last] if last.kind == Kind::Open => (rest, true),
        all => (all, false),
    };
    if let Some(brace) = rest.iter().find(|token| matches!(token.kind, Kind::Open | Kind::Close)) {
        return Err(misplaced_brace(text, *brace));
    }
    let head = match word.kind {
        Kind::Directive => directive(text, word)?,
        Kind::Name => Head::Instruction(instruction(text, word, rest)?),
        Kind::Close => close(word, rest, opens)?,
        Kind::Number | Kind::Colon | Kind::Equals | Kind::Bar | Kind::Open => {
            return Err(no_statement(text, word));
        }
    };
    let takes_body = matches!(head, Head::Instruction(info) if info.operand == Operand::Loop);
    if opens && !takes_body {
        let message = format!("`{}` has no body in braces", word.text(text));
        let diagnostic = Diagnostic::new(Code::Syntax, message).at(word.span, "not a loop");
        return Err(diagnostic.help("only `LOOP_PROGRAM 10 {` opens a body"));
    }
    Ok(Statement { head, word, operands: rest.to_vec(), opens })
}

fn directive(text: &str, word: Token) -> Result<Head, Diagnostic> {
    let name = word.text(text);
    let known = DIRECTIVES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
    known.map(|(_, head)| *head).ok_or_else(|| {
        let names = DIRECTIVES.iter().map(|(name, _)| *name);
        Diagnostic::new(Code::UnknownDirective, format!("there is no directive `{name}`"))
            .at(word.span, "not a directive")
            .suggest(word.span, names::nearest(name, names))
            .help("there are .mem, .const and .word")
    })
}

fn instruction(text: &str, word: Token, rest: &[Token]) -> Result<&'static OpcodeInfo, Diagnostic> {
    let name = word.text(text);
    if let Some(info) = names::instruction(name) {
        return Ok(info);
    }
    if rest.first().is_some_and(|next| next.kind == Kind::Equals) {
        return Err(Diagnostic::new(Code::Syntax, format!("`{name} =` is no statement"))
            .at(word.span, "a constant?")
            .help(format!("a constant is written `.const {name} = …`")));
    }
    let diagnostic = Diagnostic::new(Code::UnknownInstruction, format!("there is no instruction `{name}`"));
    let diagnostic = diagnostic.at(word.span, "not an instruction");
    Err(match names::nearest_instruction(name) {
        None => diagnostic.help("a line is an instruction with its operand, as in `MOVE_F 3200`"),
        nearest => diagnostic.suggest(word.span, nearest),
    })
}

fn close(word: Token, rest: &[Token], opens: bool) -> Result<Head, Diagnostic> {
    if rest.is_empty() && !opens {
        return Ok(Head::Close);
    }
    let diagnostic =
        Diagnostic::new(Code::Syntax, "`}` stands on a line of its own").at(word.span, "ends a loop");
    Err(diagnostic.help("put what follows it on the next line"))
}

fn misplaced_brace(text: &str, brace: Token) -> Diagnostic {
    let message = format!("`{}` cannot stand in the middle of a line", brace.text(text));
    Diagnostic::new(Code::Syntax, message)
        .at(brace.span, "")
        .help("the body of a loop has a line for each instruction, and `}` a line of its own")
}

fn no_statement(text: &str, word: Token) -> Diagnostic {
    Diagnostic::new(Code::Syntax, format!("a line cannot begin with `{}`", word.text(text)))
        .at(word.span, "expected an instruction, a label or a directive")
        .help("for example `MOVE_F 3200`, `start:` or `.mem 1`")
}
