//! Several drives in one rig.

use crate::bench::{Bench, Client, TWO, who_are_you};
use std::fmt::Write;
use stepdrive_spec::smsd::registers::Reg;

/// Drives in the large rig: each takes a file descriptor, and many systems give a process 1024.
const MANY: usize = 300;

#[tokio::test]
async fn two_drives_in_one_rig_are_independent() {
    let bench = Bench::with(TWO).await;
    let (mut left, mut right) = (bench.client_of(0).await, bench.client_of(1).await);
    assert_eq!((left.get(Reg::HwMajor).await, right.get(Reg::HwMajor).await), (Ok(6), Ok(7)));
    left.command(0x0E, 200, 0).await;
    left.trigger(Reg::Relay).await.expect("accepted");
    while left.position().await == 0 {}
    assert_eq!(right.position().await, 0);
    assert_eq!(right.get(Reg::HiZ).await, Ok(1));
    assert_eq!(right.get(Reg::Relay).await, Ok(0));
    let mut elsewhere = Client::connect(bench.address_of(1)).await;
    assert_eq!(elsewhere.get(Reg::AccessFlag).await, Ok(0));
}

#[tokio::test]
async fn hundreds_of_drives_start_are_served_and_stop() {
    let mut rig = String::new();
    for number in 0..MANY {
        let drive = format!("name = 'd{number}'\nmodel = 'SMSD-4.2LAN'\nmodbus_tcp = '127.0.0.1:0'\n");
        write!(rig, "[[drive]]\n{drive}").expect("a string takes everything");
    }
    let bench = Bench::with(&rig).await;
    let mut clients = Vec::new();
    for drive in 0..MANY {
        let mut client = Client::connect(bench.address_of(drive)).await;
        client.ask(&who_are_you()).await.expect("answered");
        if drive % 10 == 0 {
            clients.push(client);
        }
    }
    bench.stop().await;
    for client in &mut clients {
        assert_eq!(client.closed().await, [0; 0]);
    }
}
