//! `rig play`, headless and on a rig that runs.

use crate::bench::{Bench, Ran, THREE, until};
use crate::up::Place;
use expect_test::expect;
use std::fs;

const GOOD: &str = r#"
name = "a signal goes over the wire"

[[step]]
name = "relay on"
at = "1s"
do = ["write a.Relay 1"]
expect = "b.CONTINUE"
within = "10ms"

[[step]]
name = "cut"
do = ["wire a.relay b.CONTINUE cut"]
expect = "!b.CONTINUE"
within = "10ms"
"#;

/// A folder with the rig of three and a scenario for it.
fn place(scenario: &str) -> Place {
    let place = Place::with(THREE);
    fs::write(place.path("s.toml"), scenario).expect("written");
    place
}

fn headless(place: &Place, words: &str) -> Ran {
    Ran(place.run(&format!("rig play s.toml --headless {words}")))
}

/// A scenario that cannot pass.
fn bad() -> String {
    GOOD.replace(
        "within = \"10ms\"\n\n[[step]]\nname = \"cut\"",
        "within = \"4ms\"\n\n[[step]]\nname = \"cut\"",
    )
}

#[test]
fn a_scenario_that_passes_headless_is_exit_code_0() {
    let place = place(GOOD);
    expect![[r#"
        ✓ ok            1.005s  1. relay on
        ✓ ok            1.005s  2. cut
        passed: a signal goes over the wire, 2 of 2 steps ok, 1.005s of rig time
    "#]]
    .assert_eq(headless(&place, "--rig rig.toml").done());
    let json: serde_json::Value =
        serde_json::from_str(headless(&place, "--rig rig.toml --json").done()).expect("JSON");
    assert_eq!((&json["passed"], &json["steps"][0]["outcome"]), (&true.into(), &"passed".into()));
    assert_eq!(json["steps"][0]["ended_ns"], 1_005_000_000_u64, "to the nanosecond");
}

#[test]
fn a_scenario_that_fails_is_exit_code_11_and_junit_says_which_step() {
    let place = place(&bad());
    let ran = headless(&place, "--rig rig.toml --junit result.xml");
    assert_eq!((ran.code(), ran.stderr()), (11, "stepdrive: s.toml: the scenario did not pass\n".to_owned()));
    assert!(
        ran.stdout().contains("FAILED: a signal goes over the wire, 0 of 2 steps ok"),
        "{}",
        ran.stdout()
    );
    let xml = fs::read_to_string(place.path("result.xml")).expect("written");
    assert!(xml.contains("tests=\"2\" failures=\"1\" errors=\"0\" skipped=\"1\""), "{xml}");
    assert!(xml.contains("name=\"1. relay on\"") && xml.contains("<failure message="), "{xml}");
    let ran = headless(&place, "--rig rig.toml --json");
    let json: serde_json::Value = serde_json::from_str(ran.stdout()).expect("JSON");
    assert_eq!((ran.code(), &json["passed"]), (11, &false.into()));
}

#[test]
fn a_mistake_in_a_scenario_is_exit_code_1_and_its_place() {
    let mistaken = GOOD.replace("b.CONTINUE\"\nwithin = \"10ms\"\n\n", "b.CONTINEU\"\nwithin = \"10ms\"\n\n");
    let place = place(&mistaken);
    let ran = headless(&place, "--rig rig.toml --junit result.xml");
    assert_eq!((ran.code(), ran.stdout()), (1, ""));
    expect![[r#"
        stepdrive: s.toml:8:13: unknown quantity `CONTINEU` of `b`; did you mean CONTINUE?
          |
        8 | expect = "b.CONTINEU"
          |             ^^^^^^^^
    "#]]
    .assert_eq(&ran.stderr());
    assert!(!place.path("result.xml").exists());
}

#[test]
fn the_rig_of_a_scenario_is_looked_for_beside_it() {
    let place = place(&format!("rig = \"other.toml\"\n{GOOD}"));
    fs::create_dir(place.path("tests")).expect("made");
    fs::rename(place.path("s.toml"), place.path("tests/s.toml")).expect("moved");
    let said = Ran(place.run("rig play tests/s.toml --headless")).refused(1);
    assert!(said.starts_with("cannot read the rig file tests/other.toml: "), "{said}");
    fs::rename(place.path("rig.toml"), place.path("tests/other.toml")).expect("moved");
    Ran(place.run("rig play tests/s.toml --headless")).done();
}

#[test]
fn a_scenario_without_a_rig_is_played_on_the_demo_rig() {
    let place = place(
        "name = \"a way\"\n[[step]]\ndo = [\"command stage RUN_F 100\"]\nexpect = \"stage.ABS_POS >= 1600\"\nwithin = \"2s\"\n",
    );
    headless(&place, "").done();
}

#[test]
fn files_that_are_not_there_or_cannot_be_written_are_told() {
    let place = place(GOOD);
    let said = Ran(place.run("rig play nowhere.toml")).refused(1);
    assert!(said.starts_with("cannot read the scenario nowhere.toml: "), "{said}");
    let ran = headless(&place, "--rig rig.toml --junit nowhere/result.xml");
    assert_eq!(ran.code(), 2);
    assert!(ran.stderr().contains("cannot write nowhere/result.xml"), "{}", ran.stderr());
    let said = headless(&place, "--rig rig.toml --record rig.toml").refused(2);
    assert!(said.starts_with("cannot record to rig.toml: "), "{said}");
}

#[test]
fn a_headless_run_that_was_recorded_is_replayed_identically() {
    let place = place(GOOD);
    headless(&place, "--rig rig.toml --record run.jsonl").done();
    let ran = Ran(place.run("replay run.jsonl"));
    assert!(ran.done().contains("every reply and the state at the end are identical"), "{}", ran.stdout());
}

#[test]
fn a_scenario_is_played_on_the_rig_that_runs() {
    let bench = Bench::with(&THREE.replace("\"paused\"", "\"x1000\""));
    fs::write(bench.place.path("s.toml"), GOOD).expect("written");
    let ran = bench.rig("play s.toml --junit result.xml");
    assert_eq!(ran.code(), 0, "{}{}", ran.stdout(), ran.stderr());
    assert!(ran.stdout().ends_with("2 of 2 steps ok, 1.005s of rig time\n"), "{}", ran.stdout());
    assert!(
        ran.stderr().contains("1. relay on") && ran.stderr().contains("2. cut"),
        "live: {}",
        ran.stderr()
    );
    assert!(fs::read_to_string(bench.place.path("result.xml")).expect("written").contains("failures=\"0\""));
    fs::write(bench.place.path("s.toml"), bad()).expect("written");
    bench.rig("do 'wire a.relay b.CONTINUE mend' 'power a off' 'power a on'").done();
    let ran = bench.rig("play s.toml --json");
    let json: serde_json::Value = serde_json::from_str(ran.stdout()).expect("JSON");
    assert_eq!((ran.code(), &json["passed"]), (11, &false.into()), "{}", ran.stderr());
}

#[test]
fn a_mistake_is_shown_alike_by_a_rig_that_runs() {
    let bench = Bench::start();
    let mistaken = GOOD.replace("at = \"1s\"", "at = \"1\"");
    fs::write(bench.place.path("s.toml"), mistaken).expect("written");
    let (live, alone) = (bench.rig("play s.toml"), headless(&bench.place, "--rig rig.toml"));
    assert_eq!((live.code(), alone.code()), (1, 1), "{}", live.stderr());
    let first = |ran: &Ran| ran.stderr().lines().next().expect("a line").to_owned();
    assert_eq!(first(&live), first(&alone));
    assert!(first(&live).starts_with("stepdrive: s.toml:6:"), "{}", first(&live));
}

#[test]
fn a_rig_that_ends_before_the_scenario_is_exit_code_2() {
    let bench = Bench::start();
    // Time stands still, so that the first step never comes.
    fs::write(bench.place.path("s.toml"), GOOD).expect("written");
    let playing = bench.command().args(["play", "s.toml"]).spawn().expect("started");
    until(|| bench.json("status")["playing"] == "a signal goes over the wire");
    let said = bench.rig("play s.toml").refused(2);
    assert!(said.contains("is being played"), "{said}");
    bench.up.end("TERM");
    let ran = Ran(playing.wait_with_output().expect("ended"));
    assert_eq!(ran.code(), 2, "{}", ran.stdout());
    assert!(ran.stderr().contains("ended before the scenario did"), "{}", ran.stderr());
}
