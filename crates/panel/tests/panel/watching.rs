//! What those who watch are told, and what it costs.

use crate::bench::Bench;
use crate::link::Fault;
use crate::stage::{MS, SECOND, Stage, axis, has};
use crate::station;
use serde_json::{Value, json};
use std::sync::Arc;
use stepdrive_host::axis::{DriveAxis, SmsdMotor};
use stepdrive_host::smsd::{Smsd as _, SmsdOptions, WordOrder};
use stepdrive_host::units::{Decimal, Scale};
use stepdrive_panel::{Controller, Panel};
use tokio::time::{Instant, sleep};

const LOST: u64 = 1;
const MOVING: u64 = 2;
const UNREAD: u64 = 2048;

/// The states in events.
fn states(events: &[(String, Value)]) -> Vec<Value> {
    let states = events.iter().filter(|(name, _)| name == "states");
    states.flat_map(|(_, data)| data["s"].as_array().expect("states").clone()).collect()
}

#[tokio::test(start_paused = true)]
async fn first_come_all_axes_and_all_states() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    let (name, axes) = viewer.next().await;
    assert_eq!(name, "axes");
    assert_eq!(axes["axes"][0]["name"], "stage");
    assert_eq!(axes["axes"][1]["unit"], "steps");
    let (name, states) = viewer.next().await;
    assert_eq!(name, "states");
    assert_eq!(states["s"].as_array().map(Vec::len), Some(2));
    assert!(states["s"].as_array().expect("states").iter().all(|state| has(state, UNREAD)));
    let read = viewer.state(0, |state| !has(state, UNREAD)).await;
    assert_eq!(
        read,
        json!({ "i": 0, "p": 0.0, "v": 0.0, "b": 64 }),
        "de-energised, within no limits, not trusted"
    );
}

#[tokio::test(start_paused = true)]
async fn models_are_told_once_they_are_known() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    viewer.event("axes").await;
    let axes = viewer.event("axes").await;
    assert_eq!(
        (&axes["axes"][0]["model"], &axes["axes"][1]["model"]),
        (&json!("SMSD-4.2LAN"), &json!("SMD3"))
    );
    let all = viewer.event("states").await;
    assert_eq!(all["s"].as_array().map(Vec::len), Some(2), "a page begins anew with the list of axes");
}

#[tokio::test(start_paused = true)]
async fn states_come_only_when_they_have_changed_and_something_comes_all_the_time() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    viewer.during(2 * SECOND).await;
    let quiet = viewer.during(10 * SECOND).await;
    assert!(states(&quiet).is_empty(), "{quiet:?}");
    assert!((40..=41).contains(&quiet.len()), "{}", quiet.len());
    stage.post("/v1/axes/stage/move", r#"{"by":"10mm","speed":"10mm/s"}"#).await.done();
    let moving = states(&viewer.during(SECOND).await);
    assert!((8..=12).contains(&moving.len()), "{}", moving.len());
    assert!(moving.iter().all(|state| state["i"] == 0));
    let last = viewer.state(0, |state| !has(state, MOVING)).await;
    assert_eq!((&last["p"], &last["v"]), (&json!(10.0), &json!(0.0)));
    assert!(states(&viewer.during(5 * SECOND).await).is_empty());
}

#[tokio::test(start_paused = true)]
async fn nothing_is_asked_of_anybody_while_nobody_watches() {
    let stage = Stage::new();
    let asked = |stage: &Stage| (stage.smsd.requests(), stage.smd3.lines().len());
    sleep(10 * SECOND).await;
    assert_eq!(asked(&stage), (0, 0));
    let mut viewer = stage.watch("").await;
    viewer.during(SECOND).await;
    let (smsd, smd3) = asked(&stage);
    assert!(smsd > 20 && smd3 > 15, "{smsd} {smd3}");
    drop(viewer);
    sleep(SECOND).await;
    asked(&stage);
    sleep(60 * SECOND).await;
    assert_eq!(asked(&stage), (0, 0));
}

#[tokio::test(start_paused = true)]
async fn a_controller_that_falls_silent_is_lost_within_a_second() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    viewer.during(2 * SECOND).await;
    stage.smsd.otherwise(Fault::LoseRequest);
    stage.smd3.otherwise(station::Fault::LoseLine);
    let began = Instant::now();
    let mut lost = Vec::new();
    while lost.len() < 2 {
        let states = viewer.event("states").await;
        lost.extend(states["s"].as_array().expect("states").iter().filter(|state| has(state, LOST)).cloned());
    }
    assert!(began.elapsed() <= SECOND, "{:?}", began.elapsed());
    for state in &lost {
        let age = state["a"].as_u64().expect("an age");
        assert!((700..=1000).contains(&age), "{age}");
        assert!(
            state["w"].as_str().is_some_and(|why| why.ends_with("did not answer within 700ms")),
            "{state}"
        );
    }
    stage.smsd.heal();
    stage.smd3.otherwise(station::Fault::None);
    let began = Instant::now();
    viewer.state(0, |state| !has(state, LOST) && state["a"].is_null()).await;
    assert!(began.elapsed() <= 3 * SECOND, "{:?}", began.elapsed());
}

#[tokio::test(start_paused = true)]
async fn a_controller_that_cannot_be_reached_is_lost_at_once_and_says_why() {
    let stage = Stage::new();
    let mut viewer = stage.watch("?focus=stage").await;
    viewer.during(SECOND).await;
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    let began = Instant::now();
    let lost = viewer.state(0, |state| has(state, LOST)).await;
    assert!(began.elapsed() <= SECOND, "{:?}", began.elapsed());
    assert!(lost["w"].as_str().is_some_and(|why| why.starts_with("cannot connect to stage: ")), "{lost}");
    let focus = viewer.event("focus").await;
    assert!(has(&focus, LOST) && focus["a"].as_u64().is_some() && focus["w"].is_string(), "{focus}");
}

#[tokio::test(start_paused = true)]
async fn what_was_read_before_everybody_left_is_kept_with_its_age() {
    let stage = Stage::new();
    stage.post("/v1/axes/stage/move", r#"{"by":"10mm","speed":"10mm/s"}"#).await.done();
    sleep(3 * SECOND).await;
    let mut viewer = stage.watch("").await;
    viewer.state(0, |state| state["p"] == 10.0).await;
    drop(viewer);
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    sleep(7 * SECOND).await;
    let mut viewer = stage.watch("?focus=stage").await;
    let seen = viewer.state(0, |_| true).await;
    assert!(has(&seen, UNREAD) && seen["p"] == 10.0, "{seen}");
    let age = seen["a"].as_u64().expect("an age");
    assert!((6900..=7200).contains(&age), "{seen}");
    let seen = viewer.state(0, |state| has(state, LOST)).await;
    assert!(!has(&seen, UNREAD) && seen["p"] == 10.0, "{seen}");
    let age = seen["a"].as_u64().expect("an age");
    assert!((6900..=9000).contains(&age), "{seen}");
    let axis = stage.get("/v1/axes/stage").await.done();
    assert!(has(&axis, LOST) && axis["p"] == 10.0 && axis["a"].as_u64() >= Some(age), "{axis}");
    drop(viewer);
    // Whoever comes next sees at once that it was lost.
    let seen = stage.watch("").await.state(0, |_| true).await;
    assert!(has(&seen, LOST) && seen["a"].as_u64() >= Some(age), "{seen}");
    stage.smsd.refuse_connections(0);
    let seen = stage.watch("").await.state(0, |state| !has(state, LOST)).await;
    assert_eq!(seen["a"], Value::Null, "{seen}");
}

#[tokio::test(start_paused = true)]
async fn one_that_was_never_read_has_no_age() {
    let stage = Stage::new();
    stage.smsd.refuse_connections(u32::MAX);
    for _ in 0..2 {
        let seen = stage.watch("").await.state(0, |state| has(state, LOST)).await;
        assert!(has(&seen, UNREAD) && seen["a"] == Value::Null, "{seen}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_reversed_axis_has_a_negative_number_of_steps_to_the_unit() {
    let bench = Bench::new();
    let scale = Scale::millimetres(Decimal::whole(5), 200).expect("a scale").reversed();
    let motor = SmsdMotor::new("stage", bench.another(SmsdOptions::default()));
    let axes = vec![axis("stage", Controller::Smsd(Arc::new(DriveAxis::new(motor).with_scale(scale))))];
    let stage = Stage { panel: Panel::new(axes), smsd: bench, ..Stage::new() };
    stage.post("/v1/axes/stage/move", r#"{"by":"10mm","speed":"10mm/s"}"#).await.done();
    sleep(3 * SECOND).await;
    let detail = stage.get("/v1/axes/stage").await.done();
    assert_eq!(
        (&detail["steps_per_unit"], &detail["p"], &detail["steps"]),
        (&json!(-40.0), &json!(10.0), &json!(-400.0))
    );
}

#[tokio::test(start_paused = true)]
async fn who_looks_closely_sees_that_settings_were_changed() {
    let stage = Stage::new();
    let mut before = 0;
    for (method, path, body) in [
        ("PUT", "stage/settings", r#"{"set":{"ACC":2000}}"#),
        ("POST", "stage/settings/apply-lan", ""),
        ("POST", "stage/clear", ""),
        ("POST", "stage/home", r#"{"direction":"+"}"#),
        ("PUT", "uhv/settings", r#"{"set":{"VSTOP":20}}"#),
        ("POST", "uhv/settings/store", ""),
        ("POST", "uhv/settings/load", ""),
    ] {
        if path == "uhv/settings" {
            before = 0;
        }
        stage.begin(method, &format!("/v1/axes/{path}"), body).await.expect("no panic").done();
        stage.post("/v1/axes/stage/stop", "{}").await;
        sleep(SECOND).await;
        let name = path.split('/').next().expect("a name");
        let revision = stage.get(&format!("/v1/axes/{name}")).await.done()["rev"].as_u64().expect("a number");
        assert!(revision > before, "{path}");
        before = revision;
    }
    let focus = stage.watch("?focus=uhv").await.event("focus").await;
    assert_eq!(focus["rev"], before);
}

#[tokio::test(start_paused = true)]
async fn one_that_does_not_answer_holds_no_other_up() {
    let stage = Stage::new();
    stage.smd3.deafen(true);
    let mut viewer = stage.watch("").await;
    viewer.during(SECOND).await;
    stage.post("/v1/axes/stage/move", r#"{"by":"10mm","speed":"10mm/s"}"#).await.done();
    let moving = states(&viewer.during(SECOND).await);
    assert!(moving.iter().filter(|state| state["i"] == 0).count() >= 8, "{moving:?}");
}

#[tokio::test(start_paused = true)]
async fn two_who_watch_see_the_same() {
    let stage = Stage::new();
    let (mut one, mut other) = (stage.watch("").await, stage.watch("?every=20ms").await);
    stage.post("/v1/axes/stage/move", r#"{"by":"5mm"}"#).await.done();
    sleep(3 * SECOND).await;
    let last = |events: Vec<(String, Value)>| states(&events).into_iter().rfind(|state| state["i"] == 0);
    let (one, other) = (last(one.during(SECOND).await), last(other.during(SECOND).await));
    assert_eq!(one, other);
    assert_eq!(one.expect("a state")["p"], 5.0);
    let before = stage.smsd.requests();
    assert!(before < 500, "what one sees is read once for all: {before}");
}

#[tokio::test(start_paused = true)]
async fn one_axis_is_seen_closely() {
    let stage = Stage::new();
    let mut viewer = stage.watch("?focus=stage").await;
    viewer.during(SECOND).await;
    stage.post("/v1/axes/stage/move", r#"{"by":"10mm","speed":"10mm/s"}"#).await.done();
    let focus = viewer.during(SECOND).await.into_iter().filter(|(name, _)| name == "focus");
    let focus: Vec<Value> = focus.map(|(_, data)| data).collect();
    assert!((20..=27).contains(&focus.len()), "{}", focus.len());
    let last = focus.last().expect("some");
    assert_eq!((&last["target"], &last["name"]), (&json!(10.0), &json!("stage")));
    assert_eq!((&last["flags"]["HiZ"], &last["inputs"]["IN0"]), (&json!(false), &json!(false)));
    assert!((last["steps"].as_f64().expect("steps") / 40.0 - last["p"].as_f64().expect("p")).abs() < 1e-3);
    assert_eq!(last["program"], json!({ "running": false, "mem": 0, "line": 0 }));
    let begun = focus.iter().position(|look| look["v"].as_f64() > Some(0.0)).expect("it moves");
    let times: Vec<u64> = focus.iter().filter_map(|look| look["t"].as_u64()).collect();
    assert!(
        begun == 0 || times[begun] - times[begun - 1] <= 50,
        "the look before the change is told: {times:?}"
    );
    sleep(SECOND).await;
    let rest = viewer.during(5 * SECOND).await;
    let rest =
        rest.iter().filter(|(name, data)| name == "focus" && data["v"] == 0.0 && data["target"].is_null());
    assert!((8..=14).contains(&rest.count()), "at rest it is told now and then");
}

#[tokio::test(start_paused = true)]
async fn what_an_smd3_has_is_seen_closely_too() {
    let stage = Stage::new();
    let mut viewer = stage.watch("?focus=uhv").await;
    viewer.during(SECOND).await;
    stage.post("/v1/axes/uhv/stop", r#"{"how":"hard"}"#).await.done();
    let mut focus = viewer.event("focus").await;
    while focus["flags"]["EMERGENCY STOP"] != true || focus["e"] == json!([]) {
        focus = viewer.event("focus").await;
    }
    assert_eq!(focus["e"], json!(["EMERGENCY STOP"]));
    assert!(has(&focus, 128) && focus["q"]["TMOT"].is_number() && focus["program"].is_null());
    stage.post("/v1/axes/uhv/clear", "{}").await.done();
    viewer.state(1, |state| !has(state, 128)).await;
}

#[tokio::test(start_paused = true)]
async fn a_move_that_something_stops_is_told() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    viewer.during(SECOND).await;
    stage.post("/v1/axes/stage/move", r#"{"by":"50mm","speed":"5mm/s"}"#).await.done();
    sleep(SECOND).await;
    stage.smsd.another(SmsdOptions::default()).soft_stop().await.expect("stopped");
    let notice = viewer.event("notice").await;
    let text = notice["text"].as_str().expect("a text");
    assert!(
        text.starts_with("stage stands at ")
            && text.ends_with(" instead of 50 mm: somebody or something stopped it on the way"),
        "{text}"
    );
    stage.post("/v1/axes/stage/move", r#"{"by":"50mm","speed":"5mm/s"}"#).await.done();
    sleep(SECOND).await;
    stage.post("/v1/axes/stage/stop", "{}").await.done();
    let after = viewer.during(5 * SECOND).await;
    assert!(after.iter().all(|(name, _)| name != "notice"), "who stops it here knows: {after:?}");
}

#[tokio::test(start_paused = true)]
async fn what_is_asked_of_the_stream_is_checked() {
    let stage = Stage::new();
    for (query, part) in [
        ("?focus=nobody", "there is no axis `nobody`"),
        ("?every=1ms", "`every` is 20ms to 1min"),
        ("?every=soon", ""),
    ] {
        let (status, why) = stage.get(&format!("/v1/axes/events{query}")).await.error();
        assert_eq!((status, why.contains(part)), (422, true), "{why}");
    }
    assert_eq!(stage.get("/v1/axes/events?evry=1s").await.error().0, 400);
}

#[tokio::test(start_paused = true)]
async fn at_most_32_watch() {
    let stage = Stage::new();
    let mut viewers = Vec::new();
    for _ in 0..32 {
        viewers.push(stage.watch("").await);
    }
    assert_eq!(stage.get("/v1/axes/events").await.error().0, 503);
    viewers.pop();
    stage.watch("").await;
}

#[tokio::test(start_paused = true)]
async fn a_thousand_axes_are_read_twice_a_second_and_lost_within_a_second() {
    let benches: Vec<Bench> = (0..1000).map(|_| Bench::new()).collect();
    let axes = benches.iter().enumerate().map(|(number, bench)| {
        let motor = SmsdMotor::new("one of many", bench.another(SmsdOptions::default()));
        axis(&format!("a{number}"), Controller::Smsd(Arc::new(DriveAxis::new(motor))))
    });
    let panel = Panel::new(axes.collect());
    let stage = Stage { panel, ..Stage::new() };
    let mut viewer = stage.watch("").await;
    viewer.during(2 * SECOND).await;
    assert!(benches.iter().all(|bench| bench.requests() > 0));
    viewer.during(2 * SECOND).await;
    let asked: Vec<u64> = benches.iter().map(Bench::requests).collect();
    // A look is two requests, and now and then two more.
    assert!(asked.iter().all(|count| (6..=12).contains(count)), "{asked:?}");
    benches[999].otherwise(Fault::LoseRequest);
    let began = Instant::now();
    viewer.state(999, |state| has(state, LOST)).await;
    assert!(began.elapsed() <= SECOND, "{:?}", began.elapsed());
    sleep(10 * MS).await;
}

#[tokio::test(start_paused = true)]
async fn one_that_does_not_let_us_in_is_seldom_asked() {
    let stage = Stage::new();
    let wrong = SmsdOptions { password: 1, ..SmsdOptions::default() };
    let motor = SmsdMotor::new("stage", stage.smsd.another(wrong));
    let axes = vec![axis("stage", Controller::Smsd(Arc::new(DriveAxis::new(motor))))];
    let stage = Stage { panel: Panel::new(axes), ..stage };
    let mut viewer = stage.watch("").await;
    let is_refused = |state: &Value| state["w"].as_str().is_some_and(|why| why.contains("password"));
    viewer.state(0, is_refused).await;
    stage.smsd.requests();
    viewer.during(60 * SECOND).await;
    // Each attempt locks the controller for everybody else for a second.
    let asked = stage.smsd.requests();
    assert!((5..=90).contains(&asked), "{asked}");
}

#[tokio::test(start_paused = true)]
async fn a_login_that_takes_longer_than_a_look_comes_to_its_end() {
    let bench = Bench::of(WordOrder::HighFirst, SmsdOptions::default());
    let motor = SmsdMotor::new("stage", bench.another(SmsdOptions::default()));
    let axes = vec![axis("stage", Controller::Smsd(Arc::new(DriveAxis::new(motor))))];
    let stage = Stage { panel: Panel::new(axes), smsd: bench, ..Stage::new() };
    let mut viewer = stage.watch("").await;
    let began = Instant::now();
    viewer.state(0, |state| !has(state, LOST) && !has(state, UNREAD)).await;
    assert!(began.elapsed() < 3 * SECOND, "{:?}", began.elapsed());
}
