//! The house rules. Each is a function from the workspace to what breaks it, and a test.

mod arrows;
mod sources;

use crate::Outcome;
use crate::workspace::{Workspace, keys};

/// What breaks a rule: a place, and what is wrong with it.
type Broken = Vec<String>;

/// A rule, under the name by which it is reported.
type Rule = (&'static str, fn(&Workspace) -> Outcome<Broken>);

const RULES: [Rule; 7] = [
    ("crates depend along the arrows", arrows::run),
    ("files stay short", sources::lengths),
    ("what is left to do has an issue", sources::open_ends),
    ("nothing names a path of one machine", sources::machine_paths),
    ("cores do without std and clocks", sources::cores),
    ("crates share the lints", shared_lints),
    ("ARCHITECTURE.md has every crate", documented_members),
];

/// Checks every rule and lists all that is broken.
pub(crate) fn run(workspace: &Workspace) -> Outcome {
    let mut report = String::new();
    for (name, rule) in RULES {
        for broken in rule(workspace)? {
            report.push_str("\n  ");
            report.push_str(name);
            report.push_str(": ");
            report.push_str(&broken);
        }
    }
    if report.is_empty() { Ok(()) } else { Err(format!("house rules are broken:{report}")) }
}

fn shared_lints(workspace: &Workspace) -> Outcome<Broken> {
    let mut broken = Broken::new();
    for member in workspace.members()? {
        let manifest = format!("{member}/Cargo.toml");
        if !keys(&workspace.read(&manifest)?, |table| table == "lints").contains(&"workspace".to_owned()) {
            broken.push(format!("{manifest} lacks `[lints] workspace = true`"));
        }
    }
    Ok(broken)
}

fn documented_members(workspace: &Workspace) -> Outcome<Broken> {
    let Ok(architecture) = workspace.read("ARCHITECTURE.md") else {
        return Ok(vec!["there is no ARCHITECTURE.md".to_owned()]);
    };
    let missing = workspace.members()?.into_iter().filter(|member| !has_row(&architecture, member));
    Ok(missing.map(|member| format!("{member} has no row in a table there")).collect())
}

/// `true` when a table row of `page` has the folder, or its last part, in backticks in its first cell.
fn has_row(page: &str, member: &str) -> bool {
    let name = member.rsplit('/').next().unwrap_or(member);
    let cells = page.lines().filter_map(|line| line.trim().strip_prefix('|')?.split('|').next());
    cells.into_iter().any(|cell| [name, member].iter().any(|text| cell.contains(&format!("`{text}`"))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(name: &str) {
        let workspace = Workspace::here();
        let (_, rule) = RULES.into_iter().find(|(other, _)| *other == name).expect("a rule of that name");
        assert_eq!(rule(&workspace), Ok(Broken::new()), "{name}");
    }

    #[test]
    fn crates_depend_along_the_arrows() {
        holds("crates depend along the arrows");
    }

    #[test]
    fn files_stay_short() {
        holds("files stay short");
    }

    #[test]
    fn what_is_left_to_do_has_an_issue() {
        holds("what is left to do has an issue");
    }

    #[test]
    fn nothing_names_a_path_of_one_machine() {
        holds("nothing names a path of one machine");
    }

    #[test]
    fn cores_do_without_std_and_clocks() {
        holds("cores do without std and clocks");
    }

    #[test]
    fn crates_share_the_lints() {
        holds("crates share the lints");
    }

    #[test]
    fn the_architecture_page_has_every_crate() {
        holds("ARCHITECTURE.md has every crate");
    }

    #[test]
    fn a_crate_is_documented_by_a_row_that_names_it() {
        let page = "`cli` stands in prose\n| crate | what |\n|---|---|\n| `spec` | data |\n| `xtask`, `fuzz` | tools |\n";
        assert!(has_row(page, "crates/spec") && has_row(page, "fuzz"));
        assert!(!has_row(page, "crates/cli") && !has_row(page, "crates/spe"));
    }
}
