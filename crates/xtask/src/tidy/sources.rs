//! Rules about the text of the files.

use super::Broken;
use crate::Outcome;
use crate::workspace::{Workspace, is_rust};

/// Most lines that a source file may have, its tests among them.
const MAX_LINES: usize = 600;

/// Files that may be longer: each is one table.
const TABLES: [&str; 2] = ["crates/spec/src/smsd/registers.rs", "crates/spec/src/smsd/instructions.rs"];

/// The crates that know neither clock nor operating system.
const CORES: [&str; 5] = ["crates/spec", "crates/motion", "crates/proto", "crates/drive", "crates/rig"];

/// What a core must not name.
const CLOCKS: [&str; 2] = ["std::time", "SystemTime"];

/// Files that people write as text, by the end of their names.
const TEXTS: [&str; 8] = [".rs", ".toml", ".md", ".py", ".txt", ".ini", ".sh", ".ci/run"];

// Joined from halves, so that this file does not break the rules it checks.
const OPEN_ENDS: [&str; 2] = [concat!("TO", "DO"), concat!("FIX", "ME")];
const MACHINE_PATHS: [&str; 3] = [concat!("/wo", "rk/"), concat!("/ro", "ot/"), concat!("/ho", "me/")];

/// The rule: no source file is longer than [`MAX_LINES`], apart from [`TABLES`], which must exist.
pub(super) fn lengths(workspace: &Workspace) -> Outcome<Broken> {
    let mut broken = Broken::new();
    for file in texts(workspace)?.iter().filter(|file| is_rust(file)) {
        let lines = workspace.read(file)?.lines().count();
        if lines > MAX_LINES && !TABLES.contains(&file.as_str()) {
            broken.push(format!("{file} has {lines} lines, more than {MAX_LINES}"));
        }
    }
    let gone = TABLES.iter().filter(|table| !workspace.path(table).exists());
    broken.extend(gone.map(|table| format!("{table} is listed as a long table and is not there")));
    Ok(broken)
}

/// The rule: what is left to do names the issue that will do it, as in `#12`.
pub(super) fn open_ends(workspace: &Workspace) -> Outcome<Broken> {
    in_lines(workspace, |line| {
        let word = OPEN_ENDS.into_iter().find(|word| has_word(line, word))?;
        (!names_issue(line)).then(|| format!("{word} without the number of an issue"))
    })
}

/// The rule: a path is relative, or one that every machine has.
pub(super) fn machine_paths(workspace: &Workspace) -> Outcome<Broken> {
    in_lines(workspace, |line| {
        let path = MACHINE_PATHS.into_iter().find(|path| line.contains(path))?;
        Some(format!("names {path}"))
    })
}

/// The rule: a core declares `no_std` and names no clock.
pub(super) fn cores(workspace: &Workspace) -> Outcome<Broken> {
    let mut broken = Broken::new();
    for core in CORES {
        let root = format!("{core}/src/lib.rs");
        if !workspace.read(&root)?.lines().any(|line| line == "#![no_std]") {
            broken.push(format!("{root} lacks `#![no_std]`"));
        }
    }
    let is_core = |file: &str| CORES.iter().any(|core| file.starts_with(&format!("{core}/src/")));
    for file in texts(workspace)?.iter().filter(|file| is_core(file)) {
        let text = workspace.read(file)?;
        let named = CLOCKS.iter().filter(|clock| text.contains(**clock));
        broken.extend(named.map(|clock| format!("{file} names {clock}")));
    }
    Ok(broken)
}

/// Where a line of any text is found wrong: `file:line: what`.
fn in_lines(workspace: &Workspace, wrong: impl Fn(&str) -> Option<String>) -> Outcome<Broken> {
    let mut broken = Broken::new();
    for file in texts(workspace)? {
        let text = workspace.read(&file)?;
        let found = (1..).zip(text.lines()).filter_map(|(number, line)| Some((number, wrong(line)?)));
        broken.extend(found.map(|(number, what): (u32, String)| format!("{file}:{number} {what}")));
    }
    Ok(broken)
}

fn texts(workspace: &Workspace) -> Outcome<Vec<String>> {
    let is_text = |file: &String| TEXTS.iter().any(|end| file.ends_with(end));
    Ok(workspace.files()?.into_iter().filter(is_text).collect())
}

/// `true` when `word` stands in `line` and no letter touches it.
fn has_word(line: &str, word: &str) -> bool {
    let letter = |side: Option<char>| side.is_some_and(|char| char.is_alphanumeric() || char == '_');
    line.match_indices(word).any(|(start, _)| {
        let (before, rest) = line.split_at(start);
        let after = rest.get(word.len()..).unwrap_or_default();
        !letter(before.chars().next_back()) && !letter(after.chars().next())
    })
}

/// `true` when `line` has a number sign with a digit behind it.
fn names_issue(line: &str) -> bool {
    line.split('#').skip(1).any(|rest| rest.starts_with(|char: char| char.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_end_is_a_whole_word() {
        let [word, _] = OPEN_ENDS;
        assert!(has_word(&format!("// {word}: later"), word));
        assert!(has_word(word, word));
        assert!(!has_word(&format!("{word}S and A{word}"), word));
        assert!(!has_word("todo = \"warn\"", word));
    }

    #[test]
    fn an_issue_is_a_number_sign_and_a_digit() {
        assert!(names_issue("later (#12)"));
        assert!(!names_issue("# later"));
        assert!(!names_issue("#[later] 12"));
    }
}
