//! `docs/assumptions.md`: everything that nobody knows, collected from where it was decided.
//!
//! A comment assumes something when it has the bare word `ASSUMED` in it. Written in backticks or in bold, as here, the
//! word only speaks of the mark. Notes of the register map and of the table of commands are read from the tables.

use super::page;
use crate::Outcome;
use crate::workspace::{Workspace, is_rust};
use std::fmt::Write;
use stepdrive_spec::smd3::commands::COMMANDS;
use stepdrive_spec::smsd::registers::REGISTERS;

const MARK: &str = "ASSUMED";

const ABOUT: &str = "\
What the makers' documents do not say, and no other source settles. Each is one constant or one row of a table: with
the real controller at hand, check it and change it there.";

/// Words that introduce an item, and stand before its name.
const ITEM_WORDS: [&str; 9] =
    ["const", "static", "fn", "struct", "enum", "type", "trait", "mod", "macro_rules!"];

/// Words that may stand before those.
const QUALIFIERS: [&str; 7] = ["pub", "pub(crate)", "pub(super)", "unsafe", "async", "extern", "mut"];

/// An assumption that a comment states.
#[derive(Debug, PartialEq, Eq)]
struct Assumption {
    item: String,
    text: String,
}

/// The whole page.
pub(super) fn page(workspace: &Workspace) -> Outcome<String> {
    let mut text = page::start("Assumptions", "the comments and tables under `crates/`", ABOUT);
    text.push_str("\n## `crates/spec/src/smsd/registers.rs`, notes of the register map\n\n");
    for row in REGISTERS.iter().filter(|row| row.note.contains(MARK)) {
        let _ = writeln!(text, "- `{}` ({:04X}): {}", row.name, row.address, row.note);
    }
    text.push_str("\n## `crates/spec/src/smd3/commands.rs`, notes of the table of commands\n\n");
    for row in COMMANDS.iter().filter(|row| row.note.contains(MARK)) {
        let _ = writeln!(text, "- `{}`: {}", row.mnemonic, row.note);
    }
    for file in workspace.files()?.iter().filter(|file| is_scanned(file)) {
        let found = assumptions(&workspace.read(file)?);
        if !found.is_empty() {
            let _ = write!(text, "\n## `{file}`\n\n");
        }
        for Assumption { item, text: said } in found {
            let _ = writeln!(text, "- `{item}`: {said}");
        }
    }
    Ok(text)
}

fn is_scanned(file: &str) -> bool {
    let source = file.starts_with("crates/") && file.contains("/src/") && is_rust(file);
    source && !file.starts_with("crates/xtask/")
}

/// The assumptions that the comments of a source file state, in order.
fn assumptions(source: &str) -> Vec<Assumption> {
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(line) = lines.get(at) {
        let Some((sigil, _)) = comment(line) else {
            at += 1;
            continue;
        };
        let paragraph: Vec<&str> = lines
            .iter()
            .skip(at)
            .map_while(|line| comment(line).filter(|(other, text)| *other == sigil && !text.is_empty()))
            .map(|(_, text)| text)
            .collect();
        at += paragraph.len().max(1);
        let text = paragraph.join(" ");
        if assumes(&text) {
            found.push(Assumption { item: item(&lines, at, sigil), text });
        }
    }
    found
}

/// The sigil and the text of a line that is a comment and nothing else.
fn comment(line: &str) -> Option<(&'static str, &str)> {
    ["//!", "///", "//"].into_iter().find_map(|sigil| Some((sigil, line.strip_prefix(sigil)?.trim())))
}

/// `true` when the mark stands in the text as a bare word.
fn assumes(text: &str) -> bool {
    let quoted = |side: Option<char>| side.is_some_and(|char| char == '`' || char == '*');
    text.match_indices(MARK).any(|(start, mark)| {
        let before = text.get(..start).and_then(|before| before.chars().next_back());
        let after = text.get(start + mark.len()..).and_then(|after| after.chars().next());
        !quoted(before) && !quoted(after)
    })
}

/// The name of what the comment that ends before line `after` speaks of: the item, field or row that it stands on, or
/// the function that it stands in.
fn item(lines: &[&str], after: usize, sigil: &str) -> String {
    let code = |line: &&&str| comment(line).is_none() && !line.is_empty() && !line.starts_with("#[");
    let next = lines.iter().skip(after).find(code).copied().unwrap_or_default();
    let function =
        || lines.iter().take(after).rev().find(|line| line.contains("fn ")).and_then(|line| declared(line));
    let name = match sigil {
        "//!" => None,
        "///" => declared(next).or_else(|| first_word(next)),
        _ => declared(next).or_else(function),
    };
    name.unwrap_or("module").to_owned()
}

/// The name that a line of code declares: `A` for `pub const A: u16 = 1;`.
fn declared(line: &str) -> Option<&str> {
    let mut words = line.split_whitespace().skip_while(|word| QUALIFIERS.contains(word));
    let mut kind = words.next()?;
    let mut name = words.next()?;
    if kind == "const" && name == "fn" {
        kind = name;
        name = words.next()?;
    }
    if ITEM_WORDS.contains(&kind) { first_word(name) } else { None }
}

fn first_word(text: &str) -> Option<&str> {
    let text = QUALIFIERS.iter().find_map(|word| text.strip_prefix(word)?.strip_prefix(' ')).unwrap_or(text);
    text.split(|char: char| !char.is_alphanumeric() && char != '_').next().filter(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(source: &str, expected: &[(&str, &str)]) {
        let found: Vec<_> = assumptions(source).into_iter().map(|found| (found.item, found.text)).collect();
        let expected: Vec<_> =
            expected.iter().map(|(item, text)| ((*item).to_owned(), (*text).to_owned())).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn a_doc_comment_belongs_to_the_item_below_it() {
        check("/// ASSUMED: two\n/// lines.\n#[x]\npub const A: u16 = 1;", &[("A", "ASSUMED: two lines.")]);
        check("/// ASSUMED: f.\npub(crate) const fn f() {}", &[("f", "ASSUMED: f.")]);
        check("/// ASSUMED: row.\nMinSpeed => row(1);", &[("MinSpeed", "ASSUMED: row.")]);
        check("/// ASSUMED: field.\npub field: u8,", &[("field", "ASSUMED: field.")]);
    }

    #[test]
    fn only_the_paragraph_with_the_mark_is_taken() {
        let source = "/// What it is.\n///\n/// ASSUMED: a value.\n///\n/// More.\nenum E {}";
        check(source, &[("E", "ASSUMED: a value.")]);
    }

    #[test]
    fn a_plain_comment_belongs_to_the_function_around_it() {
        check("fn turn() {\n    // ASSUMED: left.\n    if left {}\n}", &[("turn", "ASSUMED: left.")]);
        check("fn turn() {}\n// ASSUMED: b.\nconst B: u8 = 1;", &[("B", "ASSUMED: b.")]);
    }

    #[test]
    fn the_head_of_a_file_is_its_module() {
        check("//! ASSUMED: all of it.\n\nconst A: u8 = 1;", &[("module", "ASSUMED: all of it.")]);
    }

    #[test]
    fn a_quoted_mark_and_a_mark_in_code_are_not_assumptions() {
        check("/// The word `ASSUMED`, or **ASSUMED**.\nconst A: &str = \"ASSUMED\";", &[]);
    }
}
