//! Connecting, authorisation, word order.

use crate::common::link::Fault;
use crate::common::station::{MS, SECOND, text, timed};
use crate::modbus_bench::Bench;
use stepdrive_drive::smsd::Memory;
use stepdrive_host::smsd::{Smsd, SmsdOptions, WordOrder};
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::timeout;

fn with_password(password: u64) -> SmsdOptions {
    SmsdOptions { password, ..SmsdOptions::default() }
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
async fn a_search_for_the_word_order_that_is_dropped_is_begun_again() {
    for order in WordOrder::ALL {
        for time in (0..2200).step_by(100) {
            let bench = Bench::of(order, SmsdOptions::default());
            bench.otherwise(Fault::Delay(150 * MS));
            let _ = timeout(time * MS, bench.client.log_in()).await;
            bench.heal();
            assert_eq!(bench.client.word_order().await, Ok(order), "dropped after {time} ms");
        }
    }
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
