//! Any requests, for the properties of a controller.

use crate::bench::PASSWORD;
use proptest::collection::vec;
use proptest::prelude::*;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Instruction, Operand};
use stepdrive_spec::smsd::standard::{Code, LanParameters, Malformed, Request};

/// A packet: mostly instructions, and all else that a host may send.
pub(crate) fn packet() -> impl Strategy<Value = Result<Request, Malformed>> {
    let command = prop_oneof![6 => word(), 1 => any::<u32>()].prop_map(Request::Command);
    prop_oneof![
        12 => command.prop_map(Ok),
        4 => memory().prop_map(Ok),
        1 => lan().prop_map(|parameters| Ok(Request::SetLan(parameters))),
        3 => prop_oneof![Just(PASSWORD), any::<u64>()].prop_map(|password| Ok(Request::Authorise(password))),
        1 => prop_oneof![4 => Just(PASSWORD), 1 => any::<u64>()].prop_map(|password| Ok(Request::SetPassword(password))),
        2 => prop::sample::select(vec![Request::GetLan, Request::GetErrors, Request::GetVersions]).prop_map(Ok),
        1 => prop::sample::select(vec![
            Malformed::Packet(Code::ErrorXor),
            Malformed::Packet(Code::ErrorLen),
            Malformed::Content(Code::ErrorNoCommand),
        ])
        .prop_map(Err),
    ]
}

/// An instruction, mostly with an operand that it takes.
fn word() -> impl Strategy<Value = u32> {
    let data = prop_oneof![0..9_i32, 15..3000_i32, -3000..0_i32, any::<i32>()];
    (prop::sample::select(&INSTRUCTIONS[..]), data).prop_map(|(info, data)| {
        let operand = match info.operand {
            Operand::Number { min, max, .. } if data > 0 => data.clamp(min.cast_signed(), max.cast_signed()),
            Operand::Mode if data >= 0 => 10_301 + ((data & 7) << 7),
            Operand::None
            | Operand::Number { .. }
            | Operand::Position
            | Operand::Mask
            | Operand::Input
            | Operand::Mode
            | Operand::Jump
            | Operand::Loop => data,
        };
        Instruction::with_position(info.opcode, operand).word()
    })
}

fn memory() -> impl Strategy<Value = Request> {
    let words = prop_oneof![6 => vec(word(), 0..12), 1 => vec(any::<u32>(), 1..3), 1 => vec(word(), 255)];
    prop_oneof![
        (any::<u8>(), words).prop_map(|(area, words)| Request::WriteMemory {
            area: area % 5,
            words: words.into_iter().collect()
        }),
        any::<u8>().prop_map(|area| Request::ReadMemory { area: area % 5 }),
    ]
}

fn lan() -> impl Strategy<Value = LanParameters> {
    let id = prop::option::of(any::<u8>());
    (any::<[u8; 6]>(), any::<[[u8; 4]; 4]>(), any::<u16>(), 0..4_u8, id).prop_map(
        |(mac, [ip, subnet_mask, gateway, dns], port, dhcp, id)| LanParameters {
            mac,
            ip,
            subnet_mask,
            gateway,
            dns,
            port,
            dhcp,
            id,
        },
    )
}
