//! Trouble on the line.

use crate::common::link::Fault;
use crate::common::station::{SECOND, text, timed};
use crate::modbus_bench::Bench;
use stepdrive_host::smsd::Smsd;
use stepdrive_host::{Error, LineError};
use stepdrive_spec::smsd::registers::Reg;

#[tokio::test(start_paused = true)]
async fn garbage_closes_the_connection_and_is_told_when_it_does_not_end() {
    let bench = Bench::ready().await;
    bench.attempts();
    bench.faults([Fault::Garbage(vec![0xAA; 40])]);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    assert_eq!(bench.attempts().len(), 1);
    bench.otherwise(Fault::Garbage(vec![0xAA; 40]));
    let told = text(bench.client.read(Reg::Speed).await);
    assert_eq!(told, "stage answered with what cannot be understood: a frame whose length field is 43690");
}

#[tokio::test(start_paused = true)]
async fn stale_frames_without_end_do_not_keep_a_request_for_ever() {
    let bench = Bench::ready().await;
    let stale: Vec<u8> = [0xF0, 0, 0, 0, 0, 5, 1, 4, 2, 0, 0].repeat(200);
    bench.otherwise(Fault::Garbage(stale));
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert!(matches!(read, Err(Error::Line(LineError::Silent { .. }))), "{read:?}");
    assert_eq!(took, 3 * SECOND);
}

#[tokio::test(start_paused = true)]
async fn an_exception_of_another_function_is_garbage_and_not_an_answer() {
    let bench = Bench::ready().await;
    // Transaction 4 is the next: an exception to function 3, where function 4 was asked.
    bench.faults([Fault::Garbage(vec![0, 4, 0, 0, 0, 3, 1, 0x83, 2])]);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    assert_eq!(bench.attempts().len(), 2);
}
