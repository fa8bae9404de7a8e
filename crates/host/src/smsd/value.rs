//! One value of the register map: its name, its words on the wire, and what may be written to it.

use super::options::WordOrder;
use crate::Error;
use crate::settings::unit;
use std::fmt;
use std::iter;
use stepdrive_spec::modbus::{Reply, Request, Table, Words};
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, Kind, Limits, Reg, Register};

/// A register, or one of several that share a row of the map. It displays as the maker's name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    pub(super) row: &'static Register,
    pub(super) index: u16,
}

impl Slot {
    /// The register `index` of a row.
    ///
    /// # Errors
    /// When the row has not so many.
    pub(super) fn new(reg: Reg, index: u16) -> Result<Slot, Error> {
        let row = reg.info();
        if index < row.count {
            return Ok(Slot { row, index });
        }
        let name = row.name.replace("{}", "").trim_end().to_owned();
        let last = row.count.saturating_sub(1);
        Err(Error::Usage(format!("there is no {name} {index}; they are numbered 0 to {last}")))
    }

    /// All registers of a row.
    pub(super) fn all(row: &'static Register) -> impl Iterator<Item = Slot> {
        (0..row.count).map(move |index| Slot { row, index })
    }

    /// Its first address.
    pub(super) fn address(self) -> u16 {
        self.row.address + self.index * self.row.kind.width()
    }

    /// The first address behind it.
    pub(super) fn end(self) -> u16 {
        self.address() + self.row.kind.width()
    }

    /// Whether writing it does something at once, so that writing it twice may do it twice.
    pub(super) fn acts(self) -> bool {
        self.row.access == Access::Trigger || matches!(self.row.id, Reg::Cmd | Reg::PasswordCmd | Reg::MemCmd)
    }

    /// Whether a read of it tells anything.
    pub(super) fn tells(self) -> bool {
        matches!(self.row.access, Access::Read | Access::ReadWrite)
    }

    /// The value in its words.
    pub(super) fn value(self, words: &[u16], order: WordOrder) -> Option<i64> {
        match (self.row.kind, words) {
            (Kind::Bit | Kind::U16, [word]) => Some(i64::from(*word)),
            (Kind::U32, [first, second]) => Some(i64::from(order.join([*first, *second]))),
            (Kind::I32, [first, second]) => Some(i64::from(order.join([*first, *second]).cast_signed())),
            _ => None,
        }
    }

    /// Appends the words of a value that is in range.
    pub(super) fn put(self, words: &mut Words, value: i64, order: WordOrder) {
        let [a, b, c, d, ..] = value.to_le_bytes();
        let bits = u32::from_le_bytes([a, b, c, d]);
        let both = match self.row.kind.width() {
            1 => &[u16::from_le_bytes([a, b])][..],
            _ => &order.split(bits),
        };
        words.extend(both.iter().copied().take(words.remaining_capacity()));
    }

    /// Checks a value that is to be written.
    ///
    /// # Errors
    /// [`Error::Usage`] when the register cannot be written, or not with that.
    pub(super) fn check(self, value: i64, model: Option<Model>) -> Result<(), Error> {
        if self.row.access == Access::Read {
            return Err(Error::Usage(format!("{self} can only be read; nothing was sent")));
        }
        let (min, max) = range(self.row, model);
        let listed = self.row.limits != Limits::Commands || command(value).is_some();
        if (min..=max).contains(&value) && listed {
            return Ok(());
        }
        let takes = self.takes(model);
        Err(Error::Usage(format!("{self} {value} is out of range: {takes}; nothing was sent")))
    }

    /// What may be written, as in `16 to 15600 full steps/s`.
    pub(super) fn takes(self, model: Option<Model>) -> String {
        if self.row.limits == Limits::Commands {
            return commands();
        }
        let (min, max) = range(self.row, model);
        let on = match (self.row.limits, model) {
            (Limits::ByModel(..), Some(model)) => format!(" on the {model}"),
            _ => String::new(),
        };
        format!("{min} to {max}{}{on}", unit(self.row.unit))
    }
}

impl fmt::Display for Slot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.row.name.split_once("{}") {
            Some((before, after)) => write!(f, "{before}{}{after}", self.index),
            None => f.write_str(self.row.name),
        }
    }
}

/// The lowest and the highest value that may be written; on a model that is not known, on any.
pub(super) fn range(row: &Register, model: Option<Model>) -> (i64, i64) {
    let ranges = Model::ALL.into_iter().filter(|other| model.is_none_or(|model| model == *other));
    ranges
        .map(|model| row.range(model))
        .fold((i64::MAX, i64::MIN), |widest, range| (widest.0.min(range.0), widest.1.max(range.1)))
}

/// The command that a value of `CMD` is.
pub(super) fn command(value: i64) -> Option<Opcode> {
    Opcode::from_cmd(u16::try_from(value).ok()?)
}

fn commands() -> String {
    let taken = INSTRUCTIONS.iter().filter(|info| info.in_cmd);
    let codes: Vec<String> = taken.map(|info| format!("{:#04X} {}", info.code, info.name)).collect();
    format!("the commands are {}", codes.join(", "))
}

/// Registers of one table without a gap between them, so that one request does for all.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run<'a> {
    pub(super) slots: &'a [Slot],
}

impl Run<'_> {
    /// The request that reads them.
    pub(super) fn read(&self) -> Option<Request> {
        let (first, last) = (self.slots.first()?, self.slots.last()?);
        Some(read(*first, last.end() - first.address()))
    }

    /// The values in a reply, in the order of the registers.
    pub(super) fn values(&self, reply: &Reply, order: WordOrder) -> Option<Vec<i64>> {
        match reply {
            Reply::Bits(bits) => Some(bits.iter().map(i64::from).collect()),
            Reply::Words(words) => {
                let mut rest = words.as_slice();
                let mut values = Vec::with_capacity(self.slots.len());
                for slot in self.slots {
                    let (own, behind) = rest.split_at_checked(usize::from(slot.row.kind.width()))?;
                    rest = behind;
                    values.push(slot.value(own, order)?);
                }
                Some(values)
            }
            Reply::Written => None,
        }
    }

    /// Whether the word order matters.
    pub(super) fn has_long_values(&self) -> bool {
        self.slots.iter().any(|slot| slot.row.kind.width() > 1)
    }

    /// Whether all of it can be read before authorisation.
    pub(super) fn is_open(&self) -> bool {
        self.slots.iter().all(|slot| slot.row.open && slot.row.access == Access::Read)
    }
}

impl fmt::Display for Run<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.slots {
            [] => Ok(()),
            [only] => only.fmt(f),
            [first, .., last] => write!(f, "{first} to {last}"),
        }
    }
}

/// Parts registers, sorted by table and address, into as few runs as can be. `most` is how many addresses of a table one may
/// have.
pub(super) fn runs(slots: &[Slot], most: fn(Table) -> usize) -> impl Iterator<Item = Run<'_>> {
    let mut rest = slots;
    iter::from_fn(move || {
        let first = rest.first()?;
        let most = most(first.row.table);
        let joins = |one: &Slot, next: &Slot| {
            let adjoins = one.row.table == next.row.table && one.end() == next.address();
            adjoins && usize::from(next.end() - first.address()) <= most
        };
        let joined = rest.windows(2).take_while(|pair| matches!(pair, [one, next] if joins(one, next)));
        let (slots, behind) = rest.split_at_checked(1 + joined.count())?;
        rest = behind;
        Some(Run { slots })
    })
}

fn read(first: Slot, count: u16) -> Request {
    let (table, address) = (first.row.table, first.address());
    if table.is_bits() {
        Request::ReadBits { table, address, count }
    } else {
        Request::ReadWords { table, address, count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slot(reg: Reg) -> Slot {
        Slot::new(reg, 0).expect("the first there is")
    }

    #[test]
    fn a_value_out_of_range_is_told_with_its_range_and_unit() {
        let text =
            |reg, value| slot(reg).check(value, Some(Model::Smsd42)).expect_err("out of range").to_string();
        assert_eq!(
            text(Reg::MaxSpeed, 20_000),
            "MAX_SPEED 20000 is out of range: 16 to 15600 full steps/s; nothing was sent"
        );
        assert_eq!(
            text(Reg::WorkCurrent, 43),
            "WORK_CURRENT 43 is out of range: 1 to 42 × 0.1 A on the SMSD-4.2LAN; nothing was sent"
        );
        assert_eq!(
            text(Reg::TargetPos, 1 << 21),
            "TARGET_POS 2097152 is out of range: -2097152 to 2097151 microsteps; nothing was sent"
        );
        assert_eq!(text(Reg::AbsPos, 0), "ABS_POS can only be read; nothing was sent");
        assert!(
            text(Reg::Cmd, 0).starts_with("CMD 0 is out of range: the commands are 0x0E RUN_F, 0x0F RUN_R")
        );
    }

    #[test]
    fn a_model_that_is_not_known_may_have_the_wider_range() {
        assert_eq!(range(Reg::WorkCurrent.info(), None), (1, 80));
        assert_eq!(range(Reg::WorkCurrent.info(), Some(Model::Smsd42)), (1, 42));
    }

    #[test]
    fn registers_of_a_row_are_called_by_their_number() {
        let mac = Slot::new(Reg::LanMac, 5).expect("six of them");
        assert_eq!((mac.to_string(), mac.address()), ("MAC 5".to_owned(), 0x7006));
        let none = Slot::new(Reg::LanMac, 6).expect_err("six of them").to_string();
        assert_eq!(none, "there is no MAC 6; they are numbered 0 to 5");
    }

    #[test]
    fn neighbours_are_joined_and_a_gap_parts_them() {
        let slots = [Reg::MinSpeed, Reg::MaxSpeed, Reg::TargetPos, Reg::TargetInput].map(slot);
        let shown: Vec<String> = runs(&slots, |_| 125).map(|run| run.to_string()).collect();
        assert_eq!(shown, ["MIN_SPEED to MAX_SPEED", "TARGET_POS to TARGET_INPUT"]);
        assert_eq!(runs(&slots[..2], |_| 1).count(), 2);
    }
}
