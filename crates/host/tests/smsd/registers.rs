//! Typed access to the register map.

use crate::bench::{Bench, MS, text};
use crate::link::Fault;
use stepdrive_drive::smsd::Memory;
use stepdrive_host::Error;
use stepdrive_host::smsd::{Smsd, SmsdOptions, WordOrder};
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg, Register};
use stepdrive_spec::smsd::status::MotStatus;

/// A controller with something in every corner of it, turning.
async fn turning(order: WordOrder) -> Bench {
    let bench = Bench::of(order, SmsdOptions::default());
    bench.client.log_in().await.expect("the factory's password");
    bench
        .client
        .write_many(&[(Reg::MaxSpeed, 700), (Reg::TargetPos, -2_000_000), (Reg::TargetInput, 5)])
        .await
        .expect("in range");
    for (index, value) in (0..32).zip([0x1234_5678, 0xFFFF_FFFF, 0, 0x8000_0001].into_iter().cycle()) {
        bench.client.write_at(Reg::CmdBuffer, index, value).await.expect("a buffer takes any words");
    }
    bench.client.set_relay(true).await.expect("a relay");
    bench.change(|drive, now| drive.set_input(now, Input::In1, true));
    bench.client.run(stepdrive_host::Direction::Negative, 300).await.expect("ready");
    tokio::time::sleep(1234 * MS).await;
    bench
}

fn told() -> impl Iterator<Item = &'static Register> {
    REGISTERS.iter().filter(|row| matches!(row.access, Access::Read | Access::ReadWrite))
}

/// What a register reads as to somebody who is logged in.
fn shown(bench: &Bench, reg: Reg, index: u16) -> i64 {
    bench.look(reg, index)
}

#[tokio::test(start_paused = true)]
async fn every_register_reads_as_what_the_controller_says() {
    for order in WordOrder::ALL {
        let bench = turning(order).await;
        for row in told() {
            for index in 0..row.count {
                let read = bench.client.read_at(row.id, index).await;
                assert_eq!(read, Ok(shown(&bench, row.id, index)), "{} {index}, {order}", row.name);
            }
            let whole: Vec<i64> = (0..row.count).map(|index| shown(&bench, row.id, index)).collect();
            assert_eq!(bench.client.read_row(row.id).await, Ok(whole), "{}", row.name);
        }
        assert!(bench.look(Reg::AbsPos, 0) < -1000, "it turns");
    }
}

#[tokio::test(start_paused = true)]
async fn the_whole_map_takes_a_request_for_each_range_without_gaps() {
    let bench = turning(WordOrder::LowFirst).await;
    bench.requests();
    let readings = bench.client.read_all().await.expect("logged in");
    assert_eq!(bench.requests(), 13);
    let expected: usize = told().map(|row| usize::from(row.count)).sum();
    assert_eq!(readings.len(), expected);
    for reading in readings {
        assert_eq!(reading.value, shown(&bench, reading.reg, reading.index), "{reading:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn many_registers_are_read_in_few_requests_and_told_in_the_order_asked() {
    let bench = turning(WordOrder::HighFirst).await;
    bench.requests();
    let regs = [Reg::MaxSpeed, Reg::AbsPos, Reg::MinSpeed, Reg::Speed, Reg::MaxSpeed];
    let values = bench.client.read_many(&regs).await.expect("logged in");
    assert_eq!(bench.requests(), 2);
    let expected: Vec<i64> = regs.iter().map(|reg| shown(&bench, *reg, 0)).collect();
    assert_eq!(values, expected);
    assert_eq!(bench.client.read_many(&[]).await, Ok(Vec::new()));
}

#[tokio::test(start_paused = true)]
async fn every_holding_register_takes_its_lowest_and_highest_value() {
    for order in WordOrder::ALL {
        let bench = Bench::of(order, SmsdOptions::default());
        let holds = told().filter(|row| row.access == Access::ReadWrite);
        for row in holds.filter(|row| ![Reg::Cmd, Reg::MemCmd, Reg::BComplete, Reg::Wait].contains(&row.id)) {
            let (min, max) = row.range(Model::Smsd42);
            for value in [min, max] {
                let last = row.count - 1;
                assert_eq!(bench.client.write_at(row.id, last, value).await, Ok(()), "{} {value}", row.name);
                assert_eq!(shown(&bench, row.id, last), value, "{}", row.name);
            }
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_value_out_of_range_is_told_and_nothing_is_sent() {
    let bench = Bench::ready().await;
    bench.requests();
    for row in told().filter(|row| {
        row.access == Access::ReadWrite && row.id != Reg::WorkCurrent && row.id != Reg::MotorType
    }) {
        let (min, max) = row.range(Model::Smsd42);
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
    assert_eq!(bench.requests(), 0);
}

#[tokio::test(start_paused = true)]
async fn a_range_that_depends_on_the_model_is_that_of_the_model() {
    for (model, most) in [(Model::Smsd42, 42), (Model::Smsd80, 80)] {
        let bench = Bench::with(model, WordOrder::LowFirst, Memory::factory(), SmsdOptions::default());
        assert_eq!(bench.client.write(Reg::WorkCurrent, most).await, Ok(()));
        let told = text(bench.client.write(Reg::WorkCurrent, most + 1).await);
        assert!(told.contains(&format!("1 to {most} × 0.1 A on the {model}")), "{told}");
    }
}

#[tokio::test(start_paused = true)]
async fn many_values_are_checked_together_and_written_in_few_requests() {
    let bench = Bench::ready().await;
    bench.requests();
    let parameters =
        [(Reg::Dec, 600), (Reg::Acc, 500), (Reg::MaxSpeed, 400), (Reg::MinSpeed, 30), (Reg::Mask, 7)];
    bench.client.write_many(&parameters).await.expect("in range");
    assert_eq!(bench.requests(), 2);
    for (reg, value) in parameters {
        assert_eq!(shown(&bench, reg, 0), value);
    }
    let told = text(bench.client.write_many(&[(Reg::MinSpeed, 1), (Reg::Acc, 3)]).await);
    assert_eq!(told, "ACC 3 is out of range: 15 to 59000 full steps/s²; nothing was sent");
    assert_eq!(shown(&bench, Reg::MinSpeed, 0), 30);
    let told = text(bench.client.write_many(&[(Reg::MinSpeed, 1), (Reg::Cmd, 0x1F)]).await);
    assert_eq!(told, "CMD acts and is written alone; nothing was sent");
}

#[tokio::test(start_paused = true)]
async fn what_the_motor_forbids_is_refused_in_words() {
    let bench = turning(WordOrder::LowFirst).await;
    let error = bench.client.write(Reg::Acc, 99).await.expect_err("turning");
    assert_eq!(
        error.to_string(),
        "stage (unit 1) refused ACC 99 (Modbus exception 06 (server device busy)): \
         the motor is turning; stop it first; nothing was changed"
    );
    assert_eq!(error.exit_code(), 7);
    let told = text(bench.client.write(Reg::Microstepping, 7).await);
    assert!(told.ends_with(
        "the motor is energised; de-energise it first (Soft HiZ or Hard HiZ); nothing was changed"
    ));
    assert_eq!(bench.client.write(Reg::MaxSpeed, 650).await, Ok(()), "any time");
}

#[tokio::test(start_paused = true)]
async fn exceptions_are_told_by_register_and_value() {
    let bench = Bench::ready().await;
    let cases = [
        (
            Exception::IllegalFunction,
            "stage (unit 1) does not know how to write MAX_SPEED 500 (Modbus exception 01",
            2,
        ),
        (
            Exception::IllegalDataAddress,
            "stage (unit 1) does not let one write MAX_SPEED 500 at HR 1101 (",
            2,
        ),
        (Exception::IllegalDataValue, "stage (unit 1) refused MAX_SPEED 500 as out of range (", 7),
        (
            Exception::ServerDeviceFailure,
            "stage (unit 1) failed to write MAX_SPEED 500 (Modbus exception 04",
            2,
        ),
        (Exception::ServerDeviceBusy, "stage (unit 1) refused MAX_SPEED 500 (", 7),
        (Exception::Other(11), "stage (unit 1) refused to write MAX_SPEED 500: Modbus exception 0B", 2),
    ];
    for (exception, start, code) in cases {
        bench.faults([Fault::Except(exception)]);
        let error = bench.client.write(Reg::MaxSpeed, 500).await.expect_err("an exception");
        assert!(error.to_string().starts_with(start), "{error}");
        assert_eq!(error.exit_code(), code, "{error}");
    }
    bench.faults([Fault::Except(Exception::IllegalDataValue)]);
    let told = text(bench.client.write(Reg::MaxSpeed, 500).await);
    assert!(told.ends_with("; it takes 16 to 15600 full steps/s; nothing was changed"), "{told}");
    bench.faults([Fault::Except(Exception::ServerDeviceFailure)]);
    let told = text(bench.client.read_row(Reg::LanIp).await);
    assert!(told.starts_with("stage (unit 1) failed to read IP 0 to IP 3 ("), "{told}");
    assert!(told.ends_with("); try again"), "{told}");
    bench.faults([Fault::Except(Exception::ServerDeviceBusy)]);
    let error = bench.client.read(Reg::Acc).await.expect_err("an exception");
    assert_eq!(
        error.to_string(),
        "stage (unit 1) refused to read ACC (Modbus exception 06 (server device busy)): it is busy; try again"
    );
    assert_eq!(error.exit_code(), 2, "no interlock stands against being read");
    bench.faults([Fault::Except(Exception::IllegalDataValue)]);
    let told = text(bench.client.write(Reg::PasswordLow32, 0x1234_5678).await);
    assert!(!told.contains("305419896") && told.contains("Password_LOW32"), "{told}");
}

#[tokio::test(start_paused = true)]
async fn one_request_tells_what_the_motor_does() {
    let bench = turning(WordOrder::LowFirst).await;
    bench.requests();
    let snapshot = bench.client.snapshot().await.expect("logged in");
    assert_eq!(bench.requests(), 1);
    assert_eq!(i64::from(snapshot.position), bench.look(Reg::AbsPos, 0));
    assert_eq!(i64::from(snapshot.speed), bench.look(Reg::Speed, 0));
    assert_eq!(i64::from(snapshot.el_pos), bench.look(Reg::ElPos, 0));
    assert_eq!(i64::from(snapshot.status.word()), bench.look(Reg::StatusWord, 0));
    assert!(snapshot.input(Input::In1) && !snapshot.input(Input::In0));
    assert!(snapshot.is_moving() && snapshot.status.motion == MotStatus::ConstantSpeed);
    let text = snapshot.to_string();
    let position = snapshot.position;
    assert_eq!(
        text,
        format!("the motor turns backward at 300 full steps/s, position {position} microsteps, READY 1")
    );
}

#[tokio::test(start_paused = true)]
async fn the_whole_state_takes_four_requests() {
    let bench = turning(WordOrder::LowFirst).await;
    bench.requests();
    let state = bench.client.state().await.expect("logged in");
    assert_eq!(bench.requests(), 4);
    assert!(state.relay && state.program.running == Some(false));
    assert_eq!((state.program.area, state.program.line, state.program.autonomous), (0, 0, 0));
}

#[tokio::test(start_paused = true)]
async fn a_register_written_by_hand_may_act_as_well() {
    let bench = Bench::ready().await;
    bench.client.write(Reg::TargetSpeed, 200).await.expect("in range");
    bench.client.write(Reg::Cmd, Opcode::RunF.code().into()).await.expect("a command");
    bench.client.write(Reg::HardStop, 1).await.expect("a coil");
    assert_eq!(bench.acts(), [(Reg::Cmd, 0x0E), (Reg::HardStop, 1)]);
}
