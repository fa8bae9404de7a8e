//! What can be looked at.

use crate::bench::{Bench, MS, SECOND, assert_near};
use core::time::Duration;
use stepdrive_drive::controller::Controller;
use stepdrive_drive::smd3::{Quantity, Smd3, Thermal};
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, Kind};
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, STATUS_FLAGS};
use stepdrive_spec::smd3::signals::{Sensor, Signal};
use stepdrive_spec::time::Instant;

fn find(name: &str) -> Quantity {
    Smd3::find_quantity(name).unwrap_or_else(|| panic!("there is no {name}"))
}

fn look(bench: &Bench, name: &str) -> f64 {
    bench.drive.look(bench.now, find(name))
}

#[test]
fn names_are_unique_whatever_their_case() {
    let mut names: Vec<String> = Smd3::quantities().map(|(name, _)| name.to_ascii_uppercase()).collect();
    names.sort();
    let all = names.len();
    names.dedup();
    assert_eq!(names.len(), all);
}

#[test]
fn every_name_leads_back_to_its_quantity_in_any_case() {
    for (name, quantity) in Smd3::quantities() {
        assert_eq!(Smd3::find_quantity(name), Some(quantity));
        assert_eq!(Smd3::find_quantity(&name.to_ascii_lowercase()), Some(quantity));
    }
    for nothing in ["", "PAC", "PACT ", "SER", "FLAGS", "RUNV", "LP", "STOP"] {
        assert_eq!(Smd3::find_quantity(nothing), None, "{nothing}");
    }
}

#[test]
fn underscores_stand_for_spaces_unless_that_is_a_name_itself() {
    assert_eq!(find("motor_short"), find("MOTOR SHORT"));
    assert_eq!(find("EMERGENCY_STOP"), find("EMERGENCY STOP"));
    assert_eq!(find("LIMIT_NEGATIVE"), Quantity::Signal(Signal::LimitNegative));
    let mut bench = Bench::new();
    bench.set("LP-", 1);
    assert_near(look(&bench, "LIMIT_NEGATIVE"), 0.0, 0.0);
    assert_near(look(&bench, "LIMIT NEGATIVE"), 1.0, 0.0);
}

#[test]
fn every_number_every_flag_and_every_signal_is_there() {
    let listed = |quantity| Smd3::quantities().any(|(_, known)| known == quantity);
    for row in &COMMANDS {
        let numeric = matches!(row.access, Access::Read | Access::ReadWrite) && row.kind != Kind::Text;
        assert_eq!(listed(Quantity::Command(row.command)), numeric, "{}", row.mnemonic);
    }
    for row in &STATUS_FLAGS {
        // Two commands are called so; EXTEN is the signal ENABLE, and IDENT the same as the command.
        let taken = matches!(row.name, "EXTEN" | "IDENT");
        assert_eq!(listed(Quantity::Status(1 << row.bit)), !taken, "{}", row.name);
    }
    assert!(ERROR_FLAGS.iter().all(|row| listed(Quantity::Error(1 << row.bit))));
    assert!(Signal::ALL.into_iter().all(|signal| find(signal.name()) == Quantity::Signal(signal)));
}

/// Asserts that everything looks as a host reads it, `at` after now, which must be before the next wake-up; and that it
/// has changed only if it flows.
fn assert_looks_as_read(bench: &Bench, at: Duration) {
    let then = bench.now + at;
    let mut there = Bench::new();
    (there.drive, there.now) = (bench.drive.clone(), then);
    for (name, quantity) in Smd3::quantities() {
        let seen = bench.drive.look(then, quantity);
        let expected = match quantity {
            Quantity::Command(_) => there.get(name),
            Quantity::Status(_) | Quantity::Error(_) => f64::from(u8::from(there.flag(name))),
            Quantity::Signal(signal) => f64::from(u8::from(there.drive.signals() & signal.bit() != 0)),
            Quantity::Current => there.current(),
            Quantity::Temperature => there.temperature(),
        };
        assert_eq!(seen.to_bits(), expected.to_bits(), "{name} looks like {seen}, not {expected}, at {then}");
        let before = bench.drive.look(bench.now, quantity);
        assert!(Smd3::flows(quantity) || before.to_bits() == seen.to_bits(), "{name} flows");
    }
}

/// Looks again and again until nothing comes any more or the end.
fn look_until(bench: &mut Bench, end: Instant) -> u32 {
    let mut looked = 0;
    while let Some((due, _)) = bench.drive.next_wake().filter(|(due, _)| *due <= end) {
        let left = due.since(bench.now);
        for share in [0, 1, 7, 50, 99] {
            let at = left * share / 100;
            if bench.now + at < due {
                assert_looks_as_read(bench, at);
                looked += 1;
            }
        }
        bench.step(due);
    }
    assert_looks_as_read(bench, 1000 * SECOND);
    looked
}

#[test]
fn a_look_between_wake_ups_is_what_a_host_would_read_then() {
    let mut bench = Bench::warming(Thermal { rise_k: 400.0, ..Thermal::default() });
    bench.set("TZW", 0.5);
    bench.set("IA", 0.75);
    bench.signal(Signal::Enable, true);
    bench.order("RUNR", "-2500");
    assert!(look_until(&mut bench, Instant::FAR_FUTURE) >= 20);
    bench.set("MODE", 4);
    bench.set("BAKET", 200);
    bench.order("RUNB", "");
    bench.drive.heat(bench.now, Some(185.0));
    assert_looks_as_read(&bench, 5 * SECOND);
    bench.drive.heat(bench.now, None);
    assert!(look_until(&mut bench, Instant::FAR_FUTURE) >= 5);
    assert!(bench.flag("TOVR"));
    bench.drive.set_sensor(bench.now, Sensor::Open);
    assert_looks_as_read(&bench, SECOND);
}

#[test]
fn what_flows_is_motion_current_and_temperature() {
    let flowing: Vec<&str> =
        Smd3::quantities().filter(|(_, quantity)| Smd3::flows(*quantity)).map(|(name, _)| name).collect();
    assert_eq!(flowing, ["TMOT", "VACT", "PACT", "PREL", "CURRENT", "TEMPERATURE"]);
    let mut bench = Bench::new();
    bench.order("RUNV", "+");
    let snapshot = format!("{:?}", bench.drive);
    for name in ["TMOT", "VACT", "PACT", "PREL", "TEMPERATURE"] {
        let seen = |at| bench.drive.look(bench.now + at, find(name));
        assert!(seen(100 * MS) < seen(133 * MS), "{name}");
    }
    assert_eq!(format!("{:?}", bench.drive), snapshot);
    bench.run_for(SECOND);
    bench.order("STOP", "");
    bench.run_until_standby();
    assert!(bench.drive.look(bench.now + SECOND, find("CURRENT")) < look(&bench, "CURRENT"));
}

#[test]
fn settings_and_the_mode_are_numbers() {
    let mut bench = Bench::new();
    bench.set("L+", 0);
    bench.set("RES", 64);
    for (name, value) in [("MODE", 2.0), ("l+", 0.0), ("L-", 1.0), ("RES", 64.0), ("IR", 1.0), ("F", 0.0)] {
        assert_near(look(&bench, name), value, 0.0);
    }
    bench.signal(Signal::Joystick, true);
    for (name, value) in [("MODE", 3.0), ("JSCON", 1.0), ("JOYSTICK", 1.0), ("STANDBY", 1.0)] {
        assert_near(look(&bench, name), value, 0.0);
    }
    assert_eq!(find("mode"), Quantity::Command(Command::Mode));
}
