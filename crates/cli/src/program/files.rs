//! Programs as files: read, assembled and checked.

use super::{count, empty_source, errors_in, show_findings, shown, sizes};
use crate::Failure;
use serde::Serialize;
use std::fs;
use std::io::{self, Read};
use std::path::Path;
use stepdrive_asm::check::CheckOptions;
use stepdrive_asm::report::Report;
use stepdrive_asm::{Diagnostic, Image, ImageError, Origin, Severity, SourceFile, assemble, report};
use stepdrive_spec::smsd::instructions::PROGRAM_AREAS;
use stepdrive_spec::smsd::models::Model;

/// How an image begins, so that it can be told from a text.
const IMAGE_START: &[u8] = b"SMSDPROG";

/// A program that was read.
pub(super) struct Program {
    /// What it is called in messages.
    pub(super) name: String,
    /// Its text; an image has none.
    pub(super) source: Option<SourceFile>,
    /// What was found, in the order of the text.
    pub(super) findings: Vec<Diagnostic>,
    image: Option<Image>,
}

impl Program {
    /// Reads a text or an image, and checks it.
    pub(super) fn read(file: &Path, model: Option<Model>) -> Result<Program, Failure> {
        let name = shown(file);
        let bytes = read(file)?;
        if bytes.starts_with(IMAGE_START) {
            let image = Image::from_bytes(&bytes).map_err(|error| not_an_image(&name, error))?;
            let findings = stepdrive_asm::check(&image, None, &CheckOptions { model });
            return Ok(Program { name, source: None, findings, image: Some(image) });
        }
        Ok(Program::assemble(text(&name, bytes)?, model))
    }

    /// Assembles a text, and checks it.
    pub(super) fn assemble(source: SourceFile, model: Option<Model>) -> Program {
        let mut assembly = assemble(&source);
        let mut findings = std::mem::take(&mut assembly.diagnostics);
        findings.extend(assembly.check(&CheckOptions { model }));
        Program { name: source.name().to_owned(), source: Some(source), findings, image: assembly.image }
    }

    /// The words, if there are no errors.
    pub(super) fn image(&self) -> Result<&Image, Failure> {
        let errors = count(&self.findings, Severity::Error);
        self.image.as_ref().ok_or_else(|| Failure::Program(errors_in(&self.name, errors)))
    }

    /// How many instructions each memory has.
    pub(super) fn sizes(&self) -> String {
        let size = |memory| self.image.as_ref().map_or(0, |image| image.area(memory).len());
        sizes(std::array::from_fn(size))
    }
}

/// Words, sizes and findings, for `--json`.
#[derive(Serialize)]
pub(super) struct Words {
    memories: Option<[Vec<u32>; PROGRAM_AREAS]>,
    findings: Vec<Report>,
}

impl Words {
    /// Those of a program; `null` for the words when it has errors.
    pub(super) fn of(program: &Program) -> Words {
        Words {
            memories: program.image.as_ref().map(memories),
            findings: report(&program.findings, program.source.as_ref()),
        }
    }

    /// Those of an image.
    pub(super) fn of_image(image: &Image) -> Words {
        Words { memories: Some(memories(image)), findings: Vec::new() }
    }
}

fn memories(image: &Image) -> [Vec<u32>; PROGRAM_AREAS] {
    std::array::from_fn(|memory| image.area(memory).to_vec())
}

/// Whether a path stands for stdin.
pub(super) fn is_stdin(file: &Path) -> bool {
    file.as_os_str() == "-"
}

/// Reads a text.
pub(super) fn read_text(file: &Path) -> Result<SourceFile, Failure> {
    text(&shown(file), read(file)?)
}

/// Reads an image, or bare words of one memory.
pub(super) fn read_image(file: &Path, memory: u8) -> Result<Image, Failure> {
    let bytes = read(file)?;
    let image = if bytes.starts_with(IMAGE_START) {
        Image::from_bytes(&bytes)
    } else {
        Image::from_words(memory.into(), &bytes)
    };
    image.map_err(|error| not_an_image(&shown(file), error))
}

/// The most that is read of a file: more than any program has, so that a wrong file is refused and not swallowed.
const MOST_BYTES: u64 = 16 << 20;

fn read(file: &Path) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    let outcome = if is_stdin(file) {
        io::stdin().lock().take(MOST_BYTES).read_to_end(&mut bytes)
    } else {
        fs::File::open(file).and_then(|file| file.take(MOST_BYTES).read_to_end(&mut bytes))
    };
    outcome.map_err(|error| Failure::Usage(format!("cannot read {}: {error}", shown(file))))?;
    Ok(bytes)
}

fn text(name: &str, bytes: Vec<u8>) -> Result<SourceFile, Failure> {
    SourceFile::from_bytes(name, bytes).map_err(|finding| {
        show_findings(&[finding], Origin::Text(&empty_source(name)));
        Failure::Program(errors_in(name, 1))
    })
}

fn not_an_image(name: &str, error: ImageError) -> Failure {
    Failure::Program(format!("{name}: {error}"))
}
