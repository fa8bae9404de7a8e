//! `stepdrive up` with `--api` and `--clock`.

use crate::bench::{Bench, THREE, ready, start};
use crate::up::{ONE, Place, Up, one_line};

#[test]
fn the_ready_line_says_where_the_rig_is_controlled_from() {
    let bench = Bench::start();
    assert!(bench.api().starts_with("http://127.0.0.1:"), "{}", bench.api());
    assert!(ready(&bench.up).get("recording").is_none());
    let without = Place::new();
    assert!(ready(&without.up()).get("api").is_none(), "nothing listens that was not asked for");
}

#[test]
fn the_api_of_the_command_line_counts() {
    let bench = Bench::with_options(ONE, &["--api", "127.0.0.1:0"]);
    assert_eq!(bench.json("status")["drives"][0]["name"], "stage");
    let bench = Bench::with_options(&THREE.replacen("127.0.0.1:0", "127.0.0.1:9", 1), &["--api", "[::1]:0"]);
    assert!(bench.api().starts_with("http://[::1]:"), "{}", bench.api());
    bench.rig("status").done();
}

#[test]
fn an_api_for_others_needs_a_token() {
    let line = one_line(&Place::new().run("up rig.toml --state state --api 0.0.0.0:0"), 1);
    assert!(
        line.contains("--api 0.0.0.0:0: others could control the rig") && line.contains("api_token"),
        "{line}"
    );
    let guarded = format!("[rig]\napi = \"127.0.0.1:0\"\napi_token = \"0123456789abcdef\"\n{ONE}");
    let bench = Bench::with_options(&guarded, &["--api", "0.0.0.0:0"]);
    assert!(bench.api().starts_with("http://127.0.0.1:"), "where it is reached from here: {}", bench.api());
    bench.rig("status --token 0123456789abcdef").done();
}

#[test]
fn the_clock_of_the_command_line_counts() {
    let bench = Bench::with_options(THREE, &["--clock", "x100"]);
    assert_eq!(bench.json("clock")["mode"], "x100");
    for (words, part) in [("--clock soon", "`soon` is unknown"), ("--clock x0", "0.01 to 1000000")] {
        let output = Place::new().run(&format!("up rig.toml --state state {words}"));
        let said = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn a_person_is_told_where_the_rig_is_controlled_from_and_how() {
    let place = Place::with(THREE);
    let words = ["up", "rig.toml", "--state", "state", "--record", "session.jsonl"];
    let mut up = Up::start(place.command().args(words));
    let welcome = up.welcome();
    let api = welcome.lines().find_map(|line| line.strip_prefix("Control API: ")).expect("an API").to_owned();
    assert!(welcome.contains("\nRecording: session.jsonl\n"), "{welcome}");
    for command in ["status", "watch"] {
        assert!(welcome.contains(&format!(" rig --api {api} {command}\n")), "{welcome}");
    }
    let shown = place.command().args(["rig", "--api", &api, "status"]).output().expect("started");
    assert!(shown.status.success());
    drop(start(&Place::new(), &[]));
}
