//! Commands and coils that act.

use crate::bench::{Bench, MS, SECOND, text};
use crate::link::Fault;
use stepdrive_host::smsd::{Smsd, Way};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Opcode, Operand};
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg};

#[tokio::test(start_paused = true)]
async fn every_command_of_the_table_is_carried_out_once() {
    for info in INSTRUCTIONS.iter().filter(|info| info.in_cmd) {
        let bench = Bench::ready().await;
        let operand = match info.operand {
            Operand::Number { .. } => Some(100),
            Operand::Position => Some(1600),
            Operand::Input => Some(1),
            Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => None,
        };
        assert_eq!(bench.client.command(info.opcode, operand).await, Ok(()), "{}", info.name);
        assert_eq!(bench.acts(), [(Reg::Cmd, info.code.into())]);
        assert_eq!(bench.look(Reg::Cmd, 0), i64::from(info.code));
        assert_eq!(bench.look(Reg::CmdError, 0), 0, "{}", info.name);
    }
}

#[tokio::test(start_paused = true)]
async fn instructions_for_programs_are_no_commands() {
    let bench = Bench::new();
    for info in INSTRUCTIONS.iter().filter(|info| !info.in_cmd) {
        let error = bench.client.command(info.opcode, None).await.expect_err("not in ch. 4.2");
        assert!(matches!(error, Error::Usage(_)), "{error}");
    }
    assert_eq!(bench.requests(), 0);
}

#[tokio::test(start_paused = true)]
async fn every_coil_that_acts_does_so_once() {
    let bench = Bench::ready().await;
    for row in REGISTERS.iter().filter(|row| row.access == Access::Trigger) {
        assert_eq!(bench.client.trigger(row.id).await, Ok(()), "{}", row.name);
        assert_eq!(bench.acts(), [(row.id, 1)]);
    }
    assert_eq!(text(bench.client.trigger(Reg::Relay).await), "Relay is no coil that acts; nothing was sent");
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
    assert_eq!(bench.look(Reg::AbsPos, 0), -16);
    bench.client.go_zero().await.expect("ready");
    tokio::time::sleep(SECOND).await;
    assert_eq!(bench.look(Reg::AbsPos, 0), 0);
}

#[tokio::test(start_paused = true)]
async fn typed_commands_are_the_codes_of_their_names() {
    let bench = Bench::ready().await;
    let client = &bench.client;
    let (plus, minus) = (Direction::Positive, Direction::Negative);
    let _ = client.run(plus, 100).await;
    let _ = client.run(minus, 100).await;
    let _ = client.go_until(plus, Input::In0).await;
    let _ = client.go_until(minus, Input::Continue).await;
    assert_eq!(bench.look(Reg::TargetInput, 0), 7);
    let _ = client.scan_zero(plus, 90).await;
    let _ = client.scan_zero(minus, 91).await;
    let _ = client.scan_mark(plus, 92).await;
    let _ = client.scan_mark(minus, 93).await;
    let _ = client.scan_mark_braking(plus, 94).await;
    let _ = client.scan_mark_braking(minus, 95).await;
    assert_eq!(bench.look(Reg::TargetSpeed, 0), 95);
    client.hard_stop().await.expect("always taken");
    let _ = client.go_mark().await;
    client.hard_stop().await.expect("always taken");
    let _ = client.move_to(5, Way::Forward).await;
    let commands: Vec<u16> =
        bench.acts().into_iter().filter(|(reg, _)| *reg == Reg::Cmd).map(|(_, code)| code).collect();
    let names = [
        Opcode::RunF,
        Opcode::RunR,
        Opcode::GoUntilF,
        Opcode::GoUntilR,
        Opcode::ScanZeroF,
        Opcode::ScanZeroR,
        Opcode::ScanMarkF,
        Opcode::ScanMarkR,
        Opcode::ScanMark2F,
        Opcode::ScanMark2R,
        Opcode::GoMark,
        Opcode::GoToF,
    ];
    assert_eq!(commands, names.map(|opcode| u16::from(opcode.code())));
}

#[tokio::test(start_paused = true)]
async fn the_four_stops_are_one_request_each() {
    let bench = Bench::ready().await;
    bench.client.run(Direction::Positive, 500).await.expect("ready");
    bench.requests();
    bench.client.soft_stop().await.expect("always taken");
    bench.client.hard_stop().await.expect("always taken");
    bench.client.soft_hi_z().await.expect("always taken");
    bench.client.hard_hi_z().await.expect("always taken");
    assert_eq!(bench.requests(), 4);
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
            "MOVE_F was refused by stage (unit 1) (CMD_ERROR is set): the motor turns forward at 500 full steps/s"
        ),
        "{told}"
    );
    assert_eq!(error.exit_code(), 7);
    let error = bench.client.run(Direction::Negative, 100).await.expect_err("the flag is still set");
    assert!(
        error
            .to_string()
            .starts_with("CMD_ERROR is set by an earlier command, so a refusal of RUN_R could not")
    );
    assert_eq!(error.exit_code(), 8);
    bench.client.soft_stop().await.expect("a stop is sent whatever is set");
    bench.client.clear_flags().await.expect("a coil");
    tokio::time::sleep(2 * SECOND).await;
    bench.client.move_by(100).await.expect("standing again");
}

#[tokio::test(start_paused = true)]
async fn a_lost_reply_to_a_command_is_uncertain_and_the_state_is_told() {
    let bench = Bench::ready().await;
    for fault in [Fault::LoseReply, Fault::LoseRequest] {
        // Flags, operand, command.
        bench.faults([Fault::None, Fault::None, fault.clone()]);
        let arrived = fault == Fault::LoseReply;
        let error = bench.client.run(Direction::Positive, 500).await.expect_err("no reply");
        let told = error.to_string();
        assert!(told.starts_with(
            "RUN_F was sent, but its reply was lost (stage (unit 1) did not answer within 1s); it was not sent again: "
        ));
        let state = if arrived {
            "the last command it took is RUN_F; the motor turns forward at 500 full steps/s"
        } else {
            "the last command it took is SOFT_STOP; the motor stands, energised"
        };
        assert!(told.contains(state), "{told}");
        assert_eq!(error.exit_code(), 5);
        assert_eq!(bench.acts().len(), usize::from(arrived));
        bench.client.command(Opcode::SoftStop, None).await.expect("always taken");
        tokio::time::sleep(2 * SECOND).await;
        bench.acts();
    }
}

#[tokio::test(start_paused = true)]
async fn what_follows_a_lost_command_is_asked_behind_it_on_the_same_connection() {
    let bench = Bench::ready().await;
    bench.attempts();
    bench.faults([Fault::Delay(1500 * MS)]);
    let error = bench.client.soft_hi_z().await.expect_err("late");
    assert!(matches!(error, Error::Uncertain { .. }), "{error}");
    assert_eq!(bench.acts(), [(Reg::SoftHiZ, 1)]);
    assert!(bench.attempts().is_empty());
}

#[tokio::test(start_paused = true)]
async fn a_command_whose_connection_goes_is_uncertain_whichever_way() {
    let cuts = (0..12).map(Fault::Cut);
    for fault in
        cuts.chain([Fault::Close, Fault::WrongTransaction, Fault::WrongUnit, Fault::Garbage(vec![0; 7])])
    {
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
    assert!(state.starts_with("its state could not be read (stage (unit 1) did not answer"), "{state}");
    assert_eq!(bench.acts(), [(Reg::SoftStop, 1)]);
}

#[tokio::test(start_paused = true)]
async fn a_connection_that_was_closed_while_idle_is_noticed_before_a_command_is_sent() {
    let bench = Bench::ready().await;
    bench.cut();
    tokio::time::sleep(MS).await;
    bench.client.soft_stop().await.expect("sent on a new connection");
    assert_eq!(bench.acts(), [(Reg::SoftStop, 1)]);
    assert_eq!(bench.attempts().len(), 2);
}
