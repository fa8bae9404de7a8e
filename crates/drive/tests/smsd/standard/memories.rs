//! Programs written and read.

use super::{Port, words};
use crate::bench::{Bench, MS, end, line, plain};
use core::time::Duration;
use stepdrive_drive::smsd::{Config, Record};
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, Request, VERSION_1, Words};

fn moving() -> [Instruction; 3] {
    [line(Opcode::SetMaxSpeed, 500), line(Opcode::MoveF, 320), plain(Opcode::SetRele)]
}

/// What a procedure of `MEM_CMD` reads from the first lines of an area.
fn lines_by_modbus(bench: &mut Bench, area: i64, count: u16) -> Vec<u32> {
    bench.write(Reg::NProg, area);
    bench.write(Reg::NStr, 0);
    bench.write(Reg::SectorSize, count.into());
    bench.procedure(0);
    (0..count).map(|index| u32::try_from(bench.read_nth(Reg::CmdBuffer, index)).expect("32 bits")).collect()
}

fn size_by_modbus(bench: &mut Bench, area: i64) -> i64 {
    bench.write(Reg::NProg, area);
    bench.procedure(3);
    bench.read(Reg::ProgSize)
}

#[test]
fn a_program_written_here_is_read_and_run_by_modbus() {
    for area in 0..4_u8 {
        let mut port = Port::new();
        assert_eq!(port.write_memory(area, &moving()), Code::Ok);
        assert_eq!(port.bench.drive.take_unsaved(), Some(Record::Program(area)));
        assert_eq!(port.bench.drive.take_unsaved(), None);
        assert_eq!(size_by_modbus(&mut port.bench, area.into()), 3);
        assert_eq!(lines_by_modbus(&mut port.bench, area.into(), 3), words(&moving()).to_vec());
        port.bench.command(Opcode::from_code(0x2F + u16::from(area)).expect("START_PROGRAM"));
        port.bench.run_until_ended();
        assert_eq!((port.bench.position(), port.bench.read(Reg::MaxSpeed)), (320, 500));
        assert!(port.bench.drive.relay());
    }
}

#[test]
fn a_program_written_by_modbus_is_read_and_run_here() {
    let mut port = Port::new();
    port.bench.store(2, &moving());
    assert_eq!(port.read_memory(2), words(&moving()).to_vec());
    port.order(Opcode::StartProgramMem2, 0);
    port.bench.run_until_ended();
    assert_eq!(port.bench.position(), 320);
}

#[test]
fn as_many_instructions_are_read_as_the_program_has() {
    let mut port = Port::new();
    assert_eq!(port.read_memory(3), []);
    for count in [1, 254, 255] {
        let program: Vec<Instruction> = (0..count).map(|at| line(Opcode::SetWait, at)).collect();
        assert_eq!(port.write_memory(3, &program), Code::Ok);
        assert_eq!(port.read_memory(3), words(&program).to_vec());
    }
    port.bench.write(Reg::NProg, 3);
    port.bench.write(Reg::ProgSize, 2);
    port.bench.procedure(4);
    assert_eq!(port.read_memory(3).len(), 2);
}

#[test]
fn a_shorter_program_leaves_nothing_of_the_longer_one() {
    let mut port = Port::new();
    port.write_memory(0, &[plain(Opcode::SetRele); 9]);
    port.write_memory(0, &[plain(Opcode::ClrRele); 2]);
    let clear = plain(Opcode::ClrRele).word();
    assert_eq!(lines_by_modbus(&mut port.bench, 0, 4), [clear, clear, 0, 0]);
}

#[test]
fn no_instructions_empty_the_area() {
    let mut port = Port::new();
    port.write_memory(1, &moving());
    assert_eq!(port.write_memory(1, &[]), Code::Ok);
    assert_eq!(port.read_memory(1), []);
    assert_eq!(size_by_modbus(&mut port.bench, 1), 0);
    assert_eq!(lines_by_modbus(&mut port.bench, 1, 3), [0, 0, 0]);
}

#[test]
fn a_word_that_is_no_instruction_stores_nothing() {
    let mut port = Port::new();
    port.write_memory(0, &moving());
    for (wrong, code) in [(0x3F0, Code::ErrorNoCommand), (0x241, Code::ErrorRange), (0x248, Code::ErrorRange)]
    {
        let mut written = words(&moving());
        written.push(wrong);
        port.assert_refused(&Request::WriteMemory { area: 0, words: written }, code);
    }
    assert_eq!(port.read_memory(0), words(&moving()).to_vec());
}

#[test]
fn instructions_of_version_2_are_none_for_version_1() {
    let mut port = Port::with(Config { protocol_version: VERSION_1, ..crate::bench::config(Model::Smsd42) });
    for code in 0x3A..=0x3E {
        let written: Words = [0x240, code << 4].into_iter().collect();
        port.assert_refused(&Request::WriteMemory { area: 0, words: written }, Code::ErrorNoCommand);
    }
    assert_eq!(port.write_memory(0, &[line(Opcode::GotoProgramIfZero, 0)]), Code::Ok);
}

#[test]
fn the_area_that_is_executing_cannot_be_written_and_others_can() {
    let mut port = Port::new();
    port.bench.store(1, &[line(Opcode::SetWait, 50), end()]);
    port.order(Opcode::StartProgramMem1, 0);
    port.bench.settle();
    port.assert_refused(&Request::WriteMemory { area: 1, words: Words::new() }, Code::ErrorWrite);
    assert_eq!(port.write_memory(0, &moving()), Code::Ok);
    assert_eq!(port.read_memory(1).len(), 2);
    port.bench.run_until_ended();
    assert_eq!(port.write_memory(1, &moving()), Code::Ok);
}

#[test]
fn while_a_procedure_of_mem_cmd_works_nothing_is_written_and_reading_goes() {
    let mut port = Port::new();
    port.write_memory(0, &moving());
    port.bench.write(Reg::NProg, 3);
    port.bench.write(Reg::MemCmd, 2);
    port.assert_refused(&Request::WriteMemory { area: 1, words: words(&moving()) }, Code::ErrorWrite);
    assert_eq!(port.read_memory(0).len(), 3);
    port.bench.run_for(2 * MS);
    assert_eq!(port.write_memory(1, &moving()), Code::Ok);
}

#[test]
fn a_write_here_takes_no_time_and_leaves_mem_cmd_free() {
    let mut port = Port::new();
    port.write_memory(1, &moving());
    assert_eq!(port.bench.drive.next_wake(), None);
    assert_eq!(port.bench.read(Reg::BComplete), 0);
    assert_eq!(port.bench.try_write(Reg::MemCmd, 2), Ok::<(), Exception>(()));
    port.bench.run_for(Duration::from_millis(2));
    assert_eq!(port.bench.read(Reg::BComplete), 1);
}
