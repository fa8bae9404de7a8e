//! User programs in the memory areas.

use crate::common::link::Fault;
use crate::common::station::{MS, text, timed};
use crate::modbus_bench::Bench;
use crate::suite::{program, words};
use stepdrive_host::Error;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smsd::registers::Reg;

#[tokio::test(start_paused = true)]
async fn the_end_of_each_procedure_is_waited_for() {
    let bench = Bench::ready().await;
    let (stored, took) = timed(bench.client.store_program(0, &program(255))).await;
    stored.expect("stored");
    // Erase, 8 blocks, size; size, 8 blocks: 2 ms each.
    assert!((36 * MS..200 * MS).contains(&took), "{took:?}");
    let procedures = bench.acts();
    assert_eq!(procedures.len(), 19);
    assert!(procedures.iter().all(|(reg, _)| *reg == Reg::MemCmd));
}

#[tokio::test(start_paused = true)]
async fn a_procedure_whose_reply_is_lost_is_known_by_its_flag_and_not_repeated() {
    for fault in [Fault::LoseReply, Fault::Break(3), Fault::Delay(1200 * MS)] {
        let bench = Bench::ready().await;
        // Area, flag, MEM_CMD.
        bench.faults([Fault::None, Fault::None, fault]);
        let program = program(10);
        bench.client.store_program(1, &program).await.expect("stored all the same");
        assert_eq!(bench.held(1), words(&program));
        let erased = bench.acts().iter().filter(|(_, code)| *code == 2).count();
        assert_eq!(erased, 1);
    }
}

#[tokio::test(start_paused = true)]
async fn a_procedure_that_never_arrived_is_uncertain() {
    let bench = Bench::ready().await;
    bench.faults([Fault::None, Fault::None, Fault::LoseRequest]);
    let told = text(bench.client.erase_program(1).await);
    assert!(told.starts_with("MEM_CMD 2 (erasing the program) was sent, but its reply was lost ("), "{told}");
    assert!(told.ends_with("B_COMPLETE stays FALSE, so it has not ended, if it was begun"), "{told}");
    assert!(bench.acts().is_empty());
}

#[tokio::test(start_paused = true)]
async fn a_store_that_breaks_off_says_how_far_it_came() {
    let bench = Bench::ready().await;
    // Area; flag, erase, looked once, flag; then sector, buffer, flag, write, looked, flag for the first block.
    bench.faults(std::iter::repeat_n(Fault::None, 5 + 6));
    bench.otherwise(Fault::LoseReply);
    let error = bench.client.store_program(1, &program(100)).await.expect_err("the line is dead");
    assert!(matches!(error, Error::Partly { .. }), "{error}");
    assert!(
        error.to_string().ends_with("; memory 1 was erased and 32 of 100 instructions were written to it"),
        "{error}"
    );
    assert_eq!(error.exit_code(), 5);
}

#[tokio::test(start_paused = true)]
async fn what_reads_back_otherwise_is_told() {
    let bench = Bench::ready().await;
    let program = program(3);
    let store = bench.client.store_program_with(0, &program, |count| {
        if count == 3 {
            // Somebody else has been at the memory.
            bench.change(meddle);
        }
    });
    let error = store.await.expect_err("another program");
    assert_eq!(error.to_string(), "line 0 of memory 0 reads 0x00000000, not 0xFBBA4100 as stored");
    assert_eq!(error.exit_code(), 10);
}

/// Erases line 0 of memory 0, by way of the registers.
fn meddle(drive: &mut stepdrive_drive::smsd::Smsd, now: stepdrive_spec::time::Instant) {
    use stepdrive_spec::modbus::Request;
    let mut session = stepdrive_drive::smsd::Session::new();
    let writes: [(u16, &[u16]); 4] = [
        (0x2100, &[0xCDEF, 0x89AB, 0x4567, 0x0123, 0]),
        (0x3100, &[0, 0]),
        (0x3180, &[0, 0, 1]),
        (0x3184, &[1]),
    ];
    for (address, values) in writes {
        let values = values.iter().copied().collect();
        drive.handle(now, &mut session, &Request::WriteRegisters { address, values }).expect("taken");
    }
    let done = drive.next_wake().expect("a procedure is at work").0;
    drive.handle_wake(done);
}

#[tokio::test(start_paused = true)]
async fn a_stop_is_not_held_up_by_a_program_being_stored() {
    let bench = Bench::ready().await;
    let program = program(255);
    let (store, stop) = (bench.client.store_program(0, &program), async {
        tokio::time::sleep(10 * MS).await;
        timed(bench.client.soft_stop()).await
    });
    let (stored, (stopped, took)) = tokio::join!(store, stop);
    assert_eq!((stored, stopped), (Ok(()), Ok(())));
    assert!(took < MS, "{took:?}");
}
