//! The wires between drives: `[[wire]]`.

use super::checked::Mistake;
use super::written::WrittenWire;
use super::{RigFile, WireSection};
use crate::names::split;
use alloc::format;
use alloc::vec::Vec;

/// What the wires of a rig mean.
pub(super) fn check(written: &[WrittenWire], rig: &RigFile) -> Result<Vec<WireSection>, Mistake> {
    let mut wires: Vec<WireSection> = Vec::new();
    for wire in written {
        let checked = wire.check(rig)?;
        if wires.iter().any(|other| other.joins() == checked.joins()) {
            let (from, to) = (wire.from.get_ref(), wire.to.get_ref());
            return Err((wire.from.span(), format!("a wire from {from} to {to} is there already")));
        }
        wires.push(checked);
    }
    Ok(wires)
}

impl WrittenWire {
    fn check(&self, rig: &RigFile) -> Result<WireSection, Mistake> {
        let at_start = |error| (self.from.span(), format!("{error}"));
        let at_end = |error| (self.to.span(), format!("{error}"));
        let (drive, name) = split(self.from.get_ref()).map_err(at_start)?;
        let from = rig.find_drive(drive).map_err(at_start)?;
        let output = rig.find_output(from, name).map_err(at_start)?;
        let (drive, name) = split(self.to.get_ref()).map_err(at_end)?;
        let to = rig.find_drive(drive).map_err(at_end)?;
        let input = rig.find_input(to, name).map_err(at_end)?;
        if from == to {
            let (from, to) = (self.from.get_ref(), self.to.get_ref());
            let message = format!("a wire loop: {from} to {to}; a wire joins two different drives");
            return Err((self.to.span(), message));
        }
        Ok(WireSection { from, output, to, input, delay: self.delay, invert: self.invert })
    }
}

/// The groups of so many drives that wires join, directly or by others.
pub(super) fn groups(drives: usize, wires: &[WireSection]) -> Vec<Vec<usize>> {
    // Each drive leads to one of its group with a lower number, the first of them to itself.
    let mut leads: Vec<usize> = (0..drives).collect();
    for wire in wires.iter().filter(|wire| wire.from < drives && wire.to < drives) {
        let (one, other) = (first(&mut leads, wire.from), first(&mut leads, wire.to));
        leads[one.max(other)] = one.min(other);
    }
    let mut groups: Vec<Vec<usize>> = leads.iter().map(|_| Vec::new()).collect();
    for drive in 0..drives {
        let first = first(&mut leads, drive);
        groups[first].push(drive);
    }
    groups.retain(|group| !group.is_empty());
    groups
}

/// The first drive of another's group. The way there is shortened for the next time.
fn first(leads: &mut [usize], drive: usize) -> usize {
    let mut at = drive;
    while leads[at] != at {
        leads[at] = leads[leads[at]];
        at = leads[at];
    }
    at
}
