//! Words to text that assembles to the same words.

use crate::diagnostic::Place;
use crate::fields;
use crate::image::Image;
use crate::operand::{JUMP_BITS, LOOP_CYCLES_SHIFT, LOOP_MAX, MASK_MAX};
use crate::source::SourceFile;
use std::collections::BTreeSet;
use std::fmt::Write;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Operand, PROGRAM_AREAS};
use stepdrive_spec::smsd::mode::MotorConfiguration;

/// One step of indentation.
pub(crate) const INDENT: &str = "    ";
/// Loops deeper than this are not indented further. The controller runs 8; a text stays readable, and short.
pub(crate) const DEEPEST_INDENT: usize = 10;

/// The text of an image. It assembles to the same image, whatever the words are: what the language has no form for
/// stands as `.word` with a remark. Jump targets get labels, `L12` for line 12; loops get braces where these come to
/// the same word. The text is laid out as [`crate::format()`] does it.
pub fn disassemble(image: &Image) -> String {
    let targets = targets(image);
    let parts = (0..).zip(0..PROGRAM_AREAS).filter(|(_, area)| !image.area(*area).is_empty());
    let texts = parts.map(|(memory, area)| Writer::new(memory, image.area(area), image, &targets).write());
    let text = texts.collect::<Vec<String>>().join("\n");
    crate::format(&SourceFile::new("", text.as_str())).unwrap_or(text)
}

/// An instruction without labels or braces, for listings and traces: `GOTO_PROGRAM mem0:5`.
pub fn bare(instruction: Instruction) -> String {
    let name = instruction.opcode.name();
    match operand(instruction) {
        Ok(Form::Plain(operands)) if operands.is_empty() => name.to_owned(),
        Ok(Form::Plain(operands)) => format!("{name} {operands}"),
        Ok(Form::Jump(place)) => format!("{name} {place}"),
        Ok(Form::Loop { cycles, body }) => format!("{name} {}", raw_loop(cycles, body)),
        Err(remark) => format!("{name} ; {remark}"),
    }
}

/// How an operand is written.
enum Form {
    Plain(String),
    Jump(Place),
    Loop { cycles: u32, body: u32 },
}

/// The operand of an instruction, or why the language has no form for it.
fn operand(instruction: Instruction) -> Result<Form, String> {
    let Instruction { opcode, data } = instruction;
    let info = opcode.info();
    if !info.in_program {
        return Err(format!("{} cannot stand in a program", info.name));
    }
    let unused = |unused: u32| format!("{}, data bits {unused:#X} are ignored", info.name);
    let outside = || format!("{} {data}, out of its range", info.name);
    match info.operand {
        Operand::None if data == 0 => Ok(Form::Plain(String::new())),
        Operand::None => Err(unused(data)),
        Operand::Number { min, max, unit } if (min..=max).contains(&data) => {
            Ok(Form::Plain(if unit == "ms" { duration(data) } else { data.to_string() }))
        }
        Operand::Position => Ok(Form::Plain(instruction.position().to_string())),
        Operand::Mask if data <= MASK_MAX => Ok(Form::Plain(mask(data))),
        Operand::Mask => Err(unused(data & !MASK_MAX)),
        Operand::Input => match u16::try_from(data).ok().and_then(Input::from_number) {
            Some(input) => Ok(Form::Plain(input.name().to_owned())),
            None => Err(outside()),
        },
        Operand::Mode => mode(data).map(Form::Plain).ok_or_else(outside),
        Operand::Jump if data <= JUMP_BITS => {
            let [line, memory, ..] = data.to_le_bytes();
            Ok(Form::Jump(Place { memory, line }))
        }
        Operand::Jump => Err(unused(data & !JUMP_BITS)),
        Operand::Loop if data >> LOOP_CYCLES_SHIFT <= LOOP_MAX => {
            Ok(Form::Loop { cycles: data >> LOOP_CYCLES_SHIFT, body: data & LOOP_MAX })
        }
        Operand::Loop => Err(unused(data >> LOOP_CYCLES_SHIFT & !LOOP_MAX)),
        Operand::Number { .. } => Err(outside()),
    }
}

/// `2s` where that says the same as `2000ms`.
fn duration(ms: u32) -> String {
    match ms {
        0 => "0ms".to_owned(),
        ms if ms % 60_000 == 0 => format!("{}min", ms / 60_000),
        ms if ms % 1000 == 0 => format!("{}s", ms / 1000),
        ms => format!("{ms}ms"),
    }
}

fn mask(data: u32) -> String {
    let inputs = Input::ALL.iter().filter(|input| data & u32::from(input.bit()) != 0);
    let names: Vec<&str> = inputs.map(|input| input.name()).collect();
    match names.len() {
        0 => "0".to_owned(),
        8 => format!("{data:#X}"),
        _ => names.join(" | "),
    }
}

fn mode(data: u32) -> Option<String> {
    let mode = MotorConfiguration::from_data(data);
    (mode.data() == data && fields::mode_is_listed(mode)).then(|| fields::mode_text(mode))
}

fn raw_loop(cycles: u32, body: u32) -> String {
    format!("cycles={cycles} instructions={body}")
}

/// The places that get a label: those that a jump leads to and that exist, or lie just behind the last instruction.
fn targets(image: &Image) -> BTreeSet<Place> {
    let jumps = image.words().filter_map(|(_, word)| match operand(Instruction::from_word(word).ok()?) {
        Ok(Form::Jump(place)) => Some(place),
        _ => None,
    });
    jumps.filter(|place| has_label(image, *place)).collect()
}

fn has_label(image: &Image, place: Place) -> bool {
    let size = image.size(usize::from(place.memory));
    size > 0 && place.line <= size
}

struct Writer<'a> {
    memory: u8,
    words: &'a [u32],
    image: &'a Image,
    targets: &'a BTreeSet<Place>,
    text: String,
    /// Where the braced loops around the present line end, the innermost last.
    ends: Vec<usize>,
}

impl<'a> Writer<'a> {
    fn new(memory: u8, words: &'a [u32], image: &'a Image, targets: &'a BTreeSet<Place>) -> Writer<'a> {
        Writer { memory, words, image, targets, text: String::new(), ends: Vec::new() }
    }

    fn write(mut self) -> String {
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, ".mem {}", self.memory);
        for (line, word) in self.words.iter().enumerate() {
            self.label(line);
            self.word(line, *word);
            self.close(line + 1);
        }
        self.label(self.words.len());
        self.text
    }

    fn label(&mut self, line: usize) {
        let place = u8::try_from(line).ok().map(|line| Place { memory: self.memory, line });
        if place.is_some_and(|place| self.targets.contains(&place)) {
            let _ = writeln!(self.text, "L{line}:");
        }
    }

    fn word(&mut self, line: usize, word: u32) {
        let form = Instruction::from_word(word)
            .map_err(|error| error.to_string())
            .and_then(|instruction| Ok((instruction.opcode.name(), operand(instruction)?)));
        let statement = match form {
            Ok((name, Form::Plain(operands))) if operands.is_empty() => name.to_owned(),
            Ok((name, Form::Plain(operands))) => format!("{name} {operands}"),
            Ok((name, Form::Jump(target))) => format!("{name} {}", self.target(target)),
            Ok((name, Form::Loop { cycles, body })) => {
                let end = line + 1 + body as usize;
                let braces =
                    body > 0 && end <= self.words.len() && self.ends.last().is_none_or(|outer| end <= *outer);
                let text = if braces { format!("{cycles} {{") } else { raw_loop(cycles, body) };
                self.put(&format!("{name} {text}"));
                if braces {
                    self.ends.push(end);
                }
                return;
            }
            Err(remark) => format!(".word 0x{word:08X}  ; {remark}"),
        };
        self.put(&statement);
    }

    fn target(&self, target: Place) -> String {
        let line = target.line;
        let prefix =
            if target.memory == self.memory { String::new() } else { format!("mem{}:", target.memory) };
        let label = if has_label(self.image, target) { "L" } else { "" };
        format!("{prefix}{label}{line}")
    }

    fn close(&mut self, line: usize) {
        while self.ends.pop_if(|end| *end == line).is_some() {
            self.put("}");
        }
    }

    fn put(&mut self, statement: &str) {
        let indent = INDENT.repeat(1 + self.ends.len().min(DEEPEST_INDENT));
        let _ = writeln!(self.text, "{indent}{statement}");
    }
}
