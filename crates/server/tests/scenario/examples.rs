//! The scenarios among the examples.

use std::fs;
use std::path::{Path, PathBuf};
use stepdrive_rig::file::{DEMO, RigFile};
use stepdrive_server::scenario::{Scenario, run_headless};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/scenarios")
}

/// Each scenario with its text and its rig.
fn all() -> Vec<(String, String, RigFile)> {
    let files = fs::read_dir(folder()).expect("the examples").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> =
        files.filter(|file| !file.to_string_lossy().ends_with("-rig.toml")).collect();
    files.sort();
    let read = |file: PathBuf| {
        let text = fs::read_to_string(&file).expect("a scenario");
        let rig = match Scenario::rig_named(&text).expect("well formed") {
            Some(rig) => fs::read_to_string(folder().join(rig)).expect("its rig"),
            None => DEMO.to_owned(),
        };
        let name = file.file_name().expect("a file").to_string_lossy().into_owned();
        (name, text, RigFile::parse(&rig).expect("a rig"))
    };
    files.into_iter().map(read).collect()
}

#[test]
fn every_example_passes() {
    let all = all();
    assert!(all.len() >= 3);
    for (file, text, rig) in all {
        let scenario =
            Scenario::parse(&text, &rig).unwrap_or_else(|mistake| panic!("{}", mistake.render(&file)));
        let report = run_headless(&rig, &scenario);
        println!("{report}\n");
        assert!(report.passed, "{file}:\n{report}");
    }
}
