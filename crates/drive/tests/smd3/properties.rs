//! What holds whatever a client sends, whatever the signals do, and however time passes.

use crate::bench::Bench;
use core::time::Duration;
use proptest::collection::vec;
use proptest::prelude::*;
use stepdrive_drive::smd3::{Config, Phases, Settings, Stored, Thermal};
use stepdrive_spec::smd3::commands::{Access, COMMANDS, CommandInfo, Kind, Reply, Request, Value};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::{ErrorFlag, StatusFlag};
use stepdrive_spec::smd3::signals::{Sensor, Signal};
use stepdrive_spec::time::Instant;

/// Something that happens to a controller.
#[derive(Clone, Debug)]
enum Happening {
    Line(Result<Option<Request>, Error>),
    Signal(Signal, bool),
    Sensor(Sensor),
    Short(bool),
    Heat(Option<f64>),
    Flash {
        worn: bool,
        damaged: bool,
    },
    /// Off, so many nanoseconds, and on with these signals.
    PowerCycle(u64, u16),
    Pass(u64),
}

/// Any value, of whatever type.
fn any_value() -> impl Strategy<Value = Value> {
    prop_oneof![
        any::<i64>().prop_map(Value::Int),
        any::<u64>().prop_map(Value::Uint),
        any::<f64>().prop_map(Value::Float),
        any::<bool>().prop_map(Value::Bool),
        any::<bool>().prop_map(Value::Sign),
        Just(Value::FlagTable),
    ]
}

/// A value of the type of a row, mostly within its range.
fn fitting(row: &'static CommandInfo) -> impl Strategy<Value = Value> {
    let scale = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0_f64, 0.0..1e-3_f64, 0.99..1.01_f64];
    scale.prop_map(move |share| {
        let number = row.min + (row.max - row.min) * share;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
        match row.kind {
            Kind::Int => Value::Int(number as i64),
            Kind::Uint => Value::Uint(number.round() as u64),
            Kind::Float => Value::Float(number),
            Kind::Bool => Value::Bool(number > 0.4),
            Kind::Sign | Kind::None | Kind::Text => Value::Sign(share > 0.4),
        }
    })
}

fn request() -> impl Strategy<Value = Request> {
    let row = prop::sample::select(&COMMANDS[..]);
    row.prop_flat_map(|row| {
        let row = row.command.info();
        let takes = matches!(row.access, Access::ReadWrite | Access::Write);
        let argument = prop_oneof![
            8 => prop::option::weighted(if takes { 0.9 } else { 0.01 }, fitting(row)),
            1 => prop::option::of(any_value()),
        ];
        argument.prop_map(move |argument| Request { command: row.command, argument })
    })
}

/// What makes the motor move, more often than chance would.
fn motion() -> impl Strategy<Value = Request> {
    let movers: Vec<&'static CommandInfo> = COMMANDS
        .iter()
        .filter(|row| row.starts || matches!(row.mnemonic, "STOP" | "SSTOP" | "CLR" | "MODE"))
        .collect();
    let steps = prop_oneof![-50..50_i64, -5000..5000_i64];
    (prop::sample::select(movers), any::<bool>(), steps, 0..6_u64).prop_map(|(row, positive, steps, mode)| {
        let argument = match row.kind {
            Kind::Sign => Some(Value::Sign(positive)),
            Kind::Int => Some(Value::Int(steps)),
            Kind::Uint => Some(Value::Uint(mode)),
            Kind::None | Kind::Float | Kind::Bool | Kind::Text => None,
        };
        Request { command: row.command, argument }
    })
}

fn happening() -> impl Strategy<Value = Happening> {
    let line = prop_oneof![
        8 => request().prop_map(|request| Ok(Some(request))),
        8 => motion().prop_map(|request| Ok(Some(request))),
        1 => Just(Ok(None)),
        1 => Just(Err(Error::UnknownCommand)),
    ];
    let pass = prop_oneof![0..3_u64, 0..500_000_000_u64, 0..5_000_000_000_u64, 0..40_000_000_000_000_u64];
    prop_oneof![
        8 => line.prop_map(Happening::Line),
        4 => (prop::sample::select(&Signal::ALL[..]), any::<bool>())
            .prop_map(|(signal, present)| Happening::Signal(signal, present)),
        1 => prop::sample::select(&[Sensor::Connected, Sensor::Connected, Sensor::Open, Sensor::Short][..])
            .prop_map(Happening::Sensor),
        1 => prop::bool::weighted(0.2).prop_map(Happening::Short),
        1 => prop::option::of(20.0..300.0_f64).prop_map(Happening::Heat),
        1 => any::<(bool, bool)>().prop_map(|(worn, damaged)| Happening::Flash { worn, damaged }),
        1 => (0..3_000_000_000_000_u64, 0..512_u16).prop_map(|(off, signals)| Happening::PowerCycle(off, signals)),
        5 => pass.prop_map(Happening::Pass),
    ]
}

/// A controller whose limits are used, and whose motor can get too warm.
fn bench() -> Bench {
    let thermal = Thermal { rise_k: 300.0, ..Thermal::default() };
    let mut bench = Bench::with(Config { thermal, ..Config::default() }, &Stored::Nothing, 0);
    bench.set("L", 1);
    bench
}

fn happen(bench: &mut Bench, happening: &Happening) -> Option<Reply> {
    match happening {
        Happening::Line(line) => return Some(bench.drive.handle(bench.now, *line)),
        Happening::Signal(signal, present) => bench.signal(*signal, *present),
        Happening::Sensor(sensor) => bench.drive.set_sensor(bench.now, *sensor),
        Happening::Short(shorted) => bench.drive.short_motor(bench.now, *shorted),
        Happening::Heat(held) => bench.drive.heat(bench.now, *held),
        Happening::Flash { worn, damaged } => {
            bench.drive.wear_flash(*worn);
            bench.drive.damage_store(*damaged);
        }
        Happening::PowerCycle(off, signals) => {
            bench.drive.switch_off(bench.now);
            bench.run_for(Duration::from_nanos(*off));
            bench.drive.switch_on(bench.now, *signals);
        }
        Happening::Pass(nanos) => bench.run_for(Duration::from_nanos(*nanos)),
    }
    None
}

/// What holds at every instant.
fn check(bench: &mut Bench) {
    let (drive, now) = (&bench.drive, bench.now);
    let due = drive.next_wake();
    assert!(due.is_none_or(|(at, _)| at >= now), "{due:?} is in the past of {now}");
    let flags = drive.flags();
    assert_eq!((flags.status & 0xFE20, flags.error & 0xFF80), (0, 0), "reserved bits read as 0");
    let standby = StatusFlag::Standby.is_in(flags.status);
    let speed = drive.speed(now);
    assert!((0.0..=46_875.0).contains(&speed), "{speed}");
    assert!(!standby || speed <= 0.0, "{speed} in standby");
    assert!(flags.error == 0 || speed <= 0.0, "{speed} while disabled");
    assert!(flags.error == 0 || !StatusFlag::Bake.is_in(flags.status), "bake while disabled");
    assert!(!StatusFlag::AtSpeed.is_in(flags.status) || speed > 0.0, "at a speed of 0");
    assert!(standby || speed > 0.0 || due.is_some(), "STANDBY would never come");
    assert_eq!(flags.error != 0, drive.phases(now) == Phases::Off);
    let current = drive.current(now);
    assert!((0.0..=1.0 + 1e-12).contains(&current), "{current}");
    assert!(flags.error == 0 || current <= 0.0);
    let temperature = drive.temperature(now);
    assert!((19.9..=320.1).contains(&temperature), "{temperature}");
    assert!((-8_388_608.0..8_388_608.0).contains(&drive.position(now)));
    assert!(drive.rotor(now).abs() < 1 << 52);
    let hot = ErrorFlag::Tovr.is_in(flags.error) || drive.temperature(now) <= 190.0 + 1e-6;
    assert!(hot || bench.get("TMOT") < 190.0, "too warm, seen, and no TOVR");
    let settings = *bench.drive.settings();
    let mut stored = settings;
    if settings.get(stepdrive_spec::smd3::commands::Command::Ident) > 0.0 {
        stored = Settings::decode(&settings.encode()).expect("sound");
    }
    assert_eq!(Settings::decode(&settings.encode()), Ok(stored), "the settings would not survive");
}

fn state(bench: &Bench) -> String {
    format!("{:?}", bench.drive)
}

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(cases(256))]

    #[test]
    fn nothing_breaks_a_controller(happenings in vec(happening(), 1..80)) {
        let mut bench = bench();
        for happening in &happenings {
            happen(&mut bench, happening);
            check(&mut bench);
        }
    }

    #[test]
    fn reads_and_refusals_change_nothing(happenings in vec(happening(), 1..60)) {
        let mut bench = bench();
        for happening in &happenings {
            let before = state(&bench);
            let reply = happen(&mut bench, happening);
            let read = matches!(happening, Happening::Line(Ok(Some(Request { argument: None, .. }))))
                && matches!(reply, Some(Reply { outcome: Ok(Some(_)), .. }));
            if read || matches!(reply, Some(Reply { outcome: Err(_), .. })) {
                prop_assert_eq!(state(&bench), before, "{:?}", happening);
            }
        }
    }

    #[test]
    fn replies_carry_the_flags_as_they_are_then(happenings in vec(happening(), 1..60)) {
        let mut bench = bench();
        for happening in &happenings {
            if let Some(reply) = happen(&mut bench, happening) {
                prop_assert_eq!(reply.flags, bench.drive.flags());
            }
        }
    }

    #[test]
    fn the_same_happenings_have_the_same_outcome(happenings in vec(happening(), 1..60)) {
        let run = || {
            let mut bench = bench();
            let replies: Vec<_> = happenings.iter().map(|happening| happen(&mut bench, happening)).collect();
            (format!("{replies:?}"), state(&bench))
        };
        prop_assert_eq!(run(), run());
    }

    #[test]
    fn time_in_pieces_and_late_wake_ups_are_the_same_time(
        happenings in vec(happening(), 1..40),
        cuts in vec(0..1_000_000_000_u64, 1..10),
    ) {
        let (mut whole, mut pieces, mut late) = (bench(), bench(), bench());
        for happening in &happenings {
            let reply = happen(&mut whole, happening);
            if let Happening::Pass(nanos) = happening {
                let end = pieces.now + Duration::from_nanos(*nanos);
                for cut in &cuts {
                    let rest = end.since(pieces.now);
                    pieces.run_for(rest.min(Duration::from_nanos(*cut)));
                    pieces.drive.handle_wake(pieces.now);
                }
                let rest = end.since(pieces.now);
                pieces.run_for(rest);
                late.now = end;
            } else {
                prop_assert_eq!(format!("{:?}", reply), format!("{:?}", happen(&mut pieces, happening)));
                prop_assert_eq!(format!("{:?}", reply), format!("{:?}", happen(&mut late, happening)));
            }
            let now = whole.now;
            late.drive.handle_wake(now);
            for other in [&pieces, &late] {
                prop_assert_eq!(whole.drive.flags(), other.drive.flags());
                prop_assert_eq!(whole.drive.rotor(now), other.drive.rotor(now));
                prop_assert_eq!(whole.drive.temperature(now).to_bits(), other.drive.temperature(now).to_bits());
                prop_assert_eq!(whole.drive.next_wake(), other.drive.next_wake());
            }
        }
    }

    #[test]
    fn the_rotor_goes_one_way_between_two_wake_ups(happenings in vec(happening(), 1..40), probes in 2..20_u64) {
        let mut bench = bench();
        for happening in &happenings {
            happen(&mut bench, happening);
            let start = bench.now.as_nanos();
            let end = bench.drive.next_wake().map_or(start + 1_000_000_000, |(at, _)| at.as_nanos());
            let places: Vec<i64> = (0..=probes)
                .map(|probe| bench.drive.rotor(Instant::from_nanos(start + (end - start) / probes * probe)))
                .collect();
            let forward = bench.drive.direction() == stepdrive_motion::Direction::Forward;
            let one_way = |left: &i64, right: &i64| left == right || (left < right) == forward;
            prop_assert!(places.is_sorted_by(one_way));
        }
    }
}
