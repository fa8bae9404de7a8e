//! `move`, `run`, `home`, `zero`: where the axis goes, and what it refuses.

use crate::bench::{Bench, keys};
use serde_json::{Value, json};

/// Where a drive's rotor is, in full steps on its travel.
fn carriage(bench: &Bench, number: usize) -> Value {
    bench.rig.drive(number)["carriage"].clone()
}

/// Whether it is there, to a step or two.
#[track_caller]
fn assert_near(bench: &Bench, number: usize, place: f64) {
    let carriage = carriage(bench, number).as_f64().expect("a number");
    assert!((carriage - place).abs() < 2.0, "{carriage} {place}");
}

#[test]
fn a_move_goes_to_a_position_or_by_a_distance_in_any_unit_that_fits() {
    let bench = Bench::start();
    bench.make_ready();
    assert_eq!(bench.run("move -a stage to 12.5mm").done(), "stage is at 12.5mm (500 full steps), trusted\n");
    assert_eq!(carriage(&bench, 0), 500.0);
    for (words, steps) in [
        ("by -3mm", 380.0),
        ("by -1 turns", 180.0),
        ("by '200 steps'", 380.0),
        ("'by 0.5 turns'", 480.0),
        ("to -5 mm", -200.0),
        ("to 10mm --speed 100mm/s", 400.0),
    ] {
        bench.run(&format!("move -a stage {words}")).done();
        assert_eq!(carriage(&bench, 0), steps, "{words}");
    }
    assert_eq!(bench.run("move -a uhv by 1 turn").done(), "uhv is at 1 turn (200 full steps), trusted\n");
    bench.run("move -a uhv to -90 deg").done();
    assert_eq!(carriage(&bench, 1), -50.0);
}

#[test]
fn a_move_as_json_tells_plan_and_outcome() {
    let bench = Bench::start();
    bench.make_ready();
    let moved = bench.json("move -a stage to 5mm");
    assert_eq!(
        (&moved["from_mm"], &moved["to_mm"], &moved["distance_mm"]),
        (&json!(0.0), &json!(5.0), &json!(5.0))
    );
    assert_eq!(
        (&moved["position_mm"], &moved["trust"], &moved["moving"]),
        (&json!(5.0), &json!("trusted"), &json!(false))
    );
    assert!(moved["expected_s"].as_f64().is_some_and(|expected| expected > 0.1), "{moved}");
}

#[test]
fn a_dry_run_shows_travel_time_and_frames_and_sends_none_of_them() {
    let bench = Bench::start();
    bench.make_ready();
    let text = bench.run("move -a stage by -3mm --speed 5mm/s --dry-run").done().to_owned();
    let expected = "stage would go from 0mm to -3mm: -3mm (-120 full steps), about 0.8 s
the position is trusted
this would be sent:
  06 11 01 00 C8  MAX_SPEED = 200
  10 11 06 00 02 04 F8 80 FF FF  TARGET_POS = -1920
  06 11 09 00 10  CMD = MOVE_F
";
    assert_eq!(text, expected);
    let text = bench.run("move -a uhv to 1 turn --dry-run").done().to_owned();
    assert!(text.ends_with("this would be sent:\n  RUNA,200\n"), "{text}");
    let dry = bench.json("move -a uhv by 0.3333 turns --dry-run");
    let expected = [
        "axis",
        "distance_full_steps",
        "distance_turns",
        "dry_run",
        "expected_s",
        "from_turns",
        "rounded",
        "sent",
        "to_turns",
        "trust",
    ];
    assert_eq!(keys(&dry), expected);
    assert_eq!(
        (&dry["sent"], &dry["rounded"], &dry["dry_run"]),
        (&json!(["RUNR,67"]), &json!(true), &json!(true))
    );
    let text = bench.run("move -a uhv by 0.3333 turns --dry-run").done().to_owned();
    assert!(
        text.contains(
            "by 0.3333 turns is between two positions that the controller counts; 0.335 turns is the nearest"
        ),
        "{text}"
    );
    assert_eq!((carriage(&bench, 0), carriage(&bench, 1)), (json!(0.0), json!(0.0)));
    assert_eq!(
        bench.run("get -a stage MAX_SPEED TARGET_POS").done(),
        "MAX_SPEED = 1000 full steps/s\nTARGET_POS = 0 microsteps\n"
    );
    bench.run("move -a stage to 500mm --dry-run").refused(7);
}

#[test]
fn without_waiting_a_move_returns_as_soon_as_it_has_begun() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    let text = bench.run("move -a stage to 150mm --speed 1mm/s --no-wait").done().to_owned();
    assert!(text.starts_with("stage goes from 0mm to 150mm: 150mm, about 15"), "{text}");
    let status = bench.json("status -a stage");
    assert_eq!((&status["moving"], &status["trust"]), (&json!(true), &json!("trusted")));
    let said = bench.run("move -a stage by 1mm").refused(7);
    assert!(said.starts_with("stage moves already, at ") && said.ends_with("nothing was sent"), "{said}");
    bench.run("zero -a stage").refused(7);
    bench.run("home -a stage").refused(7);
    bench.run("stop -a stage").done();
    assert_eq!(bench.json("status -a stage")["trust"], "trusted");
    let begun = bench.json("move -a uhv by -10 turns --no-wait");
    assert_eq!((&begun["to_turns"], &begun["axis"]), (&json!(-10.0), &json!("uhv")));
}

#[test]
fn a_move_beyond_a_soft_limit_is_exit_code_7_before_anything_is_sent() {
    let bench = Bench::start();
    bench.make_ready();
    for words in ["to 500mm", "by -10.1mm", "to 200.001mm"] {
        let said = bench.run(&format!("move -a stage {words}")).refused(7);
        assert!(said.contains("beyond the soft limits [-10, 200] mm; nothing was sent"), "{said}");
    }
    assert_eq!(carriage(&bench, 0), 0.0);
}

#[test]
fn units_and_words_that_do_not_fit_are_exit_code_1() {
    let bench = Bench::start();
    bench.make_ready();
    for (words, told) in [
        ("to 5 deg", "5 deg: deg do not fit this axis, which takes mm, turns, steps"),
        ("by 5", "`5` lacks a unit, as in `5 steps`; units are mm, deg, turns, steps"),
        ("5mm", "`5mm` does not say whether to go `to` a position or `by` a distance, as in `by 5mm`"),
        ("to 5 furlongs", "the unit `furlongs` is unknown; it is one of mm, deg, turns, steps"),
        ("by 1mm --speed 1deg/s", "1 deg/s: deg/s do not fit this axis, which takes mm, turns, steps"),
        ("by 1mm --speed 0mm/s", "a speed is above 0, not 0mm/s; the direction is said by itself"),
        (
            "by 1mm --dry-run --speed 2500mm/s",
            "MAX_SPEED 100000 is out of range: 16 to 15600 full steps/s; nothing was sent",
        ),
        (
            "by 1mm --dry-run --speed 0.000000001turns/s",
            "MAX_SPEED 2e-7 is out of range: 16 to 15600 full steps/s; nothing was sent",
        ),
    ] {
        assert_eq!(bench.run(&format!("move -a stage {words}")).refused(1), told, "{words}");
    }
    for words in ["to 5mm --speed fast", "to 5mm --timeout 0s", "to 5mm --no-wait --dry-run", ""] {
        let ran = bench.run(&format!("move -a stage {words}"));
        assert_eq!((ran.code(), ran.stdout()), (1, ""), "{words}");
    }
    let said = bench.run("move -a uhv by 100000 turns").refused(1);
    assert!(said.contains("where the counter does not reach"), "{said}");
    assert_eq!(carriage(&bench, 0), 0.0);
}

#[test]
fn a_position_that_is_not_trusted_is_no_place_to_go_to_unless_it_is_overridden() {
    let bench = Bench::start();
    let said = bench.run("move -a stage to 5mm").refused(7);
    let expected = "the position of stage is unknown: the axis has not been homed; home it, take a place as zero, or override \
                    this with --untrusted; nothing was sent";
    assert_eq!(said, expected);
    let text = bench.run("move -a stage to 5mm --untrusted").done().to_owned();
    assert_eq!(text, "stage is at 5mm (200 full steps), unknown: the axis has not been homed\n");
    bench.run("move -a stage by 1mm").done();
}

#[test]
fn trust_lasts_from_one_command_to_the_next_until_something_spoils_it() {
    let bench = Bench::start();
    bench.make_ready();
    bench.run("move -a stage to 5mm").done();
    assert_eq!(bench.json("status -a stage")["trust"], "trusted");
    bench.run("stop -a stage --free").done();
    bench.run("stop -a stage").done();
    let status = bench.json("status -a stage");
    assert_eq!(
        (&status["trust"], &status["doubt"]),
        (&json!("unknown"), &json!("the motor was de-energised"))
    );
    bench.rig.rig("power uhv off").done();
    bench.rig.rig("power uhv on").done();
    let status = bench.json("status -a uhv");
    assert_eq!(
        (&status["trust"], &status["doubt"]),
        (&json!("unknown"), &json!("the controller has started over"))
    );
}

#[test]
fn homing_finds_the_switch_and_makes_the_position_trusted() {
    let bench = Bench::start();
    assert_eq!(bench.run("home -a stage").done(), "stage is at 0mm (0 full steps), trusted\n");
    assert_near(&bench, 0, -100.0);
    bench.make_ready();
    let homed = bench.json("home -a uhv + --speed '1 turns/s'");
    assert_eq!((&homed["position_turns"], &homed["trust"]), (&json!(0.0), &json!("trusted")));
    assert_near(&bench, 1, 400.0);
    bench.run("move -a uhv to -1 turn").done();
}

#[test]
fn homing_that_comes_to_nothing_says_why() {
    let bench = Bench::start();
    let said = bench.run("home -a uhv -").refused(7);
    assert!(
        said.ends_with("the limit input of that direction is not in use; enable it with L 1 and L- 1"),
        "{said}"
    );
    bench.run("set -a stage Mask 0").done();
    let said = bench.run("home -a stage").refused(7);
    assert!(
        said.starts_with("the input SET_ZERO of stage is masked") && said.ends_with("nothing was sent"),
        "{said}"
    );
    bench.run("set -a stage Mask 255").done();
    bench.rig.rig("fault stage.SET_ZERO stuck-open").done();
    let said = bench.run("home -a stage --timeout 300ms").refused(2);
    assert!(said.contains("did not find SET_ZERO in the time given; the motor was stopped"), "{said}");
    assert_eq!(bench.json("status -a stage")["moving"], false);
}

#[test]
fn zero_takes_the_place_where_it_stands() {
    let bench = Bench::start();
    let said = bench.run("zero -a stage").refused(7);
    assert!(said.starts_with("the motor of stage is de-energised"), "{said}");
    bench.run("move -a stage by 4mm").done();
    assert_eq!(bench.run("zero -a stage").done(), "stage is at 0mm (0 full steps), trusted\n");
    assert_eq!(carriage(&bench, 0), 160.0);
    let zero: Value = bench.json("zero -a uhv");
    assert_eq!(
        (&zero["axis"], &zero["position_turns"], &zero["trust"]),
        (&json!("uhv"), &json!(0.0), &json!("trusted"))
    );
}

#[test]
fn a_run_goes_on_to_the_soft_limit_or_until_it_is_stopped() {
    let bench = Bench::start();
    bench.make_ready();
    assert_eq!(
        bench.run("run -a stage - 50 mm/s").done(),
        "stage runs in direction -, to the soft limit -10mm\n"
    );
    crate::rig::until(|| bench.json("status -a stage")["moving"] == false);
    assert_eq!(carriage(&bench, 0), -400.0);
    bench.rig.rig("clock real").done();
    assert_eq!(bench.run("run -a uhv - 0.5turns/s").done(), "uhv runs in direction -, until it is stopped\n");
    let near = |speed: f64| (speed + 0.5).abs() < 0.01;
    crate::rig::until(|| bench.json("status -a uhv")["speed_turns_per_s"].as_f64().is_some_and(near));
    assert_eq!(bench.json("stop -a uhv")["moving"], false);
    let run = bench.json("run -a stage +");
    assert_eq!(run, json!({ "axis": "stage", "direction": "+", "soft_limit_mm": 200.0 }));
    bench.run("run -a stage +").refused(7);
    let ran = bench.run("run -a stage x");
    assert!(ran.code() == 1 && ran.stderr().contains("a direction is + or -"), "{}", ran.stderr());
    bench.run("run -a stage + 5mm").refused(1);
}

#[test]
fn a_run_towards_a_soft_limit_wants_a_position_that_is_trusted() {
    let bench = Bench::start();
    bench.energise();
    let said = bench.run("run -a stage +").refused(7);
    assert!(said.starts_with("the position of stage is unknown"), "{said}");
    bench.run("run -a stage + --untrusted").done();
}

#[test]
fn a_limit_switch_that_ends_a_move_is_exit_code_7() {
    let bench = Bench::start();
    bench.make_ready();
    let said = bench.run("move -a uhv by 3 turns").refused(7);
    assert!(
        said.contains("instead of 3 turns: the limit switch there stopped it; move it away from it"),
        "{said}"
    );
    assert_eq!(bench.json("status -a uhv")["trust"], "suspect");
}

#[test]
fn a_fault_that_ends_a_move_is_exit_code_8() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    let running = bench.start_command("move -a uhv by -20 turns");
    crate::rig::until(|| bench.json("status -a uhv")["moving"] == true);
    bench.rig.rig("fault uhv.thermocouple open").done();
    let said = running.end().refused(8);
    assert!(said.contains("instead of -20 turns: TOPEN (The selected temperature sensor is open)"), "{said}");
    assert_eq!(bench.json("status -a uhv")["trust"], "unknown");
}

#[test]
fn a_timeout_ends_the_wait_and_not_the_move() {
    let bench = Bench::in_real_time();
    bench.make_ready();
    let said = bench.run("move -a stage to 100mm --speed 1mm/s --timeout 100ms").refused(2);
    assert!(
        said.starts_with("stage still moves after 100ms, at ") && said.ends_with("it was not stopped"),
        "{said}"
    );
    assert_eq!(bench.json("status -a stage")["moving"], true);
}
