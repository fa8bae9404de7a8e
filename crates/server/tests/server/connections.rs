//! Eight connections, and what belongs to one of them.

use crate::bench::{Bench, Client, PASSWORD, who_are_you};
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::registers::Reg;

/// Codes of `CMD`.
const RUN_F: u16 = 0x0E;
const MOVE_F: u16 = 0x10;

/// Fills all eight sockets of the drive, each in use.
async fn eight(bench: &Bench) -> Vec<Client> {
    let mut clients = Vec::new();
    for _ in 0..8 {
        let mut client = bench.stranger().await;
        client.ask(&who_are_you()).await.expect("answered");
        clients.push(client);
    }
    clients
}

#[tokio::test]
async fn a_ninth_client_is_turned_away_and_the_eight_go_on() {
    let bench = Bench::start().await;
    let mut clients = eight(&bench).await;
    let mut ninth = bench.stranger().await;
    assert_eq!(ninth.closed().await, [0; 0]);
    for client in &mut clients {
        client.ask(&who_are_you()).await.expect("answered");
    }
    let told = bench.notices("turned away");
    assert_eq!(told.len(), 1);
    assert!(told[0].starts_with("stage: 127.0.0.1:"), "{told:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 1)]
async fn those_that_came_first_have_the_eight_sockets_though_all_come_at_once() {
    let bench = Bench::start().await;
    let address = bench.address();
    // The server's only thread is busy with this until all have come.
    let all_at_once = async move { [(); 9].map(|()| Client::connect_at_once(address)) };
    let mut clients = Vec::from(tokio::spawn(all_at_once).await.expect("connected"));
    let mut ninth = clients.pop().expect("nine");
    for client in &mut clients {
        client.ask(&who_are_you()).await.expect("answered");
    }
    assert_eq!(ninth.closed().await, [0; 0]);
}

#[tokio::test]
async fn a_client_that_leaves_makes_room_for_one_that_comes_at_once() {
    let bench = Bench::start().await;
    let mut clients = eight(&bench).await;
    for round in 0..200 {
        drop(clients.remove(round % 8));
        let mut client = bench.stranger().await;
        client.ask(&who_are_you()).await.expect("the place of the one that left");
        clients.push(client);
    }
    assert_eq!(bench.notices("turned away").len(), 0);
}

#[tokio::test]
async fn a_flood_of_connections_is_told_of_once_and_leaves_the_eight_alone() {
    let bench = Bench::start().await;
    let mut clients = eight(&bench).await;
    let mut flood = Vec::new();
    for _ in 0..200 {
        flood.push(bench.stranger().await);
    }
    for client in &mut clients {
        client.ask(&who_are_you()).await.expect("answered");
    }
    for client in &mut flood {
        assert_eq!(client.closed().await, [0; 0]);
    }
    assert_eq!(bench.notices("turned away").len(), 1);
    clients.pop();
    bench.stranger().await.ask(&who_are_you()).await.expect("there is room again");
}

#[tokio::test]
async fn clients_that_vanish_in_the_middle_of_a_request_give_their_place_back() {
    let bench = Bench::start().await;
    for _ in 0..50 {
        let mut client = bench.stranger().await;
        let frame = client.frame(&who_are_you());
        client.send(&frame[..7]).await;
    }
    bench.stranger().await.ask(&who_are_you()).await.expect("answered");
}

#[tokio::test]
async fn authorisation_belongs_to_the_connection() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    let mut stranger = bench.stranger().await;
    assert_eq!(stranger.get(Reg::AccessFlag).await, Ok(0));
    assert_eq!(stranger.get(Reg::MaxSpeed).await, Err(Exception::IllegalDataAddress));
    assert_eq!(stranger.write(Reg::MaxSpeed, &[500]).await, Err(Exception::IllegalDataAddress));
    assert_eq!(client.get(Reg::MaxSpeed).await, Ok(1000));
    drop(client);
    assert_eq!(bench.stranger().await.get(Reg::AccessFlag).await, Ok(0), "a new connection begins anew");
}

#[tokio::test]
async fn two_clients_that_enter_the_password_at_once_do_not_mix_theirs() {
    let bench = Bench::start().await;
    let (mut left, mut right) = (bench.stranger().await, bench.stranger().await);
    left.write(Reg::PasswordLow32, &[0xCDEF, 0x89AB]).await.expect("written");
    right.write(Reg::PasswordLow32, &[0, 0, 0, 0]).await.expect("written");
    left.write(Reg::PasswordHigh32, &[0x4567, 0x0123, 0]).await.expect("written");
    assert_eq!(left.get(Reg::AccessFlag).await, Ok(1));
    assert_eq!(right.get(Reg::AccessFlag).await, Ok(0));
}

#[tokio::test]
async fn motion_goes_on_when_the_client_that_started_it_vanishes() {
    let bench = Bench::start().await;
    let mut other = bench.client().await;
    let mut client = bench.client().await;
    client.command(RUN_F, 1000, 0).await;
    let frame = client.frame(&who_are_you());
    client.send(&frame[..5]).await;
    drop(client);
    let start = other.position().await;
    while other.position().await <= start + 50 {}
    assert_eq!(other.get(Reg::Stop).await, Ok(0));
}

#[tokio::test]
async fn a_move_ends_where_it_should_though_its_client_has_gone() {
    let bench = Bench::start().await;
    let mut other = bench.client().await;
    let mut client = bench.client().await;
    client.write(Reg::MaxSpeed, &[15_600, 59_000, 59_000]).await.expect("accepted");
    client.command(MOVE_F, 16, 1234).await;
    drop(client);
    while other.get(Reg::Ready).await != Ok(1) {}
    assert_eq!(other.position().await, 1234);
}

#[tokio::test]
async fn a_changed_password_leaves_sessions_authorised_and_holds_for_the_next() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    client.write(Reg::PasswordLow32, &[1, 2, 3, 4, 1]).await.expect("changed");
    assert_eq!(client.get(Reg::AccessFlag).await, Ok(1));
    assert!(bench.stranger().await.log_in(0x0004_0003_0002_0001).await);
    assert!(!bench.stranger().await.log_in(PASSWORD).await);
}

/// A client that is logged in stays until `actions`, is gone after them, and a new one is not logged in.
async fn ends_at(actions: &[&str]) {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    for action in actions {
        bench.server.control().act(action).expect("an action");
    }
    assert_eq!(client.closed().await, [0; 0], "{actions:?}");
    bench.server.control().set_clock(stepdrive_rig::file::ClockMode::Factor(1000.0));
    let mut client = reconnected(&bench).await;
    assert_eq!(client.get(Reg::AccessFlag).await, Ok(0));
}

/// A client of the drive once it can be reached again.
async fn reconnected(bench: &Bench) -> Client {
    loop {
        let mut client = bench.stranger().await;
        if client.try_ask(&who_are_you()).await.is_ok() {
            return client;
        }
    }
}

#[tokio::test]
async fn without_supply_connections_end_even_when_it_is_back_before_anybody_looks() {
    ends_at(&["power stage off", "power stage on"]).await;
    ends_at(&["power stage off for 1us"]).await;
}

#[tokio::test]
async fn on_a_line_that_was_cut_connections_have_ended_even_when_it_is_mended_before_anybody_looks() {
    ends_at(&["fault stage.connection cut", "fault stage.connection off"]).await;
    ends_at(&["fault stage.connection cut for 1us"]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_comes_once_the_supply_or_the_line_is_back_stays() {
    let bench = Bench::start().await;
    let mut before = bench.stranger().await;
    before.ask(&who_are_you()).await.expect("answered");
    for round in 0..200 {
        let outage = match round % 2 {
            0 => ["power stage off", "power stage on"],
            _ => ["fault stage.connection cut", "fault stage.connection off"],
        };
        for action in outage {
            bench.server.control().act(action).expect("an action");
        }
        let mut client = Client::connect_at_once(bench.address());
        for _ in 0..2 {
            client.ask(&who_are_you()).await.expect("answered");
        }
        assert_eq!(before.closed().await, [0; 0], "it came before");
        before = client;
    }
}
