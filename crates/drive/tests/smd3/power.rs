//! Switching off and on again.

use crate::bench::{Bench, MS, SECOND, assert_near, assert_takes};
use core::time::Duration;
use stepdrive_drive::controller::Controller;
use stepdrive_drive::smd3::{Config, Phases, Quantity, Smd3, Stored, Thermal, Timer};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smd3::signals::{Sensor, Signal};

/// Off for some time, and on with these signals.
fn cycle(bench: &mut Bench, off: Duration, signals: u16) {
    bench.drive.switch_off(bench.now);
    bench.run_for(off);
    bench.drive.switch_on(bench.now, signals);
}

/// Everything that can be looked at but the temperature.
fn everything(drive: &Smd3, bench: &Bench) -> Vec<(&'static str, f64)> {
    let cold = [Quantity::Temperature, Quantity::Command(Command::Tmot)];
    Smd3::quantities()
        .filter(|(_, quantity)| !cold.contains(quantity))
        .map(|(name, quantity)| (name, drive.look(bench.now, quantity)))
        .collect()
}

/// A drive that runs, with settings of which half are stored.
fn busy() -> Bench {
    let mut bench = Bench::new();
    bench.set("VMAX", 700);
    bench.set("IH", 0.5);
    bench.order("STORE", "");
    bench.set("VMAX", 300);
    bench.set("IDENT", 1);
    bench.set("L", 1);
    bench.set("PACT", 1000);
    bench.order("RUNV", "-");
    bench.run_for(SECOND);
    assert!(bench.velocity() < 0.0 && bench.position() < 1000.0);
    bench
}

#[test]
fn a_power_cycle_is_a_power_up_with_what_was_stored() {
    for signals in [0, Signal::Joystick.bit() | Signal::LimitPositive.bit()] {
        let mut bench = busy();
        let stored = *bench.drive.stored();
        cycle(&mut bench, SECOND, signals);
        assert_eq!(*bench.drive.stored(), stored);
        let fresh = Smd3::power_up(bench.now, Config::default(), stored, signals);
        assert_eq!(everything(&bench.drive, &bench), everything(&fresh, &bench));
        assert_eq!((bench.drive.rotor(bench.now), bench.drive.next_wake()), (0, None));
        assert_near(bench.get("VMAX"), 700.0, 0.01);
        assert_near(bench.get("MODE"), if signals == 0 { 2.0 } else { 3.0 }, 0.0);
    }
}

#[test]
fn without_supply_the_rotor_stands_and_nothing_answers() {
    let mut bench = busy();
    let rotor = bench.drive.rotor(bench.now);
    bench.drive.switch_off(bench.now);
    assert!(!bench.drive.is_on());
    assert_eq!((bench.drive.phases(bench.now), bench.drive.next_wake()), (Phases::Off, None));
    bench.run_for(100 * SECOND);
    assert_eq!(bench.drive.rotor(bench.now), rotor);
    assert_near(bench.current(), 0.0, 0.0);
    assert!(rotor < 0 && everything(&bench.drive, &bench).iter().all(|(_, value)| value.to_bits() == 0));
}

#[test]
fn signals_and_wake_ups_do_nothing_without_supply() {
    let mut bench = Bench::in_mode(0);
    bench.order("STORE", "");
    bench.drive.switch_off(bench.now);
    for signal in [Signal::Joystick, Signal::Step, Signal::JoystickCw, Signal::ResetFault] {
        bench.signal(signal, true);
        bench.drive.handle_wake(bench.now);
    }
    assert_eq!((bench.drive.next_wake(), bench.drive.rotor(bench.now)), (None, 0));
    bench.drive.switch_on(bench.now, 0);
    assert_near(bench.get("MODE"), 0.0, 0.0);
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn the_winding_cools_while_the_supply_is_gone_and_goes_on_from_there() {
    let mut bench = Bench::new();
    bench.set("IH", 0);
    bench.order("STORE", "");
    bench.set("MODE", 4);
    bench.order("RUNB", "");
    bench.run_for(7200 * SECOND);
    let warm = bench.temperature();
    assert_near(warm, 150.0, 0.1);
    bench.drive.switch_off(bench.now);
    for minutes in [0.0_f64, 5.0, 10.0, 30.0] {
        let off = Duration::from_secs_f64(minutes * 60.0);
        let expected = 20.0 + (warm - 20.0) * (-minutes / 10.0).exp();
        let seen = Smd3::find_quantity("TEMPERATURE").expect("there");
        assert_near(bench.drive.look(bench.now + off, seen), expected, 1e-9);
    }
    bench.run_for(600 * SECOND);
    bench.drive.switch_on(bench.now, 0);
    let after = 20.0 + (warm - 20.0) * (-1.0_f64).exp();
    assert_near(bench.get("TMOT"), after, 1e-9);
    bench.run_for(600 * SECOND);
    assert_near(bench.get("TMOT"), 20.0 + (after - 20.0) * (-1.0_f64).exp(), 1e-9);
}

#[test]
fn a_motor_that_was_switched_off_too_warm_trips_again_when_it_is_switched_on() {
    let mut bench = Bench::warming(Thermal { rise_k: 400.0, ..Thermal::default() });
    bench.order("RUNV", "+");
    bench.run_until(|bench| bench.flag("TOVR"));
    cycle(&mut bench, MS, 0);
    // A millisecond cools it below the trip, and the hold current does not bring it back.
    assert_eq!(bench.flags(), "STANDBY");
    bench.order("RUNV", "+");
    bench.run_until(|bench| bench.flag("TOVR"));
    bench.drive.heat(bench.now, Some(250.0));
    bench.drive.heat(bench.now, None);
    cycle(&mut bench, SECOND, 0);
    assert_eq!(bench.flags(), "STANDBY, TOVR");
    cycle(&mut bench, 600 * SECOND, 0);
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn the_trip_is_found_from_the_temperature_at_switching_on() {
    let thermal = Thermal { rise_k: 400.0, ..Thermal::default() };
    let mut bench = Bench::warming(thermal);
    bench.set("IH", 0);
    bench.order("STORE", "");
    bench.drive.heat(bench.now, Some(160.0));
    bench.drive.heat(bench.now, None);
    cycle(&mut bench, 60 * SECOND, 0);
    let from = 20.0 + 140.0 * (-0.1_f64).exp();
    bench.set("IR", 1);
    bench.set("IA", 1);
    bench.order("RUNV", "+");
    assert!(bench.drive.next_wake().is_some_and(|(_, timer)| timer == Timer::Motion));
    let took = bench.run_until(|bench| bench.flag("TOVR"));
    // 1 A as sine and cosine: on the way to 220 °C.
    assert_takes(took, 600.0 * ((from - 220.0_f64) / (190.0 - 220.0)).ln());
}

#[test]
fn latched_errors_go_with_the_supply_unless_their_cause_is_there() {
    let mut bench = Bench::new();
    bench.order("ESTOP", "");
    bench.drive.set_sensor(bench.now, Sensor::Open);
    bench.drive.short_motor(bench.now, true);
    assert_eq!(bench.flags(), "STANDBY, TOPEN, EMERGENCY STOP");
    cycle(&mut bench, SECOND, 0);
    assert_eq!(bench.flags(), "STANDBY, TOPEN");
    bench.drive.set_sensor(bench.now, Sensor::Connected);
    cycle(&mut bench, SECOND, 0);
    // The hold current finds the short circuit.
    assert_eq!(bench.flags(), "STANDBY, MOTOR SHORT");
}

#[test]
fn what_is_wrong_outside_may_come_and_go_while_the_drive_is_off() {
    let mut bench = Bench::new();
    bench.drive.switch_off(bench.now);
    bench.drive.set_sensor(bench.now, Sensor::Open);
    bench.drive.short_motor(bench.now, true);
    bench.drive.heat(bench.now, Some(300.0));
    bench.drive.wear_flash(true);
    bench.drive.damage_store(true);
    assert_eq!(bench.drive.next_wake(), None);
    bench.run_for(SECOND);
    assert_near(bench.temperature(), 300.0, 0.0);
    bench.drive.switch_on(bench.now, 0);
    assert_eq!(bench.flags(), "STANDBY, TOPEN, CONFIGURATION ERROR");
    assert!(bench.drive.flash_worn() && bench.drive.store_damaged());
    bench.drive.switch_off(bench.now);
    bench.drive.set_sensor(bench.now, Sensor::Connected);
    bench.drive.short_motor(bench.now, false);
    bench.drive.heat(bench.now, Some(20.0));
    bench.drive.wear_flash(false);
    bench.drive.damage_store(false);
    bench.drive.switch_on(bench.now, 0);
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn the_external_enable_is_asked_for_from_the_start() {
    let mut bench = Bench::new();
    bench.signal(Signal::Enable, true);
    bench.set("EXTEN", 1);
    bench.order("STORE", "");
    cycle(&mut bench, SECOND, Signal::Enable.bit());
    assert_eq!(bench.flags(), "EXTEN, STANDBY");
    cycle(&mut bench, SECOND, 0);
    assert_eq!(bench.flags(), "STANDBY, EXTERNAL DISABLE");
}

#[test]
fn the_rotor_counts_from_0_again_and_goes_as_far() {
    let mut bench = Bench::new();
    for _ in 0..3 {
        bench.order("RUNR", "-10");
        bench.run_until_standby();
        assert_eq!(bench.drive.rotor(bench.now), -10 * Smd3::ROTOR_UNITS);
        cycle(&mut bench, SECOND, 0);
        assert_eq!(bench.drive.rotor(bench.now), 0);
        assert_near(bench.position(), 0.0, 0.0);
    }
}

#[test]
fn the_records_are_what_the_flash_holds() {
    let records = |drive: &Smd3| {
        let mut records = Vec::new();
        drive.for_each_record(&mut |record| records.push(record.to_vec()));
        records
    };
    let mut bench = Bench::new();
    let nothing = records(&bench.drive);
    bench.set("VMAX", 500);
    assert_eq!(records(&bench.drive), nothing);
    bench.order("STORE", "");
    let stored = records(&bench.drive);
    assert_eq!(stored, [bench.drive.settings().encode().to_vec()]);
    cycle(&mut bench, SECOND, 0);
    bench.drive.damage_store(true);
    assert_eq!(records(&bench.drive), stored, "it is not lost");
    let damaged = Bench::with(Config::default(), &Stored::Damaged, 0);
    assert!(records(&damaged.drive) != nothing && records(&damaged.drive) != stored);
    assert!(Smd3::OUTPUTS.is_empty() && bench.drive.outputs() == 0);
}
