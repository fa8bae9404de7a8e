//! What changes the rig.

use crate::bench::Bench;
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// An input in the rig.
const IN0: &str = "/drives/0/inputs/IN0";

#[tokio::test]
async fn an_input_is_forced_and_released() {
    let bench = Bench::start().await;
    for (set, expected) in [
        ("0", json!({ "level": false, "forced": false })),
        ("1", json!({ "level": true, "forced": true })),
        // The inverted wire holds it high.
        ("release", json!({ "level": true, "forced": null })),
    ] {
        let body = json!({ "set": set }).to_string();
        assert_eq!(bench.done("PUT /v1/drives/a/inputs/in0", &body).await, json!({ "now_ns": 0 }));
        assert_eq!(bench.see(IN0).await, expected, "{set}");
    }
}

#[tokio::test]
async fn an_input_is_forced_for_a_while_and_given_pulses() {
    let bench = Bench::start().await;
    let level = "/drives/1/inputs/IN0/level";
    bench.done("PUT /v1/drives/b/inputs/IN0", r#"{"set": "1", "for": "2 s"}"#).await;
    bench.done("POST /v1/clock/step", r#"{"for": "1999999999ns"}"#).await;
    assert_eq!(bench.see(level).await, true);
    bench.done("POST /v1/clock/step", r#"{"for": "1ns"}"#).await;
    assert_eq!(bench.see(level).await, false);
    bench.done("PUT /v1/drives/b/inputs/IN0", r#"{"set": "pulse 5ms x3 every 10ms", "for": null}"#).await;
    for expected in [true, false, true, false, true, false, false] {
        assert_eq!(bench.see(level).await, expected);
        bench.done("POST /v1/clock/step", r#"{"for": "5ms"}"#).await;
    }
}

#[tokio::test]
async fn a_fault_is_switched_on_for_a_while_and_off() {
    let bench = Bench::start().await;
    let faults = "/drives/2/faults";
    bench.done("PUT /v1/drives/uhv/faults/thermocouple", r#"{"setting": "open", "for": "5s"}"#).await;
    assert_eq!(bench.see(faults).await, json!({ "thermocouple": "open" }));
    bench.done("POST /v1/clock/step", r#"{"for": "5s"}"#).await;
    assert_eq!(bench.see(faults).await, json!({}));
    bench.done("PUT /v1/drives/uhv/faults/reply-delay", r#"{"setting": "50ms"}"#).await;
    assert_eq!(bench.see(faults).await, json!({ "reply-delay": "50ms" }));
    bench.done("PUT /v1/drives/uhv/faults/reply-delay", r#"{"setting": "off"}"#).await;
    assert_eq!(bench.see(faults).await, json!({}));
}

#[tokio::test]
async fn a_drive_is_switched_off_and_on() {
    let bench = Bench::start().await;
    let powered = "/drives/0/powered";
    bench.done("PUT /v1/drives/a/power", r#"{"on": false}"#).await;
    assert_eq!(bench.see(powered).await, false);
    bench.done("PUT /v1/drives/a/power", r#"{"on": true}"#).await;
    assert_eq!(bench.see(powered).await, true);
    bench.done("PUT /v1/drives/a/power", r#"{"on": false, "for": "2s"}"#).await;
    assert_eq!(bench.see(powered).await, false);
    bench.done("POST /v1/clock/step", r#"{"for": "2s"}"#).await;
    assert_eq!(bench.see(powered).await, true);
}

#[tokio::test]
async fn the_clients_of_a_drive_lose_it_with_its_supply_or_its_line() {
    let bench = Bench::start().await;
    for (line, off, on) in [
        ("PUT /v1/drives/a/power", r#"{"on": false}"#, r#"{"on": true}"#),
        ("PUT /v1/drives/a/faults/connection", r#"{"setting": "cut"}"#, r#"{"setting": "off"}"#),
    ] {
        let mut client =
            TcpStream::connect(bench.server.drives()[0].modbus_tcp.expect("it listens")).await.expect("up");
        client.write_all(&[0, 1, 0, 0, 0, 6, 1, 4, 0x80, 1, 0, 1]).await.expect("sent");
        client.read_u8().await.expect("a reply");
        bench.done(line, off).await;
        client.read_to_end(&mut Vec::new()).await.expect("closed");
        bench.done(line, on).await;
    }
}

#[tokio::test]
async fn the_front_panel_counts_from_the_next_power_up_on() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/drives/a/panel", r#"{"mode": "bF", "program": 2}"#).await;
    bench.done("POST /v1/actions", r#"{"do": ["power a off", "power a on"]}"#).await;
    let drive = bench.get("/v1/drives/a").await.json();
    assert_eq!(drive["quantities"]["MODE_N_PROGRAMS"], 2.0);
    bench.done("PUT /v1/drives/a/panel", r#"{"mode": "LA", "program": null}"#).await;
}

#[tokio::test]
async fn a_wire_is_cut_and_mended() {
    let bench = Bench::start().await;
    for (connected, level) in [(false, false), (true, true)] {
        let body = json!({ "from": "B.relay", "to": "a.in0", "connected": connected }).to_string();
        bench.done("PUT /v1/wires", &body).await;
        assert_eq!(bench.see("/wires/1/connected").await, connected);
        assert_eq!(bench.see("/drives/0/inputs/IN0/level").await, level);
    }
}

#[tokio::test]
async fn actions_are_carried_out_in_their_order() {
    let bench = Bench::start().await;
    let body = json!({ "do": ["input a.IN0 1", "fault uhv.rotor blocked", "input a.IN0 0", "wire a.relay b.CONTINUE cut"] });
    assert_eq!(bench.done("POST /v1/actions", &body.to_string()).await, json!({ "now_ns": 0 }));
    assert_eq!(bench.see(IN0).await["forced"], false);
    assert_eq!(bench.see("/drives/2/faults").await, json!({ "rotor": "blocked" }));
    assert_eq!(bench.see("/wires/0/connected").await, false);
}

#[tokio::test]
async fn nothing_is_done_when_one_of_several_actions_is_none() {
    let bench = Bench::start().await;
    let body = json!({ "do": ["input a.IN0 0", "input c.IN0 1"] }).to_string();
    let error = "action 2: unknown drive `c`; there are a, b, uhv; nothing was done";
    bench.refused("POST /v1/actions", &body, 422, error).await;
    assert_eq!(bench.see(IN0).await["forced"], json!(null));
}

#[tokio::test]
async fn there_are_1_to_1000_actions() {
    let bench = Bench::start().await;
    bench.refused("POST /v1/actions", r#"{"do": []}"#, 422, "takes 1 to 1000").await;
    let many = |count| json!({ "do": vec!["input a.IN0 1"; count] }).to_string();
    bench.refused("POST /v1/actions", &many(1001), 422, "1001 actions").await;
    bench.done("POST /v1/actions", &many(1000)).await;
}

#[tokio::test]
async fn what_cannot_be_is_refused_and_nothing_is_done() {
    let bench = Bench::start().await;
    let before = bench.get("/v1/rig").await.body;
    for (line, body, error) in [
        ("PUT /v1/drives/c/inputs/IN0", r#"{"set": "1"}"#, "unknown drive `c`"),
        ("PUT /v1/drives/a/inputs/IN7", r#"{"set": "1"}"#, "unknown input `IN7`"),
        ("PUT /v1/drives/a/inputs/relay", r#"{"set": "1"}"#, "relay is an output"),
        ("PUT /v1/drives/a/inputs/IN0", r#"{"set": "2"}"#, "an input is set so"),
        ("PUT /v1/drives/a/inputs/IN0", r#"{"set": ""}"#, "an input is set so"),
        ("PUT /v1/drives/a/inputs/IN0", r#"{"set": "pulse 5 parsecs"}"#, "an input is set so"),
        ("PUT /v1/drives/a/inputs/IN0", r#"{"set": "pulse 5ms", "for": "2s"}"#, "cannot be taken back"),
        (
            "PUT /v1/drives/a/inputs/IN0",
            r#"{"set": "1", "for": "soon"}"#,
            "a duration is a number and a unit",
        ),
        ("PUT /v1/drives/a/inputs/IN0%201", r#"{"set": "1"}"#, "unknown input"),
        ("PUT /v1/drives/a/faults/hunger", r#"{"setting": "open"}"#, "unknown fault `hunger`"),
        ("PUT /v1/drives/a/faults/thermocouple", r#"{"setting": "open"}"#, "no such part"),
        ("PUT /v1/drives/a/faults/rotor", r#"{"setting": "stuck"}"#, "it is blocked or off"),
        ("PUT /v1/drives/a/faults/rotor%20blocked", r#"{"setting": "off"}"#, "unknown fault"),
        ("PUT /v1/drives/b/faults/IN0", r#"{"setting": "bounce"}"#, "has no switch on IN0"),
        ("PUT /v1/drives/c/power", r#"{"on": false}"#, "unknown drive `c`"),
        ("PUT /v1/drives/a/power", r#"{"on": false, "for": "-1s"}"#, "a duration is not negative"),
        ("PUT /v1/drives/uhv/panel", r#"{"mode": "LA"}"#, "no front panel"),
        ("PUT /v1/drives/a/panel", r#"{"mode": "LA", "program": 4}"#, "0 to 3, not `4`"),
        (
            "PUT /v1/wires",
            r#"{"from": "a.relay", "to": "uhv.ENABLE", "connected": false}"#,
            "has no wire from",
        ),
        (
            "PUT /v1/wires",
            r#"{"from": "a", "to": "b.IN0", "connected": false}"#,
            "not a drive and a part of it",
        ),
        ("PUT /v1/wires", r#"{"from": "a.relay b.IN0", "to": "cut", "connected": false}"#, "no spaces"),
        ("PUT /v1/wires", r#"{"from": "", "to": "b.IN0", "connected": false}"#, "at least one letter"),
    ] {
        bench.refused(line, body, 422, error).await;
    }
    assert_eq!(bench.get("/v1/rig").await.body, before);
}
