//! The rig's own settings in its file, `[rig]`: what they give, and what a person is told about mistakes.
#![allow(clippy::needless_pass_by_value, reason = "an `Expect` is written in place")]

use expect_test::{Expect, expect};
use stepdrive_rig::file::{ClockMode, DEMO, RigFile};

/// A drive with nothing but what it must have.
const MINIMAL: &str =
    "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-8.0LAN\"\nmodbus_tcp = \"127.0.0.1:5020\"\n";

const TOKEN: &str = "api_token = \"correct-horse-battery\"";

fn with(settings: &str) -> String {
    format!("[rig]\n{settings}\n{MINIMAL}")
}

fn rig(settings: &str) -> RigFile {
    RigFile::parse(&with(settings)).unwrap_or_else(|error| panic!("{}", error.render("rig.toml")))
}

/// What a person reads about the first mistake in the settings.
fn check(settings: &str, expect: Expect) {
    expect.assert_eq(&RigFile::parse(&with(settings)).expect_err(settings).render("rig.toml"));
}

#[test]
fn without_settings_time_is_real_and_nothing_listens() {
    let file = RigFile::parse(MINIMAL).expect("valid");
    assert_eq!((file.clock, file.api, file.seed), (ClockMode::Real, None, 1));
    assert!(file.wires.is_empty());
}

#[test]
fn the_demo_rig_is_controlled_from_this_computer_and_shows_the_defaults() {
    let (demo, plain) = (RigFile::parse(DEMO).expect("valid"), rig(""));
    assert_eq!((demo.clock, demo.seed, demo.wires), (plain.clock, plain.seed, plain.wires));
    let api = demo.api.expect("there");
    assert_eq!((api.address.to_string().as_str(), api.token), ("127.0.0.1:8087", None));
}

#[test]
fn the_settings_that_the_demo_rig_shows_as_comments_are_valid() {
    let lines = DEMO.lines().map(|line| match line.strip_prefix("# ") {
        Some(setting) if setting.starts_with("[[") || setting.contains(" = ") => setting,
        _ => line,
    });
    let mut all = lines.map(|line| line.to_owned() + "\n").collect::<String>();
    all = all.replace("api_token = \"...\"", TOKEN);
    let second = MINIMAL.replace("stage", "stage2").replace("5020", "5022");
    let file = RigFile::parse(&(all + &second)).unwrap_or_else(|error| panic!("{}", error.render("demo")));
    assert_eq!((file.wires.len(), file.drives.len()), (1, 3));
    assert!(file.wires[0].delay.is_zero() && !file.wires[0].invert);
    assert!(file.api.expect("there").token.is_some());
}

#[test]
fn every_way_of_passing_time_is_taken_and_written_as_it_is_read() {
    for (text, mode) in [
        ("real", ClockMode::Real),
        ("paused", ClockMode::Paused),
        ("x100", ClockMode::Factor(100.0)),
        ("x0.5", ClockMode::Factor(0.5)),
        ("x1", ClockMode::Factor(1.0)),
        ("x0.01", ClockMode::Factor(0.01)),
        ("x1000000", ClockMode::Factor(1_000_000.0)),
    ] {
        assert_eq!(rig(&format!("clock = \"{text}\"")).clock, mode);
        assert_eq!(mode.to_string(), text);
    }
}

#[test]
fn what_is_no_way_of_passing_time_is_told() {
    for text in ["Real", "", "x", "100", "x1e3", "x-1", "xinf", "xNaN", "x.5", "x5.", "x1.2.3", "x 2", "x+1"]
    {
        let error = ClockMode::parse(text).expect_err(text).to_string();
        assert!(error.contains("is unknown; it is real, paused, or x and a factor"), "{error}");
    }
    check(
        "clock = \"fast\"",
        expect![[r#"
            rig.toml:2:9: clock `fast` is unknown; it is real, paused, or x and a factor, as in x100
              |
            2 | clock = "fast"
              |         ^^^^^^"#]],
    );
    check(
        "clock = \"x0.001\"",
        expect![[r#"
        rig.toml:2:9: the clock's factor is 0.001; it is 0.01 to 1000000
          |
        2 | clock = "x0.001"
          |         ^^^^^^^^"#]],
    );
    check(
        "clock = \"x1000001\"",
        expect![[r#"
        rig.toml:2:9: the clock's factor is 1000001; it is 0.01 to 1000000
          |
        2 | clock = "x1000001"
          |         ^^^^^^^^^^"#]],
    );
    check(
        "clock = 100",
        expect![[r#"
        rig.toml:2:9: found integer `100`, expected a string
          |
        2 | clock = 100
          |         ^^^"#]],
    );
    let endless = "x".to_owned() + &"9".repeat(500);
    assert_eq!(
        ClockMode::parse(&endless).expect_err("too fast").to_string(),
        "the clock's factor is inf; it is 0.01 to 1000000"
    );
}

#[test]
fn a_seed_is_a_whole_number() {
    assert_eq!(rig("seed = 0").seed, 0);
    assert_eq!(rig("seed = 9223372036854775807").seed, i64::MAX.unsigned_abs());
    check(
        "seed = -1",
        expect![[r#"
        rig.toml:2:8: seed is -1; it is 0 to 9223372036854775807
          |
        2 | seed = -1
          |        ^^"#]],
    );
    check(
        "seed = 1.5",
        expect![[r#"
        rig.toml:2:8: found number `1.5`, expected a whole number
          |
        2 | seed = 1.5
          |        ^^^"#]],
    );
}

#[test]
fn a_rig_is_controlled_from_this_computer_or_with_a_token() {
    for address in ["127.0.0.1:8087", "127.9.9.9:1", "[::1]:0", "[::ffff:127.0.0.1]:8087"] {
        let api = rig(&format!("api = \"{address}\"")).api.expect("there");
        assert_eq!((api.address.to_string().as_str(), api.token), (address, None));
    }
    for address in ["0.0.0.0:8087", "192.0.2.1:8087", "[::]:8087", "[2001:db8::1]:0"] {
        assert!(RigFile::parse(&with(&format!("api = \"{address}\""))).is_err(), "{address}");
        let api = rig(&format!("api = \"{address}\"\n{TOKEN}")).api.expect("there");
        assert_eq!(api.token.as_deref(), Some("correct-horse-battery"));
    }
    check(
        "api = \"0.0.0.0:8087\"",
        expect![[r#"
        rig.toml:2:7: 0.0.0.0:8087 can be reached by others, who could then control the rig; give an api_token too, or take a loopback address, as in 127.0.0.1:8087
          |
        2 | api = "0.0.0.0:8087"
          |       ^^^^^^^^^^^^^^"#]],
    );
    check(
        "api = \"localhost:8087\"",
        expect![[r#"
        rig.toml:2:7: `localhost:8087` is no IP address with a port, as in 127.0.0.1:5020
          |
        2 | api = "localhost:8087"
          |       ^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_token_is_long_enough_and_fits_into_a_header() {
    let api = |token: &str| with(&format!("api = \"127.0.0.1:0\"\napi_token = \"{token}\""));
    for token in ["0123456789abcdef", &"~".repeat(256)] {
        assert!(RigFile::parse(&api(token)).is_ok(), "{token}");
    }
    for token in ["0123456789abcde", "0123456789 abcdef", "0123456789äbcdef", "", &"~".repeat(257)] {
        assert!(RigFile::parse(&api(token)).is_err(), "{token}");
    }
    check(
        "api = \"127.0.0.1:0\"\napi_token = \"secret\"",
        expect![[r#"
        rig.toml:3:13: api_token is not 16 to 256 printable ASCII characters without spaces
          |
        3 | api_token = "secret"
          |             ^^^^^^^^"#]],
    );
}

#[test]
fn a_token_alone_guards_nothing() {
    check(
        TOKEN,
        expect![[r#"
        rig.toml:2:13: api_token without api; there is nothing that it would guard
          |
        2 | api_token = "correct-horse-battery"
          |             ^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_token_is_not_shown_in_what_is_printed_for_debugging() {
    let shown = format!("{:?}", rig(&format!("api = \"127.0.0.1:0\"\n{TOKEN}")));
    assert!(shown.contains("(hidden)") && !shown.contains("horse"), "{shown}");
}

#[test]
fn the_api_and_a_drive_do_not_share_a_port() {
    check(
        "api = \"127.0.0.1:5020\"",
        expect![[r#"
        rig.toml:2:7: 127.0.0.1:5020 is taken by the drive `stage`
          |
        2 | api = "127.0.0.1:5020"
          |       ^^^^^^^^^^^^^^^^"#]],
    );
    check(
        &format!("api = \"0.0.0.0:5020\"\n{TOKEN}"),
        expect![[r#"
        rig.toml:2:7: 0.0.0.0:5020 is taken by the drive `stage`
          |
        2 | api = "0.0.0.0:5020"
          |       ^^^^^^^^^^^^^^"#]],
    );
    assert!(RigFile::parse(&with("api = \"127.0.0.2:5020\"")).is_ok());
    let free = with("api = \"127.0.0.1:0\"").replace("5020", "0");
    assert!(RigFile::parse(&free).is_ok());
}

#[test]
fn an_unknown_setting_is_shown_with_those_that_there_are() {
    check(
        "speed = 2",
        expect![[r#"
        rig.toml:2:1: unknown field `speed`, expected one of `clock`, `api`, `api_token`, `seed`
          |
        2 | speed = 2
          | ^^^^^"#]],
    );
}
