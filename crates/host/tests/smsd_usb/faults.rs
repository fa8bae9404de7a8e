//! Trouble on the line.

use crate::bench::{Bench, MS, SECOND, Setup, text, timed};
use crate::link::Fault;
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_host::{Error, LineError, Timeouts};
use stepdrive_spec::smsd::registers::Reg;

/// Everything that any line may do to one request, and that leaves it readable at the next try.
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
        Fault::WrongNumber,
        Fault::OtherType,
        Fault::Close,
        Fault::Garbage(vec![0; 300]),
        Fault::Garbage(b"HTTP/1.1 400 Bad Request\r\n\r\n".to_vec()),
        Fault::Garbage(vec![0xFF; 2000]),
    ];
    faults.extend((0..14).map(Fault::Break));
    faults.extend((0..14).map(|place| Fault::Halves(place, 20 * MS)));
    faults.extend((0..14).map(|place| Fault::Halves(place, 3 * SECOND)));
    faults
}

/// What a serial line may do besides.
fn serial_troubles() -> Vec<Fault> {
    let mut faults = troubles();
    faults.extend((0..12).map(Fault::CutRequest));
    faults.extend((0..15).map(Fault::CutReply));
    for mask in [1, 0x80, 0xFF] {
        faults.extend((0..12).map(|place| Fault::DamageRequest(place, mask)));
        faults.extend((0..15).map(|place| Fault::DamageReply(place, mask)));
    }
    faults.push(Fault::NoiseFirst(b"booting\r\n\xFA\x01\x02".to_vec()));
    faults.push(Fault::NoiseFirst(vec![0xFA, 0xFB, 0xFE, 0xFE, 0xFA]));
    faults
}

#[tokio::test(start_paused = true)]
async fn a_read_survives_every_trouble_with_one_packet() {
    for (setup, faults) in [(Setup::default(), serial_troubles()), (Setup::raw(), troubles())] {
        for fault in faults {
            let bench = Bench::ready_as(&setup).await;
            bench.client.write_many(&[(Reg::MaxSpeed, 777), (Reg::MinSpeed, 33)]).await.expect("in range");
            bench.faults([fault.clone()]);
            let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
            assert_eq!(read, Ok(777), "{fault:?}");
            assert!(took <= 4 * SECOND, "{fault:?} took {took:?}");
            for _ in 0..5 {
                assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33), "after {fault:?}");
                assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(777), "after {fault:?}");
            }
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_write_survives_every_trouble_with_one_packet() {
    for (setup, faults) in [(Setup::default(), serial_troubles()), (Setup::raw(), troubles())] {
        for fault in faults {
            let bench = Bench::ready_as(&setup).await;
            bench.faults([fault.clone()]);
            assert_eq!(bench.client.write(Reg::MaxSpeed, 12_345).await, Ok(()), "{fault:?}");
            assert_eq!(bench.look(Reg::MaxSpeed, 0), 12_345, "{fault:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_late_reply_is_not_taken_for_the_next_one() {
    for setup in [Setup::default(), Setup::raw()] {
        let options = SmsdOptions { tries: 1, ..SmsdOptions::default() };
        let bench = Bench::ready_as(&Setup { options, ..setup }).await;
        bench.client.write_many(&[(Reg::MaxSpeed, 777), (Reg::MinSpeed, 33)]).await.expect("in range");
        for late in [1001, 1500, 1999] {
            bench.faults([Fault::Delay(late * MS)]);
            assert_eq!(text(bench.client.read(Reg::MaxSpeed).await), "stage did not answer within 1s");
            assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33));
        }
        assert_eq!(bench.attempts().len(), 1, "the connection was good all along");
        bench.faults([Fault::Postpone]);
        assert!(bench.client.read(Reg::MaxSpeed).await.is_err());
        assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33));
    }
}

#[tokio::test(start_paused = true)]
async fn numbers_come_round_and_none_is_taken_for_another() {
    let bench = Bench::ready().await;
    for round in 0..600 {
        let (reg, value) = if round % 2 == 0 { (Reg::MaxSpeed, 1000) } else { (Reg::MinSpeed, 0) };
        bench.faults([Fault::StaleFirst]);
        assert_eq!(bench.client.read(reg).await, Ok(value), "{round}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_controller_that_never_answers_is_given_up_in_time() {
    let bench = Bench::ready().await;
    bench.otherwise(Fault::LoseReply);
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert!(matches!(read, Err(Error::Line(LineError::Silent { .. }))), "{read:?}");
    assert_eq!(took, 3 * SECOND);
    bench.heal();
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    let options = SmsdOptions { tries: 2, ..SmsdOptions::default() };
    let bench = Bench::ready_as(&Setup { options, ..Setup::default() }).await;
    bench.otherwise(Fault::LoseReply);
    assert_eq!(
        text(bench.client.write(Reg::MaxSpeed, 20).await),
        "stage did not answer within 1s; whether MAX_SPEED 20 was written is not known"
    );
    assert_eq!(bench.look(Reg::MaxSpeed, 0), 20);
}

#[tokio::test(start_paused = true)]
async fn a_damaged_reply_is_asked_for_again_at_once() {
    let bench = Bench::ready().await;
    bench.faults([Fault::DamageReply(1, 1)]);
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert_eq!(read, Ok(0));
    assert!(took < 10 * MS, "{took:?}");
    bench.otherwise(Fault::DamageReply(1, 1));
    assert_eq!(
        text(bench.client.read(Reg::Speed).await),
        "stage answered with what cannot be understood: a packet that is damaged (ERROR_XOR)"
    );
    assert_eq!(bench.attempts().len(), 1, "the line is as good as before");
}

#[tokio::test(start_paused = true)]
async fn garbage_without_marks_closes_the_connection() {
    let bench = Bench::ready_as(&Setup::raw()).await;
    tokio::time::sleep(SECOND).await;
    bench.faults([Fault::Garbage(vec![0xAA; 40])]);
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert_eq!(read, Ok(0));
    assert!(took < 10 * MS, "{took:?}");
    assert_eq!(bench.attempts().len(), 2);
}

#[tokio::test(start_paused = true)]
async fn impatience_does_not_feed_a_request_to_the_one_before() {
    // Without marks, what follows a request whose end was lost is taken for its end, until the controller drops it.
    let timeouts = Timeouts { reply: 50 * MS, ..Timeouts::default() };
    let options = SmsdOptions { timeouts, ..SmsdOptions::default() };
    let bench = Bench::ready_as(&Setup { options, ..Setup::raw() }).await;
    bench.faults([Fault::CutRequest(8)]);
    let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
    assert_eq!(read, Ok(1000));
    assert!((400 * MS..500 * MS).contains(&took), "{took:?}");
    assert_eq!(bench.attempts().len(), 1);
}

#[tokio::test(start_paused = true)]
async fn many_tasks_share_one_client_through_trouble() {
    let bench = Bench::ready().await;
    let rounds = serial_troubles().into_iter().flat_map(|fault| [Fault::None, Fault::None, fault]);
    bench.faults(rounds);
    let read = |reg: Reg, value: i64| {
        let client = &bench.client;
        async move {
            for _ in 0..40 {
                if let Ok(found) = client.read(reg).await {
                    assert_eq!(found, value);
                }
            }
        }
    };
    tokio::join!(
        read(Reg::MaxSpeed, 1000),
        read(Reg::MinSpeed, 0),
        read(Reg::LanPort, 502),
        read(Reg::Mask, 255)
    );
}
