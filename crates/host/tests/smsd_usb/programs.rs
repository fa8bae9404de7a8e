//! User programs in the memory areas.

use crate::bench::{Act, Bench, MS, SECOND, Setup, text, timed};
use crate::link::Fault;
use stepdrive_host::Error;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, PROGRAM_LINES};
use stepdrive_spec::smsd::standard::{Code, Request, Words};

fn line(opcode: Opcode, operand: i32) -> Instruction {
    Instruction::with_position(opcode, operand)
}

/// A program of so many instructions, each another. Their words have all bytes that are stuffed among them.
fn program(lines: i32) -> Vec<Instruction> {
    (0..lines).map(|number| line(Opcode::MoveF, number * 1001 - 70_000)).collect()
}

fn words(program: &[Instruction]) -> Vec<u32> {
    program.iter().map(|line| line.word()).collect()
}

#[tokio::test(start_paused = true)]
async fn programs_of_every_length_are_stored_verified_and_fetched() {
    for setup in [Setup::default(), Setup::raw()] {
        let bench = Bench::ready_as(&setup).await;
        for (lines, area) in [0, 1, 32, 254, 255].into_iter().zip([0, 1, 2, 3].into_iter().cycle()) {
            let program = program(lines);
            bench.requests();
            bench.client.store_program(area, &program).await.expect("stored");
            assert_eq!(bench.requests(), 2, "one writes it, one reads it back");
            assert_eq!(bench.held(area), words(&program));
            assert_eq!(bench.client.fetch_program(area).await, Ok(program), "{lines} lines");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn progress_is_told_to_twice_the_length() {
    let bench = Bench::ready().await;
    let mut told = Vec::new();
    bench.client.store_program_with(2, &program(70), &mut |count| told.push(count)).await.expect("stored");
    bench.client.fetch_program_with(2, &mut |count| told.push(count)).await.expect("fetched");
    assert_eq!(told, [70, 140, 70]);
}

#[tokio::test(start_paused = true)]
async fn a_program_that_runs_is_neither_replaced_nor_erased() {
    let bench = Bench::ready().await;
    let pause = [line(Opcode::SetWait, 3_600_000), line(Opcode::End, 0)];
    bench.client.store_program(3, &pause).await.expect("stored");
    bench.client.start_program(3).await.expect("a command");
    tokio::time::sleep(SECOND).await;
    let state = bench.client.program().await.expect("logged in");
    assert_eq!((state.running, state.area, state.line), (None, 3, 0));
    let error = bench.client.erase_program(3).await.expect_err("it runs");
    assert_eq!(
        error.to_string(),
        "stage refused to write the program to memory 3 (ERROR_WRITE: the memory cannot be written now); the program in \
         that memory area is running, or a procedure of MEM_CMD is at work: stop the program, or wait; nothing was changed"
    );
    assert_eq!(error.exit_code(), 7);
    assert_eq!(bench.held(3), words(&pause));
    bench.client.stop_program().await.expect("always taken");
    bench.client.erase_program(3).await.expect("it is stopped");
    assert_eq!(bench.client.fetch_program(3).await, Ok(Vec::new()));
    assert_eq!(bench.acts(), [Opcode::StartProgramMem3, Opcode::StopProgramMem].map(Act::Instruction));
}

#[tokio::test(start_paused = true)]
async fn what_cannot_be_stored_is_told_and_nothing_is_sent() {
    let bench = Bench::new();
    assert_eq!(
        text(bench.client.store_program(4, &[]).await),
        "there is no memory 4; they are numbered 0 to 3; nothing was sent"
    );
    assert!(text(bench.client.store_program(0, &program(256)).await).contains("256 instructions"));
    assert!(text(bench.client.fetch_program(4).await).contains("no memory 4"));
    assert!(bench.attempts().is_empty());
}

#[tokio::test(start_paused = true)]
async fn a_program_arrives_whole_through_every_trouble_with_one_packet() {
    let faults = [
        Fault::LoseRequest,
        Fault::LoseReply,
        Fault::CutRequest(100),
        Fault::DamageRequest(77, 0x10),
        Fault::Delay(1200 * MS),
        Fault::Break(3),
        Fault::Close,
    ];
    for fault in faults {
        for lost in 0..2 {
            let bench = Bench::ready().await;
            bench.faults(std::iter::repeat_n(Fault::None, lost).chain([fault.clone()]));
            let program = program(200);
            bench.client.store_program(1, &program).await.expect("stored all the same");
            assert_eq!(bench.held(1), words(&program), "{fault:?} at {lost}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_store_that_is_never_answered_says_how_far_it_came() {
    let bench = Bench::ready().await;
    bench.otherwise(Fault::LoseReply);
    let error = bench.client.store_program(1, &program(100)).await.expect_err("the line is dead");
    assert!(error.to_string().ends_with("; whether the program is in memory 1 is not known"), "{error}");
    assert_eq!(bench.held(1).len(), 100);
    let bench = Bench::ready().await;
    bench.faults([Fault::None]);
    bench.otherwise(Fault::LoseReply);
    let error = bench.client.store_program(1, &program(100)).await.expect_err("the line is dead");
    assert!(matches!(error, Error::Partly { .. }), "{error}");
    assert!(error.to_string().ends_with("the program was written to memory 1, but not read back"), "{error}");
    assert_eq!(error.exit_code(), 5);
}

#[tokio::test(start_paused = true)]
async fn what_reads_back_otherwise_is_told() {
    let bench = Bench::ready().await;
    let program = program(3);
    let meddle = |count| {
        if count == 3 {
            // Somebody else has been at the memory.
            bench.change(|drive, now| {
                let mut session = bench.station.session();
                let password = drive.memory().password;
                let write = Request::WriteMemory { area: 0, words: Words::from_iter([0]) };
                let later = now + SECOND;
                drive.handle_standard(later, &mut session, Ok(&Request::Authorise(password)));
                drive.handle_standard(later, &mut session, Ok(&write));
            });
        }
    };
    let error = bench.client.store_program_with(0, &program, &mut { meddle }).await.expect_err("another");
    assert_eq!(error.to_string(), "memory 0 has 1 instructions, not the 3 stored");
    assert_eq!(error.exit_code(), 10);
}

#[tokio::test(start_paused = true)]
async fn a_memory_that_cannot_be_read_is_told() {
    let bench = Bench::ready().await;
    bench.faults([Fault::Refuse(Code::ErrorRead)]);
    let error = bench.client.fetch_program(2).await.expect_err("refused");
    assert_eq!(error.to_string(), "stage refused to read memory 2 (ERROR_READ: the memory cannot be read)");
}

#[tokio::test(start_paused = true)]
async fn a_stop_between_two_packets_of_a_store_is_not_held_up() {
    let bench = Bench::ready().await;
    let program = program(255);
    bench.faults([Fault::None, Fault::Delay(500 * MS)]);
    let stop = async {
        tokio::time::sleep(10 * MS).await;
        timed(bench.client.soft_stop()).await
    };
    let (stored, (stopped, took)) = tokio::join!(bench.client.store_program(0, &program), stop);
    assert_eq!((stored, stopped), (Ok(()), Ok(())));
    assert!(took <= 500 * MS, "one reply is waited for: {took:?}");
}

#[tokio::test(start_paused = true)]
async fn two_stores_at_once_do_not_mix() {
    let bench = Bench::ready().await;
    let (first, second) = (program(200), program(100));
    let outcome = tokio::join!(bench.client.store_program(0, &first), bench.client.store_program(0, &second));
    assert_eq!(outcome, (Ok(()), Ok(())));
    assert_eq!(bench.held(0), words(&second));
    assert!(bench.held(0).len() < PROGRAM_LINES);
}
