//! What every call does on a line on which nothing goes wrong.
#![allow(clippy::float_cmp, reason = "values are the drive's own")]

use crate::station::{MS, SECOND, Station};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, Kind, Mode, Request, Value};
use stepdrive_spec::smd3::flags::{ErrorFlag, StatusFlag};
use stepdrive_spec::smd3::signals::{Sensor, Signal};

fn told<T: std::fmt::Debug>(outcome: Result<T, Error>) -> String {
    outcome.expect_err("refused").to_string()
}

#[tokio::test(start_paused = true)]
async fn nothing_is_opened_before_something_is_asked_and_nothing_moves_by_connecting() {
    let station = Station::new();
    let client = station.client();
    tokio::time::sleep(SECOND).await;
    assert_eq!((station.openings(), client.last_flags(), client.name()), (0, None, "uhv"));
    client.status().await.expect("a status");
    assert_eq!((station.openings(), station.carried_out()), (1, vec![]));
    assert_eq!(station.lines(), [",?", "SER", "VACT", "PACT"]);
}

#[tokio::test(start_paused = true)]
async fn every_command_that_reads_reads_what_the_drive_has() {
    let station = Station::new();
    let client = station.client();
    for row in COMMANDS.iter().filter(|row| matches!(row.access, Access::Read | Access::ReadWrite)) {
        let value = client.get(row.command).await.unwrap_or_else(|error| panic!("{}: {error}", row.mnemonic));
        let fits = matches!(
            (row.kind, value),
            (Kind::Float, Value::Float(_))
                | (Kind::Bool, Value::Bool(_))
                | (Kind::Text, Value::Text(_) | Value::FlagTable)
                | (Kind::Uint, Value::Uint(_) | Value::Mode(_))
        );
        assert!(fits, "{} reads as {value:?}", row.mnemonic);
        if row.stored {
            let number = client.get_number(row.command).await.expect("a number");
            let held = station.setting(row.command);
            assert!((number - held).abs() <= held.abs() * 1e-5, "{} {number} {held}", row.mnemonic);
        }
    }
    assert_eq!(client.serial_number().await.map(|text| text.to_string()), Ok("20168-001".to_owned()));
    assert_eq!(client.firmware().await.map(|text| text.to_string()), Ok("20168.1".to_owned()));
}

#[tokio::test(start_paused = true)]
async fn every_setting_is_set_to_its_greatest_and_its_default() {
    let station = Station::new();
    let client = station.client();
    client.set_number(Command::Vstop, 700.0).await.expect("taken");
    for row in COMMANDS.iter().filter(|row| row.stored && row.command != Command::Mode) {
        let greatest = if row.max > 5000.0 || row.mnemonic == "VSTART" || row.mnemonic == "VSTOP" {
            700.0
        } else {
            row.max
        };
        for number in [greatest, row.default] {
            let set = client.set_number(row.command, number).await.unwrap_or_else(|error| panic!("{error}"));
            let set = match set {
                Value::Bool(on) => f64::from(u8::from(on)),
                Value::Uint(number) => number as f64,
                Value::Float(number) => number,
                Value::Int(_) | Value::Sign(_) | Value::Text(_) | Value::Mode(_) | Value::FlagTable => {
                    panic!("{} was set to {set:?}", row.mnemonic)
                }
            };
            assert!((set - station.setting(row.command)).abs() <= set.abs() * 1e-5, "{}", row.mnemonic);
        }
    }
    assert_eq!(client.set(Command::Lp, Value::Bool(true)).await, Ok(Value::Bool(true)));
    assert_eq!((station.setting(Command::LpPlus), station.setting(Command::LpMinus)), (1.0, 1.0));
}

#[tokio::test(start_paused = true)]
async fn a_set_value_is_answered_as_the_drive_can_make_it() {
    let station = Station::new();
    let client = station.client();
    assert_eq!(client.set_number(Command::Pddel, 100.0).await, Ok(Value::Float(109.227)));
    assert_eq!(client.set_number(Command::Res, 100.0).await, Ok(Value::Uint(128)));
}

#[tokio::test(start_paused = true)]
async fn what_the_table_excludes_is_not_sent() {
    let station = Station::new();
    let client = station.client();
    for (told, words) in [
        (told(client.set_number(Command::Vmax, 20_000.0).await), "VMAX 20000 is out of range: 0 to 15000 Hz"),
        (told(client.set_number(Command::L, 0.5).await), "L takes 0 or 1, not 0.5"),
        (told(client.set_number(Command::Tmot, 1.0).await), "TMOT can only be read"),
        (told(client.set_number(Command::Runa, 100.0).await), "RUNA starts motion and is no setting"),
        (told(client.runr(8_388_608).await), "RUNR 8388608 is out of range: -8388607 to 8388607 full step"),
        (told(client.get(Command::Runv).await), "RUNV cannot be read; it takes + or -"),
        (told(client.get(Command::Store).await), "STORE is done, not read"),
        (told(client.act(Command::Vmax).await), "VMAX is not done by itself"),
        (told(client.start_bake(201).await), "BAKET 201 is out of range: 0 to 200 °C"),
    ] {
        assert_eq!(told, format!("{words}; nothing was sent"));
    }
    assert_eq!((station.openings(), station.lines().len()), (0, 0));
}

#[tokio::test(start_paused = true)]
async fn the_flags_of_every_reply_are_kept() {
    let station = Station::new();
    let client = station.client();
    let flags = client.flags().await.expect("flags");
    assert!(StatusFlag::Standby.is_in(flags.status) && flags.error == 0);
    station.machine(|machine, now| machine.set_signal(now, Signal::LimitNegative, true));
    station.change(|drive, now| drive.set_sensor(now, Sensor::Open));
    client.get(Command::Fw).await.expect("a version");
    let flags = client.last_flags().expect("flags");
    assert!(StatusFlag::LimitNegative.is_in(flags.status) && ErrorFlag::Topen.is_in(flags.error));
    let refused = client.runv(Direction::Positive).await.expect_err("disabled");
    assert_eq!(
        refused.to_string(),
        "RUNV,+ refused (-7, Not possible when motor disabled): the motor is disabled by TOPEN; remove the cause and clear \
         it with CLR"
    );
    assert_eq!(refused.exit_code(), 8);
    assert!(ErrorFlag::Topen.is_in(client.clr().await.expect("done").error), "the cause is still there");
    station.change(|drive, now| drive.set_sensor(now, Sensor::Connected));
    assert_eq!(client.clr().await.map(|flags| flags.error), Ok(0));
}

#[tokio::test(start_paused = true)]
async fn the_motor_goes_where_it_is_sent() {
    let station = Station::new();
    let client = station.client();
    client.runr(200).await.expect("started");
    let status = client.status().await.expect("a status");
    assert!(!status.standby());
    tokio::time::sleep(2 * SECOND).await;
    assert_eq!(station.position(), 200.0);
    client.runa(-100).await.expect("started");
    tokio::time::sleep(2 * SECOND).await;
    assert_eq!(client.get_number(Command::Pact).await, Ok(-100.0));
    client.runv(Direction::Negative).await.expect("started");
    tokio::time::sleep(2 * SECOND).await;
    assert!(client.status().await.expect("a status").velocity < -999.0);
    client.stop().await.expect("stopped");
    tokio::time::sleep(2 * SECOND).await;
    assert!(client.status().await.expect("a status").standby());
    client.runv(Direction::Positive).await.expect("started");
    tokio::time::sleep(200 * MS).await;
    client.sstop().await.expect("stopped");
    tokio::time::sleep(SECOND).await;
    assert_eq!(station.position().fract(), 0.0, "on a full step");
    let done = [Command::Runr, Command::Runa, Command::Runv, Command::Stop, Command::Runv, Command::Sstop];
    assert_eq!(station.carried_out(), done);
}

#[tokio::test(start_paused = true)]
async fn what_wants_a_standing_motor_is_refused_with_its_speed() {
    let station = Station::new();
    let client = station.client();
    client.set_number(Command::Vmax, 412.0).await.expect("taken");
    client.runv(Direction::Positive).await.expect("started");
    tokio::time::sleep(SECOND).await;
    let refused = client.runr(5).await.expect_err("it turns");
    let words = refused.to_string();
    assert!(words.starts_with("RUNR,5 refused (-1, Stop motor first): the motor turns at 41"), "{words}");
    assert!(words.ends_with("Hz; stop it or use RUNA") && refused.exit_code() == 7, "{words}");
    client.stop().await.expect("stopped");
    tokio::time::sleep(SECOND).await;
    client.set_mode(Mode::Joystick).await.expect("taken");
    let words = told(client.runa(5).await);
    assert!(words.ends_with("and the drive is in mode 3 (Joystick); set MODE 2 first"), "{words}");
    let words = told(client.set_number(Command::Vstart, 500.0).await);
    assert!(
        words.starts_with("VSTART,500 refused (-2, Argument validation): it is above 0 and at most VSTOP"),
        "{words}"
    );
}

#[tokio::test(start_paused = true)]
async fn an_emergency_stop_latches_until_it_is_cleared() {
    let station = Station::new();
    let client = station.client();
    client.runv(Direction::Positive).await.expect("started");
    tokio::time::sleep(SECOND).await;
    client.estop().await.expect("stopped");
    assert_eq!(station.velocity(), 0.0);
    assert!(ErrorFlag::EmergencyStop.is_in(client.last_flags().expect("flags").error));
    assert!(matches!(client.runa(5).await, Err(Error::Fault(_))));
    assert_eq!(client.clr().await.map(|flags| flags.error), Ok(0));
    client.runa(5).await.expect("started");
}

#[tokio::test(start_paused = true)]
async fn a_limit_that_is_met_stops_the_motor_and_shows() {
    let station = Station::with(vec![(Signal::LimitPositive, [100.0, 110.0])]);
    let client = station.client();
    client.set_number(Command::L, 1.0).await.expect("taken");
    client.runv(Direction::Positive).await.expect("started");
    tokio::time::sleep(SECOND).await;
    let status = client.status().await.expect("a status");
    assert!(status.standby() && StatusFlag::LimitPositive.is_in(status.flags.status));
    assert_eq!(status.position, 100.0);
}

#[tokio::test(start_paused = true)]
async fn homing_wants_its_mode_and_its_limit() {
    let station = Station::with(vec![(Signal::LimitNegative, [-110.0, -100.0])]);
    let client = station.client();
    assert!(matches!(client.runh(Direction::Negative).await, Err(Error::Refused(_))));
    client.set_mode(Mode::Home).await.expect("taken");
    let words = told(client.runh(Direction::Negative).await);
    assert!(words.ends_with("enable it with L 1 and L- 1"), "{words}");
    client.set_number(Command::L, 1.0).await.expect("taken");
    client.runh(Direction::Negative).await.expect("started");
    tokio::time::sleep(60 * SECOND).await;
    let status = client.status().await.expect("a status");
    assert!(
        status.standby() && status.position == 0.0 && StatusFlag::LimitNegative.is_in(status.flags.status)
    );
    assert_eq!(client.mode().await, Ok(Mode::Home));
}

#[tokio::test(start_paused = true)]
async fn baking_warms_the_motor_and_ends() {
    let station = Station::new();
    let client = station.client();
    client.start_bake(80).await.expect("started");
    assert!(StatusFlag::Bake.is_in(client.flags().await.expect("flags").status));
    tokio::time::sleep(3600 * SECOND).await;
    let temperature = client.get_number(Command::Tmot).await.expect("a temperature");
    assert!((temperature - 80.0).abs() < 3.0, "{temperature}");
    client.end_bake().await.expect("ended");
    assert!(!StatusFlag::Bake.is_in(client.flags().await.expect("flags").status));
    assert_eq!(client.mode().await, Ok(Mode::Remote));
}

#[tokio::test(start_paused = true)]
async fn settings_are_stored_loaded_and_reset() {
    let station = Station::new();
    let client = station.client();
    client.set_number(Command::Vmax, 500.0).await.expect("taken");
    client.store().await.expect("stored");
    client.set_number(Command::Vmax, 600.0).await.expect("taken");
    client.load().await.expect("loaded");
    assert!((station.setting(Command::Vmax) - 500.0).abs() < 0.01);
    client.load_factory_defaults().await.expect("loaded");
    assert!((station.setting(Command::Vmax) - 1000.0).abs() < 0.01);
}

#[tokio::test(start_paused = true)]
async fn a_flash_that_is_worn_out_is_told_as_that() {
    let station = Station::new();
    let client = station.client();
    station.change(|drive, _| drive.wear_flash(true));
    let failed = client.store().await.expect_err("worn out");
    assert_eq!(
        failed.to_string(),
        "STORE refused (-5, Action failed): the flash could not be written and holds what it held before; the settings are in \
         force until power-off"
    );
    assert_eq!((failed.exit_code(), station.carried_out()), (2, vec![]));
}

#[tokio::test(start_paused = true)]
async fn any_request_can_be_sent_as_it_is() {
    let station = Station::new();
    let client = station.client();
    let request = Request { command: Command::Ident, argument: Some(Value::Bool(true)) };
    assert_eq!(client.request(request).await, Ok(Some(Value::Bool(true))));
    assert!(StatusFlag::Ident.is_in(client.last_flags().expect("flags").status));
}
