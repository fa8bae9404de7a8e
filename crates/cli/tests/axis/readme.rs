//! README's first five minutes: every command is typed, and shows what stands there.

use crate::rig::Bench;
use crate::up::text;
use std::env;
use std::fs;
use std::net::SocketAddr;
use std::path::Path;
use std::process::Command;

/// The heading under which they stand.
const HEADING: &str = "## The first five minutes\n";

/// Where the demo rig's stage listens.
const DEMO: &str = "127.0.0.1:5020";

/// A command of a console, and the lines that it shows.
#[derive(Debug, Default)]
struct Step {
    command: String,
    shown: Vec<String>,
}

/// The commands of the section's consoles, in their order. A line after `> ` goes on with its command.
fn steps(readme: &str) -> Vec<Step> {
    let section = readme.split_once(HEADING).expect("README has the section").1;
    let section = section.split_once("\n## ").map_or(section, |(section, _)| section);
    let mut steps: Vec<Step> = Vec::new();
    for console in section.split("```console\n").skip(1) {
        for line in console.split_once("```").expect("its end").0.lines() {
            match (line.strip_prefix("$ "), line.strip_prefix("> "), steps.last_mut()) {
                (Some(command), ..) => {
                    steps.push(Step { command: command.to_owned(), shown: Vec::new() });
                }
                (None, Some(more), Some(step)) => step.command = format!("{}\n{more}", step.command),
                (None, None, Some(step)) => step.shown.push(line.to_owned()),
                (None, _, None) => panic!("`{line}` belongs to no command"),
            }
        }
    }
    steps
}

/// Types a command where a person would be, and answers what is shown, with the demo rig's address.
fn typed(bench: &Bench, at: SocketAddr, command: &str) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_stepdrive")).parent().expect("a folder");
    let path = env::join_paths([program.to_owned()].into_iter().chain(search_path())).expect("a search path");
    let script = format!("{{\n{}\n}} 2>&1", command.replace(DEMO, &at.to_string()));
    let output = Command::new("sh")
        .args(["-c", &script])
        .current_dir(bench.place.path("."))
        .env("PATH", path)
        .env("HOME", bench.place.path("."))
        .env("XDG_STATE_HOME", bench.place.path("xdg"))
        .output()
        .expect("a shell is there");
    text(&output.stdout).replace(&at.to_string(), DEMO)
}

fn search_path() -> Vec<std::path::PathBuf> {
    env::var_os("PATH").map_or(Vec::new(), |path| env::split_paths(&path).collect())
}

/// Whether lines are as they stand in README, where `...` stands for any.
fn is_as_shown(lines: &[&str], shown: &[String]) -> bool {
    match (lines, shown) {
        ([], []) => true,
        (_, [any, rest @ ..]) if any == "..." => {
            (0..=lines.len()).any(|from| is_as_shown(&lines[from..], rest))
        }
        ([line, lines @ ..], [first, shown @ ..]) => {
            without_rows(line) == without_rows(first) && is_as_shown(lines, shown)
        }
        ([], [..]) | ([..], []) => false,
    }
}

/// A line without the number of rows: a computer that is busy leaves some out.
fn without_rows(line: &str) -> String {
    let line = line.split_once("; ").filter(|_| line.contains(" left out")).map_or(line, |(line, _)| line);
    let words: Vec<&str> = line.split(' ').collect();
    let is_count = |place: usize| words.get(place + 1) == Some(&"rows");
    let kept = words.iter().enumerate().map(|(place, word)| if is_count(place) { "N" } else { word });
    kept.collect::<Vec<&str>>().join(" ")
}

#[test]
fn every_command_of_the_first_five_minutes_shows_what_stands_there() {
    let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../README.md");
    let steps = steps(&fs::read_to_string(readme).expect("README is there"));
    let rig = stepdrive_rig::file::DEMO.replace("\"127.0.0.1:8087\"", "\"127.0.0.1:0\"");
    let bench = Bench::with(&rig.replace(DEMO, "127.0.0.1:0"));
    let at = bench.address(0);
    // It is built, and a rig is up.
    let (before, steps): (Vec<Step>, Vec<Step>) = steps
        .into_iter()
        .partition(|step| step.command.starts_with("cargo ") || step.command == "stepdrive up");
    assert_eq!(before.len(), 2, "{before:?}");
    assert!(steps.len() > 5, "{steps:?}");
    for step in steps {
        let said = typed(&bench, at, &step.command);
        let lines: Vec<&str> = said.lines().collect();
        assert!(
            is_as_shown(&lines, &step.shown),
            "{}\nshows\n{said}\nand not\n{:#?}",
            step.command,
            step.shown
        );
    }
    assert!(bench.place.path("run.png").exists());
}
