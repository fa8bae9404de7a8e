//! The settings of a line's faults: what can be set, how it is told again, and what a person is told about a mistake.
#![allow(clippy::needless_pass_by_value, reason = "an `Expect` is written in place")]

use expect_test::{Expect, expect};
use proptest::prelude::*;
use std::fmt::Write;
use std::time::Duration;
use stepdrive_rig::line::{
    Chance, ChanceError, Connection, Delay, Family, LINE_FAULTS, LineFault, LineFaultError, LineFaults,
    MOST_PAUSE, Pieces,
};
use stepdrive_spec::modbus::Exception;

/// The line of an SMSD with these faults.
fn smsd(settings: &[(&str, &str)]) -> LineFaults {
    let mut faults = LineFaults::default();
    for (name, setting) in settings {
        faults.set(name, setting, Family::Smsd).expect("a setting");
    }
    faults
}

/// What a person is told when this is set on the line of an SMSD.
fn refusal(name: &str, setting: &str) -> String {
    let mut faults = smsd(&[("reply-delay", "20ms")]);
    let before = faults;
    let error = faults.set(name, setting, Family::Smsd).expect_err("a mistake");
    assert_eq!(faults, before);
    error.to_string()
}

fn check(name: &str, setting: &str, expect: Expect) {
    expect.assert_eq(&refusal(name, setting));
}

#[test]
fn a_line_is_good_until_a_fault_is_set_and_again_when_it_is_off() {
    for fault in LINE_FAULTS {
        let family = fault.family.unwrap_or(Family::Smd3);
        let setting = match fault.name {
            "connection" => "silent",
            "reply-delay" => "1ms",
            "reply-pieces" => "2",
            "exception" => "06",
            _ => "on",
        };
        let mut faults = LineFaults::default();
        assert!(faults.is_good(), "{}", fault.name);
        faults.set(fault.name, setting, family).expect("a setting");
        assert!(!faults.is_good(), "{}", fault.name);
        faults.set(fault.name, " off ", family).expect("a setting");
        assert!(faults.is_good(), "{}", fault.name);
    }
}

#[test]
fn each_setting_sets_its_fault_and_no_other() {
    let good = LineFaults::default();
    let set = |name, setting| smsd(&[(name, setting)]);
    assert_eq!(set("connection", "cut"), LineFaults { connection: Connection::Cut, ..good });
    assert_eq!(set("connection", "silent"), LineFaults { connection: Connection::Silent, ..good });
    let delay = |delay, jitter| {
        Some(Delay { delay: Duration::from_millis(delay), jitter: Duration::from_millis(jitter) })
    };
    assert_eq!(set("reply-delay", "20ms"), LineFaults { delay: delay(20, 0), ..good });
    assert_eq!(set("reply-delay", "20ms 5ms"), LineFaults { delay: delay(20, 5), ..good });
    assert_eq!(set("reply-drop", "on"), LineFaults { drop: Chance::ALWAYS, ..good });
    assert_eq!(set("reply-duplicate", "30%"), LineFaults { duplicate: Chance::percent(30), ..good });
    assert_eq!(set("reply-damage", "0.5%"), LineFaults { damage: Chance::per_million(5_000), ..good });
    assert_eq!(set("reply-id", "always"), LineFaults { wrong_id: Chance::ALWAYS, ..good });
    let pieces = |count, gap| Some(Pieces { count, gap: Duration::from_millis(gap) });
    assert_eq!(set("reply-pieces", "3"), LineFaults { pieces: pieces(3, 5), ..good });
    assert_eq!(set("reply-pieces", "64 10ms"), LineFaults { pieces: pieces(64, 10), ..good });
    let exception = |exception, percent| Some((exception, Chance::percent(percent)));
    let failure = exception(Exception::ServerDeviceFailure, 100);
    let busy = exception(Exception::ServerDeviceBusy, 30);
    assert_eq!(set("exception", "04"), LineFaults { exception: failure, ..good });
    assert_eq!(set("exception", "06 30%"), LineFaults { exception: busy, ..good });
}

#[test]
fn a_fault_that_never_shows_is_off() {
    for (name, setting) in
        [("reply-drop", "0%"), ("exception", "04 never"), ("reply-delay", "0ms"), ("reply-id", "0.0%")]
    {
        assert!(smsd(&[(name, setting)]).is_good(), "{name} {setting}");
    }
}

#[test]
fn faults_are_told_in_the_words_that_set_them() {
    let faults = smsd(&[
        ("exception", "4 12.50%"),
        ("reply-id", "100%"),
        ("reply-damage", "0.0001%"),
        ("reply-pieces", "3"),
        ("reply-delay", "20ms  0ms"),
        ("connection", "cut"),
    ]);
    let mut told = String::new();
    for (name, setting) in faults.describe() {
        writeln!(told, "{name}: {setting}").expect("a string takes all");
    }
    expect![[r#"
        connection: cut
        reply-delay: 20ms
        reply-pieces: 3 5ms
        reply-damage: 0.0001%
        reply-id: on
        exception: 04 12.5%
    "#]]
    .assert_eq(&told);
}

#[test]
fn what_there_is_for_a_family_is_listed() {
    let names = |family| LineFault::of(family).map(|fault| fault.name).collect::<Vec<_>>();
    assert_eq!(names(Family::Smsd).len(), LINE_FAULTS.len());
    let common: Vec<_> =
        names(Family::Smsd).into_iter().filter(|n| !["reply-id", "exception"].contains(n)).collect();
    assert_eq!(names(Family::Smd3), common);
    let mut sorted = names(Family::Smsd);
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!(sorted.len(), LINE_FAULTS.len(), "names differ");
}

#[test]
fn an_unknown_fault_is_answered_with_those_that_there_are() {
    check(
        "noise",
        "on",
        expect![[
            r#"unknown line fault `noise`; an SMSD has connection, reply-delay, reply-drop, reply-pieces, reply-duplicate, reply-damage, reply-id, exception"#
        ]],
    );
    check(
        "Connection\n",
        "cut",
        expect![[
            r#"unknown line fault `Connection�`; an SMSD has connection, reply-delay, reply-drop, reply-pieces, reply-duplicate, reply-damage, reply-id, exception"#
        ]],
    );
}

#[test]
fn a_fault_of_the_other_family_is_refused_with_those_that_there_are() {
    let mut faults = LineFaults::default();
    let error = faults.set("exception", "04", Family::Smd3).expect_err("a mistake");
    assert_eq!(error, LineFaultError::NotForFamily { name: "exception", family: Family::Smd3 });
    assert!(faults.is_good());
    expect![[r#"exception is not for the line of an SMD3; an SMD3 has connection, reply-delay, reply-drop, reply-pieces, reply-duplicate, reply-damage"#]].assert_eq(&error.to_string());
}

#[test]
fn a_setting_that_cannot_be_is_refused_with_what_can_be() {
    check(
        "connection",
        "broken",
        expect![[
            r#"connection cannot be `broken`: there is no such setting; its settings are cut | silent | off"#
        ]],
    );
    check(
        "connection",
        "",
        expect![[r#"connection cannot be ``: the setting is missing; its settings are cut | silent | off"#]],
    );
    check(
        "connection",
        "cut silent",
        expect![[
            r#"connection cannot be `cut silent`: there is too much; its settings are cut | silent | off"#
        ]],
    );
    check(
        "reply-drop",
        "30",
        expect![[
            r#"reply-drop cannot be `30`: a chance is a percentage, as in 30% or 0.5%; its settings are on | CHANCE | off"#
        ]],
    );
    check(
        "reply-drop",
        "101%",
        expect![[
            r#"reply-drop cannot be `101%`: a chance is at most 100%; its settings are on | CHANCE | off"#
        ]],
    );
    check(
        "reply-id",
        "on 30%",
        expect![[r#"reply-id cannot be `on 30%`: there is too much; its settings are on | CHANCE | off"#]],
    );
    check(
        "reply-duplicate",
        "0.00001%",
        expect![[
            r#"reply-duplicate cannot be `0.00001%`: a chance has at most four decimals, as in 0.0001%; its settings are on | CHANCE | off"#
        ]],
    );
}

#[test]
fn a_number_or_time_out_of_range_is_refused_with_what_can_be() {
    check(
        "reply-delay",
        "1ms 2ms 3ms",
        expect![[
            r#"reply-delay cannot be `1ms 2ms 3ms`: there is too much; its settings are TIME [JITTER] | off"#
        ]],
    );
    check(
        "reply-delay",
        "2h",
        expect![[
            r#"reply-delay cannot be `2h`: a pause is at most 1h; for no replies at all, set connection to silent; its settings are TIME [JITTER] | off"#
        ]],
    );
    check(
        "reply-pieces",
        "1",
        expect![[
            r#"reply-pieces cannot be `1`: the number of pieces is 2 to 64; its settings are 2..64 [GAP] | off"#
        ]],
    );
    check(
        "reply-pieces",
        "65 1ms",
        expect![[
            r#"reply-pieces cannot be `65 1ms`: the number of pieces is 2 to 64; its settings are 2..64 [GAP] | off"#
        ]],
    );
    check(
        "reply-pieces",
        "two",
        expect![[
            r#"reply-pieces cannot be `two`: the number of pieces is 2 to 64; its settings are 2..64 [GAP] | off"#
        ]],
    );
    check(
        "exception",
        "05",
        expect![[
            r#"exception cannot be `05`: the exception is 04 (device failure) or 06 (device busy); its settings are 04 [CHANCE] | 06 [CHANCE] | off"#
        ]],
    );
    check(
        "exception",
        "04 often",
        expect![[
            r#"exception cannot be `04 often`: a chance is a percentage, as in 30% or 0.5%; its settings are 04 [CHANCE] | 06 [CHANCE] | off"#
        ]],
    );
}

#[test]
fn a_time_that_is_none_is_refused_in_the_words_of_durations() {
    let reason = stepdrive_rig::duration::parse("soon").expect_err("no time").to_string();
    assert!(refusal("reply-delay", "soon").contains(&reason));
    assert!(refusal("reply-delay", "1ms soon").contains(&reason));
    assert!(refusal("reply-pieces", "3 soon").contains(&reason));
}

#[test]
fn a_chance_is_exact_to_a_millionth() {
    for (text, parts) in [
        ("never", 0),
        ("0%", 0),
        ("0.0001%", 1),
        ("30%", 300_000),
        ("033.3333%", 333_333),
        ("100.0%", 1_000_000),
    ] {
        assert_eq!(Chance::parse(text).map(Chance::parts_per_million), Ok(parts), "{text}");
    }
    for text in ["", "%", "30", "-1%", "+1%", ".5%", "5.%", "1.2.3%", "1e1%", " 5%", "½%"] {
        assert_eq!(Chance::parse(text), Err(ChanceError::Malformed), "{text}");
    }
    for text in ["100.0001%", "101%", "99999999999999999999%"] {
        assert_eq!(Chance::parse(text), Err(ChanceError::TooMuch), "{text}");
    }
    assert_eq!(Chance::percent(u32::MAX), Chance::ALWAYS);
    assert_eq!(Chance::per_million(u32::MAX), Chance::ALWAYS);
}

fn chance() -> impl Strategy<Value = Chance> {
    prop_oneof![Just(Chance::NEVER), Just(Chance::ALWAYS), (0..=1_000_000_u32).prop_map(Chance::per_million)]
}

fn time() -> impl Strategy<Value = Duration> {
    let most = u64::try_from(MOST_PAUSE.as_nanos()).expect("an hour");
    prop_oneof![Just(Duration::ZERO), (0..=most).prop_map(Duration::from_nanos)]
}

prop_compose! {
    fn line_faults()(
        connection in prop_oneof![Just(Connection::Good), Just(Connection::Cut), Just(Connection::Silent)],
        delay in prop::option::of((time(), time())),
        pieces in prop::option::of((2..=64_u8, time())),
        (drop, duplicate, damage, wrong_id) in (chance(), chance(), chance(), chance()),
        exception in prop::option::of((prop::bool::ANY, chance())),
    ) -> LineFaults {
        let code = |busy| if busy { Exception::ServerDeviceBusy } else { Exception::ServerDeviceFailure };
        LineFaults {
            connection,
            delay: delay.filter(|times| *times != Default::default()).map(|(delay, jitter)| Delay { delay, jitter }),
            pieces: pieces.map(|(count, gap)| Pieces { count, gap }),
            drop, duplicate, damage, wrong_id,
            exception: exception.filter(|(_, often)| *often != Chance::NEVER).map(|(busy, often)| (code(busy), often)),
        }
    }
}

proptest! {
    #[test]
    fn what_is_told_sets_the_same_faults(faults in line_faults()) {
        let mut again = LineFaults::default();
        for (name, setting) in faults.describe() {
            again.set(name, &setting, Family::Smsd).expect("it was told");
        }
        prop_assert_eq!(again, faults);
        prop_assert_eq!(faults.describe().next().is_none(), faults.is_good());
    }

    #[test]
    fn a_chance_reads_back(chance in chance()) {
        prop_assert_eq!(Chance::parse(&chance.to_string()), Ok(chance));
    }

    #[test]
    fn no_setting_is_half_taken(
        index in 0..LINE_FAULTS.len(),
        setting in "[a-z0-9%. ]{0,12}|\\PC{0,20}|(on|off|04|3|20ms|30%)( (30%|5ms|04|x)){0,2}",
    ) {
        let fault = &LINE_FAULTS[index];
        let mut faults = LineFaults::default();
        match faults.set(fault.name, &setting, Family::Smsd) {
            Ok(()) => prop_assert!(faults.describe().all(|(name, _)| name == fault.name)),
            Err(error) => {
                prop_assert!(faults.is_good());
                prop_assert!(error.to_string().contains(fault.settings));
            }
        }
    }
}
