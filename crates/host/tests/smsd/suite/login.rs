//! Connecting and authorisation.

use crate::common::link::Fault;
use crate::common::station::{MS, SECOND, text, timed};
use crate::line::Line;
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_host::{Error, LineError, Timeouts};
use stepdrive_spec::smsd::registers::Reg;

fn with_password(password: u64) -> SmsdOptions {
    SmsdOptions { password, ..SmsdOptions::default() }
}

pub(crate) async fn nothing_is_sent_before_something_is_asked<L: Line>() {
    let bench = L::fresh();
    tokio::time::sleep(2 * SECOND).await;
    assert!(bench.attempts().is_empty());
    bench.client.log_in().await.expect("the factory's password");
    assert_eq!((bench.attempts().len(), bench.requests()), (1, L::LOGIN as u64));
    assert!(bench.acts().is_empty(), "nothing acts on connect");
}

pub(crate) async fn every_new_connection_is_logged_in<L: Line>() {
    let bench = L::ready().await;
    for _ in 0..3 {
        bench.cut();
        assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000));
    }
    assert_eq!(bench.attempts().len(), 4);
}

pub(crate) async fn a_wrong_password_is_told_and_leaves_the_controller_to_others<L: Line>() {
    let bench = L::of(with_password(1));
    let error = bench.client.read(Reg::Speed).await.expect_err("a wrong password");
    assert_eq!(
        error.to_string(),
        format!(
            "{} does not accept the password{}; nothing else was sent",
            L::CONTROLLER,
            L::OF_THE_PASSWORD
        )
    );
    assert_eq!(error.exit_code(), 6);
    bench.requests();
    for _ in 0..100 {
        assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::NotAuthorised(_))));
        tokio::time::sleep(50 * MS).await;
    }
    assert_eq!(bench.requests(), 0, "whoever polls with a wrong password would keep everybody out for ever");
    let (read, took) = timed(bench.another(SmsdOptions::default()).read(Reg::Speed)).await;
    assert_eq!(read, Ok(0));
    assert!(took < 2 * SECOND, "{took:?}");
    tokio::time::sleep(10 * SECOND).await;
    bench.requests();
    assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::NotAuthorised(_))));
    assert!(bench.requests() > 0, "after a while it is tried again");
}

pub(crate) async fn a_refused_password_is_tried_again_after_a_while<L: Line>() {
    let bench = L::of(with_password(7));
    bench.client.read(Reg::Speed).await.expect_err("a wrong password");
    let other = bench.another(SmsdOptions::default());
    tokio::time::sleep(SECOND).await;
    other.change_password(7).await.expect("authorised");
    tokio::time::sleep(10 * SECOND).await;
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

pub(crate) async fn a_refused_connection_is_tried_again_with_rising_rests<L: Line>() {
    let bench = L::of(SmsdOptions { tries: 9, ..SmsdOptions::default() });
    bench.refuse_connections(100);
    let told = text(bench.client.read(Reg::Speed).await);
    assert_eq!(told, "cannot connect to stage: connection refused");
    let attempts = bench.attempts();
    let rests: Vec<u128> = attempts.windows(2).map(|pair| (pair[1] - pair[0]).as_millis()).collect();
    assert_eq!(rests, [50, 100, 200, 400, 800, 1600, 2000, 2000]);
    bench.heal();
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

pub(crate) async fn a_connection_that_comes_to_no_end_is_given_up<L: Line>() {
    let timeouts = Timeouts { connect: 700 * MS, ..Timeouts::default() };
    let bench = L::of(SmsdOptions { tries: 1, timeouts, ..SmsdOptions::default() });
    bench.let_connections_hang(true);
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert_eq!(text(read), "cannot connect to stage: no connection within 700ms");
    assert_eq!(took, 700 * MS);
}

pub(crate) async fn a_peer_that_closes_every_connection_is_not_asked_in_a_busy_loop<L: Line>() {
    let bench = L::fresh();
    bench.otherwise(Fault::Close);
    let began = tokio::time::Instant::now();
    while began.elapsed() < 60 * SECOND {
        bench.client.read(Reg::Speed).await.expect_err("closed");
    }
    let attempts = bench.attempts().len();
    assert!((30..=40).contains(&attempts), "{attempts} in a minute");
}

pub(crate) async fn an_authorisation_that_the_controller_has_forgotten_is_asked_for_again<L: Line>() {
    let bench = L::ready().await;
    bench.client.write(Reg::MaxSpeed, 500).await.expect("in range");
    // A controller that restarts behind something that keeps the connection: the session is new, the client's is not.
    bench.forget_sessions();
    assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(500));
    bench.forget_sessions();
    bench.client.soft_stop().await.expect("refused before anything was done, so it may be sent again");
    assert_eq!(bench.acts(), [L::coil(Reg::SoftStop)]);
    assert_eq!(bench.attempts().len(), 1, "all on one connection");
}

pub(crate) async fn a_login_whose_replies_get_lost_is_begun_again<L: Line>() {
    for lost in 0..L::LOGIN {
        for fault in [Fault::LoseReply, Fault::LoseRequest, Fault::Close, Fault::Garbage(vec![0xFF; 9])] {
            let bench = L::fresh();
            tokio::time::sleep(SECOND).await;
            bench.fault_behind(lost, fault.clone());
            let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
            assert_eq!(read, Ok(1000), "{fault:?} at {lost}");
            assert!(took < L::LONGEST_LOGIN, "{fault:?} at {lost}: {took:?}");
        }
    }
}

pub(crate) async fn trouble_while_logging_in_is_no_trouble_of_a_command<L: Line>() {
    let bench = L::fresh();
    bench.otherwise(Fault::LoseReply);
    let error = bench.client.soft_stop().await.expect_err("no reply to anything");
    assert!(matches!(error, Error::Line(LineError::Silent { .. })), "{error}");
    assert!(bench.acts().is_empty());
}
