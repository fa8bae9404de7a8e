//! LAN parameters over USB, and what Modbus has to do with it.

use crate::bench::{Bench, Client, PASSWORD, STANDARD, USB, code};
use std::net::{SocketAddr, TcpListener};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// LAN parameters as the factory has them, with this port; without the unit identifier.
fn lan(port: u16) -> Vec<u8> {
    let mut lan =
        vec![0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00, 192, 168, 1, 2, 255, 255, 0, 0, 192, 168, 1, 1, 0, 0, 0, 0];
    lan.extend(port.to_le_bytes());
    lan.push(1);
    lan
}

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").expect("a free port").local_addr().expect("bound").port()
}

fn local(port: u16) -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], port))
}

async fn reach(address: SocketAddr) -> TcpStream {
    loop {
        match TcpStream::connect(address).await {
            Ok(stream) => return stream,
            Err(_) => tokio::time::sleep(Duration::from_millis(1)).await,
        }
    }
}

/// Modbus: writes holding registers, or reads input registers, and gives back the PDU of the reply.
async fn modbus(stream: &mut TcpStream, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let length = u8::try_from(pdu.len() + 1).expect("short");
    stream.write_all(&[&[0, 1, 0, 0, 0, length, unit], pdu].concat()).await.expect("sent");
    let mut reply = vec![0; 260];
    let count = stream.read(&mut reply).await.expect("a reply");
    reply[7..count].to_vec()
}

/// Modbus: logs in with the factory's password.
async fn log_in(stream: &mut TcpStream, unit: u8) {
    let words = b"\x10\x21\x00\x00\x05\x0A\xCD\xEF\x89\xAB\x45\x67\x01\x23\x00\x00";
    assert_eq!(modbus(stream, unit, words).await, b"\x10\x21\x00\x00\x05");
}

#[tokio::test]
async fn lan_parameters_set_over_usb_move_modbus_and_keep_usb() {
    let bench = Bench::awake(USB).await;
    let old = bench.drive().modbus_tcp.expect("it listens");
    let mut usb = bench.logged_in().await;
    let reply = usb.ask(12, &[]).await;
    assert_eq!(reply.data(), [lan(old.port()), vec![1]].concat(), "26 bytes, the unit identifier last");
    let mut connected = reach(old).await;
    let new = local(free_port());
    let reply = usb.ask(11, &[lan(new.port()), vec![9]].concat()).await;
    assert_eq!((reply.packet_type(), reply.code()), (1, code::OK));
    assert_eq!(connected.read(&mut [0; 9]).await.expect("an end"), 0, "the network chip is set up anew");

    let mut stream = reach(new).await;
    assert_eq!(modbus(&mut stream, 9, b"\x04\x80\x01\x00\x01").await, b"\x04\x02\x00\x06");
    log_in(&mut stream, 9).await;
    let port = modbus(&mut stream, 9, b"\x03\x70\x17\x00\x01").await;
    assert_eq!(port[2..], new.port().to_be_bytes());
    assert_eq!(usb.ask(12, &[]).await.data(), [lan(new.port()), vec![9]].concat(), "still logged in");
    assert_eq!(bench.notices("now on").len(), 1);
    drop((usb, stream));

    let bench = bench.restart().await;
    assert_eq!(bench.drive().modbus_tcp, Some(new));
    assert_eq!(bench.logged_in().await.ask(12, &[]).await.data()[25], 9);
}

#[tokio::test]
async fn lan_parameters_out_of_range_change_nothing() {
    let bench = Bench::awake(USB).await;
    let mut usb = bench.logged_in().await;
    let before = usb.ask(12, &[]).await;
    for (place, value) in [(24, 0), (24, 3), (25, 0), (25, 248)] {
        let mut wrong = [lan(5020), vec![1]].concat();
        wrong[place] = value;
        assert_eq!(usb.ask(11, &wrong).await.code(), code::ERROR_RANGE);
    }
    assert_eq!(usb.ask(11, &[lan(0), vec![1]].concat()).await.code(), code::ERROR_RANGE);
    assert_eq!(usb.ask(12, &[]).await.data(), before.data());
}

#[tokio::test]
async fn modbus_and_usb_reach_one_controller() {
    let bench = Bench::awake(USB).await;
    let mut usb = bench.logged_in().await;
    let mut stream = reach(bench.drive().modbus_tcp.expect("it listens")).await;
    log_in(&mut stream, 1).await;
    assert_eq!(usb.command(0x06, 1234).await.code(), code::OK);
    assert_eq!(modbus(&mut stream, 1, b"\x03\x11\x01\x00\x01").await, b"\x03\x02\x04\xD2");
    assert_eq!(modbus(&mut stream, 1, b"\x06\x11\x01\x02\x37").await, b"\x06\x11\x01\x02\x37");
    assert_eq!(usb.command(0x37, 0).await.value(), 567);
    // A wrong password over USB locks Modbus as well.
    assert_eq!(usb.ask(0, &[7; 8]).await.code(), code::ERROR_ACCESS_TIMEOUT);
}

#[tokio::test]
async fn the_standard_firmware_moves_after_the_reply_and_its_connection_ends() {
    let bench = Bench::awake(STANDARD).await;
    let mut client = bench.log_in(bench.standard().await).await;
    let new = local(free_port());
    assert_eq!(client.ask(11, &lan(new.port())).await.code(), code::OK);
    assert_eq!(client.closed().await, b"");
    drop(reach(new).await);
    let mut client = Client::connect(new, false).await;
    assert_eq!(client.reply().await.0, b"\xFE\x02\0\0\0\0");
    let mut client = bench.log_in(client).await;
    assert_eq!(client.ask(12, &[]).await.data(), lan(new.port()));
    drop(client);
    let bench = bench.restart().await;
    assert_eq!(bench.drive().standard_tcp, Some(new));
    let mut client = bench.standard().await;
    assert_eq!(client.ask(0, &PASSWORD).await.code(), code::OK_ACCESS);
}
