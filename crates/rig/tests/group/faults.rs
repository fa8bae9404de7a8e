//! What each fault of a machine does.

use crate::bench::{Bench, MS, SECOND, STAGE_AND_UHV};
use std::time::Duration;
use stepdrive_rig::fault::faults_of;
use stepdrive_rig::group::Member;
use stepdrive_rig::line::Family;
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

fn active(bench: &Bench) -> Vec<(String, String)> {
    bench.groups.iter().flat_map(|group| group.members().iter().flat_map(Member::faults)).collect()
}

fn go_to(bench: &mut Bench, steps: i64) {
    bench.write("stage", Reg::TargetPos, steps * 16);
    bench.command("stage", Opcode::GoTo);
    assert!(bench.until("stage.READY", 100 * SECOND));
}

#[test]
fn a_switch_stuck_open_is_run_past() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.act("fault uhv.LIMIT_POSITIVE stuck-open");
    bench.line("uhv", "MODE,2").expect("normal mode");
    bench.line("uhv", "RUNR,1800").expect("accepted");
    assert!(bench.until("uhv.STANDBY", 100 * SECOND));
    assert_eq!(bench.look("uhv.PACT"), 1800.0);
    bench.act("fault uhv.LIMIT_POSITIVE off");
    assert_eq!(bench.look("uhv.LIMIT_POSITIVE"), 1.0);
}

#[test]
fn a_switch_stuck_closed_is_there_everywhere() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.act("fault stage.IN0 stuck-closed");
    assert_eq!(bench.look("stage.IN0"), 1.0);
    bench.act("fault stage.IN0 off");
    assert_eq!(bench.look("stage.IN0"), 0.0);
}

#[test]
fn a_bouncing_switch_gives_several_edges_and_ends_closed() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.act("fault stage.IN0 bounce");
    bench.write("stage", Reg::TargetPos, 310 * 16);
    bench.command("stage", Opcode::GoTo);
    let mut edges = 0;
    while bench.until("stage.IN0", 2 * SECOND) {
        edges += 1;
        if !bench.until("!stage.IN0", 2 * SECOND) {
            break;
        }
    }
    assert!(edges >= 2, "{edges} edges");
    assert_eq!(bench.look("stage.IN0"), 1.0);
}

#[test]
fn a_blocked_rotor_loses_the_steps_and_not_the_count() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    go_to(&mut bench, 100);
    bench.act("fault stage.rotor blocked");
    bench.write("stage", Reg::TargetPos, 200 * 16);
    bench.command("stage", Opcode::GoTo);
    bench.pass(50 * MS);
    assert_eq!([bench.look("stage.stalled"), bench.look("stage.carriage")], [1.0, 100.0]);
    assert!(bench.until("stage.READY", 10 * SECOND));
    bench.act("fault stage.rotor off");
    assert_eq!([bench.look("stage.ABS_POS"), bench.look("stage.carriage")], [3200.0, 100.0]);
    go_to(&mut bench, 0);
    assert_eq!(bench.look("stage.carriage"), -100.0);
}

#[test]
fn a_shorted_motor_goes_hiz_in_an_smsd_and_shows_a_short_in_an_smd3() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.command("stage", Opcode::RunF);
    bench.pass(SECOND);
    bench.act("fault stage.motor short");
    bench.act("fault uhv.motor short");
    bench.line("uhv", "RUNV,+").expect_err("the motor is disabled");
    let shown = ["stage.HIZ", "stage.SPEED", "uhv.MOTOR_SHORT"].map(|name| bench.look(name));
    assert_eq!(shown, [1.0, 0.0, 1.0]);
}

#[test]
fn an_overheated_drive_stops_and_an_smd3_says_why() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.command("stage", Opcode::RunF);
    bench.act("fault stage.temperature high");
    bench.act("fault uhv.temperature high for 10min");
    let shown = ["stage.HIZ", "uhv.TOVR", "uhv.TMOT"].map(|name| bench.look(name));
    assert_eq!(shown, [1.0, 1.0, 200.0]);
    bench.pass(Duration::from_mins(30));
    assert!(bench.look("uhv.TMOT") < 60.0, "it cools");
}

#[test]
fn a_thermocouple_breaks_and_is_mended() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.act("fault uhv.temperature high");
    // A short-circuited thermocouple shows where the short is: the ambient temperature, and no fault.
    for (setting, open, shown) in [("open", 1.0, None), ("short", 0.0, Some(20.0)), ("off", 0.0, Some(200.0))]
    {
        bench.act(&format!("fault uhv.thermocouple {setting}"));
        let _ = bench.line("uhv", "CLR");
        assert_eq!(bench.look("uhv.TOPEN"), open, "{setting}");
        assert!(shown.is_none_or(|shown| bench.look("uhv.TMOT") == shown), "{setting}");
    }
}

#[test]
fn a_worn_flash_fails_to_store_and_a_damaged_one_comes_up_with_a_configuration_error() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.line("uhv", "VMAX,321").expect("set");
    bench.line("uhv", "STORE").expect("stored");
    bench.act("fault uhv.flash worn");
    assert_eq!(bench.line("uhv", "STORE"), Err(Error::ActionFailed));
    bench.act("fault uhv.flash damaged");
    bench.act("power uhv off for 1s");
    bench.pass(2 * SECOND);
    assert_eq!(bench.look("uhv.CONFIGURATION_ERROR"), 1.0);
    bench.act("fault uhv.flash off");
    bench.act("power uhv off for 1s");
    bench.pass(2 * SECOND);
    let shown = [bench.look("uhv.CONFIGURATION_ERROR"), bench.look("uhv.VMAX").round()];
    assert_eq!(shown, [0.0, 321.0]);
}

#[test]
fn faults_are_listed_while_they_are_on() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    for action in [
        "fault stage.IN0 bounce",
        "fault stage.reply-drop 30%",
        "fault uhv.thermocouple open for 1s",
        "fault uhv.rotor blocked",
    ] {
        bench.act(action);
    }
    let pair = |name: &str, setting: &str| (name.to_owned(), setting.to_owned());
    let all = [
        pair("IN0", "bounce"),
        pair("reply-drop", "30%"),
        pair("thermocouple", "open"),
        pair("rotor", "blocked"),
    ];
    assert_eq!(active(&bench), all);
    bench.pass(SECOND);
    assert_eq!(active(&bench).len(), 3);
    bench.act("fault stage.IN0 off");
    bench.act("fault stage.reply-drop off");
    bench.act("fault uhv.rotor off");
    assert_eq!(active(&bench), []);
}

#[test]
fn every_fault_that_is_listed_can_be_switched_on_and_off() {
    for (drive, family) in [("stage", Family::Smsd), ("uhv", Family::Smd3)] {
        for (name, settings, _) in faults_of(family) {
            let input = if family == Family::Smsd { "IN0" } else { "LIMIT_POSITIVE" };
            let name = if name == "INPUT" { input } else { name };
            let setting = settings.split(['|', ',']).next().expect("a setting").trim();
            // What is written in capitals, and a range, stand for a value.
            let setting = match setting {
                "TIME [JITTER]" => "20ms 5ms",
                "2..64 [GAP]" => "3 10ms",
                "04 [CHANCE]" => "04 30%",
                keyword => keyword,
            };
            let mut bench = Bench::new(STAGE_AND_UHV, &[]);
            bench.act(&format!("fault {drive}.{name} {setting}"));
            assert_eq!(active(&bench).len(), 1, "{name} {setting}");
            bench.act(&format!("fault {drive}.{name} off"));
            assert_eq!(active(&bench), [], "{name}");
        }
    }
}
