//! Replays the stored corpus of every fuzz target.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use stepdrive_fuzz::TARGETS;

#[test]
fn every_file_of_every_corpus_passes_its_target() {
    for (name, target) in TARGETS {
        let files = entries(&folder("corpus").join(name));
        assert!(!files.is_empty(), "corpus/{name} is empty");
        for file in files {
            let data = fs::read(&file).expect("a readable file");
            // The harness shows what was printed only when the target panics.
            println!("{}", file.display());
            target(&data);
        }
    }
}

#[test]
fn corpus_folders_and_fuzz_programs_are_those_of_the_targets() {
    let targets: BTreeSet<String> = TARGETS.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(stems("corpus"), targets);
    assert_eq!(stems("fuzz_targets"), targets);
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// The paths in a folder, in the order of their names.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let read = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<PathBuf> = read.map(|entry| entry.expect("a readable entry").path()).collect();
    paths.sort();
    paths
}

/// The names in a folder without their extensions.
fn stems(name: &str) -> BTreeSet<String> {
    let stem = |path: &PathBuf| path.file_stem().expect("a name").to_string_lossy().into_owned();
    entries(&folder(name)).iter().map(stem).collect()
}
