//! `stepdrive up --record` and `stepdrive replay`.

use crate::bench::{Bench, Ran, THREE, ready, start, until};
use crate::up::{Place, one_line};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::process::Stdio;
use stepdrive_spec::smsd::registers::Reg;

/// A rig of both families that is recorded, on a clock that runs.
fn recorded() -> Bench {
    Bench::with_options(THREE, &["--record", "session.jsonl", "--clock", "x100"])
}

/// Two clients of both families, signals and faults.
fn traffic(bench: &Bench) {
    let (mut a, mut b) = (bench.client(0), bench.client(1));
    a.write(Reg::TargetSpeed, &[200, 0, 0, 0, 0x0E]).expect("answered").expect("runs");
    bench.rig("input a.IN0 pulse 5ms x20 every 10ms").done();
    a.set(Reg::Relay, true).expect("answered").expect("accepted");
    b.write(Reg::WorkCurrent, &[42]).expect("answered").expect("accepted");
    let mut line = TcpStream::connect(bench.address(2)).expect("reachable");
    let mut replies = BufReader::new(line.try_clone().expect("a second handle"));
    for request in ["MODE,2", "RUNR,500", "PACT", "TMOT", "NONSENSE"] {
        line.write_all(format!("{request}\r\n").as_bytes()).expect("sent");
        replies.read_line(&mut String::new()).expect("answered");
    }
    bench.rig("do 'fault u.thermocouple open for 1s' 'wire a.relay b.CONTINUE cut'").done();
    for _ in 0..50 {
        a.read(Reg::HwMajor, 1).expect("answered").expect("readable");
    }
    bench.rig("power a off for 10ms").done();
}

fn replay(place: &Place, words: &str) -> Ran {
    Ran(place.run(&format!("replay {words}")))
}

fn replayed(place: &Place, words: &str) -> (i32, Value) {
    let ran = replay(place, &format!("{words} --json"));
    (ran.code(), serde_json::from_str(ran.stdout()).unwrap_or_else(|_| panic!("{}", ran.stderr())))
}

#[test]
fn what_was_recorded_is_replayed_identically_and_always_with_the_same_digest() {
    let Bench { place, up, .. } = {
        let bench = recorded();
        assert_eq!(ready(&bench.up)["recording"], "session.jsonl");
        traffic(&bench);
        bench
    };
    assert_eq!(up.end("TERM").status.code(), Some(0));
    let ran = replay(&place, "session.jsonl");
    assert!(ran.done().contains("every reply and the state at the end are identical"), "{}", ran.stdout());
    let (code, first) = replayed(&place, "session.jsonl");
    assert_eq!((code, &first["identical"], &first["cut_short"]), (0, &true.into(), &false.into()));
    assert!(first["requests"].as_u64().expect("a number") > 50, "{first}");
    assert!(ran.stdout().contains(first["digest"].as_str().expect("a digest")));
    let stdin = fs::File::open(place.path("session.jsonl")).expect("there");
    let output = place.command().args(["replay", "-", "--json"]).stdin(Stdio::from(stdin)).output();
    let again: Value = serde_json::from_slice(&output.expect("started").stdout).expect("JSON");
    assert_eq!(again, first);
}

#[test]
fn what_was_recorded_before_a_kill_can_be_replayed() {
    let bench = recorded();
    traffic(&bench);
    let file = bench.place.path("session.jsonl");
    // What happened is in the file a moment later.
    until(|| fs::read_to_string(&file).expect("readable").contains("power a off"));
    let Bench { place, up, .. } = bench;
    up.kill();
    let (code, result) = replayed(&place, "session.jsonl");
    assert_eq!(
        (code, &result["identical"], &result["cut_short"]),
        (0, &true.into(), &true.into()),
        "{result}"
    );
    assert!(result["requests"].as_u64().expect("a number") > 50, "{result}");
    assert!(replay(&place, "session.jsonl").done().contains("cut short"));
}

#[test]
fn a_reply_that_is_not_as_recorded_is_exit_code_10() {
    let bench = recorded();
    bench.client(1).read(Reg::HwMajor, 1).expect("answered").expect("readable");
    let Bench { place, up, .. } = bench;
    up.end("TERM");
    let text = fs::read_to_string(place.path("session.jsonl")).expect("readable");
    // The hardware's version is in the last reply.
    let reply = text.lines().rfind(|line| line.contains("\"tx\":\"")).expect("a reply");
    let other = reply.replacen("\"tx\":\"", "\"tx\":\"ff", 1);
    fs::write(place.path("session.jsonl"), text.replace(reply, &other)).expect("written");
    let ran = replay(&place, "session.jsonl");
    assert_eq!(ran.code(), 10, "{}", ran.stderr());
    assert!(ran.stdout().contains("differ") && ran.stdout().contains("digest "), "{}", ran.stdout());
    assert_eq!(ran.stderr(), "stepdrive: session.jsonl: the replay is not as it was recorded\n");
    assert_eq!(replayed(&place, "session.jsonl").1["identical"], false);
}

#[test]
fn what_is_no_recording_is_exit_code_1_and_what_cannot_be_read_2() {
    let place = Place::new();
    let said = replay(&place, "rig.toml").refused(1);
    assert!(said.starts_with("rig.toml: line 1: this is no recording"), "{said}");
    fs::write(place.path("other.jsonl"), "{\"stepdrive_recording\":99}\n").expect("written");
    let said = replay(&place, "other.jsonl").refused(1);
    assert!(said.contains("version 99"), "{said}");
    fs::write(place.path("bytes"), [0xFF, 0xFE, b'\n']).expect("written");
    replay(&place, "bytes").refused(1);
    let said = replay(&place, "nowhere.jsonl").refused(2);
    assert!(said.starts_with("cannot read the recording nowhere.jsonl: "), "{said}");
    fs::create_dir(place.path("folder")).expect("made");
    replay(&place, "folder").refused(2);
}

#[test]
fn a_file_that_is_there_is_not_recorded_over() {
    let place = Place::new();
    fs::write(place.path("precious"), "precious").expect("written");
    let line = one_line(&place.run("up rig.toml --state state --record precious"), 2);
    assert!(
        line.starts_with("stepdrive: cannot record to precious: ") && line.contains("a new file"),
        "{line}"
    );
    assert_eq!(fs::read_to_string(place.path("precious")).expect("readable"), "precious");
    one_line(&place.run("up rig.toml --state state --record nowhere/session.jsonl"), 2);
}

#[test]
fn the_recording_has_the_rig_file_as_it_is_written() {
    let place = Place::with(THREE);
    start(&place, &["--record", "session.jsonl", "--api", "127.0.0.1:0"]).end("TERM");
    let text = fs::read_to_string(place.path("session.jsonl")).expect("readable");
    let header: Value = serde_json::from_str(text.lines().next().expect("a line")).expect("JSON");
    assert_eq!(header["rig"], THREE);
}
