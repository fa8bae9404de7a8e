//! An SMSD with USB, and one with the standard firmware.

use crate::bench::{Place, Up, text};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Command;

const RIG: &str = r#"
[rig]
clock = "x100"
[[drive]]
name = "stage"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
usb = "pty"
usb_tcp = "127.0.0.1:0"
[[drive]]
name = "table"
model = "SMSD-8.0LAN"
lan = "standard"
standard_tcp = "127.0.0.1:0"
"#;

/// The factory's password as it goes over the wire, and another one.
const PASSWORD: [u8; 8] = [0xEF, 0xCD, 0xAB, 0x89, 0x67, 0x45, 0x23, 0x01];
const OTHER: [u8; 8] = [1; 8];

fn drives(ready: &str) -> Value {
    serde_json::from_str::<Value>(ready).expect("JSON")["drives"].clone()
}

#[test]
fn the_ready_line_says_where_usb_and_the_standard_protocol_are() {
    let place = Place::with(RIG);
    let up = place.up();
    let drives = drives(&up.ready);
    let port = place.path("state/stage.usb");
    assert_eq!(drives[0]["usb"], port.to_str().expect("text"));
    assert!(port.exists(), "a client may open it");
    for address in [&drives[0]["modbus_tcp"], &drives[0]["usb_tcp"], &drives[1]["standard_tcp"]] {
        assert!(address.as_str().is_some_and(|address| address.starts_with("127.0.0.1:")), "{drives}");
    }
    for missing in [&drives[0]["standard_tcp"], &drives[1]["modbus_tcp"], &drives[1]["usb"]] {
        assert!(missing.is_null(), "{drives}");
    }
    up.end("TERM");
    assert!(!port.is_symlink());
}

#[test]
fn a_person_is_told_where_usb_and_the_standard_protocol_are() {
    let place = Place::with(RIG);
    let mut up = Up::start(place.command().args(["up", "rig.toml", "--state", "state"]));
    let welcome = up.welcome();
    let line = |name: &str| {
        let start = format!("  {name}  ");
        welcome.lines().find(|line| line.starts_with(&start)).expect("a line").to_owned()
    };
    let usb = format!(", unit 1, USB {}, USB over TCP 127.0.0.1:", place.path("state/stage.usb").display());
    assert!(line("stage").contains(&usb), "{welcome}");
    let table = line("table");
    assert!(table.starts_with("  table  SMSD-8.0LAN  standard protocol on TCP 127.0.0.1:"), "{welcome}");
    up.end("INT");
}

/// Sends a packet over USB and gives back the data of the reply, neither of which has a byte to be escaped in it.
fn ask(stream: &mut TcpStream, packet_type: u8, data: &[u8]) -> Vec<u8> {
    let length = u8::try_from(data.len()).expect("short");
    let mut packet = [&[0, 2, packet_type, 1, length, 0], data].concat();
    packet[0] = packet.iter().fold(0_u8, |sum, byte| sum.wrapping_sub(*byte));
    stream.write_all(&[&[0xFA], packet.as_slice(), &[0xFB]].concat()).expect("sent");
    let mut reply = Vec::new();
    while reply.last() != Some(&0xFB) {
        let mut byte = [0];
        stream.read_exact(&mut byte).expect("a reply");
        reply.push(byte[0]);
    }
    reply[7..reply.len() - 1].to_vec()
}

/// Sends a packet and gives back the code of the reply.
fn code(stream: &mut TcpStream, packet_type: u8, data: &[u8]) -> u8 {
    ask(stream, packet_type, data)[2]
}

fn log_in(ready: &str, password: &[u8]) -> TcpStream {
    let address = drives(ready)[0]["usb_tcp"].as_str().expect("an address").to_owned();
    let mut stream = TcpStream::connect(address).expect("reachable");
    // ERROR_ACCESS_TIMEOUT until the second after power-up is over.
    while code(&mut stream, 0, password) == 3 {}
    stream
}

#[cfg(target_os = "linux")]
#[test]
fn what_cannot_be_stored_is_answered_error_write_and_counted() {
    let limit = |up: &Up, size: &str| {
        let limit = format!("--fsize={size}:unlimited");
        let done = Command::new("prlimit").args(["--pid", &up.id().to_string(), &limit]).status();
        assert!(done.expect("there is a `prlimit`").success());
    };
    let place = Place::with(RIG);
    let up = place.up_after("trap '' XFSZ");
    let mut stream = log_in(&up.ready, &PASSWORD);
    limit(&up, "0");
    for _ in 0..3 {
        assert_eq!(code(&mut stream, 13, &OTHER), 8, "ERROR_WRITE");
    }
    limit(&up, "unlimited");
    assert_eq!(code(&mut stream, 13, &OTHER), 0);
    let counters = ask(&mut stream, 14, &[]);
    assert_eq!(counters[4 * 7..4 * 8], [3, 0, 0, 0], "ERROR_FRAM");
    let said = text(&up.end("TERM").stderr);
    assert!(said.ends_with("; the client was answered with ERROR_WRITE\n"), "{said}");

    let up = place.up();
    let mut stream = log_in(&up.ready, &OTHER);
    assert_eq!(ask(&mut stream, 14, &[]).len(), 68, "logged in");
    up.end("KILL");
}
