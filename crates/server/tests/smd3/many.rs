//! Several drives, of both families.

use crate::bench::{Bench, Client, IDLE};
use std::fmt::Write;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// Drives of each family in the mixed rig.
const EACH: usize = 20;

fn mixed() -> String {
    let mut rig = String::new();
    for number in 0..EACH {
        write!(
            rig,
            "[[drive]]\nname = 'stage{number}'\nmodel = 'SMSD-4.2LAN'\nmodbus_tcp = '127.0.0.1:0'\n\
             [[drive]]\nname = 'uhv{number}'\nmodel = 'SMD3'\nserial = 'pty'\nserial_tcp = '127.0.0.1:0'\n"
        )
        .expect("a string takes everything");
    }
    rig
}

/// Asks an SMSD for its hardware version, which it tells everybody.
async fn answers_modbus(stream: &mut TcpStream) {
    let request = [0, 1, 0, 0, 0, 6, 1, 4, 0x80, 0x01, 0, 1];
    stream.write_all(&request).await.expect("connected");
    let mut reply = [0; 11];
    stream.read_exact(&mut reply).await.expect("answered");
    assert_eq!(reply, [0, 1, 0, 0, 0, 5, 1, 4, 2, 0, 6]);
}

#[tokio::test]
async fn a_mixed_rig_of_many_drives_answers_everywhere_and_stops() {
    let bench = Bench::with(&mixed()).await;
    let mut streams = Vec::new();
    let mut clients = Vec::new();
    for drive in bench.server.drives() {
        if let Some(address) = drive.modbus_tcp {
            let mut stream = TcpStream::connect(address).await.expect("reached");
            answers_modbus(&mut stream).await;
            streams.push(stream);
        }
        if let Some(path) = &drive.serial {
            clients.push(Client::open(path));
        }
        if let Some(address) = drive.serial_tcp {
            clients.push(Client::connect(address).await);
        }
    }
    assert_eq!((streams.len(), clients.len()), (EACH, 2 * EACH));
    for (number, pair) in clients.chunks_mut(2).enumerate() {
        assert_eq!(pair[0].ask(&format!("BAKET,{number}")).await, format!("{IDLE},{number}"));
    }
    for (number, pair) in clients.chunks_mut(2).enumerate() {
        assert_eq!(pair[1].ask("BAKET").await, format!("{IDLE},{number}"), "each has its own");
    }
    let _folder = bench.stop().await;
    for client in &mut clients {
        assert_eq!(client.closed().await, b"");
    }
    for stream in &mut streams {
        assert_eq!(stream.read(&mut [0]).await.unwrap_or(0), 0);
    }
}

#[tokio::test]
async fn the_end_closes_every_connection_and_takes_the_name_away() {
    let bench = Bench::start().await;
    let (port, address) = (bench.port(), bench.address());
    let mut clients = bench.both().await;
    for client in &mut clients {
        assert_eq!(client.ask("").await, IDLE);
    }
    let _folder = bench.stop().await;
    for client in &mut clients {
        assert_eq!(client.closed().await, b"");
    }
    assert!(!port.exists() && !port.is_symlink());
    assert!(TcpStream::connect(address).await.is_err());
}
