//! What goes wrong on the line, and what becomes of the requests that it happens to.
#![allow(clippy::float_cmp, reason = "values are the drive's own")]

use crate::station::{Fault, MS, SECOND, Station};
use stepdrive_host::{Direction, Error, LineError};
use stepdrive_spec::smd3::commands::{Command, Value};
use tokio::time::Instant;

/// Everything that can happen to one line.
fn all() -> Vec<Fault> {
    let refused = b"0x0040,0x0000,-1 (Stop motor first)\r\n";
    vec![
        Fault::LoseLine,
        Fault::LoseReply,
        Fault::Delay(1500 * MS),
        Fault::Instead(b"\xFF\xFE\r\n\0\r\n".to_vec()),
        Fault::Instead(b"0x0040,0x0000,banana\r\n".to_vec()),
        Fault::Instead(b"x".repeat(3000)),
        Fault::Instead(b"0x0040,0x0000,-4 (Unknown command)\r\n".to_vec()),
        Fault::Before(b"\x80\x80".to_vec()),
        Fault::Before(b"0x00".to_vec()),
        Fault::Behind(b"0x0040,0x0000\r\n".to_vec()),
        Fault::Behind(refused.to_vec()),
        Fault::Half(0),
        Fault::Half(9),
        Fault::Pause(9, 20 * MS),
        Fault::Pause(9, 1500 * MS),
        Fault::CutBefore,
        Fault::CutAfter,
    ]
}

#[tokio::test(start_paused = true)]
async fn a_read_comes_through_whatever_happens_once() {
    for fault in all() {
        let station = Station::new();
        let client = station.client();
        client.get(Command::Vmax).await.expect("a value");
        station.faults([fault.clone()]);
        assert_eq!(client.get_number(Command::Amax).await, Ok(999.904), "{fault:?}");
        assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0), "{fault:?}: the next");
        assert_eq!(client.get_number(Command::Amax).await, Ok(999.904), "{fault:?}: and the one behind it");
    }
}

#[tokio::test(start_paused = true)]
async fn a_setting_comes_through_whatever_happens_once() {
    for fault in all() {
        let station = Station::new();
        let client = station.client();
        client.get(Command::Vmax).await.expect("a value");
        station.faults([fault.clone()]);
        assert_eq!(client.set_number(Command::Vmax, 500.0).await, Ok(Value::Float(500.0)), "{fault:?}");
        assert!((station.setting(Command::Vmax) - 500.0).abs() < 0.01, "{fault:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_motion_command_is_never_carried_out_twice_and_its_doubt_is_told() {
    for fault in all() {
        let station = Station::new();
        let client = station.client();
        client.get(Command::Vmax).await.expect("a value");
        station.faults([fault.clone()]);
        let outcome = client.runr(5000).await;
        let times = station.carried_out().len();
        assert!(times <= 1, "{fault:?}: {times} times");
        match outcome {
            Ok(()) => assert_eq!(times, 1, "{fault:?}"),
            Err(Error::Uncertain { command, state, .. }) => {
                assert_eq!(command, "RUNR,5000");
                let turns = station.velocity() != 0.0;
                assert_eq!(state.starts_with("the motor turns at"), turns, "{fault:?}: {state}");
                assert_eq!(turns, times == 1, "{fault:?}");
            }
            Err(Error::Refused(_)) => panic!("{fault:?}: a reply that was none of its own was believed"),
            Err(other) => panic!("{fault:?}: {other}"),
        }
        tokio::time::sleep(20 * SECOND).await;
        client.get(Command::Vmax).await.expect("the line is in order again");
        assert_eq!(station.carried_out(), vec![], "{fault:?}: nothing comes later");
    }
}

#[tokio::test(start_paused = true)]
async fn a_stop_is_sent_again_until_it_is_answered() {
    for fault in all() {
        let station = Station::new();
        let client = station.client();
        client.runv(Direction::Positive).await.expect("started");
        tokio::time::sleep(SECOND).await;
        station.faults([fault.clone(), fault.clone()]);
        let stopped = client.stop().await;
        assert!(stopped.is_ok() || matches!(stopped, Err(Error::Line(_))), "{fault:?}: {stopped:?}");
        if stopped.is_err() {
            client.stop().await.expect("in the end");
        }
        tokio::time::sleep(2 * SECOND).await;
        assert_eq!(station.velocity(), 0.0, "{fault:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn what_wears_or_clears_is_not_done_again() {
    for command in [Command::Store, Command::Clr, Command::Load, Command::Loadfd] {
        let station = Station::new();
        let client = station.client();
        client.get(Command::Vmax).await.expect("a value");
        station.faults([Fault::LoseReply]);
        let doubt = client.act(command).await.expect_err("its reply was lost");
        assert!(matches!(doubt, Error::Uncertain { .. }) && doubt.exit_code() == 5, "{doubt}");
        assert_eq!(station.carried_out(), [command]);
    }
}

#[tokio::test(start_paused = true)]
async fn the_doubt_about_a_motion_reads_as_one_sentence() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    station.faults([Fault::LoseLine]);
    let doubt = client.runa(1000).await.expect_err("it was lost");
    assert_eq!(
        doubt.to_string(),
        "RUNA,1000 was sent, but its reply was lost (uhv did not answer within 1s); it was not sent again: the motor is in \
         standby at PACT 0, in mode 2 (Remote)"
    );
}

#[tokio::test(start_paused = true)]
async fn after_a_loss_the_line_is_settled_before_anything_else_is_sent() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    let upsets = client.upsets();
    station.lines();
    station.faults([Fault::Delay(1200 * MS)]);
    assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0));
    assert_eq!(station.lines(), ["VMAX", ",?", "SER", "VMAX"]);
    assert_eq!(client.upsets(), upsets + 1);
}

#[tokio::test(start_paused = true)]
async fn a_late_answer_to_what_settles_the_line_is_none_to_what_comes_then() {
    for late in [50, 150, 500, 900] {
        let station = Station::new();
        let client = station.client();
        client.estop().await.expect("stopped");
        station.faults([Fault::LoseReply, Fault::Pause(3, late * MS)]);
        client.get(Command::Vmax).await.expect("a value");
        let refused = client.runa(5).await;
        assert!(matches!(refused, Err(Error::Fault(_))), "{late} ms: {refused:?}");
        assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0), "{late} ms");
    }
}

#[tokio::test(start_paused = true)]
async fn half_a_line_that_somebody_left_in_the_drive_is_no_command() {
    for left in ["RUNV,+", "RUNA,10", "ESTOP", "STO", "MODE,", "\r", "RUNR,5\r", "garbage \u{7f}"] {
        let station = Station::new();
        let mut before = station.raw();
        before.write(left.as_bytes()).await;
        drop(before);
        tokio::time::sleep(10 * MS).await;
        station.carried_out();
        let client = station.client();
        assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0), "{left:?}");
        assert_eq!(station.carried_out(), vec![], "{left:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_cable_that_is_pulled_is_told_and_one_that_is_plugged_in_again_is_used() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    station.unplug(true);
    tokio::time::sleep(MS).await;
    let lost = client.get(Command::Vmax).await.expect_err("unplugged");
    assert!(matches!(lost, Error::Line(LineError::Connect { .. })), "{lost}");
    assert_eq!(lost.exit_code(), 5);
    let lost = client.runa(5).await.expect_err("unplugged");
    assert!(matches!(lost, Error::Line(_)), "it was not sent, so there is no doubt: {lost}");
    station.unplug(false);
    assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0));
    client.runa(5).await.expect("started");
    assert_eq!(station.carried_out(), [Command::Runa]);
}

#[tokio::test(start_paused = true)]
async fn a_drive_that_was_switched_off_and_on_is_spoken_to_as_before() {
    let station = Station::new();
    let client = station.client();
    client.set_number(Command::Vmax, 500.0).await.expect("taken");
    client.runv(Direction::Positive).await.expect("started");
    station.restart();
    let status = client.status().await.expect("a status");
    assert!(status.standby() && status.position == 0.0);
    assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0), "it was not stored");
}

#[tokio::test(start_paused = true)]
async fn a_drive_that_never_answers_is_told_as_silent_without_waiting_for_ever() {
    let station = Station::new();
    let client = station.client();
    station.otherwise(Fault::LoseLine);
    let began = Instant::now();
    let lost = client.get(Command::Vmax).await.expect_err("silent");
    assert_eq!(lost.to_string(), "uhv did not answer within 1s");
    assert!(began.elapsed() <= 2 * SECOND, "{:?}", began.elapsed());
    station.otherwise(Fault::None);
    assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0));
}

#[tokio::test(start_paused = true)]
async fn a_drive_that_is_slower_than_its_client_is_patient_is_told_as_silent_and_understood_later() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    station.faults([Fault::Delay(10 * SECOND)]);
    assert_eq!(client.get(Command::Vmax).await.expect_err("slow").exit_code(), 5);
    assert_eq!(client.get(Command::Amax).await.expect_err("still slow").exit_code(), 5);
    tokio::time::sleep(20 * SECOND).await;
    assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0));
    station.faults([Fault::Delay(10 * SECOND)]);
    let doubt = client.runr(5).await.expect_err("slow").to_string();
    assert!(doubt.ends_with("it was not sent again: its state could not be read afterwards"), "{doubt}");
    tokio::time::sleep(20 * SECOND).await;
    assert_eq!(client.get_number(Command::Pact).await, Ok(5.0));
}

#[tokio::test(start_paused = true)]
async fn something_else_that_talks_all_the_time_is_told_as_garbled() {
    for chatter in [&b"hello\r\n"[..], b"0x0040,0x0000\r\n", b"GET / HTTP/1.1\r\n\r\n", b"\0"] {
        let station = Station::new();
        let client = station.client();
        station.otherwise(Fault::Instead(chatter.repeat(40)));
        let began = Instant::now();
        let lost = client.get(Command::Vmax).await.expect_err("no drive");
        assert!(matches!(lost, Error::Line(_)), "{lost}");
        assert!(began.elapsed() <= 10 * SECOND, "{:?}", began.elapsed());
    }
}

#[tokio::test(start_paused = true)]
async fn a_line_that_takes_nothing_is_given_up_and_used_when_it_does() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    station.deafen(true);
    assert!(matches!(client.runr(1_000_000).await, Err(Error::Uncertain { .. })));
    station.deafen(false);
    tokio::time::sleep(SECOND).await;
    assert_eq!(client.get_number(Command::Vmax).await, Ok(1000.0));
    assert!(station.carried_out().len() <= 1);
}

#[tokio::test(start_paused = true)]
async fn a_value_that_is_not_the_one_sent_is_told() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    station.faults([Fault::Instead(b"0x0040,0x0000,0\r\n".to_vec())]);
    let differs = client.set_number(Command::L, 1.0).await.expect_err("another value");
    assert_eq!(differs.to_string(), "L was set to 1, and the drive answered 0; read it again");
    assert_eq!(differs.exit_code(), 10);
}

#[tokio::test(start_paused = true)]
async fn a_command_that_the_drive_does_not_know_is_told_as_that_and_leaves_the_line_in_order() {
    let reading = |command| (command, None);
    for ((command, value), line, answer, told) in [
        (reading(Command::Thigh), "THIGH", "-4 (Unknown command)", "THIGH"),
        (reading(Command::Thigh), "THIGH", "-3 (Unable to get)", "how to read THIGH"),
        ((Command::Vmax, Some(500.0)), "VMAX,500.0", "-101 (x)", "VMAX with an argument of this type"),
        ((Command::Vmax, Some(500.0)), "VMAX,500.0", "-102 (x)", "VMAX with this number of arguments"),
    ] {
        let station = Station::new();
        let client = station.client();
        station.otherwise_of(line, format!("0x0040,0x0000,{answer}\r\n").as_bytes());
        let outcome = match value {
            None => client.get_number(command).await,
            Some(value) => client.set_number(command, value).await.map(|_| value),
        };
        let error = outcome.expect_err("it does not know it");
        let words = error.to_string();
        let end = format!(": the controller does not know {told}; its firmware may be older");
        assert!(words.starts_with(&line.replace(".0", "")) && words.ends_with(&end), "{words}");
        assert_eq!(error.exit_code(), 2);
        assert!(client.last_flags().is_some());
        station.lines();
        assert_eq!(client.get_number(Command::Amax).await, Ok(999.904));
        assert_eq!(station.lines(), ["AMAX"], "the line is in order");
    }
}

#[tokio::test(start_paused = true)]
async fn a_line_that_makes_nonsense_of_a_command_twice_is_asked_a_third_time() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    let nonsense = Fault::Instead(b"0x0040,0x0000,-4 (Unknown command)\r\n".to_vec());
    let settle = [Fault::None, Fault::None];
    station.faults([&[nonsense.clone()][..], &settle, &[nonsense]].concat());
    assert_eq!(client.get_number(Command::Amax).await, Ok(999.904));
}

#[tokio::test(start_paused = true)]
async fn nonsense_of_another_kind_each_time_is_none_of_the_drives_answers() {
    let station = Station::new();
    let client = station.client();
    client.get(Command::Vmax).await.expect("a value");
    let nonsense = |code: &str| Fault::Instead(format!("0x0040,0x0000,{code} (x)\r\n").into_bytes());
    let settle = [Fault::None, Fault::None];
    station
        .faults([&[nonsense("-4")][..], &settle, &[nonsense("-102")], &settle, &[nonsense("-4")]].concat());
    let lost = client.get(Command::Amax).await.expect_err("noise");
    assert!(matches!(lost, Error::Line(LineError::Garbled { .. })), "{lost}");
    assert_eq!(client.get_number(Command::Amax).await, Ok(999.904));
}

#[tokio::test(start_paused = true)]
async fn a_motor_that_has_stopped_since_it_stood_in_the_way_is_told_to_be_tried_again() {
    let station = Station::new();
    let client = station.client();
    station.otherwise_of("RUNR,5", b"0x0000,0x0000,-1 (Stop motor first)\r\n");
    let refused = client.runr(5).await.expect_err("refused");
    let told = "the drive said that the motor was turning; it has stopped since; try again";
    assert!(refused.to_string().ends_with(told) && refused.exit_code() == 7, "{refused}");
    station.otherwise_of("RUNR,5", b"0x0040,0x0000,-7 (Not possible when motor disabled)\r\n");
    let refused = client.runr(5).await.expect_err("refused");
    let told = "but no error flag says by what; enable it with CLR";
    assert!(refused.to_string().ends_with(told) && refused.exit_code() == 8, "{refused}");
}
