//! Stops come through, whatever else goes on.

use crate::link::Fault;
use crate::stage::{MS, SECOND, Stage};
use crate::station;
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::{Instant, sleep, timeout};

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
    stage.smsd.otherwise(Fault::Delay(2 * MS));
    let storing = stage.begin("PUT", "/v1/axes/stage/programs", &body);
    sleep(60 * MS).await;
    let began = Instant::now();
    stage.post(STOP, "{}").await.done();
    assert!(began.elapsed() <= 10 * MS, "{:?}", began.elapsed());
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
    let asked = timeout(MS, stage.post("/v1/axes/uhv/stop", r#"{"how":"free"}"#)).await;
    assert!(asked.is_err(), "it takes its time");
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
