//! Names: those of the instruction table, those the language keeps for itself, and the nearest one to a misspelt word.

use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, OpcodeInfo, PROGRAM_AREAS};

/// What the maker puts before every instruction's name.
const MAKERS_PREFIX: &str = "CMD_POWERSTEP01_";
/// Longer words are not compared: nobody misspells so much, and the time would add up.
const LONGEST_COMPARED: usize = 32;
/// More names than this are not searched for the nearest one.
const MOST_COMPARED: usize = 512;

/// The instruction with this name or alias, in any case.
pub(crate) fn instruction(name: &str) -> Option<&'static OpcodeInfo> {
    let same = |known: &str| known.eq_ignore_ascii_case(name);
    INSTRUCTIONS.iter().find(|info| same(info.name) || (!info.alias.is_empty() && same(info.alias)))
}

/// The input with this name, in any case.
pub(crate) fn input(name: &str) -> Option<Input> {
    Input::from_name(&name.to_ascii_uppercase())
}

/// The memory that `mem2` names, in any case; also one that no controller has.
pub(crate) fn memory(name: &str) -> Option<u32> {
    let (mem, digits) = name.split_at_checked(3)?;
    let plain = mem.eq_ignore_ascii_case("mem") && digits.bytes().all(|byte| byte.is_ascii_digit());
    plain.then(|| digits.parse().ok()).flatten()
}

/// What else the language means by a name, so that no label or constant may have it.
pub(crate) fn reserved(name: &str) -> Option<&'static str> {
    if instruction(name).is_some() {
        Some("an instruction")
    } else if input(name).is_some() {
        Some("an input")
    } else if memory(name).is_some() {
        Some("a memory")
    } else {
        None
    }
}

/// The form in which names are compared: case does not count.
pub(crate) fn key(name: &str) -> String {
    name.to_ascii_lowercase()
}

/// The memory number as an area of an image; `None` for one that no controller has.
pub(crate) fn area(number: i64) -> Option<u8> {
    u8::try_from(number).ok().filter(|memory| usize::from(*memory) < PROGRAM_AREAS)
}

/// The instruction that was probably meant.
pub(crate) fn nearest_instruction(name: &str) -> Option<String> {
    let upper = name.to_ascii_uppercase();
    let bare = upper.strip_prefix(MAKERS_PREFIX).unwrap_or(&upper);
    if let Some(info) = instruction(bare) {
        return Some(info.name.to_owned());
    }
    let usable = INSTRUCTIONS.iter().filter(|info| info.in_program);
    nearest(bare, usable.flat_map(|info| [info.name, info.alias]))
}

/// The candidate that differs least from `word`, when it differs little enough to be a slip of the finger.
pub(crate) fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    if word.len() > LONGEST_COMPARED {
        return None;
    }
    let word = key(word);
    let limit = (word.len() / 3).max(1);
    let near = |candidate: &&str| !candidate.is_empty() && candidate.len().abs_diff(word.len()) <= limit;
    let distances = candidates
        .into_iter()
        .take(MOST_COMPARED)
        .filter(near)
        .map(|candidate| (strsim::osa_distance(&word, &key(candidate)), candidate));
    let (distance, nearest) = distances.min_by_key(|(distance, _)| *distance)?;
    (distance <= limit).then(|| nearest.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_instructions_are_guessed() {
        assert_eq!(nearest_instruction("MOVEF").as_deref(), Some("MOVE_F"));
        assert_eq!(nearest_instruction("set_max_sped").as_deref(), Some("SET_MAX_SPEED"));
        assert_eq!(nearest_instruction("CMD_PowerSTEP01_GO_TO").as_deref(), Some("GO_TO"));
        assert_eq!(nearest_instruction("SOFT_HIZ").as_deref(), Some("SOFT_HI_Z"));
        assert_eq!(nearest_instruction("fly"), None);
        assert_eq!(nearest_instruction(&"A".repeat(10_000)), None);
    }

    #[test]
    fn names_that_mean_something_are_reserved() {
        assert_eq!(reserved("move_f"), Some("an instruction"));
        assert_eq!(reserved("GO_LABEL"), Some("an instruction"));
        assert_eq!(reserved("in0"), Some("an input"));
        assert_eq!(reserved("Mem9"), Some("a memory"));
        assert_eq!(reserved("memory"), None);
        assert_eq!(reserved("mem"), None);
    }
}
