//! What survives power-off.

use crate::bench::{Bench, ONE, PASSWORD, TWO};
use std::net::TcpListener;
use std::path::Path;
use std::sync::Arc;
use stepdrive_rig::file::RigFile;
use stepdrive_server::store::{Store, StoreError};
use stepdrive_server::{Options, Server, StartError};
use stepdrive_spec::smsd::registers::Reg;
use tempfile::TempDir;

/// A program of `lines` moves.
fn program(lines: u32) -> Vec<u32> {
    (0..lines).map(|line| line << 10 | 0x10 << 4).collect()
}

#[tokio::test]
async fn password_programs_motor_configuration_and_lan_parameters_survive() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    client.write(Reg::CurrentOrVoltage, &[0, 33, 7, 42, 3]).await.expect("accepted");
    for area in 0..4 {
        client.store_program(area, &program(8 * (u32::from(area) + 1))).await;
    }
    client.write(Reg::PasswordLow32, &[4, 3, 2, 1, 1]).await.expect("changed");
    client.write(Reg::LanGateway, &[10, 0, 0, 138]).await.expect("accepted");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");

    let bench = bench.restart().await;
    let mut client = bench.stranger().await;
    assert!(client.log_in(0x0001_0002_0003_0004).await);
    assert_eq!(client.words(Reg::CurrentOrVoltage, 5).await, Ok(vec![0, 33, 7, 42, 3]));
    for area in 0..4 {
        assert_eq!(client.read_program(area).await, program(8 * (u32::from(area) + 1)), "area {area}");
    }
    assert_eq!(client.words(Reg::LanGateway, 4).await, Ok(vec![10, 0, 0, 138]));
}

#[tokio::test]
async fn drive_parameters_and_unapplied_lan_parameters_do_not_survive() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    client.write(Reg::MaxSpeed, &[500]).await.expect("accepted");
    client.write(Reg::LanGateway, &[10, 0, 0, 138]).await.expect("accepted");
    let bench = bench.restart().await;
    let mut client = bench.client().await;
    assert_eq!(client.get(Reg::MaxSpeed).await, Ok(1000));
    assert_eq!(client.words(Reg::LanGateway, 4).await, Ok(vec![192, 168, 1, 1]));
}

#[tokio::test]
async fn an_erased_program_stays_erased() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    client.store_program(2, &program(5)).await;
    client.procedure([2, 0, 1, 0, 2]).await;
    let bench = bench.restart().await;
    assert_eq!(bench.client().await.read_program(2).await, [0; 0]);
}

#[tokio::test]
async fn two_drives_of_a_rig_remember_apart() {
    let bench = Bench::with(TWO).await;
    let (mut left, mut right) = (bench.client_of(0).await, bench.client_of(1).await);
    left.write(Reg::WorkCurrent, &[42]).await.expect("accepted");
    right.write(Reg::WorkCurrent, &[80]).await.expect("accepted");
    right.store_program(0, &program(3)).await;
    let bench = bench.restart().await;
    let (mut left, mut right) = (bench.client_of(0).await, bench.client_of(1).await);
    assert_eq!(left.get(Reg::WorkCurrent).await, Ok(42));
    assert_eq!(right.get(Reg::WorkCurrent).await, Ok(80));
    assert_eq!(left.read_program(0).await, [0; 0]);
    assert_eq!(right.read_program(0).await, program(3));
}

#[tokio::test]
async fn another_model_of_the_same_name_is_another_drive() {
    let bench = Bench::start().await;
    bench.client().await.write(Reg::WorkCurrent, &[42]).await.expect("accepted");
    let folder = bench.stop().await;
    let bench = Bench::start_in(folder, &ONE.replace("4.2", "8.0")).await.expect("started");
    let mut client = bench.client().await;
    assert_eq!(client.get(Reg::WorkCurrent).await, Ok(10));
    client.write(Reg::WorkCurrent, &[80]).await.expect("accepted");
    let folder = bench.stop().await;
    let bench = Bench::start_in(folder, ONE).await.expect("started");
    assert_eq!(bench.client().await.get(Reg::WorkCurrent).await, Ok(42));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_last_of_many_writes_by_many_clients_is_what_survives() {
    for _ in 0..10 {
        let bench = Bench::start().await;
        let mut writers = tokio::task::JoinSet::new();
        for offset in 0..4 {
            let mut client = bench.client().await;
            writers.spawn(async move {
                for current in 1..10 {
                    client.write(Reg::WorkCurrent, &[current * 4 + offset]).await.expect("accepted");
                }
            });
        }
        writers.join_all().await;
        let last = bench.client().await.get(Reg::WorkCurrent).await;
        let bench = bench.restart().await;
        assert_eq!(bench.client().await.get(Reg::WorkCurrent).await, last);
    }
}

#[tokio::test]
async fn what_was_acknowledged_is_in_the_file_though_the_server_is_just_dropped() {
    let bench = Bench::start().await;
    bench.client().await.write(Reg::WorkCurrent, &[33]).await.expect("accepted");
    let copy = TempDir::new().expect("a temporary folder");
    std::fs::copy(bench.file(), copy.path().join("memory.redb")).expect("copied while it is in use");
    drop(bench);
    let bench = Bench::start_in(copy, ONE).await.expect("started");
    assert_eq!(bench.client().await.get(Reg::WorkCurrent).await, Ok(33));
}

/// Starts a server on a folder, which must fail.
async fn refused(folder: &Path, rig: &str) -> StartError {
    let rig = RigFile::parse(rig).expect("a rig");
    let options = Options { state: folder.into(), recording: None, notify: Arc::new(|_| {}) };
    Server::start(&rig, options).await.map(drop).expect_err("cannot start")
}

#[tokio::test]
async fn a_folder_in_use_is_refused_and_free_after_a_stop() {
    let bench = Bench::start().await;
    let file = bench.file();
    let error = refused(file.parent().expect("in a folder"), ONE).await;
    assert!(matches!(error, StartError::Store(StoreError::InUse { .. })), "{error}");
    assert!(error.to_string().contains(&file.display().to_string()), "{error}");
    assert!(bench.client().await.log_in(PASSWORD).await, "the one that has it goes on");
    let folder = bench.stop().await;
    Bench::start_in(folder, ONE).await.expect("free again");
}

#[tokio::test]
async fn a_failed_start_leaves_the_folder_free() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let rig = ONE.replace(":0", &format!(":{}", taken.local_addr().expect("bound").port()));
    let folder = TempDir::new().expect("a temporary folder");
    for _ in 0..10 {
        let error = refused(folder.path(), &rig).await;
        assert!(matches!(error, StartError::Listen { remembered: false, .. }), "{error}");
        assert!(error.to_string().starts_with("stage: cannot listen on 127.0.0.1:"), "{error}");
    }
    Bench::start_in(folder, ONE).await.expect("free");
}

#[tokio::test]
async fn a_folder_that_cannot_be_made_is_told_in_one_line() {
    let folder = TempDir::new().expect("a temporary folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "not a folder").expect("written");
    let error = Store::open(&file.join("state")).expect_err("below a file");
    assert!(matches!(error, StoreError::Folder { .. }));
    let line = error.to_string();
    assert!(line.contains("file/state") && line.lines().count() == 1, "{line}");
}
