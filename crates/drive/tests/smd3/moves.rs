//! Velocity and positioning: durations by the textbook, retargeting, position counters.

use crate::bench::{Bench, MS, SECOND, assert_near, assert_takes};
use core::time::Duration;
use stepdrive_drive::smd3::Timer;

/// A trapezoid, in full steps and seconds.
#[derive(Clone, Copy)]
struct Textbook {
    amax: f64,
    dmax: f64,
    vstart: f64,
    vstop: f64,
    vmax: f64,
}

impl Textbook {
    fn of(bench: &mut Bench) -> Textbook {
        Textbook {
            amax: bench.get("AMAX"),
            dmax: bench.get("DMAX"),
            vstart: bench.get("VSTART"),
            vstop: bench.get("VSTOP"),
            vmax: bench.get("VMAX"),
        }
    }

    fn seconds(self, steps: f64) -> f64 {
        let Textbook { amax, dmax, vstart, vstop, vmax } = self;
        let only_faster = (vstart * vstart + 2.0 * amax * steps).sqrt();
        if only_faster <= vstop {
            return 2.0 * steps / (vstart + only_faster);
        }
        let squares = amax * vstop * vstop + dmax * vstart * vstart;
        let peak = ((2.0 * amax * dmax * steps + squares) / (amax + dmax)).sqrt();
        let top = peak.min(vmax);
        let ramps = (top * top - vstart * vstart) / (2.0 * amax) + (top * top - vstop * vstop) / (2.0 * dmax);
        (top - vstart) / amax + (top - vstop) / dmax + (steps - ramps) / top
    }
}

fn tuned(settings: &[(&str, f64)]) -> Bench {
    let mut bench = Bench::new();
    for (mnemonic, value) in settings {
        bench.set(mnemonic, value);
    }
    bench
}

#[test]
fn moves_take_as_long_as_the_textbook_says() {
    let profiles: [&[(&str, f64)]; 4] = [
        &[],
        &[("AMAX", 300.0), ("DMAX", 2000.0), ("VSTOP", 50.0), ("VSTART", 20.0)],
        &[("RES", 8.0), ("VMAX", 15_000.0), ("AMAX", 100_000.0), ("DMAX", 50_000.0)],
        &[("VMAX", 3.5), ("AMAX", 1.0), ("DMAX", 1.0), ("VSTART", 0.5), ("VSTOP", 0.7)],
    ];
    for profile in profiles {
        for steps in [1_i32, 7, 400, 5000] {
            let mut bench = tuned(profile);
            let textbook = Textbook::of(&mut bench);
            bench.order("RUNA", &steps.to_string());
            assert_takes(bench.run_until_standby(), textbook.seconds(steps.into()));
            assert_near(bench.position(), steps.into(), 0.0);
            bench.order("RUNR", &(-2 * steps).to_string());
            assert_takes(bench.run_until_standby(), textbook.seconds((2 * steps).into()));
            assert_near(bench.position(), (-steps).into(), 0.0);
        }
    }
}

#[test]
fn velocity_mode_ramps_with_amax_and_without_vstart() {
    let mut bench = tuned(&[("AMAX", 500.0), ("DMAX", 2000.0), ("VSTOP", 200.0), ("VSTART", 100.0)]);
    let (amax, vmax) = (bench.get("AMAX"), bench.get("VMAX"));
    bench.order("RUNV", "+");
    assert_eq!(bench.flags(), "");
    bench.run_for(SECOND);
    assert_near(bench.velocity(), amax, 1e-6);
    bench.run_until(|bench| bench.flag("ATSPEED"));
    assert_takes(bench.now.since(stepdrive_spec::time::Instant::ZERO), vmax / amax);
    assert_near(bench.get("VACT"), vmax, 1e-9);
    bench.run_for(100 * SECOND);
    assert_eq!(bench.flags(), "ATSPEED");
    bench.order("RUNV", "-");
    assert_eq!(bench.flags(), "");
    let reversal = bench.run_until(|bench| bench.flag("ATSPEED"));
    assert_takes(reversal, 2.0 * vmax / amax);
    assert_near(bench.get("VACT"), -vmax, 1e-9);
}

#[test]
fn a_run_costs_one_wake_up() {
    let mut bench = Bench::new();
    bench.order("RUNV", "-");
    bench.run_for(24 * 3600 * SECOND);
    assert_eq!(bench.wakes, 1);
    let vmax = bench.get("VMAX");
    assert_near(
        bench.drive.rotor(bench.now) as f64 / 256.0,
        -vmax * (86_400.0 - 0.5 * vmax / bench.get("AMAX")),
        0.01,
    );
}

#[test]
fn a_new_vmax_in_flight_is_ramped_to_with_amax() {
    let mut bench = tuned(&[("AMAX", 500.0), ("DMAX", 2000.0)]);
    bench.order("RUNV", "+");
    bench.run_until(|bench| bench.flag("ATSPEED"));
    let before = bench.get("VMAX");
    let after = bench.set("VMAX", 400);
    assert!(!bench.flag("ATSPEED"));
    let amax = bench.get("AMAX");
    assert_takes(bench.run_until(|bench| bench.flag("ATSPEED")), (before - after) / amax);
    let faster = bench.set("VMAX", 2000);
    assert_takes(bench.run_until(|bench| bench.flag("ATSPEED")), (faster - after) / amax);
}

#[test]
fn a_move_goes_on_under_a_new_profile_and_ends_on_its_target() {
    for change in [
        ("VMAX", "300"),
        ("VMAX", "3000"),
        ("AMAX", "50"),
        ("DMAX", "50"),
        ("VSTOP", "300"),
        ("VSTART", "5"),
        ("TZW", "1"),
    ] {
        for at in [200, 1500, 4900] {
            let mut bench = Bench::new();
            bench.order("RUNA", "5000");
            bench.run_for(at * MS);
            bench.set(change.0, change.1);
            bench.run_until_standby();
            assert_near(bench.position(), 5000.0, 0.0);
        }
    }
}

#[test]
fn a_new_target_in_flight_is_gone_to_by_the_fastest_legal_way() {
    // Before, while and after it could still stop there.
    for target in ["10", "700", "3000", "-500", "9000"] {
        for at in [100, 1200, 3500] {
            let mut bench = Bench::new();
            bench.order("RUNA", "4000");
            bench.run_for(at * MS);
            bench.order("RUNA", target);
            bench.run_until_standby();
            assert_near(bench.position(), target.parse().expect("a number"), 0.0);
        }
    }
}

#[test]
fn a_run_can_become_a_move_and_a_move_a_run() {
    let mut bench = Bench::new();
    bench.order("RUNV", "-");
    bench.run_for(SECOND);
    bench.order("RUNA", "300");
    bench.run_until_standby();
    assert_near(bench.position(), 300.0, 0.0);
    bench.order("RUNA", "9000");
    bench.run_for(SECOND);
    bench.order("RUNV", "+");
    bench.run_for(20 * SECOND);
    assert!(bench.position() > 15_000.0 && bench.flag("ATSPEED"));
}

#[test]
fn atspeed_is_set_on_the_plateau_alone() {
    let mut bench = Bench::new();
    bench.order("RUNA", "3000");
    let mut seen = vec![bench.flags()];
    while !bench.standby() {
        bench.step(stepdrive_spec::time::Instant::FAR_FUTURE);
        seen.push(bench.flags());
    }
    assert_eq!(seen, ["", "ATSPEED", "", "STANDBY"]);
}

#[test]
fn standby_comes_back_after_standstill_and_tzw() {
    let mut bench = tuned(&[("TZW", 1.5)]);
    let (tzw, textbook) = (bench.get("TZW"), Textbook::of(&mut bench));
    bench.order("RUNR", "100");
    bench.run_until(|bench| bench.drive.next_wake().is_some_and(|(_, timer)| timer == Timer::Rest));
    assert_near(bench.velocity(), 0.0, 0.0);
    assert!(!bench.standby());
    bench.run_until_standby();
    assert_takes(bench.now.since(stepdrive_spec::time::Instant::ZERO), textbook.seconds(100.0) + tzw);
}

#[test]
fn positioning_waits_for_tzw_and_velocity_mode_does_not() {
    let mut bench = tuned(&[("TZW", 2.0)]);
    let textbook = Textbook::of(&mut bench);
    bench.order("RUNA", "100");
    bench.run_until(|bench| bench.position() >= 100.0);
    bench.order("RUNA", "200");
    bench.run_for(SECOND);
    assert_near(bench.position(), 100.0, 0.0);
    assert_eq!(bench.flags(), "");
    let rest = bench.run_until_standby() + SECOND;
    assert_takes(rest, 2.0 * bench.get("TZW") + textbook.seconds(100.0));
    bench.order("RUNA", "0");
    bench.run_until(|bench| bench.position() <= 0.0);
    bench.order("RUNV", "+");
    bench.run_for(SECOND);
    assert!(bench.position() > 400.0);
}

#[test]
fn a_reversal_of_a_move_waits_for_tzw() {
    let mut bench = tuned(&[("TZW", 1.0)]);
    bench.order("RUNA", "5000");
    bench.run_for(2 * SECOND);
    bench.order("RUNA", "0");
    bench.run_until(|bench| bench.velocity() <= 0.0);
    let (at, turn) = (bench.now, bench.position());
    bench.run_for(999 * MS);
    assert_near(bench.position(), turn, 0.0);
    assert!(!bench.standby());
    bench.run_until(|bench| bench.velocity() < 0.0);
    assert_takes(
        bench.now.since(at),
        bench.drive.settings().get(stepdrive_spec::smd3::commands::Command::Tzw),
    );
    bench.run_until_standby();
    assert_near(bench.position(), 0.0, 0.0);
}

#[test]
fn a_move_to_where_it_is_leaves_it_in_standby() {
    let mut bench = tuned(&[("TZW", 1.0)]);
    bench.order("RUNA", "0");
    bench.order("RUNR", "0");
    assert_eq!(bench.flags(), "STANDBY");
    assert_eq!(bench.drive.next_wake(), None);
}

#[test]
fn the_position_has_fractions_and_the_two_counters_are_set_apart() {
    let mut bench = Bench::new();
    assert_near(bench.set("PACT", 10.3), 10.0 + 77.0 / 256.0, 0.0);
    assert_near(bench.set("PREL", -0.001), 0.0, 0.0);
    bench.order("RUNR", "5");
    bench.run_until_standby();
    assert_near(bench.get("PACT"), 15.0 + 77.0 / 256.0, 0.0);
    assert_near(bench.get("PREL"), 5.0, 0.0);
    bench.order("RUNA", "0");
    bench.refused("PACT", "0", -1);
    assert_near(bench.set("PREL", 100), 100.0, 0.0);
    bench.run_until_standby();
    assert_near(bench.get("PACT"), 0.0, 0.0);
    assert_near(bench.get("PREL"), 100.0 - 15.0 - 77.0 / 256.0, 0.0);
}

#[test]
fn positions_turn_over_at_their_ends_and_the_way_is_the_shorter() {
    let mut bench = Bench::new();
    bench.refused("PACT", "8388608", -2);
    assert_near(bench.set("PACT", -8_388_608), -8_388_608.0, 0.0);
    bench.order("RUNR", "-1");
    bench.run_until_standby();
    assert_near(bench.position(), 8_388_607.0, 0.0);
    bench.order("RUNA", "-8388607");
    bench.run_until_standby();
    assert_near(bench.position(), -8_388_607.0, 0.0);
    assert_eq!(bench.drive.rotor(bench.now), 256);
    bench.refused("RUNA", "-8388608", -2);
}

#[test]
fn the_longest_relative_move_goes_the_way_it_was_sent() {
    let mut bench = tuned(&[("VMAX", 15_000.0)]);
    bench.order("RUNR", "8388607");
    bench.run_for(SECOND);
    assert!(bench.velocity() > 0.0);
    bench.run_until_standby();
    assert_eq!(bench.drive.rotor(bench.now), 8_388_607 * 256);
}

#[test]
fn the_rotor_is_where_it_was_foretold() {
    let mut bench = Bench::new();
    bench.order("RUNA", "-2000");
    for place in [-1, -100_000, -500_000] {
        let at = bench.drive.when_rotor_reaches(place).expect("on its way");
        assert!(bench.drive.rotor(at) <= place);
        let before = stepdrive_spec::time::Instant::from_nanos(at.as_nanos() - 1);
        assert!(bench.drive.rotor(before) > place);
    }
    assert_eq!(bench.drive.when_rotor_reaches(1), None);
    assert_eq!(bench.drive.when_rotor_reaches(-2001 * 256), None);
}

#[test]
fn the_slowest_and_the_fastest_runs_are_kept_up() {
    let mut bench = tuned(&[("VMAX", 0.001)]);
    let slowest = bench.get("VMAX");
    bench.order("RUNV", "+");
    bench.run_for(Duration::from_hours(1000));
    assert_near(bench.position(), slowest * 3.6e6, 1.0);
    let mut bench = tuned(&[("VMAX", 15_000.0)]);
    bench.order("RUNV", "+");
    bench.run_for(Duration::from_hours(24 * 365));
    assert!(bench.flag("ATSPEED"));
}

#[test]
fn the_destination_of_a_move_is_known_while_it_waits_and_while_it_goes() {
    let mut bench = tuned(&[("TZW", 2.0)]);
    assert_eq!(bench.drive.destination(), None);
    bench.order("RUNA", "100");
    assert_eq!(bench.drive.destination(), Some(100 * 256));
    bench.run_until(|bench| bench.position() >= 100.0);
    assert_eq!(bench.drive.destination(), None);
    bench.order("RUNA", "-20");
    assert_eq!(bench.drive.destination(), Some(-20 * 256), "it waits for the end of the rest");
    bench.run_until_standby();
    bench.order("RUNV", "+");
    assert_eq!(bench.drive.destination(), None);
    bench.run_for(SECOND);
    bench.order("STOP", "");
    let planned = bench.drive.destination().expect("it brakes");
    bench.run_until(|bench| bench.velocity() <= 0.0);
    assert_eq!(bench.drive.rotor(bench.now), planned);
}
