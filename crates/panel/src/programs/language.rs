//! What an editor has to know of the language.

use serde::Serialize;
use stepdrive_asm::allowed_operand;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, OpcodeInfo, Operand};
use stepdrive_spec::smsd::ring;
use stepdrive_web::Reply;

/// The directives, and what each does. A test assembles them.
const DIRECTIVES: [(&str, &str, &str); 3] = [
    (".const", ".const fast = 800", "Names a value, for all memories, from there on."),
    (".mem", ".mem 1", "Begins a memory, 0 to 3; what stands above the first belongs to memory 0."),
    (".word", ".word 0x00019060", "An instruction as a number."),
];

#[derive(Debug, Serialize)]
pub(crate) struct Language {
    instructions: Vec<InstructionRow>,
    inputs: Vec<&'static str>,
    directives: Vec<DirectiveRow>,
}

#[derive(Debug, Serialize)]
struct InstructionRow {
    name: &'static str,
    #[serde(skip_serializing_if = "str::is_empty")]
    alias: &'static str,
    operand: &'static str,
    /// What may stand there, in words.
    takes: String,
    unit: &'static str,
    min: Option<i64>,
    max: Option<i64>,
    about: &'static str,
}

#[derive(Clone, Debug, Serialize)]
struct DirectiveRow {
    name: &'static str,
    example: &'static str,
    about: &'static str,
}

pub(crate) async fn language() -> Reply<Language> {
    Reply(Language {
        instructions: INSTRUCTIONS.iter().filter(|info| info.in_program).map(row).collect(),
        inputs: Input::ALL.map(Input::name).to_vec(),
        directives: DIRECTIVES.map(|(name, example, about)| DirectiveRow { name, example, about }).to_vec(),
    })
}

fn row(info: &OpcodeInfo) -> InstructionRow {
    let (operand, unit, range) = operand(info.operand);
    InstructionRow {
        name: info.name,
        alias: info.alias,
        operand,
        takes: allowed_operand(info.operand),
        unit,
        min: range.map(|(min, _)| min),
        max: range.map(|(_, max)| max),
        about: info.about,
    }
}

/// What kind of operand it is, its unit and its range.
fn operand(operand: Operand) -> (&'static str, &'static str, Option<(i64, i64)>) {
    match operand {
        Operand::None => ("none", "", None),
        Operand::Number { min, max, unit } => {
            let kind = match unit {
                "ms" => "time",
                "full step/s" => "speed",
                "full step/s²" => "acceleration",
                _ => "number",
            };
            (kind, unit, Some((min.into(), max.into())))
        }
        Operand::Position => ("position", "microstep", Some((ring::MIN.into(), ring::MAX.into()))),
        Operand::Mask => ("mask", "", Some((0, u8::MAX.into()))),
        Operand::Input => ("input", "", None),
        Operand::Mode => ("mode", "", None),
        Operand::Jump => ("jump", "", None),
        Operand::Loop => ("loop", "", None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_asm::{SourceFile, assemble};

    #[test]
    fn the_examples_of_directives_are_in_the_language_and_there_are_no_others() {
        let text = DIRECTIVES.map(|(_, example, _)| example).join("\n");
        let assembly = assemble(&SourceFile::new("t", text));
        assert_eq!(assembly.diagnostics, []);
        let unknown = assemble(&SourceFile::new("t", ".nonesuch 1\n")).diagnostics;
        let help = unknown.iter().flat_map(|one| &one.help).cloned().collect::<String>();
        for (name, ..) in DIRECTIVES {
            assert!(help.contains(name), "{help}");
        }
        assert_eq!(help.matches('.').count(), DIRECTIVES.len(), "{help}");
    }
}
