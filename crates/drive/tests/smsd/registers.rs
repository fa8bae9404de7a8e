//! The register map: what can be read and written, and what it then reads as.

use crate::bench::{Bench, PASSWORD, config};
use stepdrive_drive::smsd::{Config, Event, Memory, WordOrder};
use stepdrive_spec::modbus::{Exception, Table};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, Kind, REGISTERS, Reg, Register};

/// The addresses that App. A lists: first and last.
const LISTED: [(Table, u16, u16); 15] = [
    (Table::Coils, 0x1400, 0x1407),
    (Table::Coils, 0x3400, 0x3400),
    (Table::Coils, 0x7400, 0x7400),
    (Table::DiscreteInputs, 0x1200, 0x1209),
    (Table::DiscreteInputs, 0x2200, 0x2200),
    (Table::DiscreteInputs, 0x3200, 0x3200),
    (Table::InputRegisters, 0x1000, 0x1005),
    (Table::InputRegisters, 0x3000, 0x3002),
    (Table::InputRegisters, 0x8001, 0x8004),
    (Table::InputRegisters, 0x8007, 0x8008),
    (Table::HoldingRegisters, 0x1100, 0x1110),
    (Table::HoldingRegisters, 0x2100, 0x2104),
    (Table::HoldingRegisters, 0x3100, 0x313F),
    (Table::HoldingRegisters, 0x3180, 0x3184),
    (Table::HoldingRegisters, 0x7000, 0x7018),
];

const TABLES: [Table; 4] =
    [Table::Coils, Table::DiscreteInputs, Table::InputRegisters, Table::HoldingRegisters];

/// The addresses among `addresses` of `table` that `works` for.
fn addresses_that(table: Table, mut works: impl FnMut(Table, u16) -> bool) -> Vec<(Table, u16)> {
    (0..=u16::MAX).filter(|address| works(table, *address)).map(|address| (table, address)).collect()
}

fn listed_in(table: Table) -> Vec<(Table, u16)> {
    let ranges = LISTED.iter().filter(|(of, _, _)| *of == table);
    ranges.flat_map(|(_, first, last)| (*first..=*last).map(|address| (table, address))).collect()
}

fn high_first() -> Bench {
    let config = Config { word_order: WordOrder::HighFirst, ..config(Model::Smsd42) };
    Bench::with(config, Memory::factory(), 0)
}

/// The holding registers that hold what is written to them, one by one: the row, and the number within the row.
fn plain_registers() -> impl Iterator<Item = (&'static Register, u16)> {
    let acts = |row: &&Register| !matches!(row.id, Reg::Cmd | Reg::MemCmd | Reg::Wait);
    let writable = |row: &&Register| row.table == Table::HoldingRegisters && row.access == Access::ReadWrite;
    let rows = REGISTERS.iter().filter(acts).filter(writable);
    rows.flat_map(|row| (0..row.count).map(move |index| (row, index)))
}

#[test]
fn the_listed_addresses_can_be_read_after_authorisation_and_no_other() {
    let mut bench = Bench::new();
    for table in TABLES {
        let readable = addresses_that(table, |table, address| bench.read_at(table, address, 1).is_ok());
        assert_eq!(readable, listed_in(table));
    }
}

#[test]
fn before_authorisation_access_and_identification_can_be_read_and_nothing_else() {
    let mut bench = Bench::locked(config(Model::Smsd42), Memory::factory(), 0);
    let mut readable = Vec::new();
    for table in TABLES {
        readable.extend(addresses_that(table, |table, address| bench.read_at(table, address, 1).is_ok()));
    }
    let identification = [0x8001, 0x8002, 0x8003, 0x8004, 0x8007, 0x8008];
    let mut open = vec![(Table::DiscreteInputs, 0x2200)];
    open.extend(identification.map(|address| (Table::InputRegisters, address)));
    assert_eq!(readable, open);
}

#[test]
fn before_authorisation_the_password_can_be_written_and_nothing_else() {
    let mut bench = Bench::locked(config(Model::Smsd42), Memory::factory(), 0);
    let registers = addresses_that(Table::HoldingRegisters, |_, address| {
        bench.write_one(address, 0) != Err(Exception::IllegalDataAddress)
    });
    assert_eq!(registers, (0x2100..=0x2104).map(|at| (Table::HoldingRegisters, at)).collect::<Vec<_>>());
    let coils = addresses_that(Table::Coils, |_, address| {
        bench.write_coils_at(address, &[false]) != Err(Exception::IllegalDataAddress)
    });
    assert_eq!(coils, []);
}

#[test]
fn a_range_reads_whole_and_no_address_beyond_it() {
    let mut bench = Bench::new();
    for (table, first, last) in LISTED {
        let count = last - first + 1;
        let values = bench.read_at(table, first, count).expect("listed");
        assert_eq!(values.len(), usize::from(count));
        for (address, count) in [(first, count + 1), (first - 1, count + 1), (last, 2), (last + 1, 1)] {
            let outside = bench.read_at(table, address, count);
            assert_eq!(outside, Err(Exception::IllegalDataAddress), "{table:?} {address:04X} {count}");
        }
    }
}

#[test]
fn a_read_past_the_last_address_there_is_is_refused() {
    let mut bench = Bench::new();
    for table in TABLES {
        for count in [1, 2, 125] {
            assert_eq!(bench.read_at(table, 0xFFFF, count), Err(Exception::IllegalDataAddress));
        }
    }
}

/// What a register reads at power-up where its row of the table cannot say it.
fn special_default(model: Model, reg: Reg, index: u16) -> Option<i64> {
    let octets: &[i64] = if reg == Reg::LanMac {
        &[0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00]
    } else if reg == Reg::LanIp {
        &[192, 168, 1, 2]
    } else if reg == Reg::LanSubnetMask {
        &[255, 255, 0, 0]
    } else if reg == Reg::LanGateway {
        &[192, 168, 1, 1]
    } else {
        let others = [
            (Reg::AccessFlag, 1),
            (Reg::HwMajor, i64::from(model.hw_major())),
            (Reg::PasswordLow32, 0),
            (Reg::PasswordHigh32, 0),
            (Reg::LanPort, 5020),
        ];
        return others.into_iter().find(|(other, _)| *other == reg).map(|(_, value)| value);
    };
    octets.get(usize::from(index)).copied()
}

#[test]
fn every_register_reads_its_default_at_power_up() {
    for model in Model::ALL {
        let mut bench = Bench::of(model);
        for row in &REGISTERS {
            for index in 0..row.count {
                let expected = special_default(model, row.id, index).unwrap_or(row.default);
                assert_eq!(bench.read_nth(row.id, index), expected, "{} {index} of {model}", row.name);
            }
        }
    }
}

#[test]
fn the_drive_parameters_at_power_up_are_those_of_the_decisions() {
    let mut bench = Bench::new();
    let parameters = bench.read_at(Table::HoldingRegisters, 0x1100, 17).expect("listed");
    // MIN MAX ACC DEC FS, target speed, position (2), input, CMD, mode, motor, microstep, currents, mask, wait.
    assert_eq!(parameters, [0, 1000, 1000, 1000, 15_600, 16, 0, 0, 0, 0, 1, 0, 4, 10, 1, 0xFF, 0]);
    assert_eq!(bench.flags(), "HiZ STOP READY DIR");
}

#[test]
fn identification_tells_the_models_apart() {
    for (model, hw_major) in [(Model::Smsd42, 6), (Model::Smsd80, 7)] {
        let mut bench = Bench::of(model);
        assert_eq!(bench.read_at(Table::InputRegisters, 0x8001, 4), Ok(vec![hw_major, 1, 1, 3]));
        assert_eq!(bench.read_at(Table::InputRegisters, 0x8007, 2), Ok(vec![4, 3]));
    }
}

#[test]
fn every_holding_register_reads_back_its_lowest_and_highest_value() {
    let benches: [fn() -> Bench; 3] = [Bench::new, || Bench::of(Model::Smsd80), high_first];
    for bench in benches {
        let mut bench = bench();
        let model = bench.drive.model();
        for (row, index) in plain_registers() {
            let (min, max) = row.range(model);
            for value in [min, max] {
                let words = bench.words(row, value);
                let address = row.address + index * row.kind.width();
                assert_eq!(bench.write_at(address, &words), Ok(()), "{} = {value}", row.name);
                assert_eq!(bench.read_nth(row.id, index), value, "{}", row.name);
            }
        }
    }
}

#[test]
fn every_register_of_a_row_is_a_place_of_its_own() {
    let mut bench = Bench::new();
    let value = |address: u16| if address < 0x4000 { address } else { address & 0xFF };
    for (first, last) in [(0x3100, 0x313F), (0x7001, 0x7016)] {
        let values: Vec<u16> = (first..=last).map(value).collect();
        assert_eq!(bench.write_at(first, &values), Ok(()));
        assert_eq!(bench.read_at(Table::HoldingRegisters, first, last - first + 1), Ok(values));
    }
}

#[test]
fn values_of_32_bits_can_be_written_in_halves() {
    let mut bench = Bench::new();
    bench.write_one(0x1106, 0x5678).expect("low half");
    bench.write_one(0x1107, 0xFFF2).expect("high half");
    assert_eq!(bench.read(Reg::TargetPos), i64::from(0xFFF2_5678_u32.cast_signed()));
    bench.write_one(0x3101, 0xABCD).expect("high half of CMD 00");
    bench.write_one(0x3102, 0x1234).expect("low half of CMD 01");
    assert_eq!(bench.read_nth(Reg::CmdBuffer, 0), 0xABCD_0000);
    assert_eq!(bench.read_nth(Reg::CmdBuffer, 1), 0x1234);
}

#[test]
fn the_low_word_comes_first_unless_the_rig_says_otherwise() {
    for (mut bench, words) in [(Bench::new(), [0x0002, 0x0001]), (high_first(), [0x0001, 0x0002])] {
        assert_eq!(bench.write_at(0x1106, &words), Ok(()));
        assert_eq!(bench.read_at(Table::HoldingRegisters, 0x1106, 2), Ok(words.to_vec()));
        bench.command(Opcode::MoveF);
        bench.run_until_ready();
        assert_eq!(bench.drive.position(bench.now), 0x0001_0002);
        assert_eq!(bench.read_at(Table::InputRegisters, 0x1001, 2), Ok(words.to_vec()));
    }
}

#[test]
fn the_halves_of_a_position_can_be_read_apart() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveR, 3);
    bench.run_until_ready();
    assert_eq!(bench.read_at(Table::InputRegisters, 0x1001, 1), Ok(vec![0xFFFD]));
    assert_eq!(bench.read_at(Table::InputRegisters, 0x1002, 2), Ok(vec![0xFFFF, 512 - 3 * 8]));
}

#[test]
fn the_password_reads_as_zero() {
    let mut bench = Bench::new();
    bench.enter(PASSWORD, 0).expect("open");
    assert_eq!(bench.read_at(Table::HoldingRegisters, 0x2100, 5), Ok(vec![0; 5]));
}

#[test]
fn triggers_read_false_after_they_have_acted_and_false_does_nothing() {
    let triggers = || REGISTERS.iter().filter(|row| row.access == Access::Trigger);
    assert_eq!(triggers().count(), 8);
    for row in triggers() {
        let mut bench = Bench::new();
        bench.order(Opcode::RunF, 500);
        bench.run_until_ready();
        let before = bench.snapshot();
        bench.write(row.id, 0);
        assert_eq!(bench.snapshot(), before, "{}", row.name);
        bench.write(row.id, 1);
        assert_ne!(bench.snapshot() == before, row.id != Reg::Clr, "{}", row.name);
        assert_eq!(bench.read(row.id), 0, "{}", row.name);
    }
}

#[test]
fn the_relay_reads_back_its_state() {
    let mut bench = Bench::new();
    for state in [true, false, true] {
        bench.write(Reg::Relay, state.into());
        assert_eq!(bench.read(Reg::Relay), state.into());
        assert_eq!(bench.drive.relay(), state);
    }
}

#[test]
fn one_request_may_write_all_coils_of_a_range() {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    bench.run_until_ready();
    // CLR, Reset Pos, Reset powerSTEP01, Soft STOP, Hard STOP, Soft HiZ, Hard HiZ, Relay.
    let values = [false, true, false, false, true, false, false, true];
    assert_eq!(bench.write_coils_at(0x1400, &values), Ok(()));
    assert_eq!((bench.position(), bench.drive.relay()), (0, true));
    assert_eq!(bench.flags(), "STOP READY DIR");
}

#[test]
fn wait_takes_any_value_and_ignores_it() {
    let mut bench = Bench::new();
    for value in [0, 0xFF, 0xFFFF] {
        bench.write(Reg::Wait, value);
        assert_eq!(bench.read(Reg::Wait), 0);
    }
}

#[test]
fn in_one_write_the_data_is_taken_before_the_command_acts_on_it() {
    let mut bench = Bench::new();
    // TARGET_SPEED, TARGET_POS, TARGET_INPUT, CMD = MOVE_F
    assert_eq!(bench.write_at(0x1105, &[300, 160, 0, 0, 0x10]), Ok(()));
    bench.run_until_ready();
    assert_eq!(bench.position(), 160);
    // CMD = RUN_F stands before the microstep mode that it runs with.
    bench.trigger(Reg::HardHiZ);
    assert_eq!(bench.write_at(0x1109, &[0x0E, 1, 0, 0]), Ok(()));
    bench.run_until_ready();
    assert_eq!(bench.speed(), 300);
    assert_eq!(bench.read(Reg::Microstepping), 0);
}

#[test]
fn cmd_reads_back_the_last_code_accepted() {
    let mut bench = Bench::new();
    assert_eq!(bench.read(Reg::Cmd), 0);
    bench.order(Opcode::RunF, 500);
    assert_eq!(bench.try_write(Reg::Cmd, 0x3F), Err(Exception::IllegalDataValue));
    assert_eq!(bench.read(Reg::Cmd), 0x0E);
    // A command that is refused was accepted as a write all the same.
    bench.order(Opcode::MoveF, 5);
    assert!(bench.cmd_error());
    assert_eq!(bench.read(Reg::Cmd), 0x10);
}

#[test]
fn lan_parameters_take_effect_and_are_stored_when_they_are_applied() {
    let mut bench = Bench::new();
    bench.write(Reg::LanId, 17);
    bench.write(Reg::LanPort, 1502);
    bench.write_at(0x7007, &[10, 0, 0, 9]).expect("octets");
    assert_eq!((bench.drive.unit(), bench.drive.memory().lan.port), (1, None));
    assert_eq!((bench.drive.memory_generation(), bench.drive.poll_event()), (0, None));
    bench.trigger(Reg::ApplyNetworkConfiguration);
    let lan = bench.drive.memory().lan;
    assert_eq!((bench.drive.unit(), lan.port, lan.ip), (17, Some(1502), [10, 0, 0, 9]));
    assert_eq!(bench.drive.memory_generation(), 1);
    assert_eq!(bench.drive.poll_event(), Some(Event::NetworkConfigured));
    assert_eq!(bench.drive.poll_event(), None);
}

#[test]
fn the_port_reads_as_the_one_that_the_rig_listens_on_until_another_is_chosen() {
    let mut bench = Bench::new();
    bench.drive.set_port(40_000);
    assert_eq!(bench.read(Reg::LanPort), 40_000);
    bench.write(Reg::LanPort, 40_000);
    bench.trigger(Reg::ApplyNetworkConfiguration);
    assert_eq!(bench.drive.memory().lan.port, None);
    bench.write(Reg::LanPort, 502);
    assert_eq!(bench.read(Reg::LanPort), 502);
}

#[test]
fn motor_configuration_is_stored_and_drive_parameters_are_not() {
    let mut bench = Bench::new();
    for (row, _) in plain_registers().filter(|(row, _)| (0x1100..=0x110F).contains(&row.address)) {
        let generation = bench.drive.memory_generation();
        let (_, max) = row.range(Model::Smsd42);
        bench.write(row.id, max);
        assert_eq!(bench.drive.memory_generation() > generation, row.stored, "{}", row.name);
    }
    let mut again = Bench::with(config(Model::Smsd42), bench.drive.memory().clone(), 0);
    for (row, _) in plain_registers().filter(|(row, _)| (0x1100..=0x110F).contains(&row.address)) {
        let (_, max) = row.range(Model::Smsd42);
        assert_eq!(again.read(row.id), if row.stored { max } else { row.default }, "{}", row.name);
    }
}

#[test]
fn the_inputs_at_power_up_are_seen() {
    let mut bench = Bench::with(config(Model::Smsd42), Memory::factory(), 0b1010_0101);
    assert_eq!(bench.read(Reg::Inputs), 0b1010_0101);
}

#[test]
fn every_kind_of_value_has_been_written_here() {
    let kinds = |kind: Kind| plain_registers().filter(|(row, _)| row.kind == kind).count();
    assert_eq!((kinds(Kind::U16), kinds(Kind::U32), kinds(Kind::I32)), (42, 32, 1));
}
