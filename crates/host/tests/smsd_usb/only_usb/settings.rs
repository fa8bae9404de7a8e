//! Identification, motor configuration, LAN parameters, password.

use crate::common::link::Fault;
use crate::common::station::{SECOND, text};
use crate::standard_bench::{Act, Bench, Setup};
use crate::suite::settings::other;
use stepdrive_host::Error;
use stepdrive_host::smsd::{LanParameters, Smsd, SmsdOptions};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::Code;

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
async fn a_controller_that_does_not_know_the_question_tells_all_but_what_it_is() {
    let bench = Bench::ready().await;
    bench.faults([Fault::Refuse(Code::ErrorNoCommand)]);
    let identity = bench.client.identity().await.expect("logged in");
    assert_eq!(identity.to_string(), "an SMSD that does not tell its model, protocol 2");
    assert_eq!((bench.client.model().await, identity.hardware, identity.firmware), (Ok(None), None, None));
    assert_eq!(text(bench.client.read(Reg::FwMajor).await), "stage does not tell its versions");
    let readings = bench.client.read_all().await.expect("the rest");
    assert!(readings.iter().any(|reading| reading.reg == Reg::AbsPos));
    assert!(readings.iter().all(|reading| reading.reg != Reg::HwMajor));
}

#[tokio::test(start_paused = true)]
async fn a_controller_that_cannot_be_understood_when_it_tells_what_it_is_is_asked_again_later() {
    for fault in [Fault::LoseReply, Fault::DamageReply(8, 1)] {
        let bench = Bench::ready().await;
        bench.faults([fault.clone(), fault.clone(), fault.clone()]);
        assert_eq!(bench.client.model().await, Ok(None), "{fault:?}");
        assert_eq!(bench.client.model().await, Ok(Some(Model::Smsd42)), "{fault:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_are_set_at_once_over_usb() {
    let bench = Bench::ready().await;
    let before = bench.client.lan_parameters().await.expect("logged in");
    assert_eq!(before.id, Some(1));
    bench.client.configure_lan(&other(before)).await.expect("in range");
    assert_eq!(bench.change(|drive, _| drive.unit()), 17);
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
