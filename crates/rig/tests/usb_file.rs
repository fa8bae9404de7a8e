//! Rig files with the standard protocol of an SMSD, over USB or LAN: what a person is told about mistakes.
#![allow(clippy::needless_pass_by_value, reason = "an `Expect` is written in place")]

use expect_test::{Expect, expect};
use stepdrive_rig::file::RigFile;

/// A drive with nothing but what it must have.
const MINIMAL: &str =
    "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-8.0LAN\"\nmodbus_tcp = \"127.0.0.1:5020\"\n";

/// One that runs the standard firmware.
const STANDARD: &str = "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-4.2LAN\"\nlan = \"standard\"\nstandard_tcp = \"127.0.0.1:5000\"\n";

/// What a person reads about the first mistake in a file.
fn check(text: &str, expect: Expect) {
    expect.assert_eq(&RigFile::parse(text).expect_err(text).render("rig.toml"));
}

/// The same for further lines behind a minimal drive.
fn check_drive(lines: &str, expect: Expect) {
    check(&format!("{MINIMAL}{lines}"), expect);
}

#[test]
fn usb_is_a_pseudo_terminal_with_or_without_a_name() {
    check_drive(
        "usb = \"COM3\"\n",
        expect![[r#"
        rig.toml:5:7: usb `COM3` is unknown; it is pty or pty:PATH
          |
        5 | usb = "COM3"
          |       ^^^^^^"#]],
    );
    check_drive(
        "usb = \"pty:\"\n",
        expect![[r#"
        rig.toml:5:7: usb `pty:` is unknown; it is pty or pty:PATH
          |
        5 | usb = "pty:"
          |       ^^^^^^"#]],
    );
    check_drive(
        "usb = true\n",
        expect![[r#"
        rig.toml:5:7: found boolean `true`, expected a string
          |
        5 | usb = true
          |       ^^^^"#]],
    );
    check_drive(
        "usb_tcp = \"here\"\n",
        expect![[r#"
        rig.toml:5:11: `here` is no IP address with a port, as in 127.0.0.1:5020
          |
        5 | usb_tcp = "here"
          |           ^^^^^^"#]],
    );
}

#[test]
fn the_protocol_has_two_versions() {
    for version in ["0", "3", "-1"] {
        let error = RigFile::parse(&format!("{MINIMAL}protocol_version = {version}\n")).expect_err(version);
        assert_eq!(error.to_string(), format!("protocol_version is {version}; it is 1 to 2"));
    }
    check_drive(
        "protocol_version = \"2\"\n",
        expect![[r#"
        rig.toml:5:20: found string "2", expected a whole number
          |
        5 | protocol_version = "2"
          |                    ^^^"#]],
    );
}

#[test]
fn each_firmware_has_its_own_address() {
    check_drive(
        "lan = \"usb\"\n",
        expect![[r#"
        rig.toml:5:7: lan `usb` is unknown; it is one of modbus, standard
          |
        5 | lan = "usb"
          |       ^^^^^"#]],
    );
    check_drive(
        "lan = \"standard\"\n",
        expect![[r#"
        rig.toml:4:14: modbus_tcp is not for lan = "standard", which has no Modbus; it has standard_tcp instead
          |
        4 | modbus_tcp = "127.0.0.1:5020"
          |              ^^^^^^^^^^^^^^^^"#]],
    );
    check_drive(
        "standard_tcp = \"127.0.0.1:5000\"\n",
        expect![[r#"
            rig.toml:5:16: standard_tcp is for lan = "standard" alone; give that too, or modbus_tcp instead of it
              |
            5 | standard_tcp = "127.0.0.1:5000"
              |                ^^^^^^^^^^^^^^^^"#]],
    );
    check_drive(
        "lan = \"modbus\"\nstandard_tcp = \"127.0.0.1:5000\"\n",
        expect![[r#"
            rig.toml:6:16: standard_tcp is for lan = "standard" alone; give that too, or modbus_tcp instead of it
              |
            6 | standard_tcp = "127.0.0.1:5000"
              |                ^^^^^^^^^^^^^^^^"#]],
    );
    check(
        &STANDARD.replace("standard_tcp = \"127.0.0.1:5000\"\n", ""),
        expect![[r#"
        rig.toml:2:8: with lan = "standard" an SMSD needs an address to listen on, as in standard_tcp = "127.0.0.1:5000"
          |
        2 | name = "stage"
          |        ^^^^^^^"#]],
    );
    check(
        &STANDARD.replace("standard_tcp", "modbus_tcp"),
        expect![[r#"
        rig.toml:5:14: modbus_tcp is not for lan = "standard", which has no Modbus; it has standard_tcp instead
          |
        5 | modbus_tcp = "127.0.0.1:5000"
          |              ^^^^^^^^^^^^^^^^"#]],
    );
    check(
        &format!("{STANDARD}word_order = \"low-first\"\n"),
        expect![[r#"
        rig.toml:6:14: word_order is not for lan = "standard", which has no Modbus registers
          |
        6 | word_order = "low-first"
          |              ^^^^^^^^^^^"#]],
    );
}

#[test]
fn ports_are_not_shared() {
    check_drive(
        "usb_tcp = \"127.0.0.1:5020\"\n",
        expect![[r#"
        rig.toml:5:11: 127.0.0.1:5020 is taken by another key of the same drive
          |
        5 | usb_tcp = "127.0.0.1:5020"
          |           ^^^^^^^^^^^^^^^^"#]],
    );
    let second = STANDARD.replace("stage", "table").replace("5000", "5020");
    check_drive(
        &second,
        expect![[r#"
        rig.toml:9:16: 127.0.0.1:5020 is taken by the drive `stage`
          |
        9 | standard_tcp = "127.0.0.1:5020"
          |                ^^^^^^^^^^^^^^^^"#]],
    );
    let usb = "usb = \"pty:/tmp/ttyACM0\"\n";
    let uhv = "[[drive]]\nname = \"uhv\"\nmodel = \"SMD3\"\nserial = \"pty:/tmp/ttyACM0\"\n";
    check_drive(
        &format!("{usb}{uhv}"),
        expect![[r#"
        rig.toml:9:10: /tmp/ttyACM0 is taken by the drive `stage`
          |
        9 | serial = "pty:/tmp/ttyACM0"
          |          ^^^^^^^^^^^^^^^^^^"#]],
    );
    let free = "usb = \"pty\"\nusb_tcp = \"127.0.0.1:0\"\n";
    let both = format!("{MINIMAL}{free}{STANDARD}{free}").replacen("stage", "table", 1);
    assert!(RigFile::parse(&both).is_ok());
}

#[test]
fn the_api_does_not_share_a_port_with_usb_over_tcp() {
    check_drive(
        "usb_tcp = \"127.0.0.1:8087\"\n[rig]\napi = \"127.0.0.1:8087\"\n",
        expect![[r#"
        rig.toml:7:7: 127.0.0.1:8087 is taken by the drive `stage`
          |
        7 | api = "127.0.0.1:8087"
          |       ^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn an_smd3_has_none_of_it() {
    let uhv = "[[drive]]\nname = \"uhv\"\nmodel = \"SMD3\"\nserial = \"pty\"\n";
    for line in [
        "usb = \"pty\"",
        "usb_tcp = \"127.0.0.1:0\"",
        "lan = \"modbus\"",
        "standard_tcp = \"127.0.0.1:0\"",
        "protocol_version = 2",
    ] {
        let error = RigFile::parse(&format!("{uhv}{line}\n")).expect_err(line).to_string();
        let key = line.split(' ').next().expect("a key");
        assert_eq!(error, format!("{key} is not for an SMD3; see `stepdrive example-rig`"));
    }
}
