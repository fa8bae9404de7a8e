//! Connecting, authorisation, word order.

use crate::bench::{Bench, MS, SECOND, text, timed};
use crate::link::Fault;
use std::time::Duration;
use stepdrive_drive::smsd::Memory;
use stepdrive_host::smsd::{Smsd, SmsdOptions, WordOrder};
use stepdrive_host::{Error, LineError, Timeouts};
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

fn with_password(password: u64) -> SmsdOptions {
    SmsdOptions { password, ..SmsdOptions::default() }
}

#[tokio::test(start_paused = true)]
async fn nothing_is_sent_before_something_is_asked() {
    let bench = Bench::new();
    tokio::time::sleep(SECOND).await;
    assert!(bench.attempts().is_empty());
    bench.client.log_in().await.expect("the factory's password");
    assert_eq!((bench.attempts().len(), bench.requests()), (1, 3));
    assert!(bench.acts().is_empty(), "nothing acts on connect");
}

#[tokio::test(start_paused = true)]
async fn the_word_order_is_found_from_which_the_password_is_accepted_in() {
    for order in WordOrder::ALL {
        let bench = Bench::of(order, SmsdOptions::default());
        let (found, took) = timed(bench.client.word_order()).await;
        assert_eq!(found, Ok(order));
        assert_eq!(took >= SECOND, order == WordOrder::HighFirst, "the lock-out is waited for: {took:?}");
        bench.client.write(Reg::TargetPos, -123_456).await.expect("in range");
        assert_eq!(bench.look(Reg::TargetPos, 0), -123_456);
    }
}

#[tokio::test(start_paused = true)]
async fn a_word_order_once_found_is_kept_for_all_connections() {
    let bench = Bench::of(WordOrder::HighFirst, SmsdOptions::default());
    bench.client.log_in().await.expect("found");
    bench.cut();
    let (read, took) = timed(bench.client.read(Reg::AbsPos)).await;
    assert_eq!(read, Ok(0));
    assert!(took < 100 * MS, "{took:?}");
}

#[tokio::test(start_paused = true)]
async fn a_given_word_order_is_not_questioned() {
    let options = SmsdOptions { word_order: Some(WordOrder::LowFirst), ..SmsdOptions::default() };
    let bench = Bench::of(WordOrder::HighFirst, options);
    let told = text(bench.client.read(Reg::Speed).await);
    assert_eq!(
        told,
        "stage (unit 1) does not accept the password, with word order low-first; nothing else was sent"
    );
}

#[tokio::test(start_paused = true)]
async fn a_password_that_shows_no_word_order_needs_it_given() {
    let password = 0x1111_1111_2222_2222;
    let mut memory = Memory::factory();
    memory.password = password;
    let bench = Bench::with(Model::Smsd42, WordOrder::LowFirst, memory.clone(), with_password(password));
    let told = text(bench.client.read(Reg::Speed).await);
    assert!(told.starts_with("the word order cannot be found out"), "{told}");
    let options = SmsdOptions { word_order: Some(WordOrder::LowFirst), ..with_password(password) };
    assert_eq!(bench.another(options).read(Reg::Speed).await, Ok(0));
}

#[tokio::test(start_paused = true)]
async fn every_new_connection_is_logged_in() {
    let bench = Bench::ready().await;
    for _ in 0..3 {
        bench.cut();
        assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000));
    }
    assert_eq!(bench.attempts().len(), 4);
}

#[tokio::test(start_paused = true)]
async fn a_wrong_password_is_told_and_leaves_the_controller_to_others() {
    let bench = Bench::of(WordOrder::LowFirst, with_password(1));
    let error = bench.client.read(Reg::Speed).await.expect_err("a wrong password");
    assert_eq!(
        error.to_string(),
        "stage (unit 1) does not accept the password, in either word order; nothing else was sent"
    );
    assert_eq!(error.exit_code(), 6);
    bench.requests();
    for _ in 0..100 {
        assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::NotAuthorised(_))));
        tokio::time::sleep(50 * MS).await;
    }
    assert_eq!(bench.requests(), 0, "whoever polls with a wrong password would lock everybody out for ever");
    let (read, took) = timed(bench.another(SmsdOptions::default()).read(Reg::Speed)).await;
    assert_eq!(read, Ok(0));
    assert!(took < 2 * SECOND, "{took:?}");
}

#[tokio::test(start_paused = true)]
async fn a_refused_password_is_tried_again_after_a_while() {
    let bench = Bench::of(WordOrder::LowFirst, with_password(7));
    bench.client.read(Reg::Speed).await.expect_err("a wrong password");
    let other = bench.another(SmsdOptions::default());
    tokio::time::sleep(SECOND).await;
    other.change_password(7).await.expect("authorised");
    tokio::time::sleep(10 * SECOND).await;
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

#[tokio::test(start_paused = true)]
async fn a_lock_out_that_somebody_else_has_caused_is_waited_for() {
    let bench = Bench::of(WordOrder::LowFirst, with_password(1));
    let given = SmsdOptions { word_order: Some(WordOrder::LowFirst), ..SmsdOptions::default() };
    for options in [SmsdOptions::default(), given] {
        let bad = bench.another(with_password(2));
        bad.log_in().await.expect_err("a wrong password");
        let (read, took) = timed(bench.another(options).read(Reg::Speed)).await;
        assert_eq!(read, Ok(0));
        assert!(took >= SECOND && took < 3 * SECOND, "{took:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn the_identification_is_read_without_logging_in() {
    for (model, shown) in Model::ALL.into_iter().zip(["SMSD-4.2LAN", "SMSD-8.0LAN"]) {
        let bench = Bench::with(model, WordOrder::LowFirst, Memory::factory(), with_password(1));
        let identity = bench.client.identity().await.expect("open to everybody");
        assert_eq!(identity.model, Some(model));
        assert_eq!(identity.to_string(), format!("{shown}, hardware 1, firmware 1.3, register map 4.3"));
    }
}

#[tokio::test(start_paused = true)]
async fn a_foreign_unit_is_silent_and_the_error_says_which_was_asked() {
    let bench = Bench::of(WordOrder::LowFirst, SmsdOptions { unit: 9, ..SmsdOptions::default() });
    let error = bench.client.read(Reg::Speed).await.expect_err("another unit");
    assert_eq!(error.to_string(), "stage (unit 9) did not answer within 1s");
    assert_eq!(error.exit_code(), 5);
    for unit in [0, 255, 1] {
        let client = bench.another(SmsdOptions { unit, ..SmsdOptions::default() });
        assert_eq!(client.read(Reg::Speed).await, Ok(0), "unit {unit}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_refused_connection_is_tried_again_with_rising_rests() {
    let bench = Bench::of(WordOrder::LowFirst, SmsdOptions { tries: 9, ..SmsdOptions::default() });
    bench.refuse_connections(100);
    let told = text(bench.client.read(Reg::Speed).await);
    assert_eq!(told, "cannot connect to stage: connection refused");
    let attempts = bench.attempts();
    let rests: Vec<u128> = attempts.windows(2).map(|pair| (pair[1] - pair[0]).as_millis()).collect();
    assert_eq!(rests, [50, 100, 200, 400, 800, 1600, 2000, 2000]);
    bench.heal();
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

#[tokio::test(start_paused = true)]
async fn a_connection_that_comes_to_no_end_is_given_up() {
    let timeouts = Timeouts { connect: 700 * MS, ..Timeouts::default() };
    let bench = Bench::of(WordOrder::LowFirst, SmsdOptions { tries: 1, timeouts, ..SmsdOptions::default() });
    bench.let_connections_hang(true);
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert_eq!(text(read), "cannot connect to stage: no connection within 700ms");
    assert_eq!(took, 700 * MS);
}

#[tokio::test(start_paused = true)]
async fn a_peer_that_closes_every_connection_is_not_asked_in_a_busy_loop() {
    let bench = Bench::new();
    bench.otherwise(Fault::Close);
    let began = tokio::time::Instant::now();
    while began.elapsed() < 60 * SECOND {
        bench.client.read(Reg::Speed).await.expect_err("closed");
    }
    let attempts = bench.attempts().len();
    assert!((30..=40).contains(&attempts), "{attempts} in a minute");
}

#[tokio::test(start_paused = true)]
async fn an_authorisation_that_the_controller_has_forgotten_is_asked_for_again() {
    let bench = Bench::ready().await;
    bench.client.write(Reg::MaxSpeed, 500).await.expect("in range");
    // A controller that restarts behind something that keeps the connection: the session is new, the client's is not.
    bench.forget_sessions();
    assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(500));
    bench.forget_sessions();
    bench.client.soft_stop().await.expect("refused before anything was done, so it may be sent again");
    assert_eq!(bench.acts(), [(Reg::SoftStop, 1)]);
    assert_eq!(bench.attempts().len(), 1, "all on one connection");
}

#[tokio::test(start_paused = true)]
async fn what_is_no_smsd_is_told() {
    let bench = Bench::new();
    bench.otherwise(Fault::Except(Exception::IllegalDataAddress));
    let told = text(bench.client.read(Reg::Speed).await);
    assert!(
        told.starts_with(
            "stage (unit 1) does not let a password be entered (Modbus exception 02 (illegal data address))"
        ),
        "{told}"
    );
}

#[tokio::test(start_paused = true)]
async fn a_login_whose_replies_get_lost_is_begun_again() {
    for lost in 0..3 {
        for fault in [Fault::LoseReply, Fault::LoseRequest, Fault::Close, Fault::Garbage(vec![0xFF; 9])] {
            let bench = Bench::new();
            bench.faults(std::iter::repeat_n(Fault::None, lost).chain([fault.clone()]));
            let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
            assert_eq!(read, Ok(1000), "{fault:?} at {lost}");
            assert!(took < Duration::from_millis(2500), "{fault:?} at {lost}: {took:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn trouble_while_logging_in_is_no_trouble_of_a_command() {
    let bench = Bench::new();
    bench.otherwise(Fault::LoseReply);
    let error = bench.client.soft_stop().await.expect_err("no reply to anything");
    assert!(matches!(error, Error::Line(LineError::Silent { .. })), "{error}");
    assert!(bench.acts().is_empty());
}
