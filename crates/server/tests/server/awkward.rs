//! Twelve exchanges that servers in the field get wrong.

use crate::bench::{Bench, Client, who_are_you};
use stepdrive_spec::modbus::{Exception, Request, Table};
use stepdrive_spec::smsd::registers::Reg;

/// The ID block, for unit 1, as in the transaction `0x1234`.
//                     transaction protocol    length      unit  func  address     count
const ID: [u8; 12] = [0x12, 0x34, 0x00, 0x00, 0x00, 0x06, 0x01, 0x04, 0x80, 0x01, 0x00, 0x04];
/// Its reply.
//                           transaction protocol    length      unit  func  bytes
const ID_REPLY: [u8; 17] =
    [0x12, 0x34, 0x00, 0x00, 0x00, 0x0B, 0x01, 0x04, 0x08, 0x00, 0x06, 0x00, 0x01, 0x00, 0x01, 0x00, 0x03];

/// A frame of `pdu` for unit 1.
fn frame(transaction: u16, pdu: &[u8]) -> Vec<u8> {
    let length = u16::try_from(pdu.len() + 1).expect("short");
    [&transaction.to_be_bytes()[..], &[0, 0], &length.to_be_bytes(), &[1], pdu].concat()
}

/// Sends a PDU that is refused with `exception`, and makes sure that the connection goes on.
async fn refused(client: &mut Client, pdu: &[u8], exception: u8) {
    client.send(&frame(0xABCD, pdu)).await;
    assert_eq!(client.reply().await, [0xAB, 0xCD, 0, 0, 0, 3, 1, pdu[0] | 0x80, exception], "{pdu:02X?}");
    client.ask(&who_are_you()).await.expect("answered");
}

#[tokio::test]
async fn a_request_that_comes_byte_by_byte_is_answered() {
    let bench = Bench::start().await;
    let mut client = bench.stranger().await;
    for byte in ID {
        client.send(&[byte]).await;
        // Gives the server the byte before there are more.
        for _ in 0..10 {
            tokio::task::yield_now().await;
        }
    }
    assert_eq!(client.reply().await, ID_REPLY);
}

#[tokio::test]
async fn three_requests_in_one_segment_are_answered_in_their_order() {
    let bench = Bench::start().await;
    let mut client = bench.stranger().await;
    client.send(&[1, 2, 3].map(|transaction| frame(transaction, &ID[7..])).concat()).await;
    for transaction in [1, 2, 3] {
        let reply = client.reply().await;
        assert_eq!((reply[1], &reply[2..]), (transaction, &ID_REPLY[2..]));
    }
}

#[tokio::test]
async fn a_request_and_a_half_and_then_the_other_half_are_two_requests() {
    for cut in 1..ID.len() {
        let bench = Bench::start().await;
        let mut client = bench.stranger().await;
        client.send(&[&ID, &ID[..cut]].concat()).await;
        assert_eq!(client.reply().await, ID_REPLY);
        client.send(&ID[cut..]).await;
        assert_eq!(client.reply().await, ID_REPLY);
    }
}

#[tokio::test]
async fn the_largest_write_over_unlisted_addresses_is_refused_and_changes_nothing() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    let values = [77; 123].into_iter().collect();
    let request = Request::WriteRegisters { address: Reg::MinSpeed.info().address, values };
    assert_eq!(client.ask(&request).await, Err(Exception::IllegalDataAddress));
    assert_eq!(client.words(Reg::MinSpeed, 2).await, Ok(vec![0, 1000]));
}

#[tokio::test]
async fn the_largest_read_over_unlisted_addresses_is_refused() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    let request = Request::ReadWords { table: Table::HoldingRegisters, address: 0x1100, count: 125 };
    assert_eq!(client.ask(&request).await, Err(Exception::IllegalDataAddress));
}

#[tokio::test]
async fn a_quantity_of_126_is_an_illegal_value() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    //                    func  address     count
    refused(&mut client, &[0x03, 0x11, 0x00, 0x00, 0x7E], 3).await;
    refused(&mut client, &[0x04, 0x10, 0x00, 0x00, 0x7E], 3).await;
}

#[tokio::test]
async fn a_quantity_of_0_is_an_illegal_value() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    for function in 1..=4 {
        //                    func      address     count
        refused(&mut client, &[function, 0x11, 0x00, 0x00, 0x00], 3).await;
    }
    //                    func  address     count       bytes
    refused(&mut client, &[0x0F, 0x14, 0x00, 0x00, 0x00, 0x00], 3).await;
    refused(&mut client, &[0x10, 0x11, 0x00, 0x00, 0x00, 0x00], 3).await;
}

#[tokio::test]
async fn an_address_out_of_range_is_an_illegal_address() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    for function in 1..=4 {
        //                    func      address     count
        refused(&mut client, &[function, 0x00, 0x00, 0x00, 0x01], 2).await;
        refused(&mut client, &[function, 0xFF, 0xFF, 0x00, 0x01], 2).await;
        refused(&mut client, &[function, 0xFF, 0xFF, 0x00, 0x02], 2).await;
    }
    //                    func  address     value
    refused(&mut client, &[0x05, 0x14, 0x08, 0xFF, 0x00], 2).await;
    refused(&mut client, &[0x06, 0x11, 0x11, 0x00, 0x00], 2).await;
}

#[tokio::test]
async fn an_unknown_function_is_an_illegal_function() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    refused(&mut client, &[0x2B, 0x0E, 0x01, 0x00], 1).await;
    refused(&mut client, &[0x08, 0x00, 0x00, 0x12, 0x34], 1).await;
    refused(&mut client, &[0x00], 1).await;
    refused(&mut client, &[0x64], 1).await;
}

#[tokio::test]
async fn functions_22_and_23_are_illegal_functions() {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    //                    func  address     and         or
    refused(&mut client, &[0x16, 0x11, 0x00, 0x00, 0xF2, 0x00, 0x25], 1).await;
    //                    func  read        count       write       count       bytes value
    refused(&mut client, &[0x17, 0x11, 0x00, 0x00, 0x01, 0x11, 0x00, 0x00, 0x01, 0x02, 0x00, 0x05], 1).await;
    assert_eq!(client.get(Reg::MinSpeed).await, Ok(0));
}

#[tokio::test]
async fn a_frame_of_protocol_1_is_passed_over_and_the_connection_goes_on() {
    let bench = Bench::start().await;
    let mut client = bench.stranger().await;
    let mut foreign = ID;
    foreign[3] = 1;
    client.send(&[foreign, foreign, ID].concat()).await;
    assert_eq!(client.reply().await, ID_REPLY);
}

#[tokio::test]
async fn a_request_to_another_unit_gets_no_answer_and_the_connection_goes_on() {
    let bench = Bench::start().await;
    let mut client = bench.stranger().await;
    for unit in (2..=254).chain([1]) {
        let mut request = ID;
        request[6] = unit;
        client.send(&request).await;
    }
    assert_eq!(client.reply().await, ID_REPLY);
}

#[tokio::test]
async fn units_1_and_0_and_255_are_answered_each_with_its_own() {
    let bench = Bench::start().await;
    let mut client = bench.stranger().await;
    for unit in [1, 0, 255] {
        client.unit = unit;
        client.ask(&who_are_you()).await.expect("answered");
    }
}
