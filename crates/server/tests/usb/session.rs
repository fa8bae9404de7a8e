//! Logging in, sessions and their ends.

use crate::bench::{
    Bench, Client, PASSWORD, REST, SILENCE, USB, code, instruction, noticed, packet, stuffed,
};
use std::fs;
use std::os::unix::fs::FileTypeExt;
use std::time::Duration;

#[tokio::test]
async fn the_port_stands_in_the_state_folder_under_the_name_of_the_drive() {
    let bench = Bench::start(USB).await;
    let port = bench.drive().usb.clone().expect("it has USB");
    assert_eq!(port, bench.folder.path().join("stage.usb"));
    assert!(fs::metadata(&port).expect("there").file_type().is_char_device());
    bench.server.stop().await;
    assert!(!port.is_symlink(), "removed at the end");
}

#[tokio::test]
async fn the_password_of_the_sheet_logs_in_byte_by_byte() {
    let bench = Bench::awake(USB).await;
    let request = b"\xFA\x37\x02\x00\xFF\x08\x00\xEF\xCD\xAB\x89\x67\x45\x23\x01\xFB";
    // De-energised, ready, forward.
    let reply = b"\xFA\xE3\x02\x01\xFF\x07\x00\x13\x00\x01\0\0\0\0\xFB";
    for mut client in [bench.serial(), bench.usb_tcp().await] {
        for byte in request {
            client.send(&[*byte]).await;
        }
        assert_eq!(client.bytes().await, reply);
        bench.pass(REST).await;
    }
}

#[tokio::test]
async fn in_the_second_after_power_up_and_between_attempts_no_password_is_looked_at() {
    let bench = Bench::start(USB).await;
    let (mut one, mut two) = (bench.serial(), bench.usb_tcp().await);
    assert_eq!(one.ask(0, &PASSWORD).await.code(), code::ERROR_ACCESS_TIMEOUT);
    bench.pass(Duration::from_millis(999)).await;
    assert_eq!(one.ask(0, &PASSWORD).await.code(), code::ERROR_ACCESS_TIMEOUT);
    bench.pass(Duration::from_millis(1)).await;
    assert_eq!(one.ask(0, &[7; 8]).await.code(), code::ERROR_ACCESS);
    assert_eq!(two.ask(0, &PASSWORD).await.code(), code::ERROR_ACCESS_TIMEOUT);
    bench.pass(REST).await;
    assert_eq!(two.ask(0, &PASSWORD).await.code(), code::OK_ACCESS);
    assert_eq!(one.command(0x0B, 0).await.code(), code::ERROR_ACCESS, "the other is logged in");
}

#[tokio::test]
async fn before_logging_in_every_packet_but_that_is_refused_and_does_nothing() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.serial();
    for (packet_type, data) in [
        (2, instruction(0x06, 500).to_vec()),
        (3, instruction(0x24, 0).to_vec()),
        (7, Vec::new()),
        (11, vec![9; 26]),
        (12, Vec::new()),
        (13, vec![9; 8]),
        (14, Vec::new()),
        (16, Vec::new()),
        (15, Vec::new()),
        (99, Vec::new()),
        (2, vec![1, 2]),
    ] {
        let reply = client.ask(packet_type, &data).await;
        assert_eq!((reply.packet_type(), reply.code()), (1, code::ERROR_ACCESS), "{packet_type}");
    }
    let mut client = bench.log_in(client).await;
    assert_eq!(client.command(0x37, 0).await.value(), 1000, "MAX_SPEED as from the factory");
    assert_eq!(client.ask(7, &[]).await.data(), b"", "no program");
}

#[tokio::test]
async fn a_client_moves_the_motor_and_reads_where_it_is() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    let reply = client.command(0x11, 4000).await;
    assert_eq!((reply.packet_type(), reply.code()), (2, code::OK));
    assert_eq!(reply.status() & 3, 0, "energised and busy");
    bench.pass(Duration::from_secs(30)).await;
    let reply = client.command(0x0B, 0).await;
    assert_eq!((reply.code(), reply.value()), (code::GET_ABS_POS, -4000));
}

#[tokio::test]
async fn two_clients_take_turns_at_the_port_and_each_logs_in_anew() {
    let bench = Bench::awake(USB).await;
    for speed in [100, 200, 300] {
        let mut client = bench.logged_in().await;
        assert_eq!(client.command(0x06, speed).await.code(), code::OK);
        // What it leaves unread, and half a packet, go with it.
        client.say(14, &[]).await;
        client.send(b"\xFA\x01\x02").await;
        noticed().await;
        drop(client);
        noticed().await;
        let mut next = bench.serial();
        assert_eq!(next.command(0x37, 0).await.code(), code::ERROR_ACCESS);
        let mut next = bench.log_in(next).await;
        let reply = next.command(0x37, 0).await;
        assert_eq!((reply.code(), reply.value()), (code::GET_MAX_SPEED, speed));
        drop(next);
        noticed().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn however_soon_the_port_is_opened_again_the_client_is_another_and_is_answered() {
    let bench = Bench::awake(USB).await;
    for round in 0..3000 {
        drop(bench.logged_in().await);
        let mut client = bench.serial();
        assert_eq!(client.command(0x0B, 0).await.code(), code::ERROR_ACCESS, "round {round}");
    }
}

#[tokio::test]
async fn clients_at_the_port_and_over_tcp_see_one_drive_in_turn() {
    let bench = Bench::awake(USB).await;
    let mut one = bench.logged_in().await;
    let mut two = bench.log_in(bench.usb_tcp().await).await;
    for speed in 100..150 {
        assert_eq!(one.command(0x06, speed).await.code(), code::OK);
        assert_eq!(two.command(0x37, 0).await.value(), speed);
    }
}

#[tokio::test]
async fn stop_usb_ends_the_session_and_not_the_port() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    assert_eq!(client.command(0x35, 0).await.code(), code::END_PROGRAMS);
    client.say(2, &instruction(0x0B, 0)).await;
    client.say(0, &PASSWORD).await;
    client.send(b"\xFA\xFB").await;
    assert_eq!(client.bytes().await, b"");
    let mut other = bench.log_in(bench.usb_tcp().await).await;
    assert_eq!(other.command(0x0B, 0).await.code(), code::GET_ABS_POS, "another session goes on");
    drop(client);
    noticed().await;
    assert_eq!(bench.logged_in().await.command(0x0B, 0).await.code(), code::GET_ABS_POS);
}

#[tokio::test]
async fn power_off_ends_the_session_and_the_second_begins_anew() {
    let bench = Bench::awake(USB).await;
    let mut port = bench.logged_in().await;
    let mut tcp = bench.log_in(bench.usb_tcp().await).await;
    bench.act("power stage off");
    assert_eq!(tcp.closed().await, b"");
    port.say(2, &instruction(0x0B, 0)).await;
    assert_eq!(port.bytes().await, b"", "nobody is there to answer");
    bench.act("power stage on");
    assert_eq!(port.command(0x0B, 0).await.code(), code::ERROR_ACCESS);
    assert_eq!(port.ask(0, &PASSWORD).await.code(), code::ERROR_ACCESS_TIMEOUT);
    bench.pass(REST).await;
    assert_eq!(port.ask(0, &PASSWORD).await.code(), code::OK_ACCESS);
}

#[tokio::test]
async fn half_a_packet_that_is_left_is_dropped_and_counted() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    let whole = stuffed(&packet(14, 9, &[]));
    for cut in 1..whole.len() {
        client.send(&whole[..cut]).await;
        client.send(&whole[cut..]).await;
        assert_eq!(client.reply().await.id(), 9, "both halves in time");
    }
    for left in 1..=2 {
        client.send(&whole[..3]).await;
        tokio::time::sleep(SILENCE).await;
        client.send(&whole[3..]).await;
        assert_eq!(client.bytes().await, b"", "the second half alone is none");
        assert_eq!(client.counter(2).await, left, "ERROR_TIME_OUT");
    }
}

#[tokio::test]
async fn a_packet_that_comes_with_pauses_within_the_time_is_taken() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    let whole = stuffed(&packet(14, 9, &[]));
    for byte in &whole {
        client.send(&[*byte]).await;
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(client.reply().await.id(), 9);
    assert_eq!(client.counter(2).await, 0);
}

#[tokio::test]
async fn the_ninth_client_over_tcp_is_turned_away_and_no_socket_of_the_controller_is_missed() {
    let bench = Bench::awake(USB).await;
    let mut clients: Vec<Client> = Vec::new();
    for _ in 0..8 {
        let mut client = bench.usb_tcp().await;
        assert_eq!(client.ask(14, &[]).await.code(), code::ERROR_ACCESS);
        clients.push(client);
    }
    assert_eq!(bench.usb_tcp().await.closed().await, b"");
    assert_eq!(bench.notices("turned away").len(), 1);
    assert_eq!(bench.logged_in().await.counter(6).await, 0, "ERROR_SOCKET");
}
