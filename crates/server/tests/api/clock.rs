//! How rig time passes.

use crate::bench::Bench;
use serde_json::json;

#[tokio::test]
async fn the_clock_is_set_and_told() {
    let bench = Bench::start().await;
    for mode in ["real", "x100", "x0.5", "paused"] {
        let clock = bench.done("PUT /v1/clock", &json!({ "mode": mode }).to_string()).await;
        assert_eq!(clock["mode"], mode);
        assert!(clock["now_ns"].is_u64() && clock["speed_reached"].is_f64(), "{clock}");
        assert_eq!(bench.see("/clock/mode").await, mode);
    }
    for mode in ["", "slow", "x0", "x1e3", "x1000001"] {
        bench.refused("PUT /v1/clock", &json!({ "mode": mode }).to_string(), 422, "clock").await;
    }
    assert_eq!(bench.see("/clock/mode").await, "paused");
}

#[tokio::test]
async fn a_step_is_exact_and_leaves_the_clock_paused() {
    let bench = Bench::start().await;
    assert_eq!(
        bench.done("POST /v1/clock/step", r#"{"for": "5s"}"#).await,
        json!({ "now_ns": 5_000_000_000_u64 })
    );
    assert_eq!(
        bench.done("POST /v1/clock/step", r#"{"for": "1ns"}"#).await,
        json!({ "now_ns": 5_000_000_001_u64 })
    );
    bench.done("PUT /v1/clock", r#"{"mode": "real"}"#).await;
    bench.done("POST /v1/clock/step", r#"{"for": "1h"}"#).await;
    assert_eq!(bench.see("/clock/mode").await, "paused");
    bench.refused("POST /v1/clock/step", r#"{"for": "5"}"#, 422, "the unit is missing").await;
}

#[tokio::test]
async fn a_run_ends_when_nothing_more_happens() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/drives/b/inputs/IN0", r#"{"set": "pulse 5ms"}"#).await;
    let ran = bench.done("POST /v1/clock/run-until", r#"{"until": "idle"}"#).await;
    assert_eq!(ran, json!({ "reached": true, "now_ns": 5_000_000 }));
}

#[tokio::test]
async fn a_run_ends_at_the_instant_at_which_its_condition_holds() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/drives/b/inputs/IN0", r#"{"set": "1", "for": "1234567ns"}"#).await;
    let ran = bench.done("POST /v1/clock/run-until", r#"{"until": "not b.IN0", "within": "1min"}"#).await;
    assert_eq!(ran, json!({ "reached": true, "now_ns": 1_234_567 }));
    assert_eq!(bench.see("/drives/1/inputs/IN0/level").await, false);
    assert_eq!(bench.see("/clock/mode").await, "paused");
}

#[tokio::test]
async fn a_run_to_what_never_comes_ends_with_its_time() {
    let bench = Bench::start().await;
    let ran = bench.done("POST /v1/clock/run-until", r#"{"until": "a.ABS_POS > 5", "within": "10s"}"#).await;
    assert_eq!(ran, json!({ "reached": false, "now_ns": 10_000_000_000_u64 }));
    let ran = bench.done("POST /v1/clock/run-until", r#"{"until": "a.SPEED > 1 or uhv.BAKE"}"#).await;
    assert_eq!(ran, json!({ "reached": false, "now_ns": 3_610_000_000_000_u64 }));
}

#[tokio::test]
async fn a_run_to_nothing_that_there_is_is_refused() {
    let bench = Bench::start().await;
    for (until, error) in [
        ("", "expected a quantity of a drive"),
        ("a.HUNGER", "unknown quantity `HUNGER`"),
        ("c.READY", "unknown drive `c`"),
        ("a.READY and", "column 12: expected"),
    ] {
        bench.refused("POST /v1/clock/run-until", &json!({ "until": until }).to_string(), 422, error).await;
    }
    bench
        .refused("POST /v1/clock/run-until", r#"{"until": "idle", "within": "1 day"}"#, 422, "the unit `day`")
        .await;
    assert_eq!(bench.see("/now_ns").await, 0);
}

#[tokio::test]
async fn whoever_sets_the_clock_ends_a_run_and_its_client_is_told() {
    let bench = Bench::start().await;
    // A pulse each microsecond for ever, as far as a test goes.
    bench.done("PUT /v1/drives/b/inputs/IN0", r#"{"set": "pulse 1us x1000000 every 2us"}"#).await;
    let run = bench.ask("POST /v1/clock/run-until", r#"{"until": "uhv.BAKE", "within": "1h"}"#);
    let set = async {
        while bench.see("/now_ns").await == 0 {}
        bench.done("PUT /v1/clock", r#"{"mode": "x0.01"}"#).await;
    };
    let (reply, ()) = tokio::join!(run, set);
    assert_eq!((reply.status, reply.error().contains("set the clock")), (409, true), "{}", reply.body);
}
