//! Connecting, the greeting, authorisation, the version of the protocol.

use crate::common::link::Fault;
use crate::common::station::{MS, SECOND, text, timed};
use crate::standard_bench::{Bench, Setup};
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, VERSION_1, exists_in};

#[tokio::test(start_paused = true)]
async fn the_second_after_power_up_is_waited_out() {
    for setup in [Setup::default(), Setup::raw()] {
        let bench = Bench::of(&setup);
        let (entered, took) = timed(bench.client.log_in()).await;
        assert_eq!(entered, Ok(()));
        assert!((SECOND..1500 * MS).contains(&took), "{took:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_connection_soon_after_another_waits_until_it_is_looked_at() {
    let bench = Bench::ready().await;
    bench.cut();
    let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
    assert_eq!(read, Ok(1000));
    assert!((800 * MS..1500 * MS).contains(&took), "{took:?}");
    tokio::time::sleep(SECOND).await;
    bench.cut();
    let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
    assert_eq!(read, Ok(1000));
    assert!(took < 10 * MS, "{took:?}");
}

#[tokio::test(start_paused = true)]
async fn a_controller_that_never_looks_is_told_apart_from_one_that_refuses() {
    let bench = Bench::new();
    bench.otherwise(Fault::Refuse(Code::ErrorAccessTimeout));
    let error = bench.client.log_in().await.expect_err("never looked at");
    assert_eq!(
        error.to_string(),
        "stage has not looked at the password within 4.2s (ERROR_ACCESS_TIMEOUT): somebody else logs in all the time, or \
         its clock is slow; try again"
    );
    assert_eq!(error.exit_code(), 6);
}

#[tokio::test(start_paused = true)]
async fn the_greeting_is_waited_for_and_done_without_if_it_does_not_come() {
    let bench = Bench::of(&Setup::raw());
    tokio::time::sleep(2 * SECOND).await;
    let (entered, took) = timed(bench.client.log_in()).await;
    assert_eq!(entered, Ok(()));
    assert!(took < 10 * MS, "{took:?}");
    bench.cut();
    bench.greet_nobody();
    tokio::time::sleep(2 * SECOND).await;
    let (entered, took) = timed(bench.client.log_in()).await;
    assert_eq!(entered, Ok(()));
    assert_eq!(took, SECOND, "the time of a reply");
}

#[tokio::test(start_paused = true)]
async fn whether_somebody_is_logged_in_is_asked_without_logging_in() {
    let bench = Bench::new();
    assert_eq!(bench.client.read(Reg::AccessFlag).await, Ok(0));
    bench.client.log_in().await.expect("the factory's password");
    assert_eq!(bench.client.read(Reg::AccessFlag).await, Ok(1));
}

#[tokio::test(start_paused = true)]
async fn what_the_older_protocol_does_not_have_is_not_sent() {
    let bench = Bench::of(&Setup { version: VERSION_1, ..Setup::default() });
    assert_eq!(bench.client.protocol_version().await, Ok(VERSION_1));
    bench.requests();
    let lines = |opcode| vec![Instruction { opcode, data: 0 }];
    for code in 0x3A..=0x3E {
        let opcode = Opcode::from_code(code).expect("listed");
        assert!(!exists_in(opcode, VERSION_1));
        let told = text(bench.client.store_program(0, &lines(opcode)).await);
        assert_eq!(
            told,
            format!("stage speaks version 1 of the protocol, which has no {opcode}; nothing was sent")
        );
        let told = text(bench.client.instruct(Instruction { opcode, data: 20 }).await);
        assert!(told.contains("version 1"), "{told}");
    }
    assert_eq!(bench.requests(), 0);
    assert!(bench.client.command(Opcode::ScanMark2F, Some(20)).await.is_err());
    assert_eq!(bench.acts(), []);
    assert_eq!(bench.client.store_program(0, &lines(Opcode::GotoProgramIfZero)).await, Ok(()));
}

#[tokio::test(start_paused = true)]
async fn what_is_no_smsd_is_told() {
    let bench = Bench::new();
    bench.otherwise(Fault::Refuse(Code::ErrorNoCommand));
    assert_eq!(
        text(bench.client.read(Reg::Speed).await),
        "stage answered the password with ERROR_NO_COMMAND; is it an SMSD-4.2LAN or SMSD-8.0LAN?"
    );
}
