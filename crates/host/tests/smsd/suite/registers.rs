//! Typed access to the register map.

use super::turning;
use crate::common::station::text;
use crate::line::{BenchOf, Line};
use stepdrive_host::Error;
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg, Register};
use stepdrive_spec::smsd::status::MotStatus;

fn readable<L: Line>(bench: &BenchOf<L>) -> impl Iterator<Item = &'static Register> {
    REGISTERS.iter().filter(|row| bench.client.check_readable(row.id).is_ok())
}

fn holding() -> impl Iterator<Item = &'static Register> {
    REGISTERS.iter().filter(|row| row.access == Access::ReadWrite)
}

pub(crate) async fn every_register_that_can_be_read_reads_as_what_the_controller_says<L: Line>() {
    for bench in L::kinds() {
        let bench = turning::<L>(bench).await;
        for row in readable::<L>(&bench).filter(|row| L::compares(row.id)) {
            for index in 0..row.count {
                let read = bench.client.read_at(row.id, index).await;
                assert_eq!(read, Ok(bench.look(row.id, index)), "{} {index}", row.name);
            }
            let whole: Vec<i64> = (0..row.count).map(|index| bench.look(row.id, index)).collect();
            assert_eq!(bench.client.read_row(row.id).await, Ok(whole), "{}", row.name);
        }
        assert!(bench.look(Reg::AbsPos, 0) < -1000, "it turns");
    }
}

pub(crate) async fn what_cannot_be_read_or_tells_nothing_says_why<L: Line>() {
    let bench = L::fresh();
    let mut count = 0;
    for row in REGISTERS {
        let Err(why) = bench.client.check_readable(row.id) else { continue };
        count += 1;
        assert_eq!(why.exit_code(), 1);
    }
    assert_eq!(count, L::UNREADABLE);
    assert!(bench.attempts().is_empty());
}

pub(crate) async fn many_registers_are_read_in_few_requests_and_told_in_the_order_asked<L: Line>() {
    for bench in L::kinds() {
        let bench = turning::<L>(bench).await;
        for (regs, requests) in L::READS {
            bench.requests();
            let values = bench.client.read_many(regs).await.expect("logged in");
            assert_eq!(bench.requests(), *requests, "{regs:?}");
            let expected: Vec<i64> = regs.iter().map(|reg| bench.look(*reg, 0)).collect();
            assert_eq!(values, expected, "{regs:?}");
        }
        assert_eq!(bench.client.read_many(&[]).await, Ok(Vec::new()));
        assert_eq!(bench.requests(), 0);
    }
}

pub(crate) async fn the_whole_map_is_read_in_few_requests<L: Line>() {
    let bench = turning::<L>(L::fresh()).await;
    bench.requests();
    let readings = bench.client.read_all().await.expect("logged in");
    assert_eq!(bench.requests(), L::WHOLE_MAP);
    let told = |row: &&Register| row.id == Reg::AccessFlag || L::compares(row.id);
    let expected: usize = readable::<L>(&bench).filter(told).map(|row| usize::from(row.count)).sum();
    assert_eq!(readings.len(), expected);
    for reading in readings.into_iter().filter(|reading| L::compares(reading.reg)) {
        assert_eq!(reading.value, bench.look(reading.reg, reading.index), "{reading:?}");
    }
}

pub(crate) async fn every_register_that_holds_a_value_takes_its_lowest_and_highest<L: Line>() {
    for bench in L::kinds() {
        for row in holding().filter(|row| L::takes_value(row.id)) {
            let (min, max) = row.range(Model::Smsd42);
            let last = row.count - 1;
            for value in [min, max] {
                assert_eq!(bench.client.write_at(row.id, last, value).await, Ok(()), "{} {value}", row.name);
                assert_eq!(L::holds(&bench, row.id, last), value, "{}", row.name);
            }
        }
    }
}

pub(crate) async fn a_value_out_of_range_is_told_and_nothing_is_sent<L: Line>() {
    let bench = L::fresh();
    for row in holding().filter(|row| !L::ASKED_FOR_RANGE.contains(&row.id)) {
        let (min, _) = row.range(Model::Smsd42);
        let (_, max) = row.range(Model::Smsd80);
        for value in [min - 1, max + 1, i64::MIN, i64::MAX] {
            let error = bench.client.write(row.id, value).await.expect_err("out of range");
            assert!(matches!(&error, Error::Usage(text) if text.contains(&value.to_string())), "{error}");
            assert_eq!(error.exit_code(), 1);
        }
    }
    assert_eq!(
        text(bench.client.write(Reg::MaxSpeed, 20_000).await),
        "MAX_SPEED 20000 is out of range: 16 to 15600 full steps/s; nothing was sent"
    );
    assert_eq!(text(bench.client.write(Reg::AbsPos, 0).await), "ABS_POS can only be read; nothing was sent");
    assert!(bench.attempts().is_empty());
}

pub(crate) async fn a_range_that_depends_on_the_model_is_that_of_the_model<L: Line>() {
    for (model, most) in [(Model::Smsd42, 42), (Model::Smsd80, 80)] {
        let bench = L::with(model, SmsdOptions::default());
        assert_eq!(bench.client.write(Reg::WorkCurrent, most).await, Ok(()));
        let told = text(bench.client.write(Reg::WorkCurrent, most + 1).await);
        assert!(told.contains(&format!("1 to {most} × 0.1 A on the {model}")), "{told}");
    }
}

pub(crate) async fn many_values_are_checked_together_and_written_in_few_requests<L: Line>() {
    let bench = L::ready().await;
    bench.requests();
    let parameters =
        [(Reg::Dec, 600), (Reg::Acc, 500), (Reg::MaxSpeed, 400), (Reg::MinSpeed, 30), (Reg::Mask, 7)];
    bench.client.write_many(&parameters).await.expect("in range");
    assert_eq!(bench.requests(), L::FIVE_WRITES);
    for (reg, value) in parameters {
        assert_eq!(bench.look(reg, 0), value);
    }
    let told = text(bench.client.write_many(&[(Reg::MinSpeed, 1), (Reg::Acc, 3)]).await);
    assert_eq!(told, "ACC 3 is out of range: 15 to 59000 full steps/s²; nothing was sent");
    assert_eq!(bench.look(Reg::MinSpeed, 0), 30);
    let told = text(bench.client.write_many(&[(Reg::MinSpeed, 1), (Reg::Cmd, 0x1F)]).await);
    assert_eq!(told, "CMD acts and is written alone; nothing was sent");
}

pub(crate) async fn few_requests_tell_what_the_motor_does<L: Line>() {
    let bench = turning::<L>(L::fresh()).await;
    bench.requests();
    let snapshot = bench.client.snapshot().await.expect("logged in");
    assert_eq!(bench.requests(), L::SNAPSHOT);
    assert_eq!(i64::from(snapshot.position), bench.look(Reg::AbsPos, 0));
    assert_eq!(i64::from(snapshot.speed), bench.look(Reg::Speed, 0));
    assert_eq!(i64::from(snapshot.el_pos), bench.look(Reg::ElPos, 0));
    assert_eq!(i64::from(snapshot.status.word()), bench.look(Reg::StatusWord, 0));
    assert!(snapshot.input(Input::In1) && !snapshot.input(Input::In0));
    assert!(snapshot.is_moving() && snapshot.status.motion == MotStatus::ConstantSpeed);
    let position = snapshot.position;
    assert_eq!(
        snapshot.to_string(),
        format!("the motor turns backward at 300 full steps/s, position {position} microsteps, READY 1")
    );
}

pub(crate) async fn few_requests_tell_the_whole_state<L: Line>() {
    let bench = turning::<L>(L::fresh()).await;
    bench.requests();
    let state = bench.client.state().await.expect("logged in");
    assert_eq!(bench.requests(), L::STATE);
    assert!(state.relay);
    assert_eq!(state.program.running, L::TELLS_WHETHER_A_PROGRAM_RUNS.then_some(false));
    assert_eq!((state.program.area, state.program.line, state.program.autonomous), (0, 0, 0));
}

pub(crate) async fn a_register_written_by_hand_may_act_as_well<L: Line>() {
    let bench = L::ready().await;
    bench.client.write(Reg::TargetSpeed, 200).await.expect("in range");
    bench.client.write(Reg::Cmd, Opcode::RunF.code().into()).await.expect("a command");
    bench.client.write(Reg::HardStop, 1).await.expect("a coil");
    assert_eq!(bench.acts(), [L::command(Opcode::RunF), L::coil(Reg::HardStop)]);
}
