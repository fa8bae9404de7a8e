//! The flash, worn out or damaged.

use crate::bench::{Bench, SECOND, assert_near};
use stepdrive_drive::smd3::Stored;

fn cycle(bench: &mut Bench) {
    bench.drive.switch_off(bench.now);
    bench.run_for(SECOND);
    bench.drive.switch_on(bench.now, 0);
}

/// A drive that has stored a `VMAX` of 700 Hz, and is set to 300 Hz.
fn stored() -> Bench {
    let mut bench = Bench::new();
    bench.set("VMAX", 700);
    bench.order("STORE", "");
    bench.set("VMAX", 300);
    bench
}

fn assert_vmax(bench: &mut Bench, expected: f64) {
    assert_near(bench.get("VMAX"), expected, 0.01);
}

#[test]
fn a_worn_flash_stores_nothing_and_still_reads() {
    let mut bench = stored();
    let (held, generation) = (*bench.drive.stored(), bench.drive.memory_generation());
    bench.drive.wear_flash(true);
    bench.refused("STORE", "", -5);
    assert_eq!((*bench.drive.stored(), bench.drive.memory_generation()), (held, generation));
    assert_vmax(&mut bench, 300.0);
    bench.order("LOAD", "");
    assert_vmax(&mut bench, 700.0);
    cycle(&mut bench);
    assert_eq!(bench.flags(), "STANDBY");
    bench.refused("STORE", "", -5);
    bench.drive.wear_flash(false);
    bench.set("VMAX", 500);
    bench.order("STORE", "");
    assert_eq!(bench.drive.memory_generation(), generation + 1);
    cycle(&mut bench);
    assert_vmax(&mut bench, 500.0);
}

#[test]
fn a_damaged_store_fails_to_load_and_comes_up_with_the_factorys_settings() {
    let mut bench = stored();
    bench.drive.damage_store(true);
    assert_eq!(bench.flags(), "STANDBY", "nobody has looked yet");
    bench.refused("LOAD", "", -5);
    assert_vmax(&mut bench, 300.0);
    bench.order("LOADFD", "");
    assert_vmax(&mut bench, 1000.0);
    bench.set("VMAX", 300);
    cycle(&mut bench);
    assert_eq!(bench.flags(), "STANDBY, CONFIGURATION ERROR");
    assert_vmax(&mut bench, 1000.0);
    bench.refused("RUNV", "+", -7);
    bench.order("CLR", "");
    bench.order("RUNV", "+");
}

#[test]
fn what_was_stored_is_back_when_the_damage_ends() {
    let mut bench = stored();
    bench.drive.damage_store(true);
    cycle(&mut bench);
    bench.drive.damage_store(false);
    assert!(!bench.drive.store_damaged());
    bench.order("LOAD", "");
    assert_vmax(&mut bench, 700.0);
    cycle(&mut bench);
    assert_eq!(bench.flags(), "STANDBY");
    assert_vmax(&mut bench, 700.0);
}

#[test]
fn an_empty_flash_can_be_damaged_as_well() {
    let mut bench = Bench::new();
    bench.drive.damage_store(true);
    bench.refused("LOAD", "", -5);
    cycle(&mut bench);
    assert_eq!(bench.flags(), "STANDBY, CONFIGURATION ERROR");
    bench.drive.damage_store(false);
    cycle(&mut bench);
    assert_eq!(bench.flags(), "STANDBY");
}

#[test]
fn store_writes_over_the_damage() {
    let mut bench = stored();
    bench.drive.damage_store(true);
    bench.order("STORE", "");
    assert!(!bench.drive.store_damaged());
    bench.order("LOAD", "");
    cycle(&mut bench);
    assert_eq!(bench.flags(), "STANDBY");
    assert_vmax(&mut bench, 300.0);
}

#[test]
fn a_store_that_could_not_be_written_leaves_the_damage() {
    let mut bench = stored();
    let before = *bench.drive.stored();
    bench.drive.damage_store(true);
    bench.order("STORE", "");
    bench.drive.undo_store(before);
    assert!(bench.drive.store_damaged());
    bench.refused("LOAD", "", -5);
    bench.drive.damage_store(false);
    bench.order("LOAD", "");
    assert_vmax(&mut bench, 700.0);
    bench.order("STORE", "");
    bench.drive.undo_store(before);
    assert!(!bench.drive.store_damaged(), "there was none to leave");
}

#[test]
fn a_worn_flash_keeps_its_damage() {
    let mut bench = stored();
    bench.drive.damage_store(true);
    bench.drive.wear_flash(true);
    bench.refused("STORE", "", -5);
    bench.refused("LOAD", "", -5);
    bench.drive.damage_store(false);
    bench.order("LOAD", "");
    assert_vmax(&mut bench, 700.0);
}

#[test]
fn a_store_that_was_damaged_from_the_start_stays_so_until_it_is_written() {
    let mut bench = Bench::with(stepdrive_drive::smd3::Config::default(), &Stored::Damaged, 0);
    bench.drive.damage_store(true);
    bench.drive.damage_store(false);
    assert!(bench.drive.store_damaged());
    cycle(&mut bench);
    assert_eq!(bench.flags(), "STANDBY, CONFIGURATION ERROR");
    bench.order("STORE", "");
    assert!(!bench.drive.store_damaged());
    cycle(&mut bench);
    assert_eq!(bench.flags(), "STANDBY");
}
