//! The names by which one speaks of a rig.

use stepdrive_rig::file::RigFile;
use stepdrive_rig::names::{AnyQuantity, AnySignal, split};
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::smsd::inputs::Input;

/// Drives with these names, each an SMSD, and an SMD3 named `uhv`.
fn rig(names: &[&str]) -> RigFile {
    let smsd = |name: &&str| {
        format!("[[drive]]\nname = \"{name}\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n")
    };
    let smsds: String = names.iter().map(smsd).collect();
    let text = smsds + "[[drive]]\nname = \"uhv\"\nmodel = \"SMD3\"\nserial = \"pty\"\n";
    RigFile::parse(&text).unwrap_or_else(|error| panic!("{}", error.render("rig.toml")))
}

#[test]
fn a_text_is_split_at_its_first_dot() {
    assert_eq!(split("stage.IN0"), Ok(("stage", "IN0")));
    assert_eq!(split("a.b.c"), Ok(("a", "b.c")));
    for text in ["", ".", "stage", "stage.", ".IN0"] {
        assert!(split(text).is_err(), "{text}");
    }
    assert_eq!(
        split("stage").expect_err("no dot").to_string(),
        "`stage` is not a drive and a part of it, as in stage.IN0"
    );
}

#[test]
fn a_drive_is_found_in_any_case_unless_two_are_alike() {
    let rig = rig(&["stage", "Table", "table"]);
    assert_eq!(rig.find_drive("STAGE"), Ok(0));
    assert_eq!((rig.find_drive("Table"), rig.find_drive("table")), (Ok(1), Ok(2)));
    assert_eq!(
        rig.find_drive("TABLE").expect_err("either").to_string(),
        "unknown drive `TABLE`; there are stage, Table, table, uhv"
    );
}

#[test]
fn of_many_drives_the_nearest_is_named() {
    let names: Vec<String> = (0..50).map(|number| format!("axis-{number}")).collect();
    let rig = rig(&names.iter().map(String::as_str).collect::<Vec<_>>());
    let message = |name: &str| rig.find_drive(name).expect_err(name).to_string();
    assert_eq!(message("axs-17"), "unknown drive `axs-17`; did you mean axis-17?");
    assert!(message("spindle").ends_with("axis-39 and 11 more"));
}

#[test]
fn every_input_is_found_in_any_case() {
    let rig = rig(&["stage"]);
    for input in Input::ALL {
        assert_eq!(rig.find_input(0, input.name()), Ok(AnySignal::Smsd(input)));
        assert_eq!(rig.find_input(0, &input.name().to_lowercase()), Ok(AnySignal::Smsd(input)));
    }
    for signal in Signal::ALL {
        assert_eq!(rig.find_input(1, signal.name()), Ok(AnySignal::Smd3(signal)));
        assert_eq!(AnySignal::Smd3(signal).to_string(), signal.name());
    }
    assert_eq!(rig.drives[0].inputs().len() + rig.drives[1].inputs().len(), 8 + 9);
}

#[test]
fn every_output_is_found_and_has_its_name() {
    let rig = rig(&["stage"]);
    assert_eq!(rig.find_output(0, "Relay"), Ok(0));
    assert_eq!((rig.output_name(0, 0), rig.output_name(0, 1), rig.output_name(1, 0)), ("relay", "", ""));
}

#[test]
fn every_quantity_is_found_by_what_it_displays_as_and_has_a_name_of_its_own() {
    let rig = rig(&["stage"]);
    for (drive, section) in rig.drives.iter().enumerate() {
        let mut seen = Vec::new();
        for quantity in section.quantities() {
            let written = quantity.to_string();
            assert_eq!(rig.find_quantity(drive, &written), Ok(quantity), "{written}");
            assert_eq!(rig.find_quantity(drive, &written.to_lowercase()), Ok(quantity), "{written}");
            assert_eq!(rig.find_quantity(drive, quantity.name()), Ok(quantity), "{written}");
            assert!(!seen.contains(&written), "{written}");
            seen.push(written);
        }
    }
}

#[test]
fn what_hangs_on_a_controller_has_quantities_of_its_own() {
    let rig = rig(&["stage"]);
    for drive in 0..2 {
        assert_eq!(rig.find_quantity(drive, "carriage"), Ok(AnyQuantity::Carriage));
        assert_eq!(rig.find_quantity(drive, "Stalled"), Ok(AnyQuantity::Stalled));
        assert_eq!(rig.find_quantity(drive, "POWERED"), Ok(AnyQuantity::Powered));
    }
    assert!(AnyQuantity::Carriage.flows() && AnyQuantity::Stalled.flows() && !AnyQuantity::Powered.flows());
}

#[test]
fn a_drive_that_there_is_not_has_no_parts() {
    let rig = rig(&[]);
    assert_eq!(rig.find_input(1, "IN0").expect_err("none").to_string(), "the rig has no drive number 1");
    assert!(rig.find_output(usize::MAX, "relay").is_err() && rig.find_quantity(1, "carriage").is_err());
}

#[test]
fn names_of_any_length_are_refused_in_a_short_message() {
    let rig = rig(&["stage"]);
    let long = "ä".repeat(1_000_000);
    for message in [
        rig.find_drive(&long).expect_err("none").message,
        rig.find_input(0, &long).expect_err("none").message,
        rig.find_output(0, &long).expect_err("none").message,
        rig.find_quantity(0, &long).expect_err("none").message,
        split(&long).expect_err("no dot").message,
    ] {
        assert!(message.len() < 800, "{message}");
    }
}
