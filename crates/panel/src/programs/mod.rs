//! User programs of an SMSD: the language, checking, trying out, storing.

mod language;
mod memory;
mod simulate;

pub(crate) use language::language;
pub(crate) use memory::{fetch, start, stop, store};
pub(crate) use simulate::simulate;

use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use stepdrive_asm::check::CheckOptions;
use stepdrive_asm::{Assembly, Diagnostic, Image, Place, Severity, SourceFile, assemble, report};
use stepdrive_spec::smsd::instructions::PROGRAM_AREAS;
use stepdrive_spec::smsd::models::Model;
use stepdrive_web::{Asked, Problem, Reply};

/// What a text is called in messages.
const NAME: &str = "program";

/// A finding with its place, lines and columns from 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Finding {
    severity: Severity,
    code: &'static str,
    line: usize,
    column: usize,
    end_line: usize,
    end_column: usize,
    message: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    help: Option<String>,
}

/// A memory as a program fills it.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Memory {
    mem: usize,
    size: usize,
    /// The line of the text that each instruction comes from.
    lines: Vec<usize>,
    /// The instructions as the controller has them: two texts are the same program if these are the same.
    words: Vec<u32>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Check {
    text: String,
    model: Option<String>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Checked {
    diagnostics: Vec<Finding>,
    mems: Vec<Memory>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Text {
    text: String,
}

#[derive(Debug, Serialize)]
pub(crate) struct Formatted {
    text: String,
}

/// A text that was assembled and checked.
struct Program {
    source: SourceFile,
    assembly: Assembly,
    findings: Vec<Diagnostic>,
}

impl Program {
    fn new(text: String, model: Option<Model>) -> Program {
        let source = SourceFile::new(NAME, text);
        let mut assembly = assemble(&source);
        let mut findings = std::mem::take(&mut assembly.diagnostics);
        findings.extend(assembly.check(&CheckOptions { model }));
        Program { source, assembly, findings }
    }

    fn findings(&self) -> Vec<Finding> {
        findings(&self.findings, &self.source)
    }

    /// The words, if there are no errors.
    fn image(&self) -> Result<&Image, Problem> {
        self.assembly.image.as_ref().ok_or_else(|| mistaken(&self.findings, &self.source))
    }

    /// The line of the text that an instruction comes from.
    fn line_of(&self, memory: usize, line: usize) -> Option<usize> {
        let place = Place { memory: u8::try_from(memory).ok()?, line: u8::try_from(line).ok()? };
        let span = self.assembly.source_map.span(place)?;
        Some(self.source.line_column(span.start).line)
    }

    fn memories(&self) -> Vec<Memory> {
        let Some(image) = &self.assembly.image else { return Vec::new() };
        let memory = |mem: usize| {
            let words = image.area(mem).to_vec();
            let lines = (0..words.len()).map(|line| self.line_of(mem, line).unwrap_or(0)).collect();
            Memory { mem, size: words.len(), lines, words }
        };
        (0..PROGRAM_AREAS).map(memory).filter(|memory| memory.size > 0).collect()
    }
}

/// The model of a name.
fn model(name: Option<&str>) -> Result<Option<Model>, Problem> {
    let Some(name) = name else { return Ok(None) };
    let known = Model::ALL.into_iter().find(|model| model.name() == name);
    let names = || Model::ALL.map(Model::name).join(" and ");
    known
        .map(Some)
        .ok_or_else(|| Problem::impossible(format!("programs are for an SMSD; there are {}", names())))
}

/// A problem with what is wrong in a text.
fn mistaken(found: &[Diagnostic], source: &SourceFile) -> Problem {
    let errors = found.iter().filter(|finding| finding.severity() == Severity::Error).count();
    let errors = if errors == 1 { "1 error".to_owned() } else { format!("{errors} errors") };
    let problem =
        Problem::new(StatusCode::UNPROCESSABLE_ENTITY, format!("the program has {errors}; nothing was done"));
    problem.with("diagnostics", findings(found, source))
}

fn findings(found: &[Diagnostic], source: &SourceFile) -> Vec<Finding> {
    let resolved = report(found, Some(source));
    resolved
        .into_iter()
        .map(|one| {
            let at = one.labels.iter().find_map(|label| label.at.as_ref());
            let (start, end) = at.map_or(((1, 1), (1, 1)), |at| {
                ((at.start.line, at.start.column), (at.end.line, at.end.column))
            });
            let label = one.labels.first().map(|label| label.text.as_str()).filter(|text| !text.is_empty());
            Finding {
                severity: one.severity,
                code: one.code.name(),
                line: start.0,
                column: start.1,
                end_line: end.0,
                end_column: end.1,
                message: label.map_or(one.message.clone(), |label| format!("{}: {label}", one.message)),
                help: Some(one.help.join("\n")).filter(|help| !help.is_empty()),
            }
        })
        .collect()
}

pub(crate) async fn check(Asked(asked): Asked<Check>) -> Result<Reply<Checked>, Problem> {
    let program = Program::new(asked.text, model(asked.model.as_deref())?);
    Ok(Reply(Checked { diagnostics: program.findings(), mems: program.memories() }))
}

pub(crate) async fn format(Asked(Text { text }): Asked<Text>) -> Result<Reply<Formatted>, Problem> {
    let source = SourceFile::new(NAME, text);
    let text = stepdrive_asm::format(&source).map_err(|found| mistaken(&found, &source))?;
    Ok(Reply(Formatted { text }))
}
