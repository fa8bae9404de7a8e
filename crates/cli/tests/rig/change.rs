//! What changes a rig: inputs, faults, wires, power, panel.

use crate::bench::Bench;
use serde_json::{Value, json};
use stepdrive_spec::smsd::registers::Reg;

fn input(bench: &Bench, drive: usize, name: &str) -> Value {
    bench.drive(drive)["inputs"][name].clone()
}

#[test]
fn an_input_is_forced_and_released() {
    let bench = Bench::start();
    assert_eq!(bench.rig("input a.IN0 1").done(), "done at rig time 0s\n");
    assert_eq!(input(&bench, 0, "IN0"), json!({"level": true, "forced": true}));
    bench.rig("input a.SW 1").done();
    assert_eq!(bench.client(0).read(Reg::SwF, 1).expect("answered"), Ok(vec![1]), "its client sees it");
    bench.rig("input a.IN0 0").done();
    assert_eq!(input(&bench, 0, "IN0"), json!({"level": false, "forced": false}));
    bench.rig("input a.IN0 release").done();
    assert_eq!(input(&bench, 0, "IN0"), json!({"level": false, "forced": null}));
}

#[test]
fn an_input_is_forced_for_a_time() {
    let bench = Bench::start();
    assert_eq!(bench.json("input a.IN0 1 for 2s"), json!({"now_ns": 0}));
    bench.rig("clock step 1999ms").done();
    assert_eq!(input(&bench, 0, "IN0")["level"], true);
    bench.rig("clock step 1ms").done();
    assert_eq!(input(&bench, 0, "IN0"), json!({"level": false, "forced": null}));
}

#[test]
fn an_input_is_pulsed_once_and_in_a_train() {
    let bench = Bench::start();
    bench.rig("input a.IN0 pulse 5ms").done();
    bench.rig("input u.STEP pulse 5ms x3 every 10ms").done();
    let levels = |milliseconds: &str| {
        bench.rig(&format!("clock step {milliseconds}")).done();
        [input(&bench, 0, "IN0"), input(&bench, 2, "STEP")].map(|input| input["level"] == true)
    };
    let seen = [levels("4ms"), levels("4ms"), levels("4ms"), levels("4ms"), levels("8ms"), levels("8ms")];
    assert_eq!(
        seen,
        [[true, true], [false, false], [false, true], [false, false], [false, true], [false, false]]
    );
}

#[test]
fn a_fault_is_switched_on_and_off() {
    let bench = Bench::start();
    bench.rig("fault u.thermocouple open").done();
    assert_eq!(bench.drive(2)["faults"], json!({"thermocouple": "open"}));
    bench.rig("fault u.thermocouple off").done();
    assert_eq!(bench.drive(2)["faults"], json!({}));
    bench.rig("fault a.reply-delay 20ms for 5s").done();
    assert_eq!(bench.drive(0)["faults"], json!({"reply-delay": "20ms"}));
    bench.rig("clock step 5s").done();
    assert_eq!(bench.drive(0)["faults"], json!({}));
}

#[test]
fn a_wire_is_cut_and_mended() {
    let bench = Bench::start();
    let mut client = bench.client(0);
    bench.rig("wire a.relay b.CONTINUE cut").done();
    client.set(Reg::Relay, true).expect("answered").expect("accepted");
    bench.rig("clock step 10ms").done();
    assert_eq!(input(&bench, 1, "CONTINUE")["level"], false);
    bench.rig("wire a.relay b.CONTINUE mend").done();
    bench.rig("clock step 10ms").done();
    assert_eq!(input(&bench, 1, "CONTINUE")["level"], true);
}

#[test]
fn the_power_goes_and_comes_back() {
    let bench = Bench::start();
    bench.rig("power a off").done();
    assert_eq!(bench.drive(0)["powered"], false);
    bench.rig("power a on").done();
    assert_eq!(bench.drive(0)["powered"], true);
    bench.rig("power u off for 2s").done();
    assert_eq!(bench.drive(2)["powered"], false);
    bench.rig("clock step 2s").done();
    assert_eq!(bench.drive(2)["powered"], true);
}

#[test]
fn the_front_panel_counts_from_the_next_power_up() {
    let bench = Bench::start();
    bench.rig("panel a bF 2").done();
    bench.rig("do 'power a off' 'power a on'").done();
    let mut client = bench.client(0);
    assert_eq!(client.read(Reg::ModeNPrograms, 1).expect("answered"), Ok(vec![2]));
    bench.rig("panel a LA").done();
}

#[test]
fn several_things_are_done_at_one_time_or_none() {
    let bench = Bench::start();
    let said = bench.rig("do 'input a.IN0 1' 'input b.IN9 1'").refused(1);
    assert!(said.contains("action 2") && said.contains("IN9"), "{said}");
    assert_eq!(input(&bench, 0, "IN0")["level"], false);
    bench.rig("do 'input a.IN0 1' 'input b.IN1 1'").done();
    assert_eq!(
        [input(&bench, 0, "IN0"), input(&bench, 1, "IN1")].map(|input| input["level"] == true),
        [true; 2]
    );
}

#[test]
fn names_that_mean_nothing_are_told_with_exit_code_1_and_what_there_is() {
    let bench = Bench::start();
    for (words, part) in [
        ("status c", "unknown drive `c`"),
        ("status a/../b?x", "unknown drive"),
        ("input c.IN0 1", "unknown drive `c`"),
        ("input a.IN9 1", "IN9"),
        ("input IN0 1", "stage.IN0"),
        ("input a.IN0 2", "an input is set so"),
        ("input a.IN0 pulse 0s", "no width"),
        ("fault u.thermometer open", "thermocouple"),
        ("fault u.thermocouple loose", "loose"),
        ("fault a.thermocouple open", "thermocouple"),
        ("wire a.relay b.IN0 cut", "no wire from a.relay to b.IN0"),
        ("wire a.relay b.CONTINUE snip", "snip"),
        ("power a of", "on|off"),
        ("panel u bF", "u is an SMD3"),
        ("panel a bF 7", "0 to 3"),
        ("do 'dance a'", "dance"),
    ] {
        let said = bench.rig(words).refused(1);
        assert!(said.contains(part), "{words}: {said}");
    }
    assert_eq!(bench.drive(0)["faults"], json!({}));
}
