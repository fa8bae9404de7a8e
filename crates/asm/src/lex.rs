//! A line of text to its words.

use crate::diagnostic::{Code, Diagnostic};
use crate::source::Span;

/// What begins a comment. A semicolon, as in nearly every assembler; `#` stays free.
pub(crate) const COMMENT: char = ';';

/// A kind of word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Letters, digits and `_`, not beginning with a digit.
    Name,
    /// A digit and what hangs on it, with a sign before: `-1_500`, `0x1F`, `1.5A`, `50%`, `1/16`.
    Number,
    /// A dot and a name.
    Directive,
    Colon,
    Equals,
    Bar,
    Open,
    Close,
}

/// A word and where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Token {
    pub(crate) kind: Kind,
    pub(crate) span: Span,
}

impl Token {
    pub(crate) fn text(self, source: &str) -> &str {
        self.span.of(source)
    }
}

/// The words of a line, its comment, and what could not be read (nothing behind that is).
#[derive(Debug, Default)]
pub(crate) struct Words {
    pub(crate) tokens: Vec<Token>,
    pub(crate) comment: Option<Span>,
    pub(crate) error: Option<Diagnostic>,
}

/// Takes a line apart.
pub(crate) fn words(source: &str, line: Span) -> Words {
    let mut words = Words::default();
    let mut rest = Rest { text: line.of(source), at: line.start };
    while let Some(first) = rest.text.chars().next() {
        let start = rest.at;
        let kind = match first {
            COMMENT => {
                let text = rest.text.trim_end();
                words.comment = Some(Span::new(start, start + text.len()));
                break;
            }
            ':' => Some(rest.one(Kind::Colon)),
            '=' => Some(rest.one(Kind::Equals)),
            '|' => Some(rest.one(Kind::Bar)),
            '{' => Some(rest.one(Kind::Open)),
            '}' => Some(rest.one(Kind::Close)),
            '.' => rest.directive(),
            '+' | '-' | '0'..='9' => rest.number(),
            'A'..='Z' | 'a'..='z' | '_' => Some(rest.name()),
            white if white.is_whitespace() => {
                rest.advance(white.len_utf8());
                continue;
            }
            _ => None,
        };
        let Some(kind) = kind else {
            words.error = Some(unexpected(first, start));
            break;
        };
        words.tokens.push(Token { kind, span: Span::new(start, rest.at) });
    }
    words
}

/// What is left of a line.
struct Rest<'a> {
    text: &'a str,
    at: usize,
}

impl Rest<'_> {
    fn advance(&mut self, bytes: usize) {
        self.text = self.text.get(bytes..).unwrap_or("");
        self.at += bytes;
    }

    fn skip(&mut self, wanted: impl Fn(u8) -> bool) -> usize {
        let count = self.text.bytes().take_while(|byte| wanted(*byte)).count();
        self.advance(count);
        count
    }

    fn one(&mut self, kind: Kind) -> Kind {
        self.advance(1);
        kind
    }

    fn name(&mut self) -> Kind {
        self.skip(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        Kind::Name
    }

    fn directive(&mut self) -> Option<Kind> {
        self.advance(1);
        let letters = self.skip(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        (letters > 0).then_some(Kind::Directive)
    }

    /// Takes all that may hang on a number, so that a wrong one is one wrong word.
    fn number(&mut self) -> Option<Kind> {
        self.skip(|byte| matches!(byte, b'+' | b'-'));
        let digits = self.skip(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.'));
        if self.text.starts_with('/') {
            self.advance(1);
            self.skip(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        } else if self.text.starts_with('%') {
            self.advance(1);
        }
        (digits > 0).then_some(Kind::Number)
    }
}

fn unexpected(character: char, at: usize) -> Diagnostic {
    let span = Span::new(at, at + character.len_utf8());
    let shown = character.escape_debug();
    let diagnostic = Diagnostic::new(Code::UnexpectedCharacter, format!("`{shown}` has no meaning here"));
    match character {
        '#' | '/' | '*' => diagnostic.at(span, "not part of the language").help("a comment begins with `;`"),
        ',' => diagnostic.at(span, "not part of the language").help("operands are separated by spaces"),
        _ => diagnostic.at(span, "not part of the language"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(line: &str) -> Vec<&str> {
        let words = words(line, Span::new(0, line.len()));
        assert_eq!(words.error, None, "{line}");
        words.tokens.iter().map(|token| token.text(line)).collect()
    }

    #[test]
    fn a_line_falls_into_words() {
        assert_eq!(texts("a: GO_TO -1_500 ; x"), ["a", ":", "GO_TO", "-1_500"]);
        assert_eq!(
            texts("IN0|IN1 m=1/16 h=50% {}"),
            ["IN0", "|", "IN1", "m", "=", "1/16", "h", "=", "50%", "{", "}"]
        );
        assert_eq!(texts(".word 0xFF 1.5A"), [".word", "0xFF", "1.5A"]);
    }

    #[test]
    fn the_words_before_what_cannot_be_read_are_kept() {
        let words = words("END é", Span::new(0, 6));
        assert_eq!(words.tokens.len(), 1);
        assert_eq!(words.error.and_then(|error| error.labels.first()?.span), Some(Span::new(4, 6)));
    }
}
