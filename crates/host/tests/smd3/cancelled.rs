//! Requests that nobody waits for any more.
#![allow(clippy::float_cmp, reason = "values are the drive's own")]

use crate::station::{Fault, MS, SECOND, Station};
use std::future::poll_fn;
use std::pin::pin;
use std::task::Poll;
use stepdrive_host::Error;
use stepdrive_spec::smd3::commands::Command;
use tokio::time::timeout;

/// Polls a future so often and drops it.
async fn poll_times<T>(future: impl Future<Output = T>, times: usize) -> Option<T> {
    let mut future = pin!(future);
    let mut left = times;
    poll_fn(|context| {
        if left == 0 {
            return Poll::Ready(None);
        }
        left -= 1;
        future.as_mut().poll(context).map(Some)
    })
    .await
}

#[tokio::test(start_paused = true)]
async fn dropped_at_any_point_a_request_spoils_nothing_that_follows() {
    for polls in 0..24 {
        let station = Station::new();
        let client = station.client();
        // The first poll after each piece that the line takes.
        let dropped = poll_times(client.runr(123_456), polls).await;
        let before = station.motions();
        assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0), "after {polls} polls");
        let motions = station.motions();
        assert!(
            motions.len() <= 1 && motions.iter().all(|line| line == "RUNR,123456"),
            "{polls}: {motions:?}"
        );
        assert!(dropped.is_none() || motions.len() == 1, "{polls}");
        tokio::time::sleep(10 * SECOND).await;
        client.get(Command::Pact).await.expect("a value");
        assert!(station.motions().len() <= motions.len().max(before.len()), "{polls}: started later");
    }
}

#[tokio::test(start_paused = true)]
async fn a_motion_of_which_half_a_line_has_gone_out_does_not_start_when_its_caller_has_gone() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    station.deafen(true);
    // Of 15 bytes the line takes 12 or 13, which is all but CR LF at most.
    assert!(timeout(100 * MS, client.runr(-1_000_000)).await.is_err());
    station.deafen(false);
    assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0));
    tokio::time::sleep(SECOND).await;
    assert_eq!((station.motions(), station.velocity()), (vec![], 0.0));
}

#[tokio::test(start_paused = true)]
async fn the_reply_to_a_dropped_request_is_none_to_the_next() {
    for patience in [1, 50, 500] {
        let station = Station::new();
        let client = station.client();
        client.get(Command::Vmax).await.expect("a value");
        station.faults([Fault::Delay(600 * MS)]);
        let dropped = timeout(patience * MS, client.get(Command::Amax)).await;
        assert!(dropped.is_err());
        assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0), "{patience} ms");
    }
}

#[tokio::test(start_paused = true)]
async fn dropped_while_it_connects_it_connects_again() {
    let station = Station::new();
    let client = station.client();
    assert!(poll_times(client.get(Command::Vmax), 1).await.is_none());
    assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0));
}

#[tokio::test(start_paused = true)]
async fn any_number_of_tasks_share_a_drive() {
    let station = Station::new();
    let client = std::sync::Arc::new(station.client());
    let tasks: Vec<_> = (0..20)
        .map(|number| {
            let client = std::sync::Arc::clone(&client);
            tokio::spawn(async move {
                for _ in 0..20 {
                    let (command, expected) =
                        if number % 2 == 0 { (Command::Vmax, 1000.0) } else { (Command::Vstart, 9.999_59) };
                    let read = client.get_number(command).await?;
                    assert!((read - expected).abs() < 0.001, "{command} {read}");
                    if number == 7 {
                        let _ = timeout(MS / 2, client.get(Command::Tmot)).await;
                    }
                }
                Ok::<(), Error>(())
            })
        })
        .collect();
    for task in tasks {
        task.await.expect("no panic").expect("no trouble");
    }
}
