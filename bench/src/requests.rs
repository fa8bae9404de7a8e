//! Requests as bytes.

use stepdrive_proto::modbus::{Adu, encode_request};
use stepdrive_spec::modbus::{Request, Table};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

/// A request on the wire, for unit 1.
///
/// # Panics
/// When it is not well formed.
pub fn adu(request: &Request) -> Vec<u8> {
    let mut out = Adu::new();
    encode_request(&mut out, 1, 1, request).expect("a well-formed request");
    out.to_vec()
}

/// FC01 and FC02 of `count` bits from `first`, FC03 and FC04 of as many registers.
pub fn read(first: Reg, count: u16) -> Request {
    let (table, address) = (first.info().table, first.info().address);
    match table {
        Table::Coils | Table::DiscreteInputs => Request::ReadBits { table, address, count },
        Table::InputRegisters | Table::HoldingRegisters => Request::ReadWords { table, address, count },
    }
}

/// FC06.
pub fn write(register: Reg, value: u16) -> Request {
    Request::WriteRegister { address: register.info().address, value }
}

/// FC10.
pub fn write_many<const N: usize>(first: Reg, values: [u16; N]) -> Request {
    Request::WriteRegisters { address: first.info().address, values: values.into_iter().collect() }
}

/// Logs in with the password from the factory.
pub fn log_in() -> Request {
    write_many(Reg::PasswordLow32, [0xCDEF, 0x89AB, 0x4567, 0x0123, 0])
}

/// FC06 of `CMD`.
pub fn command(opcode: Opcode) -> Request {
    write(Reg::Cmd, opcode.code().into())
}
