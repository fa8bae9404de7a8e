//! The names by which rig files, conditions and commands speak of a rig: of its drives, and of what these have.
//!
//! A drive's part is written behind the drive, as in `stage.IN0`. Case does not matter.

use crate::file::{ControllerSection, DriveSection, RigFile};
use alloc::format;
use alloc::string::{String, ToString as _};
use alloc::vec::Vec;
use core::fmt;
use stepdrive_drive::controller::Controller;
use stepdrive_drive::smd3::Smd3;
use stepdrive_drive::smsd::Smsd;
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::smsd::inputs::Input;

/// The most characters that are shown of what a person wrote.
const MOST_SHOWN: usize = 40;
/// Up to so many names are listed even when it is likely which was meant.
const FEW: usize = 10;
/// The most names that are listed.
const MOST_LISTED: usize = 40;

/// A signal that goes into a controller of either family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnySignal {
    /// An input of an SMSD.
    Smsd(Input),
    /// A signal of an SMD3.
    Smd3(Signal),
}

/// Something about a drive that has a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnyQuantity {
    /// Of an SMSD.
    Smsd(<Smsd as Controller>::Quantity),
    /// Of an SMD3.
    Smd3(<Smd3 as Controller>::Quantity),
    /// `carriage`: where the carriage is, in full steps on its travel.
    Carriage,
    /// `stalled`: whether the rotor is held or driven against an end of the travel.
    Stalled,
    /// `powered`: whether the controller has its supply.
    Powered,
}

/// What machines of both families have, by name.
const OF_MACHINES: [(&str, AnyQuantity); 3] = [
    ("carriage", AnyQuantity::Carriage),
    ("stalled", AnyQuantity::Stalled),
    ("powered", AnyQuantity::Powered),
];

/// A name that means nothing where it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NameError {
    /// What is wrong, and what would be right.
    pub message: String,
}

impl AnySignal {
    /// Its name in rig files and commands.
    pub const fn name(self) -> &'static str {
        match self {
            AnySignal::Smsd(input) => input.name(),
            AnySignal::Smd3(signal) => signal.name(),
        }
    }
}

impl AnyQuantity {
    /// Its name. It may have spaces in it, as the makers' names have; [`AnyQuantity`]'s `Display` has none.
    pub fn name(self) -> &'static str {
        let all = of_smsd().chain(of_smd3()).chain(OF_MACHINES);
        all.into_iter().find(|(_, quantity)| *quantity == self).map_or("", |(name, _)| name)
    }

    /// Whether its value may change though nothing happens, as a position's does. All others change only when something
    /// is done to the machine or it is woken.
    pub fn flows(self) -> bool {
        match self {
            AnyQuantity::Smsd(quantity) => Smsd::flows(quantity),
            AnyQuantity::Smd3(quantity) => Smd3::flows(quantity),
            AnyQuantity::Carriage | AnyQuantity::Stalled => true,
            AnyQuantity::Powered => false,
        }
    }
}

fn of_smsd() -> impl Iterator<Item = (&'static str, AnyQuantity)> {
    Smsd::quantities().map(|(name, quantity)| (name, AnyQuantity::Smsd(quantity)))
}

fn of_smd3() -> impl Iterator<Item = (&'static str, AnyQuantity)> {
    Smd3::quantities().map(|(name, quantity)| (name, AnyQuantity::Smd3(quantity)))
}

impl fmt::Display for AnySignal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for AnyQuantity {
    /// As it is written in conditions and commands: with underscores where the name has spaces, or with hyphens where
    /// another quantity is called so.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.name();
        let underscored = name.replace(' ', "_");
        let found = match self {
            AnyQuantity::Smsd(_) => Smsd::find_quantity(&underscored).map(AnyQuantity::Smsd),
            AnyQuantity::Smd3(_) => Smd3::find_quantity(&underscored).map(AnyQuantity::Smd3),
            AnyQuantity::Carriage | AnyQuantity::Stalled | AnyQuantity::Powered => Some(*self),
        };
        if found == Some(*self) { f.pad(&underscored) } else { f.pad(&name.replace(' ', "-")) }
    }
}

impl fmt::Display for NameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl core::error::Error for NameError {}

/// The drive and its part in a text like `stage.IN0`. Neither has been looked up.
///
/// # Errors
/// There is no dot between two names.
pub fn split(text: &str) -> Result<(&str, &str), NameError> {
    let both = text.split_once('.').filter(|(drive, part)| !drive.is_empty() && !part.is_empty());
    both.ok_or_else(|| NameError {
        message: format!("`{}` is not a drive and a part of it, as in stage.IN0", shown(text)),
    })
}

impl RigFile {
    /// The drive with this name, by its place in the file. Case does not matter unless two differ in nothing else.
    ///
    /// # Errors
    /// There is none, or it is not clear which is meant.
    pub fn find_drive(&self, name: &str) -> Result<usize, NameError> {
        if let Some(exact) = self.drives.iter().position(|drive| drive.name == name) {
            return Ok(exact);
        }
        let alike = |drive: &DriveSection| drive.name.eq_ignore_ascii_case(name);
        match (self.drives.iter().position(alike), self.drives.iter().rposition(alike)) {
            (Some(one), Some(last)) if one == last => Ok(one),
            _ => {
                let known: Vec<&str> = self.drives.iter().map(|drive| drive.name.as_str()).collect();
                let (name, instead) = (shown(name), instead(name, &known));
                Err(NameError { message: format!("unknown drive `{name}`; {instead}") })
            }
        }
    }

    /// The input of a drive with this name.
    ///
    /// # Errors
    /// It has none.
    pub fn find_input(&self, drive: usize, name: &str) -> Result<AnySignal, NameError> {
        let section = self.drive(drive)?;
        let upper = name.to_ascii_uppercase();
        let found = match section.controller {
            ControllerSection::Smsd(_) => Input::from_name(&upper).map(AnySignal::Smsd),
            ControllerSection::Smd3(_) => Signal::from_name(&upper).map(AnySignal::Smd3),
        };
        found.ok_or_else(|| match named(section.outputs(), name) {
            Some(output) => NameError {
                message: format!("{output} is an output; an input is one of {}", list(&section.inputs())),
            },
            None => unknown_of("input", name, section, &section.inputs()),
        })
    }

    /// The output of a drive with this name, by its place in [`Controller::OUTPUTS`].
    ///
    /// # Errors
    /// It has none.
    pub fn find_output(&self, drive: usize, name: &str) -> Result<u8, NameError> {
        let section = self.drive(drive)?;
        let outputs = section.outputs();
        let mut numbered = (0..).zip(outputs);
        if let Some((number, _)) = numbered.find(|(_, output)| output.eq_ignore_ascii_case(name)) {
            return Ok(number);
        }
        if outputs.is_empty() {
            return Err(NameError {
                message: format!("`{}` is an SMD3, which has no outputs", section.name),
            });
        }
        Err(match named(&section.inputs(), name) {
            Some(input) => NameError {
                message: format!("{input} is an input; a wire begins at an output: {}", list(outputs)),
            },
            None => unknown_of("output", name, section, outputs),
        })
    }

    /// The name of an output of a drive; empty when it has none of this number.
    pub fn output_name(&self, drive: usize, output: u8) -> &'static str {
        let outputs = self.drives.get(drive).map_or([].as_slice(), DriveSection::outputs);
        outputs.get(usize::from(output)).copied().unwrap_or("")
    }

    /// The quantity of a drive with this name; see [`Controller::find_quantity`]. A space of a name may also be written as
    /// a hyphen: an SMD3 has the flag `LIMIT-NEGATIVE` besides the input `LIMIT_NEGATIVE`.
    ///
    /// # Errors
    /// It has none.
    pub fn find_quantity(&self, drive: usize, name: &str) -> Result<AnyQuantity, NameError> {
        let section = self.drive(drive)?;
        let of_machines = OF_MACHINES.into_iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
        let found = of_machines.map(|(_, quantity)| quantity).or_else(|| section.of_controller(name));
        found.or_else(|| section.of_controller(&name.replace('-', " "))).ok_or_else(|| {
            let written: Vec<String> = section.quantities().map(|quantity| quantity.to_string()).collect();
            let known: Vec<&str> = written.iter().map(String::as_str).collect();
            unknown_of("quantity", name, section, &known)
        })
    }

    fn drive(&self, number: usize) -> Result<&DriveSection, NameError> {
        let none = || NameError { message: format!("the rig has no drive number {number}") };
        self.drives.get(number).ok_or_else(none)
    }
}

impl DriveSection {
    /// The names of its inputs.
    pub fn inputs(&self) -> Vec<&'static str> {
        match self.controller {
            ControllerSection::Smsd(_) => Input::ALL.map(Input::name).to_vec(),
            ControllerSection::Smd3(_) => Signal::ALL.map(Signal::name).to_vec(),
        }
    }

    /// The names of its outputs.
    pub fn outputs(&self) -> &'static [&'static str] {
        match self.controller {
            ControllerSection::Smsd(_) => Smsd::OUTPUTS,
            ControllerSection::Smd3(_) => Smd3::OUTPUTS,
        }
    }

    /// Its quantities: those of the controller, then those of what hangs on it.
    pub fn quantities(&self) -> impl Iterator<Item = AnyQuantity> + use<> {
        let smsd = self.smsd().map(|_| of_smsd()).into_iter().flatten();
        let smd3 = self.smd3().map(|_| of_smd3()).into_iter().flatten();
        smsd.chain(smd3).chain(OF_MACHINES).map(|(_, quantity)| quantity)
    }

    fn of_controller(&self, name: &str) -> Option<AnyQuantity> {
        match self.controller {
            ControllerSection::Smsd(_) => Smsd::find_quantity(name).map(AnyQuantity::Smsd),
            ControllerSection::Smd3(_) => Smd3::find_quantity(name).map(AnyQuantity::Smd3),
        }
    }
}

/// What a person wrote, as it may be shown: not too long, and nothing that would disturb a terminal.
pub(crate) fn shown(text: &str) -> String {
    let tame = |c: char| if c.is_control() { '\u{FFFD}' } else { c };
    let mut shown: String = text.chars().take(MOST_SHOWN).map(tame).collect();
    if text.chars().nth(MOST_SHOWN).is_some() {
        shown.push('…');
    }
    shown
}

/// One of some names, in any case.
fn named(names: &[&'static str], name: &str) -> Option<&'static str> {
    names.iter().copied().find(|known| known.eq_ignore_ascii_case(name))
}

/// That a drive has no such thing, and the one that was probably meant, or all.
fn unknown_of(what: &str, name: &str, drive: &DriveSection, known: &[&str]) -> NameError {
    let (name, instead) = (shown(name), instead(name, known));
    NameError { message: format!("unknown {what} `{name}` of `{}`; {instead}", drive.name) }
}

/// What there is instead of a name: all when they are few, else the one that was probably meant.
fn instead(name: &str, known: &[&str]) -> String {
    let likely = if known.len() > FEW { nearest(name, known) } else { None };
    match (likely, known) {
        (Some(likely), _) => format!("did you mean {likely}?"),
        (None, [only]) => format!("there is only {only}"),
        (None, _) => format!("there are {}", list(known)),
    }
}

/// Names in a row, not too many.
fn list(names: &[&str]) -> String {
    match names.split_at_checked(MOST_LISTED) {
        Some((listed, rest)) if !rest.is_empty() => {
            format!("{} and {} more", listed.join(", "), rest.len())
        }
        _ => names.join(", "),
    }
}

/// The name that differs least from what was written, when it differs little enough to be a slip of the finger.
fn nearest<'a>(written: &str, known: &[&'a str]) -> Option<&'a str> {
    let most = (written.len() / 3).max(1);
    if written.len() > MOST_SHOWN {
        return None;
    }
    let near = known.iter().map(|name| (distance(written, name), *name));
    near.filter(|(distance, _)| *distance <= most).min_by_key(|(distance, _)| *distance).map(|(_, name)| name)
}

/// How many characters must be put in, taken out or replaced to make one name of another, whatever their case.
fn distance(one: &str, other: &str) -> usize {
    // The distances from what has been seen of `one` to each beginning of `other`.
    let mut row: Vec<usize> = (0..=other.len()).collect();
    for (number, byte) in one.bytes().enumerate() {
        let mut diagonal = number;
        let mut left = number + 1;
        for (slot, wanted) in row.iter_mut().zip(core::iter::once(None).chain(other.bytes().map(Some))) {
            let above = *slot;
            *slot = match wanted {
                None => left,
                Some(wanted) => {
                    let replaced = diagonal + usize::from(!wanted.eq_ignore_ascii_case(&byte));
                    replaced.min(above + 1).min(left + 1)
                }
            };
            (diagonal, left) = (above, *slot);
        }
    }
    row.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_counts_what_differs() {
        for (one, other, expected) in [
            ("", "", 0),
            ("", "abc", 3),
            ("abc", "", 3),
            ("speed", "SPEED", 0),
            ("ABSPOS", "ABS_POS", 1),
            ("ABS_PSO", "ABS_POS", 2),
            ("kitten", "sitting", 3),
        ] {
            assert_eq!(distance(one, other), expected, "{one} {other}");
        }
    }

    #[test]
    fn the_nearest_name_is_near() {
        let names = ["SPEED", "ABS_POS", "EL_POS"];
        assert_eq!(nearest("abs_pso", &names), Some("ABS_POS"));
        assert_eq!(nearest("colour", &names), None);
        assert_eq!(nearest(&"S".repeat(1_000), &names), None);
    }

    #[test]
    fn few_names_are_listed_and_many_are_cut_short() {
        assert_eq!(instead("sped", &["SPEED"]), "there is only SPEED");
        assert_eq!(instead("sped", &["SPEED", "POS"]), "there are SPEED, POS");
        let many: Vec<&str> = core::iter::repeat_n("x", 42).collect();
        assert!(instead("sped", &many).ends_with(", x, x and 2 more"));
    }

    #[test]
    fn what_is_shown_of_a_text_is_short_and_tame() {
        assert_eq!(shown("a\u{1b}[31mb\n"), "a\u{FFFD}[31mb\u{FFFD}");
        assert_eq!(shown(&"ä".repeat(40)), "ä".repeat(40));
        assert_eq!(shown(&"ä".repeat(41)), "ä".repeat(40) + "…");
    }
}
