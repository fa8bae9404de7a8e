//! Writes that are refused: with which exception, and that nothing has changed then.

use crate::bench::{Bench, config};
use stepdrive_drive::smsd::Memory;
use stepdrive_spec::modbus::{Exception, Table};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Limits, REGISTERS, Reg, Register, Writable};

const ADDRESS: Exception = Exception::IllegalDataAddress;
const VALUE: Exception = Exception::IllegalDataValue;
const BUSY: Exception = Exception::ServerDeviceBusy;

/// A controller whose motor turns at constant speed.
fn turning() -> Bench {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    bench.run_until_ready();
    bench
}

/// A controller whose motor stands energised.
fn holding() -> Bench {
    let mut bench = Bench::new();
    bench.command(Opcode::HardStop);
    bench
}

fn rows_when(writable: Writable) -> impl Iterator<Item = &'static Register> {
    REGISTERS.iter().filter(move |row| row.writable == writable)
}

#[test]
fn a_value_out_of_range_is_refused_on_either_model_and_its_neighbour_is_taken() {
    for model in Model::ALL {
        let ranged =
            REGISTERS.iter().filter(|row| matches!(row.limits, Limits::Within(..) | Limits::ByModel(..)));
        // The procedures and the password act; they have tests of their own.
        for row in ranged.filter(|row| !matches!(row.id, Reg::MemCmd | Reg::PasswordCmd)) {
            let mut bench = Bench::of(model);
            let (min, max) = row.range(model);
            let (lowest, highest) = Register { limits: Limits::Any, ..*row }.range(model);
            for value in [min - 1, max + 1, lowest, highest] {
                if (min..=max).contains(&value) || !(lowest..=highest).contains(&value) {
                    continue;
                }
                let what = format!("{} = {value} on {model}", row.name);
                bench.assert_excepted(VALUE, &what, |bench| bench.try_write(row.id, value));
            }
            for value in [min, max] {
                assert_eq!(bench.try_write(row.id, value), Ok(()), "{} = {value} on {model}", row.name);
            }
        }
    }
}

#[test]
fn the_larger_model_has_more_motors_and_more_current() {
    for (model, motor, current) in [(Model::Smsd42, 45, 42), (Model::Smsd80, 54, 80)] {
        let mut bench = Bench::of(model);
        for (reg, highest) in [(Reg::MotorType, motor), (Reg::WorkCurrent, current)] {
            assert_eq!(bench.try_write(reg, highest), Ok(()));
            assert_eq!(bench.try_write(reg, highest + 1), Err(VALUE));
        }
    }
}

#[test]
fn a_write_across_a_gap_is_refused_and_changes_nothing() {
    let mut bench = Bench::new();
    let gaps = [0x10FF, 0x1110, 0x20FF, 0x2104, 0x30FF, 0x313F, 0x317F, 0x3184, 0x6FFF, 0x7018, 0xFFFF];
    for address in gaps {
        let what = format!("{address:04X}");
        bench.assert_excepted(ADDRESS, &what, |bench| bench.write_at(address, &[1, 1]));
    }
    for address in [0x13FF, 0x1407, 0x33FF, 0x3400, 0x73FF, 0x7400] {
        let what = format!("{address:04X}");
        bench.assert_excepted(ADDRESS, &what, |bench| bench.write_coils_at(address, &[true, true]));
    }
}

#[test]
fn tables_do_not_stand_in_for_each_other() {
    let mut bench = Bench::new();
    for address in [0x1000, 0x1001, 0x3000, 0x8001, 0x1200, 0x1400] {
        bench.assert_excepted(ADDRESS, "no holding register", |bench| bench.write_one(address, 0));
    }
    for address in [0x1200, 0x2200, 0x1100] {
        bench.assert_excepted(ADDRESS, "no coil", |bench| bench.write_coils_at(address, &[true]));
    }
    assert_eq!(bench.read_at(Table::HoldingRegisters, 0x1000, 1), Err(ADDRESS));
    assert_eq!(bench.read_at(Table::InputRegisters, 0x1100, 1), Err(ADDRESS));
}

#[test]
fn one_wrong_value_among_several_changes_none() {
    let mut bench = Bench::new();
    // MIN, MAX, ACC, DEC, FS, TARGET_SPEED: each in turn just out of its range.
    let valid = [10, 2000, 3000, 4000, 500, 600];
    let wrong = [951, 15, 14, 59_001, 14, 15_601];
    for place in 0..valid.len() {
        let mut values = valid;
        values[place] = wrong[place];
        bench.assert_excepted(VALUE, &format!("{values:?}"), |bench| bench.write_at(0x1100, &values));
    }
    assert_eq!(bench.write_at(0x1100, &valid), Ok(()));
    assert_eq!(bench.read_at(Table::HoldingRegisters, 0x1100, 6), Ok(valid.to_vec()));
}

#[test]
fn one_wrong_lan_parameter_changes_none() {
    let mut bench = Bench::new();
    let present = bench.read_at(Table::HoldingRegisters, 0x7000, 25).expect("listed");
    let wrong = [(0, 0), (0, 248), (1, 256), (6, 0xFFFF), (7, 256), (22, 256), (23, 0), (24, 0), (24, 3)];
    for (place, value) in wrong {
        let mut values = present.clone();
        values[0] = 9;
        values[place] = value;
        let what = format!("{:04X} = {value}", 0x7000 + place);
        bench.assert_excepted(VALUE, &what, |bench| bench.write_at(0x7000, &values));
    }
}

#[test]
fn a_target_position_written_whole_is_checked_at_once() {
    let mut bench = Bench::new();
    for value in [-2_097_153, 2_097_152, i64::from(i32::MIN), i64::from(i32::MAX)] {
        bench.assert_excepted(VALUE, "beyond 22 bits", |bench| bench.try_write(Reg::TargetPos, value));
    }
}

#[test]
fn a_target_position_written_in_halves_is_checked_when_it_is_used() {
    use Opcode::{GoTo, GoToF, GoToR, MoveF, MoveR};
    for opcode in [MoveF, MoveR, GoToF, GoToR, GoTo] {
        let mut bench = Bench::new();
        bench.write_one(0x1107, 0x0020).expect("a half is not checked");
        bench.command(opcode);
        assert_eq!(bench.flags(), "HiZ STOP READY DIR CMD_ERROR");
        bench.assert_refused("2097152 is not within -2097152 to 2097151");
    }
}

#[test]
fn a_code_that_cmd_does_not_list_is_refused() {
    let mut bench = Bench::new();
    let listed = (0x0E..=0x1C).chain(0x1F..=0x22).chain(0x2F..=0x33).chain(0x3D..=0x3E).collect::<Vec<_>>();
    let others = (0..=0x100).chain([0x0E00, 0x400E, 0xFFFF]).filter(|code| !listed.contains(code));
    for code in others {
        let what = format!("CMD = {code:#X}");
        bench.assert_excepted(VALUE, &what, |bench| bench.write_one(0x1109, code));
    }
}

#[test]
fn an_input_that_does_not_exist_sets_cmd_error_when_it_is_used() {
    for opcode in [Opcode::GoUntilF, Opcode::GoUntilR] {
        for input in [8, 255, 0x8000, 0xFFFF] {
            let mut bench = Bench::new();
            bench.order(opcode, input);
            assert_eq!(bench.flags(), "HiZ STOP READY DIR CMD_ERROR");
            bench.assert_refused(&format!("there is no input {input}"));
        }
    }
}

#[test]
fn motor_configuration_is_refused_while_the_motor_is_energised() {
    for mut bench in [holding(), turning()] {
        for row in rows_when(Writable::HiZ) {
            bench.assert_excepted(BUSY, row.name, |bench| bench.try_write(row.id, row.default));
        }
        bench.command(Opcode::HardHiZ);
        for row in rows_when(Writable::HiZ) {
            assert_eq!(bench.try_write(row.id, row.default), Ok(()), "{}", row.name);
        }
    }
    assert_eq!(rows_when(Writable::HiZ).count(), 5);
}

#[test]
fn motor_configuration_is_refused_until_a_soft_hi_z_has_braked() {
    let mut bench = turning();
    bench.command(Opcode::SoftHiZ);
    bench.assert_excepted(BUSY, "braking", |bench| bench.try_write(Reg::StopCurrent, 3));
    bench.run_until_ready();
    bench.write(Reg::StopCurrent, 3);
}

#[test]
fn min_speed_and_accelerations_are_refused_while_the_motor_turns() {
    let mut bench = turning();
    for row in rows_when(Writable::Stopped) {
        bench.assert_excepted(BUSY, row.name, |bench| bench.try_write(row.id, row.default));
    }
    bench.command(Opcode::HardStop);
    for row in rows_when(Writable::Stopped) {
        assert_eq!(bench.try_write(row.id, row.default), Ok(()), "{}", row.name);
    }
    assert_eq!(
        rows_when(Writable::Stopped).map(|row| row.name).collect::<Vec<_>>(),
        ["MIN_SPEED", "ACC", "DEC"]
    );
}

#[test]
fn a_write_of_several_registers_changes_none_when_the_state_forbids_one() {
    let mut bench = turning();
    bench.assert_excepted(BUSY, "MAX_SPEED would be free", |bench| bench.write_at(0x1101, &[2000, 2000]));
    bench.assert_excepted(BUSY, "so would CMD", |bench| bench.write_at(0x1109, &[0x20, 1]));
    assert_eq!(bench.write_at(0x1104, &[2000, 600]), Ok(()));
}

#[test]
fn an_unlisted_address_outweighs_a_wrong_value_and_a_wrong_state() {
    let mut bench = turning();
    bench.assert_excepted(ADDRESS, "02 before 03", |bench| bench.write_at(0x110F, &[0x100, 0, 0]));
    bench.assert_excepted(ADDRESS, "02 before 06", |bench| bench.write_at(0x10FF, &[0, 0]));
    let mut locked = Bench::locked(config(Model::Smsd42), Memory::factory(), 0);
    locked.assert_excepted(ADDRESS, "not authorised", |bench| bench.try_write(Reg::Acc, 0));
}

#[test]
fn a_wrong_value_outweighs_a_wrong_state() {
    let mut bench = turning();
    bench.assert_excepted(VALUE, "the same register", |bench| bench.try_write(Reg::Acc, 14));
    bench.assert_excepted(VALUE, "another behind", |bench| bench.write_at(0x1102, &[1000, 1000, 14]));
    bench.assert_excepted(VALUE, "another before", |bench| bench.write_at(0x1101, &[15, 1000]));
    bench.assert_excepted(VALUE, "no such command", |bench| bench.write_at(0x1109, &[0, 1]));
}

#[test]
fn the_mask_has_eight_bits() {
    let mut bench = Bench::new();
    for value in [0x100, 0xFFFF] {
        bench.assert_excepted(VALUE, "Mask", |bench| bench.try_write(Reg::Mask, value));
    }
    bench.write(Reg::Mask, 0);
}

#[test]
fn target_speed_takes_the_15_that_run_takes() {
    let mut bench = Bench::new();
    bench.assert_excepted(VALUE, "14", |bench| bench.try_write(Reg::TargetSpeed, 14));
    bench.order(Opcode::RunF, 15);
    bench.run_until_ready();
    assert_eq!((bench.speed(), bench.cmd_error()), (15, false));
}
