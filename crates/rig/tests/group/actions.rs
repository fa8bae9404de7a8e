//! Inputs, panel and supply under control, and how an action is refused.

use crate::bench::{Bench, MS, PAIR, SECOND, STAGE_AND_UHV};
use expect_test::{Expect, expect};
use std::time::Duration;
use stepdrive_rig::action::Action;
use stepdrive_rig::file::RigFile;
use stepdrive_spec::smd3::commands::Value;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

#[test]
fn a_forced_input_keeps_its_level_whatever_the_switch_does() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.act("input stage.IN0 0");
    bench.write("stage", Reg::TargetPos, 310 * 16);
    bench.command("stage", Opcode::GoTo);
    assert!(bench.until("stage.READY", 10 * SECOND));
    assert_eq!([bench.look("stage.carriage"), bench.look("stage.IN0")], [310.0, 0.0]);
    bench.act("input stage.IN0 release");
    assert_eq!(bench.look("stage.IN0"), 1.0);
}

#[test]
fn an_input_forced_for_a_while_is_released_by_itself() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.act("input uhv.RESET_FAULT 1 for 3ms");
    assert!(bench.until("!uhv.RESET_FAULT", SECOND));
    assert_eq!(bench.now.as_nanos(), 3_000_000);
}

#[test]
fn a_pulse_lasts_as_long_as_it_says() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.pass(SECOND);
    bench.act("input stage.SW pulse 5ms");
    assert_eq!(bench.look("stage.SW_F"), 1.0);
    assert!(bench.until("!stage.SW_F", SECOND));
    assert_eq!(bench.now.as_nanos(), 1_005_000_000);
    assert_eq!(bench.look("stage.SW_EVN"), 1.0, "the edge was seen");
}

#[test]
fn a_train_of_pulses_steps_a_motor_in_step_and_direction_mode() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.line("uhv", "MODE,0").expect("step and direction");
    bench.act("input uhv.DIR 1");
    bench.act("input uhv.STEP pulse 100us x200 every 10ms");
    bench.pass(3 * SECOND);
    assert_eq!(bench.line("uhv", "RES"), Ok(Some(Value::Uint(256))));
    assert_eq!(bench.line("uhv", "PACT"), Ok(Some(Value::Float(200.0 / 256.0))));
}

#[test]
fn the_supply_goes_and_comes_back_with_the_carriage_where_it_was_left() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.write("stage", Reg::TargetPos, 3200);
    bench.command("stage", Opcode::GoTo);
    bench.pass(100 * MS);
    bench.act("power stage off for 2s");
    let left = bench.look("stage.carriage");
    assert!(left > 0.0 && left < 200.0);
    assert_eq!([bench.look("stage.powered"), bench.look("stage.READY")], [0.0, 0.0]);
    assert!(bench.until("stage.powered", 10 * SECOND));
    assert_eq!(bench.now.as_nanos(), 2_100_000_000);
    let now = ["stage.carriage", "stage.ABS_POS", "stage.HIZ"].map(|name| bench.look(name));
    assert_eq!(now, [left, 0.0, 1.0]);
}

#[test]
fn a_switch_that_closed_while_the_supply_was_off_is_seen_at_power_up() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.act("power uhv off");
    bench.act("input uhv.LIMIT_NEGATIVE 1");
    bench.act("power uhv on");
    assert_eq!(bench.look("uhv.LIMIT_NEGATIVE"), 1.0);
}

#[test]
fn the_front_panel_counts_from_the_next_power_up_on() {
    let mut bench = Bench::new(PAIR, &[("a", "again:\nSET_WAIT 10ms\nGOTO_PROGRAM again\n")]);
    let power_cycle = |bench: &mut Bench| {
        bench.act("power a off for 1s");
        bench.pass(2 * SECOND);
        bench.look("a.PROGRAM_RUN")
    };
    bench.act("panel a LA");
    bench.pass(SECOND);
    assert_eq!(bench.look("a.PROGRAM_RUN"), 1.0, "not yet");
    assert_eq!(power_cycle(&mut bench), 0.0);
    bench.act("panel a bF 2");
    assert_eq!(bench.look("a.MODE_N_PROGRAMS"), 2.0);
    assert_eq!(power_cycle(&mut bench), 0.0, "memory 2 is empty");
    bench.act("panel a bF 0");
    assert_eq!(power_cycle(&mut bench), 1.0);
}

#[test]
fn everything_at_rest_is_idle_at_once_and_a_move_at_its_end() {
    let mut bench = Bench::new(PAIR, &[]);
    assert!(bench.until_idle(SECOND));
    assert_eq!(bench.now.as_nanos(), 0);
    bench.write("a", Reg::TargetPos, 3200);
    bench.command("a", Opcode::GoTo);
    assert!(bench.until_idle(Duration::from_mins(1)));
    assert_eq!(bench.look("a.ABS_POS"), 3200.0);
    let idle = bench.now;
    bench.pass(SECOND);
    assert!(bench.until_idle(SECOND));
    assert_eq!(bench.now, idle + SECOND);
}

fn refused(text: &str, expected: &Expect) {
    let rig = RigFile::parse(STAGE_AND_UHV).expect("a valid rig");
    let error = Action::parse(text, &rig).expect_err(text);
    expected.assert_eq(&error.to_string());
}

#[test]
fn what_is_no_action_is_refused_with_what_would_be() {
    refused("", &expect![[r#"there is no action; as in: input stage.IN0 1"#]]);
    refused("kick stage", &expect!["unknown action `kick`; there are input, fault, power, panel, wire"]);
    refused(
        "input stage.IN9 1",
        &expect!["unknown input `IN9` of `stage`; there are IN0, IN1, SET_ZERO, SW, EN, STEP, DIR, CONTINUE"],
    );
    refused("input stag.IN0 1", &expect!["unknown drive `stag`; there are stage, uhv"]);
    refused("input IN0 1", &expect!["`IN0` is not a drive and a part of it, as in stage.IN0"]);
    refused(
        "input stage.IN0 2",
        &expect!["an input is set so: input DRIVE.INPUT 1|0|release|pulse WIDTH [xCOUNT every PERIOD]"],
    );
    refused("input stage.IN0 pulse 0ms", &expect!["a pulse of no width is none"]);
    refused(
        "input stage.IN0 pulse 5 parsecs",
        &expect!["an input is set so: input DRIVE.INPUT 1|0|release|pulse WIDTH [xCOUNT every PERIOD]"],
    );
    refused(
        "input stage.IN0 pulse 5ms x0 every 10ms",
        &expect!["the number of pulses is x1 to x1000000, as in: pulse 5ms x200 every 10ms"],
    );
    refused(
        "input stage.IN0 pulse 5ms x2 every 5ms",
        &expect!["pulses come farther apart than they are wide, as in: pulse 5ms x200 every 10ms"],
    );
    refused(
        "input stage.IN0 release for 2s",
        &expect!["`for` goes with forced inputs, faults and the power: this cannot be taken back by itself"],
    );
    refused("power stage maybe", &expect!["the power is switched so: power DRIVE on|off [for DURATION]"]);
    refused("panel uhv bF", &expect!["uhv is an SMD3, which has no front panel with LA and bF"]);
    refused("panel stage XX", &expect!["the front panel shows LA or bF, not `XX`"]);
    refused("panel stage bF 4", &expect!["the program at the front panel is 0 to 3, not `4`"]);
    refused(
        "wire stage.relay uhv.STEP cut",
        &expect!["the rig file has no wire from stage.relay to uhv.STEP"],
    );
    refused("wire uhv.relay stage.IN0 cut", &expect!["`uhv` is an SMD3, which has no outputs"]);
    refused("fault stage.rotor bent", &expect!["the fault rotor cannot be `bent`; it is blocked or off"]);
    refused(
        "fault stage.thermocouple open",
        &expect!["stage cannot have the fault thermocouple: its controller has no such part"],
    );
    refused(
        "fault stage.gearbox worn",
        &expect![
            "unknown fault `gearbox` of stage; there are INPUT, rotor, motor, temperature, connection, reply-delay, reply-drop, reply-pieces, reply-duplicate, reply-damage, reply-id, exception (INPUT: an input with a switch)"
        ],
    );
    refused(
        "fault stage.IN1 bounce",
        &expect!["stage has no switch on IN1; to force the input itself: input stage.IN1 1"],
    );
    refused(
        "fault uhv.exception 04",
        &expect![
            "exception is not for the line of an SMD3; an SMD3 has connection, reply-delay, reply-drop, reply-pieces, reply-duplicate, reply-damage"
        ],
    );
    refused(
        "fault stage.reply-drop 130%",
        &expect!["reply-drop cannot be `130%`: a chance is at most 100%; its settings are on | CHANCE | off"],
    );
}
