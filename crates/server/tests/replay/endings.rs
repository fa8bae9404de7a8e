//! What ends a connection or undoes a reply is recorded so that it replays.

use crate::bench::{Bench, read, replay_it, trigger, write};
use std::fs;
use std::net::TcpListener;
use std::time::Duration;
use stepdrive_server::replay::Replayed;
use stepdrive_spec::smsd::registers::Reg;

const SMSD: &str = "[[drive]]\nname = \"stage\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n";
const SMD3: &str = "[[drive]]\nname = \"uhv\"\nmodel = \"SMD3\"\nserial_tcp = \"127.0.0.1:0\"\n";

fn count(recording: &str, what: &str) -> usize {
    recording.lines().filter(|line| line.contains(what)).count()
}

fn identical(recording: &str) -> Replayed {
    let replayed = replay_it(recording);
    assert!(replayed.identical && !replayed.cut_short, "{replayed}\n{recording}");
    replayed
}

#[tokio::test]
async fn a_store_that_failed_is_undone_in_the_replay_too() {
    let bench = Bench::start(SMD3).await;
    let (mut first, mut second) = (bench.smd3(0).await, bench.smd3(0).await);
    first.tell(b"BAKET,77\nSTORE\n").await;
    let in_the_way = bench.state("uhv.smd3.new");
    fs::create_dir(&in_the_way).expect("made");
    second.tell(b"BAKET,88\r\n").await;
    assert!(second.tell(b"STORE\r\n").await.ends_with(b"-5 (Action failed)\r\n"));
    first.tell(b"LOAD\nBAKET\n").await;
    fs::remove_dir(&in_the_way).expect("removed");
    second.tell(b"STORE\r\nLOAD\r\nBAKET\r\n").await;
    let recording = bench.stop().await;
    assert_eq!(count(&recording, "not-stored"), 1);
    identical(&recording);
    // Without that line the replay is another story: the first client's LOAD gives what was not stored.
    let without: String =
        recording.split_inclusive('\n').filter(|line| !line.contains("not-stored")).collect();
    let replayed = replay_it(without);
    assert!(replayed.differences > 0 && replayed.altered, "{replayed}");
}

#[tokio::test]
async fn of_a_line_that_does_not_end_for_long_the_recording_keeps_the_beginning_and_it_replays() {
    let bench = Bench::start(SMD3).await;
    let mut client = bench.smd3(0).await;
    client.send(&b"\nA".repeat(3)).await;
    for _ in 0..1000 {
        client.send(&[b'A'; 1000]).await;
    }
    let mut replies = client.tell(b"A\r\nBAKET\r\n").await;
    while !replies.ends_with(b",150\r\n") {
        replies.extend(client.tell(b"").await);
    }
    let recording = bench.stop().await;
    assert!(recording.len() < 10_000, "{}", recording.len());
    assert_eq!(count(&recording, "\"heard\""), 5, "{recording}");
    identical(&recording);
}

#[tokio::test]
async fn a_drive_that_moves_to_another_port_and_unit_replays() {
    let bench = Bench::start(SMSD).await;
    let mut client = bench.smsd(0).await;
    let mut other = bench.smsd(0).await;
    client.log_in().await;
    other.log_in().await;
    let port = TcpListener::bind("127.0.0.1:0").expect("a free port").local_addr().expect("bound").port();
    for request in
        [write(Reg::LanId, &[9]), write(Reg::LanPort, &[port]), trigger(Reg::ApplyNetworkConfiguration)]
    {
        let frame = client.frame(1, &request);
        assert!(!client.tell(&frame).await.is_empty());
    }
    assert!(client.is_closed().await && other.is_closed().await);
    let mut again = bench.smsd_at(port).await;
    for unit in [1, 9] {
        let frame = again.frame(unit, &read(Reg::HwMajor, 2));
        assert_eq!(again.tell(&frame).await.is_empty(), unit == 1);
    }
    let recording = bench.stop().await;
    assert_eq!(count(&recording, "\"shut\""), 3);
    identical(&recording);
}

#[tokio::test]
async fn the_port_that_was_free_is_the_one_that_is_read_in_the_replay() {
    let bench = Bench::start(SMSD).await;
    let mut client = bench.smsd(0).await;
    client.log_in().await;
    let frame = client.frame(1, &read(Reg::LanPort, 1));
    let reply = client.tell(&frame).await;
    assert_eq!(reply[9..], bench.server.drives()[0].modbus_tcp.expect("an SMSD").port().to_be_bytes());
    identical(&bench.stop().await);
}

#[tokio::test]
async fn a_changed_password_and_a_second_run_on_what_was_remembered_replay() {
    let bench = Bench::start(SMSD).await;
    let mut client = bench.smsd(0).await;
    client.log_in().await;
    for request in [write(Reg::PasswordLow32, &[4, 3, 2, 1, 1]), write(Reg::WorkCurrent, &[42])] {
        let frame = client.frame(1, &request);
        client.tell(&frame).await;
    }
    let (recording, folder) = bench.stop_and_keep().await;
    identical(&recording);

    let bench = Bench::start_in(folder, SMSD, "second").await;
    let mut client = bench.smsd(0).await;
    let frame = client.frame(1, &write(Reg::PasswordLow32, &[4, 3, 2, 1, 0]));
    client.tell(&frame).await;
    let frame = client.frame(1, &read(Reg::WorkCurrent, 1));
    assert_eq!(client.tell(&frame).await[9..], [0, 42]);
    identical(&bench.stop().await);
}

#[tokio::test]
async fn a_client_of_a_drive_that_is_switched_off_and_on_again_replays() {
    let bench = Bench::start(&[SMSD, SMD3].concat()).await;
    let (mut stage, mut uhv) = (bench.smsd(0).await, bench.smd3(1).await);
    for state in ["off", "on", "off for 20ms"] {
        bench.act(&format!("power stage {state}"));
        bench.act(&format!("power uhv {state}"));
        let frame = stage.frame(1, &read(Reg::HwMajor, 1));
        stage.tell(&frame).await;
        uhv.tell(b"VMAX\r\n").await;
    }
    tokio::time::sleep(Duration::from_millis(30)).await;
    let (mut stage, mut uhv) = (bench.smsd(0).await, bench.smd3(1).await);
    let frame = stage.frame(1, &read(Reg::HwMajor, 1));
    assert!(!stage.tell(&frame).await.is_empty() && !uhv.tell(b"VMAX\r\n").await.is_empty());
    identical(&bench.stop().await);
}

#[tokio::test]
async fn half_a_line_and_half_a_frame_leave_no_trace_in_the_recording() {
    let bench = Bench::start(&[SMSD, SMD3].concat()).await;
    let (mut stage, mut uhv) = (bench.smsd(0).await, bench.smd3(1).await);
    let frame = stage.frame(1, &read(Reg::HwMajor, 1));
    stage.tell(&frame[..7]).await;
    uhv.tell(b"\r\n\nVMAX,1").await;
    drop((stage, uhv));
    tokio::time::sleep(Duration::from_millis(30)).await;
    let recording = bench.stop().await;
    assert_eq!((count(&recording, "\"heard\""), count(&recording, "\"shut\"")), (2, 2), "{recording}");
    identical(&recording);
}

#[tokio::test]
async fn nothing_is_written_behind_the_end() {
    let bench = Bench::start(&[SMSD, SMD3].concat()).await;
    let control = bench.server.control().clone();
    let (mut stage, mut uhv) = (bench.smsd(0).await, bench.smd3(1).await);
    let frame = stage.frame(1, &read(Reg::HwMajor, 1));
    let flood = tokio::spawn(async move {
        while !stage.tell(&frame).await.is_empty() && !uhv.tell(b"PACT\r\n").await.is_empty() {}
    });
    tokio::time::sleep(Duration::from_millis(20)).await;
    let (recording, folder) = bench.stop_and_keep().await;
    control.act("input stage.IN0 1").expect("an action");
    flood.await.expect("no panic");
    assert!(recording.lines().last().is_some_and(|line| line.contains("\"end\"")));
    assert_eq!(fs::read_to_string(folder.path().join("recording")).expect("readable"), recording);
    identical(&recording);
}
