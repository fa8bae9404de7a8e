//! Moves, homing, zero and faults.

use crate::link::Fault;
use crate::stage::{MS, SECOND, Stage, has};
use serde_json::json;
use std::sync::{Arc, Mutex};
use stepdrive_host::axis::SoftLimits;
use stepdrive_host::smsd::{Smsd as _, SmsdOptions};
use stepdrive_host::trust::{Trust, TrustState};
use stepdrive_host::units::Decimal;
use stepdrive_panel::{Keeper, Kept};
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::{Instant, sleep};

const MOVE: &str = "/v1/axes/stage/move";

#[tokio::test(start_paused = true)]
async fn a_move_is_answered_when_it_has_begun() {
    let stage = Stage::new();
    let began = Instant::now();
    let plan = stage.post(MOVE, r#"{"by":"12.5mm"}"#).await.done();
    assert_eq!((&plan["from"], &plan["to"], &plan["distance"]), (&json!(0.0), &json!(12.5), &json!(12.5)));
    assert!(plan["seconds"].as_f64() > Some(1.0) && began.elapsed() < 10 * MS);
    assert!(plan["sent"][1].as_str().is_some_and(|sent| sent.ends_with("CMD = MOVE_F")), "{plan}");
    sleep(3 * SECOND).await;
    assert!((stage.place() - 12.5).abs() < 1e-9);
}

#[tokio::test(start_paused = true)]
async fn amounts_are_numbers_or_texts_with_or_without_a_unit() {
    for (by, place) in
        [("5", 5.0), ("\"5\"", 5.0), ("\"-5mm\"", -5.0), ("\"1 turn\"", 5.0), ("\"40 steps\"", 1.0)]
    {
        let stage = Stage::new();
        stage.post(MOVE, &format!(r#"{{"by":{by},"speed":"20mm/s"}}"#)).await.done();
        sleep(3 * SECOND).await;
        assert!((stage.place() - place).abs() < 1e-9, "{by}: {}", stage.place());
    }
}

#[tokio::test(start_paused = true)]
async fn a_move_to_wants_a_trusted_position_unless_it_is_overridden() {
    let stage = Stage::new();
    let (status, why) = stage.post(MOVE, r#"{"to":"5mm"}"#).await.error();
    assert_eq!((status, why.contains("has not been homed")), (409, true), "{why}");
    stage.post(MOVE, r#"{"to":"5mm","override_trust":true}"#).await.done();
    sleep(3 * SECOND).await;
    stage.post("/v1/axes/stage/zero", "").await.done();
    stage.post(MOVE, r#"{"to":-1}"#).await.done();
    sleep(3 * SECOND).await;
    assert!((stage.place() - 4.0).abs() < 1e-9);
}

#[tokio::test(start_paused = true)]
async fn a_dry_run_sends_nothing_that_moves() {
    let stage = Stage::new();
    let plan = stage.post(MOVE, r#"{"by":"12.5mm","dry_run":true}"#).await.done();
    assert_eq!(plan["to"], 12.5);
    sleep(SECOND).await;
    assert_eq!((stage.place(), stage.smsd.acts().len()), (0.0, 0));
}

#[tokio::test(start_paused = true)]
async fn every_refusal_has_its_status_and_moves_nothing() {
    let stage = Stage::with(SoftLimits::new(Decimal::whole(-1), Decimal::whole(2)).expect("in order"), None);
    for (body, status, part) in [
        (r#"{"by":"5mm"}"#, 409, "beyond the soft limits [-1, 2] mm"),
        (r#"{"by":"5deg"}"#, 422, "do not fit this axis"),
        (r#"{"by":"5furlongs"}"#, 422, "the unit `furlongs` is unknown"),
        (r#"{"by":"1mm","speed":"5"}"#, 0, ""),
        (r#"{"by":"1mm","to":"1mm"}"#, 422, "either `to` a position or `by` a distance"),
        ("{}", 422, "either `to`"),
        (r#"{"bye":"1mm"}"#, 400, "unknown field"),
        ("", 400, "the body is not what is wanted"),
    ] {
        let stage = if status == 0 { &Stage::new() } else { &stage };
        let answer = stage.post(MOVE, body).await;
        if status == 0 {
            answer.done();
            continue;
        }
        let (found, why) = answer.error();
        assert_eq!((found, why.contains(part)), (status, true), "{body}: {why}");
    }
    let (status, why) = stage.post("/v1/axes/nobody/move", r#"{"by":1}"#).await.error();
    assert_eq!((status, why.as_str()), (422, "there is no axis `nobody`; GET /v1/axes says which there are"));
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    assert_eq!(stage.post(MOVE, r#"{"by":1}"#).await.status, 502);
    assert!(stage.place() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn an_endless_motion_goes_to_the_soft_limit_and_never_the_other_way() {
    let stage = Stage::with(SoftLimits::new(Decimal::whole(-1), Decimal::whole(2)).expect("in order"), None);
    let run = |direction: &str| {
        json!({ "direction": direction, "speed": "5mm/s", "override_trust": true }).to_string()
    };
    stage.post("/v1/axes/stage/run", &run("+")).await.done();
    sleep(3 * SECOND).await;
    assert!((stage.place() - 2.0).abs() < 1e-9);
    stage.smsd.another(SmsdOptions::default()).move_by(40 * 16).await.expect("moved");
    sleep(3 * SECOND).await;
    let (status, why) = stage.post("/v1/axes/stage/run", &run("+")).await.error();
    assert_eq!((status, why.contains("go the other way")), (409, true), "{why}");
    sleep(SECOND).await;
    assert!((stage.place() - 3.0).abs() < 1e-9, "{}", stage.place());
}

#[tokio::test(start_paused = true)]
async fn homing_goes_on_by_itself_and_nothing_else_starts_meanwhile() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    viewer.during(SECOND).await;
    let begun = stage.post("/v1/axes/stage/home", r#"{"direction":"-","speed":"5mm/s"}"#).await;
    assert_eq!((begun.status.as_u16(), begun.json()), (202, json!({})));
    viewer.state(0, |state| has(state, 512)).await;
    for (path, body) in [
        ("move", r#"{"by":1}"#),
        ("run", r#"{"direction":"+"}"#),
        ("jog", r#"{"direction":"+","speed":5,"id":"me"}"#),
        ("home", r#"{"direction":"+"}"#),
        ("zero", "{}"),
    ] {
        let (status, why) = stage.post(&format!("/v1/axes/stage/{path}"), body).await.error();
        assert_eq!(
            (status, why.contains("is looking for its home switch; stop it first")),
            (409, true),
            "{path}: {why}"
        );
    }
    sleep(SECOND).await;
    assert!(stage.place() < -1.0);
    stage.smsd.change(|drive, now| drive.set_input(now, stepdrive_spec::smsd::inputs::Input::SetZero, true));
    let homed = viewer.state(0, |state| !has(state, 512)).await;
    assert!(has(&homed, 32), "trusted: {homed}");
    let after = viewer.during(SECOND).await;
    assert!(after.iter().all(|(name, _)| name != "notice"), "{after:?}");
}

#[tokio::test(start_paused = true)]
async fn homing_that_ends_otherwise_is_told() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    stage.post("/v1/axes/stage/home", r#"{"direction":"-"}"#).await.done();
    sleep(SECOND).await;
    stage.post("/v1/axes/stage/stop", "{}").await.done();
    let notice = viewer.event("notice").await;
    assert_eq!(
        notice,
        json!({ "name": "stage", "level": "info", "text": "stage was stopped before it was home" })
    );
    stage.post("/v1/axes/stage/home", r#"{"direction":"-"}"#).await.done();
    sleep(SECOND).await;
    stage.smsd.another(SmsdOptions::default()).soft_stop().await.expect("stopped");
    let notice = viewer.event("notice").await;
    assert_eq!(notice["level"], "error");
    assert!(notice["text"].as_str().is_some_and(|text| text.starts_with("stage is not home: ")), "{notice}");
    stage.post("/v1/axes/uhv/home", r#"{"direction":"-"}"#).await.done();
    let notice = viewer.event("notice").await;
    assert_eq!(
        (&notice["name"], &notice["level"]),
        (&json!("uhv"), &json!("error")),
        "its limits are not in use"
    );
}

#[tokio::test(start_paused = true)]
async fn a_fault_is_cleared_if_its_cause_is_gone() {
    let stage = Stage::new();
    stage.post("/v1/axes/uhv/stop", r#"{"how":"hard"}"#).await.done();
    let (status, why) = stage.post("/v1/axes/uhv/move", r#"{"by":10}"#).await.error();
    assert_eq!((status, why.contains("EMERGENCY STOP")), (409, true), "{why}");
    stage.post("/v1/axes/uhv/clear", "").await.done();
    stage.post("/v1/axes/uhv/move", r#"{"by":10}"#).await.done();
}

#[tokio::test(start_paused = true)]
async fn one_axis_is_told_with_all_its_flags_and_what_they_mean() {
    let stage = Stage::new();
    let axis = stage.get("/v1/axes/stage").await.done();
    assert_eq!(
        (&axis["name"], &axis["model"], &axis["unit"]),
        (&json!("stage"), &json!("SMSD-4.2LAN"), &json!("mm"))
    );
    assert_eq!(
        (&axis["virtual"], &axis["steps_per_unit"], &axis["limits"]),
        (&json!(true), &json!(40.0), &json!(null))
    );
    let table = axis["flags_table"].as_array().expect("a table");
    for row in table {
        assert!(row["about"].as_str().is_some_and(|about| about.len() > 5), "{row}");
        let name = row["name"].as_str().expect("a name");
        let kind = match row["kind"].as_str() {
            Some("input") => "inputs",
            Some("output") => "outputs",
            _ => "flags",
        };
        assert!(axis[kind].get(name).is_some_and(serde_json::Value::is_boolean), "{name}");
    }
    assert_eq!(table.len(), 10 + 8 + 1);
    let axis = stage.get("/v1/axes/UHV").await.done();
    assert_eq!((&axis["name"], axis["flags_table"].as_array().map(Vec::len)), (&json!("uhv"), Some(15)));
    stage.smsd.otherwise(Fault::LoseRequest);
    let lost = stage.get("/v1/axes/stage").await.done();
    assert!(has(&lost, 1) && lost["w"].is_string(), "{lost}");
}

/// Remembers in memory.
#[derive(Clone, Default)]
struct Memory(Arc<Mutex<Remembered>>);

/// What was kept, and the news.
type Remembered = (Vec<(Trust, Kept)>, Option<TrustState>);

impl Keeper for Memory {
    fn keep(&self, trust: TrustState, why: Kept) {
        self.0.lock().expect("no panic").0.push((trust.trust(), why));
    }

    fn news(&self) -> Option<TrustState> {
        self.0.lock().expect("no panic").1.take()
    }
}

#[tokio::test(start_paused = true)]
async fn trust_is_kept_and_what_others_have_noted_is_taken_over() {
    let memory = Memory::default();
    let stage = Stage::with(SoftLimits::OFF, Some(Box::new(memory.clone())));
    stage.energise().await;
    stage.post("/v1/axes/stage/zero", "").await.done();
    assert_eq!(memory.0.lock().expect("no panic").0.last(), Some(&(Trust::Trusted, Kept::Zeroed)));
    stage.post("/v1/axes/stage/stop", r#"{"how":"free"}"#).await.done();
    assert_eq!(memory.0.lock().expect("no panic").0.last(), Some(&(Trust::Unknown, Kept::Acted)));
    stage.smsd.change(|drive, now| drive.set_input(now, stepdrive_spec::smsd::inputs::Input::In0, true));
    stage.energise().await;
    memory.0.lock().expect("no panic").1 = Some(TrustState::parse("trusted 0").expect("a state"));
    let axis = stage.get("/v1/axes/stage").await.done();
    assert_eq!((has(&axis, 32), &axis["doubt"]), (true, &json!(null)));
    assert!(stage.smsd.look(Reg::AbsPos, 0) == 0);
}
