//! Storing and reading programs: the procedures of `MEM_CMD`.

use crate::bench::{Bench, MS, config, count, end, just_before, line, plain};
use core::time::Duration;
use stepdrive_drive::smsd::{Memory, Record};
use stepdrive_spec::modbus::{Exception, Table};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

const VALUE: Exception = Exception::IllegalDataValue;
const BUSY: Exception = Exception::ServerDeviceBusy;
const READ: i64 = 0;
const WRITE: i64 = 1;
const ERASE: i64 = 2;
const READ_SIZE: i64 = 3;
const WRITE_SIZE: i64 = 4;

/// A program whose lines are all different.
fn lines(count: i32) -> Vec<Instruction> {
    (0..count).map(|number| line(Opcode::GoTo, number - 100)).collect()
}

fn words(program: &[Instruction]) -> Vec<u32> {
    program.iter().map(|line| line.word()).collect()
}

/// Reads a program as ch. 5 says.
fn read_program(bench: &mut Bench, area: i64) -> Vec<u32> {
    bench.write(Reg::NProg, area);
    bench.procedure(READ_SIZE);
    let size = bench.read(Reg::ProgSize);
    let mut program = Vec::new();
    for first in (0..size).step_by(32) {
        let count = (size - first).min(32);
        bench.write(Reg::NStr, first);
        bench.write(Reg::SectorSize, count);
        bench.procedure(READ);
        let buffer = (0..u16::try_from(count).expect("at most 32"))
            .map(|nth| u32::try_from(bench.read_nth(Reg::CmdBuffer, nth)).expect("32 bits"));
        program.extend(buffer);
    }
    program
}

/// Sets the registers of the procedures.
fn set(bench: &mut Bench, area: i64, first: i64, count: i64, size: i64) {
    bench.write(Reg::NProg, area);
    bench.write(Reg::NStr, first);
    bench.write(Reg::SectorSize, count);
    bench.write(Reg::ProgSize, size);
}

#[test]
fn a_program_of_any_length_is_stored_and_read_back_in_each_area() {
    for (area, length) in [(0, 1), (1, 32), (2, 33), (3, 255), (0, 100)] {
        let mut bench = Bench::new();
        let program = lines(length);
        bench.store(area, &program);
        assert_eq!(read_program(&mut bench, area.into()), words(&program));
        for other in (0..4).filter(|other| *other != area) {
            assert_eq!(read_program(&mut bench, other.into()), []);
        }
    }
}

#[test]
fn the_worked_example_is_stored_as_printed() {
    let mut bench = Bench::new();
    bench.write_at(0x3100, &[0x9060, 0x0001]).expect("a buffer");
    set(&mut bench, 0, 0, 1, 1);
    bench.procedure(WRITE);
    assert_eq!(bench.drive.memory().area(0).words()[0], 0x0001_9060);
}

#[test]
fn each_procedure_takes_the_time_of_the_fram_and_then_sets_b_complete() {
    for code in READ..=WRITE_SIZE {
        let mut bench = Bench::new();
        set(&mut bench, 1, 0, 32, 5);
        bench.write(Reg::MemCmd, code);
        assert_eq!((bench.read(Reg::BComplete), bench.read(Reg::MemCmd)), (0, code));
        bench.run_for(just_before(2 * MS));
        assert_eq!(bench.read(Reg::BComplete), 0);
        bench.run_for(Duration::from_nanos(1));
        assert_eq!(bench.read(Reg::BComplete), 1);
        assert_eq!(bench.drive.next_wake(), None);
    }
}

#[test]
fn nothing_shows_before_a_procedure_has_ended() {
    let mut bench = Bench::new();
    bench.write_at(0x3100, &[0x9060, 0x0001]).expect("a buffer");
    set(&mut bench, 0, 7, 1, 1);
    bench.write(Reg::MemCmd, WRITE);
    assert_eq!(bench.drive.memory(), &Memory::factory());
    assert_eq!((bench.drive.memory_generation(), bench.drive.take_unsaved()), (0, None));
    bench.run_for(2 * MS);
    assert_eq!(bench.drive.memory().area(0).words()[7], 0x0001_9060);
    assert_eq!((bench.drive.memory_generation(), bench.drive.take_unsaved()), (1, Some(Record::Program(0))));
}

#[test]
fn a_procedure_works_on_what_the_registers_held_when_it_was_started() {
    let mut bench = Bench::new();
    bench.write_at(0x3100, &[0x9060, 0x0001]).expect("a buffer");
    set(&mut bench, 0, 7, 1, 1);
    bench.write(Reg::MemCmd, WRITE);
    bench.write_at(0x3100, &[0xFFFF, 0xFFFF]).expect("a buffer");
    set(&mut bench, 3, 9, 32, 200);
    bench.run_for(2 * MS);
    assert_eq!(bench.drive.memory().area(0).words()[7], 0x0001_9060);
    assert_eq!(bench.drive.memory().area(3), Memory::factory().area(3));
}

#[test]
fn only_the_host_clears_b_complete_and_only_the_controller_sets_it() {
    let mut bench = Bench::new();
    bench.write(Reg::BComplete, 1);
    assert_eq!(bench.read(Reg::BComplete), 0);
    bench.procedure(ERASE);
    bench.write(Reg::BComplete, 1);
    assert_eq!(bench.read(Reg::BComplete), 1);
    bench.write(Reg::BComplete, 0);
    assert_eq!(bench.read(Reg::BComplete), 0);
}

#[test]
fn the_flag_of_an_earlier_procedure_stays_until_it_is_cleared() {
    let mut bench = Bench::new();
    bench.procedure(ERASE);
    bench.write(Reg::MemCmd, ERASE);
    assert_eq!(bench.read(Reg::BComplete), 1);
}

#[test]
fn erasing_fills_the_area_with_end_and_sets_its_size_to_zero() {
    let mut bench = Bench::new();
    bench.store(2, &lines(255));
    bench.procedure(ERASE);
    assert_eq!(bench.drive.memory().area(2).words(), &[0; 255]);
    assert_eq!(read_program(&mut bench, 2), []);
    bench.write(Reg::ProgSize, 255);
    bench.procedure(WRITE_SIZE);
    assert_eq!(read_program(&mut bench, 2), vec![0; 255]);
}

#[test]
fn size_and_content_are_separate() {
    let mut bench = Bench::new();
    bench.store(0, &lines(10));
    bench.write(Reg::ProgSize, 4);
    bench.procedure(WRITE_SIZE);
    assert_eq!(read_program(&mut bench, 0), words(&lines(4)));
    bench.write(Reg::ProgSize, 10);
    bench.procedure(WRITE_SIZE);
    assert_eq!(read_program(&mut bench, 0), words(&lines(10)));
}

#[test]
fn a_program_written_without_its_size_ends_at_once() {
    let mut bench = Bench::new();
    bench.procedure(ERASE);
    bench.write_at(0x3100, &[0x9060, 0x0001]).expect("a buffer");
    set(&mut bench, 0, 0, 1, 1);
    bench.procedure(WRITE);
    bench.command(Opcode::StartProgramMem0);
    bench.settle();
    assert!(!bench.program_runs());
    assert_eq!(bench.read(Reg::MaxSpeed), 1000);
}

#[test]
fn reading_beyond_the_size_gives_the_content() {
    let mut bench = Bench::new();
    bench.store(0, &lines(40));
    bench.write(Reg::ProgSize, 0);
    bench.procedure(WRITE_SIZE);
    set(&mut bench, 0, 32, 8, 0);
    bench.procedure(READ);
    let read: Vec<i64> = (0..8).map(|nth| bench.read_nth(Reg::CmdBuffer, nth)).collect();
    let expected: Vec<i64> = words(&lines(40))[32..].iter().map(|word| i64::from(*word)).collect();
    assert_eq!(read, expected);
}

#[test]
fn reading_a_few_lines_leaves_the_rest_of_the_buffer() {
    let mut bench = Bench::new();
    bench.store(0, &lines(2));
    bench.write_at(0x3100, &[0xAAAA; 64]).expect("a buffer");
    set(&mut bench, 0, 0, 2, 0);
    bench.procedure(READ);
    assert_eq!(bench.read_nth(Reg::CmdBuffer, 1), i64::from(lines(2)[1].word()));
    assert_eq!(bench.read_nth(Reg::CmdBuffer, 2), 0xAAAA_AAAA);
}

#[test]
fn a_place_outside_the_memory_is_refused_and_nothing_is_stored() {
    // N_PROG, N_STR, SECTOR_SIZE
    let wrong = [
        (4, 0, 1),
        (0xFFFF, 0, 1),
        (0, 0, 0),
        (0, 0, 33),
        (0, 0, 0xFFFF),
        (0, 255, 1),
        (0, 254, 2),
        (0, 224, 32),
        (0, 0xFFFF, 1),
        (0, 0xFFFF, 0xFFFF),
    ];
    for (area, first, count) in wrong {
        for code in [READ, WRITE] {
            let mut bench = Bench::new();
            set(&mut bench, area, first, count, 1);
            let what = format!("N_PROG {area}, N_STR {first}, SECTOR_SIZE {count}");
            bench.assert_excepted(VALUE, &what, |bench| bench.try_write(Reg::MemCmd, code));
            assert_eq!(bench.drive.next_wake(), None);
        }
    }
    for (area, first, count) in [(0, 254, 1), (3, 223, 32)] {
        let mut bench = Bench::new();
        set(&mut bench, area, first, count, 1);
        bench.procedure(WRITE);
    }
}

#[test]
fn erasing_and_sizes_look_at_the_area_alone() {
    for code in [ERASE, READ_SIZE, WRITE_SIZE] {
        let mut bench = Bench::new();
        set(&mut bench, 3, 0xFFFF, 0xFFFF, 255);
        bench.procedure(code);
        bench.write(Reg::NProg, 4);
        bench.assert_excepted(VALUE, "N_PROG 4", |bench| bench.try_write(Reg::MemCmd, code));
    }
}

#[test]
fn a_size_over_255_is_refused() {
    for size in [256, 0xFFFF] {
        let mut bench = Bench::new();
        set(&mut bench, 0, 0, 1, size);
        bench.assert_excepted(VALUE, "PROG_SIZE", |bench| bench.try_write(Reg::MemCmd, WRITE_SIZE));
    }
}

#[test]
fn one_word_that_is_no_instruction_keeps_all_from_being_stored() {
    for wrong in [0x0001_9061, 0x0001_9068, 0x3F0, 0xFFFF_FFFF_u32] {
        for place in [0, 31] {
            let mut bench = Bench::new();
            let mut buffer = vec![0; 64];
            buffer[place * 2] = u16::try_from(wrong & 0xFFFF).expect("low word");
            buffer[place * 2 + 1] = u16::try_from(wrong >> 16).expect("high word");
            bench.write_at(0x3100, &buffer).expect("a buffer takes any words");
            set(&mut bench, 0, 0, 32, 1);
            let what = format!("{wrong:08X} in place {place}");
            bench.assert_excepted(VALUE, &what, |bench| bench.try_write(Reg::MemCmd, WRITE));
        }
    }
}

#[test]
fn a_wrong_word_behind_the_sector_does_not_matter() {
    let mut bench = Bench::new();
    bench.write_at(0x3100, &[0x9060, 0x0001, 0xFFFF, 0xFFFF]).expect("a buffer");
    set(&mut bench, 0, 0, 1, 1);
    bench.procedure(WRITE);
    assert_eq!(bench.drive.memory().area(0).words()[..2], [0x0001_9060, 0]);
}

#[test]
fn a_program_may_hold_instructions_that_it_cannot_carry_out() {
    let mut bench = Bench::new();
    bench.store(0, &[plain(Opcode::GetSpeed), line(Opcode::SetMaxSpeed, 0)]);
    assert_eq!(bench.drive.memory().area(0).size(), 2);
}

#[test]
fn an_unlisted_procedure_is_a_wrong_value() {
    let mut bench = Bench::new();
    for code in [5, 0xFFFF] {
        bench.assert_excepted(VALUE, "MEM_CMD", |bench| bench.try_write(Reg::MemCmd, code));
    }
}

#[test]
fn while_a_procedure_works_another_is_refused() {
    let mut bench = Bench::new();
    set(&mut bench, 0, 0, 1, 1);
    bench.write(Reg::MemCmd, ERASE);
    bench.run_for(MS);
    for code in READ..=WRITE_SIZE {
        bench.assert_excepted(BUSY, "one works", |bench| bench.try_write(Reg::MemCmd, code));
    }
    let registers = [1, 2, 3, 4, 0];
    bench.assert_excepted(BUSY, "with its registers", |bench| bench.write_at(0x3180, &registers));
    bench.run_for(MS);
    assert_eq!(bench.write_at(0x3180, &registers), Ok(()));
}

#[test]
fn a_wrong_value_outweighs_a_procedure_at_work_and_a_running_program() {
    let mut bench = Bench::new();
    bench.store(1, &[line(Opcode::SetWait, 3_600_000), end()]);
    bench.command(Opcode::StartProgramMem1);
    bench.settle();
    set(&mut bench, 1, 0, 33, 256);
    for code in [WRITE, WRITE_SIZE] {
        bench.assert_excepted(VALUE, "program runs", |bench| bench.try_write(Reg::MemCmd, code));
    }
    bench.write(Reg::MemCmd, READ_SIZE);
    bench.write(Reg::NProg, 4);
    for code in READ..=WRITE_SIZE {
        bench.assert_excepted(VALUE, "procedure works", |bench| bench.try_write(Reg::MemCmd, code));
    }
}

#[test]
fn the_area_of_the_running_program_can_be_read_and_not_changed() {
    let mut bench = Bench::new();
    bench.store(1, &[line(Opcode::SetWait, 3_600_000), end()]);
    bench.command(Opcode::StartProgramMem1);
    bench.settle();
    set(&mut bench, 1, 0, 1, 1);
    for code in [WRITE, ERASE, WRITE_SIZE] {
        bench.assert_excepted(BUSY, "it executes", |bench| bench.try_write(Reg::MemCmd, code));
    }
    for code in [READ, READ_SIZE] {
        bench.procedure(code);
    }
    bench.write(Reg::NProg, 0);
    for code in READ..=WRITE_SIZE {
        bench.procedure(code);
    }
    bench.command(Opcode::StopProgramMem);
    bench.write(Reg::NProg, 1);
    bench.procedure(ERASE);
}

#[test]
fn the_area_that_a_program_has_jumped_to_is_the_one_that_is_kept() {
    let mut bench = Bench::new();
    bench.store(0, &[line(Opcode::GotoProgram, 2 << 8)]);
    bench.store(2, &[line(Opcode::SetWait, 3_600_000), count(), end()]);
    bench.command(Opcode::StartProgramMem0);
    bench.run_for(10 * MS);
    for (area, free) in [(0, true), (1, true), (2, false), (3, true)] {
        bench.write(Reg::NProg, area);
        assert_eq!(bench.try_write(Reg::MemCmd, ERASE).is_ok(), free, "area {area}");
        bench.run_for(2 * MS);
    }
}

#[test]
fn the_registers_of_a_refused_write_are_as_before() {
    let mut bench = Bench::new();
    set(&mut bench, 1, 2, 3, 4);
    bench.assert_excepted(VALUE, "all five at once", |bench| bench.write_at(0x3180, &[0, 0, 33, 0, 1]));
    assert_eq!(bench.read_at(Table::HoldingRegisters, 0x3180, 5), Ok(vec![1, 2, 3, 4, 0]));
}

#[test]
fn all_five_registers_may_come_in_one_write() {
    let mut bench = Bench::new();
    bench.store(3, &lines(5));
    assert_eq!(bench.write_at(0x3180, &[3, 0, 0, 0, 3]), Ok(()));
    bench.run_for(2 * MS);
    assert_eq!(bench.read(Reg::ProgSize), 5);
}

#[test]
fn programs_survive_power_off() {
    let mut bench = Bench::new();
    bench.store(0, &lines(255));
    bench.store(3, &lines(7));
    let mut restored = Memory::factory();
    while let Some(record) = bench.drive.take_unsaved() {
        restored.decode(record, &bench.drive.memory().encode(record)).expect("intact");
    }
    assert_eq!(&restored, bench.drive.memory());
    let mut again = Bench::with(config(Model::Smsd42), restored, 0);
    assert_eq!((again.read(Reg::BComplete), again.read(Reg::ProgSize)), (0, 0));
    assert_eq!(read_program(&mut again, 0), words(&lines(255)));
    assert_eq!(read_program(&mut again, 3), words(&lines(7)));
}
