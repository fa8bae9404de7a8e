//! A disk that cannot be written.
#![cfg(target_os = "linux")]

use crate::bench::{Place, text};
use std::process::Command;
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::registers::Reg;

/// Sets the size that a running process may give to its files, the way a full disk does.
fn limit_files(process: u32, size: &str) {
    let limit = format!("--fsize={size}:unlimited");
    let done = Command::new("prlimit").args(["--pid", &process.to_string(), &limit]).status();
    assert!(done.expect("there is a `prlimit`").success());
}

#[test]
fn what_cannot_be_stored_is_refused_and_told_once_and_stored_when_it_can_be() {
    let place = Place::new();
    // Writing beyond the limit is to fail, not to kill.
    let up = place.up_after("trap '' XFSZ");
    let mut client = up.client();
    client.write(Reg::WorkCurrent, &[20]).expect("answered").expect("accepted");

    limit_files(up.id(), "0");
    let refused = client.write(Reg::WorkCurrent, &[30]).expect("answered");
    assert_eq!(refused, Err(Exception::ServerDeviceFailure));
    for _ in 0..20 {
        let refused = client.read(Reg::WorkCurrent, 1).expect("answered");
        assert_eq!(refused, Err(Exception::ServerDeviceFailure), "nobody sees what is not stored");
    }

    limit_files(up.id(), "unlimited");
    assert_eq!(client.read(Reg::WorkCurrent, 1).expect("answered"), Ok(vec![30]));
    client.write(Reg::StopCurrent, &[3]).expect("answered").expect("accepted");
    let said = text(&up.end("TERM").stderr);
    assert!(said.starts_with("stage: state/memory.redb cannot be written: "), "{said}");
    assert!(said.ends_with("; the client was answered with exception 04\n"), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");

    let up = place.up();
    assert_eq!(up.client().read(Reg::WorkCurrent, 2).expect("answered"), Ok(vec![30, 3]));
    up.end("TERM");
}
