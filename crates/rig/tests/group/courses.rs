//! Running until something is so.

use crate::bench::{Bench, MS, PAIR, SECOND, STAGE_AND_UHV};
use std::time::Duration;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::time::Instant;

/// A stage on its way to 800 full steps.
fn moving() -> Bench {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.pass(SECOND);
    bench.write("stage", Reg::TargetPos, 800 * 16);
    bench.command("stage", Opcode::GoTo);
    bench
}

#[test]
fn a_position_is_met_at_the_first_nanosecond_at_which_it_is_reached() {
    let mut bench = moving();
    assert!(bench.until("stage.ABS_POS >= 5000", 10 * SECOND));
    assert_eq!(bench.look("stage.ABS_POS"), 5000.0);
    let mut before = moving();
    before.pass(Duration::from_nanos(bench.now.as_nanos() - 1_000_000_001));
    assert_eq!(before.look("stage.ABS_POS"), 4999.0);
}

#[test]
fn a_flag_is_met_at_the_nanosecond_at_which_it_changes() {
    let mut bench = moving();
    assert!(bench.until("stage.READY", 10 * SECOND));
    let mut before = moving();
    before.pass(Duration::from_nanos(bench.now.as_nanos() - 1_000_000_001));
    assert_eq!([before.look("stage.READY"), bench.look("stage.READY")], [0.0, 1.0]);
}

#[test]
fn what_holds_already_takes_no_time() {
    let mut bench = moving();
    let now = bench.now;
    assert!(bench.until("!stage.READY", SECOND));
    assert_eq!(bench.now, now);
}

#[test]
fn what_never_comes_takes_the_time_given_and_no_more() {
    let mut bench = moving();
    let now = bench.now;
    assert!(!bench.until("stage.ABS_POS > 12800", 500 * MS));
    assert_eq!(bench.now, now + 500 * MS);
    assert!(!bench.until("stage.ABS_POS > 12800", Duration::from_hours(1)));
}

#[test]
fn a_condition_over_two_drives_holds_when_the_later_one_is_there() {
    let mut bench = Bench::new(PAIR, &[]);
    for (drive, steps) in [("a", 100), ("b", 400)] {
        bench.write(drive, Reg::TargetPos, steps * 16);
        bench.command(drive, Opcode::GoTo);
    }
    let mut alone = bench.clone();
    assert!(alone.until("b.READY", 10 * SECOND));
    assert!(bench.until("a.READY && b.READY", 10 * SECOND));
    assert_eq!(bench.now, alone.now);
    assert_ne!(bench.now, Instant::ZERO);
}

#[test]
fn a_temperature_is_met_while_nothing_happens_for_an_hour() {
    let mut bench = Bench::new(STAGE_AND_UHV, &[]);
    bench.line("uhv", "MODE,4").expect("bake");
    bench.line("uhv", "BAKET,120").expect("the set-point");
    bench.line("uhv", "RUNB").expect("begins");
    assert!(bench.until("uhv.TMOT > 100", Duration::from_hours(2)));
    let shown = bench.look("uhv.TMOT");
    assert!((100.0..100.001).contains(&shown), "{shown}");
}
