//! The checked-out workspace: its root, its files, and the little of `Cargo.toml` that the house rules need.

use crate::Outcome;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folders that hold what tools make, not what people write.
const NOT_SOURCES: [&str; 5] = [".git", "__pycache__", "artifacts", "corpus", "target"];

/// The workspace that this program was built in.
#[derive(Clone, Debug)]
pub(crate) struct Workspace {
    root: PathBuf,
}

impl Workspace {
    /// The workspace, wherever the program is called from.
    pub(crate) fn here() -> Workspace {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
        Workspace { root: manifest.ancestors().nth(2).unwrap_or(manifest).to_path_buf() }
    }

    /// The full path of `relative`.
    pub(crate) fn path(&self, relative: &str) -> PathBuf {
        self.root.join(relative)
    }

    /// The text of the file at `relative`.
    pub(crate) fn read(&self, relative: &str) -> Outcome<String> {
        std::fs::read_to_string(self.path(relative))
            .map_err(|error| format!("{relative} cannot be read: {error}"))
    }

    /// Writes the file at `relative`, with the folders it stands in.
    pub(crate) fn write(&self, relative: &str, text: &str) -> Outcome {
        let path = self.path(relative);
        path.parent()
            .map_or(Ok(()), std::fs::create_dir_all)
            .and_then(|()| std::fs::write(&path, text))
            .map_err(|error| format!("{relative} cannot be written: {error}"))
    }

    /// `program` with `arguments`, to be run in the root.
    pub(crate) fn command(&self, program: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(&self.root);
        command
    }

    /// Runs `program` with its output passed through; an exit code other than 0 is a failure.
    pub(crate) fn run(&self, program: &str, arguments: &[&str]) -> Outcome {
        finish(&mut self.command(program, arguments))
    }

    /// The relative paths, with `/`, of all files that people write, sorted.
    pub(crate) fn files(&self) -> Outcome<Vec<String>> {
        let mut files = Vec::new();
        let mut folders = vec![String::new()];
        while let Some(folder) = folders.pop() {
            let unreadable = |error| format!("the folder {folder:?} cannot be read: {error}");
            for entry in std::fs::read_dir(self.path(&folder)).map_err(unreadable)? {
                let entry = entry.map_err(unreadable)?;
                let name = entry.file_name().to_string_lossy().into_owned();
                let path = if folder.is_empty() { name.clone() } else { format!("{folder}/{name}") };
                if !entry.file_type().map_err(unreadable)?.is_dir() {
                    files.push(path);
                } else if !NOT_SOURCES.contains(&name.as_str()) {
                    folders.push(path);
                }
            }
        }
        files.sort();
        Ok(files)
    }

    /// The folders of the workspace's members, as listed in the root `Cargo.toml`.
    pub(crate) fn members(&self) -> Outcome<Vec<String>> {
        Ok(listed(&self.read("Cargo.toml")?, "members"))
    }
}

/// Runs a command with its output passed through; an exit code other than 0 is a failure.
pub(crate) fn finish(command: &mut Command) -> Outcome {
    let program = command.get_program().to_string_lossy().into_owned();
    let status = command.status().map_err(|error| format!("{program} cannot be started: {error}"))?;
    if status.success() {
        return Ok(());
    }
    let arguments: Vec<_> = command.get_args().map(|argument| argument.to_string_lossy()).collect();
    Err(format!("`{program} {}` failed ({status})", arguments.join(" ")))
}

/// `true` for a Rust source file.
pub(crate) fn is_rust(file: &str) -> bool {
    Path::new(file).extension().is_some_and(|extension| extension == "rs")
}

/// The strings of the array `key = [...]` in a `Cargo.toml`.
fn listed(manifest: &str, key: &str) -> Vec<String> {
    let start = format!("{key} = [");
    let Some(from) = manifest.lines().position(|line| line.starts_with(&start)) else { return Vec::new() };
    let array: String = manifest.lines().skip(from).take_while(|line| line.trim() != "]").collect();
    array.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The keys of the tables of `manifest` whose name `wanted` accepts: `a` and `b` for `a = 1` and `b.workspace = true`.
pub(crate) fn keys(manifest: &str, wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let mut inside = false;
    let mut keys = Vec::new();
    for line in manifest.lines().map(str::trim) {
        if let Some(table) = line.strip_prefix('[') {
            let table = table.trim_end_matches(']');
            inside = wanted(table);
            if let Some((parent, key)) = table.rsplit_once('.')
                && wanted(parent)
            {
                keys.push(key.to_owned());
            }
        } else if inside && !line.starts_with('#') {
            let key = line.split(['=', '.']).next().unwrap_or_default().trim();
            if !key.is_empty() {
                keys.push(key.to_owned());
            }
        }
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANIFEST: &str = r#"
[workspace]
members = [
    "crates/spec",
    "bench",
]
exclude = ["crates/nostd"]

[dependencies]
# not-this = "1"
stepdrive-spec.workspace = true
toml = { version = "1" }

[dependencies.serde]
workspace = true

[dev-dependencies]
proptest.workspace = true
"#;

    #[test]
    fn members_are_read_from_an_array_over_several_lines() {
        assert_eq!(listed(MANIFEST, "members"), ["crates/spec", "bench"]);
        assert!(listed(MANIFEST, "default-members").is_empty());
    }

    #[test]
    fn keys_of_a_table_are_found_in_each_way_of_writing_them() {
        assert_eq!(keys(MANIFEST, |table| table == "dependencies"), ["stepdrive-spec", "toml", "serde"]);
        assert_eq!(keys(MANIFEST, |table| table == "dev-dependencies"), ["proptest"]);
    }

    #[test]
    fn this_file_is_among_the_files_and_built_ones_are_not() {
        let files = Workspace::here().files().expect("the workspace is readable");
        assert!(files.iter().any(|file| file == "crates/xtask/src/workspace.rs"));
        assert!(!files.iter().any(|file| file.starts_with("target/")));
    }
}
