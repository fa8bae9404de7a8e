//! Identification, motor configuration, LAN parameters, password.

use crate::bench::{Act, Bench, SECOND, Setup, text, timed};
use crate::link::Fault;
use stepdrive_host::Error;
use stepdrive_host::smsd::{LanParameters, Smsd, SmsdOptions};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::Code;

const MOTOR: MotorConfiguration = MotorConfiguration {
    current_or_voltage: 0,
    motor_type: 30,
    microstepping: 7,
    work_current: 25,
    stop_current: 3,
};

#[tokio::test(start_paused = true)]
async fn a_controller_says_what_it_is() {
    for (model, shown) in Model::ALL.into_iter().zip(["SMSD-4.2LAN", "SMSD-8.0LAN"]) {
        let bench = Bench::ready_as(&Setup { model, ..Setup::default() }).await;
        let identity = bench.client.identity().await.expect("logged in");
        assert_eq!((identity.model, identity.register_map), (Some(model), None));
        assert_eq!(identity.to_string(), format!("{shown}, hardware 1, firmware 1.3, protocol 2"));
    }
}

#[tokio::test(start_paused = true)]
async fn a_controller_that_does_not_say_what_it_is_takes_what_any_model_takes() {
    let bench = Bench::ready().await;
    bench.faults([Fault::Refuse(Code::ErrorNoCommand)]);
    let told = text(bench.client.write(Reg::WorkCurrent, 43).await);
    assert!(told.starts_with("stage refused to write WORK_CURRENT 43 (ERROR_RANGE"), "{told}");
    assert_eq!(bench.client.write(Reg::WorkCurrent, 42).await, Ok(()));
}

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
    assert_eq!(
        text(bench.client.set_motor_configuration(&MotorConfiguration::FACTORY).await),
        "stage refused to write CURRENT_OR_VOLTAGE 1, MOTOR_TYPE 0, MICROSTEPPING 4, WORK_CURRENT 10, STOP_CURRENT 1: \
         the motor is energised; de-energise it first (Soft HiZ or Hard HiZ); \
         nothing was changed but CMD_ERROR, which is set: clear it (CLR)"
    );
}

fn other(before: LanParameters) -> LanParameters {
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

#[tokio::test(start_paused = true)]
async fn lan_parameters_are_set_at_once_over_usb() {
    let bench = Bench::ready().await;
    let before = bench.client.lan_parameters().await.expect("logged in");
    assert_eq!((before.id, before.ip, before.port, before.dhcp), (Some(1), [192, 168, 1, 2], 502, false));
    assert_eq!(before.mac, [0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00]);
    let wanted = other(before);
    bench.client.configure_lan(&wanted).await.expect("in range");
    assert_eq!(bench.change(|drive, _| drive.unit()), 17);
    assert_eq!(bench.client.lan_parameters().await, Ok(wanted));
    bench.client.configure_lan(&LanParameters { id: None, ..before }).await.expect("in range");
    assert_eq!(bench.client.lan_parameters().await, Ok(LanParameters { id: Some(17), ..before }));
    assert_eq!(bench.attempts().len(), 1, "USB stays");
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_of_the_standard_firmware_have_no_unit_and_end_the_connection() {
    let bench = Bench::ready_as(&Setup::raw()).await;
    let before = bench.client.lan_parameters().await.expect("logged in");
    assert_eq!(before.id, None);
    let told = text(bench.client.configure_lan(&LanParameters { id: Some(5), ..before }).await);
    assert_eq!(told, "stage has no ID: it has the standard firmware");
    assert_eq!(text(bench.client.write(Reg::LanId, 5).await), told);
    assert_eq!(text(bench.client.read(Reg::LanId).await), told);
    assert_eq!(bench.attempts().len(), 1);
    let wanted = other(before);
    bench.client.configure_lan(&wanted).await.expect("in range");
    assert_eq!(bench.client.lan_parameters().await, Ok(wanted), "on a new connection");
    assert_eq!(bench.attempts().len(), 1);
    let readings = bench.client.read_all().await.expect("logged in");
    assert!(readings.iter().all(|reading| reading.reg != Reg::LanId));
}

#[tokio::test(start_paused = true)]
async fn a_lan_parameter_by_itself_leaves_the_others() {
    let bench = Bench::ready().await;
    let before = bench.client.lan_parameters().await.expect("logged in");
    bench.client.write_at(Reg::LanIp, 3, 77).await.expect("in range");
    bench
        .client
        .write_many(&[(Reg::LanPort, 503), (Reg::LanMac, 2), (Reg::MaxSpeed, 500)])
        .await
        .expect("ok");
    let mut wanted = LanParameters { ip: [192, 168, 1, 77], port: 503, ..before };
    wanted.mac[0] = 2;
    assert_eq!(bench.client.lan_parameters().await, Ok(wanted));
    assert_eq!(bench.look(Reg::MaxSpeed, 0), 500);
    bench.requests();
    bench.client.trigger(Reg::ApplyNetworkConfiguration).await.expect("as they are");
    assert_eq!((bench.requests(), bench.client.lan_parameters().await), (2, Ok(wanted)));
    assert_eq!(
        text(bench.client.configure_lan(&LanParameters { port: 0, ..wanted }).await),
        "Port 0 is out of range: 1 to 65535; nothing was sent"
    );
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_that_no_controller_can_have_are_told_by_register() {
    let bench = Bench::ready().await;
    bench.faults([Fault::Value(3)]);
    let error = bench.client.lan_parameters().await.expect_err("out of range");
    assert_eq!(error.to_string(), "DHCP of stage reads 3, and it can be 1 to 2; write another value to it");
    assert_eq!(error.exit_code(), 2);
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_that_read_back_otherwise_are_told() {
    let bench = Bench::ready().await;
    let lan = bench.client.lan_parameters().await.expect("logged in");
    bench.faults([Fault::None, Fault::None, Fault::Value(2)]);
    let error = bench.client.configure_lan(&lan).await.expect_err("read back with DHCP");
    assert!(error.to_string().starts_with("the LAN parameters were written as "), "{error}");
    assert_eq!(error.exit_code(), 10);
}

#[tokio::test(start_paused = true)]
async fn a_changed_password_counts_from_the_next_connection_on() {
    let bench = Bench::ready().await;
    bench.client.change_password(0xFEDC_BA98_7654_3210).await.expect("authorised");
    assert_eq!(bench.acts(), [Act::Password]);
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    bench.cut();
    assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
    let old = bench.another(SmsdOptions::default());
    assert!(matches!(old.read(Reg::Speed).await, Err(Error::NotAuthorised(_))));
}

#[tokio::test(start_paused = true)]
async fn a_change_of_password_that_is_not_answered_is_settled_by_logging_in() {
    let bench = Bench::ready().await;
    bench.faults([Fault::LoseReply]);
    let (changed, took) = timed(bench.client.change_password(5)).await;
    assert_eq!(changed, Ok(()), "it was carried out");
    assert!(took < 3 * SECOND, "{took:?}");
    assert_eq!(bench.acts(), [Act::Password]);
    bench.faults([Fault::LoseRequest]);
    let told = text(bench.client.change_password(6).await);
    assert_eq!(
        told,
        "the change of the password was sent, but its reply was lost (stage did not answer within 1s); \
         it was not sent again: the password before is in force; \
         this was read on another connection, so what was sent may still arrive"
    );
    assert!(bench.acts().is_empty());
    assert_eq!(bench.change(|drive, _| drive.memory().password), 5);
}

#[tokio::test(start_paused = true)]
async fn a_client_that_does_not_know_which_password_is_in_force_tries_both() {
    for arrives in [true, false] {
        let bench = Bench::ready().await;
        bench.faults([if arrives { Fault::LoseReply } else { Fault::LoseRequest }]);
        bench.otherwise(Fault::LoseReply);
        let told = text(bench.client.change_password(5).await);
        assert!(told.contains("which password is in force could not be found out"), "{told}");
        bench.heal();
        assert_eq!(bench.client.read(Reg::Speed).await, Ok(0));
        assert_eq!(bench.change(|drive, _| drive.memory().password == 5), arrives);
        bench.cut();
        tokio::time::sleep(SECOND).await;
        assert_eq!(bench.client.change_password(9).await, Ok(()));
    }
}

#[tokio::test(start_paused = true)]
async fn a_password_that_is_changed_back_out_of_doubt_is_not_forgotten() {
    let factory = SmsdOptions::default().password;
    let bench = Bench::ready().await;
    bench.faults([Fault::LoseReply]);
    bench.otherwise(Fault::LoseReply);
    assert!(matches!(bench.client.change_password(5).await, Err(Error::Uncertain { .. })));
    bench.heal();
    tokio::time::sleep(2 * SECOND).await;
    // The old one is refused, the new one accepted; then the answer to the change back is lost.
    bench.faults([Fault::None, Fault::None, Fault::LoseReply]);
    assert_eq!(bench.client.change_password(factory).await, Ok(()));
    assert_eq!(bench.change(|drive, _| drive.memory().password), factory);
    assert_eq!(bench.acts(), [Act::Password, Act::Password]);
}
