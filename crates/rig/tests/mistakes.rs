//! Rig files with mistakes: what a person is told.
#![allow(clippy::needless_pass_by_value, reason = "an `Expect` is written in place")]

use expect_test::{Expect, expect};
use stepdrive_rig::file::RigFile;

/// A drive with nothing but what it must have.
const MINIMAL: &str =
    "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-8.0LAN\"\nmodbus_tcp = \"127.0.0.1:5020\"\n";

/// What a person reads about the first mistake in a file.
fn check(text: &str, expect: Expect) {
    let shown = match RigFile::parse(text) {
        Ok(file) => format!("valid, {} drives", file.drives.len()),
        Err(error) => error.render("rig.toml"),
    };
    expect.assert_eq(&shown);
}

/// The same for further lines behind a minimal drive.
fn check_drive(lines: &str, expect: Expect) {
    check(&format!("{MINIMAL}{lines}"), expect);
}

#[test]
fn a_mistake_knows_its_place() {
    let error = RigFile::parse(&format!("{MINIMAL}autonomous = 1\n")).expect_err("a mistake");
    assert_eq!((error.line, error.column), (Some(5), Some(14)));
    assert_eq!(error.to_string(), "found integer `1`, expected true or false");
    let error = RigFile::parse("").expect_err("a mistake");
    assert_eq!((error.line, error.column), (None, None));
}

#[test]
fn columns_count_characters_and_lines_may_end_in_crlf() {
    let text = MINIMAL.replace('\n', "\r\n") + "autonomous = { größe = 1 }, name = 2\r\n";
    let error = RigFile::parse(&text).expect_err("a mistake");
    assert_eq!(error.line, Some(5));
    assert!(!error.render("rig.toml").contains('\r'));
    let text = MINIMAL.to_owned() + "mechanics = { \"größe\" = 1 }\n";
    assert_eq!(RigFile::parse(&text).expect_err("a mistake").column, Some(15));
}

#[test]
fn a_byte_order_mark_does_not_matter() {
    assert!(RigFile::parse(&format!("\u{FEFF}{MINIMAL}")).is_ok());
    check(
        "\u{FEFF}[[drive]]\n",
        expect![[r#"
            rig.toml:1:1: missing field `name`
              |
            1 | [[drive]]
              | ^^^^^^^^^"#]],
    );
}

#[test]
fn an_unknown_key_is_shown_with_those_that_there_are() {
    check_drive(
        "wheels = 4\n",
        expect![[r#"
            rig.toml:5:1: unknown field `wheels`, expected one of `name`, `model`, `modbus_tcp`, `usb`, `usb_tcp`, `lan`, `standard_tcp`, `protocol_version`, `serial`, `serial_tcp`, `word_order`, `autonomous`, `mode_n_programs`, `motor`, `mechanics`, `winding`, `switch`
              |
            5 | wheels = 4
              | ^^^^^^"#]],
    );
    check_drive(
        "[drive.motor]\nsteps = 200\n",
        expect![[r#"
            rig.toml:6:1: unknown field `steps`, expected `steps_per_rev`
              |
            6 | steps = 200
              | ^^^^^"#]],
    );
    check_drive(
        "[rig]\nspeed = 3\n",
        expect![[r#"
            rig.toml:6:1: unknown field `speed`, expected one of `clock`, `api`, `api_token`, `seed`
              |
            6 | speed = 3
              | ^^^^^"#]],
    );
    check_drive(
        "[[drives]]\nname = \"x\"\n",
        expect![[r#"
            rig.toml:5:3: unknown field `drives`, expected one of `rig`, `drive`, `wire`
              |
            5 | [[drives]]
              |   ^^^^^^"#]],
    );
}

#[test]
fn a_name_that_is_none_of_a_few_is_shown_with_those_that_there_are() {
    check_drive(
        "word_order = \"big\"\n",
        expect![[r#"
        rig.toml:5:14: word_order `big` is unknown; it is one of low-first, high-first
          |
        5 | word_order = "big"
          |              ^^^^^"#]],
    );
    check_drive(
        "[[drive.switch]]\ninput = \"HOME\"\nclosed = [1.0, 2.0]\n",
        expect![[r#"
        rig.toml:6:9: input `HOME` is unknown; it is one of IN0, IN1, SET_ZERO, SW, EN, STEP, DIR, CONTINUE
          |
        6 | input = "HOME"
          |         ^^^^^^"#]],
    );
    check_drive(
        "[rig]\nclock = \"fast\"\n",
        expect![[r#"
            rig.toml:6:9: clock `fast` is unknown; it is real, paused, or x and a factor, as in x100
              |
            6 | clock = "fast"
              |         ^^^^^^"#]],
    );
    check(
        &MINIMAL.replace("SMSD-8.0LAN", "SMSD-8.0"),
        expect![[r#"
            rig.toml:3:9: model `SMSD-8.0` is unknown; it is one of SMSD-4.2LAN, SMSD-8.0LAN, SMD3
              |
            3 | model = "SMSD-8.0"
              |         ^^^^^^^^^^"#]],
    );
}

#[test]
fn a_value_of_the_wrong_type_is_told_as_such() {
    check_drive(
        "autonomous = 1\n",
        expect![[r#"
        rig.toml:5:14: found integer `1`, expected true or false
          |
        5 | autonomous = 1
          |              ^"#]],
    );
    check_drive(
        "mode_n_programs = \"1\"\n",
        expect![[r#"
        rig.toml:5:19: found string "1", expected a whole number
          |
        5 | mode_n_programs = "1"
          |                   ^^^"#]],
    );
    check_drive(
        "[drive.motor]\nsteps_per_rev = 200.0\n",
        expect![[r#"
        rig.toml:6:17: found number `200.0`, expected a whole number
          |
        6 | steps_per_rev = 200.0
          |                 ^^^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\nstart = \"left\"\n",
        expect![[r#"
        rig.toml:6:9: found string "left", expected a number
          |
        6 | start = "left"
          |         ^^^^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\ntravel = 100.0\n",
        expect![[r#"
        rig.toml:6:10: found number `100.0`, expected a list
          |
        6 | travel = 100.0
          |          ^^^^^"#]],
    );
    check_drive(
        "[[drive.switch]]\ninput = 2\nclosed = [1.0, 2.0]\n",
        expect![[r#"
        rig.toml:6:9: found integer `2`, expected a string
          |
        6 | input = 2
          |         ^"#]],
    );
    check_drive(
        "[drive.switch]\ninput = \"IN0\"\nclosed = [1.0, 2.0]\n",
        expect![[r#"
        rig.toml:5:1: found one table where there may be several; its name stands in double brackets
          |
        5 | [drive.switch]
          | ^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_number_out_of_range_is_told_the_range() {
    check_drive(
        "mode_n_programs = 9\n",
        expect![[r#"
        rig.toml:5:19: mode_n_programs is 9; it is 0 to 3
          |
        5 | mode_n_programs = 9
          |                   ^"#]],
    );
    check_drive(
        "mode_n_programs = -1\n",
        expect![[r#"
        rig.toml:5:19: mode_n_programs is -1; it is 0 to 3
          |
        5 | mode_n_programs = -1
          |                   ^^"#]],
    );
    check_drive(
        "mode_n_programs = 300\n",
        expect![[r#"
        rig.toml:5:19: mode_n_programs is 300; it is 0 to 3
          |
        5 | mode_n_programs = 300
          |                   ^^^"#]],
    );
    check_drive(
        "[drive.motor]\nsteps_per_rev = 0\n",
        expect![[r#"
        rig.toml:6:17: steps_per_rev is 0; it is 1 to 10000
          |
        6 | steps_per_rev = 0
          |                 ^"#]],
    );
    check_drive(
        "[drive.motor]\nsteps_per_rev = 10_001\n",
        expect![[r#"
        rig.toml:6:17: steps_per_rev is 10001; it is 1 to 10000
          |
        6 | steps_per_rev = 10_001
          |                 ^^^^^^"#]],
    );
}

#[test]
fn an_address_needs_a_port() {
    check(
        &MINIMAL.replace(":5020", ""),
        expect![[r#"
        rig.toml:4:14: `127.0.0.1` is no IP address with a port, as in 127.0.0.1:5020
          |
        4 | modbus_tcp = "127.0.0.1"
          |              ^^^^^^^^^^^"#]],
    );
    check(
        &MINIMAL.replace("127.0.0.1", "localhost"),
        expect![[r#"
        rig.toml:4:14: `localhost:5020` is no IP address with a port, as in 127.0.0.1:5020
          |
        4 | modbus_tcp = "localhost:5020"
          |              ^^^^^^^^^^^^^^^^"#]],
    );
    check(
        &MINIMAL.replace("5020", "65536"),
        expect![[r#"
        rig.toml:4:14: `127.0.0.1:65536` is no IP address with a port, as in 127.0.0.1:5020
          |
        4 | modbus_tcp = "127.0.0.1:65536"
          |              ^^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_travel_leads_from_low_to_high_over_at_least_one_place() {
    check_drive(
        "[drive.mechanics]\ntravel = [10.0, -10.0]\n",
        expect![[r#"
        rig.toml:6:10: travel is [10.0, -10.0]; the first must be below the second, both within ±1e9 full steps
          |
        6 | travel = [10.0, -10.0]
          |          ^^^^^^^^^^^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\ntravel = [10.0, 10.0]\n",
        expect![[r#"
        rig.toml:6:10: travel is [10.0, 10.0]; the first must be below the second, both within ±1e9 full steps
          |
        6 | travel = [10.0, 10.0]
          |          ^^^^^^^^^^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\ntravel = [nan, 10.0]\n",
        expect![[r#"
        rig.toml:6:10: travel is [NaN, 10.0]; the first must be below the second, both within ±1e9 full steps
          |
        6 | travel = [nan, 10.0]
          |          ^^^^^^^^^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\ntravel = [-inf, inf]\n",
        expect![[r#"
        rig.toml:6:10: travel is [-inf, inf]; the first must be below the second, both within ±1e9 full steps
          |
        6 | travel = [-inf, inf]
          |          ^^^^^^^^^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\ntravel = [0.001, 0.002]\n",
        expect![[r#"
        rig.toml:6:10: travel is narrower than 1/256 of a full step; nothing could move
          |
        6 | travel = [0.001, 0.002]
          |          ^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn an_interval_has_two_numbers() {
    check_drive(
        "[drive.mechanics]\ntravel = [1.0]\n",
        expect![[r#"
        rig.toml:6:10: two numbers are wanted, from and to; here are 1
          |
        6 | travel = [1.0]
          |          ^^^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\ntravel = [1.0, 2.0, 3.0]\n",
        expect![[r#"
        rig.toml:6:10: two numbers are wanted, from and to; here are 3
          |
        6 | travel = [1.0, 2.0, 3.0]
          |          ^^^^^^^^^^^^^^^"#]],
    );
    check_drive(
        "[[drive.switch]]\ninput = \"IN0\"\nclosed = []\n",
        expect![[r#"
        rig.toml:7:10: two numbers are wanted, from and to; here are 0
          |
        7 | closed = []
          |          ^^"#]],
    );
}

#[test]
fn the_start_lies_within_the_travel() {
    check_drive(
        "[drive.mechanics]\ntravel = [-10.0, 10.0]\nstart = 11.0\n",
        expect![[r#"
        rig.toml:7:9: start 11.0 is not within the travel, -10.0 to 10.0
          |
        7 | start = 11.0
          |         ^^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\nstart = nan\n",
        expect![[r#"
        rig.toml:6:9: start is NaN; it is within ±1e9 full steps
          |
        6 | start = nan
          |         ^^^"#]],
    );
    check_drive(
        "[drive.mechanics]\nstart = -1e10\n",
        expect![[r#"
        rig.toml:6:9: start is -10000000000.0; it is within ±1e9 full steps
          |
        6 | start = -1e10
          |         ^^^^^"#]],
    );
}

#[test]
fn a_switch_is_closed_somewhere() {
    check_drive(
        "[[drive.switch]]\ninput = \"IN0\"\nclosed = [2.0, 1.0]\n",
        expect![[r#"
        rig.toml:7:10: closed is [2.0, 1.0]; the first must be below the second, both within ±1e9 full steps
          |
        7 | closed = [2.0, 1.0]
          |          ^^^^^^^^^^"#]],
    );
    check_drive(
        "[[drive.switch]]\ninput = \"IN0\"\nclosed = [0.001, 0.002]\n",
        expect![[r#"
        rig.toml:7:10: closed is narrower than 1/256 of a full step; no microstep would meet it
          |
        7 | closed = [0.001, 0.002]
          |          ^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_missing_key_is_named() {
    check(
        &MINIMAL.replace("name = \"stage\"\n", ""),
        expect![[r#"
            rig.toml:1:1: missing field `name`
              |
            1 | [[drive]]
              | ^^^^^^^^^"#]],
    );
    check(
        &MINIMAL.replace("model = \"SMSD-8.0LAN\"\n", ""),
        expect![[r#"
            rig.toml:1:1: missing field `model`
              |
            1 | [[drive]]
              | ^^^^^^^^^"#]],
    );
    check(
        &MINIMAL.replace("modbus_tcp = \"127.0.0.1:5020\"\n", ""),
        expect![[r#"
            rig.toml:2:8: an SMSD needs an address to listen on, as in modbus_tcp = "127.0.0.1:5020"
              |
            2 | name = "stage"
              |        ^^^^^^^"#]],
    );
    check_drive(
        "[[drive.switch]]\ninput = \"IN0\"\n",
        expect![[r#"
            rig.toml:5:1: missing field `closed`
              |
            5 | [[drive.switch]]
              | ^^^^^^^^^^^^^^^^"#]],
    );
    check_drive(
        "[[drive.switch]]\nclosed = [1.0, 2.0]\n",
        expect![[r#"
            rig.toml:5:1: missing field `input`
              |
            5 | [[drive.switch]]
              | ^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_key_stands_once() {
    check_drive(
        "name = \"other\"\n",
        expect![[r#"
            rig.toml:5:1: this field is there already
              |
            5 | name = "other"
              | ^^^^"#]],
    );
}

#[test]
fn a_name_has_no_spaces_and_is_not_empty() {
    check(
        &MINIMAL.replace("stage", "my stage"),
        expect![[r#"
        rig.toml:2:8: the name `my stage` is not 1 to 32 letters, digits, - and _
          |
        2 | name = "my stage"
          |        ^^^^^^^^^^"#]],
    );
    check(
        &MINIMAL.replace("stage", ""),
        expect![[r#"
        rig.toml:2:8: the name `` is not 1 to 32 letters, digits, - and _
          |
        2 | name = ""
          |        ^^"#]],
    );
}

#[test]
fn drives_have_names_and_addresses_of_their_own() {
    check(
        &format!("{MINIMAL}\n{MINIMAL}"),
        expect![[r#"
        rig.toml:7:8: a drive named `stage` is there already
          |
        7 | name = "stage"
          |        ^^^^^^^"#]],
    );
    check(
        &format!("{MINIMAL}\n{}", MINIMAL.replace("stage", "table")),
        expect![[r#"
        rig.toml:9:14: 127.0.0.1:5020 is taken by the drive `stage`
          |
        9 | modbus_tcp = "127.0.0.1:5020"
          |              ^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_rig_has_a_drive() {
    check("", expect!["rig.toml: the rig has no drive; begin one with [[drive]]"]);
    check("[rig]\nclock = \"real\"\n", expect!["rig.toml: the rig has no drive; begin one with [[drive]]"]);
    check(
        "drive = 3\n",
        expect![[r#"
        rig.toml:1:9: found integer `3`, expected a list
          |
        1 | drive = 3
          |         ^"#]],
    );
}

#[test]
fn text_that_is_not_toml_is_shown_where_it_breaks_off() {
    check(
        "{\"drive\": []}\n",
        expect![[r#"
        rig.toml:1:1: invalid key-value pair, expected key
          |
        1 | {"drive": []}
          | ^"#]],
    );
    check(
        "PK\u{3}\u{4}",
        expect![[r#"
            rig.toml:1:5: key with no value, expected `=`
              |
            1 | PK��
              |     ^"#]],
    );
    check(
        "[[drive]\n",
        expect![[r#"
        rig.toml:1:9: unclosed array table, expected `]`
          |
        1 | [[drive]
          |         ^"#]],
    );
    check(
        "[[drive]]\nname = stage\n",
        expect![[r#"
        rig.toml:2:8: string values must be quoted, expected literal string
          |
        2 | name = stage
          |        ^^^^^"#]],
    );
    check(
        "[[drive]]\nname = \"stage\n",
        expect![[r#"
        rig.toml:2:14: invalid basic string, expected `"`
          |
        2 | name = "stage
          |              ^"#]],
    );
}
