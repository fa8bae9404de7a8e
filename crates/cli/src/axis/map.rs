//! The register map of the SMSD as a person speaks of it.

use super::names::{instead, shown};
use std::fmt;
pub(crate) use stepdrive_host::settings::{plural, unit};
use stepdrive_spec::modbus::Table;
use stepdrive_spec::smsd::registers::{REGISTERS, Reg, Register};

/// A register, or one of several that share a row of the map. It displays as the maker's name, as in `IP 2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Slot {
    /// The row.
    pub(crate) reg: Reg,
    /// Which of the row, from 0.
    pub(crate) index: u16,
}

impl Slot {
    /// Its row of the map.
    pub(crate) fn row(self) -> &'static Register {
        self.reg.info()
    }

    /// Its first address.
    pub(crate) fn address(self) -> u16 {
        self.row().address + self.index * self.row().kind.width()
    }
}

impl fmt::Display for Slot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.row().name.replace("{}", &self.index.to_string()))
    }
}

/// Every register of the map.
pub(crate) fn slots() -> impl Iterator<Item = Slot> {
    REGISTERS.iter().flat_map(|row| (0..row.count).map(|index| Slot { reg: row.id, index }))
}

/// The register with a name: the maker's in any case, with `_`, `-` or a space between words, or its address as in
/// `0x1101`. Of two of a name, a flag and a setting, the setting is meant.
///
/// # Errors
/// There is none; the text says what there is instead.
pub(crate) fn find(name: &str) -> Result<Slot, String> {
    if let Some(digits) = name.strip_prefix("0x").or_else(|| name.strip_prefix("0X")) {
        return at_address(digits).ok_or_else(|| format!("there is no register at {}", shown(name)));
    }
    let wanted = key(name);
    let alike = || slots().filter(|slot| key(&slot.to_string()) == wanted);
    let setting = alike().find(|slot| slot.row().table == Table::HoldingRegisters);
    setting.or_else(|| alike().next()).ok_or_else(|| {
        let names: Vec<String> = slots().map(|slot| slot.to_string()).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        format!("there is no register `{}`; {}", shown(name), instead(name, &names))
    })
}

/// The register at an address in hexadecimal, which no two tables share.
fn at_address(digits: &str) -> Option<Slot> {
    let address = u16::from_str_radix(digits, 16).ok()?;
    slots().find(|slot| slot.address() == address)
}

/// A name without what may be written in different ways.
pub(crate) fn key(name: &str) -> String {
    name.trim().to_ascii_uppercase().replace([' ', '-'], "_")
}

/// What a table is called in messages.
pub(crate) const fn table_name(table: Table) -> &'static str {
    match table {
        Table::Coils => "coil",
        Table::DiscreteInputs => "discrete input",
        Table::InputRegisters => "input register",
        Table::HoldingRegisters => "holding register",
    }
}

/// A value of a register as people write it, as in `800 full steps/s`, `10 × 0.1 A` or `0x0004`.
pub(crate) fn written(row: &Register, value: i64) -> String {
    if row.hex { hex(row, value) } else { format!("{value}{}", unit(row.unit)) }
}

/// A value of a register in hexadecimal, with all its digits.
pub(crate) fn hex(row: &Register, value: i64) -> String {
    let digits = if row.kind.width() > 1 { 10 } else { 6 };
    format!("{value:#0digits$X}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_register_is_found_however_its_name_is_written() {
        for name in ["MAX_SPEED", "max_speed", "Max Speed", "max-speed", "0x1101", "0X1101"] {
            assert_eq!(find(name), Ok(Slot { reg: Reg::MaxSpeed, index: 0 }), "{name}");
        }
        assert_eq!(find("subnet_mask 3"), Ok(Slot { reg: Reg::LanSubnetMask, index: 3 }));
        assert_eq!(find("CMD"), Ok(Slot { reg: Reg::Cmd, index: 0 }));
        assert_eq!(find("cmd_31").map(Slot::address), Ok(0x313E));
        assert_eq!(find("ACC").map(|slot| slot.reg), Ok(Reg::Acc));
    }

    #[test]
    fn every_register_is_found_by_its_address() {
        let addresses: BTreeSet<u16> = slots().map(Slot::address).collect();
        assert_eq!(addresses.len(), slots().count());
        for slot in slots() {
            assert_eq!(find(&format!("0x{:04X}", slot.address())), Ok(slot));
        }
    }

    #[test]
    fn a_name_that_means_nothing_has_a_suggestion() {
        assert_eq!(
            find("MAX_SPED").expect_err("none"),
            "there is no register `MAX_SPED`; did you mean MAX_SPEED?"
        );
        assert_eq!(find("0x0000").expect_err("none"), "there is no register at 0x0000");
        assert_eq!(find("0xZZ").expect_err("none"), "there is no register at 0xZZ");
    }

    #[test]
    fn a_value_is_written_with_its_unit_or_in_hexadecimal() {
        for (reg, value, text) in [
            (Reg::WorkCurrent, 10, "10 × 0.1 A"),
            (Reg::TargetPos, -5, "-5 microsteps"),
            (Reg::Microstepping, 4, "0x0004"),
            (Reg::CmdBuffer, 0x19060, "0x00019060"),
        ] {
            assert_eq!(written(reg.info(), value), text, "{reg:?}");
        }
    }
}
