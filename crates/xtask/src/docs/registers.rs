//! `docs/registers.md`: the register map.

use super::page;
use std::fmt::Write;
use stepdrive_spec::modbus::Table;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, Kind, Limits, REGISTERS, Register, Writable};

const ABOUT: &str = "\
Addresses are those of the PDU, in hexadecimal, as the maker prints them. A 32-bit value fills two registers, the low
word at the lower address. A request that touches an address not listed here is answered with exception 02.

- **Access**: *trigger* acts when TRUE is written and reads as FALSE; *secret* reads as 0; *open* needs no authorisation.
- **Range**: what a write may carry; other values are refused with exception 03. Where the models differ, the
  SMSD-4.2LAN comes first.
- **Stored**: survives power-off. Its default is how it leaves the factory; the others have theirs at every power-up.
- **Note**: the reading chosen where the maker's text leaves one open; `assumptions.md` lists what nobody knows.";

const HEADS: [&str; 12] = [
    "Address", "Table", "Name", "Kind", "Access", "Range", "Unit", "Default", "Stored", "About", "Source",
    "Note",
];

/// The sections of the page: a table of Modbus, and the function codes that reach it.
const TABLES: [(Table, &str, &str); 4] = [
    (Table::Coils, "Coils", "01 read, 05 and 0F write"),
    (Table::DiscreteInputs, "Discrete inputs", "02 read"),
    (Table::InputRegisters, "Input registers", "04 read"),
    (Table::HoldingRegisters, "Holding registers", "03 read, 06 and 10 write"),
];

/// What the first hexadecimal digit of an address stands for.
const AREAS: [(u16, &str); 5] =
    [(1, "Motor"), (2, "Authorisation"), (3, "Programs"), (7, "LAN parameters"), (8, "Identification")];

/// The whole page.
pub(super) fn page() -> String {
    let mut text = page::start("Register map", "`crates/spec/src/smsd/registers.rs`", ABOUT);
    for (table, name, functions) in TABLES {
        text.push_str(&section(table, name, functions));
    }
    text
}

fn section(table: Table, name: &str, functions: &str) -> String {
    let mut text = format!("\n## {name}\n\nFunction codes {functions}.\n");
    for (digit, area) in AREAS {
        let rows: Vec<Vec<String>> = REGISTERS
            .iter()
            .filter(|row| row.table == table && row.address >> 12 == digit)
            .map(cells)
            .collect();
        if !rows.is_empty() {
            // Writing to a String cannot fail.
            let _ = write!(text, "\n### {area} ({digit:X}xxx)\n{}", page::table(&HEADS, rows));
        }
    }
    text
}

fn cells(row: &Register) -> Vec<String> {
    vec![
        addresses(row),
        row.table.abbreviation().to_owned(),
        name(row),
        kind(row.kind).to_owned(),
        access(row),
        range(row),
        row.unit.to_owned(),
        number(row, row.default),
        page::tick(row.stored),
        row.about.to_owned(),
        row.source.to_owned(),
        row.note.to_owned(),
    ]
}

fn addresses(row: &Register) -> String {
    let last = row.end() - 1;
    if last == row.address {
        format!("`{:04X}`", row.address)
    } else {
        format!("`{:04X}`–`{last:04X}`", row.address)
    }
}

/// The name, with the numbers of the first and the last where there are several.
fn name(row: &Register) -> String {
    if row.count == 1 {
        return row.name.to_owned();
    }
    let numbered = |number: u16| row.name.replace("{}", &number.to_string());
    format!("{} … {}", numbered(0), numbered(row.count - 1))
}

fn kind(kind: Kind) -> &'static str {
    match kind {
        Kind::Bit => "bit",
        Kind::U16 => "u16",
        Kind::U32 => "u32",
        Kind::I32 => "i32",
    }
}

fn access(row: &Register) -> String {
    let access = match row.access {
        Access::Read => "read",
        Access::ReadWrite => "read, write",
        Access::Secret => "secret",
        Access::Trigger => "trigger",
    };
    let when = match row.writable {
        Writable::Always => "",
        Writable::Stopped => " at standstill",
        Writable::HiZ => " in HiZ",
    };
    let open = if row.open { "; open" } else { "" };
    format!("{access}{when}{open}")
}

fn range(row: &Register) -> String {
    let shown = |(min, max)| format!("{} … {}", number(row, min), number(row, max));
    match row.limits {
        Limits::Any => String::new(),
        Limits::Within(..) => shown(row.range(Model::Smsd42)),
        Limits::ByModel(small, large) => format!("{} / {}", shown(small), shown(large)),
        Limits::Commands => "the codes for `CMD` in `instructions.md`".to_owned(),
    }
}

fn number(row: &Register, value: i64) -> String {
    if row.hex { format!("0x{value:X}") } else { value.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::registers::Reg;

    #[test]
    fn every_register_stands_on_the_page_once() {
        let text = page();
        for row in &REGISTERS {
            let start = format!("\n| {} | {} |", addresses(row), row.table.abbreviation());
            assert_eq!(text.matches(&start).count(), 1, "{start}");
        }
    }

    #[test]
    fn a_row_shows_both_models_where_they_differ() {
        assert_eq!(range(Reg::WorkCurrent.info()), "1 … 42 / 1 … 80");
        assert_eq!(access(Reg::WorkCurrent.info()), "read, write in HiZ");
    }

    #[test]
    fn a_row_of_several_registers_shows_the_first_and_the_last() {
        let row = Reg::CmdBuffer.info();
        assert_eq!((addresses(row).as_str(), name(row).as_str()), ("`3100`–`313F`", "CMD 0 … CMD 31"));
    }
}
