//! What `STORE` keeps.

use crate::bench::{Bench, IDLE, ONE, folder};
use std::fs;
use tempfile::TempDir;

/// A state folder in which a drive has stored `BAKET` 77.
async fn used() -> TempDir {
    let bench = Bench::start().await;
    let mut client = bench.tcp().await;
    assert_eq!(client.ask("BAKET,77").await, format!("{IDLE},77"));
    assert_eq!(client.ask("STORE").await, IDLE);
    bench.stop().await
}

#[tokio::test]
async fn settings_survive_a_restart_and_the_position_does_not() {
    let bench = Bench::start().await;
    let mut client = bench.serial();
    let settings = ["VMAX,500", "L,1", "LSM,1", "RES,64"];
    for line in settings {
        client.ask(line).await;
    }
    let before = client.data("VMAX").await;
    client.ask("PACT,123").await;
    client.ask("IDENT,1").await;
    assert_eq!(client.ask("STORE").await, "0x0050,0x0000");

    let bench = bench.restart().await;
    let mut client = bench.serial();
    assert_eq!(client.data("VMAX").await, before);
    for line in ["L", "LSM"] {
        assert_eq!(client.ask(line).await, format!("{IDLE},1"));
    }
    assert_eq!(client.data("RES").await, "64");
    assert_eq!(client.data("PACT").await, "0.00000E+00");
    assert_eq!(client.data("IDENT").await, "0");
}

#[tokio::test]
async fn what_is_not_stored_is_gone_after_a_restart() {
    let bench = Bench::start_in(used().await, ONE).await.expect("the rig starts");
    assert_eq!(bench.tcp().await.data("BAKET,99").await, "99");
    let bench = bench.restart().await;
    assert_eq!(bench.tcp().await.data("BAKET").await, "77");
}

#[tokio::test]
async fn what_was_answered_survives_a_kill() {
    let bench = Bench::start().await;
    let mut client = bench.tcp().await;
    for temperature in 1..20 {
        client.ask(&format!("BAKET,{temperature}")).await;
        assert_eq!(client.ask("STORE").await, IDLE);
        // What a process that dies now leaves.
        let left = folder();
        fs::copy(bench.file("uhv.smd3"), left.path().join("uhv.smd3")).expect("copied");
        let other = Bench::start_in(left, ONE).await.expect("the rig starts");
        assert_eq!(other.tcp().await.ask("BAKET").await, format!("{IDLE},{temperature}"));
    }
}

#[tokio::test]
async fn an_end_in_the_middle_of_storing_leaves_one_of_the_configurations_whole() {
    for _ in 0..20 {
        let bench = Bench::start_in(used().await, ONE).await.expect("the rig starts");
        let mut client = bench.tcp().await;
        client.send("BAKET,88\r\nSTORE\r\n".repeat(20)).await;
        client.reply().await;
        let folder = bench.stop().await;
        let bytes = fs::read(folder.path().join("uhv.smd3")).expect("readable");
        let bench = Bench::start_in(folder, ONE).await.expect("the rig starts");
        let reply = bench.tcp().await.ask("BAKET").await;
        assert!(reply == format!("{IDLE},77") || reply == format!("{IDLE},88"), "{reply}");
        assert_eq!(
            fs::read(bench.file("uhv.smd3")).expect("readable"),
            bytes,
            "nothing was written after the end"
        );
    }
}

#[tokio::test]
async fn several_clients_that_store_at_once_are_all_answered_and_the_last_one_counts() {
    let bench = Bench::start().await;
    let mut clients = Vec::new();
    for _ in 0..8 {
        clients.push(bench.tcp().await);
    }
    for (temperature, client) in (100..).zip(&mut clients) {
        client.send(format!("BAKET,{temperature}\r\nSTORE\r\n")).await;
    }
    for client in &mut clients {
        client.reply().await;
        assert_eq!(client.reply().await, IDLE);
    }
    let last = clients[0].data("BAKET").await;
    assert_eq!(bench.restart().await.tcp().await.data("BAKET").await, last);
}

#[tokio::test]
async fn a_damaged_configuration_comes_up_with_the_factory_s_and_says_so() {
    let folder = used().await;
    let file = folder.path().join("uhv.smd3");
    let intact = fs::read(&file).expect("readable");
    let middle = intact.len() / 2;
    let mut flipped = intact.clone();
    flipped[middle] ^= 1;
    let mut folder = folder;
    for damaged in [&flipped[..], &intact[..middle], &[], &[0xFF; 5000]] {
        fs::write(&file, damaged).expect("written");
        let bench = Bench::start_in(folder, ONE).await.expect("the rig starts all the same");
        let mut client = bench.serial();
        assert_eq!(client.ask("BAKET").await, "0x0040,0x0040,150");
        assert_eq!(client.data("RUNV,+").await, "-7 (Not possible when motor disabled)");
        assert_eq!(client.data("LOAD").await, "-5 (Action failed)");
        let told = bench.notices("damaged");
        let copy = told[0].rsplit(' ').next().expect("a path");
        assert!(told.len() == 1 && told[0].starts_with("uhv: "), "{told:?}");
        assert_eq!(fs::read(copy).expect("the copy"), damaged);
        assert_eq!(fs::read(&file).expect("readable"), damaged, "the file itself is untouched");
        assert_eq!(client.ask("CLR").await, IDLE);
        folder = bench.stop().await;
    }
}

#[tokio::test]
async fn storing_anew_repairs_a_damaged_configuration() {
    let folder = used().await;
    fs::write(folder.path().join("uhv.smd3"), "nonsense").expect("written");
    let bench = Bench::start_in(folder, ONE).await.expect("the rig starts");
    assert_eq!(bench.tcp().await.ask("STORE").await, "0x0040,0x0040");
    let bench = bench.restart().await;
    assert_eq!(bench.tcp().await.ask("BAKET").await, format!("{IDLE},150"));
}

#[tokio::test]
async fn a_flash_that_cannot_be_written_fails_the_command_and_works_again_later() {
    let bench = Bench::start_in(used().await, ONE).await.expect("the rig starts");
    let mut client = bench.serial();
    let in_the_way = bench.file("uhv.smd3.new");
    fs::create_dir(&in_the_way).expect("made");
    client.ask("BAKET,88").await;
    assert_eq!(client.ask("STORE").await, format!("{IDLE},-5 (Action failed)"));
    assert_eq!(client.data("STORE").await, "-5 (Action failed)");
    let told = bench.notices("cannot be written");
    assert!(told.len() == 1 && told[0].contains("uhv.smd3") && told[0].contains("-5"), "{told:?}");
    fs::remove_dir(&in_the_way).expect("removed");
    assert_eq!(client.ask("STORE").await, IDLE);
    let bench = bench.restart().await;
    assert_eq!(bench.tcp().await.data("BAKET").await, "88");
}

#[tokio::test]
async fn a_failed_store_leaves_what_was_stored() {
    let bench = Bench::start_in(used().await, ONE).await.expect("the rig starts");
    fs::create_dir(bench.file("uhv.smd3.new")).expect("made");
    let mut client = bench.serial();
    client.ask("BAKET,88").await;
    assert_eq!(client.data("STORE").await, "-5 (Action failed)");
    assert_eq!(client.ask("LOAD").await, IDLE);
    assert_eq!(client.data("BAKET").await, "77", "also for LOAD");
    let bench = bench.restart().await;
    assert_eq!(bench.tcp().await.ask("BAKET").await, format!("{IDLE},77"));
}
