//! Trouble on the line.

use crate::common::link::Fault;
use crate::common::station::{MS, SECOND, text, timed};
use crate::line::Line;
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_host::{Error, LineError};
use stepdrive_rig::machine::Machine;
use stepdrive_spec::smsd::registers::Reg;

/// Everything that a line may do to one request, and that leaves it readable at the next try.
fn troubles<L: Line>() -> Vec<Fault> {
    let mut faults = vec![
        Fault::LoseRequest,
        Fault::LoseReply,
        Fault::Delay(500 * MS),
        Fault::Delay(1500 * MS),
        Fault::Delay(5 * SECOND),
        Fault::Postpone,
        Fault::Twice,
        Fault::StaleFirst,
        Fault::WrongNumber,
        Fault::Close,
        Fault::Garbage(vec![0; 300]),
        Fault::Garbage(b"HTTP/1.1 400 Bad Request\r\n\r\n".to_vec()),
    ];
    faults.extend((0..14).map(Fault::Break));
    faults.extend((0..14).map(|place| Fault::Halves(place, 20 * MS)));
    faults.extend((0..14).map(|place| Fault::Halves(place, 3 * SECOND)));
    faults.extend(L::own_troubles());
    faults
}

pub(crate) async fn a_read_survives_every_trouble_with_one_reply<L: Line>() {
    for fault in troubles::<L>() {
        let bench = L::ready().await;
        bench.client.write_many(&[(Reg::MaxSpeed, 777), (Reg::MinSpeed, 33)]).await.expect("in range");
        bench.faults([fault.clone()]);
        let (read, took) = timed(bench.client.read(Reg::MaxSpeed)).await;
        assert_eq!(read, Ok(777), "{fault:?}");
        assert!(took <= L::LONGEST_READ, "{fault:?} took {took:?}");
        for _ in 0..5 {
            assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33), "after {fault:?}");
            assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(777), "after {fault:?}");
        }
    }
}

pub(crate) async fn a_write_survives_every_trouble_with_one_reply<L: Line>() {
    let (reg, value) = L::WIDE;
    for fault in troubles::<L>() {
        let bench = L::ready().await;
        bench.faults([fault.clone()]);
        assert_eq!(bench.client.write(reg, value).await, Ok(()), "{fault:?}");
        assert_eq!(bench.look(reg, 0), value, "{fault:?}");
        assert_eq!(bench.client.read(reg).await, Ok(value), "after {fault:?}");
    }
}

pub(crate) async fn a_late_reply_is_not_taken_for_the_next_one<L: Line>() {
    let bench = L::of(SmsdOptions { tries: 1, ..SmsdOptions::default() }).logged_in().await;
    bench.client.write_many(&[(Reg::MaxSpeed, 777), (Reg::MinSpeed, 33)]).await.expect("in range");
    for late in [1001, 1500, 1999] {
        bench.faults([Fault::Delay(late * MS)]);
        let told = text(bench.client.read(Reg::MaxSpeed).await);
        assert_eq!(told, format!("{} did not answer within 1s", L::CONTROLLER));
        assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33), "both are single registers");
    }
    assert_eq!(bench.attempts().len(), 1, "the connection was good all along");
    bench.faults([Fault::Postpone]);
    assert!(bench.client.read(Reg::MaxSpeed).await.is_err());
    assert_eq!(bench.client.read(Reg::MinSpeed).await, Ok(33));
}

pub(crate) async fn numbers_come_round_and_none_is_taken_for_another<L: Line>() {
    let bench = L::ready().await;
    for round in 0..600 {
        let (reg, value) = if round % 2 == 0 { (Reg::MaxSpeed, 1000) } else { (Reg::MinSpeed, 0) };
        bench.faults([Fault::StaleFirst]);
        assert_eq!(bench.client.read(reg).await, Ok(value), "{round}");
    }
}

pub(crate) async fn a_controller_that_never_answers_is_given_up_in_time<L: Line>() {
    let bench = L::ready().await;
    bench.otherwise(Fault::LoseReply);
    let (read, took) = timed(bench.client.read(Reg::Speed)).await;
    assert!(matches!(read, Err(Error::Line(LineError::Silent { .. }))), "{read:?}");
    assert_eq!(took, 3 * SECOND);
    let (written, took) = timed(bench.client.write(Reg::MaxSpeed, 20)).await;
    let told = text(written);
    assert!(took < 4 * SECOND, "{took:?}");
    assert!(told.starts_with(&format!("{} did not answer within 1s", L::CONTROLLER)), "{told}");
    bench.heal();
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

pub(crate) async fn a_write_that_cannot_be_sent_again_may_still_have_arrived<L: Line>() {
    let bench = L::ready().await;
    bench.faults([Fault::Break(0)]);
    bench.refuse_connections(100);
    let told = text(bench.client.write(Reg::MinSpeed, 50).await);
    assert!(told.ends_with("refused; whether MIN_SPEED 50 was written is not known"), "{told}");
    assert_eq!(bench.look(Reg::MinSpeed, 0), 50);
}

pub(crate) async fn a_write_that_is_never_answered_says_that_nobody_knows<L: Line>() {
    let bench = L::of(SmsdOptions { tries: 2, ..SmsdOptions::default() }).logged_in().await;
    bench.otherwise(Fault::LoseReply);
    assert_eq!(
        text(bench.client.write(Reg::MaxSpeed, 20).await),
        format!("{} did not answer within 1s; whether MAX_SPEED 20 was written is not known", L::CONTROLLER)
    );
    assert_eq!(bench.look(Reg::MaxSpeed, 0), 20);
}

pub(crate) async fn power_that_goes_and_comes_back_is_followed<L: Line>() {
    let bench = L::ready().await;
    bench.client.write(Reg::MaxSpeed, 500).await.expect("in range");
    bench.machine(Machine::switch_off);
    bench.cut();
    bench.refuse_connections(4);
    assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::Line(LineError::Connect { .. }))));
    tokio::time::sleep(30 * SECOND).await;
    bench.machine(Machine::switch_on);
    assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "as at power-up");
}

pub(crate) async fn power_that_goes_and_comes_back_behind_an_open_port_is_followed<L: Line>() {
    let bench = L::ready().await;
    bench.client.write(Reg::MaxSpeed, 500).await.expect("in range");
    bench.machine(Machine::switch_off);
    assert!(matches!(bench.client.read(Reg::Speed).await, Err(Error::Line(LineError::Silent { .. }))));
    tokio::time::sleep(30 * SECOND).await;
    bench.machine(Machine::switch_on);
    assert_eq!(bench.client.read(Reg::MaxSpeed).await, Ok(1000), "as at power-up");
}

pub(crate) async fn many_tasks_share_one_client_through_trouble<L: Line>() {
    let bench = L::ready().await;
    let rounds = troubles::<L>().into_iter().flat_map(|fault| [Fault::None, Fault::None, fault]);
    bench.faults(rounds);
    let read = |reg: Reg, value: i64| {
        let client = &bench.client;
        async move {
            for _ in 0..40 {
                if let Ok(found) = client.read(reg).await {
                    assert_eq!(found, value);
                }
            }
        }
    };
    tokio::join!(
        read(Reg::MaxSpeed, 1000),
        read(Reg::MinSpeed, 0),
        read(Reg::WorkCurrent, 10),
        read(Reg::LanPort, 502),
        read(Reg::Mask, 255)
    );
}
