//! User programs in the memory areas.

use crate::bench::{Bench, MS, SECOND, text, timed};
use crate::link::Fault;
use stepdrive_host::Error;
use stepdrive_host::smsd::{Smsd, SmsdOptions, WordOrder};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

fn line(opcode: Opcode, operand: i32) -> Instruction {
    Instruction::with_position(opcode, operand)
}

/// A program of so many instructions, each another.
fn program(lines: i32) -> Vec<Instruction> {
    (0..lines).map(|number| line(Opcode::MoveF, number * 1001 - 70_000)).collect()
}

/// The instruction words that the controller holds.
fn held(bench: &Bench, area: usize) -> Vec<u32> {
    bench.change(|drive, _| {
        let area = drive.memory().area(area);
        area.words()[..usize::from(area.size())].to_vec()
    })
}

fn words(program: &[Instruction]) -> Vec<u32> {
    program.iter().map(|line| line.word()).collect()
}

#[tokio::test(start_paused = true)]
async fn programs_of_every_length_are_stored_verified_and_fetched() {
    for order in WordOrder::ALL {
        let bench = Bench::of(order, SmsdOptions::default());
        for (lines, area) in
            [0, 1, 31, 32, 33, 64, 254, 255].into_iter().zip([0, 1, 2, 3].into_iter().cycle())
        {
            let program = program(lines);
            bench.client.store_program(area, &program).await.expect("stored");
            assert_eq!(held(&bench, area.into()), words(&program));
            assert_eq!(bench.client.fetch_program(area).await, Ok(program), "{lines} lines");
            assert_eq!(bench.look(Reg::BComplete, 0), 0, "cleared as ch. 5 says");
        }
    }
}

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
async fn progress_is_told_to_twice_the_length() {
    let bench = Bench::ready().await;
    let mut told = Vec::new();
    bench.client.store_program_with(2, &program(70), |count| told.push(count)).await.expect("stored");
    assert_eq!(told, [32, 64, 70, 102, 134, 140]);
}

#[tokio::test(start_paused = true)]
async fn a_program_is_erased_started_and_stopped() {
    let bench = Bench::ready().await;
    bench
        .client
        .store_program(3, &[line(Opcode::SetWait, 3_600_000), line(Opcode::End, 0)])
        .await
        .expect("stored");
    bench.client.start_program(3).await.expect("a command");
    tokio::time::sleep(SECOND).await;
    let state = bench.client.program().await.expect("logged in");
    assert!(state.running == Some(true) && state.area == 3 && state.line == 0, "{state:?}");
    let error = bench.client.erase_program(3).await.expect_err("it runs");
    assert_eq!(
        error.to_string(),
        "stage (unit 1) refused MEM_CMD 2 (Modbus exception 06 (server device busy)): a procedure of MEM_CMD is at work, \
         or the program in that memory area is running; wait, or stop the program"
    );
    assert_eq!(error.exit_code(), 7);
    bench.client.stop_program().await.expect("always taken");
    assert_eq!(bench.client.program().await.expect("logged in").running, Some(false));
    bench.client.erase_program(3).await.expect("it is stopped");
    assert_eq!(bench.client.fetch_program(3).await, Ok(Vec::new()));
}

#[tokio::test(start_paused = true)]
async fn what_cannot_be_stored_is_told_and_nothing_is_sent() {
    let bench = Bench::new();
    assert_eq!(
        text(bench.client.store_program(4, &[]).await),
        "there is no memory 4; they are numbered 0 to 3; nothing was sent"
    );
    assert!(text(bench.client.store_program(0, &program(256)).await).contains("256 instructions"));
    assert!(text(bench.client.start_program(9).await).contains("no memory 9"));
    assert_eq!(bench.requests(), 0);
}

#[tokio::test(start_paused = true)]
async fn a_procedure_whose_reply_is_lost_is_known_by_its_flag_and_not_repeated() {
    for fault in [Fault::LoseReply, Fault::Cut(3), Fault::Delay(1200 * MS)] {
        let bench = Bench::ready().await;
        // Area, flag, MEM_CMD.
        bench.faults([Fault::None, Fault::None, fault]);
        let program = program(10);
        bench.client.store_program(1, &program).await.expect("stored all the same");
        assert_eq!(held(&bench, 1), words(&program));
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

#[tokio::test(start_paused = true)]
async fn two_stores_at_once_do_not_mix() {
    let bench = Bench::ready().await;
    let (first, second) = (program(200), program(100));
    let outcome = tokio::join!(bench.client.store_program(0, &first), bench.client.store_program(1, &second));
    assert_eq!(outcome, (Ok(()), Ok(())));
    assert_eq!((held(&bench, 0), held(&bench, 1)), (words(&first), words(&second)));
}
