//! Who may control the rig.

use crate::bench::{Bench, THREE};

const TOKEN: &str = "correct-horse-battery";

async fn status(bench: &Bench, head: &str) -> u16 {
    let reply = bench.send("GET /v1/rig", head, "").await;
    if reply.status != 200 {
        assert!(!reply.error().is_empty());
    }
    reply.status
}

#[tokio::test]
async fn a_host_that_is_not_this_computer_is_refused() {
    let bench = Bench::start().await;
    let port = bench.address().port();
    for host in ["localhost", "LOCALHOST", "127.0.0.1", "127.1.2.3", "[::1]"] {
        assert_eq!(status(&bench, &format!("Host: {host}\r\n")).await, 200, "{host}");
        assert_eq!(status(&bench, &format!("Host: {host}:{port}\r\n")).await, 200, "{host}");
    }
    for host in [
        "evil.example",
        "localhost.evil.example",
        "127.0.0.1.evil.example",
        "192.0.2.7",
        "0.0.0.0",
        "",
        "a b",
    ] {
        assert_eq!(status(&bench, &format!("Host: {host}\r\n")).await, 403, "{host}");
    }
    assert_eq!(status(&bench, "").await, 403);
    assert_eq!(status(&bench, "Host: localhost\r\nHost: evil.example\r\n").await, 403);
}

#[tokio::test]
async fn the_host_of_a_whole_address_counts_too() {
    let bench = Bench::start().await;
    let get = |address: &str| format!("GET {address}");
    let head = "Host: localhost\r\n";
    assert_eq!(bench.send(&get("http://localhost/v1/rig"), head, "").await.status, 200);
    assert_eq!(bench.send(&get("http://evil.example/v1/rig"), head, "").await.status, 403);
}

#[tokio::test]
async fn only_web_pages_of_this_origin_may_ask() {
    let bench = Bench::start().await;
    let port = bench.address().port();
    let with = |origin: &str| format!("Host: localhost:{port}\r\nOrigin: {origin}\r\n");
    assert_eq!(status(&bench, &with(&format!("http://localhost:{port}"))).await, 200);
    for origin in [
        "http://evil.example",
        "null",
        "",
        "http://localhost",
        &format!("https://localhost:{port}"),
        &format!("http://127.0.0.1:{port}"),
        &format!("http://localhost:{port}.evil.example"),
    ] {
        assert_eq!(status(&bench, &with(origin)).await, 403, "{origin}");
    }
}

#[tokio::test]
async fn a_page_of_another_origin_changes_nothing() {
    let bench = Bench::start().await;
    let head = "Host: localhost\r\nOrigin: http://evil.example\r\nContent-Type: application/json\r\n";
    let reply = bench.send("PUT /v1/clock", head, r#"{"mode": "real"}"#).await;
    assert_eq!(reply.status, 403);
    assert_eq!(bench.see("/clock/mode").await, "paused");
}

#[tokio::test]
async fn a_rig_with_a_token_is_controlled_by_those_who_show_it() {
    let bench = Bench::with(&THREE.replace("[rig]", &format!("[rig]\n    api_token = \"{TOKEN}\""))).await;
    let with = |shown: &str| format!("Host: localhost\r\nAuthorization: {shown}\r\n");
    assert_eq!(status(&bench, &with(&format!("Bearer {TOKEN}"))).await, 200);
    assert_eq!(status(&bench, &with(&format!("bearer {TOKEN}"))).await, 200);
    for shown in
        ["", "Bearer", "Bearer ", TOKEN, &format!("Basic {TOKEN}"), &format!("Bearer {TOKEN}!"), "Bearer ä"]
    {
        assert_eq!(status(&bench, &with(shown)).await, 401, "{shown}");
    }
    for path in ["/v1/rig", "/openapi.json", "/nothing", "/v1/events"] {
        let reply = bench.get(path).await;
        assert_eq!((reply.status, reply.header("www-authenticate")), (401, Some("Bearer")), "{path}");
    }
    let reply = bench.send("GET /v1/rig", "Host: evil.example\r\n", "").await;
    assert_eq!(reply.status, 403, "a foreign host is not even told that there is a token");
}
