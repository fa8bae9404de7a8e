//! Typed access to the register map.

use super::line::ModbusTcp;
use crate::common::link::Fault;
use crate::common::station::text;
use crate::modbus_bench::Bench;
use crate::suite::turning;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::registers::Reg;

#[tokio::test(start_paused = true)]
async fn what_the_motor_forbids_is_refused_in_words() {
    let bench = turning::<ModbusTcp>(Bench::new()).await;
    let error = bench.client.write(Reg::Acc, 99).await.expect_err("turning");
    assert_eq!(
        error.to_string(),
        "stage (unit 1) refused ACC 99 (Modbus exception 06 (server device busy)): \
         the motor is turning; stop it first; nothing was changed"
    );
    assert_eq!(error.exit_code(), 7);
    let told = text(bench.client.write(Reg::Microstepping, 7).await);
    assert!(told.ends_with(
        "the motor is energised; de-energise it first (Soft HiZ or Hard HiZ); nothing was changed"
    ));
    assert_eq!(bench.client.write(Reg::MaxSpeed, 650).await, Ok(()), "any time");
}

#[tokio::test(start_paused = true)]
async fn exceptions_are_told_by_register_and_value() {
    let bench = Bench::ready().await;
    let cases = [
        (
            Exception::IllegalFunction,
            "stage (unit 1) does not know how to write MAX_SPEED 500 (Modbus exception 01",
            2,
        ),
        (
            Exception::IllegalDataAddress,
            "stage (unit 1) does not let one write MAX_SPEED 500 at HR 1101 (",
            2,
        ),
        (Exception::IllegalDataValue, "stage (unit 1) refused MAX_SPEED 500 as out of range (", 7),
        (
            Exception::ServerDeviceFailure,
            "stage (unit 1) failed to write MAX_SPEED 500 (Modbus exception 04",
            2,
        ),
        (Exception::ServerDeviceBusy, "stage (unit 1) refused MAX_SPEED 500 (", 7),
        (Exception::Other(11), "stage (unit 1) refused to write MAX_SPEED 500: Modbus exception 0B", 2),
    ];
    for (exception, start, code) in cases {
        bench.faults([Fault::Except(exception)]);
        let error = bench.client.write(Reg::MaxSpeed, 500).await.expect_err("an exception");
        assert!(error.to_string().starts_with(start), "{error}");
        assert_eq!(error.exit_code(), code, "{error}");
    }
    bench.faults([Fault::Except(Exception::IllegalDataValue)]);
    let told = text(bench.client.write(Reg::MaxSpeed, 500).await);
    assert!(told.ends_with("; it takes 16 to 15600 full steps/s; nothing was changed"), "{told}");
    bench.faults([Fault::Except(Exception::ServerDeviceFailure)]);
    let told = text(bench.client.read_row(Reg::LanIp).await);
    assert!(told.starts_with("stage (unit 1) failed to read IP 0 to IP 3 ("), "{told}");
    assert!(told.ends_with("); try again"), "{told}");
    bench.faults([Fault::Except(Exception::ServerDeviceBusy)]);
    let error = bench.client.read(Reg::Acc).await.expect_err("an exception");
    assert_eq!(
        error.to_string(),
        "stage (unit 1) refused to read ACC (Modbus exception 06 (server device busy)): it is busy; try again"
    );
    assert_eq!(error.exit_code(), 2, "no interlock stands against being read");
    bench.faults([Fault::Except(Exception::IllegalDataValue)]);
    let told = text(bench.client.write(Reg::PasswordLow32, 0x1234_5678).await);
    assert!(!told.contains("305419896") && told.contains("Password_LOW32"), "{told}");
}
