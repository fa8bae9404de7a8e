//! Jogging, and the dead man's timer.

use crate::link::Fault;
use crate::stage::{MS, SECOND, Stage, has};
use serde_json::json;
use std::time::Duration;
use stepdrive_host::Direction;
use stepdrive_host::axis::SoftLimits;
use stepdrive_host::smsd::{Smsd as _, SmsdOptions};
use stepdrive_host::units::Decimal;
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::{Instant, sleep, sleep_until};

const SOFT_STOP: (Reg, u16) = (Reg::SoftStop, 1);
const END: &str = "/v1/axes/stage/jog/end";

/// How many soft stops have come since this was last asked.
fn stops(stage: &Stage) -> usize {
    stage.smsd.acts().iter().filter(|act| **act == SOFT_STOP).count()
}

/// Whether it turns so fast. The motor chip rounds its highest speed down to a multiple of 15.26 full steps a second.
fn turns_at(stage: &Stage, speed: f64) -> bool {
    (speed - 15.3..=speed).contains(&stage.speed())
}

#[tokio::test(start_paused = true)]
async fn a_jog_that_is_not_renewed_ends_500_ms_after_it_was_asked_for() {
    let stage = Stage::new();
    let began = Instant::now();
    assert_eq!(stage.jog("me").await.done(), json!({ "ends_in_ms": 500 }));
    sleep_until(began + 499 * MS).await;
    assert!(stage.speed() > 100.0);
    assert_eq!(stops(&stage), 0);
    sleep_until(began + 501 * MS).await;
    assert_eq!(stops(&stage), 1);
    sleep(2 * SECOND).await;
    assert!(stage.speed() == 0.0 && stage.place() > 1.0);
}

#[tokio::test(start_paused = true)]
async fn a_jog_goes_on_for_as_long_as_it_is_renewed_and_ends_500_ms_after_the_last_time() {
    let stage = Stage::new();
    let began = Instant::now();
    for renewal in 0..20 {
        sleep_until(began + 150 * MS * renewal).await;
        stage.jog("me").await.done();
    }
    assert_eq!(stops(&stage), 0);
    let last = began + 150 * MS * 19;
    sleep_until(last + 499 * MS).await;
    assert_eq!(stops(&stage), 0);
    assert!(turns_at(&stage, 200.0));
    sleep_until(last + 501 * MS).await;
    assert_eq!(stops(&stage), 1);
}

#[tokio::test(start_paused = true)]
async fn letting_go_of_the_key_stops_at_once() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    sleep(300 * MS).await;
    let began = Instant::now();
    stage.post(END, r#"{"id":"me"}"#).await.done();
    assert_eq!((stops(&stage), began.elapsed()), (1, Duration::ZERO));
    sleep(2 * SECOND).await;
    assert!(stage.speed() == 0.0);
    assert_eq!(stops(&stage), 0, "the timer does not stop it again");
}

#[tokio::test(start_paused = true)]
async fn a_renewal_that_hangs_holds_nothing_up() {
    let stage = Stage::new();
    let began = Instant::now();
    stage.jog("me").await.done();
    sleep_until(began + 100 * MS).await;
    // Another speed: the controller is asked, and says nothing.
    stage.smsd.otherwise(Fault::LoseReply);
    let renewal = stage.begin("POST", "/v1/axes/stage/jog", r#"{"direction":"+","speed":9,"id":"me"}"#);
    sleep_until(began + 599 * MS).await;
    assert_eq!(stops(&stage), 0);
    stage.smsd.otherwise(Fault::None);
    sleep_until(began + 705 * MS).await;
    assert_eq!(stops(&stage), 1, "600 ms, and 100 ms in which the lost request is given up");
    renewal.await.expect("no panic").done();
}

#[tokio::test(start_paused = true)]
async fn a_start_that_hangs_is_followed_by_a_stop_all_the_same() {
    let stage = Stage::new();
    stage.get("/v1/axes/stage").await.done();
    let began = Instant::now();
    // The command goes out; the reply to it is lost. What is asked before it is answered.
    stage.smsd.otherwise(Fault::Delay(60 * MS));
    let started = stage.begin("POST", "/v1/axes/stage/jog", r#"{"direction":"+","speed":5,"id":"me"}"#);
    sleep_until(began + 499 * MS).await;
    stage.smsd.otherwise(Fault::None);
    sleep_until(began + 700 * MS).await;
    assert_eq!(stops(&stage), 1);
    sleep(2 * SECOND).await;
    assert!(stage.speed() == 0.0);
    drop(started);
}

#[tokio::test(start_paused = true)]
async fn a_client_that_hangs_up_while_it_asks_leaves_the_timer_running() {
    let stage = Stage::new();
    let began = Instant::now();
    stage.smsd.otherwise(Fault::Delay(10 * MS));
    let asked = stage.begin("POST", "/v1/axes/stage/jog", r#"{"direction":"+","speed":5,"id":"me"}"#);
    sleep(15 * MS).await;
    asked.abort();
    stage.smsd.otherwise(Fault::None);
    sleep_until(began + 450 * MS).await;
    assert!(stage.speed() > 50.0);
    sleep_until(began + 501 * MS).await;
    assert_eq!(stops(&stage), 1);
}

#[tokio::test(start_paused = true)]
async fn two_clients_cannot_jog_an_axis_at_once() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    let (status, why) = stage.jog("you").await.error();
    assert_eq!((status, why.as_str()), (409, "stage is being jogged by somebody else; nothing was sent"));
    assert_eq!(stage.post(END, r#"{"id":"you"}"#).await.status, 409);
    sleep(200 * MS).await;
    assert!(stage.speed() > 0.0);
    stage.post(END, r#"{"id":"me"}"#).await.done();
    sleep(2 * SECOND).await;
    stage.jog("you").await.done();
}

#[tokio::test(start_paused = true)]
async fn another_speed_takes_effect_while_it_goes_on() {
    let stage = Stage::new();
    for speed in [5, 5, 5, 10, 10, 10, 2, 2, 2] {
        stage
            .post("/v1/axes/stage/jog", &json!({"direction": "+", "speed": speed, "id": "me"}).to_string())
            .await
            .done();
        sleep(300 * MS).await;
    }
    assert!(turns_at(&stage, 80.0), "2 mm/s, not {}", stage.speed());
    assert_eq!(stops(&stage), 0);
}

#[tokio::test(start_paused = true)]
async fn the_other_direction_brakes_first_and_then_goes_there() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    sleep(400 * MS).await;
    let there = stage.place();
    for _ in 0..10 {
        stage.post("/v1/axes/stage/jog", r#"{"direction":"-","speed":5,"id":"me"}"#).await.done();
        sleep(150 * MS).await;
    }
    assert!(stage.place() < there, "{} {there}", stage.place());
    assert_eq!(stops(&stage), 1);
}

#[tokio::test(start_paused = true)]
async fn a_press_that_has_ended_is_not_begun_again_by_a_request_that_comes_late() {
    let stage = Stage::new();
    let press = |press: u64| json!({"direction": "+", "speed": 5, "id": "me", "press": press}).to_string();
    stage.post("/v1/axes/stage/jog", &press(7)).await.done();
    sleep(300 * MS).await;
    stage.post(END, r#"{"id":"me","press":7}"#).await.done();
    for pause in [0, 5, 5000] {
        sleep(MS * pause).await;
        let (status, why) = stage.post("/v1/axes/stage/jog", &press(7)).await.error();
        assert_eq!((status, why.contains("this jog of stage has ended")), (409, true), "{why}");
    }
    stage.post("/v1/axes/stage/jog", &press(8)).await.done();
    sleep(300 * MS).await;
    assert!(stage.speed() > 0.0);
    stage.post(END, r#"{"id":"me","press":7}"#).await.done();
    assert_eq!(stops(&stage), 1, "the end of the seventh ends the eighth no more");
}

#[tokio::test(start_paused = true)]
async fn a_late_renewal_is_refused_also_when_others_have_jogged_or_failed_since() {
    let stage = Stage::new();
    let press =
        |id: &str, press: u64| json!({"direction": "+", "speed": 5, "id": id, "press": press}).to_string();
    let jog = async |id: &str, number: u64| stage.post("/v1/axes/stage/jog", &press(id, number)).await;
    for (id, number) in [("a", 5), ("b", 1), ("c", 1)] {
        jog(id, number).await.done();
        sleep(100 * MS).await;
        stage.post(END, &json!({"id": id, "press": number}).to_string()).await.done();
        sleep(2 * SECOND).await;
    }
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    let failing = stage.begin("POST", "/v1/axes/stage/jog", &press("d", 9));
    sleep(SECOND).await;
    stage.smsd.refuse_connections(0);
    sleep(5 * SECOND).await;
    failing.await.expect("no panic");
    for (id, number) in [("a", 5), ("a", 4), ("b", 1), ("c", 1), ("d", 9)] {
        let (status, why) = jog(id, number).await.error();
        assert_eq!((status, why.contains("this jog of stage has ended")), (409, true), "{id}{number}: {why}");
    }
    assert!(stage.speed() == 0.0);
    jog("a", 6).await.done();
}

#[tokio::test(start_paused = true)]
async fn a_press_while_it_brakes_is_taken_and_goes_when_it_stands() {
    let stage = Stage::new();
    let press = |press: u64| json!({"direction": "+", "speed": 5, "id": "me", "press": press}).to_string();
    stage.post("/v1/axes/stage/jog", &press(1)).await.done();
    sleep(400 * MS).await;
    stage.post(END, r#"{"id":"me","press":1}"#).await.done();
    sleep(10 * MS).await;
    assert!(stage.speed() > 0.0, "it brakes");
    for _ in 0..4 {
        stage.post("/v1/axes/stage/jog", &press(2)).await.done();
        sleep(150 * MS).await;
    }
    assert!(turns_at(&stage, 200.0));
}

#[tokio::test(start_paused = true)]
async fn the_highest_speed_is_afterwards_as_it_was_before() {
    let stage = Stage::new();
    let before = stage.smsd.look(Reg::MaxSpeed, 0);
    stage.jog("me").await.done();
    sleep(100 * MS).await;
    assert_eq!(stage.smsd.look(Reg::MaxSpeed, 0), 200);
    stage.post(END, r#"{"id":"me"}"#).await.done();
    sleep(2 * SECOND).await;
    assert_eq!(stage.smsd.look(Reg::MaxSpeed, 0), before);
}

#[tokio::test(start_paused = true)]
async fn soft_limits_hold_also_where_the_position_is_not_trusted() {
    let limits = SoftLimits::new(Decimal::whole(-1), Decimal::whole(2)).expect("in order");
    let stage = Stage::with(limits, None);
    let began = Instant::now();
    while began.elapsed() < 4 * SECOND {
        stage.jog("me").await.done();
        sleep(150 * MS).await;
    }
    assert!((stage.place() - 2.0).abs() < 1e-9, "{}", stage.place());
    stage.post(END, r#"{"id":"me"}"#).await.done();
    sleep(SECOND).await;
    let (status, why) = stage.jog("me").await.error();
    assert_eq!(status, 409);
    assert!(why.contains("at or beyond the soft limit 2mm; go the other way"), "{why}");
    assert!(stage.speed() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn who_watches_is_told_why_a_jog_ended() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    stage.jog("me").await.done();
    viewer.state(0, |state| has(state, 256)).await;
    let notice = viewer.event("notice").await;
    assert_eq!(notice["level"], "info");
    assert_eq!(notice["text"], "stage was stopped: whoever jogged it was not heard of for 500 ms");
    viewer.state(0, |state| !has(state, 256)).await;
}

#[tokio::test(start_paused = true)]
async fn a_jog_on_a_line_that_is_lost_is_stopped_as_soon_as_the_line_is_back() {
    let stage = Stage::new();
    let mut viewer = stage.watch("").await;
    stage.jog("me").await.done();
    sleep(300 * MS).await;
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    let notice = viewer.event("notice").await;
    assert_eq!(notice["level"], "info");
    let notice = viewer.event("notice").await;
    assert_eq!(notice["level"], "error");
    let text = notice["text"].as_str().expect("a text");
    assert!(text.starts_with("stage could not be told to stop yet: "), "{text}");
    sleep(5 * SECOND).await;
    assert!(stage.speed() > 100.0);
    assert_eq!(stops(&stage), 0);
    stage.smsd.refuse_connections(0);
    sleep(5 * SECOND).await;
    assert!(stops(&stage) >= 1 && stage.speed() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn closing_the_panel_ends_all_jogs() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    stage.post("/v1/axes/uhv/jog", r#"{"direction":"-","speed":100,"id":"you"}"#).await.done();
    sleep(200 * MS).await;
    stage.panel.close().await;
    assert_eq!(stops(&stage), 1);
    sleep(2 * SECOND).await;
    assert!(stage.speed() == 0.0 && stage.smd3.velocity() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn an_smd3_is_jogged_as_well() {
    let stage = Stage::new();
    let jog = |speed: u32| json!({"direction": "-", "speed": speed, "id": "me"}).to_string();
    for speed in [100, 100, 300, 300] {
        stage.post("/v1/axes/uhv/jog", &jog(speed)).await.done();
        sleep(400 * MS).await;
    }
    assert!((stage.smd3.velocity() + 300.0).abs() < 1.0, "{}", stage.smd3.velocity());
    sleep(3 * SECOND).await;
    assert!(stage.smd3.velocity() == 0.0);
    let vmax = stage.smd3.setting(stepdrive_spec::smd3::commands::Command::Vmax);
    assert!((vmax - 1000.0).abs() < 0.1, "{vmax}");
}

#[tokio::test(start_paused = true)]
async fn what_is_no_jog_is_refused_and_moves_nothing() {
    let stage = Stage::new();
    for (body, status) in [
        (r#"{"direction":"up","speed":5,"id":"me"}"#, 400),
        (r#"{"direction":"+","speed":0,"id":"me"}"#, 422),
        (r#"{"direction":"+","speed":-5,"id":"me"}"#, 422),
        (r#"{"direction":"+","speed":1e300,"id":"me"}"#, 422),
        (r#"{"direction":"+","speed":100000,"id":"me"}"#, 422),
        (r#"{"direction":"+","speed":5,"id":""}"#, 422),
        (r#"{"direction":"+","speed":5}"#, 400),
    ] {
        let answer = stage.post("/v1/axes/stage/jog", body).await;
        assert_eq!(answer.error().0, status, "{body}: {answer:?}");
    }
    assert_eq!(
        stage.post("/v1/axes/nobody/jog", r#"{"direction":"+","speed":5,"id":"me"}"#).await.status,
        422
    );
    sleep(SECOND).await;
    assert!(stage.place() == 0.0);
}

#[tokio::test(start_paused = true)]
async fn a_motor_that_goes_on_after_its_stop_is_stopped_again() {
    let stage = Stage::new();
    stage.jog("me").await.done();
    sleep(300 * MS).await;
    stage.post(END, r#"{"id":"me"}"#).await.done();
    sleep(10 * MS).await;
    // As a command that was long on its way would have it.
    stage.smsd.another(SmsdOptions::default()).run(Direction::Positive, 200).await.expect("taken");
    sleep(5 * SECOND).await;
    assert!(stage.speed() == 0.0);
    assert!(stops(&stage) >= 2);
}
