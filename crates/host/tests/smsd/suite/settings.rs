//! Motor configuration, LAN parameters, password.

use crate::common::link::Fault;
use crate::common::station::{SECOND, text, timed};
use crate::line::Line;
use stepdrive_host::Error;
use stepdrive_host::smsd::{LanParameters, Smsd, SmsdOptions};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::Reg;

const MOTOR: MotorConfiguration = MotorConfiguration {
    current_or_voltage: 0,
    motor_type: 30,
    microstepping: 7,
    work_current: 25,
    stop_current: 3,
};

/// LAN parameters with another value everywhere.
pub(crate) fn other(before: LanParameters) -> LanParameters {
    LanParameters {
        id: before.id.map(|_| 17),
        mac: [2, 3, 4, 5, 6, 7],
        ip: [10, 0, 0, 5],
        subnet_mask: [255, 0, 0, 0],
        gateway: [10, 0, 0, 1],
        dns: [0xFA, 0xFB, 0xFE, 9],
        port: 5020,
        dhcp: true,
    }
}

pub(crate) async fn a_motor_configuration_is_set_as_a_whole<L: Line>() {
    let bench = L::ready().await;
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
    assert_eq!(told, format!("{} {}", L::CONTROLLER, L::ENERGISED));
}

pub(crate) async fn lan_parameters_are_stored_and_in_effect<L: Line>() {
    let bench = L::ready().await;
    let before = bench.client.lan_parameters().await.expect("logged in");
    assert_eq!((before.ip, before.port, before.dhcp), ([192, 168, 1, 2], 502, false));
    assert_eq!(before.mac, [0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00]);
    let wanted = other(before);
    bench.client.configure_lan(&wanted).await.expect("in range");
    let stored = bench.change(|drive, _| drive.memory().lan);
    assert_eq!((stored.mac, stored.ip, stored.gateway), (wanted.mac, wanted.ip, wanted.gateway));
    assert_eq!(
        (stored.subnet_mask, stored.dns, stored.port, stored.dhcp),
        (wanted.subnet_mask, wanted.dns, Some(5020), 2)
    );
    let unit = wanted.id.unwrap_or(1);
    assert_eq!((stored.id, bench.change(|drive, _| drive.unit())), (unit, unit));
    assert_eq!(bench.client.lan_parameters().await, Ok(wanted));
}

pub(crate) async fn lan_parameters_out_of_range_are_told<L: Line>() {
    let bench = L::ready().await;
    let before = bench.client.lan_parameters().await.expect("logged in");
    assert_eq!(
        text(bench.client.configure_lan(&LanParameters { port: 0, ..before }).await),
        "Port 0 is out of range: 1 to 65535; nothing was sent"
    );
}

pub(crate) async fn a_changed_password_counts_from_the_next_connection_on<L: Line>() {
    let bench = L::ready().await;
    bench.client.change_password(0xFEDC_BA98_7654_3210).await.expect("authorised");
    assert_eq!(bench.acts(), [L::password()]);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    bench.cut();
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    let old = bench.another(SmsdOptions::default());
    assert!(matches!(old.read(Reg::Speed).await, Err(Error::NotAuthorised(_))));
}

pub(crate) async fn a_change_of_password_that_is_not_answered_is_settled_by_logging_in<L: Line>() {
    let bench = L::ready().await;
    bench.fault_behind(L::BEFORE_PASSWORD, Fault::LoseReply);
    let (changed, took) = timed(bench.client.change_password(5)).await;
    assert_eq!(changed, Ok(()), "it was carried out");
    assert!(took < 3 * SECOND, "{took:?}");
    assert_eq!(bench.acts(), [L::password()]);
    bench.fault_behind(L::BEFORE_PASSWORD, Fault::LoseRequest);
    let told = text(bench.client.change_password(6).await);
    assert_eq!(
        told,
        format!(
            "the change of the password was sent, but its reply was lost ({} did not answer within 1s); \
             it was not sent again: the password before is in force; \
             this was read on another connection, so what was sent may still arrive",
            L::CONTROLLER
        )
    );
    assert!(bench.acts().is_empty());
    assert_eq!(bench.change(|drive, _| drive.memory().password), 5);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
}

pub(crate) async fn a_client_that_does_not_know_which_password_is_in_force_tries_both<L: Line>() {
    for arrives in [true, false] {
        let bench = L::ready().await;
        let fault = if arrives { Fault::LoseReply } else { Fault::LoseRequest };
        bench.fault_behind(L::BEFORE_PASSWORD, fault);
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
