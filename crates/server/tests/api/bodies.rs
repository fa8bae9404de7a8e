//! Bodies that are not what they should be.

use crate::bench::Bench;
use serde_json::json;

#[tokio::test]
async fn a_malformed_body_is_refused_with_its_place() {
    let bench = Bench::start().await;
    for (body, line, column, error) in [
        ("{\n \"mode\": real}", 2, 10, "expected value"),
        ("{\"mode\": \"real\"", 1, 15, "EOF"),
        ("", 1, 1, "EOF"),
        ("\u{FEFF}{}", 1, 1, "expected value"),
        ("[\"real\"]", 1, 1, "an object is wanted"),
        ("\"real\"", 1, 6, "invalid type"),
        ("{\"mode\": 5}", 1, 10, "invalid type"),
        ("{\"mode\": null}", 1, 13, "invalid type"),
        ("{}", 1, 2, "missing field `mode`"),
        ("{\"mode\": \"real\", \"speed\": 2}", 1, 24, "unknown field `speed`"),
        ("{\"mode\": \"real\", \"mode\": \"real\"}", 1, 23, "duplicate field"),
        ("{\"mode\": \"real\"} {}", 1, 18, "trailing characters"),
    ] {
        let reply = bench.ask("PUT /v1/clock", body).await;
        assert!(reply.error().contains(error), "{body}: {}", reply.body);
        let json = reply.json();
        assert_eq!(
            (reply.status, &json["line"], &json["column"]),
            (400, &json!(line), &json!(column)),
            "{body}: {json}"
        );
    }
    assert_eq!(bench.see("/clock/mode").await, "paused");
}

#[tokio::test]
async fn a_body_that_is_not_utf8_or_too_deep_is_refused() {
    let bench = Bench::start().await;
    let head = "PUT /v1/clock HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: application/json\r\n";
    let mut request = format!("{head}Content-Length: 12\r\n\r\n{{\"mode\":\"").into_bytes();
    request.extend([0xFF, b'"', b'}']);
    assert_eq!(bench.raw(request).await.status, 400);
    let deep = format!("{{\"mode\": {}", "[".repeat(100_000));
    bench.refused("PUT /v1/clock", &deep, 400, "invalid type").await;
    let deep = format!("{{\"x\": {}", "[".repeat(100_000));
    bench.refused("PUT /v1/clock", &deep, 400, "unknown field").await;
}

#[tokio::test]
async fn wrong_types_and_unknown_words_are_malformed() {
    let bench = Bench::start().await;
    for (line, body) in [
        ("PUT /v1/drives/a/power", r#"{"on": 1}"#),
        ("PUT /v1/drives/a/power", r#"{"on": "false"}"#),
        ("PUT /v1/drives/a/panel", r#"{"mode": "bF 2"}"#),
        ("PUT /v1/drives/a/panel", r#"{"mode": "la"}"#),
        ("PUT /v1/drives/a/panel", r#"{"mode": "LA", "program": -1}"#),
        ("PUT /v1/drives/a/panel", r#"{"mode": "LA", "program": 1.5}"#),
        ("POST /v1/actions", r#"{"do": "power a off"}"#),
        ("POST /v1/actions", r#"{"do": [5]}"#),
        ("PUT /v1/wires", r#"{"from": "a.relay", "to": "b.CONTINUE"}"#),
        ("PUT /v1/drives/a/inputs/IN0", r#"{"set": 1}"#),
    ] {
        bench.refused(line, body, 400, "the body is not what is wanted here").await;
    }
}

#[tokio::test]
async fn only_json_is_read() {
    let bench = Bench::start().await;
    let body = r#"{"mode": "real"}"#;
    for kind in ["", "Content-Type: text/plain\r\n", "Content-Type: application/x-www-form-urlencoded\r\n"] {
        let reply = bench.send("PUT /v1/clock", &format!("Host: localhost\r\n{kind}"), body).await;
        assert_eq!(reply.status, 415, "{kind}");
        assert!(reply.error().contains("Content-Type: application/json"));
    }
    assert_eq!(bench.see("/clock/mode").await, "paused");
    let head = "Host: localhost\r\nContent-Type: Application/JSON; charset=utf-8\r\n";
    assert_eq!(bench.send("PUT /v1/clock", head, body).await.status, 200);
}

#[tokio::test]
async fn a_body_has_a_mebibyte_at_most() {
    let bench = Bench::start().await;
    let padded = |length: usize| {
        let body = r#"{"mode": "paused"}"#;
        format!("{body}{}", " ".repeat(length - body.len()))
    };
    bench.done("PUT /v1/clock", &padded(1 << 20)).await;
    for length in [(1 << 20) + 1, 8 << 20] {
        bench.refused("PUT /v1/clock", &padded(length), 413, "longer than 1 MiB").await;
    }
}

#[tokio::test]
async fn a_body_in_chunks_is_read_and_has_the_same_limit() {
    let bench = Bench::start().await;
    let head = "PUT /v1/clock HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: application/json\r\n";
    let head = format!("{head}Transfer-Encoding: chunked\r\n\r\n");
    let small = "5\r\n{\"mod\r\nc\r\ne\": \"real\"} \r\n0\r\n\r\n";
    assert_eq!(bench.raw(format!("{head}{small}")).await.status, 200);
    let chunk = format!("10000\r\n{}\r\n", " ".repeat(1 << 16));
    let large = format!("{head}{}0\r\n\r\n", chunk.repeat(17));
    assert_eq!(bench.raw(large).await.status, 413);
}
