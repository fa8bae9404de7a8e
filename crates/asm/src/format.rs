//! The one way to lay out a program.

use crate::diagnostic::{Diagnostic, Findings};
use crate::disassemble::{DEEPEST_INDENT, INDENT};
use crate::fields::{CONTROLS, names_of};
use crate::lex::{Kind, Token};
use crate::names;
use crate::parse::{self, Head, Line, Statement};
use crate::source::{MAX_TEXT_BYTES, SourceFile, too_large};
use crate::value::canonical_unit;
use stepdrive_spec::smsd::instructions::Operand;

/// Code wider than this does not push the comments of its neighbours to the right.
const WIDEST_ALIGNED: usize = 64;

/// The text laid out properly: the maker's names in capitals, labels on lines of their own, bodies indented, comments
/// below each other. Comments and blank lines stay (of several blank lines one), and so does every value as it was
/// written. Formatting the result again changes nothing, and it assembles to the same words.
///
/// # Errors
/// What is wrong with lines that cannot be read; such a text is left alone.
pub fn format(source: &SourceFile) -> Result<String, Vec<Diagnostic>> {
    if source.text().len() > MAX_TEXT_BYTES {
        return Err(vec![too_large(source.text().len())]);
    }
    let mut findings = Findings::default();
    let lines = parse::parse(source, &mut findings);
    if findings.has_errors() {
        return Err(findings.finish());
    }
    let mut layout = Layout { text: source.text(), depth: 0, rows: Vec::new() };
    for line in &lines {
        layout.line(line);
    }
    let formatted = layout.finish();
    if formatted.len() > MAX_TEXT_BYTES {
        // Only with more lines than any program has; the result could not be read again.
        return Err(vec![too_large(formatted.len())]);
    }
    Ok(formatted)
}

/// A line of the result.
#[derive(Default)]
struct Row {
    /// The indented code; empty for a comment on its own.
    code: String,
    comment: String,
    /// For a constant: how wide the part before `=` is.
    before_equals: Option<usize>,
}

impl Row {
    fn is_blank(&self) -> bool {
        self.code.is_empty() && self.comment.is_empty()
    }
}

struct Layout<'a> {
    text: &'a str,
    depth: usize,
    rows: Vec<Row>,
}

impl Layout<'_> {
    fn line(&mut self, line: &Line) {
        let comment = line.comment.map(|span| comment_text(span.of(self.text))).unwrap_or_default();
        if let Some(label) = line.label {
            let comment = if line.statement.is_none() { comment.clone() } else { String::new() };
            self.rows.push(Row { code: format!("{}:", label.text(self.text)), comment, before_equals: None });
        }
        if let Some(statement) = &line.statement {
            self.statement(statement, comment);
        } else if line.label.is_none() {
            let own_column = line.comment.is_some_and(|span| span.start > line.span.start);
            let code = if own_column { self.indent() } else { String::new() };
            self.rows.push(Row { code: String::new(), comment: code + &comment, before_equals: None });
        }
    }

    fn statement(&mut self, statement: &Statement, comment: String) {
        if matches!(statement.head, Head::Close) {
            self.depth = self.depth.saturating_sub(1);
        }
        let word = statement.word.text(self.text);
        let (code, before_equals) = match statement.head {
            Head::Memory => (format!(".mem {}", self.operands(statement)), None),
            Head::Constant => {
                let before = statement.operands.first().map_or(0, |name| name.span.end - name.span.start);
                (format!(".const {}", self.operands(statement)), Some(".const ".len() + before))
            }
            Head::Word => (format!("{}.word {}", self.indent(), self.operands(statement)), None),
            Head::Instruction(info) => {
                let operands = self.operands(statement);
                let brace = if statement.opens { " {" } else { "" };
                let space = if operands.is_empty() { "" } else { " " };
                (format!("{}{}{space}{operands}{brace}", self.indent(), info.name), None)
            }
            Head::Close | Head::Broken => (format!("{}{word}", self.indent()), None),
        };
        self.rows.push(Row { code: code.trim_end().to_owned(), comment, before_equals });
        self.depth += usize::from(statement.opens);
    }

    fn indent(&self) -> String {
        INDENT.repeat(1 + self.depth.min(DEEPEST_INDENT))
    }

    fn operands(&self, statement: &Statement) -> String {
        let tight_equals = !matches!(statement.head, Head::Constant);
        let mut out = String::new();
        let mut tight = true;
        for token in &statement.operands {
            let joins = token.kind == Kind::Colon || token.kind == Kind::Equals && tight_equals;
            if !tight && !joins {
                out.push(' ');
            }
            out.push_str(&self.word(statement, *token));
            tight = joins;
        }
        out
    }

    /// A word in its proper case. Names that the author chose stay as they are.
    fn word(&self, statement: &Statement, token: Token) -> String {
        let word = token.text(self.text);
        match token.kind {
            Kind::Number => number_text(word),
            Kind::Name if names::input(word).is_some() => word.to_ascii_uppercase(),
            Kind::Name if names::memory(word).is_some() || is_field_word(statement, word) => {
                word.to_ascii_lowercase()
            }
            Kind::Name
            | Kind::Directive
            | Kind::Colon
            | Kind::Equals
            | Kind::Bar
            | Kind::Open
            | Kind::Close => word.to_owned(),
        }
    }

    fn finish(self) -> String {
        let mut rows = self.rows;
        rows.dedup_by(|next, row| next.is_blank() && row.is_blank());
        for run in rows.chunk_by_mut(|row, next| row.before_equals.is_some() && next.before_equals.is_some())
        {
            align_equals(run);
        }
        for run in rows.chunk_by_mut(|row, next| !row.code.is_empty() && !next.code.is_empty()) {
            align_comments(run);
        }
        let lines: Vec<&str> = rows.iter().map(|row| row.code.trim_end()).collect();
        let text = lines.join("\n");
        let text = text.trim_matches('\n');
        if text.is_empty() { String::new() } else { format!("{text}\n") }
    }
}

/// `true` for a field's name, or a value that is a word of the language.
fn is_field_word(statement: &Statement, word: &str) -> bool {
    let Head::Instruction(info) = statement.head else { return false };
    let known = |known: &[&str]| known.iter().any(|known| known.eq_ignore_ascii_case(word));
    known(names_of(info.operand)) || info.operand == Operand::Mode && known(&CONTROLS)
}

/// The comment with one space behind its semicolons.
fn comment_text(comment: &str) -> String {
    let text = comment.trim_start_matches(';');
    let (marks, text) = (&comment[..comment.len() - text.len()], text.trim_end());
    let space = if text.is_empty() || text.starts_with(char::is_whitespace) { "" } else { " " };
    format!("{marks}{space}{text}")
}

fn number_text(word: &str) -> String {
    if let Some((sign, digits)) = word.split_once("0X").filter(|(sign, _)| sign.len() <= 1) {
        return format!("{sign}0x{digits}");
    }
    if word.contains("0x") {
        return word.to_owned();
    }
    let at = word.find(|letter: char| letter.is_ascii_alphabetic()).unwrap_or(word.len());
    let (digits, suffix) = word.split_at(at);
    format!("{digits}{}", canonical_unit(suffix).unwrap_or(suffix))
}

fn align_equals(run: &mut [Row]) {
    let widest = run.iter().filter_map(|row| row.before_equals).max().unwrap_or(0);
    for row in run {
        if let Some(width) = row.before_equals {
            row.code.insert_str(
                width.min(row.code.len()),
                &" ".repeat(widest.min(WIDEST_ALIGNED).saturating_sub(width)),
            );
        }
    }
}

/// Joins each row's comment to its code.
fn align_comments(run: &mut [Row]) {
    let width = |row: &Row| row.code.chars().count();
    let aligned =
        run.iter().filter(|row| !row.comment.is_empty()).map(width).filter(|width| *width <= WIDEST_ALIGNED);
    let column = aligned.max().unwrap_or(0);
    for row in run {
        if row.comment.is_empty() {
            continue;
        }
        if !row.code.is_empty() {
            let gap = column.saturating_sub(width(row)) + 2;
            row.code.push_str(&" ".repeat(gap));
        }
        row.code.push_str(&row.comment);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use expect_test::{Expect, expect};

    fn check(text: &str, expect: &Expect) {
        let format = |text: &str| format(&SourceFile::new("x", text)).expect("a readable text");
        let once = format(text);
        expect.assert_eq(&once);
        assert_eq!(format(&once), once);
    }

    #[test]
    fn a_text_is_laid_out() {
        check(
            "\n\n;about\n.CONST Fast=800 ;speed\n.const wait = 500MS\n\n\n start: set_max_speed Fast;go\nloop_program 3 {;three times\nmove_f  0X10\n ; inside\n}\ngo_label\ngoto_program MEM1:start\n",
            &expect![[r#"
                ; about
                .const Fast = 800  ; speed
                .const wait = 500ms

                start:
                    SET_MAX_SPEED Fast  ; go
                    LOOP_PROGRAM 3 {    ; three times
                        MOVE_F 0x10
                        ; inside
                    }
                    GO_MARK
                    GOTO_PROGRAM mem1:start
            "#]],
        );
    }

    #[test]
    fn words_of_the_language_get_their_case_and_others_keep_theirs() {
        check(
            "X:\nset_mode CONTROL = Current motor=0 microstep=1/16 current=Amps hold=50%\nset_mask_event in0|IN1 |set_zero\n.WORD 0XfF\n",
            &expect![[r#"
                X:
                    SET_MODE control=current motor=0 microstep=1/16 current=Amps hold=50%
                    SET_MASK_EVENT IN0 | IN1 | SET_ZERO
                    .word 0xfF
            "#]],
        );
    }
}
