//! Text to words: one pass over the lines that places everything, one over the jumps that finds their targets.

use crate::diagnostic::{Code, Diagnostic, Findings, Place};
use crate::image::Image;
use crate::lex::{Kind, Token};
use crate::names;
use crate::operand::{self, Encoded, LOOP_CYCLES_SHIFT, LOOP_MAX, Target};
use crate::parse::{self, Head, Line, Statement};
use crate::source::{MAX_TEXT_BYTES, SourceFile, Span, too_large};
use crate::source_map::SourceMap;
use crate::value::{Constants, Value, superfluous};
use std::collections::BTreeMap;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, OpcodeInfo, PROGRAM_AREAS, PROGRAM_LINES};

/// What a text comes to.
#[derive(Clone, Debug)]
pub struct Assembly {
    /// The words; `None` when there are errors, so that nobody stores half a program.
    pub image: Option<Image>,
    /// What is wrong, in the order of the text.
    pub diagnostics: Vec<Diagnostic>,
    /// Which line of the text each word comes from.
    pub source_map: SourceMap,
}

impl Assembly {
    /// What the checker finds; nothing when there is no image.
    pub fn check(&self, options: &crate::check::CheckOptions) -> Vec<Diagnostic> {
        let checked =
            self.image.as_ref().map(|image| crate::check::check(image, Some(&self.source_map), options));
        checked.unwrap_or_default()
    }
}

/// Assembles a text. Never fails as a whole: every line is looked at, and the findings say what is wrong with which.
pub fn assemble(source: &SourceFile) -> Assembly {
    let mut findings = Findings::default();
    if source.text().len() > MAX_TEXT_BYTES {
        let diagnostics = vec![too_large(source.text().len())];
        return Assembly { image: None, diagnostics, source_map: SourceMap::default() };
    }
    let lines = parse::parse(source, &mut findings);
    let mut assembler = Assembler::new(source.text(), findings);
    for line in &lines {
        assembler.line(line);
    }
    assembler.finish()
}

/// A memory while it fills.
#[derive(Default)]
struct Area {
    /// Where the text begins to speak of it.
    begun: Option<Span>,
    words: Vec<u32>,
    spans: Vec<Span>,
    /// How many instructions it was given, also those that found no room.
    count: usize,
    labels: BTreeMap<String, (u8, Token)>,
    last_label: Option<(usize, Token)>,
}

/// A loop whose closing brace has not come yet.
struct OpenLoop {
    /// Its line and cycles; `None` when they could not be read.
    head: Option<(usize, u32)>,
    span: Span,
}

/// A jump to a label.
struct Jump {
    place: Place,
    memory: Option<u8>,
    label: Token,
}

struct Assembler<'a> {
    text: &'a str,
    findings: Findings,
    constants: Constants,
    areas: [Area; PROGRAM_AREAS],
    current: u8,
    loops: Vec<OpenLoop>,
    jumps: Vec<Jump>,
}

impl<'a> Assembler<'a> {
    fn new(text: &'a str, findings: Findings) -> Assembler<'a> {
        Assembler {
            text,
            findings,
            constants: Constants::default(),
            areas: Default::default(),
            current: 0,
            loops: Vec::new(),
            jumps: Vec::new(),
        }
    }

    fn area(&mut self) -> &mut Area {
        // `current` is only ever set to a memory that there is.
        &mut self.areas[usize::from(self.current)]
    }

    fn line(&mut self, line: &Line) {
        let memory_follows =
            line.statement.as_ref().is_some_and(|statement| matches!(statement.head, Head::Memory));
        if let Some(label) = line.label {
            let result = if memory_follows { Err(label_before_memory(label)) } else { self.label(label) };
            self.findings.note(result);
        }
        if let Some(statement) = &line.statement {
            let result = self.statement(statement);
            self.findings.note(result);
        }
    }

    fn label(&mut self, token: Token) -> Result<(), Diagnostic> {
        let name = token.text(self.text);
        if let Some(what) = names::reserved(name) {
            return Err(reserved(name, what, token, "label"));
        }
        let key = names::key(name);
        let area = self.area();
        if let Some((_, first)) = area.labels.get(&key) {
            return Err(duplicate(name, "label", token, *first));
        }
        area.begun.get_or_insert(token.span);
        area.last_label = Some((area.count, token));
        let line = u8::try_from(area.count).unwrap_or(u8::MAX);
        area.labels.insert(key, (line, token));
        Ok(())
    }

    fn statement(&mut self, statement: &Statement) -> Result<(), Diagnostic> {
        match statement.head {
            Head::Memory => self.memory(statement),
            Head::Constant => self.constant(statement),
            Head::Word => {
                let word = self.word(statement);
                self.push(word.as_ref().map_or(0, |word| *word), statement);
                word.map(|_| ())
            }
            Head::Instruction(info) => self.instruction(info, statement),
            Head::Close => self.close(statement),
            Head::Broken => {
                self.push(0, statement);
                if statement.opens {
                    self.loops.push(OpenLoop { head: None, span: statement.word.span });
                }
                Ok(())
            }
        }
    }

    fn memory(&mut self, statement: &Statement) -> Result<(), Diagnostic> {
        self.close_all();
        let help = "`.mem` takes a memory from 0 to 3";
        let value = self.only_value(statement).map_err(|diagnostic| diagnostic.help(help))?;
        let memory = value.plain().and_then(names::area);
        let span = statement.operand_span();
        let Some(memory) = memory else {
            let message = format!("there is no memory {}", span.of(self.text));
            return Err(Diagnostic::new(Code::OutOfRange, message).at(span, "").help(help));
        };
        self.current = memory;
        if let Some(first) = self.area().begun {
            let message = format!("memory {memory} already has its instructions");
            return Err(Diagnostic::new(Code::DuplicateMemory, message)
                .at(span, "here again")
                .at(first, "it begins here")
                .help("put all of a memory behind one `.mem`; what stands above the first `.mem` is in memory 0"));
        }
        self.area().begun = Some(statement.span());
        Ok(())
    }

    fn constant(&mut self, statement: &Statement) -> Result<(), Diagnostic> {
        let [name, equals, value @ ..] = statement.operands.as_slice() else {
            return Err(no_constant(statement));
        };
        if name.kind != Kind::Name || equals.kind != Kind::Equals || value.is_empty() {
            return Err(no_constant(statement));
        }
        let word = name.text(self.text);
        if let Some(what) = names::reserved(word) {
            return Err(reserved(word, what, *name, "constant"));
        }
        if let Some(first) = self.constants.token(word) {
            return Err(duplicate(word, "constant", *name, first));
        }
        // A constant with a wrong value is known all the same, so that its uses are not reported too.
        let broken = self.constants.any_broken(self.text, value);
        let value = self.constants.joined(self.text, value);
        self.constants.set(word, value.as_ref().ok().copied().filter(|_| !broken), *name);
        value.map(|_| ())
    }

    fn word(&self, statement: &Statement) -> Result<u32, Diagnostic> {
        let help = "`.word` takes a number from 0 to 0xFFFFFFFF";
        let value = self.only_value(statement).map_err(|diagnostic| diagnostic.help(help))?;
        let word = value.plain().and_then(|number| u32::try_from(number).ok());
        word.ok_or_else(|| {
            let span = statement.operand_span();
            let message = format!("{} is no instruction word", span.of(self.text));
            Diagnostic::new(Code::OutOfRange, message).at(span, "").help(help)
        })
    }

    fn only_value(&self, statement: &Statement) -> Result<Value, Diagnostic> {
        match statement.operands.as_slice() {
            [only] => self.constants.value(self.text, *only),
            [_, extra, ..] => Err(superfluous(self.text, *extra)),
            [] => {
                let message = format!("`{}` needs an operand", statement.word.text(self.text));
                Err(Diagnostic::new(Code::MissingOperand, message)
                    .at(statement.word.span, "nothing stands behind it"))
            }
        }
    }

    fn instruction(&mut self, info: &'static OpcodeInfo, statement: &Statement) -> Result<(), Diagnostic> {
        let line = self.area().count;
        let encoded = if info.in_program {
            operand::encode(self.text, &self.constants, info, statement)
        } else {
            Err(not_in_programs(info, statement))
        };
        let data = match &encoded {
            Ok(Encoded::Data(data)) => *data,
            Ok(Encoded::Jump(target)) => self.jump(*target, line),
            Ok(Encoded::Body { .. }) | Err(_) => 0,
        };
        self.push(Instruction { opcode: info.opcode, data }.word(), statement);
        if statement.opens {
            let head = if let Ok(Encoded::Body { cycles }) = encoded { Some((line, cycles)) } else { None };
            self.loops.push(OpenLoop { head, span: statement.word.span });
        }
        encoded.map(|_| ())
    }

    /// The data of a jump, for now 0 when its label is to be looked up later.
    fn jump(&mut self, target: Target, line: usize) -> u32 {
        match target {
            Target::Line(memory, line) => operand::jump_data(memory.unwrap_or(self.current), line),
            Target::Label(memory, label) => {
                // What has no place has no room either, and that is reported.
                if let Ok(line) = u8::try_from(line) {
                    self.jumps.push(Jump { place: Place { memory: self.current, line }, memory, label });
                }
                0
            }
        }
    }

    fn push(&mut self, word: u32, statement: &Statement) {
        let span = statement.span();
        let memory = self.current;
        let area = self.area();
        area.begun.get_or_insert(span);
        area.count += 1;
        if area.words.len() < PROGRAM_LINES {
            area.words.push(word);
            area.spans.push(span);
        } else if area.count == PROGRAM_LINES + 1 {
            let message = format!("memory {memory} is full: it holds {PROGRAM_LINES} instructions");
            self.findings
                .push(Diagnostic::new(Code::MemoryFull, message).at(span, "the first one without room").help(
                "go on in another memory: end with `GOTO_PROGRAM mem1:more` and put `.mem 1`, `more:` here",
            ));
        }
    }

    fn close(&mut self, statement: &Statement) -> Result<(), Diagnostic> {
        let Some(open) = self.loops.pop() else {
            let diagnostic = Diagnostic::new(Code::UnopenedLoop, "`}` closes no loop");
            let diagnostic = diagnostic.at(statement.word.span, "no loop is open here");
            return Err(diagnostic.help("a loop begins with `LOOP_PROGRAM 10 {`"));
        };
        self.label_at_end(&open, statement);
        let area = self.area();
        if let Some((line, cycles)) = open.head {
            let body = u32::try_from(area.count - line - 1).unwrap_or(LOOP_MAX).min(LOOP_MAX);
            let data = cycles << LOOP_CYCLES_SHIFT | body;
            if let Some(word) = area.words.get_mut(line) {
                *word = Instruction { opcode: Opcode::LoopProgram, data }.word();
            }
        }
        Ok(())
    }

    fn label_at_end(&mut self, open: &OpenLoop, statement: &Statement) {
        let area = self.area();
        let at_end = |(line, label): &(usize, Token)| *line == area.count && label.span > open.span;
        if let Some((_, label)) = area.last_label.take_if(|last| at_end(last)) {
            let message =
                format!("the label `{}` stands behind the loop's last instruction", label.text(self.text));
            self.findings.push(
                Diagnostic::new(Code::LabelAtLoopEnd, message)
                    .at(label.span, "a jump to it leaves the loop")
                    .at(statement.word.span, "the loop ends here")
                    .help(
                        "put it behind `}` to leave the loop, or before the last instruction to stay in it",
                    ),
            );
        }
    }

    fn close_all(&mut self) {
        for open in self.loops.drain(..) {
            self.findings.push(
                Diagnostic::new(Code::UnclosedLoop, "the loop has no end")
                    .at(open.span, "its `{` is not closed")
                    .help("put `}` on a line behind the last instruction of its body"),
            );
        }
    }

    fn finish(mut self) -> Assembly {
        self.close_all();
        for jump in std::mem::take(&mut self.jumps) {
            let resolved = self.resolve(&jump);
            let area = self.areas.get_mut(usize::from(jump.place.memory));
            let word = area.and_then(|area| area.words.get_mut(usize::from(jump.place.line)));
            if let (Some(data), Some(word)) = (self.findings.note(resolved), word) {
                // END is code 0, so this is the data alone.
                *word |= Instruction { opcode: Opcode::End, data }.word();
            }
        }
        let mut image = Image::new();
        let mut complete = !self.findings.has_errors();
        for (memory, area) in self.areas.iter().enumerate() {
            complete &= image.set_area(memory, &area.words).is_ok();
        }
        let source_map = self.source_map();
        Assembly { image: complete.then_some(image), diagnostics: self.findings.finish(), source_map }
    }

    fn resolve(&self, jump: &Jump) -> Result<u32, Diagnostic> {
        let name = jump.label.text(self.text);
        let key = names::key(name);
        let memory = jump.memory.unwrap_or(jump.place.memory);
        let labels = self.areas.get(usize::from(memory)).map(|area| &area.labels);
        if let Some((line, _)) = labels.and_then(|labels| labels.get(&key)) {
            return Ok(operand::jump_data(memory, *line));
        }
        let known = labels.into_iter().flatten().map(|(_, (_, token))| token.text(self.text));
        let mut diagnostic =
            Diagnostic::new(Code::UnknownLabel, format!("memory {memory} has no label `{name}`"))
                .at(jump.label.span, "not found")
                .suggest(jump.label.span, names::nearest(name, known));
        for (other, area) in self.areas.iter().enumerate() {
            if area.labels.contains_key(&key) {
                diagnostic = diagnostic.help(format!("memory {other} has one: write `mem{other}:{name}`"));
            }
        }
        Err(diagnostic)
    }

    fn source_map(&mut self) -> SourceMap {
        let mut map = SourceMap::default();
        for (memory, area) in (0..).zip(&mut self.areas) {
            for (line, token) in area.labels.values() {
                map.name(Place { memory, line: *line }, token.text(self.text));
            }
            map.set_area(memory, std::mem::take(&mut area.spans));
        }
        map
    }
}

fn label_before_memory(label: Token) -> Diagnostic {
    Diagnostic::new(Code::Syntax, "a label cannot stand before `.mem`")
        .at(label.span, "in which memory?")
        .help("put it on the line behind `.mem`")
}

fn no_constant(statement: &Statement) -> Diagnostic {
    Diagnostic::new(Code::Syntax, "this is no constant")
        .at(statement.span(), "expected a name, `=` and a value")
        .help("a constant is written `.const fast = 800`")
}

fn reserved(name: &str, what: &str, token: Token, wanted: &str) -> Diagnostic {
    Diagnostic::new(Code::ReservedName, format!("`{name}` is {what} and cannot name a {wanted}"))
        .at(token.span, "choose another name")
}

fn duplicate(name: &str, what: &str, token: Token, first: Token) -> Diagnostic {
    Diagnostic::new(Code::DuplicateName, format!("there are two {what}s `{name}`"))
        .at(token.span, "here again")
        .at(first.span, "first here")
        .help("names that differ only in case are the same")
}

fn not_in_programs(info: &OpcodeInfo, statement: &Statement) -> Diagnostic {
    Diagnostic::new(Code::NotInPrograms, format!("`{}` cannot stand in a program", info.name))
        .at(statement.word.span, "a program that meets it stops with an error")
        .help("a host can send it over USB")
}
