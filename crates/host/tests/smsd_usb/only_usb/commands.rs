//! Commands, coils that act, and instructions.

use crate::common::link::Fault;
use crate::common::station::{MS, Protocol, SECOND, text};
use crate::standard_bench::{Act, Bench, Setup};
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Instruction, Opcode, Operand};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Answer, COUNTERS, Code, Counter, Reply, code_of};
use stepdrive_spec::smsd::status::Status;

#[tokio::test(start_paused = true)]
async fn a_command_that_arrives_damaged_is_sent_again_and_carried_out_once() {
    let bench = Bench::ready().await;
    // The checksum, an operand, the stop byte too early: the number is still its own.
    for (place, mask) in [(1, 1), (8, 0x40), (9, 0xFB)] {
        bench.faults([Fault::None, Fault::DamageRequest(place, mask)]);
        bench.client.run(Direction::Positive, 500).await.expect("the second arrived");
        assert_eq!(bench.acts(), [Act::Instruction(Opcode::RunF)], "{place}");
    }
    bench.otherwise(Fault::DamageRequest(1, 1));
    let error = bench.client.soft_stop().await.expect_err("none arrived");
    assert_eq!(
        error.to_string(),
        "stage answered with what cannot be understood: ERROR_XOR: what was sent to it arrived damaged"
    );
    assert_eq!((error.exit_code(), bench.acts()), (5, Vec::new()));
}

#[tokio::test(start_paused = true)]
async fn an_answer_that_may_be_to_something_before_is_no_reason_to_send_a_command_again() {
    let setup = Setup { options: SmsdOptions { tries: 1, ..SmsdOptions::default() }, ..Setup::default() };
    let bench = Bench::ready_as(&setup).await;
    bench.faults([Fault::LoseRequest]);
    assert!(bench.client.read(Reg::Speed).await.is_err());
    // As if the read had been damaged on its way so that it bore the number of the stop, and were answered late.
    let answer = Answer { status: Status::from_word(0x13), code: Code::ErrorXor, data: 0 };
    let late = (1..=u8::MAX).flat_map(|id| bench.station.protocol.wire(&(id, Reply::Response(answer))));
    bench.faults([Fault::NoiseFirst(late.collect())]);
    let error = bench.client.soft_stop().await.expect_err("whose answer is it?");
    assert!(matches!(error, Error::Uncertain { .. }), "{error}");
    tokio::time::sleep(10 * SECOND).await;
    assert_eq!(bench.acts(), [Act::Instruction(Opcode::SoftStop)]);
}

#[tokio::test(start_paused = true)]
async fn either_type_of_reply_is_taken() {
    let bench = Bench::ready().await;
    bench.otherwise(Fault::OtherType);
    bench.client.run(Direction::Positive, 500).await.expect("ready");
    tokio::time::sleep(SECOND).await;
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(500));
    assert_eq!(bench.client.write(Reg::MaxSpeed, 800).await, Ok(()));
    bench.cut();
    assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(800));
}

#[tokio::test(start_paused = true)]
async fn any_instruction_can_be_sent() {
    let bench = Bench::ready().await;
    for info in INSTRUCTIONS.iter().filter(|info| !matches!(info.opcode, Opcode::StopUsb)) {
        let data = match info.operand {
            Operand::Number { min, .. } => min,
            Operand::Mode => MotorConfiguration::FACTORY.data(),
            Operand::None
            | Operand::Position
            | Operand::Mask
            | Operand::Input
            | Operand::Jump
            | Operand::Loop => 0,
        };
        let instruction = Instruction { opcode: info.opcode, data };
        match bench.client.instruct(instruction).await {
            Ok(answer) => assert_eq!(answer.code, code_of(info.opcode), "{}", info.name),
            Err(error) => assert_eq!((info.opcode, error.exit_code()), (Opcode::ReturnProgram, 7), "{error}"),
        }
    }
    let error = bench.client.instruct(Instruction { opcode: Opcode::RunF, data: 3 }).await;
    assert_eq!(
        text(error),
        "stage refused to carry out RUN_F (ERROR_RANGE: a value is out of its range); nothing was changed"
    );
}

#[tokio::test(start_paused = true)]
async fn a_port_that_was_stopped_answers_again_when_it_is_opened_anew() {
    let bench = Bench::ready().await;
    bench.client.instruct(Instruction { opcode: Opcode::StopUsb, data: 0 }).await.expect("answered");
    tokio::time::sleep(10 * MS).await;
    assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "after two silences it is opened anew");
    assert_eq!(bench.attempts().len(), 2);
}

#[tokio::test(start_paused = true)]
async fn the_counters_of_errors_are_read() {
    let bench = Bench::ready().await;
    let before = bench.client.error_counters().await.expect("logged in");
    assert_eq!(before, [0; COUNTERS]);
    bench.client.run(Direction::Positive, 500).await.expect("ready");
    assert!(bench.client.move_by(5).await.is_err());
    let after = bench.client.error_counters().await.expect("logged in");
    assert_eq!(after[Counter::Starts as usize], 1);
    assert_eq!(after[Counter::CommandPowerstep01 as usize], 1);
}
