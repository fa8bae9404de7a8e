//! Switching off and on again, and the front panel.

use crate::bench::{Bench, MS, PASSWORD, SECOND, config, end, line, plain};
use stepdrive_drive::controller::{Controller, ROTOR_UNITS};
use stepdrive_drive::smsd::{Config, Memory, Record, Session, Smsd};
use stepdrive_motion::Direction;
use stepdrive_spec::modbus::{Request, Table};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

/// Off for a second, and on with the inputs at `levels`; the connection is authorised again.
fn cycle(bench: &mut Bench, levels: u8) {
    bench.drive.switch_off(bench.now);
    bench.run_for(SECOND);
    bench.drive.switch_on(bench.now, levels);
    bench.session = Session::new();
    bench.log_in(bench.drive.memory().password);
}

/// Everything that can be looked at.
fn everything(drive: &Smsd, bench: &Bench) -> Vec<(&'static str, f64)> {
    Smsd::quantities().map(|(name, quantity)| (name, drive.look(bench.now, quantity))).collect()
}

/// A controller in the middle of everything, with something of its own in every part of its memory.
fn busy() -> Bench {
    let mut bench = Bench::new();
    bench.enter(77, 1).expect("authorised");
    bench.write(Reg::Microstepping, 6);
    bench.write(Reg::LanId, 9);
    bench.trigger(Reg::ApplyNetworkConfiguration);
    bench.store(2, &[line(Opcode::MoveF, 5000), plain(Opcode::WaitIn0), end()]);
    for (reg, value) in [
        (Reg::MinSpeed, 3),
        (Reg::MaxSpeed, 900),
        (Reg::Acc, 800),
        (Reg::Dec, 700),
        (Reg::FsSpeed, 600),
        (Reg::TargetSpeed, 500),
        (Reg::TargetPos, -400),
        (Reg::TargetInput, 3),
        (Reg::Mask, 0x7F),
        (Reg::LanId, 20),
        (Reg::NStr, 7),
        (Reg::Relay, 1),
    ] {
        bench.write(reg, value);
    }
    bench.input(Input::Sw, true);
    bench.command(Opcode::StartProgramMem2);
    bench.run_for(500 * MS);
    bench.order(Opcode::MoveR, 1);
    assert!(bench.cmd_error() && bench.program_runs() && bench.speed() > 0 && bench.position() > 0);
    bench
}

#[test]
fn a_power_cycle_is_a_power_up_with_what_was_remembered() {
    let mut bench = busy();
    let memory = bench.drive.memory().clone();
    cycle(&mut bench, 0b1000);
    assert_eq!(bench.drive.memory(), &memory);
    assert_eq!((bench.read(Reg::LanId), bench.drive.unit(), bench.read(Reg::Microstepping)), (9, 9, 6));
    let fresh = Smsd::power_up(bench.now, config(Model::Smsd42), memory, 0b1000);
    assert_eq!(everything(&bench.drive, &bench), everything(&fresh, &bench));
    assert_eq!((bench.drive.rotor(bench.now), bench.drive.next_wake()), (0, None));
    assert!(bench.drive.is_on());
}

#[test]
fn without_supply_the_rotor_stands_and_nothing_answers() {
    let mut bench = busy();
    let rotor = bench.drive.rotor(bench.now);
    assert!(rotor > 0);
    bench.drive.switch_off(bench.now);
    assert!(!bench.drive.is_on());
    assert_eq!((bench.drive.next_wake(), bench.drive.outputs()), (None, 0));
    bench.run_for(100 * SECOND);
    assert_eq!(bench.drive.rotor(bench.now), rotor);
    assert_eq!(bench.drive.when_rotor_reaches(rotor + 1), None);
    assert!(everything(&bench.drive, &bench).iter().all(|(_, value)| value.to_bits() == 0));
}

#[test]
fn what_was_not_stored_yet_is_still_named_after_the_supply_has_gone() {
    let mut bench = busy();
    while bench.drive.take_unsaved().is_some() {}
    let generation = bench.drive.memory_generation();
    bench.trigger(Reg::HardHiZ);
    bench.write(Reg::WorkCurrent, 20);
    cycle(&mut bench, 0);
    assert_eq!(bench.drive.memory_generation(), generation + 1);
    assert_eq!(bench.drive.take_unsaved(), Some(Record::Motor));
    assert_eq!(bench.read(Reg::WorkCurrent), 20);
}

#[test]
fn a_procedure_that_the_supply_left_unfinished_has_stored_nothing() {
    let mut bench = busy();
    bench.command(Opcode::StopProgramMem);
    bench.write(Reg::NProg, 2);
    bench.write(Reg::BComplete, 0);
    bench.write(Reg::MemCmd, 2);
    cycle(&mut bench, 0);
    bench.run_for(SECOND);
    assert_eq!((bench.drive.memory().area(2).size(), bench.read(Reg::BComplete)), (3, 0));
}

#[test]
fn a_failed_attempt_is_forgotten_with_the_supply() {
    let mut bench = Bench::locked(config(Model::Smsd42), Memory::factory(), 0);
    assert!(!bench.log_in(1));
    assert!(!bench.log_in(PASSWORD), "locked out");
    bench.drive.switch_off(bench.now);
    bench.drive.switch_on(bench.now, 0);
    assert!(bench.log_in(PASSWORD));
}

#[test]
fn the_rotor_counts_from_0_again_and_goes_as_far() {
    let mut bench = Bench::new();
    for _ in 0..3 {
        bench.order(Opcode::MoveR, 160);
        bench.run_until_ready();
        assert_eq!((bench.position(), bench.drive.rotor(bench.now)), (-160, -10 * ROTOR_UNITS));
        assert_eq!(bench.drive.direction(), Direction::Reverse);
        cycle(&mut bench, 0);
        assert_eq!((bench.position(), bench.drive.rotor(bench.now)), (0, 0));
        assert_eq!(bench.drive.direction(), Direction::Forward);
    }
}

#[test]
fn in_autonomous_mode_every_switching_on_starts_the_program() {
    let mut memory = Memory::factory();
    memory.load_program(1, &[line(Opcode::MoveF, 16).word(), end().word()]);
    memory.mode_n_programs = 1;
    let config = Config { autonomous: true, ..config(Model::Smsd42) };
    let mut bench = Bench::with(config, memory, 0);
    for _ in 0..3 {
        bench.run_until_ended();
        assert_eq!((bench.position(), bench.place(), bench.drive.program().executed), (16, (1, 1), 2));
        cycle(&mut bench, 0);
    }
}

#[test]
fn the_mode_at_the_front_panel_counts_from_the_next_power_up_on() {
    let mut bench = Bench::new();
    bench.store(3, &[line(Opcode::SetWait, 1000), end()]);
    bench.drive.set_panel(true, Some(3));
    assert!(bench.drive.autonomous());
    bench.run_for(SECOND);
    assert!(!bench.program_runs());
    cycle(&mut bench, 0);
    assert!(bench.program_runs());
    bench.drive.set_panel(false, None);
    bench.settle();
    assert!(bench.program_runs() && !bench.drive.autonomous());
    assert_eq!(bench.place(), (3, 0));
    cycle(&mut bench, 0);
    assert!(!bench.program_runs());
    assert_eq!(bench.read(Reg::ModeNPrograms), 3);
}

#[test]
fn the_program_number_at_the_front_panel_is_remembered() {
    let mut bench = Bench::new();
    let generation = bench.drive.memory_generation();
    bench.drive.set_panel(false, Some(0));
    bench.drive.set_panel(false, None);
    for none in [4, 255] {
        bench.drive.set_panel(false, Some(none));
    }
    assert_eq!((bench.drive.memory_generation(), bench.read(Reg::ModeNPrograms)), (generation, 0));
    bench.drive.set_panel(false, Some(2));
    assert_eq!(bench.drive.take_unsaved(), Some(Record::ModeNPrograms));
    assert_eq!((bench.drive.memory_generation(), bench.read(Reg::ModeNPrograms)), (generation + 1, 2));
}

#[test]
fn the_relay_is_the_output() {
    let mut bench = Bench::new();
    assert_eq!(Smsd::OUTPUTS, ["relay"]);
    assert_eq!(bench.drive.outputs(), 0);
    bench.write(Reg::Relay, 1);
    assert_eq!(bench.drive.outputs(), 1);
}

#[test]
fn the_records_are_the_memory_and_nothing_else() {
    let records = |drive: &Smsd| {
        let mut records = Vec::new();
        drive.for_each_record(&mut |record| records.push(record.to_vec()));
        records
    };
    let mut bench = busy();
    let before = records(&bench.drive);
    let memory = bench.drive.memory();
    let encoded = Record::ALL.map(|record| memory.encode(record).to_vec());
    assert_eq!(before, encoded);
    let relay = Reg::Relay.info();
    assert_eq!(relay.table, Table::Coils);
    bench.request(&Request::WriteCoil { address: relay.address, value: false }).expect("writable");
    cycle(&mut bench, 0xFF);
    assert_eq!(records(&bench.drive), before);
    bench.drive.set_panel(false, Some(3));
    assert_ne!(records(&bench.drive), before);
}
