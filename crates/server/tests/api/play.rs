//! Scenarios on a running rig.

use crate::bench::{Bench, Viewer};
use serde_json::{Value, json};

/// Two steps, the second of which waits for what happens only when time goes on.
const TWO_STEPS: &str = r#"
    name = "a pulse comes and goes"
    [[step]]
    name = "begin"
    do = ["input b.IN0 1 for 5s"]
    expect = "b.IN0"
    [[step]]
    name = "end"
    expect = "not b.IN0"
    within = "6s"
"#;

async fn play(bench: &Bench, scenario: &str) -> Viewer {
    let body = json!({ "scenario": scenario }).to_string();
    let head = "POST /v1/play HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: application/json\r\n";
    Viewer::ask(bench, &format!("{head}Content-Length: {}\r\n\r\n{body}", body.len())).await
}

/// What is left of a scenario: the outcomes of steps that have ended, and the report.
async fn rest(viewer: &mut Viewer) -> (Vec<(Value, Value)>, Value) {
    let mut ended = Vec::new();
    loop {
        match viewer.next().await.expect("an event") {
            (name, report) if name == "report" => return (ended, report),
            (name, step) => {
                assert_eq!(name, "step");
                ended.extend(step.get("outcome").map(|outcome| (step["number"].clone(), outcome.clone())));
            }
        }
    }
}

#[tokio::test]
async fn a_scenario_is_told_step_by_step_and_with_its_report() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/clock", r#"{"mode": "x1000"}"#).await;
    let mut playing = play(&bench, TWO_STEPS).await;
    assert_eq!(playing.status().await, 200);
    let (ended, report) = rest(&mut playing).await;
    assert_eq!(ended, [(json!(1), json!("passed")), (json!(2), json!("passed"))]);
    assert_eq!((&report["name"], &report["passed"]), (&json!("a pulse comes and goes"), &json!(true)));
    let nanos = |name: &str| report[name].as_u64().expect("a time");
    assert_eq!(nanos("ended_ns") - nanos("began_ns"), 5_000_000_000);
    assert_eq!(playing.next().await, None, "the reply is over");
    assert_eq!(bench.see("/playing").await, Value::Null);
}

#[tokio::test]
async fn a_step_that_fails_says_why() {
    let bench = Bench::start().await;
    let scenario = r#"
        name = "never"
        [[step]]
        expect = "uhv.BAKE"
    "#;
    let mut playing = play(&bench, scenario).await;
    assert_eq!(playing.status().await, 200);
    let (ended, report) = rest(&mut playing).await;
    assert_eq!(ended, [(json!(1), json!("failed"))]);
    assert_eq!(report["passed"], false);
    assert!(report["steps"][0]["why"].as_str().is_some_and(|why| !why.is_empty()), "{report}");
}

#[tokio::test]
async fn one_is_played_at_a_time_and_hanging_up_ends_it() {
    let bench = Bench::start().await;
    let mut playing = play(&bench, TWO_STEPS).await;
    assert_eq!(playing.status().await, 200);
    assert_eq!(bench.see("/playing").await, "a pulse comes and goes");
    let other = json!({ "scenario": TWO_STEPS }).to_string();
    bench.refused("POST /v1/play", &other, 409, "`a pulse comes and goes` is being played").await;
    bench
        .refused("POST /v1/clock/run-until", r#"{"until": "idle"}"#, 409, "a scenario is being played")
        .await;
    // A scenario goes on when rig time does, whoever moves it.
    bench.done("POST /v1/clock/step", r#"{"for": "1s"}"#).await;
    assert_eq!(bench.get("/v1/drives/b").await.json()["quantities"]["IN0"], 1.0);
    drop(playing);
    while bench.see("/playing").await != Value::Null {}
    let mut playing = play(&bench, TWO_STEPS).await;
    assert_eq!(playing.status().await, 200);
}

#[tokio::test]
async fn a_mistake_in_a_scenario_is_told_with_its_place() {
    let bench = Bench::start().await;
    for (scenario, line, column, error) in [
        ("name = \"x\"\n[[step]]\nexpect = \"c.READY\"\n", 3, 11, "unknown drive `c`"),
        ("name = \"x\"\n[[step]]\ndo = [\"input a.IN9 1\"]\n", 3, 7, "unknown input `IN9`"),
        ("name = x", 1, 8, ""),
    ] {
        let reply = bench.ask("POST /v1/play", &json!({ "scenario": scenario }).to_string()).await;
        let told = reply.json();
        assert!(reply.error().contains(error), "{told}");
        assert_eq!(
            (reply.status, &told["line"], &told["column"]),
            (422, &json!(line), &json!(column)),
            "{told}"
        );
    }
    bench.refused("POST /v1/play", "{}", 400, "missing field `scenario`").await;
    assert_eq!(bench.see("/playing").await, Value::Null);
}

#[tokio::test]
async fn who_watches_sees_that_a_scenario_begins() {
    let bench = Bench::start().await;
    let mut viewer = Viewer::open(&bench, "/v1/events?every=20ms").await;
    assert_eq!(viewer.status().await, 200);
    viewer.next().await.expect("an event");
    let mut playing = play(&bench, TWO_STEPS).await;
    assert_eq!(playing.status().await, 200);
    let (_, rig) = viewer.next().await.expect("an event");
    assert_eq!(rig["playing"], "a pulse comes and goes");
}
