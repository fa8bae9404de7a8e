//! What a person at a terminal sees: the bar of a move, and the table of `watch`.

use crate::bench::Bench;
use crate::rig::{seen, terminal, until};
use std::process::Command;

#[test]
fn a_move_has_a_bar_that_is_gone_in_the_end_and_no_result_on_stderr() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    let (program, mut person) = terminal(100, 20);
    let mut command = bench.command("move -a stage to 10mm --speed 8mm/s");
    let child = command.stderr(program).spawn().expect("started");
    drop(command);
    let mut text = String::new();
    seen(&mut person, &mut text, "\r\x1b[K");
    let output = child.wait_with_output().expect("ended");
    assert_eq!(String::from_utf8_lossy(&output.stdout), "stage is at 10mm (400 full steps), trusted\n");
    assert!(text.starts_with("\rmoving to 10mm [") && text.contains(" %\x1b[K"), "{text:?}");
    let shares: Vec<u32> =
        text.split(" %").filter_map(|part| part.rsplit(' ').next()?.parse().ok()).collect();
    assert!(shares.len() > 2 && shares.is_sorted(), "{shares:?}");
}

#[test]
fn a_bake_has_a_bar_as_well() {
    let bench = Bench::start();
    let (program, mut person) = terminal(100, 20);
    let mut command = bench.command("bake 50 -a uhv --for 600ms");
    let mut child = command.stderr(program).spawn().expect("started");
    drop(command);
    let mut text = String::new();
    seen(&mut person, &mut text, "\r\x1b[K");
    assert!(child.wait().expect("ended").success());
    assert!(text.starts_with("\rbaking uhv ["), "{text:?}");
}

/// `stepdrive watch` at a terminal, and what it showed until `part` came.
fn watched(bench: &Bench, size: (u16, u16), colour: bool, part: &str) -> String {
    let (program, mut person) = terminal(size.0, size.1);
    let mut command = bench.command("watch --every 20ms");
    if !colour {
        command.env("NO_COLOR", "1");
    }
    let mut child = command.stdout(program).spawn().expect("started");
    drop(command);
    let mut text = String::new();
    seen(&mut person, &mut text, part);
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.expect("there is a `kill`").success());
    seen(&mut person, &mut text, "\x1b[?25h");
    assert_eq!(child.wait().expect("ended").code(), Some(0));
    text
}

#[test]
fn watch_redraws_a_table_in_place_and_leaves_the_cursor_as_it_was() {
    let bench = Bench::start();
    bench.make_ready();
    bench.run("stop -a uhv --hard").done();
    let text = watched(&bench, (120, 24), true, "\x1b[3A\r");
    assert!(text.starts_with("\x1b[?25l\x1b[1mAXIS "), "{text:?}");
    assert!(
        text.contains("\x1b[31muhv ") && text.contains("EMERGENCY STOP"),
        "what is wrong is red: {text:?}"
    );
    assert!(text.contains("\nstage       0mm  trusted"), "{text:?}");
}

#[test]
fn watch_stays_within_the_terminal_and_without_colour_where_none_is_wanted() {
    let bench = Bench::start();
    let text = watched(&bench, (20, 24), false, "\x1b[3A\r");
    assert!(!text.contains("\x1b[1m") && !text.contains("\x1b[31m"), "{text:?}");
    let longest =
        text.lines().map(|line| line.split("\x1b[K").next().unwrap_or("").rsplit('\r').next().unwrap_or(""));
    assert!(longest.map(|line| line.replace("\x1b[?25l", "").chars().count()).max() <= Some(20), "{text:?}");
}

#[test]
fn watch_shows_that_another_command_has_homed_the_axis() {
    let bench = Bench::start();
    let mut running = bench.start_command("watch stage --every 10ms");
    let mut lines = running.lines();
    assert!(lines.next().is_some_and(|line| line.contains("unknown: the axis has not been homed")));
    bench.run("home -a stage").done();
    assert!(lines.any(|line| line.ends_with("  stage  0mm  trusted  stands, energised  none")));
    running.signal("INT");
    assert_eq!(running.end().code(), 0);
    until(|| bench.json("status -a stage")["trust"] == "trusted");
}
