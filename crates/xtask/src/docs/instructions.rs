//! `docs/instructions.md`: the instructions of user programs and of the `CMD` register.

use super::page;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Operand, PROGRAM_AREAS, PROGRAM_LINES};
use stepdrive_spec::smsd::ring;

const HEADS: [&str; 7] = ["Code", "Name", "Also", "Data", "In programs", "By CMD", "About"];

/// The whole page.
pub(super) fn page() -> String {
    let about = format!(
        "\
An instruction fills a 32-bit word: bits 3:0 are reserved and 0, bits 9:4 are its code, bits 31:10 its data. There are
{PROGRAM_AREAS} memory areas of {PROGRAM_LINES} instructions each. `SET_MAX_SPEED 100` is `0x00019060`.

Those with a mark under *By CMD* are carried out when their code is written to register `1109`; their data comes from
`TARGET_SPEED`, `TARGET_POS` or `TARGET_INPUT`. Those with neither mark exist over USB only."
    );
    let rows = INSTRUCTIONS.iter().map(|info| {
        vec![
            format!("`{:02X}`", info.code),
            format!("`{}`", info.name),
            if info.alias.is_empty() { String::new() } else { format!("`{}`", info.alias) },
            operand(info.operand),
            page::tick(info.in_program),
            page::tick(info.in_cmd),
            info.about.to_owned(),
        ]
    });
    page::start("Instructions", "`crates/spec/src/smsd/instructions.rs`", &about) + &page::table(&HEADS, rows)
}

fn operand(operand: Operand) -> String {
    match operand {
        Operand::None => String::new(),
        Operand::Number { min, max, unit } => format!("{min} … {max} {unit}").trim_end().to_owned(),
        Operand::Position => format!("{} … {} microstep", ring::MIN, ring::MAX),
        Operand::Mask => "mask of inputs, 8 bits".to_owned(),
        Operand::Input => "number of an input, 0 … 7".to_owned(),
        Operand::Mode => {
            "bit 0 control, 6:1 motor, 9:7 microstep, 16:10 current, 18:17 holding current".to_owned()
        }
        Operand::Jump => "bits 7:0 line, 9:8 memory area".to_owned(),
        Operand::Loop => "bits 9:0 instructions, 19:10 cycles".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_instruction_stands_on_the_page_once() {
        let text = page();
        for info in &INSTRUCTIONS {
            let start = format!("\n| `{:02X}` | `{}` |", info.code, info.name);
            assert_eq!(text.matches(&start).count(), 1, "{start}");
        }
    }

    #[test]
    fn a_range_ends_with_its_unit() {
        assert_eq!(operand(Operand::Number { min: 0, max: 950, unit: "full step/s" }), "0 … 950 full step/s");
        assert_eq!(operand(Operand::Number { min: 0, max: 3, unit: "" }), "0 … 3");
    }
}
