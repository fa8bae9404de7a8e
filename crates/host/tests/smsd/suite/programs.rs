//! User programs in the memory areas.

use super::{line, program, words};
use crate::common::link::Fault;
use crate::common::station::{MS, SECOND, text};
use crate::line::Line;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

pub(crate) async fn programs_of_every_length_are_stored_verified_and_fetched<L: Line>() {
    for bench in L::kinds() {
        for (lines, area) in [0, 1, 31, 32, 33, 64, 254, 255].into_iter().zip((0..4).cycle()) {
            let program = program(lines);
            bench.client.store_program(area, &program).await.expect("stored");
            assert_eq!(bench.held(area), words(&program));
            assert_eq!(bench.client.fetch_program(area).await, Ok(program), "{lines} lines");
            assert_eq!(bench.look(Reg::BComplete, 0), 0, "cleared as ch. 5 says");
        }
    }
}

pub(crate) async fn progress_is_told_to_twice_the_length<L: Line>() {
    let bench = L::ready().await;
    let program = program(70);
    let mut told = Vec::new();
    bench.client.store_program_with(2, &program, &mut |count| told.push(count)).await.expect("stored");
    bench.client.fetch_program_with(2, &mut |count| told.push(count)).await.expect("fetched");
    let once = (1..=70_usize.div_ceil(L::BLOCK)).map(|blocks| 70.min(blocks * L::BLOCK));
    let expected: Vec<usize> = once.clone().chain(once.clone().map(|count| 70 + count)).chain(once).collect();
    assert_eq!(told, expected);
}

pub(crate) async fn a_program_that_runs_is_neither_replaced_nor_erased<L: Line>() {
    let bench = L::ready().await;
    let pause = [line(Opcode::SetWait, 3_600_000), line(Opcode::End, 0)];
    bench.client.store_program(3, &pause).await.expect("stored");
    bench.client.start_program(3).await.expect("a command");
    tokio::time::sleep(SECOND).await;
    let running = |runs| L::TELLS_WHETHER_A_PROGRAM_RUNS.then_some(runs);
    let state = bench.client.program().await.expect("logged in");
    assert_eq!((state.running, state.area, state.line), (running(true), 3, 0));
    let error = bench.client.erase_program(3).await.expect_err("it runs");
    assert_eq!(error.to_string(), format!("{} {}", L::CONTROLLER, L::PROGRAM_RUNS));
    assert_eq!(error.exit_code(), 7);
    assert_eq!(bench.held(3), words(&pause));
    bench.client.stop_program().await.expect("always taken");
    assert_eq!(bench.client.program().await.expect("logged in").running, running(false));
    bench.client.erase_program(3).await.expect("it is stopped");
    assert_eq!(bench.client.fetch_program(3).await, Ok(Vec::new()));
    assert_eq!(L::acts(&bench), [Opcode::StartProgramMem3, Opcode::StopProgramMem].map(L::command));
}

pub(crate) async fn what_cannot_be_stored_is_told_and_nothing_is_sent<L: Line>() {
    let bench = L::fresh();
    assert_eq!(
        text(bench.client.store_program(4, &[]).await),
        "there is no memory 4; they are numbered 0 to 3; nothing was sent"
    );
    assert!(text(bench.client.store_program(0, &program(256)).await).contains("256 instructions"));
    assert!(text(bench.client.fetch_program(4).await).contains("no memory 4"));
    assert!(text(bench.client.start_program(9).await).contains("no memory 9"));
    assert!(bench.attempts().is_empty());
}

pub(crate) async fn a_program_arrives_whole_through_every_trouble_with_one_request<L: Line>() {
    let mut faults =
        vec![Fault::LoseRequest, Fault::LoseReply, Fault::Delay(1200 * MS), Fault::Break(3), Fault::Close];
    if L::SERIAL {
        faults.extend([Fault::CutRequest(100), Fault::DamageRequest(77, 0x10)]);
    }
    for fault in faults {
        for lost in 0..2 {
            let bench = L::ready().await;
            bench.fault_behind(lost, fault.clone());
            let program = program(200);
            bench.client.store_program(1, &program).await.expect("stored all the same");
            assert_eq!(bench.held(1), words(&program), "{fault:?} at {lost}");
        }
    }
}

pub(crate) async fn two_stores_at_once_do_not_mix<L: Line>() {
    let bench = L::ready().await;
    let (first, second) = (program(200), program(100));
    let outcome = tokio::join!(bench.client.store_program(0, &first), bench.client.store_program(1, &second));
    assert_eq!(outcome, (Ok(()), Ok(())));
    assert_eq!((bench.held(0), bench.held(1)), (words(&first), words(&second)));
    let outcome = tokio::join!(bench.client.store_program(2, &first), bench.client.store_program(2, &second));
    assert_eq!(outcome, (Ok(()), Ok(())));
    assert_eq!(bench.held(2), words(&second));
}
