//! Findings as text for people.

use crate::diagnostic::{Diagnostic, Label, Severity};
use crate::source::{SourceFile, Span};
use annotate_snippets::{Annotation, AnnotationKind, Group, Level, Renderer, Snippet};

/// What is shown behind a finding's end, at most; the rest of a very long line is left out.
const TAIL_BYTES: usize = 200;
/// A finding further to the right than this is shown by its place alone.
const FURTHEST_COLUMN: usize = 1000;

/// How the text looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Text alone.
    Plain,
    /// With the escape sequences of a terminal.
    Colour,
}

/// What the findings are about.
#[derive(Clone, Copy, Debug)]
pub enum Origin<'a> {
    /// A program's text.
    Text(&'a SourceFile),
    /// An image under this name, which has no text.
    Image(&'a str),
}

/// The findings, each with its place, the line of the text, a mark under the culprit, and help. They are separated by
/// blank lines; the text ends with a newline unless it is empty.
pub fn render(diagnostics: &[Diagnostic], origin: Origin<'_>, style: Style) -> String {
    let renderer = match style {
        Style::Plain => Renderer::plain(),
        Style::Colour => Renderer::styled(),
    };
    let texts: Vec<String> = diagnostics.iter().map(|one| render_one(one, origin, &renderer)).collect();
    texts.join("\n")
}

fn render_one(diagnostic: &Diagnostic, origin: Origin<'_>, renderer: &Renderer) -> String {
    let level = match diagnostic.severity() {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let mut group = Group::with_title(level.primary_title(&diagnostic.message).id(diagnostic.code.name()));
    match origin {
        Origin::Text(source) => group = with_snippets(group, &diagnostic.labels, source),
        Origin::Image(name) => group = with_places(group, &diagnostic.labels, name),
    }
    for help in &diagnostic.help {
        group = group.element(Level::HELP.message(help));
    }
    renderer.render(&[group]) + "\n"
}

fn with_snippets<'a>(mut group: Group<'a>, labels: &'a [Label], source: &'a SourceFile) -> Group<'a> {
    if labels.iter().all(|label| label.span.is_none()) {
        return group.element(annotate_snippets::Origin::path(source.name()));
    }
    let line_of = |label: &Label| label.span.map(|span| source.line_column(span.start).line);
    for (index, run) in labels.chunk_by(|one, next| line_of(one) == line_of(next)).enumerate() {
        let Some((line, span)) = run.first().and_then(|first| line_of(first).zip(first.span)) else {
            continue;
        };
        let reach = run.iter().filter_map(|label| label.span).fold(span, Span::around);
        if let Some(text) = excerpt(source, line, reach) {
            let start = source.line(line).start;
            let primary = |label: usize| index == 0 && label == 0;
            let marks =
                run.iter().enumerate().filter_map(|(at, label)| annotation(label, start, text, primary(at)));
            group =
                group.element(Snippet::source(text).line_start(line).path(source.name()).annotations(marks));
        } else {
            let column = source.line_column(span.start).column;
            group =
                group.element(annotate_snippets::Origin::path(source.name()).line(line).char_column(column));
        }
    }
    group
}

/// The part of a line that is shown for a span of it. `None` when that lies too far to the right.
fn excerpt(source: &SourceFile, line: usize, span: Span) -> Option<&str> {
    let whole = source.line(line);
    span.start.checked_sub(whole.start).filter(|column| *column <= FURTHEST_COLUMN)?;
    let text = whole.of(source.text());
    let end = span.end.saturating_sub(whole.start).min(FURTHEST_COLUMN);
    text.get(..text.ceil_char_boundary(end + TAIL_BYTES))
}

/// The mark of a label within the text that is shown.
fn annotation<'a>(label: &'a Label, line_start: usize, text: &str, primary: bool) -> Option<Annotation<'a>> {
    let span = label.span?;
    let within = |offset: usize| text.floor_char_boundary(offset.saturating_sub(line_start));
    let kind = if primary { AnnotationKind::Primary } else { AnnotationKind::Context };
    let remark = Some(label.text.as_str()).filter(|text| !text.is_empty());
    Some(kind.span(within(span.start)..within(span.end)).label(remark))
}

fn with_places<'a>(mut group: Group<'a>, labels: &'a [Label], name: &'a str) -> Group<'a> {
    let place_of = |label: &Label| label.place.map(|place| place.to_string()).unwrap_or_default();
    let first = labels.first().map(place_of).unwrap_or_default();
    group = group.element(annotate_snippets::Origin::path(format!("{name} {first}").trim_end().to_owned()));
    for label in labels.iter().filter(|label| !label.text.is_empty()) {
        group = group.element(Level::NOTE.message(format!("{}: {}", place_of(label), label.text)));
    }
    group
}
