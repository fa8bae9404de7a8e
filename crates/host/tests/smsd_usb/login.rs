//! Connecting, the greeting, authorisation, the version of the protocol.

use crate::bench::{Act, Bench, MS, SECOND, Setup, text, timed};
use crate::link::Fault;
use std::time::Duration;
use stepdrive_host::smsd::{Framing, Smsd, SmsdOptions};
use stepdrive_host::{Error, LineError};
use stepdrive_rig::machine::Machine;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, VERSION_1, exists_in};

fn with_password(password: u64) -> Setup {
    Setup { options: SmsdOptions { password, ..SmsdOptions::default() }, ..Setup::default() }
}

#[tokio::test(start_paused = true)]
async fn nothing_is_sent_before_something_is_asked() {
    let bench = Bench::new();
    tokio::time::sleep(2 * SECOND).await;
    assert!(bench.attempts().is_empty());
    bench.client.log_in().await.expect("the factory's password");
    assert_eq!((bench.attempts().len(), bench.requests()), (1, 1));
    assert!(bench.acts().is_empty(), "nothing acts on connect");
}

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
    assert_eq!(error.exit_code(), 7);
}

#[tokio::test(start_paused = true)]
async fn a_wrong_password_is_told_and_leaves_the_controller_to_others() {
    let bench = Bench::of(&with_password(1));
    let error = bench.client.read(Reg::Speed).await.expect_err("a wrong password");
    assert_eq!(error.to_string(), "stage does not accept the password; nothing else was sent");
    assert_eq!(error.exit_code(), 6);
    bench.requests();
    for _ in 0..100 {
        assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::NotAuthorised(_))));
        tokio::time::sleep(50 * MS).await;
    }
    assert_eq!(bench.requests(), 0, "whoever polls with a wrong password would keep everybody out for ever");
    assert_eq!(bench.another(SmsdOptions::default()).read(Reg::Speed).await, Ok(0));
    tokio::time::sleep(10 * SECOND).await;
    assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::NotAuthorised(_))));
    assert!(bench.requests() > 1, "after a while it is tried again");
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
async fn an_access_that_the_controller_has_forgotten_is_asked_for_again() {
    for setup in [Setup::default(), Setup::raw()] {
        let bench = Bench::ready_as(&setup).await;
        bench.client.write(Reg::MaxSpeed, 500).await.expect("in range");
        bench.forget_sessions();
        assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(500));
        bench.forget_sessions();
        bench.client.soft_stop().await.expect("refused before anything was done, so it may be sent again");
        assert_eq!(bench.acts(), [Act::Instruction(Opcode::SoftStop)]);
        assert_eq!(bench.attempts().len(), 1, "all on one connection");
    }
}

#[tokio::test(start_paused = true)]
async fn power_that_goes_and_comes_back_behind_an_open_port_is_followed() {
    let bench = Bench::ready().await;
    bench.client.write(Reg::MaxSpeed, 500).await.expect("in range");
    bench.machine(Machine::switch_off);
    assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::Line(LineError::Silent { .. }))));
    tokio::time::sleep(30 * SECOND).await;
    bench.machine(Machine::switch_on);
    assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "as at power-up");
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
async fn a_login_whose_reply_gets_lost_is_begun_again() {
    let faults = [Fault::LoseReply, Fault::LoseRequest, Fault::Close, Fault::Garbage(vec![0xFF; 9])];
    for setup in [Setup::default(), Setup::raw()] {
        for fault in &faults {
            let bench = Bench::of(&setup);
            tokio::time::sleep(SECOND).await;
            bench.faults([fault.clone()]);
            let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
            assert_eq!(read, Ok(1000), "{fault:?}");
            assert!(took < Duration::from_millis(3600), "{fault:?}: {took:?}");
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

#[tokio::test(start_paused = true)]
async fn what_is_no_smsd_is_told() {
    let bench = Bench::new();
    bench.otherwise(Fault::Refuse(Code::ErrorNoCommand));
    assert_eq!(
        text(bench.client.read(Reg::Speed).await),
        "stage answered the password with ERROR_NO_COMMAND; is it an SMSD-4.2LAN or SMSD-8.0LAN?"
    );
}

#[tokio::test(start_paused = true)]
async fn a_refused_connection_is_tried_again_with_rising_rests() {
    let options = SmsdOptions { tries: 5, ..SmsdOptions::default() };
    let bench = Bench::of(&Setup { options, framing: Framing::Raw, ..Setup::raw() });
    bench.refuse_connections(100);
    let told = text(bench.client.read(Reg::Speed).await);
    assert_eq!(told, "cannot connect to stage: connection refused");
    let attempts = bench.attempts();
    let rests: Vec<u128> = attempts.windows(2).map(|pair| (pair[1] - pair[0]).as_millis()).collect();
    assert_eq!(rests, [50, 100, 200, 400]);
}
