//! Trouble on the line.

use crate::common::link::Fault;
use crate::common::station::{MS, SECOND, text, timed};
use crate::standard_bench::{Bench, Setup};
use stepdrive_host::Timeouts;
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_spec::smsd::registers::Reg;

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
