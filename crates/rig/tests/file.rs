//! Rig files that are valid: what they give.
#![allow(clippy::float_cmp, reason = "places are exact")]

use stepdrive_drive::smsd::{Memory, Smsd, WordOrder};
use stepdrive_rig::file::{ClockMode, DEMO, DriveSection, RigFile, SerialPort, SmsdSection};
use stepdrive_rig::machine::Machine;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::Firmware;
use stepdrive_spec::time::Instant;

/// A drive with nothing but what it must have.
const MINIMAL: &str =
    "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-8.0LAN\"\nmodbus_tcp = \"127.0.0.1:5020\"\n";

/// The only drive of a file that is valid.
fn drive(text: &str) -> DriveSection {
    let file = RigFile::parse(text).unwrap_or_else(|error| panic!("{}", error.render("rig.toml")));
    assert_eq!(file.drives.len(), 1);
    file.drives[0].clone()
}

fn smsd(drive: &DriveSection) -> &SmsdSection {
    drive.smsd().expect("an SMSD")
}

/// The drive, switched on with what it remembers.
fn machine(drive: &DriveSection, memory: Memory) -> Machine<Smsd> {
    smsd(drive).power_up(drive, memory)
}

#[test]
fn the_demo_rig_is_a_stage_with_two_switches_and_shows_the_defaults() {
    let (demo, plain) = (RigFile::parse(DEMO).expect("valid").drives[0].clone(), drive(MINIMAL));
    assert_eq!((demo.name.as_str(), demo.steps_per_rev), ("stage", plain.steps_per_rev));
    let (demo, plain) = (smsd(&demo), smsd(&plain));
    assert_eq!((demo.model, demo.lan.address.to_string().as_str()), (Model::Smsd42, "127.0.0.1:5020"));
    assert_eq!(demo.switches.len(), 2);
    assert_eq!((demo.word_order, demo.autonomous), (plain.word_order, plain.autonomous));
    assert_eq!(demo.mode_n_programs, plain.mode_n_programs);
    assert_eq!((demo.lan.firmware, demo.protocol_version), (plain.lan.firmware, plain.protocol_version));
    assert_eq!((&demo.usb, demo.usb_tcp), (&Some(SerialPort::Pty(None)), None));
}

#[test]
fn everything_but_name_model_and_address_has_a_default() {
    let file = RigFile::parse(MINIMAL).expect("valid");
    assert_eq!(file.clock, ClockMode::Real);
    let drive = drive(MINIMAL);
    assert_eq!((drive.steps_per_rev, drive.travel, drive.start), (200, None, 0.0));
    let section = smsd(&drive);
    assert_eq!((section.word_order, section.autonomous), (WordOrder::LowFirst, false));
    assert!(section.mode_n_programs.is_none() && section.switches.is_empty());
    assert!(section.usb.is_none() && section.usb_tcp.is_none());
    assert_eq!((section.lan.firmware, section.protocol_version), (Firmware::Modbus, 2));
    assert_eq!((section.model, section.lan.address.port()), (Model::Smsd80, 5020));
    let machine = machine(&drive, Memory::factory());
    assert_eq!((machine.carriage(Instant::ZERO), machine.next_wake()), (0.0, None));
}

#[test]
fn every_key_is_taken() {
    let lines = "word_order = \"high-first\"\nautonomous = true\nmode_n_programs = 3\n\
        motor.steps_per_rev = 400\nmechanics = { travel = [-10, 20], start = 5 }\n\
        switch = [{ input = \"CONTINUE\", closed = [4, 6] }]\n";
    let drive = drive(&format!("[rig]\nclock = \"real\"\n{MINIMAL}{lines}"));
    assert_eq!((smsd(&drive).word_order, smsd(&drive).autonomous), (WordOrder::HighFirst, true));
    assert_eq!(drive.steps_per_rev, 400);
    let machine = machine(&drive, Memory::factory());
    assert_eq!(machine.carriage(Instant::ZERO), 5.0);
    assert_eq!(machine.drive().inputs(), 0x80);
    assert_eq!(machine.drive().memory().mode_n_programs, 3);
}

#[test]
fn an_smsd_may_have_usb_as_a_port_and_over_tcp() {
    let lines = "usb = \"pty:/tmp/ttyACM0\"\nusb_tcp = \"127.0.0.1:5021\"\nprotocol_version = 1\n";
    let drive = drive(&format!("{MINIMAL}{lines}"));
    let section = smsd(&drive);
    assert_eq!(section.usb, Some(SerialPort::Pty(Some("/tmp/ttyACM0".into()))));
    assert_eq!(section.usb_tcp.map(|address| address.port()), Some(5021));
    let machine = machine(&drive, Memory::factory());
    assert_eq!((machine.drive().protocol_version(), machine.drive().firmware()), (1, Firmware::Modbus));
}

#[test]
fn the_standard_firmware_listens_instead_of_modbus() {
    let standard = MINIMAL.replace("modbus_tcp", "lan = \"standard\"\nstandard_tcp");
    let drive = drive(&standard);
    let section = smsd(&drive);
    assert_eq!((section.lan.firmware, section.lan.address.port()), (Firmware::Standard, 5020));
    assert_eq!(machine(&drive, Memory::factory()).drive().firmware(), Firmware::Standard);
}

#[test]
fn without_mode_n_programs_the_controller_keeps_the_one_it_remembers() {
    let mut memory = Memory::factory();
    memory.mode_n_programs = 2;
    assert_eq!(machine(&drive(MINIMAL), memory).drive().memory().mode_n_programs, 2);
}

#[test]
fn several_drives_may_share_an_address_only_if_its_port_is_free_to_choose() {
    let second = |address: &str| {
        format!("[[drive]]\nname = \"b\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"{address}\"\n")
    };
    for address in ["127.0.0.1:5021", "127.0.0.2:5020", "[::1]:5020"] {
        assert!(RigFile::parse(&format!("{MINIMAL}{}", second(address))).is_ok(), "{address}");
    }
    let free = MINIMAL.replace("5020", "0") + &second("127.0.0.1:0");
    assert_eq!(RigFile::parse(&free).expect("valid").drives.len(), 2);
}

#[test]
fn names_are_up_to_32_letters_digits_and_signs() {
    for name in ["x", "Z-1_a", "12345678901234567890123456789012"] {
        assert_eq!(drive(&MINIMAL.replace("stage", name)).name, name);
    }
    for name in ["123456789012345678901234567890123", "ä", "a/b", "a.b", ".."] {
        assert!(RigFile::parse(&MINIMAL.replace("stage", name)).is_err(), "{name}");
    }
}
