//! User programs in the memory areas.

use crate::common::link::Fault;
use crate::common::station::{MS, Protocol, SECOND, timed};
use crate::standard_bench::{Bench, Setup};
use crate::suite::program;
use stepdrive_host::Error;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smsd::standard::{Code, Request, Words};

#[tokio::test(start_paused = true)]
async fn a_program_of_any_length_takes_two_requests() {
    for setup in [Setup::default(), Setup::raw()] {
        let bench = Bench::ready_as(&setup).await;
        for lines in [0, 1, 32, 254, 255] {
            bench.requests();
            bench.client.store_program(0, &program(lines)).await.expect("stored");
            assert_eq!(bench.requests(), 2, "one writes it, one reads it back");
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
                let mut session = bench.station.protocol.session().session;
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
