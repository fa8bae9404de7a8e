//! What can be looked at.

use crate::bench::{Bench, MS, SECOND, count, repeat};
use core::time::Duration;
use stepdrive_drive::controller::Controller;
use stepdrive_drive::smsd::{Quantity, Smsd};
use stepdrive_spec::modbus::Table;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg};

#[track_caller]
fn assert_shows(bench: &Bench, expected: &[(&str, i32)]) {
    for (name, value) in expected {
        let quantity = Smsd::find_quantity(name).unwrap_or_else(|| panic!("there is no {name}"));
        let seen = bench.drive.look(bench.now, quantity);
        assert_eq!(seen.to_bits(), f64::from(*value).to_bits(), "{name} shows {seen}, not {value}");
    }
}

#[test]
fn names_are_unique_whatever_their_case() {
    let mut names: Vec<String> = Smsd::quantities().map(|(name, _)| name.to_ascii_uppercase()).collect();
    names.sort();
    let all = names.len();
    names.dedup();
    assert_eq!(names.len(), all);
}

#[test]
fn every_name_leads_back_to_its_quantity_in_any_case() {
    for (name, quantity) in Smsd::quantities() {
        for spelt in [name.to_owned(), name.to_ascii_lowercase(), name.replace(' ', "_")] {
            assert_eq!(Smsd::find_quantity(&spelt), Some(quantity), "{spelt}");
        }
    }
    for nothing in ["", "READ", "READY ", "Password_LOW32", "Reset Pos", "CMD 32", "CMD {}"] {
        assert_eq!(Smsd::find_quantity(nothing), None, "{nothing}");
    }
}

#[test]
fn every_register_that_tells_something_and_every_input_is_there() {
    let listed = |quantity| Smsd::quantities().any(|(_, known)| known == quantity);
    for row in &REGISTERS {
        let tells = matches!(row.access, Access::Read | Access::ReadWrite);
        for index in 0..row.count {
            assert_eq!(listed(Quantity::Register(row.id, index)), tells, "{} {index}", row.name);
        }
    }
    for input in Input::ALL {
        // DIR is the flag of that name.
        assert_eq!(listed(Quantity::Input(input)), input != Input::Dir, "{input}");
        assert!(Smsd::find_quantity(input.name()).is_some());
    }
}

#[test]
fn names_that_the_map_gives_twice_are_told_apart() {
    let mut bench = Bench::tuned(4, 0, 1000, 300, 200);
    bench.order(Opcode::RunF, 500);
    assert_shows(&bench, &[("ACC", 300), ("DEC", 200), ("ACC_FLAG", 1), ("DEC_FLAG", 0)]);
    bench.run_for(SECOND);
    bench.command(Opcode::SoftStop);
    assert_shows(&bench, &[("ACC_FLAG", 0), ("DEC_FLAG", 1)]);
}

#[test]
fn values_are_whole_and_signed() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveR, 70_000);
    bench.run_until_ready();
    assert_shows(&bench, &[("abs_pos", -70_000), ("TARGET_POS", 70_000), ("DIR", 0), ("Access", 1)]);
    bench.write_at(Reg::CmdBuffer.info().address + 2, &[0x9060, 0x7001]).expect("a buffer");
    assert_shows(&bench, &[("CMD 0", 0), ("cmd_1", 0x7001_9060)]);
    assert_shows(&bench, &[("IP 0", 192), ("Port", 5020), ("HW_MAJOR", 6)]);
}

#[test]
fn inputs_show_their_level() {
    for input in Input::ALL {
        let mut bench = Bench::new();
        bench.write(Reg::Mask, 0);
        bench.input(input, true);
        for other in Input::ALL.into_iter().filter(|other| *other != Input::Dir) {
            assert_shows(&bench, &[(other.name(), i32::from(other == input))]);
        }
        assert_shows(&bench, &[("INPUTS", i32::from(input.bit()))]);
    }
}

/// Asserts that each register looks as an authorised host reads it, `at` after now, which must be before the next
/// wake-up; and that it has changed only if it flows.
fn assert_looks_as_read(bench: &Bench, at: Duration) {
    let mut there = bench.clone();
    there.now = bench.now + at;
    there.drive.handle_wake(there.now);
    for (name, quantity) in Smsd::quantities() {
        let seen = bench.drive.look(there.now, quantity);
        let Quantity::Register(reg, index) = quantity else { continue };
        #[allow(clippy::float_cmp, reason = "whole numbers of at most 32 bits")]
        let same = seen == there.read_nth(reg, index) as f64;
        assert!(same, "{name} looks like {seen} at {}", there.now);
        let before = bench.drive.look(bench.now, quantity);
        assert!(Smsd::flows(quantity) || before.to_bits() == seen.to_bits(), "{name} flows");
    }
}

#[test]
fn a_look_between_wake_ups_is_what_a_host_would_read_then() {
    let mut bench = Bench::tuned(7, 20, 900, 700, 300);
    bench.write(Reg::FsSpeed, 400);
    let program = [repeat(2, 3), count(), crate::bench::line(Opcode::MoveR, 40_000), crate::bench::end()];
    bench.start(&program);
    let mut looked = 0;
    while let Some((due, _)) = bench.drive.next_wake() {
        let left = due.since(bench.now);
        for share in [0, 1, 7, 50, 99] {
            let at = left * share / 100;
            if bench.now + at < due {
                assert_looks_as_read(&bench, at);
                looked += 1;
            }
        }
        bench.step(due);
    }
    assert!(looked > 40 && !bench.program_runs());
    assert_looks_as_read(&bench, 1000 * SECOND);
}

#[test]
fn what_flows_is_the_position_and_the_speed() {
    let flowing: Vec<&str> =
        Smsd::quantities().filter(|(_, quantity)| Smsd::flows(*quantity)).map(|(name, _)| name).collect();
    assert_eq!(flowing, ["SPEED", "ABS_POS", "EL_POS"]);
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 500);
    let snapshot = bench.snapshot();
    let seen = |name: &str, at| bench.drive.look(bench.now + at, Smsd::find_quantity(name).expect("there"));
    for name in flowing {
        assert!(seen(name, 20 * MS) < seen(name, 33 * MS), "{name}");
    }
    assert_eq!(bench.snapshot(), snapshot);
}

#[test]
fn bits_are_0_or_1_and_words_within_16_bits() {
    let mut bench = Bench::new();
    bench.order(Opcode::GoUntilR, 4);
    bench.run_for(SECOND);
    for (name, quantity) in Smsd::quantities() {
        let value = bench.drive.look(bench.now, quantity);
        let bit = match quantity {
            Quantity::Register(reg, _) => matches!(reg.info().table, Table::Coils | Table::DiscreteInputs),
            Quantity::Input(_) => true,
        };
        let most = if bit { 1.0 } else { f64::from(u32::MAX) };
        assert!(
            value.fract() == 0.0 && value <= most && value >= if bit { 0.0 } else { -2_097_152.0 },
            "{name} {value}"
        );
    }
}
