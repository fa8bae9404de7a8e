//! What is particular to a serial port.

use crate::bench::{Bench, Client, IDLE, ONE, folder, noticed, open_port};
use rustix::termios::{InputModes, LocalModes, OptionalActions, OutputModes, tcgetattr, tcsetattr};
use std::fs;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::Path;
use stepdrive_server::StartError;

/// A rig whose port has this name.
fn named(path: &Path) -> String {
    ONE.replace("\"pty\"", &format!("'pty:{}'", path.display()))
}

#[tokio::test]
async fn the_port_stands_in_the_state_folder_under_the_name_of_the_drive() {
    let bench = Bench::start().await;
    assert_eq!(bench.port(), bench.file("uhv.tty"));
    assert!(fs::metadata(bench.port()).expect("there").file_type().is_char_device());
    let port = bench.port();
    let _folder = bench.stop().await;
    assert!(!port.is_symlink(), "removed at the end");
}

#[tokio::test]
async fn the_port_keeps_its_name_and_what_is_behind_it_however_often_it_is_opened() {
    let bench = Bench::start().await;
    let target = fs::read_link(bench.port()).expect("a link");
    for temperature in 0..50 {
        assert_eq!(bench.serial().data(&format!("BAKET,{temperature}")).await, temperature.to_string());
        tokio::task::yield_now().await;
    }
    assert_eq!(fs::read_link(bench.port()).expect("a link"), target);
}

#[tokio::test]
async fn nothing_that_a_client_left_unread_is_read_by_the_next() {
    let bench = Bench::start().await;
    for replies in [1, 10, 100, 300] {
        let mut client = bench.serial();
        client.send("FLAGS\r\n".repeat(replies)).await;
        if replies > 1 {
            client.reply().await;
        }
        drop(client);
        noticed().await;
        assert_eq!(bench.serial().ask("SER").await, format!("{IDLE},20168-001"), "{replies} replies");
    }
}

#[tokio::test]
async fn half_a_line_goes_with_its_client() {
    let bench = Bench::start().await;
    bench.serial().send("BAKE").await;
    noticed().await;
    assert_eq!(bench.serial().ask("SER").await, format!("{IDLE},20168-001"));
}

#[tokio::test]
async fn commands_sent_just_before_closing_are_carried_out() {
    let bench = Bench::start().await;
    bench.serial().send("STORE\r\nBAKET,7\r\nSTORE\r\nRUNR,1000\r\n").await;
    let mut other = bench.tcp().await;
    while other.position().await <= 0.0 {}
    assert_eq!(other.data("BAKET").await, "7");
    let bench = bench.restart().await;
    assert_eq!(bench.tcp().await.data("BAKET").await, "7");
}

#[tokio::test]
async fn a_port_that_is_opened_and_closed_at_once_goes_on() {
    let bench = Bench::start().await;
    for _ in 0..200 {
        drop(open_port(&bench.port()));
    }
    assert_eq!(bench.serial().ask("").await, IDLE);
    assert_eq!(bench.notices(""), <[String; 0]>::default());
}

#[tokio::test]
async fn a_port_that_two_programs_have_open_serves_until_both_have_closed_it() {
    let bench = Bench::start().await;
    let mut reader = bench.serial();
    for temperature in 0..20 {
        // As `echo BAKET,7 > port` beside a terminal program.
        let mut writer = bench.serial();
        writer.send(format!("BAKET,{temperature}\r\n")).await;
        drop(writer);
        assert_eq!(reader.reply().await, format!("{IDLE},{temperature}"));
        tokio::task::yield_now().await;
    }
}

#[tokio::test]
async fn a_client_that_never_reads_holds_up_nobody_and_the_port_recovers_when_it_closes() {
    let bench = Bench::start().await;
    let mut deaf = bench.serial();
    deaf.stuff(&b"FLAGS\r\n".repeat(100)).await;
    let mut other = bench.tcp().await;
    assert_eq!(other.ask("").await, IDLE);
    drop(deaf);
    noticed().await;
    assert_eq!(bench.serial().ask("SER").await, format!("{IDLE},20168-001"));
    assert_eq!(bench.notices(""), <[String; 0]>::default());
}

#[tokio::test]
async fn a_client_that_takes_its_time_gets_everything() {
    let bench = Bench::start().await;
    let mut slow = bench.serial();
    slow.stuff(b"BAKET,9\r\n").await;
    for _ in 0..500 {
        assert_eq!(slow.reply().await, format!("{IDLE},9"));
    }
}

#[tokio::test]
async fn what_a_client_sets_at_the_terminal_goes_with_it() {
    let bench = Bench::start().await;
    let port = open_port(&bench.port());
    let mut settings = tcgetattr(&port).expect("a terminal");
    settings.local_modes |= LocalModes::ICANON;
    settings.input_modes |= InputModes::ICRNL | InputModes::IXON;
    settings.output_modes |= OutputModes::OPOST | OutputModes::ONLCR;
    tcsetattr(&port, OptionalActions::Now, &settings).expect("set");
    drop(port);
    noticed().await;
    let mut client = bench.serial();
    client.send("BAKET,7\r").await;
    assert_eq!(client.reply().await, format!("{IDLE},7"));
    assert_eq!(client.ask("SER").await, format!("{IDLE},20168-001"));
}

#[tokio::test]
async fn a_port_may_have_a_name_of_its_own() {
    let elsewhere = folder();
    let path = elsewhere.path().join("ttyACM0");
    let bench = Bench::with(&named(&path)).await;
    assert_eq!(bench.port(), path);
    assert_eq!(Client::open(&path).ask("").await, IDLE);
}

#[tokio::test]
async fn a_link_that_was_left_behind_is_replaced() {
    let elsewhere = folder();
    let path = elsewhere.path().join("port");
    for left_behind in ["/nowhere/at/all", "/dev/null"] {
        symlink(left_behind, &path).expect("made");
        let bench = Bench::with(&named(&path)).await;
        assert_eq!(bench.serial().ask("").await, IDLE);
        bench.stop().await;
        assert!(!path.is_symlink());
    }
}

#[tokio::test]
async fn what_is_no_port_is_left_alone_and_named_in_the_error() {
    let elsewhere = folder();
    let notes = elsewhere.path().join("notes.txt");
    fs::write(&notes, "mine").expect("written");
    let link = elsewhere.path().join("link");
    symlink(&notes, &link).expect("made");
    let inside = elsewhere.path().join("no/such/folder");
    for path in [&notes, &link, &inside, &elsewhere.path().to_owned()] {
        let error = Bench::start_in(folder(), &named(path)).await.map(drop).expect_err("it is in use");
        assert!(matches!(error, StartError::Serial { .. }));
        let text = error.to_string();
        assert!(
            text.starts_with("uhv: cannot make the serial port") && text.contains(&*path.to_string_lossy())
        );
    }
    assert_eq!(fs::read_to_string(&link).expect("readable"), "mine");
    assert_eq!(fs::read_link(&link).expect("a link"), notes);
}

#[tokio::test]
async fn a_name_that_another_has_taken_over_is_left_to_it() {
    let elsewhere = folder();
    let path = elsewhere.path().join("port");
    let first = Bench::with(&named(&path)).await;
    let second = Bench::with(&named(&path)).await;
    first.stop().await;
    assert_eq!(second.serial().ask("").await, IDLE);
}
