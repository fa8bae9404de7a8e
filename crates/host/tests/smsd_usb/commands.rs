//! Commands, coils that act, and instructions.

use crate::bench::{Act, Bench, MS, SECOND, Setup, text};
use crate::link::Fault;
use stepdrive_host::smsd::{Smsd, SmsdOptions, Way};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Instruction, Opcode, Operand};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Answer, COUNTERS, Code, Counter, Reply, code_of};
use stepdrive_spec::smsd::status::Status;

#[tokio::test(start_paused = true)]
async fn every_command_of_the_table_is_carried_out_once() {
    for setup in [Setup::default(), Setup::raw()] {
        for info in INSTRUCTIONS.iter().filter(|info| info.in_cmd) {
            let bench = Bench::ready_as(&setup).await;
            let operand = match info.operand {
                Operand::Number { .. } => Some(100),
                Operand::Position => Some(1600),
                Operand::Input => Some(1),
                Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => None,
            };
            assert_eq!(bench.client.command(info.opcode, operand).await, Ok(()), "{}", info.name);
            assert_eq!(bench.acts(), [Act::Instruction(info.opcode)]);
            assert_eq!(bench.look(Reg::CmdError, 0), 0, "{}", info.name);
        }
    }
}

#[tokio::test(start_paused = true)]
async fn what_is_no_command_or_out_of_range_is_not_sent() {
    let bench = Bench::new();
    for info in INSTRUCTIONS.iter().filter(|info| !info.in_cmd) {
        let error = bench.client.command(info.opcode, None).await.expect_err("not in ch. 4.2");
        assert!(matches!(error, Error::Usage(_)), "{error}");
    }
    assert_eq!(
        text(bench.client.run(Direction::Positive, 15_601).await),
        "RUN_F 15601 is out of range: 15 to 15600 full steps/s; nothing was sent"
    );
    assert!(bench.attempts().is_empty());
}

#[tokio::test(start_paused = true)]
async fn a_move_ends_where_it_was_to_go() {
    let bench = Bench::ready().await;
    bench.client.move_to(3200, Way::Shortest).await.expect("ready");
    let under_way = bench.client.snapshot().await.expect("logged in");
    assert!(under_way.is_moving() && !under_way.status.ready);
    tokio::time::sleep(5 * SECOND).await;
    assert_eq!(bench.look(Reg::AbsPos, 0), 3200);
    bench.client.move_by(-200).await.expect("standing");
    tokio::time::sleep(5 * SECOND).await;
    assert_eq!(bench.look(Reg::AbsPos, 0), 3000);
    bench.client.reset_position().await.expect("a coil");
    bench.client.move_to(-16, Way::Reverse).await.expect("ready");
    tokio::time::sleep(SECOND).await;
    assert_eq!(bench.client.read(Reg::AbsPos).await, Ok(-16));
}

#[tokio::test(start_paused = true)]
async fn a_command_takes_two_requests_and_a_stop_one() {
    let bench = Bench::ready().await;
    bench.requests();
    bench.client.run(Direction::Positive, 500).await.expect("ready");
    assert_eq!(bench.requests(), 2);
    bench.client.soft_stop().await.expect("always taken");
    bench.client.hard_stop().await.expect("always taken");
    bench.client.soft_hi_z().await.expect("always taken");
    bench.client.hard_hi_z().await.expect("always taken");
    bench.client.stop_program().await.expect("always taken");
    assert_eq!(bench.requests(), 5);
    assert_eq!(bench.look(Reg::HiZ, 0), 1);
}

#[tokio::test(start_paused = true)]
async fn a_command_that_cannot_be_carried_out_says_why() {
    let bench = Bench::ready().await;
    bench.client.run(Direction::Positive, 500).await.expect("ready");
    tokio::time::sleep(SECOND).await;
    let error = bench.client.move_by(100).await.expect_err("the motor turns");
    let told = error.to_string();
    assert!(
        told.starts_with(
            "MOVE_F was refused by stage (CMD_ERROR is set): the motor turns forward at 500 full steps/s"
        ),
        "{told}"
    );
    assert_eq!(error.exit_code(), 7);
    bench.requests();
    let error = bench.client.run(Direction::Negative, 100).await.expect_err("the flag is still set");
    assert!(
        error
            .to_string()
            .starts_with("CMD_ERROR is set by an earlier command, so a refusal of RUN_R could not")
    );
    assert_eq!((error.exit_code(), bench.requests()), (8, 1));
    bench.client.soft_stop().await.expect("a stop is sent whatever is set");
    bench.client.clear_flags().await.expect("a coil");
    tokio::time::sleep(2 * SECOND).await;
    bench.client.move_by(100).await.expect("standing again");
}

#[tokio::test(start_paused = true)]
async fn a_lost_reply_to_a_command_is_uncertain_and_the_state_is_told() {
    for setup in [Setup::default(), Setup::raw()] {
        let bench = Bench::ready_as(&setup).await;
        for fault in [Fault::LoseReply, Fault::LoseRequest] {
            // Flags, command.
            bench.faults([Fault::None, fault.clone()]);
            let arrived = fault == Fault::LoseReply;
            let error = bench.client.run(Direction::Positive, 500).await.expect_err("no reply");
            let told = error.to_string();
            assert!(
                told.starts_with(
                    "RUN_F was sent, but its reply was lost (stage did not answer within 1s); it was not sent again: "
                ),
                "{told}"
            );
            let state =
                if arrived { "the motor turns forward at 500 full steps/s" } else { "the motor stands" };
            assert!(told.contains(state) && !told.contains("may still arrive"), "{told}");
            assert_eq!(error.exit_code(), 5);
            assert_eq!(bench.acts().len(), usize::from(arrived));
            bench.client.command(Opcode::SoftStop, None).await.expect("always taken");
            tokio::time::sleep(2 * SECOND).await;
            bench.acts();
        }
    }
}

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
    let late = (1..=u8::MAX).flat_map(|id| bench.station.encoded(id, &Reply::Response(answer)));
    bench.faults([Fault::NoiseFirst(late.collect())]);
    let error = bench.client.soft_stop().await.expect_err("whose answer is it?");
    assert!(matches!(error, Error::Uncertain { .. }), "{error}");
    tokio::time::sleep(10 * SECOND).await;
    assert_eq!(bench.acts(), [Act::Instruction(Opcode::SoftStop)]);
}

#[tokio::test(start_paused = true)]
async fn a_command_whose_connection_goes_is_uncertain_whichever_way() {
    let breaks = (0..12).map(Fault::Break);
    for fault in breaks.chain([Fault::Close, Fault::WrongNumber, Fault::Garbage(vec![0; 7])]) {
        let bench = Bench::ready().await;
        let arrives = fault != Fault::Close;
        bench.faults([fault.clone()]);
        let error = bench.client.hard_stop().await.expect_err("no reply");
        let Error::Uncertain { command, state, .. } = &error else { panic!("{fault:?}: {error}") };
        assert_eq!(command, "Hard STOP");
        let energised = if arrives { "energised" } else { "de-energised" };
        assert!(state.starts_with(&format!("the motor stands, {energised}")), "{fault:?}: {state}");
        assert_eq!(bench.acts().len(), usize::from(arrives), "{fault:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_state_that_cannot_be_read_is_not_made_up() {
    let bench = Bench::ready().await;
    bench.otherwise(Fault::LoseReply);
    let error = bench.client.soft_stop().await.expect_err("no reply to anything");
    let Error::Uncertain { state, .. } = &error else { panic!("{error}") };
    assert!(state.starts_with("its state could not be read (stage did not answer"), "{state}");
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
