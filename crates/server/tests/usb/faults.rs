//! Trouble on the line of USB.

use crate::bench::{Bench, STANDARD, USB, code, instruction, noticed, packet, stuffed};
use std::time::Duration;
use tokio::time::Instant;

#[tokio::test]
async fn a_reply_that_is_dropped_was_carried_out() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    bench.act("fault stage.reply-drop on");
    client.say(2, &instruction(0x06, 777)).await;
    assert_eq!(client.bytes().await, b"");
    bench.act("fault stage.reply-drop off");
    assert_eq!(client.command(0x37, 0).await.value(), 777);
}

#[tokio::test]
async fn a_reply_comes_late_and_in_pieces() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    bench.act("fault stage.reply-delay 80ms");
    bench.act("fault stage.reply-pieces 4 20ms");
    let asked = Instant::now();
    assert_eq!(client.command(0x37, 0).await.value(), 1000);
    assert!(asked.elapsed() >= Duration::from_millis(140), "{:?}", asked.elapsed());
}

#[tokio::test]
async fn a_reply_is_damaged_or_has_bytes_twice() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    let request = stuffed(&packet(14, 7, &[]));
    client.send(&request).await;
    let right = client.bytes().await;
    bench.act("fault stage.reply-damage on");
    client.send(&request).await;
    let damaged = client.bytes().await;
    let bits = |(a, b): (&u8, &u8)| (a ^ b).count_ones();
    assert_eq!(damaged.len(), right.len());
    assert!((1..=3).contains(&right.iter().zip(&damaged).map(bits).sum::<u32>()));
    bench.act("fault stage.reply-damage off");
    bench.act("fault stage.reply-duplicate on");
    client.send(&request).await;
    assert!(client.bytes().await.len() > right.len());
}

#[tokio::test]
async fn a_reply_has_another_identification_and_a_right_checksum() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    bench.act("fault stage.reply-id on");
    for id in 0..=255 {
        client.send(&stuffed(&packet(14, id, &[]))).await;
        assert_ne!(client.reply().await.id(), id);
    }
}

#[tokio::test]
async fn modbus_exceptions_are_none_of_its_business() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    bench.act("fault stage.exception 06");
    assert_eq!(client.command(0x37, 0).await.value(), 1000);
}

#[tokio::test]
async fn on_a_silent_line_nothing_is_carried_out() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    bench.act("fault stage.connection silent");
    client.say(2, &instruction(0x06, 777)).await;
    assert_eq!(client.bytes().await, b"");
    bench.act("fault stage.connection off");
    assert_eq!(client.command(0x37, 0).await.value(), 1000, "still logged in");
}

#[tokio::test]
async fn a_line_that_is_cut_ends_sessions_and_connections_and_leaves_the_port_open() {
    let bench = Bench::awake(USB).await;
    let mut port = bench.logged_in().await;
    let mut tcp = bench.log_in(bench.usb_tcp().await).await;
    bench.act("fault stage.connection cut");
    assert_eq!(tcp.closed().await, b"");
    port.say(2, &instruction(0x06, 777)).await;
    assert_eq!(port.bytes().await, b"");
    bench.act("fault stage.connection off");
    noticed().await;
    assert_eq!(port.command(0x37, 0).await.code(), code::ERROR_ACCESS);
    let mut port = bench.log_in(port).await;
    assert_eq!(port.command(0x37, 0).await.value(), 1000);
}

#[tokio::test]
async fn the_greeting_of_the_standard_firmware_goes_over_the_same_line() {
    let bench = Bench::awake(STANDARD).await;
    bench.act("fault stage.reply-drop on");
    let address = bench.drive().standard_tcp.expect("it has the standard firmware");
    let mut client = crate::bench::Client::connect(address, false).await;
    assert_eq!(client.bytes().await, b"");
    bench.act("fault stage.reply-drop off");
    let mut client = bench.log_in(client).await;
    assert_eq!(client.command(0x37, 0).await.value(), 1000);
}
