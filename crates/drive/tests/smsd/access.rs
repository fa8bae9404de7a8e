//! Authorisation.

use crate::bench::{Bench, MS, PASSWORD, SECOND, config, just_before};
use core::time::Duration;
use stepdrive_drive::smsd::{Memory, Record, Session};
use stepdrive_spec::modbus::{Exception, Table};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

const WRONG: u64 = PASSWORD ^ 1;
const OTHER: u64 = 0xFEDC_BA98_7654_3210;

fn locked() -> Bench {
    Bench::locked(config(Model::Smsd42), Memory::factory(), 0)
}

/// Another client connects to the same controller.
fn second_connection(bench: &Bench) -> Bench {
    let mut second = bench.clone();
    second.session = Session::new();
    second
}

#[test]
fn the_factory_password_gives_access() {
    let mut bench = locked();
    assert_eq!(bench.read(Reg::AccessFlag), 0);
    assert!(bench.log_in(PASSWORD));
    assert_eq!(bench.read(Reg::AccessFlag), 1);
    assert_eq!(bench.read(Reg::MaxSpeed), 1000);
}

#[test]
fn the_password_and_its_command_may_come_in_one_write() {
    let mut bench = locked();
    assert_eq!(bench.write_at(0x2100, &[0xCDEF, 0x89AB, 0x4567, 0x0123, 0]), Ok(()));
    assert_eq!(bench.read(Reg::AccessFlag), 1);
}

#[test]
fn the_password_may_come_word_by_word() {
    let mut bench = locked();
    for (address, word) in (0x2100..).zip([0xCDEF, 0x89AB, 0x4567, 0x0123, 0]) {
        assert_eq!(bench.write_one(address, word), Ok(()));
    }
    assert_eq!(bench.read(Reg::AccessFlag), 1);
}

#[test]
fn a_wrong_password_gives_no_access_and_no_exception() {
    for wrong in [0, WRONG, PASSWORD.swap_bytes(), PASSWORD.rotate_left(32), PASSWORD ^ 1 << 63] {
        let mut bench = locked();
        assert_eq!(bench.enter(wrong, 0), Ok(()));
        assert_eq!(bench.read(Reg::AccessFlag), 0);
        assert_eq!(bench.read_at(Table::HoldingRegisters, 0x1100, 1), Err(Exception::IllegalDataAddress));
    }
}

#[test]
fn within_a_second_of_a_failed_attempt_none_is_evaluated() {
    let mut bench = locked();
    bench.run_for(SECOND / 2);
    bench.log_in(WRONG);
    for pause in [Duration::ZERO, SECOND / 2, just_before(SECOND / 2)] {
        bench.run_for(pause);
        assert!(!bench.log_in(PASSWORD), "after {pause:?} more");
    }
    bench.run_for(Duration::from_nanos(1));
    assert!(bench.log_in(PASSWORD));
}

#[test]
fn attempts_that_are_not_evaluated_do_not_prolong_the_lock_out() {
    let mut bench = locked();
    bench.log_in(WRONG);
    for _ in 0..99 {
        bench.run_for(10 * MS);
        assert!(!bench.log_in(WRONG));
    }
    bench.run_for(10 * MS);
    assert!(bench.log_in(PASSWORD));
}

#[test]
fn a_failed_attempt_locks_every_connection_out() {
    let mut bench = locked();
    bench.log_in(WRONG);
    let mut second = second_connection(&bench);
    assert!(!second.log_in(PASSWORD));
    second.run_for(SECOND);
    assert!(second.log_in(PASSWORD));
}

#[test]
fn a_lock_out_leaves_a_connection_that_has_access_alone() {
    let mut first = locked();
    first.log_in(PASSWORD);
    let mut second = second_connection(&first);
    second.log_in(WRONG);
    first.drive = second.drive;
    assert_eq!(first.read(Reg::AccessFlag), 1);
    assert!(first.log_in(WRONG), "an attempt that is not evaluated takes nothing away");
    first.run_for(SECOND);
    assert!(!first.log_in(WRONG), "one that is evaluated and fails does");
}

#[test]
fn a_successful_attempt_may_be_followed_by_another_at_once() {
    let mut bench = locked();
    assert!(bench.log_in(PASSWORD));
    let mut second = second_connection(&bench);
    assert!(second.log_in(PASSWORD));
    second.log_in(WRONG);
    second.run_for(SECOND);
    assert!(second.log_in(PASSWORD));
    assert!(!second_connection(&second).log_in(WRONG), "the lock-out is over, not the check");
}

#[test]
fn clients_that_log_in_at_once_do_not_mix_their_passwords() {
    let mut first = locked();
    first.write_at(0x2100, &[0xCDEF, 0x89AB]).expect("open");
    let mut second = second_connection(&first);
    second.write_at(0x2100, &[0, 0, 0x4567, 0x0123]).expect("open");
    first.drive = second.drive;
    first.write_at(0x2102, &[0x4567, 0x0123, 0]).expect("open");
    assert_eq!(first.read(Reg::AccessFlag), 1);
}

#[test]
fn a_changed_password_holds_from_then_on_and_is_stored() {
    let mut bench = locked();
    bench.log_in(PASSWORD);
    assert_eq!(bench.enter(OTHER, 1), Ok(()));
    assert_eq!(bench.drive.memory().password, OTHER);
    assert_eq!(bench.drive.take_unsaved(), Some(Record::Password));
    assert!(bench.session.is_authorised(), "the connection that changed it stays authorised");
    let mut second = second_connection(&bench);
    assert!(!second.log_in(PASSWORD));
    second.run_for(SECOND);
    assert!(second.log_in(OTHER));
}

#[test]
fn changing_the_password_leaves_other_connections_authorised() {
    let mut first = locked();
    first.log_in(PASSWORD);
    let mut second = second_connection(&first);
    second.log_in(PASSWORD);
    second.enter(OTHER, 1).expect("authorised");
    first.drive = second.drive;
    assert_eq!(first.read(Reg::AccessFlag), 1);
}

#[test]
fn changing_the_password_needs_access() {
    let mut bench = locked();
    bench.write_at(0x2100, &[1, 2, 3, 4]).expect("open");
    for words in [&[1][..], &[0, 1]] {
        let address = 0x2105 - u16::try_from(words.len()).expect("short");
        let act = |bench: &mut Bench| bench.write_at(address, words);
        bench.assert_excepted(Exception::IllegalDataAddress, "Password_CMD = 1", act);
    }
    assert_eq!(bench.drive.memory().password, PASSWORD);
}

#[test]
fn another_password_command_is_a_wrong_value() {
    for mut bench in [locked(), Bench::new()] {
        for value in [2, 0xFFFF] {
            let act = |bench: &mut Bench| bench.write_one(0x2104, value);
            bench.assert_excepted(Exception::IllegalDataValue, "Password_CMD", act);
        }
    }
}
