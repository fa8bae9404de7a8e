//! Any requests under any trouble: what the driver says is what the drive has, and nothing moves twice.

use crate::station::{Fault, MS, Station};
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::time::Duration;
use stepdrive_host::Error;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_spec::smd3::commands::{Command, Value};
use tokio::time::timeout;

#[derive(Clone, Debug)]
enum Op {
    Get(Command),
    Set(f64),
    Move(i64),
    Stop,
    Sleep(u64),
    Unplug,
    PlugIn,
}

/// An operation, what becomes of its first lines, and how long its caller waits.
type Step = (Op, Vec<Fault>, Option<u64>);

fn any_fault() -> impl Strategy<Value = Fault> {
    let bytes = || {
        prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..60),
            Just(b"0x0040,0x0000\r\n".to_vec()),
            Just(b"0x0040,0x00".to_vec()),
            Just(b"\r\n".to_vec()),
        ]
    };
    prop_oneof![
        6 => Just(Fault::None),
        1 => Just(Fault::LoseLine),
        1 => Just(Fault::LoseReply),
        1 => (0_u64..3000).prop_map(|ms| Fault::Delay(Duration::from_millis(ms))),
        1 => proptest::collection::vec(0x80_u8..=0xFF, 0..60).prop_map(Fault::Instead),
        1 => proptest::collection::vec(0x80_u8..=0xFF, 0..60).prop_map(Fault::Before),
        1 => bytes().prop_map(Fault::Behind),
        1 => (0_usize..30).prop_map(Fault::Half),
        1 => (0_usize..30, 0_u64..1500).prop_map(|(at, ms)| Fault::Pause(at, Duration::from_millis(ms))),
        1 => Just(Fault::CutBefore),
        1 => Just(Fault::CutAfter),
    ]
}

fn any_step() -> impl Strategy<Value = Step> {
    let op = prop_oneof![
        3 => prop_oneof![Just(Command::Vmax), Just(Command::Res), Just(Command::Ser)].prop_map(Op::Get),
        3 => (1_u32..10_000).prop_map(|speed| Op::Set(f64::from(speed))),
        4 => (1_i64..1000).prop_map(Op::Move),
        2 => Just(Op::Stop),
        1 => (0_u64..5000).prop_map(Op::Sleep),
        1 => Just(Op::Unplug),
        2 => Just(Op::PlugIn),
    ];
    let patience = prop_oneof![3 => Just(None), 1 => (0_u64..1500).prop_map(Some)];
    (op, proptest::collection::vec(any_fault(), 0..4), patience)
}

/// Does one operation to its end, and checks what it says against the drive.
async fn carry_out(station: &Station, client: &Smd3Client, op: &Op, number: i64) -> Result<(), Error> {
    match op {
        Op::Get(command) => {
            let value = client.get(*command).await?;
            if *command == Command::Vmax {
                let Value::Float(speed) = value else { panic!("VMAX reads as {value:?}") };
                let held = station.setting(Command::Vmax);
                assert!((speed - held).abs() <= held * 1e-5, "VMAX {speed}, and the drive has {held}");
            }
        }
        Op::Set(speed) => {
            client.set_number(Command::Vmax, *speed).await?;
            let held = station.setting(Command::Vmax);
            assert!((speed - held).abs() < 0.01, "VMAX was set to {speed}, and the drive has {held}");
        }
        // No two moves are alike, so that it shows when one is made twice.
        Op::Move(steps) => {
            let (line, before) = (format!("RUNA,{}", steps + 1000 * number), station.motions().len());
            let outcome = client.runa(steps + 1000 * number).await;
            let started = station.motions()[before..].contains(&line);
            match &outcome {
                Ok(()) => assert!(started, "{line} was answered, and the drive has not started"),
                Err(Error::Line(_)) => {
                    assert!(!started, "{line} was told as not sent, and the drive has started");
                }
                Err(_) => {}
            }
            outcome?;
        }
        Op::Stop => client.stop().await?,
        Op::Sleep(ms) => tokio::time::sleep(Duration::from_millis(*ms)).await,
        Op::Unplug => station.unplug(true),
        Op::PlugIn => station.unplug(false),
    }
    Ok(())
}

async fn run(steps: &[Step]) {
    let station = Station::new();
    let client = station.client();
    for ((op, faults, patience), number) in steps.iter().zip(1..) {
        station.faults(faults.clone());
        let work = carry_out(&station, &client, op, number);
        // Neither a refusal nor a lost line is a failure here.
        let _ = match patience {
            Some(ms) => timeout(Duration::from_millis(*ms), work).await.unwrap_or(Ok(())),
            None => work.await,
        };
    }
    station.faults([]);
    station.unplug(false);
    tokio::time::sleep(4000 * MS).await;
    client.stop().await.expect("the line is in order");
    tokio::time::sleep(Duration::from_mins(10)).await;
    let status = client.status().await.expect("the line is in order");
    assert!((status.position - station.position()).abs() <= 1e-5 * status.position.abs() + 0.01);
    assert!(status.standby() && status.velocity == 0.0);
    let motions = station.motions();
    let different: BTreeSet<&String> = motions.iter().collect();
    assert_eq!(different.len(), motions.len(), "a motion was carried out twice: {motions:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn what_the_driver_says_is_what_the_drive_has(steps in proptest::collection::vec(any_step(), 1..40)) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
        runtime.expect("a runtime").block_on(run(&steps));
    }
}
