//! Commands and coils that act.

use crate::common::link::Fault;
use crate::common::station::{MS, SECOND, text};
use crate::line::Line;
use stepdrive_host::smsd::{Smsd, Way};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Opcode, Operand};
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg};

pub(crate) async fn every_command_of_the_table_is_carried_out_once<L: Line>() {
    for info in INSTRUCTIONS.iter().filter(|info| info.in_cmd) {
        let bench = L::ready().await;
        let operand = match info.operand {
            Operand::Number { .. } => Some(100),
            Operand::Position => Some(1600),
            Operand::Input => Some(1),
            Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => None,
        };
        assert_eq!(bench.client.command(info.opcode, operand).await, Ok(()), "{}", info.name);
        assert_eq!(bench.acts(), [L::command(info.opcode)]);
        L::check_shown(&bench, Reg::Cmd, info.code.into());
        assert_eq!(bench.look(Reg::CmdError, 0), 0, "{}", info.name);
    }
}

pub(crate) async fn what_is_no_command_or_out_of_range_is_not_sent<L: Line>() {
    let bench = L::fresh();
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

pub(crate) async fn every_coil_that_acts_does_so_once<L: Line>() {
    let bench = L::ready().await;
    for row in REGISTERS.iter().filter(|row| row.access == Access::Trigger) {
        assert_eq!(bench.client.trigger(row.id).await, Ok(()), "{}", row.name);
        // Over the standard protocol that one is written as it is read.
        if row.id != Reg::ApplyNetworkConfiguration {
            assert_eq!(bench.acts(), [L::coil(row.id)]);
        }
    }
    assert_eq!(text(bench.client.trigger(Reg::Relay).await), "Relay is no coil that acts; nothing was sent");
}

pub(crate) async fn a_move_ends_where_it_was_to_go<L: Line>() {
    let bench = L::ready().await;
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
    assert_eq!((bench.look(Reg::AbsPos, 0), bench.client.read(Reg::AbsPos).await), (-16, Ok(-16)));
    bench.client.go_zero().await.expect("ready");
    tokio::time::sleep(SECOND).await;
    assert_eq!(bench.look(Reg::AbsPos, 0), 0);
}

pub(crate) async fn typed_commands_are_the_codes_of_their_names<L: Line>() {
    let bench = L::ready().await;
    let client = &bench.client;
    let (plus, minus) = (Direction::Positive, Direction::Negative);
    let _ = client.run(plus, 100).await;
    let _ = client.run(minus, 100).await;
    let _ = client.go_until(plus, Input::In0).await;
    let _ = client.go_until(minus, Input::Continue).await;
    L::check_shown(&bench, Reg::TargetInput, 7);
    let _ = client.scan_zero(plus, 90).await;
    let _ = client.scan_zero(minus, 91).await;
    let _ = client.scan_mark(plus, 92).await;
    let _ = client.scan_mark(minus, 93).await;
    let _ = client.scan_mark_braking(plus, 94).await;
    let _ = client.scan_mark_braking(minus, 95).await;
    L::check_shown(&bench, Reg::TargetSpeed, 95);
    client.hard_stop().await.expect("always taken");
    let _ = client.go_mark().await;
    client.hard_stop().await.expect("always taken");
    let _ = client.move_to(5, Way::Forward).await;
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
    let stop = L::coil(Reg::HardStop);
    let commands: Vec<_> = bench.acts().into_iter().filter(|act| *act != stop).collect();
    assert_eq!(commands, names.map(L::command));
}

pub(crate) async fn the_four_stops_are_one_request_each<L: Line>() {
    let bench = L::ready().await;
    bench.requests();
    bench.client.run(Direction::Positive, 500).await.expect("ready");
    assert_eq!(bench.requests(), L::COMMAND);
    bench.client.soft_stop().await.expect("always taken");
    bench.client.hard_stop().await.expect("always taken");
    bench.client.soft_hi_z().await.expect("always taken");
    bench.client.hard_hi_z().await.expect("always taken");
    assert_eq!(bench.requests(), 4);
    assert_eq!(bench.look(Reg::HiZ, 0), 1);
    bench.client.stop_program().await.expect("always taken");
    assert_eq!(bench.requests(), L::STOP_PROGRAM);
}

pub(crate) async fn a_command_that_cannot_be_carried_out_says_why<L: Line>() {
    let bench = L::ready().await;
    bench.client.run(Direction::Positive, 500).await.expect("ready");
    tokio::time::sleep(SECOND).await;
    let error = bench.client.move_by(100).await.expect_err("the motor turns");
    let told = error.to_string();
    let start = format!(
        "MOVE_F was refused by {} (CMD_ERROR is set): the motor turns forward at 500 full steps/s",
        L::CONTROLLER
    );
    assert!(told.starts_with(&start), "{told}");
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

pub(crate) async fn a_lost_reply_to_a_command_is_uncertain_and_the_state_is_told<L: Line>() {
    let bench = L::ready().await;
    for fault in [Fault::LoseReply, Fault::LoseRequest] {
        bench.fault_behind(L::BEFORE_COMMAND, fault.clone());
        let arrived = fault == Fault::LoseReply;
        let error = bench.client.run(Direction::Positive, 500).await.expect_err("no reply");
        let told = error.to_string();
        let start = format!(
            "RUN_F was sent, but its reply was lost ({} did not answer within 1s); it was not sent again: ",
            L::CONTROLLER
        );
        assert!(told.starts_with(&start), "{told}");
        let state = if arrived {
            L::state_behind(Opcode::RunF, "the motor turns forward at 500 full steps/s")
        } else {
            L::state_behind(Opcode::SoftStop, "the motor stands, energised")
        };
        assert!(told.contains(&state) && !told.contains("may still arrive"), "{told}");
        assert_eq!(error.exit_code(), 5);
        assert_eq!(bench.acts().len(), usize::from(arrived));
        bench.client.command(Opcode::SoftStop, None).await.expect("always taken");
        tokio::time::sleep(2 * SECOND).await;
        bench.acts();
    }
}

pub(crate) async fn what_follows_a_lost_command_is_asked_behind_it_on_the_same_connection<L: Line>() {
    let bench = L::ready().await;
    bench.attempts();
    bench.faults([Fault::Delay(1500 * MS)]);
    let error = bench.client.soft_hi_z().await.expect_err("late");
    assert!(matches!(error, Error::Uncertain { .. }), "{error}");
    assert_eq!(bench.acts(), [L::coil(Reg::SoftHiZ)]);
    assert!(bench.attempts().is_empty());
}

pub(crate) async fn a_command_whose_connection_goes_is_uncertain_whichever_way<L: Line>() {
    let breaks = (0..12).map(Fault::Break);
    let others = [Fault::Close, Fault::WrongNumber, Fault::Garbage(vec![0; 7])];
    for fault in breaks.chain(others).chain(L::NO_REPLY.iter().cloned()) {
        let bench = L::ready().await;
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

pub(crate) async fn a_state_that_cannot_be_read_is_not_made_up<L: Line>() {
    let bench = L::ready().await;
    bench.otherwise(Fault::LoseReply);
    let error = bench.client.soft_stop().await.expect_err("no reply to anything");
    let Error::Uncertain { state, .. } = &error else { panic!("{error}") };
    let start = format!("its state could not be read ({} did not answer", L::CONTROLLER);
    assert!(state.starts_with(&start), "{state}");
    assert_eq!(bench.acts(), [L::coil(Reg::SoftStop)]);
}

pub(crate) async fn a_connection_that_was_closed_while_idle_is_noticed_before_a_command_is_sent<L: Line>() {
    let bench = L::ready().await;
    bench.cut();
    tokio::time::sleep(MS).await;
    bench.client.soft_stop().await.expect("sent on a new connection");
    assert_eq!(bench.acts(), [L::coil(Reg::SoftStop)]);
    assert_eq!(bench.attempts().len(), 2);
}
