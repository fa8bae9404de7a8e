//! Requests: what a server reads and a client writes.

use super::frame::Adu;
use core::fmt;
use stepdrive_spec::modbus::{
    Bits, Exception, MAX_READ_BITS, MAX_READ_WORDS, MAX_WRITE_BITS, MAX_WRITE_WORDS, Request, Table, Words,
};

/// How many addresses each table has; a range must end there (Application Protocol §4.4).
const ADDRESSES: usize = 0x1_0000;
/// Function 05 writes this word for a coil to be set, and 0 for one to be cleared (§6.5).
const COIL_ON: u16 = 0xFF00;

/// A request that is not well formed, and the exception it earns.
///
/// A server answers it with [`encode_refusal`](super::encode_refusal); a client meets it when it tries to encode such
/// a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The function code as it was sent.
    pub function: u8,
    /// Why it is refused.
    pub exception: Exception,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "function {:02X} is refused: {}", self.function, self.exception)
    }
}

impl core::error::Error for Refusal {}

/// Reads a request from a PDU. The functions 01 to 06, 0F and 10 are known (Application Protocol §6.1 to §6.6, §6.11,
/// §6.12).
///
/// # Errors
/// The first of these that applies, in the order of the specification's state diagrams:
/// * [`Exception::IllegalFunction`]: any other function code, also 0, those from 0x80, and none at all (as 0);
/// * [`Exception::IllegalDataValue`]: a PDU too short or too long for its function, a byte count that disagrees with
///   the quantity or the bytes there are, a quantity out of 1 to 2000, 125, 1968, 123 for functions 01 and 02, 03 and
///   04, 0F, 10; a value other than 0000 and FF00 for function 05;
/// * [`Exception::IllegalDataAddress`]: a range that ends past address 0xFFFF.
pub fn decode_request(pdu: &[u8]) -> Result<Request, Refusal> {
    let (function, body) = match pdu {
        [function, body @ ..] => (*function, body),
        [] => (0, pdu),
    };
    let refuse = |exception| Refusal { function, exception };
    let request = parse(function, body).map_err(refuse)?;
    check(&request).map_err(refuse)?;
    Ok(request)
}

/// Writes a whole ADU with the request into `out`.
///
/// # Errors
/// When the request is not well formed: the refusal with which a server would answer it, and `out` is as it was.
/// Besides quantities and ranges that is a table that the function cannot read, as bits of holding registers
/// ([`Exception::IllegalFunction`]).
pub fn encode_request(out: &mut Adu, transaction: u16, unit: u8, request: &Request) -> Result<(), Refusal> {
    let function = request.function();
    check(request).map_err(|exception| Refusal { function, exception })?;
    let (first, second) = fields(request);
    out.begin(transaction, unit, function);
    out.put_word(first);
    out.put_word(second);
    match request {
        Request::WriteCoils { values, .. } => out.put_counted(values.as_packed()),
        Request::WriteRegisters { values, .. } => out.put_counted_words(values),
        Request::ReadBits { .. }
        | Request::ReadWords { .. }
        | Request::WriteCoil { .. }
        | Request::WriteRegister { .. } => {}
    }
    out.finish();
    Ok(())
}

/// The two words that follow the function code in every request, and that the reply to a write repeats: the address,
/// and the value or quantity.
pub(super) fn fields(request: &Request) -> (u16, u16) {
    match request {
        Request::ReadBits { address, count, .. } | Request::ReadWords { address, count, .. } => {
            (*address, *count)
        }
        Request::WriteCoil { address, value } => (*address, if *value { COIL_ON } else { 0 }),
        Request::WriteRegister { address, value } => (*address, *value),
        Request::WriteCoils { address, values } => (*address, values.len()),
        // At most 125, the capacity.
        Request::WriteRegisters { address, values } => {
            (*address, u16::try_from(values.len()).unwrap_or(u16::MAX))
        }
    }
}

/// Two words that make up all of `body`.
pub(super) fn two_words(body: &[u8]) -> Option<(u16, u16)> {
    let &[a, b, c, d] = body else { return None };
    Some((u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d])))
}

/// The words packed in `bytes`; `None` for half a word and for more words than fit.
pub(super) fn unpack_words(bytes: &[u8]) -> Option<Words> {
    let (pairs, []) = bytes.as_chunks() else { return None };
    if pairs.len() > MAX_READ_WORDS {
        return None;
    }
    let mut words = Words::from([0; MAX_READ_WORDS]);
    words.truncate(pairs.len());
    for (word, pair) in words.iter_mut().zip(pairs) {
        *word = u16::from_be_bytes(*pair);
    }
    Some(words)
}

/// Reads the data behind the function code. Quantities and ranges are left to [`check`].
fn parse(function: u8, body: &[u8]) -> Result<Request, Exception> {
    let request = match function {
        0x01 => read_bits(Table::Coils, body),
        0x02 => read_bits(Table::DiscreteInputs, body),
        0x03 => read_words(Table::HoldingRegisters, body),
        0x04 => read_words(Table::InputRegisters, body),
        0x05 => write_coil(body),
        0x06 => two_words(body).map(|(address, value)| Request::WriteRegister { address, value }),
        0x0F => write_coils(body),
        0x10 => write_registers(body),
        _ => return Err(Exception::IllegalFunction),
    };
    request.ok_or(Exception::IllegalDataValue)
}

fn read_bits(table: Table, body: &[u8]) -> Option<Request> {
    let (address, count) = two_words(body)?;
    Some(Request::ReadBits { table, address, count })
}

fn read_words(table: Table, body: &[u8]) -> Option<Request> {
    let (address, count) = two_words(body)?;
    Some(Request::ReadWords { table, address, count })
}

fn write_coil(body: &[u8]) -> Option<Request> {
    match two_words(body)? {
        (address, COIL_ON) => Some(Request::WriteCoil { address, value: true }),
        (address, 0) => Some(Request::WriteCoil { address, value: false }),
        _ => None,
    }
}

fn write_coils(body: &[u8]) -> Option<Request> {
    let (address, quantity, packed) = counted(body)?;
    Some(Request::WriteCoils { address, values: Bits::from_packed(packed, quantity)? })
}

fn write_registers(body: &[u8]) -> Option<Request> {
    let (address, quantity, packed) = counted(body)?;
    let values = unpack_words(packed).filter(|words| words.len() == usize::from(quantity))?;
    Some(Request::WriteRegisters { address, values })
}

/// Address, quantity, and the bytes behind a byte count that tells the truth.
fn counted(body: &[u8]) -> Option<(u16, u16, &[u8])> {
    let (head, [size, packed @ ..]) = body.split_at_checked(4)? else { return None };
    let (address, quantity) = two_words(head)?;
    (packed.len() == usize::from(*size)).then_some((address, quantity, packed))
}

/// Whether a request is well formed: its function can read the table, its quantity is allowed, its range ends within
/// the addresses.
fn check(request: &Request) -> Result<(), Exception> {
    let (address, quantity, most) = match request {
        Request::ReadBits { table, address, count } if table.is_bits() => {
            (*address, usize::from(*count), MAX_READ_BITS)
        }
        Request::ReadWords { table, address, count } if !table.is_bits() => {
            (*address, usize::from(*count), MAX_READ_WORDS)
        }
        Request::ReadBits { .. } | Request::ReadWords { .. } => return Err(Exception::IllegalFunction),
        Request::WriteCoil { .. } | Request::WriteRegister { .. } => return Ok(()),
        Request::WriteCoils { address, values } => (*address, usize::from(values.len()), MAX_WRITE_BITS),
        Request::WriteRegisters { address, values } => (*address, values.len(), MAX_WRITE_WORDS),
    };
    if !(1..=most).contains(&quantity) {
        Err(Exception::IllegalDataValue)
    } else if usize::from(address).saturating_add(quantity) > ADDRESSES {
        Err(Exception::IllegalDataAddress)
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// The PDU means the request, and the request is encoded as that PDU behind a header.
    fn same(pdu: &[u8], request: &Request) {
        assert_eq!(decode_request(pdu).as_ref(), Ok(request), "{pdu:02X?}");
        let mut out = Adu::new();
        assert_eq!(encode_request(&mut out, 0x1234, 7, request), Ok(()));
        let length = u8::try_from(pdu.len() + 1).expect("a PDU has at most 253 bytes");
        assert_eq!(*out, [&[0x12, 0x34, 0, 0, 0, length, 7], pdu].concat());
    }

    fn refused(pdu: &[u8], exception: Exception) {
        let function = pdu.first().copied().unwrap_or(0);
        assert_eq!(decode_request(pdu), Err(Refusal { function, exception }), "{pdu:02X?}");
    }

    fn not_encoded(request: &Request, exception: Exception) {
        let mut out = Adu::new();
        let refusal = Refusal { function: request.function(), exception };
        assert_eq!(encode_request(&mut out, 1, 1, request), Err(refusal));
        assert_eq!(out, Adu::new(), "nothing is written");
    }

    /// A PDU of function 0F or 10.
    fn write_many(function: u8, address: u16, quantity: u16, byte_count: u8, data: &[u8]) -> Vec<u8> {
        [&[function], &address.to_be_bytes()[..], &quantity.to_be_bytes(), &[byte_count], data].concat()
    }

    #[test]
    fn functions_01_and_02_read_bits() {
        //      func  address     count
        same(
            &[0x01, 0x20, 0x00, 0x00, 0x01],
            &Request::ReadBits { table: Table::Coils, address: 0x2000, count: 1 },
        );
        same(
            &[0x02, 0x12, 0x00, 0x07, 0xD0],
            &Request::ReadBits { table: Table::DiscreteInputs, address: 0x1200, count: 2000 },
        );
    }

    #[test]
    fn functions_03_and_04_read_words() {
        //      func  address     count
        same(
            &[0x03, 0x11, 0x00, 0x00, 0x7D],
            &Request::ReadWords { table: Table::HoldingRegisters, address: 0x1100, count: 125 },
        );
        same(
            &[0x04, 0x10, 0x04, 0x00, 0x01],
            &Request::ReadWords { table: Table::InputRegisters, address: 0x1004, count: 1 },
        );
    }

    #[test]
    fn function_05_writes_a_coil_as_ff00_or_0000() {
        //      func  address     value
        same(&[0x05, 0x20, 0x00, 0xFF, 0x00], &Request::WriteCoil { address: 0x2000, value: true });
        same(&[0x05, 0xFF, 0xFF, 0x00, 0x00], &Request::WriteCoil { address: 0xFFFF, value: false });
        refused(&[0x05, 0x20, 0x00, 0x00, 0x01], Exception::IllegalDataValue);
        refused(&[0x05, 0x20, 0x00, 0xFF, 0x01], Exception::IllegalDataValue);
        refused(&[0x05, 0x20, 0x00, 0x00, 0xFF], Exception::IllegalDataValue);
    }

    #[test]
    fn function_06_writes_a_register() {
        //      func  address     value
        same(&[0x06, 0x11, 0x01, 0x03, 0xE8], &Request::WriteRegister { address: 0x1101, value: 1000 });
        same(&[0x06, 0xFF, 0xFF, 0xFF, 0xFF], &Request::WriteRegister { address: 0xFFFF, value: 0xFFFF });
    }

    #[test]
    fn function_0f_writes_coils_lowest_address_in_the_lowest_bit() {
        let values = [true, false, true, true, false, false, false, false, true].into_iter().collect();
        //      func  address     quantity    bytes data
        same(
            &[0x0F, 0x20, 0x00, 0x00, 0x09, 0x02, 0x0D, 0x01],
            &Request::WriteCoils { address: 0x2000, values },
        );
    }

    #[test]
    fn padding_bits_of_function_0f_are_ignored() {
        let values = [true; 3].into_iter().collect();
        //           func  address     quantity    bytes data
        let pdu = [0x0F, 0x20, 0x00, 0x00, 0x03, 0x01, 0xFF];
        assert_eq!(decode_request(&pdu), Ok(Request::WriteCoils { address: 0x2000, values }));
    }

    #[test]
    fn function_10_writes_registers() {
        let values = [0x0102, 0xA0B0].into_iter().collect();
        //      func  address     quantity    bytes data
        same(
            &[0x10, 0x11, 0x05, 0x00, 0x02, 0x04, 0x01, 0x02, 0xA0, 0xB0],
            &Request::WriteRegisters { address: 0x1105, values },
        );
    }

    #[test]
    fn the_largest_writes_are_accepted() {
        let coils = write_many(0x0F, 0, 1968, 246, &[0xFF; 246]);
        same(&coils, &Request::WriteCoils { address: 0, values: [true; 1968].into_iter().collect() });
        let registers = write_many(0x10, 0xFF85, 123, 246, &[0; 246]);
        same(
            &registers,
            &Request::WriteRegisters { address: 0xFF85, values: [0; 123].into_iter().collect() },
        );
    }

    #[test]
    fn every_other_function_code_is_an_illegal_function() {
        for function in (0..=u8::MAX).filter(|code| !matches!(code, 0x01..=0x06 | 0x0F | 0x10)) {
            refused(&[function, 0x10, 0x00, 0x00, 0x01], Exception::IllegalFunction);
            refused(&[function], Exception::IllegalFunction);
        }
        refused(&[], Exception::IllegalFunction);
    }

    #[test]
    fn quantities_of_reads_out_of_range_are_illegal_values() {
        for (function, most) in [(0x01, 2000), (0x02, 2000), (0x03, 125), (0x04, 125)] {
            for quantity in [0, most + 1, 0xFFFF] {
                let [high, low] = u16::to_be_bytes(quantity);
                refused(&[function, 0xFF, 0xFF, high, low], Exception::IllegalDataValue);
            }
        }
    }

    #[test]
    fn quantities_of_writes_out_of_range_are_illegal_values() {
        refused(&write_many(0x0F, 0, 0, 0, &[]), Exception::IllegalDataValue);
        refused(&write_many(0x0F, 0, 1969, 247, &[0; 247]), Exception::IllegalDataValue);
        refused(&write_many(0x0F, 0, 2001, 251, &[0; 251]), Exception::IllegalDataValue);
        for quantity in [0, 124, 126, 127] {
            let size = quantity * 2;
            let data = [0; 254];
            refused(
                &write_many(0x10, 0, quantity.into(), size, &data[..size.into()]),
                Exception::IllegalDataValue,
            );
        }
    }

    #[test]
    fn byte_counts_that_disagree_are_illegal_values() {
        //        func  address     quantity    bytes data
        refused(&[0x0F, 0x20, 0x00, 0x00, 0x09, 0x01, 0x0D], Exception::IllegalDataValue);
        refused(&[0x0F, 0x20, 0x00, 0x00, 0x08, 0x02, 0x0D, 0x01], Exception::IllegalDataValue);
        refused(&[0x0F, 0x20, 0x00, 0x00, 0x09, 0x02, 0x0D], Exception::IllegalDataValue);
        refused(&[0x0F, 0x20, 0x00, 0x00, 0x09, 0x01, 0x0D, 0x01], Exception::IllegalDataValue);
        refused(&[0x10, 0x11, 0x05, 0x00, 0x02, 0x02, 0x01, 0x02], Exception::IllegalDataValue);
        refused(&[0x10, 0x11, 0x05, 0x00, 0x01, 0x04, 0x01, 0x02, 0xA0, 0xB0], Exception::IllegalDataValue);
        refused(&[0x10, 0x11, 0x05, 0x00, 0x01, 0x03, 0x01, 0x02, 0xA0], Exception::IllegalDataValue);
        refused(&[0x10, 0x11, 0x05, 0x00, 0x02, 0x04, 0x01, 0x02], Exception::IllegalDataValue);
        refused(&[0x10, 0x11, 0x05, 0x00, 0x02, 0x02, 0x01, 0x02, 0xA0, 0xB0], Exception::IllegalDataValue);
    }

    #[test]
    fn short_pdus_and_trailing_bytes_are_illegal_values() {
        let coils = write_many(0x0F, 0, 9, 2, &[0, 0]);
        let registers = write_many(0x10, 0, 1, 2, &[0, 0]);
        let fixed = (0x01..=0x06).map(|function| [function, 0x00, 0x00, 0x00, 0x00].to_vec());
        for mut pdu in fixed.chain([coils, registers]) {
            for cut in 1..pdu.len() {
                refused(&pdu[..cut], Exception::IllegalDataValue);
            }
            pdu.push(0);
            refused(&pdu, Exception::IllegalDataValue);
        }
    }

    #[test]
    fn ranges_that_end_past_the_last_address_are_illegal_addresses() {
        for function in 0x01..=0x04 {
            //              func      address     count
            assert!(decode_request(&[function, 0xFF, 0xFE, 0x00, 0x02]).is_ok());
            refused(&[function, 0xFF, 0xFF, 0x00, 0x02], Exception::IllegalDataAddress);
        }
        refused(&write_many(0x0F, 0xFFFF, 2, 1, &[0]), Exception::IllegalDataAddress);
        refused(&write_many(0x10, 0xFFFF, 2, 4, &[0; 4]), Exception::IllegalDataAddress);
    }

    #[test]
    fn requests_that_no_server_would_accept_are_not_encoded() {
        let (value, address) = (Exception::IllegalDataValue, Exception::IllegalDataAddress);
        not_encoded(&Request::ReadBits { table: Table::Coils, address: 0, count: 2001 }, value);
        not_encoded(&Request::ReadWords { table: Table::InputRegisters, address: 0, count: 0 }, value);
        not_encoded(&Request::ReadWords { table: Table::InputRegisters, address: 0xFFFF, count: 2 }, address);
        not_encoded(&Request::WriteCoils { address: 0, values: Bits::EMPTY }, value);
        not_encoded(&Request::WriteCoils { address: 0, values: [true; 2000].into_iter().collect() }, value);
        not_encoded(&Request::WriteRegisters { address: 0, values: Words::from([0; 125]) }, value);
    }

    #[test]
    fn requests_for_a_table_that_the_function_cannot_read_are_not_encoded() {
        let bits = Request::ReadBits { table: Table::HoldingRegisters, address: 0, count: 1 };
        not_encoded(&bits, Exception::IllegalFunction);
        let words = Request::ReadWords { table: Table::Coils, address: 0, count: 1 };
        not_encoded(&words, Exception::IllegalFunction);
    }

    #[test]
    fn a_refusal_says_which_function_and_why() {
        let refusal = Refusal { function: 0x2B, exception: Exception::IllegalFunction };
        assert_eq!(
            std::format!("{refusal}"),
            "function 2B is refused: Modbus exception 01 (illegal function)"
        );
    }
}
