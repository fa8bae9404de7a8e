//! Server-sent events.

use crate::bench::{Bench, Viewer};
use serde_json::json;

#[tokio::test]
async fn the_rig_comes_at_once_and_then_when_it_has_changed() {
    let bench = Bench::start().await;
    let mut viewer = Viewer::open(&bench, "/v1/events?every=20ms").await;
    assert_eq!(viewer.status().await, 200);
    let (name, rig) = viewer.next().await.expect("an event");
    assert_eq!((name.as_str(), &rig), ("state", &bench.get("/v1/rig").await.json()));
    assert!(viewer.is_quiet().await, "nothing has changed");
    for level in [false, true] {
        let body = json!({ "set": if level { "1" } else { "0" } }).to_string();
        bench.done("PUT /v1/drives/a/inputs/IN0", &body).await;
        let (name, rig) = viewer.next().await.expect("an event");
        assert_eq!((name.as_str(), &rig["drives"][0]["inputs"]["IN0"]["forced"]), ("state", &json!(level)));
    }
    assert!(viewer.is_quiet().await, "nothing more has changed");
}

#[tokio::test]
async fn time_alone_is_no_change() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/clock", r#"{"mode": "real"}"#).await;
    let mut viewer = Viewer::open(&bench, "/v1/events?every=20ms").await;
    assert_eq!(viewer.status().await, 200);
    viewer.next().await.expect("an event");
    assert!(viewer.is_quiet().await);
    bench.done("PUT /v1/clock", r#"{"mode": "paused"}"#).await;
    let (_, rig) = viewer.next().await.expect("an event");
    assert_eq!(rig["clock"]["mode"], "paused");
}

#[tokio::test]
async fn what_one_request_changes_comes_in_one_event() {
    let bench = Bench::start().await;
    let mut viewer = Viewer::open(&bench, "/v1/events").await;
    assert_eq!(viewer.status().await, 200);
    viewer.next().await.expect("an event");
    bench
        .done("POST /v1/actions", r#"{"do": ["wire a.relay b.CONTINUE cut", "fault b.rotor blocked"]}"#)
        .await;
    let (_, rig) = viewer.next().await.expect("an event");
    assert_eq!(
        (&rig["wires"][0]["connected"], &rig["drives"][1]["faults"]),
        (&json!(false), &json!({ "rotor": "blocked" }))
    );
}

#[tokio::test]
async fn how_often_events_come_is_checked() {
    let bench = Bench::start().await;
    for (query, status) in [
        ("every=19ms", 422),
        ("every=61s", 422),
        ("every=often", 422),
        ("every=", 422),
        ("each=20ms", 400),
        ("every=20ms&every=20ms", 400),
    ] {
        let reply = bench.get(&format!("/v1/events?{query}")).await;
        assert_eq!(reply.status, status, "{query}: {}", reply.error());
    }
    for query in ["every=20ms", "every=1min", "every=0.5%20s", "every=0.5+s", ""] {
        let mut viewer = Viewer::open(&bench, &format!("/v1/events?{query}")).await;
        assert_eq!(viewer.status().await, 200, "{query}");
    }
}

#[tokio::test]
async fn sixteen_watch_and_whoever_leaves_makes_room() {
    let bench = Bench::start().await;
    let mut viewers = Vec::new();
    for _ in 0..16 {
        let mut viewer = Viewer::open(&bench, "/v1/events").await;
        assert_eq!(viewer.status().await, 200);
        viewer.next().await.expect("an event");
        viewers.push(viewer);
    }
    let reply = bench.get("/v1/events").await;
    assert_eq!((reply.status, reply.error().contains("16 clients watch already")), (503, true));
    bench.done("PUT /v1/drives/a/inputs/IN0", r#"{"set": "0"}"#).await;
    for viewer in &mut viewers {
        let (_, rig) = viewer.next().await.expect("an event");
        assert_eq!(rig["drives"][0]["inputs"]["IN0"]["forced"], false);
    }
    viewers.pop();
    while Viewer::open(&bench, "/v1/events").await.status().await != 200 {}
}

#[tokio::test]
async fn who_watches_is_let_go_when_the_rig_stops() {
    let bench = Bench::start().await;
    let mut viewer = Viewer::open(&bench, "/v1/events").await;
    assert_eq!(viewer.status().await, 200);
    viewer.next().await.expect("an event");
    bench.server.stop().await;
    assert_eq!(viewer.next().await, None);
}
