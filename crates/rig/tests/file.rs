//! Rig files that are valid: what they give.
#![allow(clippy::float_cmp, reason = "places are exact")]

use stepdrive_drive::smsd::{Memory, WordOrder};
use stepdrive_rig::file::{ClockMode, DEMO, DriveSection, RigFile};
use stepdrive_spec::smsd::models::Model;
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

#[test]
fn the_demo_rig_is_a_stage_with_two_switches_and_shows_the_defaults() {
    let demo = drive(DEMO);
    assert_eq!((demo.name.get_ref().as_str(), demo.model), ("stage", Model::Smsd42));
    assert_eq!(demo.modbus_tcp.get_ref().to_string(), "127.0.0.1:5020");
    assert_eq!(demo.switches.len(), 2);
    let plain = drive(MINIMAL);
    assert_eq!((demo.word_order, demo.autonomous), (plain.word_order, plain.autonomous));
    assert_eq!(demo.mode_n_programs.is_none(), plain.mode_n_programs.is_none());
    assert_eq!(demo.motor.steps_per_rev.get_ref(), plain.motor.steps_per_rev.get_ref());
}

#[test]
fn everything_but_name_model_and_address_has_a_default() {
    let file = RigFile::parse(MINIMAL).expect("valid");
    assert_eq!(file.rig.clock, ClockMode::Real);
    let drive = drive(MINIMAL);
    assert_eq!((drive.word_order, drive.autonomous), (WordOrder::LowFirst, false));
    assert_eq!(*drive.motor.steps_per_rev.get_ref(), 200);
    assert!(drive.mode_n_programs.is_none() && drive.mechanics.travel.is_none());
    assert!(drive.mechanics.start.is_none() && drive.switches.is_empty());
    let config = drive.config();
    assert_eq!((config.model, config.port, config.autonomous), (Model::Smsd80, 5020, false));
    let machine = drive.power_up(Memory::factory());
    assert_eq!((machine.carriage(Instant::ZERO), machine.next_wake()), (0.0, None));
}

#[test]
fn every_key_is_taken() {
    let lines = "word_order = \"high-first\"\nautonomous = true\nmode_n_programs = 3\n\
        motor.steps_per_rev = 400\nmechanics = { travel = [-10, 20], start = 5 }\n\
        switch = [{ input = \"CONTINUE\", closed = [4, 6] }]\n";
    let drive = drive(&format!("[rig]\nclock = \"real\"\n{MINIMAL}{lines}"));
    let config = drive.config();
    assert_eq!((config.word_order, config.autonomous), (WordOrder::HighFirst, true));
    assert_eq!(*drive.motor.steps_per_rev.get_ref(), 400);
    let machine = drive.power_up(Memory::factory());
    assert_eq!(machine.carriage(Instant::ZERO), 5.0);
    assert_eq!(machine.drive().inputs(), 0x80);
    assert_eq!(machine.drive().memory().mode_n_programs, 3);
}

#[test]
fn without_mode_n_programs_the_controller_keeps_the_one_it_remembers() {
    let mut memory = Memory::factory();
    memory.mode_n_programs = 2;
    assert_eq!(drive(MINIMAL).power_up(memory).drive().memory().mode_n_programs, 2);
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
        assert_eq!(drive(&MINIMAL.replace("stage", name)).name.get_ref(), name);
    }
    for name in ["123456789012345678901234567890123", "ä", "a/b", "a.b", ".."] {
        assert!(RigFile::parse(&MINIMAL.replace("stage", name)).is_err(), "{name}");
    }
}
