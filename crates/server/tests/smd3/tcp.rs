//! What is particular to TCP.

use crate::bench::{Bench, Client, IDLE};
use std::net::SocketAddr;
use tokio::time::Instant;

/// A client that does not read its replies is disconnected after so many seconds.
const UNREAD_REPLY_SECONDS: u64 = 10;

#[tokio::test]
async fn two_clients_take_turns_and_see_the_same_drive() {
    let bench = Bench::start().await;
    let (mut one, mut two) = (bench.tcp().await, bench.tcp().await);
    let mut port = bench.serial();
    for temperature in 0..100 {
        let set = format!("{IDLE},{temperature}");
        assert_eq!(one.ask(&format!("BAKET,{temperature}")).await, set);
        assert_eq!(two.ask("BAKET").await, set);
        assert_eq!(port.ask("BAKET").await, set);
    }
}

#[tokio::test]
async fn half_a_line_of_one_client_does_not_touch_another() {
    let bench = Bench::start().await;
    let (mut one, mut two) = (bench.tcp().await, bench.tcp().await);
    one.send("BAK").await;
    assert_eq!(two.ask("BAKET,9").await, format!("{IDLE},9"));
    assert_eq!(one.ask("ET").await, format!("{IDLE},9"));
}

#[tokio::test]
async fn the_ninth_client_is_turned_away_until_there_is_room() {
    let bench = Bench::start().await;
    let mut clients = Vec::new();
    for _ in 0..8 {
        let mut client = bench.tcp().await;
        assert_eq!(client.ask("").await, IDLE);
        clients.push(client);
    }
    assert_eq!(bench.tcp().await.closed().await, b"");
    assert_eq!(bench.notices("turned away").len(), 1);
    clients.pop();
    while !answers(bench.address()).await {}
}

/// Whether a new client is served.
async fn answers(address: SocketAddr) -> bool {
    let mut client = Client::connect(address).await;
    client.send_last("\r\n").await;
    !client.closed().await.is_empty()
}

#[tokio::test]
async fn what_was_sent_before_the_end_is_carried_out_and_answered() {
    let bench = Bench::start().await;
    let mut client = bench.tcp().await;
    client.send_last("BAKET,9\r\nBAKET,8\r\nBAKET,7").await;
    assert_eq!(client.closed().await, format!("{IDLE},9\r\n{IDLE},8\r\n").as_bytes());
    assert_eq!(bench.tcp().await.ask("BAKET").await, format!("{IDLE},8"));
}

#[tokio::test(start_paused = true)]
async fn a_client_that_never_reads_is_disconnected_after_the_time_for_it() {
    let bench = Bench::start().await;
    let mut deaf = bench.tcp().await;
    let start = Instant::now();
    let taken = deaf.send_until_closed(&b"FLAGS\r\n".repeat(100)).await;
    assert_eq!(start.elapsed().as_secs(), UNREAD_REPLY_SECONDS);
    // Whatever the kernel holds in its buffers; the server itself takes no more than it can answer.
    assert!(taken < 64 << 20, "{taken} bytes taken");
}

#[tokio::test]
async fn a_client_that_never_reads_does_not_hold_up_others() {
    let bench = Bench::start().await;
    let mut deaf = bench.tcp().await;
    deaf.stuff(&b"FLAGS\r\n".repeat(100)).await;
    for mut client in bench.both().await {
        for _ in 0..100 {
            assert_eq!(client.ask("").await, IDLE);
        }
    }
}
