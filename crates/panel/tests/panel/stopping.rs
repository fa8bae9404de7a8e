//! Stops come through, whatever else goes on.

use crate::bench::Bench;
use crate::link::Fault;
use crate::stage::{Answer, MS, SECOND, Stage, ask, axis};
use crate::station;
use futures_util::FutureExt as _;
use serde_json::json;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use stepdrive_host::axis::{DriveAxis, SmsdMotor, SoftLimits};
use stepdrive_host::smsd::SmsdOptions;
use stepdrive_host::trust::TrustState;
use stepdrive_panel::{Controller, Keeper, Kept, Panel};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::{Instant, sleep, timeout};

const STOP_ALL: &str = "/v1/axes/stop";
const STOP: &str = "/v1/axes/stage/stop";

fn acted(stage: &Stage, coil: Reg) -> bool {
    stage.smsd.acts().contains(&(coil, 1))
}

#[tokio::test(start_paused = true)]
async fn a_stop_goes_through_while_another_request_hangs() {
    let stage = Stage::new();
    stage.post("/v1/axes/stage/run", r#"{"direction":"+","speed":5}"#).await.done();
    sleep(500 * MS).await;
    // One request is taken and never answered; the line is good again behind it.
    stage.smsd.faults([Fault::LoseReply]);
    let hanging = stage.begin("GET", "/v1/axes/stage/programs", "");
    sleep(MS).await;
    let began = Instant::now();
    stage.post(STOP, r#"{"how":"soft"}"#).await.done();
    assert!(began.elapsed() <= 100 * MS, "{:?}", began.elapsed());
    assert!(acted(&stage, Reg::SoftStop));
    let (status, why) = hanging.await.expect("no panic").error();
    assert_eq!(status, 409);
    assert!(why.contains("was told to stop, and what else was under way on its line was given up"), "{why}");
}

#[tokio::test(start_paused = true)]
async fn a_stop_does_not_disturb_what_lets_it_through() {
    let stage = Stage::new();
    let text = "RUN_F 200\n".repeat(200) + "END\n";
    let body = serde_json::json!({ "text": text }).to_string();
    stage.energise().await;
    stage.smsd.otherwise(Fault::Delay(2 * MS));
    let storing = stage.begin("PUT", "/v1/axes/stage/programs", &body);
    sleep(60 * MS).await;
    let began = Instant::now();
    stage.post(STOP, "{}").await.done();
    // Behind the stop itself it is seen to that no program moves the motor again.
    assert!(began.elapsed() <= 30 * MS, "{:?}", began.elapsed());
    assert!(acted(&stage, Reg::SoftStop));
    storing.await.expect("no panic").done();
}

#[tokio::test(start_paused = true)]
async fn a_stop_ends_a_jog_and_is_what_it_says() {
    for (how, coil) in [("soft", Reg::SoftStop), ("hard", Reg::HardStop), ("free", Reg::SoftHiZ)] {
        let stage = Stage::new();
        stage.jog("me").await.done();
        sleep(300 * MS).await;
        stage.smsd.acts();
        stage.post(STOP, &format!(r#"{{"how":"{how}"}}"#)).await.done();
        sleep(3 * SECOND).await;
        assert_eq!(stage.smsd.acts(), [(coil, 1)], "{how}: nothing else stops it afterwards");
        assert!(stage.speed() == 0.0);
    }
}

#[tokio::test(start_paused = true)]
async fn a_stop_that_fails_while_jogging_is_sent_again_until_it_gets_through() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    sleep(300 * MS).await;
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    assert_eq!(stage.post(STOP, "{}").await.status, 502);
    stage.smsd.refuse_connections(0);
    sleep(5 * SECOND).await;
    assert!(stage.speed() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn a_client_that_hangs_up_has_its_stop_all_the_same() {
    let stage = Stage::new();
    stage.post("/v1/axes/uhv/run", r#"{"direction":"+","speed":500}"#).await.done();
    sleep(SECOND).await;
    // Free: it brakes, and is disabled once it stands.
    let asked = timeout(Duration::ZERO, stage.post("/v1/axes/uhv/stop", r#"{"how":"free"}"#)).await;
    assert!(asked.is_err(), "it has hung up");
    sleep(5 * SECOND).await;
    let carried_out = stage.smd3.carried_out();
    assert!(carried_out.ends_with(&[Command::Stop, Command::Estop]), "{carried_out:?}");
}

#[tokio::test(start_paused = true)]
async fn an_smd3_whose_line_hangs_is_stopped_as_soon_as_it_is_heard() {
    let stage = Stage::new();
    stage.post("/v1/axes/uhv/run", r#"{"direction":"+","speed":500}"#).await.done();
    sleep(SECOND).await;
    stage.smd3.faults([station::Fault::LoseReply]);
    let hanging = stage.begin("GET", "/v1/axes/uhv", "");
    sleep(MS).await;
    let began = Instant::now();
    stage.post("/v1/axes/uhv/stop", r#"{"how":"soft"}"#).await.done();
    assert!(began.elapsed() <= 300 * MS, "{:?}", began.elapsed());
    sleep(SECOND).await;
    assert!(stage.smd3.velocity() == 0.0);
    hanging.await.expect("no panic").done();
}

const NOT_YET: &str = "stage could not be told to stop yet: cannot connect to stage: connection refused; it is told again until it can be";

/// The SMSD runs, and its line is lost.
async fn lost_while_it_runs() -> Stage {
    let stage = Stage::new();
    stage.post("/v1/axes/stage/run", r#"{"direction":"+","speed":5}"#).await.done();
    sleep(500 * MS).await;
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    stage.smsd.acts();
    stage
}

/// Whatever was seen of the line last, that the stop has not got through is told.
#[track_caller]
fn assert_not_yet(answer: &Answer) {
    let (status, why) = answer.error();
    assert_eq!(status, 502);
    assert!(why.starts_with("stage could not be told to stop yet: "), "{why}");
    assert!(why.ends_with("; it is told again until it can be"), "{why}");
}

/// How often a coil has acted since this was last asked.
fn times(stage: &Stage, coil: Reg) -> usize {
    stage.smsd.acts().into_iter().filter(|act| *act == (coil, 1)).count()
}

#[tokio::test(start_paused = true)]
async fn a_stop_on_a_dead_line_is_answered_within_a_second_and_told_once_it_can_be() {
    for watched in [false, true] {
        let stage = lost_while_it_runs().await;
        let _viewer = if watched { Some(stage.watch("?focus=stage").await) } else { None };
        for _ in 0..20 {
            let began = Instant::now();
            assert_not_yet(&stage.post(STOP, "{}").await);
            assert!(began.elapsed() <= 1010 * MS, "{:?}", began.elapsed());
        }
        assert!(stage.speed() > 100.0);
        stage.smsd.refuse_connections(0);
        sleep(5 * SECOND).await;
        assert!(stage.speed() == 0.0);
        assert!(
            (1..=2).contains(&times(&stage, Reg::SoftStop)),
            "one tells it, whatever the number of presses"
        );
        sleep(5 * SECOND).await;
        assert_eq!(times(&stage, Reg::SoftStop), 0, "it has been told");
    }
}

#[tokio::test(start_paused = true)]
async fn a_stop_that_nobody_answers_says_so_within_a_second() {
    let stage = lost_while_it_runs().await;
    stage.smsd.heal();
    stage.smsd.let_connections_hang(true);
    let began = Instant::now();
    let (status, why) = stage.post(STOP, "{}").await.error();
    assert!(began.elapsed() <= 1010 * MS, "{:?}", began.elapsed());
    assert_eq!(status, 502);
    assert_eq!(why, "stage has not confirmed within 1s that it stops; it is told again until it does");
}

#[tokio::test(start_paused = true)]
async fn while_a_jog_is_being_ended_on_a_dead_line_a_stop_is_answered_as_soon() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    sleep(300 * MS).await;
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    assert_not_yet(&stage.post("/v1/axes/stage/jog/end", r#"{"id":"me"}"#).await);
    for _ in 0..10 {
        let began = Instant::now();
        assert_not_yet(&stage.post(STOP, "{}").await);
        assert!(began.elapsed() <= 1010 * MS, "{:?}", began.elapsed());
    }
    stage.smsd.acts();
    stage.smsd.refuse_connections(0);
    sleep(5 * SECOND).await;
    assert!(stage.speed() == 0.0);
    assert!((1..=2).contains(&times(&stage, Reg::SoftStop)), "one tells it, whatever the number of presses");
}

#[tokio::test(start_paused = true)]
async fn the_stop_that_was_asked_for_last_is_the_one_that_is_told() {
    let stage = lost_while_it_runs().await;
    stage.post(STOP, "{}").await;
    stage.post(STOP, r#"{"how":"free"}"#).await;
    stage.smsd.refuse_connections(0);
    sleep(5 * SECOND).await;
    let acts = stage.smsd.acts();
    assert!(!acts.contains(&(Reg::SoftStop, 1)) && acts.contains(&(Reg::SoftHiZ, 1)), "{acts:?}");
}

#[tokio::test(start_paused = true)]
async fn no_other_stop_is_waited_for_by_one_that_is_harder() {
    let stage = Stage::new();
    stage.post("/v1/axes/uhv/run", r#"{"direction":"+","speed":500}"#).await.done();
    sleep(SECOND).await;
    let began = Instant::now();
    stage.post("/v1/axes/uhv/stop", r#"{"how":"free"}"#).await.done();
    assert!(
        began.elapsed() <= 100 * MS && stage.smd3.velocity() > 0.0,
        "it brakes, and nobody waits for that"
    );
    stage.post("/v1/axes/uhv/stop", r#"{"how":"hard"}"#).await.done();
    assert!(began.elapsed() <= 200 * MS, "{:?}", began.elapsed());
    assert!(stage.smd3.velocity() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn all_are_told_at_once_and_those_that_were_not_yet_are_named() {
    let stage = lost_while_it_runs().await;
    stage.post("/v1/axes/uhv/run", r#"{"direction":"+","speed":500}"#).await.done();
    sleep(SECOND).await;
    let began = Instant::now();
    let told = stage.post(STOP_ALL, "{}").await.done();
    assert!(began.elapsed() <= 1010 * MS, "{:?}", began.elapsed());
    assert_eq!(told, json!({ "stopped": 1, "not_yet": [{ "axis": "stage", "error": NOT_YET }] }));
    sleep(SECOND).await;
    assert!(stage.smd3.velocity() == 0.0);
    stage.smsd.refuse_connections(0);
    sleep(5 * SECOND).await;
    assert!(stage.speed() == 0.0);
    let told = stage.post(STOP_ALL, r#"{"how":"free"}"#).await.done();
    assert_eq!(told, json!({ "stopped": 2, "not_yet": [] }));
    assert!(acted(&stage, Reg::SoftHiZ));
}

#[tokio::test(start_paused = true)]
async fn a_thousand_that_run_are_all_stopped_by_one_request() {
    let benches: Vec<Bench> = (0..1000).map(|_| Bench::new()).collect();
    let axes = benches.iter().enumerate().map(|(number, bench)| {
        let motor = SmsdMotor::new("one of many", bench.another(SmsdOptions::default()));
        axis(&format!("a{number}"), Controller::Smsd(Arc::new(DriveAxis::new(motor))))
    });
    let stage = Stage { panel: Panel::new(axes.collect()), ..Stage::new() };
    let _viewer = stage.watch("").await;
    for number in 0..benches.len() {
        let run = format!("/v1/axes/a{number}/run");
        stage.post(&run, r#"{"direction":"+","speed":200}"#).await.done();
    }
    let began = Instant::now();
    let told = stage.post(STOP_ALL, "{}").await.done();
    assert!(began.elapsed() <= 1010 * MS, "{:?}", began.elapsed());
    assert_eq!(told, json!({ "stopped": 1000, "not_yet": [] }));
    sleep(5 * SECOND).await;
    assert!(benches.iter().all(|bench| bench.look(Reg::Speed, 0) == 0));
}

/// A keeper that is slow: while it first keeps, somebody stops the axis.
#[derive(Clone, Default)]
struct Slow(Arc<Mutex<Option<axum::Router>>>);

impl Keeper for Slow {
    fn keep(&self, _: TrustState, why: Kept) {
        if why == Kept::Acted
            && let Some(router) = self.0.lock().expect("no panic").take()
        {
            // It is told of, and goes on by itself.
            let _ = ask(router, "POST", STOP, Some("{}")).now_or_never();
        }
    }

    fn news(&self) -> Option<TrustState> {
        None
    }
}

#[tokio::test(start_paused = true)]
async fn a_stop_while_it_is_noted_down_that_an_axis_sets_off_is_not_lost() {
    for (what, body) in [
        ("run", r#"{"direction":"+","speed":5}"#),
        ("move", r#"{"by":20,"speed":5}"#),
        ("home", r#"{"direction":"+","speed":5}"#),
        ("jog", r#"{"direction":"+","speed":5,"id":"me"}"#),
    ] {
        let slow = Slow::default();
        let stage = Stage::with(SoftLimits::OFF, Some(Box::new(slow.clone())));
        *slow.0.lock().expect("no panic") = Some(stage.router());
        let answer = stage.post(&format!("/v1/axes/stage/{what}"), body).await;
        sleep(300 * MS).await;
        assert!(stage.speed() == 0.0, "{what}: {answer:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_stop_waits_for_no_look_whatever_that_asks() {
    // The first look asks for the model, too.
    for hanging in 0..12 {
        let stage = Stage::new();
        stage.smsd.fault_behind(hanging, Fault::LoseReply);
        let _viewer = stage.watch("?focus=stage").await;
        sleep(30 * MS).await;
        // What hangs hangs now.
        stage.smsd.faults([]);
        let began = Instant::now();
        stage.post(STOP, "{}").await.done();
        assert!(began.elapsed() <= 110 * MS, "{hanging}: {:?}", began.elapsed());
    }
}
