//! Every command against its row of the table: what it reads as, what it takes, when it is refused.

use crate::bench::{Bench, SECOND, assert_near, number};
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, CommandInfo, Kind, Mode, Request, Value};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::ErrorFlag;
use stepdrive_spec::smd3::units;

/// The settings: what can be read and set, but for the two counters.
fn settings() -> impl Iterator<Item = &'static CommandInfo> {
    let counters = [Command::Pact, Command::Prel];
    COMMANDS.iter().filter(move |row| row.access == Access::ReadWrite && !counters.contains(&row.command))
}

fn value(kind: Kind, number: f64) -> Value {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    match kind {
        Kind::Int => Value::Int(number as i64),
        Kind::Uint => Value::Uint(number as u64),
        Kind::Float => Value::Float(number),
        Kind::Bool => Value::Bool(number > 0.5),
        Kind::Sign => Value::Sign(number > 0.0),
        Kind::None | Kind::Text => panic!("takes no argument"),
    }
}

fn request(row: &CommandInfo, argument: f64) -> Request {
    Request { command: row.command, argument: Some(value(row.kind, argument)) }
}

/// An argument that the row takes, or none where it takes none.
fn good(row: &CommandInfo) -> Request {
    match row.access {
        Access::Action => Request { command: row.command, argument: None },
        Access::Write | Access::ReadWrite => {
            request(row, if row.max > row.min { row.default.max(1.0).min(row.max) } else { 1.0 })
        }
        Access::Read => panic!("takes no argument"),
    }
}

fn same(left: f64, right: f64) -> bool {
    (left - right).abs() <= 1e-9 * right.abs()
}

#[test]
fn every_setting_has_the_default_of_its_row_rounded() {
    let mut bench = Bench::new();
    let rounded = [
        ("PDDEL", units::POWER_DOWN_DELAY.round(100.0)),
        ("IHD", units::HOLD_DELAY.round(20.0)),
        ("IH", 3.0 / 32.0),
        ("AMAX", units::acceleration(256).round(1000.0)),
        ("DMAX", units::acceleration(256).round(1000.0)),
        ("VSTART", units::vstart(256).round(10.0)),
        ("VSTOP", units::vstart(256).round(10.0)),
        ("VMAX", units::vmax(256).round(1000.0)),
        ("THIGH", 46_875.0 / 94.0),
    ];
    for row in settings() {
        let exact = rounded.iter().find(|(mnemonic, _)| *mnemonic == row.mnemonic);
        let expected = exact.map_or(row.default, |(_, value)| *value);
        assert!(same(bench.get(row.mnemonic), expected), "{} is {}", row.mnemonic, bench.get(row.mnemonic));
        assert_near(expected, row.default, 0.13 * row.default);
    }
}

/// Speeds of which 0 is not one.
const ABOVE_ZERO: [Command; 4] = [Command::Vstart, Command::Vstop, Command::Vmax, Command::Thigh];

/// The least and the greatest that a setting takes on a drive fresh from the factory.
fn range(row: &CommandInfo) -> (f64, f64) {
    let mut bench = Bench::new();
    let least = if ABOVE_ZERO.contains(&row.command) { 1e-9 } else { row.min };
    match row.mnemonic {
        "AMAX" | "DMAX" => (least, units::acceleration(256).greatest()),
        "VSTART" => (least, bench.get("VSTOP")),
        "VSTOP" => (bench.get("VSTART"), units::vstart(256).greatest()),
        _ => (least, row.max),
    }
}

#[test]
fn every_setting_takes_both_ends_of_its_range() {
    for row in settings() {
        for taken in <[f64; 2]>::from(range(row)) {
            let mut bench = Bench::new();
            let outcome = bench.request(request(row, taken)).outcome;
            let outcome = outcome.unwrap_or_else(|error| panic!("{} {taken}: {error}", row.mnemonic));
            let answered = number(outcome.expect("a value"));
            assert_eq!(answered.to_bits(), bench.get(row.mnemonic).to_bits(), "{}", row.mnemonic);
        }
    }
}

#[test]
fn nothing_beyond_a_range_is_taken() {
    for row in settings().filter(|row| row.kind != Kind::Bool) {
        let mut bench = Bench::new();
        let before = *bench.drive.settings();
        let greatest = range(row).1;
        let mut beyond = vec![greatest + 1.0];
        if row.kind == Kind::Float {
            beyond.extend([greatest * 1.001, -1e-3, f64::INFINITY, f64::NEG_INFINITY, f64::NAN]);
        }
        if ABOVE_ZERO.contains(&row.command) || row.min > 0.0 {
            beyond.extend([0.0, row.min / 2.0]);
        }
        for argument in beyond {
            let outcome = bench.request(request(row, argument)).outcome;
            assert_eq!(outcome, Err(Error::ArgumentValidation), "{} {argument}", row.mnemonic);
        }
        assert_eq!(bench.drive.settings(), &before, "{}", row.mnemonic);
    }
}

#[test]
fn values_are_rounded_to_what_the_drive_can_make_and_answered_so() {
    let rows = [
        ("PDDEL", "100", 109.226_666_7),
        ("PDDEL", "10", 0.0),
        ("IHD", "320", 327.68),
        ("IR", "0.3", 10.0 / 32.0),
        ("TZW", "0.0001", 85.333_333e-6),
        ("THIGH", "200", 46_875.0 / 234.0),
        ("VMAX", "0.000001", 0.002_793_967_7),
        ("AMAX", "1", 1.023_181_5),
        ("RES", "100", 128.0),
        ("RES", "9", 8.0),
        ("BAKET", "200", 200.0),
        ("IDENT", "1", 1.0),
    ];
    for (mnemonic, argument, expected) in rows {
        let mut bench = Bench::new();
        let answered = bench.set(mnemonic, argument);
        assert_near(answered, expected, 1e-6 * expected);
        assert_near(bench.get(mnemonic), answered, 0.0);
    }
}

#[test]
fn what_is_set_again_as_it_was_answered_does_not_change() {
    let mut bench = Bench::new();
    for (mnemonic, argument) in
        [("VMAX", "777.7"), ("AMAX", "333.3"), ("THIGH", "777"), ("IR", "0.7"), ("TZW", "1.1")]
    {
        let answered = bench.set(mnemonic, argument);
        assert_near(bench.set(mnemonic, answered), answered, 0.0);
    }
}

#[test]
fn a_new_resolution_rounds_the_profile_anew_and_leaves_the_position() {
    let mut bench = Bench::new();
    bench.set("PACT", "12.5");
    bench.set("RES", 8);
    assert_near(bench.get("AMAX"), units::acceleration(8).round(1000.0), 1e-6);
    assert_near(bench.get("VMAX"), units::vmax(8).round(1000.0), 1e-6);
    assert_near(bench.set("AMAX", 500_000), 500_000.0, 5.0);
    bench.set("VSTOP", 20_000);
    bench.set("VSTART", 20_000);
    bench.set("RES", 256);
    assert_near(bench.get("AMAX"), units::acceleration(256).greatest(), 1e-6);
    assert_near(bench.get("VSTART"), units::vstart(256).greatest(), 1e-6);
    assert_near(bench.get("VSTOP"), units::vstart(256).greatest(), 1e-6);
    assert_near(bench.position(), 12.5, 0.0);
}

#[test]
fn vstart_is_at_most_vstop() {
    let mut bench = Bench::new();
    bench.refused("VSTART", "20", -2);
    bench.set("VSTOP", 20);
    bench.set("VSTART", 20);
    bench.refused("VSTOP", "19", -2);
    bench.set("VSTART", 19);
    bench.set("VSTOP", 19);
}

#[test]
fn access_is_that_of_the_row() {
    let mut bench = Bench::new();
    for row in &COMMANDS {
        let bare = bench.request(Request { command: row.command, argument: None }).outcome;
        match row.access {
            Access::Read | Access::ReadWrite => assert!(matches!(bare, Ok(Some(_))), "{}", row.mnemonic),
            Access::Write => assert_eq!(bare, Err(Error::UnableToGet), "{}", row.mnemonic),
            Access::Action => {}
        }
        let with = Request { command: row.command, argument: Some(Value::Bool(true)) };
        if matches!(row.access, Access::Read | Access::Action) {
            assert_eq!(bench.request(with).outcome, Err(Error::ArgumentCount), "{}", row.mnemonic);
        } else if row.kind != Kind::Bool {
            assert_eq!(bench.request(with).outcome, Err(Error::ArgumentType), "{}", row.mnemonic);
        }
    }
}

#[test]
fn values_have_the_types_of_their_rows() {
    let mut bench = Bench::new();
    for row in COMMANDS.iter().filter(|row| matches!(row.access, Access::Read | Access::ReadWrite)) {
        let outcome = bench.request(Request { command: row.command, argument: None }).outcome;
        let value = outcome.expect("readable").expect("a value");
        let fits = match (row.command, value) {
            (Command::Mode, value) => value == Value::Mode(Mode::Remote),
            (Command::Ser, Value::Text(text)) => text.as_str() == "20168-001",
            (Command::Fw, Value::Text(text)) => text.as_str() == "20168.1",
            (Command::Flags, value) => value == Value::FlagTable,
            (_, Value::Uint(_)) => row.kind == Kind::Uint,
            (_, Value::Float(_)) => row.kind == Kind::Float,
            (_, Value::Bool(_)) => row.kind == Kind::Bool,
            (_, Value::Int(_) | Value::Sign(_) | Value::Text(_) | Value::Mode(_) | Value::FlagTable) => false,
        };
        assert!(fits, "{} is {value:?}", row.mnemonic);
    }
}

#[test]
fn what_wants_standby_is_refused_while_turning_and_while_resting() {
    for row in COMMANDS.iter().filter(|row| row.standby) {
        let mut bench = Bench::new();
        bench.set("TZW", 1);
        bench.order("RUNA", "1000");
        bench.run_for(SECOND);
        assert_eq!(bench.request(good(row)).outcome, Err(Error::StopMotorFirst), "{} turning", row.mnemonic);
        bench.run_until(|bench| bench.velocity() <= 0.0);
        assert_eq!(bench.request(good(row)).outcome, Err(Error::StopMotorFirst), "{} resting", row.mnemonic);
        bench.run_until_standby();
        assert!(bench.request(good(row)).outcome.is_ok(), "{} in standby", row.mnemonic);
    }
}

#[test]
fn what_does_not_want_standby_is_taken_while_turning() {
    for row in COMMANDS.iter().filter(|row| !row.standby && row.mode.is_none_or(|mode| mode == Mode::Remote))
    {
        if row.access == Access::Read {
            continue;
        }
        let mut bench = Bench::new();
        bench.order("RUNV", "+");
        bench.run_for(SECOND);
        assert!(bench.request(good(row)).outcome.is_ok(), "{}", row.mnemonic);
    }
}

#[test]
fn what_belongs_to_a_mode_is_refused_in_every_other() {
    for row in COMMANDS.iter().filter(|row| row.mode.is_some()) {
        for mode in Mode::ALL {
            let mut bench = Bench::in_mode(mode.number().into());
            bench.set("L", 1);
            let outcome = bench.request(good(row)).outcome;
            if row.mode == Some(mode) {
                assert_eq!(outcome, Ok(None), "{} in {mode:?}", row.mnemonic);
            } else {
                assert_eq!(outcome, Err(Error::NotPossibleInMode), "{} in {mode:?}", row.mnemonic);
            }
        }
    }
}

#[test]
fn what_starts_motion_is_refused_while_the_motor_is_disabled_and_nothing_else_is() {
    for row in COMMANDS.iter().filter(|row| row.access != Access::Read && row.command != Command::Clr) {
        let mut bench = Bench::in_mode(row.mode.unwrap_or(Mode::Remote).number().into());
        bench.order("ESTOP", "");
        let outcome = bench.request(good(row)).outcome;
        assert_eq!(outcome == Err(Error::NotPossibleWhenMotorDisabled), row.starts, "{}", row.mnemonic);
        assert_eq!(outcome.is_err(), row.starts, "{}", row.mnemonic);
        assert!(ErrorFlag::EmergencyStop.is_in(bench.drive.flags().error), "{}", row.mnemonic);
    }
}

#[test]
fn the_checks_come_in_their_order() {
    let mut bench = Bench::new();
    bench.order("RUNV", "+");
    bench.refused("RUNR", "1", -1);
    bench.order("ESTOP", "");
    bench.refused("RUNR", "1", -7);
    bench.run_until_standby();
    bench.set("MODE", 5);
    bench.refused("RUNR", "1", -6);
    bench.refused("RUNR", "8388608", -2);
    bench.refused("RUNR", "-8388608", -2);
}

#[test]
fn an_empty_line_and_a_line_that_is_wrong_are_answered_with_the_flags() {
    let mut bench = Bench::new();
    let reply = bench.drive.handle(bench.now, Ok(None));
    assert_eq!((reply.flags.status, reply.flags.error, reply.outcome), (0x0040, 0, Ok(None)));
    let reply = bench.drive.handle(bench.now, Err(Error::UnknownCommand));
    assert_eq!((reply.flags.status, reply.outcome), (0x0040, Err(Error::UnknownCommand)));
}

#[test]
fn flags_are_those_after_the_command() {
    let mut bench = Bench::new();
    assert_eq!(bench.send("IDENT", "1").flags.status, 0x0050);
    assert_eq!(bench.send("IDENT", "0").flags.status, 0x0040);
    assert_eq!(bench.send("RUNV", "+").flags.status, 0x0000);
    assert_eq!(bench.send("ESTOP", "").flags.error, 0x0020);
}

#[test]
fn lp_sets_both_polarities_and_cannot_be_read() {
    let mut bench = Bench::new();
    assert_near(bench.set("LP", 1), 1.0, 0.0);
    assert_near(bench.get("LP+") + bench.get("LP-"), 2.0, 0.0);
    assert_eq!(bench.flags(), "LIMIT NEGATIVE, LIMIT POSITIVE, STANDBY");
    bench.refused("LP", "", -3);
}
