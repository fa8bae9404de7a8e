//! Findings as values for machines, with lines and columns.

use crate::diagnostic::{Code, Diagnostic, Label, Place, Severity};
use crate::source::{LineColumn, SourceFile, Span};
use serde::Serialize;

/// A finding with its places resolved; serialises to JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Report {
    /// How bad it is.
    pub severity: Severity,
    /// Which rule was broken.
    pub code: Code,
    /// What happened, to what.
    pub message: String,
    /// Where: the culprit first.
    pub labels: Vec<ReportLabel>,
    /// What is allowed, what to do.
    pub help: Vec<String>,
    /// A change that probably repairs it.
    pub suggestion: Option<ReportSuggestion>,
}

/// A remark on one place.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReportLabel {
    /// Where in the text; `null` for a program that has none.
    pub at: Option<Region>,
    /// Which instruction of the controller; `null` where the remark is on something else.
    pub place: Option<Place>,
    /// The remark; may be empty.
    pub text: String,
}

/// A change that probably repairs it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReportSuggestion {
    /// What to replace.
    pub at: Region,
    /// By what.
    pub replacement: String,
}

/// A stretch of a text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Region {
    /// The text's name.
    pub file: String,
    /// Its bytes.
    pub bytes: Span,
    /// Where it begins.
    pub start: LineColumn,
    /// The first character behind it.
    pub end: LineColumn,
}

/// Resolves findings against the text they are about; `None` for a program without text.
pub fn report(diagnostics: &[Diagnostic], source: Option<&SourceFile>) -> Vec<Report> {
    diagnostics.iter().map(|diagnostic| resolve(diagnostic, source)).collect()
}

fn resolve(diagnostic: &Diagnostic, source: Option<&SourceFile>) -> Report {
    let label = |label: &Label| ReportLabel {
        at: label.span.and_then(|span| region(span, source)),
        place: label.place,
        text: label.text.clone(),
    };
    let suggestion = diagnostic.suggestion.as_ref().and_then(|suggestion| {
        Some(ReportSuggestion {
            at: region(suggestion.span, source)?,
            replacement: suggestion.replacement.clone(),
        })
    });
    Report {
        severity: diagnostic.severity(),
        code: diagnostic.code,
        message: diagnostic.message.clone(),
        labels: diagnostic.labels.iter().map(label).collect(),
        help: diagnostic.help.clone(),
        suggestion,
    }
}

fn region(span: Span, source: Option<&SourceFile>) -> Option<Region> {
    let source = source?;
    let (start, end) = (source.line_column(span.start), source.line_column(span.end));
    Some(Region { file: source.name().to_owned(), bytes: span, start, end })
}
