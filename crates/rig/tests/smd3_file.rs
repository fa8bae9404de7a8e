//! Rig files with an SMD3: what they give, and what a person is told about mistakes.
#![allow(clippy::float_cmp, reason = "what is written is taken as it is")]
#![allow(clippy::needless_pass_by_value, reason = "an `Expect` is written in place")]

use expect_test::{Expect, expect};
use std::time::Duration;
use stepdrive_drive::smd3::{Settings, Stored, Thermal};
use stepdrive_rig::file::{DEMO, DriveSection, RigFile, SerialPort, Smd3Section};
use stepdrive_spec::smd3::signals::{Sensor, Signal};
use stepdrive_spec::time::Instant;

/// A drive with nothing but what it must have.
const MINIMAL: &str = "[[drive]]\nname = \"uhv\"\nmodel = \"SMD3\"\nserial = \"pty\"\n";

/// The only drive of a file that is valid.
fn drive(text: &str) -> DriveSection {
    let file = RigFile::parse(text).unwrap_or_else(|error| panic!("{}", error.render("rig.toml")));
    assert_eq!(file.drives.len(), 1);
    file.drives[0].clone()
}

fn smd3(drive: &DriveSection) -> &Smd3Section {
    drive.smd3().expect("an SMD3")
}

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
fn the_demo_rig_has_an_smd3_with_two_limits_and_shows_the_defaults() {
    let demo = RigFile::parse(DEMO).expect("valid");
    let uhv = demo.drives.iter().find(|drive| drive.name == "uhv").expect("there");
    let (section, plain) = (smd3(uhv), drive(MINIMAL));
    assert_eq!((&section.serial, section.serial_tcp), (&smd3(&plain).serial, None));
    assert_eq!((section.thermal, section.sensor), (smd3(&plain).thermal, smd3(&plain).sensor));
    let wired: Vec<Signal> = section.switches.iter().map(|switch| switch.input).collect();
    assert_eq!(wired, [Signal::LimitNegative, Signal::LimitPositive]);
}

#[test]
fn everything_but_name_model_and_a_port_has_a_default() {
    let drive = drive(MINIMAL);
    assert_eq!((drive.steps_per_rev, drive.travel, drive.start), (200, None, 0.0));
    let section = smd3(&drive);
    assert_eq!((&section.serial, section.serial_tcp), (&Some(SerialPort::Pty(None)), None));
    assert_eq!((section.thermal, section.sensor), (Thermal::default(), Sensor::Connected));
    assert!(section.switches.is_empty());
    assert!(drive.smsd().is_none());
}

#[test]
fn every_key_is_taken() {
    let lines = "serial_tcp = \"127.0.0.1:5021\"\nmotor.steps_per_rev = 400\n\
        mechanics = { travel = [-10, 20], start = 5 }\n\
        winding = { ambient = -10, time_constant = 0.25, rise = 300, sensor = \"open\" }\n\
        switch = [{ input = \"LIMIT_POSITIVE\", closed = [4, 6] }, { input = \"STEP\", closed = [8, 9] }]\n";
    let drive = drive(&(MINIMAL.replace("\"pty\"", "\"pty:/tmp/ttyACM0\"") + lines));
    let section = smd3(&drive);
    assert_eq!(section.serial, Some(SerialPort::Pty(Some("/tmp/ttyACM0".into()))));
    assert_eq!(section.serial_tcp.map(|address| address.port()), Some(5021));
    assert_eq!((section.thermal.ambient_c, section.thermal.rise_k), (-10.0, 300.0));
    assert_eq!(section.thermal.time_constant, Duration::from_millis(250));
    assert_eq!((drive.steps_per_rev, section.sensor), (400, Sensor::Open));
    let machine = section.power_up(&drive, Stored::Nothing);
    assert_eq!(machine.carriage(Instant::ZERO), 5.0);
    assert_eq!(machine.drive().signals(), Signal::LimitPositive.bit());
    assert_eq!(machine.drive().temperature(Instant::ZERO), -10.0);
}

#[test]
fn every_signal_may_be_wired() {
    for signal in Signal::ALL {
        let lines = format!("[[drive.switch]]\ninput = \"{signal}\"\nclosed = [-1.0, 1.0]\n");
        let drive = drive(&format!("{MINIMAL}{lines}"));
        let machine = smd3(&drive).power_up(&drive, Stored::Intact(Settings::factory()));
        assert_eq!(machine.drive().signals(), signal.bit(), "{signal}");
    }
}

#[test]
fn either_port_is_enough() {
    let tcp = MINIMAL.replace("serial = \"pty\"", "serial_tcp = \"[::1]:0\"");
    assert!(smd3(&drive(&tcp)).serial.is_none());
}

#[test]
fn the_ends_of_the_ranges_are_taken() {
    for line in [
        "ambient = -273.0",
        "ambient = 1000.0",
        "time_constant = 0.001",
        "time_constant = 1e9",
        "rise = 0.001",
        "rise = 10_000",
    ] {
        drive(&format!("{MINIMAL}[drive.winding]\n{line}\n"));
    }
    for sensor in ["connected", "open", "short"] {
        drive(&format!("{MINIMAL}[drive.winding]\nsensor = \"{sensor}\"\n"));
    }
}

#[test]
fn a_port_is_wanted() {
    check(
        &MINIMAL.replace("serial = \"pty\"\n", ""),
        expect![[r#"
        rig.toml:2:8: an SMD3 needs a port, as in serial = "pty" or serial_tcp = "127.0.0.1:0"
          |
        2 | name = "uhv"
          |        ^^^^^"#]],
    );
}

#[test]
fn the_keys_of_the_other_family_are_refused() {
    for line in [
        "modbus_tcp = \"127.0.0.1:5020\"",
        "word_order = \"low-first\"",
        "autonomous = false",
        "mode_n_programs = 1",
    ] {
        assert!(RigFile::parse(&format!("{MINIMAL}{line}\n")).is_err(), "{line}");
    }
    check_drive(
        "modbus_tcp = \"127.0.0.1:5020\"\n",
        expect![[r#"
        rig.toml:5:14: modbus_tcp is not for an SMD3; see `stepdrive example-rig`
          |
        5 | modbus_tcp = "127.0.0.1:5020"
          |              ^^^^^^^^^^^^^^^^"#]],
    );
    let smsd = "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n";
    check(
        &format!("{smsd}serial = \"pty\"\n"),
        expect![[r#"
        rig.toml:5:10: serial is not for an SMSD; see `stepdrive example-rig`
          |
        5 | serial = "pty"
          |          ^^^^^"#]],
    );
    check(
        &format!("{smsd}serial_tcp = \"127.0.0.1:0\"\n"),
        expect![[r#"
        rig.toml:5:14: serial_tcp is not for an SMSD; see `stepdrive example-rig`
          |
        5 | serial_tcp = "127.0.0.1:0"
          |              ^^^^^^^^^^^^^"#]],
    );
    check(
        &format!("{smsd}[drive.winding]\nrise = 100\n"),
        expect![[r#"
        rig.toml:5:1: winding is not for an SMSD; see `stepdrive example-rig`
          |
        5 | [drive.winding]
          | ^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_serial_port_has_one_of_two_forms() {
    for form in ["/dev/ttyUSB0", "pty:", "PTY", "", "pty:/tmp/a\\u0000b"] {
        assert!(RigFile::parse(&MINIMAL.replace("\"pty\"", &format!("\"{form}\""))).is_err(), "{form}");
    }
    check(
        &MINIMAL.replace("\"pty\"", "\"/dev/ttyUSB0\""),
        expect![[r#"
        rig.toml:4:10: serial `/dev/ttyUSB0` is unknown; it is pty or pty:PATH
          |
        4 | serial = "/dev/ttyUSB0"
          |          ^^^^^^^^^^^^^^"#]],
    );
    check(
        &MINIMAL.replace("\"pty\"", "\"pty:\""),
        expect![[r#"
        rig.toml:4:10: serial `pty:` is unknown; it is pty or pty:PATH
          |
        4 | serial = "pty:"
          |          ^^^^^^"#]],
    );
    check(
        &MINIMAL.replace("\"pty\"", "true"),
        expect![[r#"
        rig.toml:4:10: found boolean `true`, expected a string
          |
        4 | serial = true
          |          ^^^^"#]],
    );
    check_drive(
        "serial_tcp = \"localhost:5021\"\n",
        expect![[r#"
        rig.toml:5:14: `localhost:5021` is no IP address with a port, as in 127.0.0.1:5020
          |
        5 | serial_tcp = "localhost:5021"
          |              ^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_winding_is_physical() {
    check_drive(
        "[drive.winding]\nambient = -274.0\n",
        expect![[r#"
        rig.toml:6:11: ambient is -274.0; it is -273.0 to 1000.0
          |
        6 | ambient = -274.0
          |           ^^^^^^"#]],
    );
    check_drive(
        "[drive.winding]\ntime_constant = 0.0\n",
        expect![[r#"
        rig.toml:6:17: time_constant is 0.0; it is 0.001 to 1000000000.0
          |
        6 | time_constant = 0.0
          |                 ^^^"#]],
    );
    check_drive(
        "[drive.winding]\ntime_constant = inf\n",
        expect![[r#"
        rig.toml:6:17: time_constant is inf; it is 0.001 to 1000000000.0
          |
        6 | time_constant = inf
          |                 ^^^"#]],
    );
    check_drive(
        "[drive.winding]\nrise = nan\n",
        expect![[r#"
        rig.toml:6:8: rise is NaN; it is 0.001 to 10000.0
          |
        6 | rise = nan
          |        ^^^"#]],
    );
    check_drive(
        "[drive.winding]\nrise = -150.0\n",
        expect![[r#"
        rig.toml:6:8: rise is -150.0; it is 0.001 to 10000.0
          |
        6 | rise = -150.0
          |        ^^^^^^"#]],
    );
    check_drive(
        "[drive.winding]\nsensor = \"wet\"\n",
        expect![[r#"
        rig.toml:6:10: sensor `wet` is unknown; it is one of connected, open, short
          |
        6 | sensor = "wet"
          |          ^^^^^"#]],
    );
    check_drive(
        "[drive.winding]\ncolour = \"red\"\n",
        expect![[r#"
        rig.toml:6:1: unknown field `colour`, expected one of `ambient`, `time_constant`, `rise`, `sensor`
          |
        6 | colour = "red"
          | ^^^^^^"#]],
    );
}

#[test]
fn a_switch_is_wired_to_one_of_the_smd3_s_signals() {
    check_drive(
        "[[drive.switch]]\ninput = \"SET_ZERO\"\nclosed = [1.0, 2.0]\n",
        expect![[r#"
        rig.toml:6:9: input `SET_ZERO` is unknown; it is one of LIMIT_NEGATIVE, LIMIT_POSITIVE, ENABLE, RESET_FAULT, STEP, DIR, JOYSTICK, JOYSTICK_CW, JOYSTICK_CCW
          |
        6 | input = "SET_ZERO"
          |         ^^^^^^^^^^"#]],
    );
}

#[test]
fn two_drives_do_not_share_a_port() {
    let other = |line: &str| format!("[[drive]]\nname = \"other\"\nmodel = \"SMD3\"\n{line}\n");
    let fixed = MINIMAL.replace("\"pty\"", "\"pty:/tmp/uhv\"") + "serial_tcp = \"127.0.0.1:5021\"\n";
    check(
        &(fixed.clone() + &other("serial_tcp = \"127.0.0.1:5021\"")),
        expect![[r#"
        rig.toml:9:14: 127.0.0.1:5021 is taken by the drive `uhv`
          |
        9 | serial_tcp = "127.0.0.1:5021"
          |              ^^^^^^^^^^^^^^^^"#]],
    );
    check(
        &(fixed.clone() + &other("serial = \"pty:/tmp/uhv\"")),
        expect![[r#"
        rig.toml:9:10: /tmp/uhv is taken by the drive `uhv`
          |
        9 | serial = "pty:/tmp/uhv"
          |          ^^^^^^^^^^^^^^"#]],
    );
    let smsd = "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:5021\"\n";
    check(
        &(fixed.clone() + smsd),
        expect![[r#"
        rig.toml:9:14: 127.0.0.1:5021 is taken by the drive `uhv`
          |
        9 | modbus_tcp = "127.0.0.1:5021"
          |              ^^^^^^^^^^^^^^^^"#]],
    );
    check(&(fixed + &other("serial = \"pty\"\nserial_tcp = \"127.0.0.1:0\"")), expect!["valid, 2 drives"]);
}
