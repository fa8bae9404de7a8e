//! Requests that somebody stops waiting for.

use crate::common::link::Fault;
use crate::common::station::{MS, SECOND};
use crate::line::{BenchOf, Line};
use crate::suite::program;
use std::time::Duration;
use stepdrive_host::smsd::{Smsd, Way};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::timeout;

/// Lets `what` run no longer than `time`.
async fn drop_after<T>(time: Duration, what: impl Future<Output = T>) -> Option<T> {
    timeout(time, what).await.ok()
}

pub(crate) async fn the_reply_to_a_dropped_request_is_thrown_away<L: Line>() {
    let bench = L::ready().await;
    bench.client.write_many(&[(Reg::MaxSpeed, 777), (Reg::MinSpeed, 33)]).await.expect("in range");
    for late in [1, 20, 300] {
        for rest in [0, late] {
            bench.faults([Fault::Delay(late * MS)]);
            assert_eq!(drop_after(late * MS / 2, bench.client.read(Reg::MaxSpeed)).await, None);
            tokio::time::sleep(rest * MS).await;
            assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33));
        }
    }
    assert_eq!(bench.attempts().len(), 1);
}

pub(crate) async fn a_dropped_login_is_begun_again<L: Line>() {
    for time in (0..2200).step_by(100) {
        for bench in L::kinds() {
            bench.otherwise(Fault::Delay(150 * MS));
            let _ = drop_after(time * MS, bench.client.log_in()).await;
            bench.heal();
            assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "dropped after {time} ms");
        }
    }
}

pub(crate) async fn a_connection_that_is_dropped_while_it_is_opened_is_opened_anew<L: Line>() {
    let bench = L::fresh();
    bench.let_connections_hang(true);
    assert_eq!(drop_after(SECOND, bench.client.read(Reg::Speed)).await, None);
    bench.let_connections_hang(false);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

/// A line on which nothing more goes out for almost a second, and `begun` bytes of a stop that was then dropped.
async fn with_a_stop_stuck<L: Line>(begun: usize) -> BenchOf<L> {
    let bench = L::fresh();
    // Three requests that nobody takes yet: the first is with the controller, which is slow.
    bench.make_room(3 * L::length(Opcode::GetSpeed) + begun);
    tokio::time::sleep(2 * SECOND).await;
    bench.client.log_in().await.expect("the factory's password");
    bench.faults([Fault::Delay(900 * MS)]);
    for _ in 0..4 {
        assert_eq!(drop_after(MS, bench.client.read(Reg::Speed)).await, None);
    }
    assert_eq!(drop_after(MS, bench.client.hard_stop()).await, None);
    bench
}

pub(crate) async fn a_command_that_had_not_begun_to_go_out_never_does<L: Line>() {
    let bench = with_a_stop_stuck::<L>(0).await;
    assert_eq!(bench.client.read(Reg::Stop).await, Ok(1));
    tokio::time::sleep(5 * SECOND).await;
    assert_eq!(bench.acts(), []);
    assert_eq!(bench.look(Reg::HiZ, 0), 1);
    assert_eq!(bench.attempts().len(), 1, "the connection is as good as before");
}

pub(crate) async fn a_command_that_has_gone_out_in_part_is_not_finished_late<L: Line>() {
    for begun in 1..L::length(Opcode::HardStop) {
        let bench = with_a_stop_stuck::<L>(begun).await;
        assert_eq!(bench.client.read(Reg::Stop).await, Ok(1));
        tokio::time::sleep(5 * SECOND).await;
        assert_eq!(bench.acts(), []);
        let attempts = if L::SENDS_AHEAD { 2 } else { 1 };
        assert_eq!(bench.attempts().len(), attempts, "its rest would have come first on the old one");
    }
}

pub(crate) async fn a_command_that_has_gone_out_is_carried_out_once<L: Line>() {
    let bench = with_a_stop_stuck::<L>(L::length(Opcode::HardStop)).await;
    assert_eq!(bench.client.read(Reg::Stop).await, Ok(1));
    assert_eq!(bench.acts(), vec![L::coil(Reg::HardStop); usize::from(L::SENDS_AHEAD)]);
}

pub(crate) async fn a_dropped_move_has_happened_once_or_not_at_all<L: Line>() {
    for micros in (0..60_000).step_by(1000) {
        let bench = L::ready().await;
        bench.otherwise(Fault::Delay(10 * MS));
        let going = bench.client.move_to(1600, Way::Shortest);
        let outcome = drop_after(Duration::from_micros(micros), going).await;
        bench.heal();
        tokio::time::sleep(5 * SECOND).await;
        let acts = bench.acts();
        assert!(acts.len() <= 1, "{acts:?}");
        assert!(outcome.is_none() || acts.len() == 1);
        let position = bench.client.read(Reg::AbsPos).await.expect("nothing is poisoned");
        assert_eq!(position, if acts.is_empty() { 0 } else { 1600 });
        assert_eq!(bench.client.move_to(16, Way::Shortest).await, Ok(()));
    }
}

pub(crate) async fn a_dropped_store_leaves_the_next_one_whole<L: Line>() {
    for slowness in [Duration::ZERO, 10 * MS] {
        let bench = L::ready().await;
        let program = program(if slowness.is_zero() { 100 } else { 255 });
        for micros in (0..80_000).step_by(1700) {
            bench.otherwise(Fault::Delay(slowness));
            let storing = bench.client.store_program(1, &program);
            let _ = drop_after(Duration::from_micros(micros), storing).await;
            bench.heal();
            if micros % 5 == 0 {
                assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000));
            }
        }
        tokio::time::sleep(10 * MS).await;
        bench.client.store_program(1, &program).await.expect("stored");
        assert_eq!(bench.client.fetch_program(1).await, Ok(program));
    }
}

pub(crate) async fn a_dropped_change_of_password_is_found_out_at_the_next_login<L: Line>() {
    for micros in (0..40_000).step_by(1000) {
        let bench = L::ready().await;
        bench.otherwise(Fault::Delay(10 * MS));
        let _ = drop_after(Duration::from_micros(micros), bench.client.change_password(5)).await;
        bench.heal();
        tokio::time::sleep(SECOND).await;
        bench.cut();
        assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "dropped after {micros} µs");
    }
}
