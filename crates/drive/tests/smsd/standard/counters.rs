//! The counters of errors, each by its cause.

use super::Port;
use crate::bench::{MS, SECOND, line, plain};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{COUNTER_ROWS, COUNTERS, Code, Counter, Reply, Request};

fn counters(port: &mut Port) -> [u32; COUNTERS] {
    let reply = port.reply(&Request::GetErrors);
    let Reply::Errors(counters) = reply else { panic!("{reply:?}") };
    counters
}

/// Asserts that these have counted since power-up and all others have not.
fn assert_counted(port: &mut Port, expected: &[(Counter, u32)]) {
    let counters = counters(port);
    assert_eq!(counters, port.bench.drive.counters());
    for (counter, name, _) in COUNTER_ROWS {
        let count = expected.iter().find(|(other, _)| *other == counter).map_or(0, |(_, count)| *count);
        assert_eq!(counters[counter as usize], count, "{name}");
    }
}

#[test]
fn a_controller_that_has_done_nothing_has_counted_nothing() {
    assert_counted(&mut Port::new(), &[]);
}

#[test]
fn starts_are_how_often_the_phases_were_energised() {
    let mut port = Port::new();
    for round in 1..=3 {
        port.order(Opcode::RunF, 100);
        port.order(Opcode::RunR, 100);
        port.order(Opcode::SoftStop, 0);
        port.bench.run_until_ready();
        port.order(Opcode::MoveF, 10);
        port.bench.run_until_ready();
        assert_counted(&mut port, &[(Counter::Starts, round)]);
        port.bench.command(Opcode::SoftHiZ);
        port.bench.run_until_ready();
        assert_counted(&mut port, &[(Counter::Starts, round)]);
    }
}

#[test]
fn each_way_to_energise_the_motor_is_a_start_and_staying_de_energised_is_none() {
    for (opcode, operand, starts) in [
        (Opcode::HardStop, 0, 1),
        (Opcode::SoftStop, 0, 1),
        (Opcode::GoTo, 0, 1),
        (Opcode::MoveF, 0, 1),
        (Opcode::RunF, 100, 1),
        (Opcode::ScanZeroF, 100, 1),
        (Opcode::HardHiZ, 0, 0),
        (Opcode::SoftHiZ, 0, 0),
        (Opcode::ResetPos, 0, 0),
        (Opcode::StepClock, 0, 0),
    ] {
        let mut port = Port::new();
        port.order(opcode, operand);
        port.bench.run_for(SECOND);
        assert_counted(&mut port, &[(Counter::Starts, starts)]);
    }
}

#[test]
fn the_enable_input_of_the_step_clock_starts_too() {
    let mut port = Port::new();
    port.order(Opcode::StepClock, 0);
    for _ in 0..3 {
        port.bench.input(Input::En, true);
        port.bench.input(Input::En, false);
    }
    assert_counted(&mut port, &[(Counter::Starts, 3)]);
}

#[test]
fn a_reset_of_the_motor_chip_keeps_the_counters() {
    let mut port = Port::new();
    port.order(Opcode::HardStop, 0);
    port.order(Opcode::ResetPowerstep01, 0);
    assert_counted(&mut port, &[(Counter::Starts, 1)]);
    port.order(Opcode::HardStop, 0);
    assert_counted(&mut port, &[(Counter::Starts, 2)]);
}

#[test]
fn a_short_circuit_ends_a_start_and_bridges_that_are_shut_down_have_none() {
    let mut port = Port::new();
    port.bench.drive.short_motor(port.bench.now, true);
    port.order(Opcode::HardStop, 0);
    port.order(Opcode::HardStop, 0);
    assert_counted(&mut port, &[(Counter::Starts, 1)]);
}

#[test]
fn each_overheating_counts_once() {
    let mut port = Port::new();
    for hot in [true, true, false, false, true] {
        port.bench.drive.overheat(port.bench.now, hot);
    }
    port.order(Opcode::GetStatusAndClr, 0);
    port.order(Opcode::ResetPowerstep01, 0);
    assert_counted(&mut port, &[(Counter::ThermalPowerstep01, 2)]);
}

#[test]
fn refused_commands_count_by_either_protocol_also_while_cmd_error_stands() {
    let mut port = Port::new();
    port.order(Opcode::RunF, 100);
    port.order(Opcode::MoveF, 1);
    port.order(Opcode::MoveF, 1);
    port.bench.order(Opcode::MoveF, 1);
    port.order(Opcode::StepClock, 0);
    assert_counted(&mut port, &[(Counter::Starts, 1), (Counter::CommandPowerstep01, 4)]);
}

#[test]
fn requests_that_are_refused_as_such_do_not_count() {
    let mut port = Port::new();
    for word in [0x3F0, 0x201, super::word(Opcode::RunF, 1), super::word(Opcode::ReturnProgram, 0)] {
        assert!(port.code(&Request::Command(word)).is_error());
    }
    assert_eq!(port.code(&Request::Authorise(0)), Code::ErrorAccessTimeout);
    assert_counted(&mut port, &[]);
}

#[test]
fn a_program_that_fails_counts_and_one_that_ends_does_not() {
    let mut port = Port::new();
    port.bench.run_program(&[plain(Opcode::SetRele), plain(Opcode::ReturnProgram)]);
    port.bench.run_program(&[plain(Opcode::SetRele)]);
    port.bench.run_program(&[line(Opcode::RunF, 1)]);
    assert_counted(&mut port, &[(Counter::CommandPowerstep01, 2), (Counter::WorkProgram, 2)]);
}

#[test]
fn what_the_world_tells_of_is_counted_up_to_the_highest_number() {
    let mut port = Port::new();
    for (counter, name, _) in COUNTER_ROWS.into_iter().filter(|row| row.0 != Counter::Starts) {
        port.bench.drive.count(counter);
        port.bench.drive.count(counter);
        assert_eq!(counters(&mut port)[counter as usize], 2, "{name}");
    }
}

#[test]
fn power_off_clears_the_counters() {
    let mut port = Port::new();
    port.order(Opcode::HardStop, 0);
    port.bench.drive.count(Counter::Fram);
    port.bench.drive.overheat(port.bench.now, true);
    port.bench.drive.switch_off(port.bench.now);
    port.bench.run_for(MS);
    port.bench.drive.switch_on(port.bench.now, 0);
    assert_eq!(port.bench.drive.counters()[Counter::Fram as usize], 0);
    assert_eq!(port.bench.drive.counters()[Counter::Starts as usize], 0);
    assert_eq!(
        port.bench.drive.counters()[Counter::ThermalPowerstep01 as usize],
        1,
        "it is too hot still, and shuts down again"
    );
    assert_eq!(port.bench.read(Reg::AccessFlag), 1);
}
