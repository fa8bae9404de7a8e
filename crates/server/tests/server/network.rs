//! `Apply Network Configuration`: the network chip is set up anew.

use crate::bench::{Bench, Client, ONE, TWO, free_port, who_are_you};
use std::net::{SocketAddr, TcpListener};
use stepdrive_server::StartError;
use stepdrive_spec::smsd::registers::Reg;

/// A client at an address that the drive is about to listen at.
async fn reach(address: SocketAddr) -> Client {
    loop {
        if let Ok(client) = Client::try_connect(address).await {
            return client;
        }
        tokio::task::yield_now().await;
    }
}

/// Waits until nobody listens at an address any more.
async fn left(address: SocketAddr) {
    while Client::try_connect(address).await.is_ok() {
        tokio::task::yield_now().await;
    }
}

fn local(port: u16) -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], port))
}

#[tokio::test]
async fn the_reply_comes_first_and_then_all_connections_are_closed() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    let mut other = bench.stranger().await;
    other.ask(&who_are_you()).await.expect("answered");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
    assert_eq!(client.closed().await, [0; 0]);
    assert_eq!(other.closed().await, [0; 0]);
    reach(bench.address()).await.ask(&who_are_you()).await.expect("the drive is there again");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_comes_back_at_once_is_not_closed_with_those_before_it() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    for _ in 0..200 {
        client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
        client.closed().await;
        client = bench.client().await;
    }
}

#[tokio::test]
async fn requests_behind_it_in_the_same_segment_are_not_carried_out() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    let apply = Reg::ApplyNetworkConfiguration.info().address;
    let apply = client.frame(&stepdrive_spec::modbus::Request::WriteCoil { address: apply, value: true });
    let relay = Reg::Relay.info().address;
    let relay = client.frame(&stepdrive_spec::modbus::Request::WriteCoil { address: relay, value: true });
    client.send(&[apply.clone(), relay].concat()).await;
    assert_eq!(client.closed().await, apply, "one reply");
    let mut client = reach(bench.address()).await;
    assert!(client.log_in(crate::bench::PASSWORD).await);
    assert_eq!(client.get(Reg::Relay).await, Ok(0));
}

#[tokio::test]
async fn a_new_unit_and_a_new_port_are_in_effect_and_survive_a_restart() {
    let bench = Bench::start().await;
    let (old, new) = (bench.address(), local(free_port()));
    let mut client = bench.client().await;
    client.write(Reg::LanId, &[9]).await.expect("accepted");
    client.write(Reg::LanPort, &[new.port()]).await.expect("accepted");
    assert_eq!(bench.stranger().await.get(Reg::HwMajor).await, Ok(6), "not in effect yet");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");

    let mut client = reach(new).await;
    client.unit = 9;
    client.ask(&who_are_you()).await.expect("answered");
    left(old).await;
    assert_eq!(bench.notices("now on"), [format!("stage: network configuration applied; now on TCP {new}")]);

    let bench = bench.restart().await;
    assert_eq!(bench.address(), new);
    assert_eq!(bench.server.drives()[0].unit, Some(9));
    let mut client = Client::connect(new).await;
    client.unit = 9;
    assert!(client.log_in(crate::bench::PASSWORD).await);
    assert_eq!(client.get(Reg::LanPort).await, Ok(new.port()));
    assert_eq!(client.get(Reg::LanId).await, Ok(9));
}

#[tokio::test]
async fn a_port_that_is_taken_leaves_the_drive_where_it_is() {
    let bench = Bench::start().await;
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = taken.local_addr().expect("bound").port();
    let mut client = bench.client().await;
    client.write(Reg::LanPort, &[port]).await.expect("accepted");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
    client.closed().await;
    reach(bench.address()).await.ask(&who_are_you()).await.expect("the old port");
    let told = bench.notices("staying on the old port");
    assert!(told.len() == 1 && told[0].contains(&format!("127.0.0.1:{port}")), "{told:?}");
}

#[tokio::test]
async fn a_stored_port_that_is_taken_at_the_start_is_said_to_come_from_the_lan_parameters() {
    let bench = Bench::start().await;
    let port = free_port();
    let mut client = bench.client().await;
    client.write(Reg::LanPort, &[port]).await.expect("accepted");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
    let folder = bench.stop().await;
    let _taken = TcpListener::bind(local(port)).expect("free again");
    let error = Bench::start_in(folder, ONE).await.map(drop).expect_err("the port is taken");
    assert!(matches!(error, StartError::Listen { remembered: true, .. }));
    assert!(error.to_string().contains("LAN parameters"), "{error}");
}

#[tokio::test]
async fn a_port_that_the_rig_left_open_is_read_and_followed() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    let lan = client.words(Reg::LanId, 25).await.expect("readable");
    assert_eq!(lan[0x17], bench.address().port());
    // As a client does that writes back all it has read.
    client.write(Reg::LanId, &lan).await.expect("accepted");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
    client.closed().await;
    let first = bench.address();
    let other = TcpListener::bind(first);
    assert!(other.is_err(), "the drive listens there still");

    let folder = bench.stop().await;
    let _taken = TcpListener::bind(first).expect("free now");
    let bench = Bench::start_in(folder, ONE).await.expect("another port is taken");
    let port = bench.client().await.get(Reg::LanPort).await;
    assert_eq!(port, Ok(bench.address().port()));
}

#[tokio::test]
async fn a_stored_port_stays_when_it_is_written_back_as_it_was_read() {
    let bench = Bench::start().await;
    let port = free_port();
    let mut client = bench.client().await;
    client.write(Reg::LanPort, &[port]).await.expect("accepted");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
    let bench = bench.restart().await;
    let mut client = bench.client().await;
    assert_eq!(client.get(Reg::LanPort).await, Ok(port));
    client.write(Reg::LanPort, &[port]).await.expect("accepted");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
    let bench = bench.restart().await;
    assert_eq!(bench.address().port(), port);
}

#[tokio::test]
async fn the_way_back_to_the_port_of_the_rig_is_open() {
    let bench = Bench::start().await;
    let (first, second) = (bench.address(), local(free_port()));
    for (from, to) in [(first, second), (second, first)] {
        let mut client = reach(from).await;
        assert!(client.log_in(crate::bench::PASSWORD).await);
        client.write(Reg::LanPort, &[to.port()]).await.expect("accepted");
        client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
        reach(to).await.ask(&who_are_you()).await.expect("answered");
        left(from).await;
    }
}

#[tokio::test]
async fn a_drive_that_moves_onto_the_port_of_another_stays() {
    let bench = Bench::with(TWO).await;
    let mut client = bench.client().await;
    client.write(Reg::LanPort, &[bench.address_of(1).port()]).await.expect("accepted");
    client.trigger(Reg::ApplyNetworkConfiguration).await.expect("accepted");
    client.closed().await;
    assert_eq!(reach(bench.address()).await.get(Reg::HwMajor).await, Ok(6));
    assert_eq!(reach(bench.address_of(1)).await.get(Reg::HwMajor).await, Ok(7));
}
