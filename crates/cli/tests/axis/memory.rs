//! `stepdrive program store`, `fetch`, `start`, `stop` and `follow`.

use crate::bench::Bench;
use crate::rig::until;
use serde_json::Value;
use std::fs;

/// Goes out and back again until it is stopped.
const SHUTTLE: &str = "SET_MAX_SPEED 800\nagain:\n    MOVE_F 1600\n    MOVE_R 1600\n    GOTO_PROGRAM again\n";

#[test]
fn a_program_is_stored_read_back_and_fetched_as_text() {
    let bench = Bench::start();
    bench.write("p.smsd", SHUTTLE);
    let ran = bench.run("program store p.smsd --mem 0 -a stage");
    assert_eq!(ran.code(), 0, "{}", ran.stderr());
    assert_eq!(ran.stdout(), "stage: 4 instructions stored in memory 0 and read back\n");
    let ran = bench.run("program fetch --mem 0 -a stage");
    assert_eq!(
        ran.done(),
        ".mem 0\n    SET_MAX_SPEED 800\nL1:\n    MOVE_F 1600\n    MOVE_R 1600\n    GOTO_PROGRAM L1\n"
    );
    let ran = bench.run("program fetch -a stage -o back.smsd");
    assert_eq!(ran.stderr(), "stage: 4 instructions in memory 0 to back.smsd\n");
    assert!(
        fs::read_to_string(bench.place().path("back.smsd")).expect("written").contains("GOTO_PROGRAM L1")
    );
}

#[test]
fn a_text_that_names_no_memory_goes_to_any_with_its_jumps() {
    let bench = Bench::start();
    bench.write("p.smsd", SHUTTLE);
    let told = bench.json("program store p.smsd --mem 2 -a stage");
    assert_eq!(told["stored"], serde_json::json!([{ "memory": 2, "instructions": 4 }]));
    let ran = bench.run("program fetch --mem 2 -a stage");
    assert!(
        ran.done().starts_with(".mem 2\n") && ran.stdout().contains("GOTO_PROGRAM L1"),
        "{}",
        ran.stdout()
    );
    let told = bench.json("program fetch -a stage");
    let sizes: Vec<usize> = told["memories"]
        .as_array()
        .expect("four")
        .iter()
        .map(|words| words.as_array().map_or(9, Vec::len))
        .collect();
    assert_eq!(sizes, [0, 0, 4, 0]);
}

#[test]
fn every_memory_of_a_program_is_stored_and_an_image_too() {
    let bench = Bench::start();
    bench.write("p.smsd", "SET_RELE\nEND\n.mem 1\nCLR_RELE\nEND\n");
    bench.run("program build p.smsd -o p.bin");
    let told = bench.json("program store p.bin -a stage");
    assert_eq!(told["stored"].as_array().map(Vec::len), Some(2));
    let told = bench.run("program store p.smsd --mem 3 -a stage").refused(1);
    assert!(told.contains("no instructions for memory 3: it has 2 instructions in memory 0"), "{told}");
}

#[test]
fn a_program_with_errors_is_not_sent_anywhere() {
    let bench = Bench::start();
    bench.write("p.smsd", "MOVE_F fast\n");
    // Nobody is asked: there is nothing at this address.
    let ran = bench.run("program store p.smsd --mem 0 -a 127.0.0.1:1");
    assert_eq!((ran.code(), ran.stdout()), (9, ""), "{}", ran.stderr());
    assert!(ran.stderr().contains("p.smsd:1:8") && ran.stderr().contains("1 error"), "{}", ran.stderr());
    let told = bench.run("program store none.smsd --mem 0 -a stage").refused(1);
    assert!(told.starts_with("cannot read none.smsd"), "{told}");
}

#[test]
fn what_one_model_cannot_do_is_told_once_the_model_is_known() {
    let bench = Bench::start();
    bench.write("p.smsd", "SET_MODE control=current motor=0 microstep=1/16 current=6.0A hold=50%\nEND\n");
    let ran = bench.run("program store p.smsd --mem 0 -a stage");
    let alone = bench.run("program check p.smsd");
    let (known, unknown) = (ran.stderr(), alone.stderr());
    assert!(known.len() > unknown.len() && known.contains("SMSD-4.2LAN"), "{known}\n---\n{unknown}");
}

#[test]
fn a_program_is_started_followed_and_stopped() {
    let bench = Bench::in_real_time();
    bench.energise();
    bench.write("p.smsd", SHUTTLE);
    bench.run("program store p.smsd --mem 0 -a stage");
    assert_eq!(bench.run("program start 0 -a stage").done(), "stage: the program in memory 0 was started\n");
    let mut follow = bench.start_command("program follow -a stage --json");
    let seen: Vec<Value> =
        follow.lines().take(3).map(|line| serde_json::from_str(&line).expect("JSON")).collect();
    for line in &seen {
        assert_eq!(line["event"], "line");
        // A line as short as the jump is seen only by chance, but may be.
        let known = ["MOVE_F 1600", "MOVE_R 1600", "GOTO_PROGRAM mem0:1"];
        assert!(line["instruction"].as_str().is_some_and(|text| known.contains(&text)), "{line}");
    }
    drop(follow);
    let told = bench.json("program stop -a stage");
    assert_eq!(told["ran"], true);
    assert_eq!(bench.json("get -a stage PROGRAM_RUN")["values"][0]["value"], 0);
    until(|| bench.json("program stop -a stage")["moving"] == false);
    assert_eq!(bench.run("program stop -a stage").done(), "stage: no program ran\n");
}

#[test]
fn following_ends_with_the_program_and_tells_where() {
    let bench = Bench::in_real_time();
    bench.energise();
    bench.write("p.smsd", "SET_WAIT 200ms\nMOVE_F 160\nWAIT_IN0\nEND\n");
    bench.run("program store p.smsd --mem 1 -a stage");
    bench.rig.rig("input stage.IN0 1").done();
    let ran = bench.run("program start 1 --follow -a stage");
    let lines: Vec<&str> = ran.done().lines().collect();
    assert_eq!(
        lines[0].split_whitespace().collect::<Vec<_>>(),
        ["time", "line", "position", "speed", "instruction"]
    );
    assert!(lines[1].ends_with("SET_WAIT 200ms") && lines[1].contains("mem1:0"), "{lines:?}");
    assert!(lines.last().is_some_and(|line| line.contains("position 160 microsteps")), "{lines:?}");
    let ran = bench.run("program follow -a stage");
    assert_eq!((ran.code(), ran.stdout(), ran.stderr().as_str()), (0, "", "stage: no program runs\n"));
}

#[test]
fn an_instruction_that_is_refused_ends_following_with_8() {
    let bench = Bench::in_real_time();
    bench.energise();
    bench.write("p.smsd", "RUN_F 100\nSET_WAIT 200ms\nMOVE_F 5\nEND\n");
    bench.run("program store p.smsd --mem 0 -a stage");
    let ran = bench.run("program start 0 --follow -a stage --json");
    assert_eq!(ran.code(), 8, "{}", ran.stderr());
    assert!(
        ran.stderr().contains("CMD_ERROR is set: the controller refused an instruction"),
        "{}",
        ran.stderr()
    );
    let end: Value = serde_json::from_str(ran.stdout().lines().last().expect("a line")).expect("JSON");
    assert_eq!((&end["event"], &end["refused"], &end["moving"]), (&"end".into(), &true.into(), &true.into()));
    // The flag stays until it is cleared, and nothing is started before.
    let told = bench.run("program start 0 -a stage").refused(8);
    assert!(told.contains("CMD_ERROR is set by an earlier command"), "{told}");
}

#[test]
fn a_program_that_runs_is_not_written_over() {
    let bench = Bench::start();
    bench.write("p.smsd", SHUTTLE);
    bench.run("program store p.smsd --mem 0 -a stage");
    bench.run("program start 0 -a stage").done();
    let ran = bench.run("program store p.smsd --mem 0 -a stage");
    assert_eq!(ran.code(), 7, "{}", ran.stderr());
    assert!(ran.stderr().contains("stop the program"), "{}", ran.stderr());
}

#[test]
fn an_smd3_has_no_programs() {
    let bench = Bench::start();
    bench.write("p.smsd", "END\n");
    for words in ["store p.smsd --mem 0", "fetch --mem 0", "start 0", "stop", "follow"] {
        let ran = bench.run(&format!("program {words} -a uhv"));
        assert_eq!(ran.code(), 1, "{words}: {}", ran.stderr());
        assert!(
            ran.stderr().contains("uhv is an SMD3, which has no user programs"),
            "{words}: {}",
            ran.stderr()
        );
    }
    assert_eq!(bench.run("program start 4 -a stage").code(), 1);
}
