//! `stepdrive completions` and `stepdrive man`.

use crate::rig::Ran;
use crate::up::Place;
use serde_json::Value;
use std::fs;
use std::io::Write as _;
use std::process::{Command, Stdio};

/// The commands that `stepdrive --help` lists.
fn commands(place: &Place) -> Vec<String> {
    let help = Ran(place.run("--help"));
    let listed =
        help.done().split_once("Commands:\n").expect("a list").1.split_once("\n\n").expect("an end").0;
    let names = listed.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    names.filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect()
}

#[test]
fn every_shell_is_told_every_command() {
    let place = Place::new();
    let commands = commands(&place);
    assert!(commands.len() > 8 && commands.contains(&"plot".to_owned()), "{commands:?}");
    for shell in ["bash", "zsh", "fish"] {
        let ran = Ran(place.run(&format!("completions {shell}")));
        let script = ran.done();
        for command in &commands {
            let word = |text: &str| {
                text.split(|c: char| !(c.is_alphanumeric() || c == '-')).any(|word| word == command)
            };
            assert!(word(script), "{shell} is not told of {command}");
        }
    }
}

#[test]
fn bash_takes_the_script() {
    let place = Place::new();
    let ran = Ran(place.run("completions bash"));
    let mut bash = Command::new("bash").arg("-n").stdin(Stdio::piped()).spawn().expect("bash is there");
    bash.stdin.take().expect("a pipe").write_all(ran.done().as_bytes()).expect("written");
    assert!(bash.wait().expect("it ends").success());
}

#[test]
fn a_shell_that_is_unknown_is_refused() {
    let ran = Ran(Place::new().run("completions tcsh"));
    assert_eq!((ran.code(), ran.stdout()), (1, ""));
    assert!(ran.stderr().contains("tcsh") && ran.stderr().contains("fish"), "{}", ran.stderr());
}

#[test]
fn every_command_has_a_page() {
    let place = Place::new();
    let ran = Ran(place.run("man pages/man1 --json"));
    let told: Value = serde_json::from_str(ran.done()).expect("JSON");
    let pages: Vec<&str> =
        told["pages"].as_array().expect("a list").iter().filter_map(Value::as_str).collect();
    assert!(pages.contains(&"stepdrive.1") && pages.contains(&"stepdrive-rig-clock.1"), "{pages:?}");
    for command in commands(&place).iter().filter(|command| *command != "help") {
        let page = format!("stepdrive-{command}.1");
        assert!(pages.contains(&page.as_str()), "{page}");
        let text = fs::read_to_string(place.path("pages/man1").join(&page)).expect("written");
        assert!(text.contains(".SH SYNOPSIS") && text.contains(".SH DESCRIPTION"), "{page}");
    }
    let written = fs::read_dir(place.path("pages/man1")).expect("a folder").count();
    assert_eq!(written, pages.len());
}

#[test]
fn a_folder_that_cannot_be_made_is_told() {
    let place = Place::new();
    fs::write(place.path("taken"), "").expect("written");
    let told = Ran(place.run("man taken")).refused(2);
    assert!(told.starts_with("cannot write taken: "), "{told}");
}
