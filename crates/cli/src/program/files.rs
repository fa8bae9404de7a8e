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
use stepdrive_spec::smsd::instructions::{Instruction, PROGRAM_AREAS};
use stepdrive_spec::smsd::models::Model;

/// How an image begins, so that it can be told from a text.
const IMAGE_START: &[u8] = b"SMSDPROG";

/// Memories, and the instructions for each.
pub(super) type Memories = Vec<(u8, Vec<Instruction>)>;

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

    /// The instructions to be stored: those for one memory, or for every memory that the program has some for.
    pub(super) fn memories_for(&self, memory: Option<u8>) -> Result<Memories, Failure> {
        let image = self.image()?;
        let moved = memory.and_then(|memory| self.moved_to(memory));
        let image = moved.as_ref().unwrap_or(image);
        let meant = (0..PROGRAM_AREAS).filter_map(|area| u8::try_from(area).ok());
        let meant = meant.filter(|area| memory.is_none_or(|memory| memory == *area));
        let meant: Vec<u8> = meant.filter(|area| !image.area((*area).into()).is_empty()).collect();
        if meant.is_empty() {
            let which = memory.map_or_else(String::new, |memory| format!(" for memory {memory}"));
            let (name, sizes) = (&self.name, self.sizes());
            return Err(Failure::Usage(format!(
                "{name} has no instructions{which}: it has {sizes}; nothing was sent"
            )));
        }
        meant.into_iter().map(|area| Ok((area, self.instructions(image, area)?))).collect()
    }

    /// A text that says nothing of memories, assembled for another than memory 0.
    fn moved_to(&self, memory: u8) -> Option<Image> {
        let source = self.source.as_ref()?;
        let text = format!(".mem {memory}\n{}", source.text());
        let moved = assemble(&SourceFile::new(source.name(), text)).image?;
        let only = |image: &Image, memory: usize| {
            (0..PROGRAM_AREAS).all(|area| (area == memory) != image.area(area).is_empty())
        };
        (only(self.image.as_ref()?, 0) && only(&moved, memory.into())).then_some(moved)
    }

    fn instructions(&self, image: &Image, memory: u8) -> Result<Vec<Instruction>, Failure> {
        let words = image.area(memory.into()).iter().enumerate();
        let instruction = |(line, word): (usize, &u32)| {
            Instruction::from_word(*word).map_err(|error| {
                Failure::Program(format!(
                    "{}: mem{memory}:{line} is {word:#010X}: {error}; nothing was sent",
                    self.name
                ))
            })
        };
        words.map(instruction).collect()
    }

    /// Shows what the checker finds besides when it knows the model.
    pub(super) fn show_more(&self, model: Model) {
        let options = CheckOptions { model: Some(model) };
        match (&self.source, &self.image) {
            (Some(source), _) => {
                let mut findings = assemble(source).check(&options);
                findings.retain(|finding| !self.findings.contains(finding));
                show_findings(&findings, Origin::Text(source));
            }
            (None, Some(image)) => {
                let mut findings = stepdrive_asm::check(image, None, &options);
                findings.retain(|finding| !self.findings.contains(finding));
                show_findings(&findings, Origin::Image(&self.name));
            }
            (None, None) => {}
        }
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
