//! Which stop is told, and for how long.

use crate::link::Fault;
use crate::stage::{MS, SECOND, Stage, Viewer, axis};
use serde_json::json;
use std::sync::Arc;
use stepdrive_host::Direction;
use stepdrive_host::axis::{DriveAxis, SmsdMotor};
use stepdrive_host::smsd::{Smsd as _, SmsdOptions};
use stepdrive_panel::{Controller, Panel};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::{Instant, sleep};

const STOP_ALL: &str = "/v1/axes/stop";
const STOP: &str = "/v1/axes/stage/stop";
const RUN: &str = "/v1/axes/stage/run";
const FORWARD: &str = r#"{"direction":"+","speed":5}"#;
const FREE: &str = r#"{"how":"free"}"#;
const HARD: &str = r#"{"how":"hard"}"#;

/// What a stop lets act.
async fn told(stage: &Stage, path: &str) -> Vec<(Reg, u16)> {
    stage.smsd.acts();
    stage.post(path, "{}").await.done();
    stage.smsd.acts()
}

fn is_free(stage: &Stage) -> bool {
    stage.smsd.look(Reg::HiZ, 0) == 1
}

fn lose(stage: &Stage) {
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    stage.smsd.acts();
}

#[tokio::test(start_paused = true)]
async fn a_soft_stop_leaves_a_motor_without_current_whoever_watches() {
    for watched in [false, true] {
        let stage = Stage::new();
        let mut viewer = stage.watch("").await;
        viewer.during(SECOND).await;
        if !watched {
            drop(viewer);
            sleep(2 * SECOND).await;
        }
        for path in [STOP, STOP_ALL] {
            let acts = told(&stage, path).await;
            assert!(!acts.contains(&(Reg::SoftStop, 1)) && acts.contains(&(Reg::SoftHiZ, 1)), "{acts:?}");
            assert!(is_free(&stage));
        }
    }
}

#[tokio::test(start_paused = true)]
async fn what_moves_since_it_was_seen_or_is_energised_is_braked_and_held() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    viewer.during(SECOND).await;
    stage.post(RUN, FORWARD).await.done();
    assert!(told(&stage, STOP).await.contains(&(Reg::SoftStop, 1)));
    viewer.during(3 * SECOND).await;
    assert!(told(&stage, STOP).await.contains(&(Reg::SoftStop, 1)), "it is energised");
    drop(viewer);
    sleep(3 * SECOND).await;
    assert!(told(&stage, STOP).await.contains(&(Reg::SoftStop, 1)), "it still is");
}

#[tokio::test(start_paused = true)]
async fn what_another_program_starts_just_before_a_stop_is_braked_and_held() {
    let stage = Stage::new();
    let viewer = stage.watch("").await;
    sleep(SECOND).await;
    drop(viewer);
    sleep(300 * MS).await;
    stage.energise().await;
    assert!(told(&stage, STOP_ALL).await.contains(&(Reg::SoftStop, 1)), "what was seen is of before that");
}

#[tokio::test(start_paused = true)]
async fn a_stop_that_is_pending_leaves_a_motor_without_current_when_its_line_is_back() {
    for watched in [false, true] {
        let stage = Stage::new();
        let _viewer = if watched { Some(stage.watch("").await) } else { None };
        sleep(SECOND).await;
        lose(&stage);
        stage.post(STOP, "{}").await.error();
        sleep(3 * SECOND).await;
        stage.smsd.refuse_connections(0);
        sleep(3 * SECOND).await;
        assert!(stage.smsd.acts().contains(&(Reg::SoftHiZ, 1)), "it was told");
        assert!(is_free(&stage), "watched: {watched}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_motor_that_was_freed_while_its_line_was_lost_stays_so() {
    let stage = Stage::new();
    stage.post(RUN, FORWARD).await.done();
    let _viewer = stage.watch("").await;
    sleep(SECOND).await;
    lose(&stage);
    stage.post(STOP, "{}").await.error();
    // Its supply fails, and comes back.
    stage.smsd.machine(|machine, now| {
        machine.switch_off(now);
        machine.switch_on(now);
    });
    stage.smsd.refuse_connections(0);
    sleep(3 * SECOND).await;
    assert!(is_free(&stage) && stage.speed() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn a_jog_whose_drive_loses_its_supply_leaves_it_without_current() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    sleep(300 * MS).await;
    lose(&stage);
    sleep(SECOND).await;
    stage.smsd.machine(|machine, now| {
        machine.switch_off(now);
        machine.switch_on(now);
    });
    stage.smsd.refuse_connections(0);
    sleep(3 * SECOND).await;
    assert!(stage.smsd.acts().contains(&(Reg::SoftHiZ, 1)), "it was told");
    assert!(is_free(&stage));
}

#[tokio::test(start_paused = true)]
async fn where_it_is_seen_a_stop_asks_nothing_before() {
    let stage = Stage::new();
    let _viewer = stage.watch("?focus=stage").await;
    stage.post(RUN, FORWARD).await.done();
    sleep(SECOND).await;
    stage.smsd.otherwise(Fault::Delay(20 * MS));
    // What the looks ask is answered, and their next turn is not yet.
    stage.smsd.acts();
    let stopping = stage.begin("POST", STOP, "{}");
    let began = Instant::now();
    while !stage.smsd.acts().contains(&(Reg::SoftStop, 1)) {
        sleep(MS).await;
        assert!(began.elapsed() <= 30 * MS, "{:?}", began.elapsed());
    }
    stopping.await.expect("no panic").done();
}

#[tokio::test(start_paused = true)]
async fn a_harder_stop_that_is_pending_is_not_weakened() {
    for (first, second, coil) in [
        (HARD, "{}", Reg::HardStop),
        (FREE, "{}", Reg::SoftHiZ),
        (HARD, FREE, Reg::SoftHiZ),
        (FREE, HARD, Reg::HardStop),
    ] {
        let stage = Stage::new();
        stage.post(RUN, FORWARD).await.done();
        sleep(SECOND).await;
        lose(&stage);
        stage.post(STOP, first).await.error();
        stage.post(STOP, second).await.error();
        stage.smsd.refuse_connections(0);
        sleep(3 * SECOND).await;
        let acts = stage.smsd.acts();
        assert!(!acts.is_empty() && acts.iter().all(|act| *act == (coil, 1)), "{first} {second}: {acts:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn an_smd3_that_brakes_to_be_freed_is_freed_whoever_stops_it_meanwhile() {
    let stage = Stage::new();
    stage.post("/v1/axes/uhv/run", r#"{"direction":"+","speed":500}"#).await.done();
    sleep(SECOND).await;
    stage.post("/v1/axes/uhv/stop", FREE).await.done();
    assert!(stage.smd3.velocity() > 0.0, "it brakes");
    let began = Instant::now();
    stage.post("/v1/axes/uhv/stop", "{}").await.done();
    assert!(began.elapsed() <= 100 * MS, "{:?}", began.elapsed());
    sleep(5 * SECOND).await;
    let carried_out = stage.smd3.carried_out();
    assert!(carried_out.ends_with(&[Command::Stop, Command::Stop, Command::Estop]), "{carried_out:?}");
}

#[tokio::test(start_paused = true)]
async fn what_is_freed_while_its_program_is_being_started_is_free() {
    for after in (0..200).step_by(5) {
        let stage = Stage::new();
        let text = json!({ "text": "RUN_F 200\nEND\n" }).to_string();
        stage.put("/v1/axes/stage/programs", &text).await.done();
        stage.smsd.otherwise(Fault::Delay(30 * MS));
        let starting = stage.begin("POST", "/v1/axes/stage/programs/0/start", "");
        sleep(after * MS).await;
        stage.post(STOP, FREE).await.done();
        let _ = starting.await.expect("no panic");
        sleep(3 * SECOND).await;
        assert!(is_free(&stage), "after {after} ms");
    }
}

#[tokio::test(start_paused = true)]
async fn a_jog_that_ends_in_the_same_instant_repeats_the_stop_that_was_asked_for() {
    for (how, coil) in [(HARD, Reg::HardStop), (FREE, Reg::SoftHiZ)] {
        let stage = Stage::new();
        stage.jog("me").await.done();
        sleep(300 * MS).await;
        stage.smsd.acts();
        let ending = stage.begin("POST", "/v1/axes/stage/jog/end", r#"{"id":"me"}"#);
        let stopping = stage.begin("POST", STOP, how);
        ending.await.expect("no panic").done();
        stopping.await.expect("no panic").done();
        sleep(3 * SECOND).await;
        let acts = stage.smsd.acts();
        assert!(!acts.is_empty() && acts.iter().all(|act| *act == (coil, 1)), "{how}: {acts:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_jog_that_was_freed_and_does_not_brake_is_freed_again() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    sleep(300 * MS).await;
    stage.post(STOP, FREE).await.done();
    let other = stage.smsd.another(SmsdOptions::default());
    other.run(Direction::Positive, 200).await.expect("it can be reached");
    stage.smsd.acts();
    sleep(5 * SECOND).await;
    assert!(stage.smsd.acts().contains(&(Reg::SoftHiZ, 1)), "it was told again");
    assert!(is_free(&stage) && stage.speed() == 0.0);
}

/// What is said of a stop that is given up.
async fn given_up(viewer: &mut Viewer) -> String {
    let events = viewer.during(60 * SECOND).await.into_iter();
    let mut texts = events.filter_map(|(_, data)| data["text"].as_str().map(str::to_owned));
    texts.find(|text| text.contains("it is not told again")).expect("a notice within a minute")
}

#[tokio::test(start_paused = true)]
async fn a_stop_that_does_not_get_through_is_given_up_after_two_minutes() {
    let stage = Stage::new();
    stage.post(RUN, FORWARD).await.done();
    let mut viewer = stage.watch("").await;
    lose(&stage);
    stage.post(STOP, "{}").await.error();
    viewer.during(110 * SECOND).await;
    let asked_again = stage.post(STOP, "{}").await.error();
    assert!(asked_again.1.ends_with("it is told again until it can be"), "{}", asked_again.1);
    let before = viewer.during(115 * SECOND).await;
    assert!(before.iter().all(|(name, _)| name != "notice"), "who asks anew has the whole time");
    let notice = given_up(&mut viewer).await;
    assert_eq!(
        notice,
        "stage could not be told to stop: cannot connect to stage: connection refused; it is not told again: see to it, and stop it once more"
    );
    stage.smsd.refuse_connections(0);
    viewer.during(5 * SECOND).await;
    assert!(stage.speed() > 0.0 && stage.smsd.acts().is_empty());
    stage.post(STOP, "{}").await.done();
    sleep(3 * SECOND).await;
    assert!(stage.speed() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn a_stop_that_is_refused_for_its_password_is_tried_three_times() {
    let stage = Stage::new();
    let options = SmsdOptions { password: 1234, ..SmsdOptions::default() };
    let motor = SmsdMotor::new("stage", stage.smsd.another(options));
    let locked = axis("stage", Controller::Smsd(Arc::new(DriveAxis::new(motor))));
    let stage = Stage { panel: Panel::new(vec![locked]), ..stage };
    stage.energise().await;
    let mut viewer = stage.watch("").await;
    assert_eq!(stage.post(STOP, "{}").await.status, 502);
    given_up(&mut viewer).await;
    drop(viewer);
    stage.smsd.requests();
    sleep(60 * SECOND).await;
    assert_eq!(stage.smsd.requests(), 0);
    assert_eq!(stage.post(STOP, "{}").await.status, 502);
    assert!(stage.smsd.requests() > 0, "it is told once more");
}

#[tokio::test(start_paused = true)]
async fn while_a_stop_does_not_get_through_nothing_else_is_begun() {
    let stage = Stage::new();
    stage.post(RUN, FORWARD).await.done();
    sleep(SECOND).await;
    lose(&stage);
    stage.post(STOP, "{}").await.error();
    for (what, body) in [
        ("run", FORWARD),
        ("move", r#"{"by":20,"speed":5}"#),
        ("home", FORWARD),
        ("jog", r#"{"direction":"+","speed":5,"id":"me"}"#),
        ("programs/0/start", ""),
    ] {
        let began = Instant::now();
        let (status, why) = stage.post(&format!("/v1/axes/stage/{what}"), body).await.error();
        assert!(began.elapsed() <= 10 * MS, "{what}: {:?}", began.elapsed());
        assert_eq!(
            (status, why.as_str()),
            (
                409,
                "stage is still being told to stop: cannot connect to stage: connection refused; try again; nothing was sent"
            ),
            "{what}"
        );
    }
    stage.smsd.refuse_connections(0);
    sleep(3 * SECOND).await;
    stage.post(RUN, FORWARD).await.done();
}
