//! Motor configuration, LAN parameters, password.

use crate::bench::{Bench, SECOND, text};
use crate::link::Fault;
use stepdrive_host::Error;
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::Reg;

const MOTOR: MotorConfiguration = MotorConfiguration {
    current_or_voltage: 0,
    motor_type: 30,
    microstepping: 7,
    work_current: 25,
    stop_current: 3,
};

#[tokio::test(start_paused = true)]
async fn a_motor_configuration_is_set_as_a_whole() {
    let bench = Bench::ready().await;
    assert_eq!(bench.client.motor_configuration().await, Ok(MotorConfiguration::FACTORY));
    bench.client.set_motor_configuration(&MOTOR).await.expect("de-energised");
    assert_eq!(bench.change(|drive, _| drive.memory().motor), MOTOR);
    assert_eq!(bench.client.motor_configuration().await, Ok(MOTOR));
    let wrong = MotorConfiguration { work_current: 43, ..MOTOR };
    assert!(
        text(bench.client.set_motor_configuration(&wrong).await)
            .starts_with("WORK_CURRENT 43 is out of range")
    );
    bench.client.hard_stop().await.expect("always taken");
    let told = text(bench.client.set_motor_configuration(&MotorConfiguration::FACTORY).await);
    assert_eq!(
        told,
        "stage (unit 1) refused CURRENT_OR_VOLTAGE 1, MOTOR_TYPE 0, MICROSTEPPING 4, WORK_CURRENT 10, STOP_CURRENT 1 \
         (Modbus exception 06 (server device busy)): \
         the motor is energised; de-energise it first (Soft HiZ or Hard HiZ); nothing was changed"
    );
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_are_written_down_and_then_applied() {
    let bench = Bench::ready().await;
    let before = bench.client.lan_parameters().await.expect("logged in");
    assert_eq!((before.id, before.ip, before.port, before.dhcp), (Some(1), [192, 168, 1, 2], 502, false));
    assert_eq!(before.mac, [0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00]);
    let mut wanted = before;
    wanted.id = Some(17);
    wanted.mac = [2, 3, 4, 5, 6, 7];
    wanted.ip = [10, 0, 0, 5];
    wanted.subnet_mask = [255, 0, 0, 0];
    wanted.gateway = [10, 0, 0, 1];
    wanted.dns = [9, 9, 9, 9];
    wanted.port = 5020;
    wanted.dhcp = true;
    bench.client.set_lan_parameters(&wanted).await.expect("in range");
    assert_eq!(bench.change(|drive, _| drive.unit()), 1, "not in effect yet");
    bench.client.apply_lan_parameters().await.expect("a coil");
    let stored = bench.change(|drive, _| drive.memory().lan);
    assert_eq!(
        (stored.id, stored.mac, stored.ip, stored.gateway),
        (17, wanted.mac, wanted.ip, wanted.gateway)
    );
    assert_eq!(
        (stored.subnet_mask, stored.dns, stored.port, stored.dhcp),
        (wanted.subnet_mask, wanted.dns, Some(5020), 2)
    );
    // The connection was closed, and the unit is another one.
    assert_eq!(bench.client.lan_parameters().await, Ok(wanted));
    assert_eq!(bench.client.name().await, "stage (unit 17)");
    assert_eq!(bench.attempts().len(), 2);
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_out_of_range_are_told() {
    let bench = Bench::ready().await;
    let mut wanted = bench.client.lan_parameters().await.expect("logged in");
    wanted.port = 0;
    assert_eq!(
        text(bench.client.set_lan_parameters(&wanted).await),
        "Port 0 is out of range: 1 to 65535; nothing was sent"
    );
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_that_no_controller_can_have_are_told_by_register() {
    let bench = Bench::ready().await;
    for (place, value, told) in [
        (0, 248, "ID of stage (unit 1) reads 248, and it can be 1 to 247"),
        (9, 999, "IP 2 of stage (unit 1) reads 999, and it can be 0 to 255"),
        (23, 0, "Port of stage (unit 1) reads 0, and it can be 1 to 65535"),
        (24, 3, "DHCP of stage (unit 1) reads 3, and it can be 1 to 2"),
    ] {
        bench.faults([Fault::Register(place, value)]);
        let error = bench.client.lan_parameters().await.expect_err("out of range");
        assert_eq!(error.to_string(), format!("{told}; write another value to it"));
        assert_eq!(error.exit_code(), 2);
    }
    bench.faults([Fault::Register(10, 255)]);
    assert_eq!(bench.client.lan_parameters().await.map(|lan| lan.ip), Ok([192, 168, 1, 255]));
}

#[tokio::test(start_paused = true)]
async fn a_changed_password_counts_from_the_next_connection_on() {
    let bench = Bench::ready().await;
    bench.client.change_password(0xFEDC_BA98_7654_3210).await.expect("authorised");
    assert_eq!(bench.acts(), [(Reg::PasswordCmd, 1)]);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    bench.cut();
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    let old = bench.another(SmsdOptions::default());
    assert!(matches!(old.read(Reg::Speed).await, Err(Error::NotAuthorised(_))));
}

#[tokio::test(start_paused = true)]
async fn a_change_of_password_that_is_not_answered_is_settled_by_logging_in() {
    let bench = Bench::ready().await;
    bench.faults([Fault::None, Fault::LoseReply]);
    bench.client.change_password(5).await.expect("it was carried out");
    assert_eq!(bench.acts(), [(Reg::PasswordCmd, 1)]);
    bench.faults([Fault::None, Fault::LoseRequest]);
    let told = text(bench.client.change_password(6).await);
    assert_eq!(
        told,
        "the change of the password was sent, but its reply was lost (stage (unit 1) did not answer within 1s); \
         it was not sent again: the password before is in force; \
         this was read on another connection, so what was sent may still arrive"
    );
    assert!(bench.acts().is_empty());
    assert_eq!(bench.change(|drive, _| drive.memory().password), 5);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

#[tokio::test(start_paused = true)]
async fn a_client_that_does_not_know_which_password_is_in_force_tries_both() {
    for arrives in [true, false] {
        let bench = Bench::ready().await;
        bench.faults([Fault::None, if arrives { Fault::LoseReply } else { Fault::LoseRequest }]);
        bench.otherwise(Fault::LoseReply);
        let told = text(bench.client.change_password(5).await);
        assert!(told.contains("which password is in force could not be found out"), "{told}");
        bench.heal();
        assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
        assert_eq!(bench.change(|drive, _| drive.memory().password == 5), arrives);
        // And it knows from then on.
        bench.cut();
        tokio::time::sleep(SECOND).await;
        assert_eq!(bench.client.change_password(9).await, Ok(()));
    }
}
