//! Requests that somebody stops waiting for.

use crate::bench::{Act, Bench, MS, SECOND, Setup};
use crate::link::Fault;
use std::time::Duration;
use stepdrive_host::smsd::{Framing, Smsd, Way};
use stepdrive_proto::smsd::{PacketBuf, encode_request};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Request, VERSION_2};
use tokio::time::timeout;

/// Lets `what` run no longer than `time`.
async fn drop_after<T>(time: Duration, what: impl Future<Output = T>) -> Option<T> {
    timeout(time, what).await.ok()
}

#[tokio::test(start_paused = true)]
async fn the_reply_to_a_dropped_request_is_thrown_away() {
    for setup in [Setup::default(), Setup::raw()] {
        let bench = Bench::ready_as(&setup).await;
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
}

#[tokio::test(start_paused = true)]
async fn a_dropped_login_is_begun_again() {
    for setup in [Setup::default(), Setup::raw()] {
        for time in (0..2200).step_by(100) {
            let bench = Bench::of(&setup);
            bench.otherwise(Fault::Delay(150 * MS));
            let _ = drop_after(time * MS, bench.client.log_in()).await;
            bench.heal();
            assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "dropped after {time} ms");
        }
    }
}

/// Bytes of an instruction as a packet.
fn length(framing: Framing, opcode: Opcode, id: u8) -> usize {
    let mut packet = PacketBuf::new();
    let word = Instruction { opcode, data: 0 }.word();
    encode_request(&mut packet, framing, VERSION_2, id, &Request::Command(word));
    packet.len()
}

/// A line on which nothing more goes out for almost a second, and `begun` bytes of a stop that was then dropped.
async fn with_a_stop_stuck(setup: &Setup, begun: usize) -> Bench {
    let bench = Bench::of(setup);
    // Three requests that nobody takes yet: the first is with the controller, which is slow.
    let read = length(setup.framing, Opcode::GetSpeed, 9);
    bench.make_room(3 * read + begun);
    tokio::time::sleep(2 * SECOND).await;
    bench.client.log_in().await.expect("the factory's password");
    bench.faults([Fault::Delay(900 * MS)]);
    for _ in 0..4 {
        let _ = bench.client.check_readable(Reg::Speed);
        assert_eq!(drop_after(MS, bench.client.read(Reg::Speed)).await, None);
    }
    assert_eq!(drop_after(MS, bench.client.hard_stop()).await, None);
    bench
}

#[tokio::test(start_paused = true)]
async fn a_command_that_had_not_begun_to_go_out_never_does() {
    let bench = with_a_stop_stuck(&Setup::default(), 0).await;
    assert_eq!(bench.client.read(Reg::Stop).await, Ok(1));
    tokio::time::sleep(5 * SECOND).await;
    assert_eq!(bench.acts(), []);
    assert_eq!(bench.look(Reg::HiZ, 0), 1);
    assert_eq!(bench.attempts().len(), 1, "the connection is as good as before");
}

#[tokio::test(start_paused = true)]
async fn a_command_that_has_gone_out_in_part_is_not_finished_late() {
    for begun in 1..length(Framing::Stuffed, Opcode::HardStop, 9) {
        let bench = with_a_stop_stuck(&Setup::default(), begun).await;
        assert_eq!(bench.client.read(Reg::Stop).await, Ok(1));
        tokio::time::sleep(5 * SECOND).await;
        assert_eq!(bench.acts(), []);
        assert_eq!(bench.attempts().len(), 2, "its rest would have come first on the old one");
    }
}

#[tokio::test(start_paused = true)]
async fn a_command_that_has_gone_out_is_carried_out_once() {
    let bench = with_a_stop_stuck(&Setup::default(), length(Framing::Stuffed, Opcode::HardStop, 9)).await;
    assert_eq!(bench.client.read(Reg::Stop).await, Ok(1));
    assert_eq!(bench.acts(), [Act::Instruction(Opcode::HardStop)]);
}

#[tokio::test(start_paused = true)]
async fn a_dropped_move_has_happened_once_or_not_at_all() {
    for setup in [Setup::default(), Setup::raw()] {
        for micros in (0..60_000).step_by(1000) {
            let bench = Bench::ready_as(&setup).await;
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
}

#[tokio::test(start_paused = true)]
async fn a_dropped_store_leaves_the_next_one_whole() {
    let program: Vec<Instruction> =
        (0..255).map(|line| Instruction::with_position(Opcode::MoveF, line * 997)).collect();
    let bench = Bench::ready().await;
    for micros in (0..40_000).step_by(1700) {
        bench.otherwise(Fault::Delay(10 * MS));
        let _ = drop_after(Duration::from_micros(micros), bench.client.store_program(1, &program)).await;
        bench.heal();
        if micros % 5 == 0 {
            assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000));
        }
    }
    tokio::time::sleep(10 * MS).await;
    bench.client.store_program(1, &program).await.expect("stored");
    assert_eq!(bench.client.fetch_program(1).await, Ok(program));
}

#[tokio::test(start_paused = true)]
async fn a_dropped_change_of_password_is_found_out_at_the_next_login() {
    for micros in (0..40_000).step_by(1000) {
        let bench = Bench::ready().await;
        bench.otherwise(Fault::Delay(10 * MS));
        let _ = drop_after(Duration::from_micros(micros), bench.client.change_password(5)).await;
        bench.heal();
        tokio::time::sleep(SECOND).await;
        bench.cut();
        assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "dropped after {micros} µs");
    }
}
