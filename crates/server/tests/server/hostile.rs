//! Bytes that no honest client sends.

use crate::bench::{Bench, Client, who_are_you};
use std::time::Duration;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::timing::{HALF_FRAME_TIMEOUT, UNREAD_REPLY_TIMEOUT};
use tokio::time::Instant;

/// A header with this length field, and a reading request behind it.
fn with_length(length: u16) -> Vec<u8> {
    let [high, low] = length.to_be_bytes();
    //transaction protocol    length     unit  func  address     count
    vec![0x00, 0x01, 0x00, 0x00, high, low, 0x01, 0x04, 0x80, 0x01, 0x00, 0x04]
}

/// The drive serves others as if nothing had happened.
async fn still_served(bench: &Bench) {
    bench.stranger().await.ask(&who_are_you()).await.expect("answered");
}

#[tokio::test]
async fn a_length_that_cannot_be_true_closes_the_connection_without_an_answer() {
    let bench = Bench::start().await;
    for length in [0, 1, 255, 65535] {
        let mut client = bench.stranger().await;
        client.send(&with_length(length)).await;
        assert_eq!(client.closed().await, [0; 0], "{length}");
    }
    still_served(&bench).await;
}

#[tokio::test]
async fn what_came_before_a_false_length_is_answered() {
    let bench = Bench::start().await;
    let mut client = bench.stranger().await;
    client.send(&[with_length(6), with_length(0)].concat()).await;
    assert_eq!(client.closed().await.len(), 17);
}

#[tokio::test]
async fn a_pdu_too_short_or_too_long_is_an_illegal_value() {
    let bench = Bench::start().await;
    let mut client = bench.stranger().await;
    for length in [2, 3, 5] {
        let mut frame = with_length(length);
        frame.truncate(6 + usize::from(length));
        client.send(&frame).await;
        assert_eq!(client.reply().await[7..], [0x84, 3], "length {length}");
    }
    for length in [7, 100, 254] {
        let mut frame = with_length(length);
        frame.resize(6 + usize::from(length), 0);
        client.send(&frame).await;
        assert_eq!(client.reply().await[7..], [0x84, 3], "length {length}");
    }
    client.ask(&who_are_you()).await.expect("the connection goes on");
}

/// Numbers that look random and are the same in every run.
fn noise() -> impl FnMut() -> u8 {
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state.to_le_bytes()[3]
    }
}

#[tokio::test]
async fn garbage_closes_the_connection_and_changes_nothing() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    let before = client.words(Reg::MinSpeed, 17).await;
    let mut noise = noise();
    for size in 1..200 {
        let mut vandal = bench.stranger().await;
        vandal.send_last(&(0..size).map(|_| noise()).collect::<Vec<u8>>()).await;
        vandal.closed().await;
    }
    assert_eq!(client.words(Reg::MinSpeed, 17).await, before);
}

#[tokio::test]
async fn garbage_in_whole_frames_is_refused_before_authorisation() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    let before = client.words(Reg::MinSpeed, 17).await;
    let mut vandal = bench.stranger().await;
    let mut noise = noise();
    for size in 1..253 {
        let pdu: Vec<u8> = (0..size).map(|_| noise()).collect();
        let length = u8::try_from(size + 1).expect("short");
        vandal.send(&[&[7, 7, 0, 0, 0, length, 1], &pdu[..]].concat()).await;
        let reply = vandal.reply().await;
        assert!(reply[7] == pdu[0] | 0x80 && (1..=3).contains(&reply[8]), "{pdu:02X?}: {reply:02X?}");
    }
    assert_eq!(client.words(Reg::MinSpeed, 17).await, before);
}

#[tokio::test(start_paused = true)]
async fn half_a_request_and_silence_is_disconnected_after_the_time_for_it() {
    for cut in 1..12 {
        let bench = Bench::start().await;
        let mut client = bench.stranger().await;
        let start = Instant::now();
        client.send(&with_length(6)[..cut]).await;
        assert_eq!(client.closed().await, [0; 0]);
        assert_eq!(start.elapsed().as_secs(), HALF_FRAME_TIMEOUT.as_secs(), "cut at {cut}");
    }
}

#[tokio::test(start_paused = true)]
async fn silence_between_requests_may_last() {
    let bench = Bench::start().await;
    let mut client = bench.stranger().await;
    client.ask(&who_are_you()).await.expect("answered");
    tokio::time::sleep(Duration::from_hours(24)).await;
    client.ask(&who_are_you()).await.expect("answered");
}

#[tokio::test(start_paused = true)]
async fn a_client_that_never_reads_is_disconnected_after_the_time_for_it() {
    let bench = Bench::start().await;
    let mut deaf = bench.stranger().await;
    let start = Instant::now();
    let taken = deaf.send_until_closed(&with_length(6).repeat(100)).await;
    assert_eq!(start.elapsed().as_secs(), UNREAD_REPLY_TIMEOUT.as_secs());
    // Whatever the kernel holds in its buffers; the server itself takes no more than it can answer.
    assert!(taken < 64 << 20, "{taken} bytes taken");
}

#[tokio::test]
async fn a_client_that_never_reads_does_not_hold_up_others() {
    let bench = Bench::start().await;
    let address = bench.address();
    let deaf = tokio::spawn(async move {
        Client::connect(address).await.send_until_closed(&with_length(6).repeat(100)).await
    });
    let mut client = bench.client().await;
    for _ in 0..500 {
        client.ask(&who_are_you()).await.expect("answered");
    }
    assert!(!deaf.is_finished());
    deaf.abort();
}
