//! Help, version and the example.

use crate::bench::{Place, Up, text};
use std::fs;
use std::io::pipe;

#[test]
fn help_and_version_are_results() {
    let place = Place::new();
    for (words, part) in [
        ("--help", "Usage: stepdrive <COMMAND>"),
        ("-h", "Usage: stepdrive <COMMAND>"),
        ("help", "Usage: stepdrive <COMMAND>"),
        ("up --help", "Usage: stepdrive up [OPTIONS] [RIG]"),
        ("help up", "Usage: stepdrive up [OPTIONS] [RIG]"),
        ("--version", concat!("stepdrive ", env!("CARGO_PKG_VERSION"), "\n")),
    ] {
        let output = place.run(words);
        assert!(text(&output.stdout).contains(part), "{words}: {}", text(&output.stdout));
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{words}");
    }
}

#[test]
fn nothing_is_coloured_where_nobody_sees_it() {
    let place = Place::with("[[drive]]\nnam = \"stage\"\n");
    for words in ["--help", "up --jsn", "up rig.toml", "example-rig"] {
        let output = place.run(words);
        assert!(!output.stdout.contains(&0x1B) && !output.stderr.contains(&0x1B), "{words}");
    }
}

#[test]
fn the_example_rig_is_commented_and_comes_up() {
    let place = Place::new();
    let output = place.run("example-rig");
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()));
    let example = text(&output.stdout);
    assert!(example.starts_with("# ") && example.contains("\"127.0.0.1:5020\"  "), "{example}");
    // On free ports, since those in the example may be taken where this runs.
    fs::write(place.path("rig.toml"), example.replace(":5020", ":0").replace(":8087", ":0"))
        .expect("written");
    let output = place.up().end("TERM");
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()));
}

#[test]
fn a_reader_that_has_gone_is_no_failure() {
    let place = Place::new();
    let (reader, writer) = pipe().expect("a pipe");
    drop(reader);
    let output = place.command().arg("example-rig").stdout(writer).output().expect("started");
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()));
}

#[test]
fn a_stdout_that_cannot_be_written_is_a_failure() {
    let Ok(full) = fs::File::options().write(true).open("/dev/full") else { return };
    let place = Place::new();
    let output = place.command().arg("example-rig").stdout(full).output().expect("started");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).starts_with("stepdrive: cannot write to stdout: "));
}

#[test]
fn memory_lives_in_the_state_folder_of_the_platform_by_default() {
    let place = Place::new();
    Up::start(place.command().args(["up", "rig.toml", "--json"])).end("TERM");
    let folders: Vec<_> = fs::read_dir(place.path("xdg/stepdrive")).expect("made").collect();
    let [Ok(folder)] = &folders[..] else { panic!("one folder: {folders:?}") };
    assert!(folder.file_name().to_string_lossy().starts_with("rig-"));
    assert!(folder.path().join("memory.redb").is_file());
}
