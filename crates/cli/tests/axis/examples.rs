//! The examples of the host library do what they say.

#[path = "../../../host/examples/blocking.rs"]
#[allow(dead_code, reason = "an example has a main")]
mod blocking;
#[path = "../../../host/examples/smd3_home.rs"]
#[allow(dead_code, reason = "an example has a main")]
mod smd3_home;
#[path = "../../../host/examples/smsd_move.rs"]
#[allow(dead_code, reason = "an example has a main")]
mod smsd_move;
#[path = "../../../host/examples/smsd_usb.rs"]
#[allow(dead_code, reason = "an example has a main")]
mod smsd_usb;

use crate::rig::{Bench, ready};
use std::future::Future;
use tokio::runtime::Builder;

/// The demo rig on free ports, fifty times as fast.
fn bench() -> Bench {
    let demo = stepdrive_rig::file::DEMO;
    let rig = demo
        .replace("\"127.0.0.1:8087\"", "\"127.0.0.1:0\"")
        .replace("\"127.0.0.1:5020\"", "\"127.0.0.1:0\"")
        .replace("serial = \"pty\" ", "serial_tcp = \"127.0.0.1:0\" ")
        .replace("clock = \"real\"", "clock = \"x50\"");
    Bench::with(&rig)
}

fn wait<T>(work: impl Future<Output = Result<T, stepdrive_host::Error>>) -> T {
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(work).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn smsd_move_homes_the_stage_and_ends_a_turn_before_where_it_went() {
    let bench = bench();
    wait(smsd_move::run(&format!("smsd+tcp://{}", bench.address(0))));
    // 12.5 mm are 500 full steps, 8000 microsteps; a turn is 200.
    assert_eq!(bench.drive(0)["position"], 300.0 * 16.0);
    // Home is where the switch closes.
    assert_eq!(bench.drive(0)["carriage"], -100.0 + 300.0);
}

#[test]
fn smsd_usb_reads_the_stage_at_its_usb_port_and_leaves_it_as_it_was() {
    let bench = bench();
    let port =
        ready(&bench.up)["drives"][0]["usb"].as_str().expect("the demo rig's stage has USB").to_owned();
    let before = bench.drive(0);
    wait(smsd_usb::run(&port));
    assert_eq!(bench.drive(0), before);
}

#[test]
fn smd3_home_homes_the_drive_and_goes_three_turns() {
    let bench = bench();
    wait(smd3_home::run(&format!("smd3+tcp://{}", bench.address(1))));
    assert_eq!(bench.drive(1)["position"], 600.0);
    assert_eq!(bench.drive(1)["carriage"], -4800.0 + 600.0);
}

#[test]
fn blocking_goes_there_and_back_and_lets_the_motor_go() {
    let bench = bench();
    blocking::run(&bench.address(0).to_string()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((&bench.drive(0)["position"], &bench.drive(0)["state"]), (&0.0.into(), &"HiZ".into()));
}
