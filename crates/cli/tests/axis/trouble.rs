//! What is wrong on the line, from cut to garbled: exit code 5, or none where it can be helped.

use crate::bench::Bench;
use crate::rig::until;
use std::net::TcpListener;

/// Words that keep what waits short.
const QUICK: &str = "--connect-timeout 300ms --reply-timeout 200ms";

#[test]
fn a_host_that_is_not_there_is_exit_code_5() {
    let bench = Bench::start();
    let free = TcpListener::bind("127.0.0.1:0").and_then(|port| port.local_addr()).expect("a free port");
    for words in [
        "status",
        "move by '1 steps'",
        "stop",
        "home",
        "zero",
        "flags",
        "clear",
        "get VMAX",
        "set VMAX 5",
        "run +",
        "bake 50",
    ] {
        let said = bench.run(&format!("{words} -a smd3+tcp://{free}")).refused(5);
        assert!(said.starts_with(&format!("cannot connect to {free}: ")), "{words}: {said}");
    }
    let said = bench.run("status -a no-such-host.invalid:502").refused(5);
    assert!(said.starts_with("cannot connect to no-such-host.invalid:502: "), "{said}");
    let said = bench.run("status -a /dev/no-such-port").refused(5);
    assert!(said.starts_with("cannot connect to /dev/no-such-port: "), "{said}");
    bench.run(&format!("watch {free}")).refused(5);
}

#[test]
fn a_controller_of_the_other_family_is_told_from_the_right_one() {
    let bench = Bench::start();
    let (stage, uhv) = (bench.address(0), bench.address(1));
    let said = bench.run(&format!("status -a smsd+tcp://{uhv} {QUICK}")).refused(5);
    assert!(said.contains(&uhv.to_string()), "{said}");
    let said = bench.run(&format!("status -a smd3+tcp://{stage} {QUICK}")).refused(5);
    assert!(said.contains(&stage.to_string()), "{said}");
}

#[test]
fn a_controller_with_another_unit_does_not_answer() {
    let bench = Bench::start();
    let said = bench.run(&format!("status -a smsd+tcp://{}?unit=9 {QUICK}", bench.address(0))).refused(5);
    assert!(said.contains("did not answer within 200ms"), "{said}");
}

#[test]
fn a_controller_that_is_silent_is_exit_code_5_under_its_name() {
    let bench = Bench::start();
    for (axis, number) in [("stage", 0), ("uhv", 1)] {
        bench.rig.rig(&format!("fault {axis}.connection silent")).done();
        let said = bench.run(&format!("status -a {axis} {QUICK}")).refused(5);
        assert!(said.contains(&format!("{axis} at {}", bench.address(number))), "{said}");
        assert!(said.contains("did not answer within 200ms"), "{said}");
        bench.rig.rig(&format!("fault {axis}.connection off")).done();
        bench.run(&format!("status -a {axis}")).done();
    }
}

#[test]
fn a_connection_that_is_cut_is_exit_code_5() {
    let bench = Bench::start();
    for axis in ["stage", "uhv"] {
        bench.rig.rig(&format!("fault {axis}.connection cut")).done();
        bench.run(&format!("status -a {axis} {QUICK}")).refused(5);
        bench.run(&format!("stop -a {axis} {QUICK}")).refused(5);
    }
}

#[test]
fn slow_and_broken_replies_are_borne() {
    let bench = Bench::start();
    bench.make_ready();
    for fault in ["reply-delay 30ms 20ms", "reply-pieces 5 1ms"] {
        for axis in ["stage", "uhv"] {
            let (name, _) = fault.split_once(' ').expect("a setting");
            bench.rig.rig(&format!("fault {axis}.{fault}")).done();
            bench.run(&format!("move -a {axis} by 0.5 turns")).done();
            bench.rig.rig(&format!("fault {axis}.{name} off")).done();
        }
    }
}

#[test]
fn replies_that_are_sometimes_lost_or_garbled_do_not_keep_one_from_looking() {
    let bench = Bench::start();
    for fault in ["reply-drop 15%", "reply-duplicate 15%"] {
        for axis in ["stage", "uhv"] {
            let (name, _) = fault.split_once(' ').expect("a setting");
            bench.rig.rig(&format!("fault {axis}.{fault}")).done();
            bench.run(&format!("flags -a {axis} {QUICK}")).done();
            bench.rig.rig(&format!("fault {axis}.{name} off")).done();
        }
    }
}

#[test]
fn replies_that_are_always_garbled_are_exit_code_5() {
    let bench = Bench::start();
    bench.rig.rig("fault stage.reply-id on").done();
    let said = bench.run(&format!("status -a stage {QUICK}")).refused(5);
    assert!(
        said.ends_with("(unit 1) did not answer within 200ms"),
        "replies to other requests are none: {said}"
    );
    bench.rig.rig("fault uhv.reply-damage on").done();
    let said = bench.run(&format!("status -a uhv {QUICK}")).refused(5);
    assert!(said.starts_with("uhv at ") && !said.contains(|c: char| c.is_control()), "{said:?}");
}

#[test]
fn a_controller_that_is_busy_says_so() {
    let bench = Bench::start();
    bench.rig.rig("fault stage.exception 06").done();
    for words in ["get -a stage MAX_SPEED", "move -a stage by 1mm"] {
        let said = bench.run(words).refused(7);
        assert!(
            said.ends_with(
                "does not let a password be entered now (Modbus exception 06 (server device busy)); try again"
            ),
            "{said}"
        );
    }
    bench.rig.rig("fault stage.exception 04").done();
    let said = bench.run("get -a stage MAX_SPEED").refused(2);
    assert!(said.contains("Modbus exception 04"), "{said}");
}

#[test]
fn a_cable_that_is_pulled_during_a_move_is_exit_code_5() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    let running = bench.start_command(&format!("move -a stage by 50mm --speed 5mm/s {QUICK}"));
    until(|| bench.rig.drive(0)["speed"].as_f64().is_some_and(|speed| speed > 0.0));
    bench.rig.rig("fault stage.connection cut").done();
    running.end().refused(5);
    bench.rig.rig("fault stage.connection off").done();
    let status = bench.json("status -a stage");
    assert_eq!(status["moving"], true, "nobody has stopped it: {status}");
    bench.run("stop -a stage").done();
}

#[test]
fn ctrl_c_while_the_cable_is_pulled_says_that_nobody_knows() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    let words = "move -a stage by 50mm --speed 5mm/s --connect-timeout 300ms --reply-timeout 5s";
    let running = bench.start_command(words);
    until(|| bench.rig.drive(0)["speed"].as_f64().is_some_and(|speed| speed > 0.0));
    bench.rig.rig("fault stage.connection silent").done();
    running.signal("INT");
    bench.rig.rig("fault stage.connection cut").done();
    let ran = running.end();
    assert_eq!(ran.code(), 5, "{}", ran.stderr());
    assert!(ran.stderr().contains("; whether stage has stopped is not known\n"), "{}", ran.stderr());
}

/// Where a drive's rotor stands, once it stands.
fn place(bench: &Bench, number: usize) -> f64 {
    until(|| bench.rig.drive(number)["speed"] == 0.0);
    bench.rig.drive(number)["carriage"].as_f64().expect("a number")
}

#[test]
fn a_move_whose_reply_is_lost_is_never_made_twice() {
    let bench = Bench::start();
    bench.make_ready();
    let mut rounds = 0..5;
    // Which replies are lost is a matter of chance, so it is gone on with until one was at the worst place.
    while rounds.next().is_some_and(|_| !loses_replies_of_moves(&bench)) {}
    assert!(!rounds.is_empty(), "some were lost at the worst place");
}

/// Moves under a line that loses replies; whether one was lost at the worst place.
fn loses_replies_of_moves(bench: &Bench) -> bool {
    let mut lost = 0;
    for (axis, number) in [("stage", 0), ("uhv", 1)] {
        bench.rig.rig(&format!("fault {axis}.reply-drop 25%")).done();
        for _ in 0..8 {
            let before = place(bench, number);
            let ran = bench
                .run(&format!("move -a {axis} by '20 steps' --connect-timeout 300ms --reply-timeout 60ms"));
            let gone = place(bench, number) - before;
            let (none, once) = (gone.abs() < 1e-6, (gone - 20.0).abs() < 1e-6);
            assert!(if ran.code() == 0 { once } else { none || once }, "{gone} {}", ran.stderr());
            assert!(matches!(ran.code(), 0 | 5), "{}", ran.stderr());
            lost += usize::from(ran.stderr().contains("it was not sent again"));
        }
    }
    lost > 0
}
