//! Clients that are slow, many, or no clients at all.

use crate::bench::{Bench, THREE, Viewer};
use std::sync::Arc;
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, Server};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};

/// The most connections that are served.
const MOST: usize = 64;

#[tokio::test]
async fn what_is_no_http_is_turned_away_and_the_rig_goes_on() {
    let bench = Bench::start().await;
    for noise in [&b"\x00\x01\x00\x00\x00\x06\x01\x03\x11\x01\x00\x01"[..], b"PACT\r\n", &[0xFF; 1000]] {
        let mut stream = bench.connect().await;
        stream.write_all(noise).await.expect("sent");
        let mut reply = Vec::new();
        let _ = stream.read_to_end(&mut reply).await;
        assert!(reply.is_empty() || reply.starts_with(b"HTTP/1.1 400"), "{reply:?}");
    }
    let long = format!("GET /{} HTTP/1.1\r\nHost: localhost\r\n\r\n", "x".repeat(100_000));
    let reply = bench.raw(long).await;
    assert!([414, 431].contains(&reply.status), "{}", reply.status);
    assert_eq!(bench.get("/v1/rig").await.status, 200);
}

#[tokio::test]
async fn sixty_four_are_served_and_whoever_comes_then_is_told_so() {
    let bench = Bench::start().await;
    let mut idle = Vec::new();
    for _ in 0..MOST {
        let mut stream = bench.connect().await;
        stream.write_all(b"GET /v1/rig HTTP/1.1\r\nHost: localhost\r\n\r\n").await.expect("sent");
        // Once it is answered, it is served.
        stream.read_u8().await.expect("a reply");
        idle.push(stream);
    }
    let reply = bench.raw("").await;
    assert_eq!((reply.status, reply.error().contains("64 clients")), (503, true));
    idle.pop();
    // It may take a moment until the place is seen to be free.
    while bench.raw("GET /v1/rig HTTP/1.0\r\nHost: localhost\r\n\r\n").await.status == 503 {}
}

#[tokio::test(start_paused = true)]
async fn who_never_finishes_the_head_of_a_request_is_let_go() {
    let bench = Bench::start().await;
    for part in ["", "GET /v1/rig HT", "GET /v1/rig HTTP/1.1\r\nHost: localhost\r\nX: "] {
        let mut stream = bench.connect().await;
        stream.write_all(part.as_bytes()).await.expect("sent");
        let _ = stream.read_to_end(&mut Vec::new()).await;
    }
}

#[tokio::test(start_paused = true)]
async fn who_never_finishes_a_body_is_told_so() {
    let bench = Bench::start().await;
    let head = "PUT /v1/clock HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n";
    let reply = bench.raw(format!("{head}Content-Length: 20\r\n\r\n{{\"mode\": ")).await;
    assert_eq!((reply.status, reply.error().contains("within 10 seconds")), (408, true));
}

#[tokio::test(start_paused = true)]
async fn who_does_not_read_is_let_go() {
    let bench = Bench::start().await;
    let mut stream = bench.connect().await;
    let many = "GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(1000);
    while stream.write_all(many.as_bytes()).await.is_ok() {}
}

#[tokio::test]
async fn requests_follow_each_other_on_a_connection() {
    let bench = Bench::start().await;
    let one = "GET /v1/drives/c HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let last = "GET /v1/rig HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    let reply = bench.raw(format!("{one}{one}{last}")).await;
    assert_eq!(reply.status, 422);
    assert_eq!(reply.body.matches("HTTP/1.1 ").count(), 2);
}

#[tokio::test]
async fn who_hangs_up_ends_a_run() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/drives/b/inputs/IN0", r#"{"set": "pulse 1us x1000000 every 2us"}"#).await;
    let body = r#"{"until": "uhv.BAKE", "within": "1h"}"#;
    let head = "POST /v1/clock/run-until HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n";
    let request = format!("{head}Content-Length: {}\r\n\r\n{body}", body.len());
    let run = Viewer::ask(&bench, &request).await;
    while bench.see("/now_ns").await == 0 {}
    drop(run);
    // The next is not kept waiting for the end of the hour.
    let ran = bench.done("POST /v1/clock/step", r#"{"for": "1ns"}"#).await;
    assert!(ran["now_ns"].as_u64() < Some(3_600_000_000_000), "{ran}");
}

#[tokio::test]
async fn an_address_that_is_taken_is_told_with_what_to_do() {
    let bench = Bench::start().await;
    let rig = THREE.replace("api = \"127.0.0.1:0\"", &format!("api = \"{}\"", bench.address()));
    let folder = TempDir::new().expect("a temporary folder");
    let options = Options { state: folder.path().into(), recording: None, notify: Arc::new(|_| {}) };
    let error = Server::start(&RigFile::parse(&rig).expect("a rig"), options).await.expect_err("taken");
    let error = error.to_string();
    assert!(
        error.starts_with(&format!("cannot listen on {} for the control API: ", bench.address())),
        "{error}"
    );
    assert!(error.ends_with("choose another `api` in the rig file, or end what uses it"), "{error}");
}
