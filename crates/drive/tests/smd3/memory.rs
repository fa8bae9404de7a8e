//! `STORE`, `LOAD`, `LOADFD`, and the stored configuration as bytes.

use crate::bench::{Bench, assert_near};
use stepdrive_drive::smd3::{Config, DamagedSettings, Settings, Stored};
use stepdrive_spec::smd3::commands::{COMMANDS, Command};

/// A drive in which every stored setting differs from the factory's.
fn changed() -> Bench {
    let mut bench = Bench::new();
    for (mnemonic, value) in [
        ("JSMODE", "1"),
        ("AUTOJS", "0"),
        ("EXTEN", "1"),
        ("TSEL", "1"),
        ("IR", "0.5"),
        ("IA", "0.75"),
        ("IH", "0.25"),
        ("PDDEL", "1000"),
        ("IHD", "200"),
        ("F", "2"),
        ("RES", "64"),
        ("L", "1"),
        ("L+", "0"),
        ("L-", "0"),
        ("LP+", "1"),
        ("LP-", "1"),
        ("LSM", "1"),
        ("AMAX", "333"),
        ("DMAX", "444"),
        ("VSTOP", "55"),
        ("VSTART", "44"),
        ("VMAX", "555"),
        ("TZW", "0.5"),
        ("THIGH", "800"),
        ("EDGE", "1"),
        ("INTERP", "1"),
        ("BAKET", "120"),
        ("MODE", "5"),
    ] {
        bench.set(mnemonic, value);
    }
    bench
}

fn stored(bench: &Bench) -> Settings {
    let Stored::Intact(settings) = bench.drive.stored() else { panic!("nothing is stored") };
    *settings
}

#[test]
fn the_changed_drive_of_these_tests_differs_in_every_setting() {
    let bench = changed();
    for row in COMMANDS.iter().filter(|row| row.stored) {
        let (now, factory) = (bench.drive.settings().get(row.command), Settings::factory().get(row.command));
        assert!((now - factory).abs() > 1e-3, "{}", row.mnemonic);
    }
}

#[test]
fn what_was_stored_is_there_after_power_up() {
    let mut bench = changed();
    bench.set("PACT", 5);
    assert_eq!(bench.drive.memory_generation(), 0);
    bench.order("STORE", "");
    assert_eq!(bench.drive.memory_generation(), 1);
    bench.order("STORE", "");
    assert_eq!(bench.drive.memory_generation(), 2);
    let settings = Settings::decode(&stored(&bench).encode()).expect("intact");
    assert_eq!(&settings, bench.drive.settings());
    let mut again = Bench::with(Config::default(), &Stored::Intact(settings), 0);
    assert_eq!(again.drive.settings(), bench.drive.settings());
    assert_near(again.get("PACT"), 0.0, 0.0);
}

#[test]
fn load_brings_back_what_was_stored_and_loadfd_the_factorys() {
    let mut bench = changed();
    bench.order("STORE", "");
    bench.set("IDENT", 1);
    bench.order("LOADFD", "");
    for row in COMMANDS.iter().filter(|row| row.stored) {
        assert_near(bench.drive.settings().get(row.command), Settings::factory().get(row.command), 0.0);
    }
    assert_near(bench.get("IDENT"), 1.0, 0.0);
    bench.order("LOAD", "");
    for row in COMMANDS.iter().filter(|row| row.stored) {
        assert_near(bench.drive.settings().get(row.command), stored(&bench).get(row.command), 0.0);
    }
    assert_near(bench.get("IDENT"), 1.0, 0.0);
}

#[test]
fn load_with_nothing_stored_is_the_factorys_and_with_a_damaged_store_fails() {
    let mut bench = changed();
    bench.order("LOAD", "");
    assert_eq!(bench.drive.settings(), &Settings::factory());
    let mut bench = Bench::with(Config::default(), &Stored::Damaged, 0);
    bench.set("BAKET", 99);
    bench.refused("LOAD", "", -5);
    assert_near(bench.get("BAKET"), 99.0, 0.0);
    bench.order("STORE", "");
    bench.order("LOADFD", "");
    bench.order("LOAD", "");
    assert_near(bench.get("BAKET"), 99.0, 0.0);
}

#[test]
fn what_is_loaded_acts_at_once() {
    let mut bench = Bench::new();
    bench.set("EXTEN", 1);
    bench.order("STORE", "");
    bench.set("EXTEN", 0);
    bench.order("CLR", "");
    bench.order("LOAD", "");
    assert_eq!(bench.flags(), "STANDBY, EXTERNAL DISABLE");
}

#[test]
fn the_layout_is_a_version_a_count_the_values_and_a_checksum() {
    let bytes = Settings::factory().encode();
    let rows = COMMANDS.iter().filter(|row| row.stored).count();
    assert_eq!(bytes.len(), 2 + 8 * rows + 4);
    assert_eq!(bytes[..2], [1, u8::try_from(rows).expect("few")]);
    assert_eq!(bytes[2..10], 2.0_f64.to_le_bytes(), "MODE comes first");
    assert_eq!(Settings::decode(&bytes), Ok(Settings::factory()));
}

#[test]
fn every_flipped_bit_and_every_cut_is_noticed() {
    let bytes = Settings::factory().encode();
    for bit in 0..bytes.len() * 8 {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(Settings::decode(&damaged), Err(DamagedSettings), "bit {bit}");
    }
    for end in 0..bytes.len() {
        assert_eq!(Settings::decode(&bytes[..end]), Err(DamagedSettings), "cut at {end}");
    }
    let mut longer = bytes.to_vec();
    longer.push(0);
    assert_eq!(Settings::decode(&longer), Err(DamagedSettings));
    assert_eq!(DamagedSettings.to_string(), "the stored configuration is damaged");
}

/// The bytes of settings with one value replaced and the checksum right.
fn forged(command: Command, value: f64) -> Vec<u8> {
    let row =
        COMMANDS.iter().filter(|row| row.stored).position(|row| row.command == command).expect("stored");
    let mut bytes = Settings::factory().encode().to_vec();
    bytes.truncate(bytes.len() - 4);
    bytes[2 + 8 * row..10 + 8 * row].copy_from_slice(&value.to_le_bytes());
    let mut crc = u32::MAX;
    for byte in &bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
        }
    }
    bytes.extend((!crc).to_le_bytes());
    bytes
}

#[test]
fn values_that_the_drive_would_not_have_are_damage() {
    assert_eq!(Settings::decode(&forged(Command::Baket, 150.0)), Ok(Settings::factory()));
    for (command, value) in [
        (Command::Mode, 6.0),
        (Command::Mode, 1.5),
        (Command::Autojs, 0.5),
        (Command::Autojs, f64::NAN),
        (Command::Vmax, 1000.0),
        (Command::Vmax, -1.0),
        (Command::Vmax, f64::INFINITY),
        (Command::Vstart, 0.0),
        (Command::Ir, 2.0),
        (Command::Ir, 0.01),
        (Command::Res, 100.0),
        (Command::Thigh, 0.0),
        (Command::L, -0.0),
        (Command::Vstop, 12_000_000.0 / 16_777_216.0 / 256.0),
        (Command::Baket, 201.0),
        (Command::Tzw, -1.0),
    ] {
        assert_eq!(Settings::decode(&forged(command, value)), Err(DamagedSettings), "{command} {value}");
    }
}

#[test]
fn a_setting_at_every_end_of_its_range_is_stored_and_read_back() {
    for res in [8, 256] {
        let mut bench = Bench::new();
        bench.set("RES", res);
        for (mnemonic, value) in [
            ("VMAX", "15000"),
            ("VSTOP", "700"),
            ("VSTART", "1e-9"),
            ("TZW", "2.79616"),
            ("THIGH", "46875"),
            ("PDDEL", "5570.56"),
            ("IHD", "327.68"),
            ("AMAX", "1"),
            ("IR", "1"),
            ("IH", "0"),
        ] {
            bench.set(mnemonic, value);
        }
        let settings = *bench.drive.settings();
        assert_eq!(Settings::decode(&settings.encode()), Ok(settings));
    }
}
