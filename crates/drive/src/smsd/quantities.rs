//! What can be looked at: the register map as an authorised host reads it, 32-bit values in one, and the inputs.

use super::{Session, Smsd};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::registers::{Access, Kind, REGISTERS, Reg, Register};
use stepdrive_spec::time::Instant;

/// Something that can be looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A register of the map, with its number within the row.
    Register(Reg, u16),
    /// The level of an input.
    Input(Input),
}

macro_rules! numbered {
    ($name:literal: $($number:literal)+) => { &[$(concat!($name, " ", $number),)+] };
}

/// The names of rows of several registers; and of the two flags that the map calls as it does the settings.
static NAMES: [(Reg, &[&str]); 8] = [
    (Reg::AccFlag, &["ACC_FLAG"]),
    (Reg::DecFlag, &["DEC_FLAG"]),
    (
        Reg::CmdBuffer,
        numbered!("CMD": 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31),
    ),
    (Reg::LanMac, numbered!("MAC": 0 1 2 3 4 5)),
    (Reg::LanIp, numbered!("IP": 0 1 2 3)),
    (Reg::LanSubnetMask, numbered!("Subnet Mask": 0 1 2 3)),
    (Reg::LanGateway, numbered!("Gateway IP": 0 1 2 3)),
    (Reg::LanDns, numbered!("DNS server IP Address": 0 1 2 3)),
];

impl Quantity {
    /// All of them with their names: the registers that tell something, as the map calls them, but for the flags
    /// `ACC_FLAG` and `DEC_FLAG`; then the inputs that no register is called like.
    pub(crate) fn all() -> impl Iterator<Item = (&'static str, Quantity)> {
        let told = REGISTERS.iter().filter(|row| matches!(row.access, Access::Read | Access::ReadWrite));
        let registers = told.flat_map(|row| {
            let numbered = names(row).iter().zip(0..);
            numbered.map(|(name, index)| (*name, Quantity::Register(row.id, index)))
        });
        let inputs = Input::ALL.into_iter().filter(|input| !is_register(input.name()));
        registers.chain(inputs.map(|input| (input.name(), Quantity::Input(input))))
    }

    /// Whether it may change between two wake-ups.
    pub(crate) fn flows(self) -> bool {
        matches!(self, Quantity::Register(Reg::Speed | Reg::AbsPos | Reg::ElPos, _))
    }
}

fn names(row: &'static Register) -> &'static [&'static str] {
    let own = NAMES.iter().find(|(id, _)| *id == row.id).map(|(_, names)| *names);
    own.unwrap_or(core::slice::from_ref(&row.name))
}

fn is_register(name: &str) -> bool {
    REGISTERS.iter().any(|row| row.name == name)
}

impl Smsd {
    /// The value of a quantity at `now`, which may lie between the last call and the next wake-up; flags as 0 and 1. Of
    /// a controller that is switched off it is 0.
    pub fn look(&self, now: Instant, quantity: Quantity) -> f64 {
        match quantity {
            _ if !self.on => 0.0,
            Quantity::Register(id, index) => {
                let value = self.value(now, &Session::AUTHORISED, id, index);
                let signed = id.info().kind == Kind::I32;
                if signed { f64::from(value.cast_signed()) } else { f64::from(value) }
            }
            Quantity::Input(input) => f64::from(u8::from(self.inputs.level(input))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_of_a_row_has_a_name() {
        for row in &REGISTERS {
            assert_eq!(names(row).len(), usize::from(row.count), "{}", row.name);
        }
    }
}
