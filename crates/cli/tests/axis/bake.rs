//! `bake`.

use crate::bench::{Bench, keys};
use crate::rig::until;
use serde_json::json;

#[test]
fn an_smsd_does_not_bake() {
    let bench = Bench::start();
    let said = bench.run("bake 150 -a stage").refused(1);
    assert_eq!(said, "stage is an SMSD, which cannot bake its motor; an SMD3 can; nothing was sent");
}

#[test]
fn a_bake_ends_by_itself_and_leaves_the_drive_as_it_was() {
    let bench = Bench::start();
    let text = bench.run("bake 60°C -a uhv --for 600ms").done().to_owned();
    assert!(text.starts_with("uhv was baked for 600ms and is at ") && text.ends_with(" °C\n"), "{text}");
    assert!(bench.run("get -a uhv BAKET MODE").done().ends_with("MODE = 2 (Remote)\n"));
    bench.run("move -a uhv by 0.1 turns").done();
}

#[test]
fn a_bake_without_an_end_goes_on_until_it_is_switched_off() {
    let bench = Bench::start();
    let bake = bench.json("bake 150 -a uhv");
    assert_eq!(keys(&bake), ["axis", "baking", "setpoint_c", "temperature_c"]);
    assert_eq!((&bake["baking"], &bake["setpoint_c"]), (&json!(true), &json!(150.0)));
    let said = bench.run("move -a uhv by 1 turn").refused(7);
    assert!(said.contains("is in mode 4 (Bake)"), "{said}");
    assert_eq!(bench.json("status -a uhv")["mode"], "Bake");
    until(|| bench.json("get -a uhv TMOT")["values"][0]["value"].as_f64().is_some_and(|now| now > 30.0));
    assert_eq!(bench.json("bake off -a uhv")["baking"], false);
    bench.run("move -a uhv by 0.1 turns").done();
}

#[test]
fn ctrl_c_ends_a_bake() {
    let bench = Bench::start();
    let running = bench.start_command("bake 150 -a uhv --for 1h");
    until(|| bench.json("flags -a uhv").to_string().contains("\"name\":\"BAKE\",\"set\":true"));
    running.signal("INT");
    let said = running.end().refused(2);
    assert!(said.starts_with("bake of uhv was ended on Ctrl-C, after "), "{said}");
    bench.run("move -a uhv by 0.1 turns").done();
}

#[test]
fn a_bake_that_something_ends_says_what() {
    let bench = Bench::start();
    let running = bench.start_command("bake 150 -a uhv --for 1h");
    until(|| bench.json("flags -a uhv").to_string().contains("\"name\":\"BAKE\",\"set\":true"));
    bench.rig.rig("fault uhv.thermocouple open").done();
    let said = running.end().refused(8);
    assert!(said.contains(": TOPEN; remove the cause and clear it with `stepdrive clear`"), "{said}");
}

#[test]
fn a_bake_that_is_refused_leaves_the_drive_as_it_was() {
    let bench = Bench::start();
    let said = bench.run("bake 250 -a uhv").refused(1);
    assert_eq!(said, "BAKET 250 is out of range: 0 to 200 °C; nothing was sent");
    bench.run("stop -a uhv --hard").done();
    bench.run("bake 150 -a uhv").refused(8);
    assert_eq!(bench.run("get -a uhv MODE").done(), "MODE = 2 (Remote)\n");
    for words in ["hot", "150.5", "off --for 1s", "150 --for 0s"] {
        assert_eq!(bench.run(&format!("bake {words} -a uhv")).code(), 1, "{words}");
    }
}
