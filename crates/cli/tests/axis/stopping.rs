//! `stop`, and Ctrl-C during a motion.

use crate::bench::{Bench, Running};
use crate::rig::until;
use serde_json::json;

/// A long move that is on its way.
fn moving(bench: &Bench, words: &str) -> Running {
    let running = bench.start_command(words);
    until(|| bench.rig.drive(0)["speed"].as_f64().is_some_and(|speed| speed > 0.0));
    running
}

#[test]
fn a_stop_brakes_and_keeps_trust() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    bench.run("run -a stage + 5mm/s").done();
    let stopped = bench.json("stop -a stage");
    assert_eq!(
        (&stopped["moving"], &stopped["trust"], &stopped["energised"]),
        (&json!(false), &json!("trusted"), &json!(true))
    );
    assert_eq!(bench.json("stop -a stage")["position_mm"], stopped["position_mm"]);
}

#[test]
fn a_hard_stop_makes_the_position_suspect_and_a_free_one_unknown() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    bench.run("run -a stage + 5mm/s").done();
    let text = bench.run("stop -a stage --hard").done().to_owned();
    assert!(text.ends_with(", suspect: the motor was stopped dead while it turned\n"), "{text}");
    let text = bench.run("stop -a stage --free").done().to_owned();
    assert!(text.ends_with(", unknown: the motor was de-energised\n"), "{text}");
    assert_eq!(bench.json("status -a stage")["energised"], false);
    let stopped = bench.json("stop -a uhv --hard");
    assert_eq!(
        (&stopped["energised"], &stopped["faults"][0]["name"]),
        (&json!(false), &json!("EMERGENCY STOP"))
    );
    let ran = bench.run("stop -a stage --hard --free");
    assert!(ran.code() == 1 && ran.stderr().contains("cannot be used with"), "{}", ran.stderr());
}

#[test]
fn ctrl_c_stops_a_move_softly() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    for signal in ["INT", "TERM"] {
        let running = moving(&bench, "move -a stage by 50mm --speed 5mm/s");
        running.signal(signal);
        let ran = running.end();
        assert_eq!((ran.code(), ran.stdout()), (2, ""));
        let said = ran.stderr();
        let (first, second) = said.split_once('\n').expect("two lines");
        assert_eq!(first, "stepdrive: stopping stage; Ctrl-C again stops it at once");
        assert!(
            second.starts_with("stepdrive: stage was stopped on Ctrl-C, at ")
                && second.ends_with(", trusted\n"),
            "{said}"
        );
        let status = bench.json("status -a stage");
        assert_eq!((&status["moving"], &status["energised"]), (&json!(false), &json!(true)));
    }
}

#[test]
fn a_second_ctrl_c_stops_it_at_once() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    // So slow that it would brake for a minute.
    for name in ["ACC", "DEC"] {
        bench.run(&format!("set -a stage {name} 15")).done();
    }
    let running = bench.start_command("move -a stage to 200mm");
    until(|| bench.rig.drive(0)["speed"].as_f64().is_some_and(|speed| speed > 20.0));
    running.signal("INT");
    until(|| bench.json("get -a stage 0x1204")["values"][0]["value"] == 1);
    running.signal("INT");
    let ran = running.end();
    assert_eq!(ran.code(), 2);
    assert!(
        ran.stderr().ends_with(", suspect: the motor was stopped dead while it turned\n"),
        "{}",
        ran.stderr()
    );
    assert_eq!(bench.json("status -a stage")["trust"], "suspect");
}

#[test]
fn ctrl_c_ends_homing_and_leaves_the_position_unknown() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    let running = bench.start_command("home -a uhv - --speed 0.5turns/s");
    until(|| bench.json("status -a uhv")["moving"] == true);
    running.signal("INT");
    let ran = running.end();
    assert!(ran.code() == 2 && ran.stderr().contains("uhv was stopped on Ctrl-C, at "), "{}", ran.stderr());
    let status = bench.json("status -a uhv");
    assert_eq!((&status["moving"], &status["doubt"]), (&json!(false), &json!("homing came to nothing")));
    bench.run("move -a uhv by 0.1 turns").done();
}

#[test]
fn a_stop_from_elsewhere_ends_a_move_with_exit_code_7() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    let running = moving(&bench, "move -a stage by 50mm --speed 5mm/s");
    bench.run("stop -a stage").done();
    let said = running.end().refused(7);
    assert!(said.contains("instead of 50mm: somebody or something stopped it on the way"), "{said}");
    let running = moving(&bench, "move -a stage by 50mm");
    bench.run("stop -a stage --hard").done();
    running.end().refused(7);
    assert_eq!(bench.json("status -a stage")["trust"], "suspect");
}

#[test]
fn a_stop_ends_a_program_too() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    bench.write("p.smsd", "again:\n    MOVE_F 1600\n    MOVE_R 1600\n    GOTO_PROGRAM again\n");
    bench.run("program store p.smsd --mem 0 -a stage").done();
    for (how, energised) in [("", true), ("--hard", true), ("--free", false)] {
        bench.run("program start 0 -a stage").done();
        until(|| bench.rig.drive(0)["speed"].as_f64().is_some_and(|speed| speed > 0.0));
        let stopped = bench.json(&format!("stop -a stage {how}"));
        assert_eq!((&stopped["moving"], &stopped["energised"]), (&json!(false), &json!(energised)), "{how}");
        assert_eq!(bench.json("get -a stage PROGRAM_RUN")["values"][0]["value"], 0, "{how}");
        let status = bench.json("status -a stage");
        assert_eq!(
            (&status["moving"], &status["position_mm"]),
            (&json!(false), &stopped["position_mm"]),
            "{how}"
        );
    }
}
