//! `rig watch`.

use crate::bench::{Bench, seen, terminal};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command};

/// A `rig watch` that runs.
struct Watch {
    child: Child,
    stdout: BufReader<ChildStdout>,
}

impl Watch {
    fn start(bench: &Bench, words: &str) -> Watch {
        let mut command = bench.command();
        let mut child = command.arg("watch").args(words.split_whitespace()).spawn().expect("started");
        let stdout = BufReader::new(child.stdout.take().expect("piped"));
        Watch { child, stdout }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        assert_ne!(self.stdout.read_line(&mut line).expect("readable"), 0, "it has ended");
        line
    }

    /// Reads on to a line with this in it.
    fn line_with(&mut self, part: &str) -> String {
        loop {
            let line = self.line();
            if line.contains(part) {
                return line;
            }
        }
    }

    /// Sends it a signal, and says its exit code and what it said on stderr.
    fn end(self, signal: &str) -> (Option<i32>, String) {
        let sent = Command::new("kill").args([format!("-{signal}"), self.child.id().to_string()]).status();
        assert!(sent.expect("there is a `kill`").success());
        self.wait()
    }

    fn wait(self) -> (Option<i32>, String) {
        let output = self.child.wait_with_output().expect("ended");
        (output.status.code(), String::from_utf8(output.stderr).expect("text"))
    }
}

#[test]
fn without_a_terminal_there_is_a_line_for_each_change() {
    let bench = Bench::start();
    let mut watch = Watch::start(&bench, "--every 20ms");
    let first: Vec<String> = (0..6).map(|_| watch.line()).collect();
    assert!(first[0].ends_with("  clock paused\n"), "{first:?}");
    for (line, name) in first[2..].iter().zip(["a", "b", "u", "a.relay b.CONTINUE"]) {
        assert!(line.starts_with("     0.000000  ") && line.contains(&format!("  {name}  ")), "{line}");
    }
    bench.rig("clock step 1.5s").done();
    bench.rig("input b.IN0 1").done();
    let line = watch.line_with("IN0=1 forced");
    assert!(line.starts_with("     1.500000  b  ") && !line.contains('\x1b'), "{line}");
    assert_eq!(watch.end("INT"), (Some(0), String::new()));
}

#[test]
fn as_json_there_is_a_state_a_line() {
    let bench = Bench::start();
    let mut watch = Watch::start(&bench, "--json --every 20ms");
    let read = |line: String| serde_json::from_str::<Value>(&line).expect("JSON");
    assert_eq!(read(watch.line())["drives"][0]["name"], "a");
    bench.rig("power b off").done();
    assert_eq!(read(watch.line_with("\"powered\":false"))["drives"][1]["powered"], false);
    assert_eq!(watch.end("TERM"), (Some(0), String::new()));
}

#[test]
fn a_rig_that_ends_is_told_with_exit_code_2() {
    let bench = Bench::start();
    let api = bench.api().to_owned();
    let mut watch = Watch::start(&bench, "");
    watch.line();
    bench.up.end("TERM");
    assert_eq!(watch.wait(), (Some(2), format!("stepdrive: the rig at {api} has ended\n")));
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let bench = Bench::start();
    let mut watch = Watch::start(&bench, "--every 20ms");
    watch.line();
    drop(std::mem::replace(&mut watch.stdout, BufReader::new(spare())));
    bench.rig("input a.IN0 1").done();
    assert_eq!(watch.wait(), (Some(0), String::new()));
}

/// A stdout of something else, to have one.
fn spare() -> ChildStdout {
    let mut child = Command::new("true").stdout(std::process::Stdio::piped()).spawn().expect("started");
    let stdout = child.stdout.take().expect("piped");
    child.wait().expect("ended");
    stdout
}

#[test]
fn at_a_terminal_it_is_redrawn_in_place_and_leaves_the_cursor_as_it_was() {
    let bench = Bench::start();
    let (program, mut person) = terminal(40, 8);
    let mut command = bench.command();
    let mut child = command.args(["watch", "--every", "20ms"]).stdout(program).spawn().expect("started");
    drop(command);
    let mut text = String::new();
    seen(&mut person, &mut text, "\x1b[J");
    assert!(text.starts_with("\x1b[?25lclock paused, rig time 0s"), "{text:?}");
    assert!(text.contains("\x1b[1mDRIVE ") && text.contains("and 3 lines more"), "{text:?}");
    let too_long = |line: &str| line.replace("\x1b[1m", "").chars().take_while(|c| *c != '\x1b').count() > 40;
    assert!(!text.lines().any(too_long), "{text:?}");
    bench.rig("power a off").done();
    seen(&mut person, &mut text, "\x1b[31ma ");
    assert!(text.contains("\x1b[7A\rclock paused"), "seven lines up: {text:?}");
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.expect("there is a `kill`").success());
    seen(&mut person, &mut text, "\x1b[?25h");
    assert_eq!(child.wait().expect("ended").code(), Some(0));
}

#[test]
fn no_colour_is_shown_to_who_wants_none() {
    let bench = Bench::start();
    bench.rig("power a off").done();
    let (program, mut person) = terminal(120, 30);
    let mut command = bench.command();
    let mut child = command.arg("watch").env("NO_COLOR", "1").stdout(program).spawn().expect("started");
    drop(command);
    let mut text = String::new();
    seen(&mut person, &mut text, "\x1b[J");
    assert!(text.contains("no power") && !text.contains("\x1b[1m") && !text.contains("\x1b[31m"), "{text:?}");
    child.kill().and_then(|()| child.wait()).expect("ended");
}

#[test]
fn an_interval_that_is_none_is_exit_code_1() {
    let bench = Bench::start();
    for (words, part) in [("--every 5", "the unit is missing"), ("--every 1ms", "20ms")] {
        let said = bench.rig(&format!("watch {words}")).refused(1);
        assert!(said.contains(part), "{said}");
    }
}
