//! What is said between clients and drives, overheard.

use crate::bench::{Bench, Viewer};
use crate::modbus::{ask, host, log_in};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// One drive of each kind of line.
const EACH: &str = r#"
    [rig]
    clock = "paused"
    api = "127.0.0.1:0"
    [[drive]]
    name = "a"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
    usb_tcp = "127.0.0.1:0"
    [[drive]]
    name = "std"
    model = "SMSD-4.2LAN"
    lan = "standard"
    standard_tcp = "127.0.0.1:0"
    [[drive]]
    name = "uhv"
    model = "SMD3"
    serial_tcp = "127.0.0.1:0"
"#;

/// Somebody who overhears: what they have heard so far is in the events before.
struct Listener(Viewer);

impl Listener {
    async fn open(bench: &Bench, query: &str) -> Listener {
        let mut viewer = Viewer::open(bench, &format!("/v1/traffic?every=20ms{query}")).await;
        assert_eq!(viewer.status().await, 200);
        let first = viewer.next().await.expect("an event");
        assert_eq!(first, ("traffic".to_owned(), json!({ "rows": [], "lost": 0 })));
        Listener(viewer)
    }

    /// The next so many rows.
    async fn rows(&mut self, count: usize) -> Vec<Value> {
        let mut rows = Vec::new();
        while rows.len() < count {
            let (_, traffic) = self.0.next().await.expect("an event");
            assert_eq!(traffic["lost"], 0);
            rows.extend(traffic["rows"].as_array().expect("rows").iter().cloned());
        }
        assert_eq!(rows.len(), count, "{rows:?}");
        rows
    }

    /// Whom the next so many rows were said to, their words and whether they are bad.
    async fn said(&mut self, count: usize) -> Vec<Value> {
        let rows = self.rows(count).await;
        rows.into_iter().map(|row| json!([row["to"], row["text"], row["bad"]])).collect()
    }
}

async fn connect(address: Option<std::net::SocketAddr>) -> TcpStream {
    TcpStream::connect(address.expect("it listens")).await.expect("connected")
}

#[tokio::test]
async fn modbus_is_told_by_the_names_of_registers_and_commands() {
    let bench = Bench::with(EACH).await;
    let mut host = host(&bench).await;
    let mut listener = Listener::open(&bench, "&drive=a").await;
    ask(&mut host, &[4, 0x10, 0, 0, 3]).await;
    let rows = listener.rows(2).await;
    let peer = host.local_addr().expect("an address").to_string();
    assert_eq!(
        rows[0],
        json!({
            "t_ns": 0, "drive": "a", "conn": 1, "by": "modbus", "peer": peer, "to": "drive",
            "hex": "000100000006010410000003", "text": "FC04 read SPEED, ABS_POS", "bad": false,
        })
    );
    assert_eq!((&rows[1]["to"], &rows[1]["text"]), (&json!("client"), &json!("SPEED = 0, ABS_POS = 0")));
    ask(&mut host, &[6, 0x11, 0x09, 0, 0x10]).await;
    ask(&mut host, &[3, 0x99, 0x99, 0, 1]).await;
    let expected = json!([
        ["drive", "FC06 CMD = MOVE_F", false],
        ["client", "FC06 written", false],
        ["drive", "FC03 read HR 0x9999", false],
        ["client", "FC03 Modbus exception 02 (illegal data address)", true],
    ]);
    assert_eq!(json!(listener.said(4).await), expected);
}

#[tokio::test]
async fn lines_are_told_with_their_flags_however_they_come() {
    let bench = Bench::with(EACH).await;
    let mut listener = Listener::open(&bench, "&drive=UHV").await;
    let mut host = connect(bench.server.drives()[2].serial_tcp).await;
    for part in [&b"VMA"[..], b"X\r", b"\nFOO\r\n"] {
        host.write_all(part).await.expect("sent");
        tokio::time::sleep(std::time::Duration::from_millis(5)).await;
    }
    let rows = listener.rows(4).await;
    let words: Vec<Value> =
        rows.iter().map(|row| json!([row["by"], row["to"], row["text"], row["bad"]])).collect();
    let vmax = rows[1]["text"].as_str().expect("text");
    assert!(vmax.ends_with(" [STANDBY]"), "{vmax}");
    assert_eq!(rows[0]["hex"], "564d41580d");
    let expected = json!([
        ["serial", "drive", "VMAX", false],
        ["serial", "client", vmax, false],
        ["serial", "drive", "FOO", true],
        ["serial", "client", "-4 (Unknown command) [STANDBY]", true],
    ]);
    assert_eq!(json!(words), expected);
}

#[tokio::test]
async fn packets_are_told_as_instructions_and_codes() {
    let bench = Bench::with(EACH).await;
    let mut listener = Listener::open(&bench, "").await;
    let mut usb = connect(bench.server.drives()[0].usb_tcp).await;
    // GET_ABS_POS before anybody has logged in: FA, checksum and header, instruction 0x2C, FB.
    let packet = [0x00_u8, 2, 2, 7, 4, 0, 0xC0, 2, 0, 0];
    let sum = packet[1..].iter().fold(0xFF_u8, |sum, byte| sum.wrapping_add(*byte));
    let bytes = [&[0xFA, !sum], &packet[1..], &[0xFB]].concat();
    usb.write_all(&bytes[..5]).await.expect("sent");
    tokio::time::sleep(std::time::Duration::from_millis(5)).await;
    usb.write_all(&bytes[5..]).await.expect("sent");
    let rows = listener.rows(2).await;
    assert_eq!((&rows[0]["by"], &rows[0]["bad"]), (&json!("usb"), &json!(false)));
    assert_eq!(rows[0]["hex"].as_str().map(str::len), Some(2 * bytes.len()));
    assert_eq!(
        (&rows[1]["text"], &rows[1]["bad"]),
        (&json!("ERROR_ACCESS, HiZ STOP READY DIR"), &json!(true))
    );
    let mut lan = connect(bench.server.drives()[1].standard_tcp).await;
    lan.read_exact(&mut [0; 6]).await.expect("it speaks first");
    let rows = listener.rows(1).await;
    assert_eq!(
        (&rows[0]["drive"], &rows[0]["by"], &rows[0]["to"]),
        (&json!("std"), &json!("lan"), &json!("client"))
    );
    assert_eq!(rows[0]["text"], "asks for the password");
}

#[tokio::test]
async fn the_panel_is_heard_like_everybody_and_requests_without_reply_are_too() {
    let bench = Bench::with(EACH).await;
    let mut listener = Listener::open(&bench, "&drive=a").await;
    let mut line = bench.server.line(0).expect("connected");
    log_in(&mut line).await;
    let rows = listener.rows(2).await;
    assert_eq!((&rows[0]["peer"], &rows[0]["by"]), (&json!("panel"), &json!("modbus")));
    let text = rows[0]["text"].as_str().expect("text");
    assert!(text.starts_with("FC10 ") && text.contains("(secret)"), "{text}");
    bench.done("PUT /v1/drives/a/faults/connection", r#"{"setting": "silent"}"#).await;
    line.write_all(&[0, 1, 0, 0, 0, 6, 1, 4, 0x10, 0, 0, 1]).await.expect("sent");
    assert_eq!(json!(listener.said(1).await), json!([["drive", "FC04 read SPEED", false]]));
}

#[tokio::test]
async fn others_are_not_heard_and_sixteen_can_listen() {
    let bench = Bench::with(EACH).await;
    let mut listeners = Vec::new();
    for _ in 0..16 {
        listeners.push(Listener::open(&bench, "&drive=uhv").await);
    }
    host(&bench).await;
    assert!(listeners[0].0.is_quiet().await, "another drive is spoken to");
    let reply = bench.get("/v1/traffic").await;
    assert_eq!((reply.status, reply.error().contains("16 clients watch already")), (503, true));
    listeners.pop();
    while Viewer::open(&bench, "/v1/traffic").await.status().await != 200 {}
    for (query, status) in [("drive=x", 422), ("every=5ms", 422), ("drive=a&drive=a", 400), ("focus=a", 400)]
    {
        assert_eq!(bench.get(&format!("/v1/traffic?{query}")).await.status, status, "{query}");
    }
}
