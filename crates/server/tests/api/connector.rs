//! Connections to drives from within the process of the rig, and what else is served beside the API.

use crate::bench::{Bench, THREE, Viewer};
use crate::modbus::{ask, host, log_in, write};
use axum::Router;
use axum::routing::get;
use serde_json::json;
use std::fs;
use std::io::ErrorKind;
use std::sync::Arc;
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, Recording, Server};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// An SMSD with the standard firmware.
const STANDARD: &str = r#"
    [rig]
    clock = "paused"
    api = "127.0.0.1:0"
    [[drive]]
    name = "a"
    model = "SMSD-4.2LAN"
    lan = "standard"
    standard_tcp = "127.0.0.1:0"
"#;

/// Reads input registers 0x1000 and on, `SPEED` and `ABS_POS`.
const LOOK: [u8; 5] = [4, 0x10, 0, 0, 3];

#[tokio::test]
async fn a_drive_is_spoken_to_in_what_it_speaks_on_its_first_line() {
    let bench = Bench::start().await;
    let mut smsd = bench.server.line(0).expect("connected");
    log_in(&mut smsd).await;
    assert_eq!(ask(&mut smsd, &LOOK).await, [4, 6, 0, 0, 0, 0, 0, 0]);
    let mut smd3 = bench.server.line(2).expect("connected");
    smd3.write_all(b"PACT\r\n").await.expect("sent");
    let mut reply = [0; 27];
    smd3.read_exact(&mut reply).await.expect("answered");
    assert_eq!(reply, *b"0x0040,0x0000,0.00000E+00\r\n");
    let error = bench.server.line(3).expect_err("there are three");
    assert_eq!(error.to_string(), "the rig has no drive 3; they count from 0");
    let standard = Bench::with(STANDARD).await;
    let mut line = standard.server.line(0).expect("connected");
    let mut greeting = [0; 6];
    line.read_exact(&mut greeting).await.expect("it asks for the password");
    assert_eq!(greeting, [0xFE, 2, 0, 0, 0, 0]);
}

#[tokio::test]
async fn a_line_takes_no_socket_of_the_drive() {
    let bench = Bench::start().await;
    let mut hosts = Vec::new();
    for _ in 0..8 {
        hosts.push(host(&bench).await);
    }
    let mut lines = Vec::new();
    for _ in 0..20 {
        let mut line = bench.server.line(0).expect("connected");
        log_in(&mut line).await;
        lines.push(line);
    }
    let address = bench.server.drives()[0].modbus_tcp.expect("it listens");
    let mut ninth = TcpStream::connect(address).await.expect("accepted");
    assert_eq!(ninth.read(&mut [0]).await.unwrap_or(0), 0, "the ninth over TCP is turned away");
    assert_eq!(ask(&mut hosts[7], &LOOK).await[0], 4);
}

#[tokio::test]
async fn a_line_ends_with_the_supply_or_the_connection_and_can_be_had_again() {
    let bench = Bench::start().await;
    for (drive, cut, mend) in [
        (0, "power a off", "power a on"),
        (0, "fault a.connection cut", "fault a.connection off"),
        (2, "power uhv off", "power uhv on"),
    ] {
        let mut line = bench.server.line(drive).expect("connected");
        bench.done("POST /v1/actions", &json!({ "do": [cut] }).to_string()).await;
        assert_eq!(line.read(&mut [0]).await.expect("closed"), 0, "{cut}");
        let error = bench.server.line(drive).expect_err(cut);
        assert_eq!(error.kind(), ErrorKind::ConnectionRefused);
        assert!(error.to_string().ends_with("it is without its supply, or its line is cut"), "{error}");
        bench.done("POST /v1/actions", &json!({ "do": [mend] }).to_string()).await;
        bench.server.line(drive).expect(mend);
    }
}

#[tokio::test]
async fn a_line_stays_when_somebody_else_sets_up_the_network_anew() {
    let bench = Bench::start().await;
    let (mut line, mut host) = (bench.server.line(0).expect("connected"), host(&bench).await);
    log_in(&mut line).await;
    assert_eq!(ask(&mut host, &[5, 0x74, 0, 0xFF, 0]).await[0], 5);
    assert_eq!(host.read(&mut [0]).await.unwrap_or(0), 0, "all over TCP are disconnected");
    assert_eq!(ask(&mut line, &LOOK).await[0], 4);
    assert_eq!(ask(&mut line, &[5, 0x74, 0, 0xFF, 0]).await[0], 5);
    assert_eq!(line.read(&mut [0]).await.expect("closed"), 0, "whoever asks for it begins anew");
}

#[tokio::test]
async fn lines_end_with_the_rig() {
    let bench = Bench::start().await;
    let (connector, mut line) = (bench.server.connector(), bench.server.line(0).expect("connected"));
    bench.server.stop().await;
    assert_eq!(line.read(&mut [0]).await.expect("closed"), 0);
    assert_eq!(connector.connect(0).expect_err("stopped").to_string(), "the rig has stopped");
}

#[tokio::test]
async fn a_recording_tells_the_panel_from_other_clients_and_can_be_replayed() {
    let folder = TempDir::new().expect("a temporary folder");
    let rig = RigFile::parse(THREE).expect("a rig");
    let file = folder.path().join("rec.jsonl");
    let recording = Some(Recording { file: file.clone(), rig: THREE.to_owned() });
    let options = Options { state: folder.path().join("state"), recording, notify: Arc::new(|_| {}) };
    let server = Server::start(&rig, options).await.expect("the rig starts");
    let mut line = server.line(0).expect("connected");
    log_in(&mut line).await;
    write(&mut line, 0x1105, &[500]).await;
    drop(line);
    server.stop().await;
    let text = fs::read_to_string(&file).expect("a recording");
    assert!(text.contains(r#""open":{"conn":1,"drive":0,"panel":true}"#), "{text}");
    let replayed = stepdrive_server::replay::replay(text.as_bytes()).expect("it can be replayed");
    assert!(replayed.identical, "{replayed}");
}

#[tokio::test]
async fn what_is_served_beside_the_api_is_behind_its_token_but_for_the_page() {
    let folder = TempDir::new().expect("a temporary folder");
    let rig = THREE.replace("[rig]", "[rig]\n    api_token = \"correct-horse-battery\"");
    let rig = RigFile::parse(&rig).expect("a rig");
    let options = Options { state: folder.path().into(), recording: None, notify: Arc::new(|_| {}) };
    let server = Server::start_with(&rig, options, |connector, drives| {
        let (connector, names) = (connector.clone(), drives.iter().map(|drive| drive.name.clone()));
        let names = names.collect::<Vec<String>>().join(" ");
        let axes = async move || connector.connect(0).map_or("no line".to_owned(), |_| names);
        Router::new().route("/", get(async || "the page")).route("/v1/axes", get(axes))
    });
    let bench = Bench::of(server.await.expect("the rig starts"), folder);
    assert_eq!(bench.get("/").await.body, "the page");
    assert_eq!((bench.get("/v1/axes").await.status, bench.get("/v1/rig").await.status), (401, 401));
    let shown = "Host: localhost\r\nAuthorization: Bearer correct-horse-battery\r\n";
    assert_eq!(bench.send("GET /v1/axes", shown, "").await.body, "a b uhv");
    assert_eq!(bench.send("GET /v1/rig", shown, "").await.status, 200);
    assert_eq!(bench.send("PUT /v1/axes", shown, "").await.status, 405);
    assert_eq!(bench.send("GET /nothing", shown, "").await.status, 404);
    let mut viewer = Viewer::ask(&bench, &format!("GET /v1/events HTTP/1.1\r\n{shown}\r\n")).await;
    assert_eq!(viewer.status().await, 200);
}
