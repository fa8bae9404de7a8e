//! Looks for what is allowed but hardly meant.
//!
//! The checker works on words, so it takes an assembled text and a read-out of a controller alike. It follows every
//! path that a program can take through the four memories, with calls matched to their returns (`walk`), and keeps
//! for every instruction in which states the motor may be there (`motor`). All findings are warnings.
//!
//! What it takes for granted: a program begins with the motor at rest and de-energised, no host interferes, and any
//! conditional jump may go either way. Memory 0 is a program; another memory is one when no other memory leads to it.

mod calls;
mod endless;
mod graph;
mod loops;
mod motor;
mod walk;
mod words;

use crate::diagnostic::{Code, Diagnostic, Findings, Label, Place};
use crate::image::Image;
use crate::source_map::SourceMap;
use graph::Graph;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, PROGRAM_AREAS, PROGRAM_LINES};
use stepdrive_spec::smsd::models::Model;

/// A memory with more instructions than this is called nearly full.
const NEARLY_FULL: usize = 240;

/// What the checker is told about the controller.
#[derive(Clone, Copy, Debug, Default)]
pub struct CheckOptions {
    /// The model that the program is for; without it, what only one of them can do is not reported.
    pub model: Option<Model>,
}

/// Checks the programs of an image. `source_map` is that of the assembly it comes from, and lets the findings point at
/// the text; without it they name memory and line.
pub fn check(image: &Image, source_map: Option<&SourceMap>, options: &CheckOptions) -> Vec<Diagnostic> {
    let mut check = Check { image, source_map, findings: Findings::default() };
    words::check(&mut check, options.model);
    let graph = Graph::new(image);
    let walk = walk::walk(&graph);
    check.sizes();
    check.unreachable(&walk);
    check.ends(&graph, &walk);
    motor::check(&mut check, &graph, &walk);
    endless::check(&mut check, &graph, &walk);
    loops::check(&mut check, &graph, &walk);
    calls::check(&mut check, &graph, &walk);
    check.findings.finish()
}

/// An image under check, and what was found so far.
struct Check<'a> {
    image: &'a Image,
    source_map: Option<&'a SourceMap>,
    findings: Findings,
}

impl Check<'_> {
    /// A remark on an instruction.
    fn label(&self, place: Place, text: impl Into<String>) -> Label {
        let span = self.source_map.and_then(|map| map.span(place));
        Label { span, place: Some(place), text: text.into() }
    }

    /// A finding on an instruction.
    fn warn(&mut self, code: Code, message: impl Into<String>, labels: &[(Place, &str)], help: &str) {
        let mut diagnostic = Diagnostic::new(code, message);
        diagnostic.labels = labels.iter().map(|(place, text)| self.label(*place, *text)).collect();
        self.findings.push(diagnostic.help(help));
    }

    /// The name of the instruction at a place; `.word` for what is none.
    fn name(&self, place: Place) -> &'static str {
        instruction(self.image, place).map_or(".word", |instruction| instruction.opcode.name())
    }

    fn sizes(&mut self) {
        for (memory, area) in (0..).zip(0..PROGRAM_AREAS) {
            let words = self.image.area(area);
            // A read-out may be filled up with END, which is 0.
            let used = words.iter().rposition(|word| *word != 0).map_or(0, |last| last + 1);
            if used > NEARLY_FULL {
                let message =
                    format!("memory {memory} is nearly full: {used} of {PROGRAM_LINES} instructions");
                let last = Place { memory, line: u8::try_from(used - 1).unwrap_or(u8::MAX) };
                let help =
                    "move a part of it into a memory of its own and call it with `CALL_PROGRAM mem1:part`";
                self.warn(Code::NearlyFull, message, &[(last, "")], help);
            }
        }
    }

    /// Reports what no path leads to, a run of instructions at a time. An `END` that is not reached harms nobody.
    fn unreachable(&mut self, walk: &walk::Walk) {
        let places: Vec<Place> = self.image.words().map(|(place, _)| place).collect();
        let runs = places
            .chunk_by(|one, next| one.memory == next.memory && walk.reached(*one) == walk.reached(*next));
        for run in runs {
            let Some(first) = run.first().filter(|first| !walk.reached(**first)) else { continue };
            let is_end = |place: &Place| self.image.word(*place) == Some(0);
            if run.iter().all(is_end) {
                continue;
            }
            let (message, label) = match run.len() {
                1 => ("this instruction is never reached".to_owned(), ""),
                many => (format!("these {many} instructions are never reached"), "from here on"),
            };
            let help = "no path leads here: what stands above it always goes elsewhere";
            self.warn(Code::Unreachable, message, &[(*first, label)], help);
        }
    }

    /// Reports where a program ends without saying so.
    fn ends(&mut self, graph: &Graph, walk: &walk::Walk) {
        for place in walk.places() {
            if graph.runs_off(place) {
                let message =
                    format!("the program runs past the end of memory {}, which ends it", place.memory);
                let help = "write `END` behind it if that is meant";
                self.warn(Code::RunsPastEnd, message, &[(place, "nothing follows")], help);
            }
            match graph.lost_jump(place) {
                Some(target) if self.image.area(usize::from(target.memory)).is_empty() => {
                    let message = format!("memory {} is empty here, so the program ends", target.memory);
                    let help = "that is right only if the controller has another program stored there";
                    self.warn(Code::EmptyMemory, message, &[(place, "goes there")], help);
                }
                Some(target) => {
                    let size = self.image.area(usize::from(target.memory)).len();
                    let message = format!(
                        "{target} is past the end of memory {}, which ends the program",
                        target.memory
                    );
                    let help =
                        format!("memory {} has lines 0 to {}; write `END` to end", target.memory, size - 1);
                    self.warn(Code::JumpPastEnd, message, &[(place, "goes there")], &help);
                }
                None => {}
            }
        }
    }
}

/// The instruction at a place, when there is one that a program may hold.
fn instruction(image: &Image, place: Place) -> Option<Instruction> {
    image.word(place).and_then(|word| Instruction::from_word(word).ok())
}

/// The memory that an instruction starts the program of.
fn started_memory(opcode: Opcode) -> Option<u8> {
    let first = Opcode::StartProgramMem0.code();
    let memory = opcode.code().checked_sub(first)?;
    (usize::from(memory) < PROGRAM_AREAS).then_some(memory)
}
