//! Who may depend on whom.

use super::Broken;
use crate::Outcome;
use crate::workspace::{Workspace, keys};

/// The start of the names of our crates.
const OURS: &str = "stepdrive-";

/// Each member, and the crates of ours that it may use. What is absent matters as much: `proto` knows no drive, and
/// `drive` knows no byte.
const ARROWS: [(&str, &[&str]); 14] = [
    ("crates/spec", &[]),
    ("crates/motion", &["spec"]),
    ("crates/proto", &["spec"]),
    ("crates/drive", &["spec", "motion"]),
    ("crates/rig", &["spec", "motion", "drive"]),
    ("crates/asm", &["spec"]),
    ("crates/web", &[]),
    ("crates/server", &["spec", "proto", "drive", "rig", "asm", "web"]),
    ("crates/host", &["spec", "proto"]),
    ("crates/panel", &["spec", "host", "asm", "rig", "web"]),
    ("crates/cli", &["spec", "rig", "asm", "server", "host", "panel", "web"]),
    ("crates/xtask", &["spec"]),
    ("bench", &["spec", "motion", "proto", "drive", "rig", "asm", "server", "host", "panel"]),
    ("fuzz", &["spec", "motion", "proto", "drive", "rig", "asm", "server"]),
];

/// The rule: every member stands in the table and uses no more than it says. Tests may use what they like.
pub(super) fn run(workspace: &Workspace) -> Outcome<Broken> {
    let mut broken = Broken::new();
    for member in workspace.members()? {
        let manifest = workspace.read(&format!("{member}/Cargo.toml"))?;
        broken.extend(forbidden(&member, &manifest));
    }
    Ok(broken)
}

fn forbidden(member: &str, manifest: &str) -> Broken {
    let Some((_, allowed)) = ARROWS.iter().find(|(other, _)| *other == member) else {
        return vec![format!("{member} has no row in the table of arrows")];
    };
    let used = keys(manifest, is_dependencies);
    let ours = used.iter().filter_map(|name| name.strip_prefix(OURS));
    ours.filter(|name| !allowed.contains(name))
        .map(|name| format!("{member} must not use {OURS}{name}"))
        .collect()
}

/// `true` for the tables of what a crate is built from, for whatever target.
fn is_dependencies(table: &str) -> bool {
    matches!(table.rsplit('.').next(), Some("dependencies" | "build-dependencies"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dependency_against_the_arrows_is_named() {
        let manifest = "[dependencies]\nstepdrive-spec.workspace = true\nstepdrive-drive.workspace = true\n";
        assert_eq!(forbidden("crates/proto", manifest), ["crates/proto must not use stepdrive-drive"]);
        assert!(forbidden("crates/rig", manifest).is_empty());
    }

    #[test]
    fn a_dependency_of_one_target_counts_and_one_of_the_tests_does_not() {
        let unix = "[target.'cfg(unix)'.dependencies]\nstepdrive-proto.workspace = true\n";
        assert_eq!(forbidden("crates/drive", unix), ["crates/drive must not use stepdrive-proto"]);
        assert!(
            forbidden("crates/drive", "[dev-dependencies]\nstepdrive-proto.workspace = true\n").is_empty()
        );
    }

    #[test]
    fn a_crate_without_a_row_is_named() {
        assert_eq!(forbidden("crates/new", ""), ["crates/new has no row in the table of arrows"]);
    }
}
