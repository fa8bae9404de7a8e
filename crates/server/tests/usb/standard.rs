//! The standard firmware: packets over LAN, without start and stop.

use crate::bench::{Bench, Client, PASSWORD, REST, SILENCE, STANDARD, code, instruction, packet};
use std::time::Duration;
use stepdrive_rig::file::RigFile;
use stepdrive_server::scenario::Scenario;

#[tokio::test]
async fn the_controller_speaks_first() {
    let bench = Bench::awake(STANDARD).await;
    let served = bench.drive();
    assert_eq!((served.modbus_tcp, served.unit, served.usb.as_ref()), (None, None, None));
    let mut client = Client::connect(served.standard_tcp.expect("it listens"), false).await;
    assert_eq!(client.bytes().await, b"\xFE\x02\0\0\0\0");
    assert_eq!(client.ask(0, &PASSWORD).await.code(), code::OK_ACCESS);
    let mut usb = bench.usb_tcp().await;
    assert_eq!(usb.bytes().await, b"", "not over USB");
}

#[tokio::test]
async fn packets_are_told_apart_by_their_length_however_they_come() {
    let bench = Bench::awake(STANDARD).await;
    let mut client = bench.log_in(bench.standard().await).await;
    let three =
        [packet(2, 1, &instruction(0x06, 0x3FB)), packet(14, 2, &[]), packet(2, 3, &instruction(0x37, 0))];
    let stream = three.concat();
    for size in [1, 2, 5, 7, stream.len()] {
        for piece in stream.chunks(size) {
            client.send(piece).await;
        }
        let replies = [client.reply().await, client.reply().await, client.reply().await];
        assert_eq!(replies.clone().map(|reply| reply.id()), [1, 2, 3]);
        assert_eq!(replies[2].value(), 0x3FB);
    }
}

#[tokio::test]
async fn an_impossible_length_is_told_once_and_skipped_until_there_is_silence() {
    let bench = Bench::awake(STANDARD).await;
    let mut client = bench.log_in(bench.standard().await).await;
    client.send(b"\x00\x02\x0E\x07\x01\x04").await;
    client.send(&packet(14, 8, &[]).repeat(100)).await;
    let reply = client.reply().await;
    assert_eq!((reply.id(), reply.code()), (7, code::ERROR_LEN));
    assert_eq!(client.bytes().await, b"");
    tokio::time::sleep(SILENCE).await;
    assert_eq!(client.counter(2).await, 0, "no half packet was dropped");
}

#[tokio::test]
async fn half_a_packet_is_dropped_and_counted() {
    let bench = Bench::awake(STANDARD).await;
    let mut client = bench.log_in(bench.standard().await).await;
    client.send(&packet(14, 8, &[])[..4]).await;
    tokio::time::sleep(SILENCE).await;
    assert_eq!(client.counter(2).await, 1);
}

#[tokio::test]
async fn the_ninth_client_is_turned_away_and_counted() {
    let bench = Bench::awake(STANDARD).await;
    let mut clients = Vec::new();
    for _ in 0..8 {
        clients.push(bench.standard().await);
    }
    let address = bench.drive().standard_tcp.expect("it listens");
    assert_eq!(Client::connect(address, false).await.closed().await, b"");
    let mut client = bench.log_in(clients.remove(0)).await;
    assert_eq!(client.counter(6).await, 1, "ERROR_SOCKET");
}

#[tokio::test]
async fn stop_usb_changes_nothing_here() {
    let bench = Bench::awake(STANDARD).await;
    let mut client = bench.log_in(bench.standard().await).await;
    assert_eq!(client.command(0x35, 0).await.code(), code::END_PROGRAMS);
    assert_eq!(client.command(0x0B, 0).await.code(), code::GET_ABS_POS);
}

#[tokio::test]
async fn power_off_closes_the_connection() {
    let bench = Bench::awake(STANDARD).await;
    let mut client = bench.log_in(bench.standard().await).await;
    bench.act("power stage off for 1s");
    assert_eq!(client.closed().await, b"");
    bench.pass(REST + Duration::from_secs(1)).await;
    let mut client = bench.standard().await;
    assert_eq!(client.command(0x0B, 0).await.code(), code::ERROR_ACCESS);
}

#[test]
fn a_scenario_that_speaks_modbus_to_it_is_refused() {
    let rig = RigFile::parse(STANDARD).expect("a rig");
    for act in ["write stage.MAX_SPEED 800", "command stage GO_TO 500"] {
        let text = format!("name = \"x\"\n[[step]]\ndo = [\"{act}\"]\n");
        let told = Scenario::parse(&text, &rig).expect_err(act).to_string();
        assert!(told.contains("stage has the standard firmware, which has no registers"), "{told}");
    }
}
