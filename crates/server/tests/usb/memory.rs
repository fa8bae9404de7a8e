//! What survives, and is stored before it is told.

use crate::bench::{Bench, PASSWORD, REST, STANDARD, USB, code, instruction};

const OTHER: [u8; 8] = [1, 2, 3, 4, 5, 6, 7, 8];

#[tokio::test]
async fn password_programs_and_motor_configuration_survive_a_restart() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.logged_in().await;
    let program: Vec<u8> = (0..255).flat_map(|line| instruction(0x06, 100 + line)).collect();
    let reply = client.ask(4, &program).await;
    assert_eq!((reply.packet_type(), reply.code()), (1, code::OK));
    assert_eq!(client.command(0x03, 0x2A3D).await.code(), code::OK);
    assert_eq!(client.ask(13, &OTHER).await.code(), code::OK);
    let mode = client.command(0x04, 0).await.value();
    drop(client);

    let bench = bench.restart().await;
    let mut client = bench.serial();
    assert_eq!(client.ask(0, &PASSWORD).await.code(), code::ERROR_ACCESS);
    bench.pass(REST).await;
    assert_eq!(client.ask(0, &OTHER).await.code(), code::OK_ACCESS);
    let reply = client.ask(8, &[]).await;
    assert_eq!((reply.packet_type(), reply.data()), (8, program.as_slice()));
    assert_eq!(client.command(0x04, 0).await.value(), mode);
    assert_eq!(client.ask(4, &[]).await.code(), code::OK);
    let bench = bench.restart().await;
    let mut client = bench.serial();
    assert_eq!(client.ask(0, &OTHER).await.code(), code::OK_ACCESS);
    assert_eq!(client.ask(8, &[]).await.data(), b"");
}

#[tokio::test]
async fn what_is_set_over_lan_is_there_over_usb() {
    let bench = Bench::awake(STANDARD).await;
    let mut lan = bench.log_in(bench.standard().await).await;
    let mut usb = bench.log_in(bench.usb_tcp().await).await;
    let program = [instruction(0x24, 0), instruction(0x00, 0)].concat();
    assert_eq!(lan.ask(6, &program).await.code(), code::OK);
    assert_eq!(usb.ask(10, &[]).await.data(), program);
    assert_eq!(usb.ask(12, &[]).await.data().len(), 25);
    assert_eq!(lan.ask(12, &[]).await.data(), usb.ask(12, &[]).await.data());
}
