//! The error flags: latched, and cleared only when their cause is gone.

use crate::bench::{Bench, SECOND, assert_near};
use stepdrive_drive::smd3::{Config, Phases, Stored};
use stepdrive_spec::smd3::signals::{Sensor, Signal};

/// A fault: its flag, how it comes, how it goes.
type Fault = (&'static str, fn(&mut Bench), fn(&mut Bench));

const FAULTS: [Fault; 5] = [
    ("TSHORT", |b| with_rtd(b, Sensor::Short), |b| with_rtd(b, Sensor::Connected)),
    ("TOPEN", |b| sensor(b, Sensor::Open), |b| sensor(b, Sensor::Connected)),
    ("MOTOR SHORT", |b| b.drive.short_motor(b.now, true), |b| b.drive.short_motor(b.now, false)),
    ("EXTERNAL DISABLE", |b| assert_near(b.set("EXTEN", 1), 1.0, 0.0), |b| b.signal(Signal::Enable, true)),
    ("EMERGENCY STOP", |b| b.order("ESTOP", ""), |_| {}),
];

fn sensor(bench: &mut Bench, sensor: Sensor) {
    bench.drive.set_sensor(bench.now, sensor);
}

fn with_rtd(bench: &mut Bench, state: Sensor) {
    bench.set("TSEL", 1);
    sensor(bench, state);
}

#[test]
fn every_fault_stops_the_motor_at_once_and_holds_until_it_is_cleared() {
    for (flag, comes, goes) in FAULTS {
        let mut bench = Bench::new();
        bench.order("RUNV", "+");
        bench.run_for(SECOND);
        let position = bench.position();
        comes(&mut bench);
        assert_eq!(bench.flags(), format!("STANDBY, {flag}"));
        assert_near(bench.position(), position, 0.0);
        assert_near(bench.current(), 0.0, 0.0);
        assert_eq!(bench.drive.phases(bench.now), Phases::Off);
        bench.refused("RUNV", "+", -7);
        goes(&mut bench);
        assert!(bench.flag(flag), "it is latched");
        bench.order("CLR", "");
        assert!(!bench.flag(flag), "{flag}");
        bench.order("RUNV", "+");
    }
}

#[test]
fn clr_and_the_reset_input_leave_what_is_still_there() {
    for (flag, comes, goes) in FAULTS.into_iter().filter(|(flag, _, _)| *flag != "EMERGENCY STOP") {
        for by_input in [false, true] {
            let mut bench = Bench::new();
            let clear = |bench: &mut Bench| {
                if by_input {
                    bench.signal(Signal::ResetFault, true);
                    bench.signal(Signal::ResetFault, false);
                } else {
                    bench.order("CLR", "");
                }
            };
            comes(&mut bench);
            bench.order("ESTOP", "");
            clear(&mut bench);
            assert!(bench.flags().ends_with(flag), "{}", bench.flags());
            goes(&mut bench);
            clear(&mut bench);
            assert!(!bench.flag(flag), "{flag}");
        }
    }
}

#[test]
fn a_reset_input_that_stays_clears_nothing_more() {
    let mut bench = Bench::new();
    bench.signal(Signal::ResetFault, true);
    bench.order("ESTOP", "");
    assert!(bench.flag("EMERGENCY STOP"));
    bench.signal(Signal::ResetFault, false);
    assert!(bench.flag("EMERGENCY STOP"));
}

#[test]
fn the_enable_input_counts_only_while_it_is_used() {
    let mut bench = Bench::new();
    bench.signal(Signal::Enable, true);
    assert_eq!(bench.flags(), "EXTEN, STANDBY");
    bench.set("EXTEN", 1);
    assert_eq!(bench.flags(), "EXTEN, STANDBY");
    bench.signal(Signal::Enable, false);
    assert_eq!(bench.flags(), "STANDBY, EXTERNAL DISABLE");
    bench.set("EXTEN", 0);
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn a_thermocouple_has_no_short_circuit() {
    let mut bench = Bench::new();
    sensor(&mut bench, Sensor::Short);
    assert_eq!(bench.flags(), "STANDBY");
    assert_near(bench.get("TMOT"), 20.0, 0.0);
    bench.set("TSEL", 1);
    assert_eq!(bench.flags(), "STANDBY, TSHORT");
    assert_near(bench.get("TMOT"), 0.0, 0.0);
    bench.set("TSEL", 0);
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn an_open_sensor_reads_as_zero() {
    let mut bench = Bench::new();
    sensor(&mut bench, Sensor::Open);
    assert_near(bench.get("TMOT"), 0.0, 0.0);
}

#[test]
fn a_short_circuit_of_the_motor_shows_when_a_current_flows() {
    let mut bench = Bench::new();
    bench.set("IH", 0);
    bench.drive.short_motor(bench.now, true);
    assert_eq!(bench.flags(), "STANDBY");
    bench.order("RUNV", "+");
    assert_eq!(bench.flags(), "STANDBY, MOTOR SHORT");
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn a_damaged_configuration_is_reported_at_power_up() {
    let mut bench = Bench::with(Config::default(), &Stored::Damaged, 0);
    assert_eq!(bench.flags(), "STANDBY, CONFIGURATION ERROR");
    assert_eq!(bench.drive.settings(), &stepdrive_drive::smd3::Settings::factory());
    bench.refused("RUNV", "+", -7);
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn faults_come_together_and_go_one_by_one() {
    let mut bench = Bench::new();
    bench.order("ESTOP", "");
    sensor(&mut bench, Sensor::Open);
    bench.set("EXTEN", 1);
    assert_eq!(bench.flags(), "STANDBY, TOPEN, EXTERNAL DISABLE, EMERGENCY STOP");
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY, TOPEN, EXTERNAL DISABLE");
    sensor(&mut bench, Sensor::Connected);
    bench.order("CLR", "");
    assert_eq!(bench.flags(), "STANDBY, EXTERNAL DISABLE");
}
