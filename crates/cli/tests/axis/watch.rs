//! `watch`.

use crate::bench::{Bench, keys};
use serde_json::{Value, json};

#[test]
fn without_a_terminal_there_is_a_line_for_each_change_of_all_axes() {
    let bench = Bench::start();
    bench.make_ready();
    let mut running = bench.start_command("watch --every 10ms");
    let mut lines = running.lines();
    let first: Vec<String> = lines.by_ref().take(2).collect();
    assert!(
        first.iter().any(|line| line.ends_with("  stage  0mm  trusted  stands, energised  none")),
        "{first:?}"
    );
    assert!(
        first.iter().any(|line| line.ends_with("  uhv  0 turns  trusted  stands, energised  none")),
        "{first:?}"
    );
    bench.run("move -a stage to 5mm").done();
    let there = lines.find(|line| line.ends_with("  stage  5mm  trusted  stands, energised  none"));
    assert!(there.is_some_and(|line| !line.contains('\x1b')));
    running.signal("INT");
    assert_eq!(running.end().code(), 0);
    assert_eq!(bench.json("status -a stage")["trust"], "trusted", "who only looks spoils nothing");
}

#[test]
fn as_json_there_is_a_line_for_each_look() {
    let bench = Bench::start();
    let mut running = bench.start_command("watch stage --every 20ms --json");
    let seen: Vec<Value> =
        running.lines().take(3).map(|line| serde_json::from_str(&line).expect("JSON")).collect();
    assert!(seen.iter().all(|state| state["axis"] == "stage" && state["position_mm"] == 0.0), "{seen:?}");
    assert!(
        keys(&seen[0]).contains(&"time_s") && seen[1]["time_s"].as_f64() > seen[0]["time_s"].as_f64(),
        "{seen:?}"
    );
}

#[test]
fn an_axis_that_is_lost_on_the_way_is_shown_so_and_comes_back() {
    let bench = Bench::start();
    let mut running = bench.start_command("watch -a uhv --every 20ms --json --reply-timeout 100ms");
    let mut lines = running.lines().map(|line| serde_json::from_str::<Value>(&line).expect("JSON"));
    assert_eq!(lines.next().expect("a line")["trust"], "unknown");
    bench.rig.rig("fault uhv.connection silent").done();
    let lost = lines.find(|state| state["error"].is_string()).expect("it is lost");
    assert_eq!((keys(&lost), &lost["axis"]), (vec!["axis", "error", "time_s"], &json!("uhv")));
    bench.rig.rig("fault uhv.connection off").done();
    lines.find(|state| state["position_turns"] == 0.0).expect("it is back");
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let bench = Bench::start();
    let mut running = bench.start_command("watch stage --every 10ms --json");
    assert!(running.lines().next().is_some());
    assert_eq!(running.end().code(), 0);
}
