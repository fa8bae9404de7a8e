//! Motor configuration, LAN parameters, password.

use crate::common::link::Fault;
use crate::modbus_bench::Bench;
use crate::suite::settings::other;

#[tokio::test(start_paused = true)]
async fn lan_parameters_are_written_down_and_then_applied() {
    let bench = Bench::ready().await;
    let before = bench.client.lan_parameters().await.expect("logged in");
    let wanted = other(before);
    assert_eq!((before.id, wanted.id), (Some(1), Some(17)));
    bench.client.set_lan_parameters(&wanted).await.expect("in range");
    assert_eq!(bench.change(|drive, _| drive.unit()), 1, "not in effect yet");
    bench.client.apply_lan_parameters().await.expect("a coil");
    // The connection was closed, and the unit is another one.
    assert_eq!(bench.client.lan_parameters().await, Ok(wanted));
    assert_eq!(bench.client.name().await, "stage (unit 17)");
    assert_eq!(bench.attempts().len(), 2);
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_that_no_controller_can_have_are_told_by_register() {
    let bench = Bench::ready().await;
    for (place, value, told) in [
        (0, 248, "ID of stage (unit 1) reads 248, and it can be 1 to 247"),
        (9, 999, "IP 2 of stage (unit 1) reads 999, and it can be 0 to 255"),
        (23, 0, "Port of stage (unit 1) reads 0, and it can be 1 to 65535"),
        (24, 3, "DHCP of stage (unit 1) reads 3, and it can be 1 to 2"),
    ] {
        bench.faults([Fault::Register(place, value)]);
        let error = bench.client.lan_parameters().await.expect_err("out of range");
        assert_eq!(error.to_string(), format!("{told}; write another value to it"));
        assert_eq!(error.exit_code(), 2);
    }
    bench.faults([Fault::Register(10, 255)]);
    assert_eq!(bench.client.lan_parameters().await.map(|lan| lan.ip), Ok([192, 168, 1, 255]));
}
