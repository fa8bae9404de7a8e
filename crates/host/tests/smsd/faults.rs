//! Trouble on the line.

use crate::bench::{Bench, MS, SECOND, text, timed};
use crate::link::Fault;
use std::time::Duration;
use stepdrive_host::smsd::{Smsd, SmsdOptions, WordOrder};
use stepdrive_host::{Error, LineError};
use stepdrive_rig::machine::Machine;
use stepdrive_spec::smsd::registers::Reg;

/// Everything that a line may do to one reply and that leaves it readable at the next try.
fn troubles() -> Vec<Fault> {
    let mut faults = vec![
        Fault::LoseRequest,
        Fault::LoseReply,
        Fault::Delay(500 * MS),
        Fault::Delay(1500 * MS),
        Fault::Delay(5 * SECOND),
        Fault::Postpone,
        Fault::Twice,
        Fault::StaleFirst,
        Fault::WrongTransaction,
        Fault::WrongUnit,
        Fault::ForeignFirst,
        Fault::Close,
        Fault::Garbage(vec![0; 300]),
        Fault::Garbage(b"HTTP/1.1 400 Bad Request\r\n\r\n".to_vec()),
        Fault::Garbage(vec![0, 0, 0, 0, 0, 1]),
    ];
    faults.extend((0..12).map(Fault::Cut));
    faults.extend((0..12).map(|place| Fault::Halves(place, 20 * MS)));
    faults.extend((0..12).map(|place| Fault::Halves(place, 3 * SECOND)));
    faults
}

#[tokio::test(start_paused = true)]
async fn a_read_survives_every_trouble_with_one_reply() {
    for fault in troubles() {
        let bench = Bench::ready().await;
        bench.client.write_many(&[(Reg::MaxSpeed, 777), (Reg::MinSpeed, 33)]).await.expect("in range");
        bench.faults([fault.clone()]);
        let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
        assert_eq!(read, Ok(777), "{fault:?}");
        assert!(took <= 3100 * MS, "{fault:?} took {took:?}");
        for _ in 0..5 {
            assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33), "after {fault:?}");
            assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(777), "after {fault:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_write_survives_every_trouble_with_one_reply() {
    for fault in troubles() {
        let bench = Bench::ready().await;
        bench.faults([fault.clone()]);
        assert_eq!(bench.client.write(Reg::TargetPos, -77_777).await, Ok(()), "{fault:?}");
        assert_eq!(bench.look(Reg::TargetPos, 0), -77_777, "{fault:?}");
        assert_eq!(bench.client.read(Reg::TargetPos).await, Ok(-77_777), "after {fault:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_late_reply_is_not_taken_for_the_next_one() {
    let bench = Bench::of(WordOrder::LowFirst, SmsdOptions { tries: 1, ..SmsdOptions::default() });
    bench.client.write_many(&[(Reg::MaxSpeed, 777), (Reg::MinSpeed, 33)]).await.expect("in range");
    for late in [1001, 1500, 1999] {
        bench.faults([Fault::Delay(late * MS)]);
        let told = text(bench.client.read(Reg::MaxSpeed).await);
        assert_eq!(told, "stage (unit 1) did not answer within 1s");
        assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33), "both are single registers");
    }
    assert_eq!(bench.attempts().len(), 1, "the connection was good all along");
    bench.faults([Fault::Postpone]);
    assert!(bench.client.read(Reg::MaxSpeed).await.is_err());
    assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33));
}

#[tokio::test(start_paused = true)]
async fn a_controller_that_never_answers_is_given_up_in_time() {
    let bench = Bench::ready().await;
    bench.otherwise(Fault::LoseReply);
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert!(matches!(read, Err(Error::Line(LineError::Silent { .. }))), "{read:?}");
    assert_eq!(took, 3 * SECOND);
    let (written, took) = timed(bench.client.write(Reg::MaxSpeed, 20)).await;
    let told = text(written);
    assert!(took < 4 * SECOND, "{took:?}");
    assert!(told.starts_with("stage (unit 1) did not answer within 1s"), "{told}");
    bench.heal();
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

#[tokio::test(start_paused = true)]
async fn a_write_that_is_never_answered_says_that_nobody_knows() {
    let bench = Bench::of(WordOrder::LowFirst, SmsdOptions { tries: 2, ..SmsdOptions::default() });
    bench.client.log_in().await.expect("the factory's password");
    bench.otherwise(Fault::LoseReply);
    assert_eq!(
        text(bench.client.write(Reg::MaxSpeed, 20).await),
        "stage (unit 1) did not answer within 1s; whether MAX_SPEED 20 was written is not known"
    );
    assert_eq!(bench.look(Reg::MaxSpeed, 0), 20);
}

#[tokio::test(start_paused = true)]
async fn garbage_closes_the_connection_and_is_told_when_it_does_not_end() {
    let bench = Bench::ready().await;
    bench.attempts();
    bench.faults([Fault::Garbage(vec![0xAA; 40])]);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    assert_eq!(bench.attempts().len(), 1);
    bench.otherwise(Fault::Garbage(vec![0xAA; 40]));
    let told = text(bench.client.read(Reg::Speed).await);
    assert_eq!(told, "stage answered with what cannot be understood: a frame whose length field is 43690");
}

#[tokio::test(start_paused = true)]
async fn stale_frames_without_end_do_not_keep_a_request_for_ever() {
    let bench = Bench::ready().await;
    let stale: Vec<u8> = [0xF0, 0, 0, 0, 0, 5, 1, 4, 2, 0, 0].repeat(200);
    bench.otherwise(Fault::Garbage(stale));
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert!(matches!(read, Err(Error::Line(LineError::Silent { .. }))), "{read:?}");
    assert_eq!(took, 3 * SECOND);
}

#[tokio::test(start_paused = true)]
async fn an_exception_of_another_function_is_garbage_and_not_an_answer() {
    let bench = Bench::ready().await;
    // Transaction 4 is the next: an exception to function 3, where function 4 was asked.
    bench.faults([Fault::Garbage(vec![0, 4, 0, 0, 0, 3, 1, 0x83, 2])]);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    assert_eq!(bench.attempts().len(), 2);
}

#[tokio::test(start_paused = true)]
async fn power_that_goes_and_comes_back_is_followed() {
    let bench = Bench::ready().await;
    bench.client.write(Reg::MaxSpeed, 500).await.expect("in range");
    bench.machine(Machine::switch_off);
    bench.cut();
    bench.refuse_connections(4);
    assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::Line(LineError::Connect { .. }))));
    tokio::time::sleep(Duration::from_secs(30)).await;
    bench.machine(Machine::switch_on);
    assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "as at power-up");
}

#[tokio::test(start_paused = true)]
async fn many_tasks_share_one_client_through_trouble() {
    let bench = Bench::ready().await;
    let rounds = troubles().into_iter().flat_map(|fault| [Fault::None, Fault::None, fault]);
    bench.faults(rounds);
    let read = |reg: Reg, value: i64| {
        let client = &bench.client;
        async move {
            for _ in 0..25 {
                if let Ok(found) = client.read(reg).await {
                    assert_eq!(found, value);
                }
            }
        }
    };
    tokio::join!(
        read(Reg::MaxSpeed, 1000),
        read(Reg::FsSpeed, 15_600),
        read(Reg::LanPort, 502),
        read(Reg::Mask, 255)
    );
}
