//! Scenarios on a rig that is served, and their recordings.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_rig::file::{ClockMode, RigFile};
use stepdrive_server::replay::replay;
use stepdrive_server::scenario::{
    PlayError, Played, Playing, Report, Scenario, StepEvent, record_headless, run_headless,
};
use stepdrive_server::{Control, Options, Recording, Server, Until};
use stepdrive_spec::time::Instant;
use tempfile::TempDir;

/// Two drives that have nothing to do with each other, and are two groups therefore.
const RIG: &str = "
    [rig]
    clock = \"paused\"
    [[drive]]
    name = \"stage\"
    model = \"SMSD-4.2LAN\"
    modbus_tcp = \"127.0.0.1:0\"
    [[drive]]
    name = \"uhv\"
    model = \"SMD3\"
    serial_tcp = \"127.0.0.1:0\"
";

/// What one group does when the other has come somewhere; and a time to the nanosecond.
const CROSSWISE: &str = "
    name = \"crosswise\"
    [[step]]
    name = \"go\"
    at = \"1s\"
    do = ['command stage RUN_F 500']
    [[step]]
    name = \"follow\"
    when = 'stage.ABS_POS >= 5000'
    do = ['line uhv RUNV,+']
    expect = 'uhv.PACT >= 300'
    within = \"10s\"
    [[step]]
    name = \"halt\"
    after = \"7ns\"
    do = ['command stage HARD_STOP', 'line uhv SSTOP']
    expect = 'uhv.STANDBY && stage.STOP'
    within = \"5s\"
";

/// In tests this is long only when they fail.
const TOO_LONG: Duration = Duration::from_secs(30);

async fn serve(folder: &Path, recording: Option<Recording>) -> Server {
    let rig = RigFile::parse(RIG).expect("a rig");
    let options = Options { state: folder.join("state"), recording, notify: Arc::new(|_| ()) };
    Server::start(&rig, options).await.expect("the rig starts")
}

fn headless(text: &str) -> Report {
    let rig = RigFile::parse(RIG).expect("a rig");
    run_headless(&rig, &Scenario::parse(text, &rig).expect("a scenario"))
}

/// What happens to the end, and the report.
async fn finish(playing: &mut Playing) -> (Vec<StepEvent>, Report) {
    let mut events = Vec::new();
    loop {
        match tokio::time::timeout(TOO_LONG, playing.next()).await.expect("it does not go on") {
            Some(Played::Step(event)) => events.push(event),
            Some(Played::Over(report)) => return (events, report),
            None => panic!("no report"),
        }
    }
}

async fn step(control: &Control, by: Duration) {
    control.run(&Until::Time, by).await.expect("time may be moved");
}

#[tokio::test]
async fn a_running_rig_plays_to_the_same_instants_as_a_headless_one() {
    let folder = TempDir::new().expect("a folder");
    let server = serve(folder.path(), None).await;
    let control = server.control();
    let mut playing = control.play(CROSSWISE).expect("it plays");
    assert_eq!((playing.name(), playing.began()), ("crosswise", Instant::ZERO));
    assert_eq!(control.playing().as_deref(), Some("crosswise"));
    control.set_clock(ClockMode::Factor(200.0));
    let (events, report) = finish(&mut playing).await;
    assert_eq!(report, headless(CROSSWISE));
    let told: Vec<(usize, bool)> =
        events.iter().map(|event| (event.number, event.outcome.is_some())).collect();
    assert_eq!(told, [(1, false), (1, true), (2, false), (2, true), (3, false), (3, true)]);
    assert_eq!(playing.next().await, None);
    assert_eq!(control.playing(), None);
    server.stop().await;
}

#[tokio::test]
async fn a_scenario_waits_while_the_clock_is_paused_and_follows_its_steps() {
    let folder = TempDir::new().expect("a folder");
    let server = serve(folder.path(), None).await;
    let control = server.control();
    let mut playing = control.play(CROSSWISE).expect("it plays");
    step(control, Duration::from_millis(999)).await;
    assert!(tokio::time::timeout(Duration::from_millis(50), playing.next()).await.is_err());
    step(control, Duration::from_mins(1)).await;
    let (_, report) = finish(&mut playing).await;
    assert_eq!(report, headless(CROSSWISE));
    server.stop().await;
}

#[tokio::test]
async fn a_condition_cannot_be_run_to_while_a_scenario_waits_for_its_own() {
    let folder = TempDir::new().expect("a folder");
    let server = serve(folder.path(), None).await;
    let control = server.control();
    let _playing = control.play(CROSSWISE).expect("it plays");
    assert_eq!(control.run(&Until::Idle, Duration::from_secs(1)).await, None);
    server.stop().await;
}

#[tokio::test]
async fn one_scenario_is_played_at_a_time_and_ends_when_it_is_dropped() {
    let folder = TempDir::new().expect("a folder");
    let server = serve(folder.path(), None).await;
    let control = server.control();
    let first = control.play(CROSSWISE).expect("it plays");
    let error = control.play(CROSSWISE).expect_err("another one is played");
    assert_eq!(
        error.to_string(),
        "the scenario `crosswise` is being played; wait until it has ended, or end it"
    );
    drop(first);
    let ended = async {
        while control.playing().is_some() {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(TOO_LONG, ended).await.expect("it ends");
    let mut second = control.play("name = 'x'\n[[step]]\nexpect = 'stage.READY'\n").expect("it plays");
    assert!(finish(&mut second).await.1.passed);
    server.stop().await;
}

#[tokio::test]
async fn a_scenario_with_a_mistake_is_not_played() {
    let folder = TempDir::new().expect("a folder");
    let server = serve(folder.path(), None).await;
    let Err(PlayError::Mistake(mistake)) =
        server.control().play("name = 'x'\n[[step]]\nexpect = 'stag.READY'\n")
    else {
        panic!("there is a mistake in it");
    };
    assert_eq!((mistake.line, mistake.column), (Some(3), Some(11)));
    assert_eq!(server.control().playing(), None);
    server.stop().await;
}

#[tokio::test]
async fn a_scenario_sets_the_clock_of_a_running_rig() {
    let folder = TempDir::new().expect("a folder");
    let server = serve(folder.path(), None).await;
    let mut playing = server.control().play("name = 'x'\n[[step]]\ndo = ['clock x500']\n").expect("it plays");
    assert!(finish(&mut playing).await.1.passed);
    assert_eq!(server.control().clock(), ClockMode::Factor(500.0));
    server.stop().await;
}

#[tokio::test]
async fn what_a_scenario_writes_is_remembered() {
    let folder = TempDir::new().expect("a folder");
    let text = |act: &str, expect: &str| format!("name = 'x'\n[[step]]\n{act}\nexpect = '{expect}'\n");
    let server = serve(folder.path(), None).await;
    let write = text("do = ['write stage.WORK_CURRENT 33']", "stage.WORK_CURRENT == 33");
    assert!(finish(&mut server.control().play(&write).expect("it plays")).await.1.passed);
    server.stop().await;
    let server = serve(folder.path(), None).await;
    let look = text("", "stage.WORK_CURRENT == 33");
    let (_, report) = finish(&mut server.control().play(&look).expect("it plays")).await;
    assert!(report.passed, "{report}");
    server.stop().await;
}

#[tokio::test]
async fn the_recording_of_a_scenario_replays_without_it() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("run.jsonl");
    let recording = Recording { file: file.clone(), rig: RIG.to_owned() };
    let server = serve(folder.path(), Some(recording)).await;
    let mut playing = server.control().play(CROSSWISE).expect("it plays");
    server.control().set_clock(ClockMode::Factor(100.0));
    assert!(finish(&mut playing).await.1.passed);
    server.stop().await;
    let replayed = replay(BufReader::new(File::open(file).expect("the recording"))).expect("it is whole");
    assert!(replayed.identical && replayed.requests > 5, "{replayed}");
}

#[test]
fn a_headless_run_is_recorded_and_replays() {
    let folder = TempDir::new().expect("a folder");
    let rig = RigFile::parse(RIG).expect("a rig");
    let text = format!("{CROSSWISE}[[step]]\ndo = ['fault uhv.reply-drop 100%', 'line uhv STOP']\n");
    let scenario = Scenario::parse(&text, &rig).expect("a scenario");
    let recorded = |name: &str| {
        let recording = Recording { file: folder.path().join(name), rig: RIG.to_owned() };
        let report = record_headless(&rig, &scenario, &recording).expect("it is recorded");
        assert_eq!(report, run_headless(&rig, &scenario));
        std::fs::read(recording.file).expect("the recording")
    };
    let (first, second) = (recorded("first"), recorded("second"));
    assert_eq!(first, second);
    let replayed = replay(first.as_slice()).expect("it is whole");
    assert!(replayed.identical && replayed.requests > 5, "{replayed}");
    let again = Recording { file: folder.path().join("first"), rig: RIG.to_owned() };
    assert!(record_headless(&rig, &scenario, &again).is_err(), "a file that is there is left alone");
}
