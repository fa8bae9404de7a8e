//! Who may ask.

use super::Port;
use crate::bench::{PASSWORD, SECOND, config, just_before};
use core::time::Duration;
use stepdrive_drive::smsd::StandardSession;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, LanParameters, Malformed, Reply, Request, Words};

const LOGIN: Request = Request::Authorise(PASSWORD);
const WRONG: Request = Request::Authorise(PASSWORD ^ 1);
const OTHER: u64 = 0xFEDC_BA98_7654_3210;

fn locked() -> Port {
    Port::locked(config(Model::Smsd42))
}

/// A second after power-up.
fn rested() -> Port {
    let mut port = locked();
    port.bench.run_for(SECOND);
    port
}

fn everything_but_a_login() -> Vec<Request> {
    let lan = LanParameters {
        mac: [0; 6],
        ip: [0; 4],
        subnet_mask: [0; 4],
        gateway: [0; 4],
        dns: [0; 4],
        port: 1,
        dhcp: 1,
        id: Some(1),
    };
    vec![
        Request::Command(super::word(Opcode::HardStop, 0)),
        Request::Command(0x3F0),
        Request::WriteMemory { area: 0, words: Words::new() },
        Request::ReadMemory { area: 0 },
        Request::SetLan(lan),
        Request::GetLan,
        Request::SetPassword(1),
        Request::GetErrors,
        Request::GetVersions,
    ]
}

#[test]
fn before_the_login_everything_else_is_refused() {
    let mut port = rested();
    for request in everything_but_a_login() {
        port.assert_refused(&request, Code::ErrorAccess);
    }
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
    assert!(port.session.is_authorised());
    assert_eq!(port.code(&Request::SetPassword(1)), Code::Ok);
}

#[test]
fn a_login_by_modbus_is_none_here_and_the_other_way_round() {
    let mut port = rested();
    assert!(port.bench.session.is_authorised());
    port.assert_refused(&Request::GetLan, Code::ErrorAccess);
    port.bench.session = stepdrive_drive::smsd::Session::new();
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
    assert_eq!(port.bench.read(Reg::AccessFlag), 0);
}

#[test]
fn a_broken_packet_is_answered_whoever_is_logged_in_and_wrong_content_only_after_the_login() {
    let mut port = rested();
    for (login, unknown) in [(false, Code::ErrorAccess), (true, Code::ErrorNoCommand)] {
        if login {
            assert_eq!(port.code(&LOGIN), Code::OkAccess);
        }
        for (malformed, expected) in [
            (Malformed::Packet(Code::ErrorXor), Code::ErrorXor),
            (Malformed::Packet(Code::ErrorLen), Code::ErrorLen),
            (Malformed::Content(Code::ErrorNoCommand), unknown),
        ] {
            let before = port.snapshot();
            let reply = port.bench.drive.handle_standard(port.bench.now, &mut port.session, Err(malformed));
            let Some(Reply::Response(answer)) = reply else { panic!("{reply:?}") };
            assert_eq!((answer.code, answer.data), (expected, 0));
            assert_eq!(port.snapshot(), before);
        }
    }
}

#[test]
fn within_a_second_of_power_up_no_attempt_is_looked_at() {
    let mut port = locked();
    port.assert_refused(&LOGIN, Code::ErrorAccessTimeout);
    port.bench.run_for(just_before(SECOND));
    port.assert_refused(&LOGIN, Code::ErrorAccessTimeout);
    port.assert_refused(&WRONG, Code::ErrorAccessTimeout);
    port.bench.run_for(Duration::from_nanos(1));
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
}

#[test]
fn within_a_second_of_an_attempt_none_is_looked_at_whatever_became_of_it() {
    for (first, outcome) in [(LOGIN, Code::OkAccess), (WRONG, Code::ErrorAccess)] {
        let mut port = rested();
        assert_eq!(port.code(&first), outcome);
        port.bench.run_for(SECOND / 2);
        port.assert_refused(&LOGIN, Code::ErrorAccessTimeout);
        port.bench.run_for(just_before(SECOND / 2));
        port.assert_refused(&WRONG, Code::ErrorAccessTimeout);
        port.bench.run_for(Duration::from_nanos(1));
        assert_eq!(port.code(&LOGIN), Code::OkAccess, "too early an attempt must not begin the second anew");
    }
}

#[test]
fn the_second_counts_for_every_line_of_the_controller() {
    let mut port = rested();
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
    let first = core::mem::replace(&mut port.session, StandardSession::lan());
    port.assert_refused(&LOGIN, Code::ErrorAccessTimeout);
    port.bench.run_for(SECOND);
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
    port.session = first;
    assert!(matches!(port.reply(&Request::GetLan), Reply::Lan(_)));
}

#[test]
fn a_failed_attempt_by_modbus_locks_this_protocol_out() {
    let mut port = rested();
    assert!(!port.bench.log_in(PASSWORD ^ 1));
    port.bench.run_for(just_before(SECOND));
    port.assert_refused(&LOGIN, Code::ErrorAccessTimeout);
    port.bench.run_for(Duration::from_nanos(1));
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
}

#[test]
fn an_attempt_by_modbus_that_succeeds_does_not() {
    let mut port = rested();
    assert!(port.bench.log_in(PASSWORD));
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
}

#[test]
fn a_failed_attempt_here_locks_modbus_out_and_a_right_one_does_not() {
    for (attempt, at_once) in [(WRONG, false), (LOGIN, true)] {
        let mut port = rested();
        port.bench.session = stepdrive_drive::smsd::Session::new();
        port.reply(&attempt);
        port.bench.run_for(just_before(SECOND));
        assert_eq!(port.bench.log_in(PASSWORD), at_once, "{attempt:?}");
        port.bench.run_for(Duration::from_nanos(1));
        assert!(port.bench.log_in(PASSWORD));
    }
}

#[test]
fn a_wrong_password_ends_the_login() {
    let mut port = Port::new();
    port.bench.run_for(SECOND);
    assert_eq!(port.code(&WRONG), Code::ErrorAccess);
    port.assert_refused(&Request::GetLan, Code::ErrorAccess);
}

#[test]
fn the_factory_password_is_taken_with_its_bytes_in_ascending_order_too() {
    let mut port = rested();
    assert_eq!(port.code(&Request::Authorise(PASSWORD.swap_bytes())), Code::OkAccess);
}

#[test]
fn another_password_is_taken_as_it_is_only() {
    let mut port = Port::new();
    assert_eq!(port.code(&Request::SetPassword(OTHER)), Code::Ok);
    for wrong in [OTHER.swap_bytes(), PASSWORD, PASSWORD.swap_bytes()] {
        port.bench.run_for(SECOND);
        assert_eq!(port.code(&Request::Authorise(wrong)), Code::ErrorAccess, "{wrong:#X}");
    }
    port.bench.run_for(SECOND);
    assert_eq!(port.code(&Request::Authorise(OTHER)), Code::OkAccess);
}

#[test]
fn power_off_ends_the_login() {
    let mut port = Port::new();
    port.bench.drive.switch_off(port.bench.now);
    assert_eq!(port.ask(&Request::GetLan), None);
    port.bench.run_for(SECOND);
    port.bench.drive.switch_on(port.bench.now, 0);
    assert_eq!(port.code(&Request::GetLan), Code::ErrorAccess);
    assert!(!port.session.is_authorised());
    port.bench.run_for(just_before(SECOND));
    port.assert_refused(&LOGIN, Code::ErrorAccessTimeout);
    port.bench.run_for(Duration::from_nanos(1));
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
}

#[test]
fn power_off_forgets_a_failed_attempt_but_the_second_after_power_up_counts() {
    let mut port = rested();
    assert_eq!(port.code(&WRONG), Code::ErrorAccess);
    port.bench.drive.switch_off(port.bench.now);
    port.bench.drive.switch_on(port.bench.now, 0);
    assert!(port.bench.log_in(PASSWORD));
    port.reply(&LOGIN);
    assert!(!port.session.is_authorised());
}

#[test]
fn stop_usb_silences_its_session_and_no_other() {
    let mut port = Port::new();
    let answer = port.order(Opcode::StopUsb, 0);
    assert_eq!((answer.code, answer.data), (Code::EndPrograms, 0));
    assert!(port.session.is_stopped());
    let before = port.snapshot();
    for request in everything_but_a_login() {
        assert_eq!(port.ask(&request), None);
    }
    let broken = Err(Malformed::Packet(Code::ErrorXor));
    assert_eq!(port.bench.drive.handle_standard(port.bench.now, &mut port.session, broken), None);
    assert_eq!(port.snapshot(), before);
    port.session = StandardSession::usb();
    port.bench.run_for(SECOND);
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
}

#[test]
fn a_usb_port_that_was_stopped_answers_after_a_power_cycle() {
    let mut port = Port::new();
    port.order(Opcode::StopUsb, 0);
    port.bench.drive.switch_off(port.bench.now);
    port.bench.drive.switch_on(port.bench.now, 0);
    assert_eq!(port.code(&Request::GetLan), Code::ErrorAccess);
}

#[test]
fn stop_usb_over_lan_changes_nothing() {
    let mut port = Port::new();
    port.session = StandardSession::lan();
    port.bench.run_for(SECOND);
    assert_eq!(port.code(&LOGIN), Code::OkAccess);
    let before = port.snapshot();
    assert_eq!(port.order(Opcode::StopUsb, 0).code, Code::EndPrograms);
    assert_eq!(port.snapshot(), before);
    assert_eq!(port.get(Opcode::GetMaxSpeed), 1000);
}
