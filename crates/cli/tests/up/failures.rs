//! What goes wrong at the start: an exit code, one line, and nothing on stdout.

use crate::bench::{ONE, Place, one_line, text};
use expect_test::expect;
use std::fs;
use std::net::TcpListener;

#[test]
fn wrong_arguments_are_told_with_exit_code_1() {
    let place = Place::new();
    for words in ["", "upp", "up --jsn", "up a.toml b.toml", "example-rig rig.toml", "up --state"] {
        let output = place.run(words);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(1), String::new()), "`{words}`");
        assert!(!output.stderr.is_empty(), "`{words}`");
    }
    assert!(text(&place.run("up --jsn").stderr).contains("'--json'"), "what may have been meant");
}

#[test]
fn a_rig_file_that_is_not_there_is_told_with_exit_code_1() {
    let line = one_line(&Place::new().run("up nowhere.toml"), 1);
    assert!(line.starts_with("stepdrive: cannot read the rig file nowhere.toml: No such file"), "{line}");
}

#[test]
fn a_rig_file_that_is_no_text_is_told_with_exit_code_1() {
    let place = Place::new();
    fs::write(place.path("rig.toml"), [0xFF, 0xFE, 0]).expect("written");
    one_line(&place.run("up rig.toml"), 1);
    fs::create_dir(place.path("folder")).expect("made");
    one_line(&place.run("up folder"), 1);
}

#[test]
fn a_mistake_in_a_rig_file_is_told_with_its_place_and_exit_code_1() {
    let output = Place::with(&format!("{ONE}[drive.motor]\nsteps = 200\n")).run("up rig.toml");
    assert_eq!((output.status.code(), text(&output.stdout)), (Some(1), String::new()));
    expect![[r#"
        stepdrive: rig.toml:6:1: unknown field `steps`, expected `steps_per_rev`
          |
        6 | steps = 200
          | ^^^^^
    "#]]
    .assert_eq(&text(&output.stderr));
}

#[test]
fn a_mistake_in_a_rig_file_makes_no_state_folder() {
    let place = Place::with("[[drive]]\n");
    assert_eq!(place.run("up rig.toml --state state").status.code(), Some(1));
    assert!(!place.path("state").exists());
}

#[test]
fn an_occupied_port_is_told_with_exit_code_2() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("bound").to_string();
    let place = Place::with(&ONE.replace("127.0.0.1:0", &address));
    let line = one_line(&place.run("up rig.toml --json"), 2);
    assert!(line.starts_with(&format!("stepdrive: stage: cannot listen on {address}: ")), "{line}");
    assert!(line.contains("in use") && line.contains("choose another port"), "{line}");
}

#[test]
fn a_state_folder_that_cannot_be_written_is_told_with_exit_code_2() {
    let line = one_line(&Place::new().run("up rig.toml --state rig.toml/state"), 2);
    assert!(line.starts_with("stepdrive: the state folder rig.toml/state cannot be used: "), "{line}");
}

#[test]
fn a_state_folder_in_use_is_told_with_exit_code_2() {
    let place = Place::new();
    let up = place.up();
    let line = one_line(&place.run("up rig.toml --state state"), 2);
    assert!(line.starts_with("stepdrive: state/memory.redb is in use by another stepdrive"), "{line}");
    up.end("TERM");
    place.up().end("TERM");
}

#[test]
fn a_damaged_memory_is_told_with_exit_code_2_and_kept() {
    let place = Place::new();
    place.up().end("TERM");
    let intact = fs::read(place.memory()).expect("readable");
    // Where the damage is harmless, the port is what stops the rig from coming up.
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("bound").to_string();
    fs::write(place.path("rig.toml"), ONE.replace("127.0.0.1:0", &address)).expect("written");
    let used = (0..intact.len()).filter(|at| intact[*at] != 0);
    let mut found = 0;
    for at in used.step_by(701) {
        let mut bytes = intact.clone();
        bytes[at] ^= 0xFF;
        fs::write(place.memory(), &bytes).expect("written");
        let line = one_line(&place.run("up rig.toml --state state"), 2);
        if line.contains("state/memory.redb is damaged") {
            assert!(fs::read(place.memory()).expect("readable") == bytes, "byte {at}: the file was changed");
            found += 1;
        } else {
            assert!(line.contains("cannot listen"), "byte {at}: {line}");
        }
    }
    assert!(found > 0);
}
