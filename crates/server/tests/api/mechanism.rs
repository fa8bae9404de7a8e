//! What hangs on a drive, and watching one drive.

use crate::bench::{Bench, THREE, Viewer};
use crate::modbus::{host, write};
use serde_json::{Value, json};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

/// A stage that has a travel, with its carriage at 20 full steps, and an SMD3 with one limit switch.
const TWO: &str = r#"
    [rig]
    clock = "paused"
    api = "127.0.0.1:0"
    [[drive]]
    name = "a"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
    motor = { steps_per_rev = 400 }
    mechanics = { travel = [-100.0, 100.0], start = 20.0 }
    [[drive.switch]]
    input = "IN1"
    closed = [50.0, 60.0]
    [[drive]]
    name = "uhv"
    model = "SMD3"
    serial_tcp = "127.0.0.1:0"
    [[drive.switch]]
    input = "LIMIT_POSITIVE"
    closed = [900.0, 1000.0]
"#;

async fn mechanism(bench: &Bench, drive: &str) -> Value {
    bench.get(&format!("/v1/drives/{drive}")).await.json()["mechanism"].clone()
}

#[tokio::test]
async fn a_drive_is_told_with_its_mechanics() {
    let bench = Bench::with(TWO).await;
    let stage = json!({
        "steps_per_rev": 400, "travel": [-100.0, 100.0], "switches": [{ "input": "IN1", "closed": [50.0, 60.0] }],
        "carriage": 20.0, "zero": 20.0, "mark": 20.0, "target": null, "stalled": false,
    });
    assert_eq!(mechanism(&bench, "a").await, stage);
    let uhv = json!({
        "steps_per_rev": 200, "travel": null, "switches": [{ "input": "LIMIT_POSITIVE", "closed": [900.0, 1000.0] }],
        "carriage": 0.0, "zero": 0.0, "mark": null, "target": null, "stalled": false,
    });
    assert_eq!(mechanism(&bench, "uhv").await, uhv);
    assert_eq!(bench.see("/drives/0").await.get("mechanism"), None);
}

#[tokio::test]
async fn zero_moves_with_lost_steps_and_the_target_is_the_plan() {
    let bench = Bench::with(TWO).await;
    let mut host = host(&bench).await;
    // MOVE_F by 100 full steps of 16 microsteps, of which 80 are on the travel.
    write(&mut host, 0x1106, &[1600, 0]).await;
    write(&mut host, 0x1109, &[0x10]).await;
    assert_eq!(mechanism(&bench, "a").await["target"], 120.0);
    bench.done("POST /v1/clock/run-until", r#"{"until": "a.READY"}"#).await;
    let after = mechanism(&bench, "a").await;
    assert_eq!(
        (&after["carriage"], &after["zero"], &after["target"]),
        (&json!(100.0), &json!(0.0), &json!(null))
    );
    bench.done("PUT /v1/drives/a/power", r#"{"on": false}"#).await;
    let off = mechanism(&bench, "a").await;
    assert_eq!((&off["carriage"], &off["zero"], &off["mark"]), (&json!(100.0), &json!(null), &json!(null)));
}

#[tokio::test]
async fn one_drive_is_watched_with_its_mechanism() {
    let bench = Bench::with(TWO).await;
    let mut viewer = Viewer::open(&bench, "/v1/events?drive=UHV&every=20ms").await;
    assert_eq!(viewer.status().await, 200);
    let (_, rig) = viewer.next().await.expect("an event");
    assert_eq!(rig["drives"].as_array().expect("drives").len(), 1);
    assert_eq!(
        (&rig["drives"][0]["name"], &rig["drives"][0]["mechanism"]["target"]),
        (&json!("uhv"), &json!(null))
    );
    bench.done("PUT /v1/drives/a/inputs/IN0", r#"{"set": "0"}"#).await;
    assert!(viewer.is_quiet().await, "another drive has changed");
    let address = bench.server.drives()[1].serial_tcp.expect("it listens");
    let mut host = TcpStream::connect(address).await.expect("connected");
    host.write_all(b"RUNA,300\r\n").await.expect("sent");
    let (_, rig) = viewer.next().await.expect("an event");
    assert_eq!(rig["drives"][0]["mechanism"]["target"], 300.0);
}

#[tokio::test]
async fn no_drive_is_watched_with_the_clock_and_the_wires() {
    let bench = Bench::with(THREE).await;
    let mut viewer = Viewer::open(&bench, "/v1/events?every=20ms&drive=none").await;
    assert_eq!(viewer.status().await, 200);
    let (_, rig) = viewer.next().await.expect("an event");
    let whole = bench.get("/v1/rig").await.json();
    assert_eq!(
        (&rig["drives"], &rig["wires"], &rig["clock"]),
        (&json!([]), &whole["wires"], &whole["clock"])
    );
    bench.done("PUT /v1/drives/a/inputs/IN0", r#"{"set": "0"}"#).await;
    assert!(viewer.is_quiet().await, "a drive has changed");
    bench.done("POST /v1/actions", r#"{"do": ["wire a.relay b.CONTINUE cut"]}"#).await;
    let (_, rig) = viewer.next().await.expect("an event");
    assert_eq!((&rig["drives"], &rig["wires"][0]["connected"]), (&json!([]), &json!(false)));
}

#[tokio::test]
async fn a_drive_called_none_can_be_watched_and_an_unknown_one_cannot() {
    let bench = Bench::with(&TWO.replace("\"uhv\"", "\"none\"")).await;
    let mut viewer = Viewer::open(&bench, "/v1/events?drive=none").await;
    assert_eq!(viewer.status().await, 200);
    let (_, rig) = viewer.next().await.expect("an event");
    assert_eq!(rig["drives"][0]["name"], "none");
    let reply = bench.get("/v1/events?drive=c").await;
    assert_eq!((reply.status, reply.error().as_str()), (422, "unknown drive `c`; there are a, none"));
}
