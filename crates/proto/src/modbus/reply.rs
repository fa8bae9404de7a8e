//! Replies: what a server writes and a client reads.

use super::frame::Adu;
use super::request::{Refusal, fields, two_words, unpack_words};
use core::fmt;
use stepdrive_spec::modbus::{Bits, Exception, Reply, Request};

/// Set in the function code of a reply that carries an exception (Application Protocol §4.1).
const EXCEPTION_BIT: u8 = 0x80;
/// Bytes in the PDU of an exception: function code and exception code.
const EXCEPTION_LEN: usize = 2;
/// Bytes in the PDU of a reply to a write: function code, address, value or quantity.
const WRITTEN_LEN: usize = 5;
/// Most bytes in the PDU of a reply to a read: function code, byte count, 2000 bits or 125 words.
const MOST_READ_LEN: usize = 252;

/// Writes a whole ADU into `out` with what became of `request`.
///
/// The reply to a read carries the values, that to a write repeats the address and the value or quantity (Application
/// Protocol §6). A reply that does not belong to the request, as bits for words or another number of them, is a
/// failure of the server and sent as [`Exception::ServerDeviceFailure`].
pub fn encode_reply(
    out: &mut Adu,
    transaction: u16,
    unit: u8,
    request: &Request,
    outcome: &Result<Reply, Exception>,
) {
    let function = request.function();
    match outcome {
        Ok(reply) if belongs(reply, request) => {
            out.begin(transaction, unit, function);
            put_reply(out, request, reply);
            out.finish();
        }
        Ok(_) => {
            let exception = Exception::ServerDeviceFailure;
            encode_refusal(out, transaction, unit, Refusal { function, exception });
        }
        Err(exception) => encode_refusal(out, transaction, unit, Refusal { function, exception: *exception }),
    }
}

/// Writes a whole ADU with an exception into `out` (Application Protocol §7).
///
/// The function code of the reply is that of the request with the highest bit set; a request that had it set already
/// keeps it.
pub fn encode_refusal(out: &mut Adu, transaction: u16, unit: u8, refusal: Refusal) {
    out.begin(transaction, unit, refusal.function | EXCEPTION_BIT);
    out.put(&[refusal.exception.code()]);
    out.finish();
}

/// Reads the PDU of the reply to `request`. Whether transaction and unit are those of the request is for the caller to
/// compare. Padding bits behind the last bit asked for are ignored.
///
/// # Errors
/// [`ReplyError::Exception`] when the server refused the request, any other when the bytes are no reply to it.
pub fn decode_reply(pdu: &[u8], request: &Request) -> Result<Reply, ReplyError> {
    let expected = request.function();
    let (found, body) = match pdu {
        [found, body @ ..] => (*found, body),
        [] => return Err(ReplyError::Empty),
    };
    if found == expected | EXCEPTION_BIT {
        return Err(exception(body));
    }
    if found != expected {
        return Err(ReplyError::Function { expected, found });
    }
    match request {
        Request::ReadBits { count, .. } => read_bits(body, *count),
        Request::ReadWords { count, .. } => read_words(body, *count),
        Request::WriteCoil { .. }
        | Request::WriteRegister { .. }
        | Request::WriteCoils { .. }
        | Request::WriteRegisters { .. } => written(body, request),
    }
}

/// Why a client has no values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyError {
    /// The controller's answer: it did not carry out the request.
    Exception(Exception),
    /// There is not even a function code.
    Empty,
    /// The reply, or the exception, is for another function.
    Function {
        /// The function code of the request.
        expected: u8,
        /// The function code of the reply; from 0x80 it is an exception.
        found: u8,
    },
    /// The PDU is too short or too long.
    Length {
        /// Bytes that it must have.
        expected: usize,
        /// Bytes that it has.
        found: usize,
    },
    /// The byte count is not the one for the quantity asked for.
    ByteCount {
        /// The byte count for the quantity.
        expected: usize,
        /// The byte count in the reply.
        found: u8,
    },
    /// The reply to a write repeats another address.
    Address {
        /// The address in the request.
        expected: u16,
        /// The address in the reply.
        found: u16,
    },
    /// The reply to a write repeats another value or quantity.
    Value {
        /// The value or quantity in the request.
        expected: u16,
        /// The value or quantity in the reply.
        found: u16,
    },
}

impl fmt::Display for ReplyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            ReplyError::Exception(exception) => exception.fmt(f),
            ReplyError::Empty => f.write_str("the reply has no function code"),
            ReplyError::Function { expected, found } if found & EXCEPTION_BIT != 0 => {
                let function = found & !EXCEPTION_BIT;
                write!(f, "the reply is an exception to function {function:02X}, not {expected:02X}")
            }
            ReplyError::Function { expected, found } => {
                write!(f, "the reply is to function {found:02X}, not {expected:02X}")
            }
            ReplyError::Length { expected, found } => {
                write!(f, "the reply has {found} bytes of PDU, not {expected}")
            }
            ReplyError::ByteCount { expected, found } => {
                write!(f, "the reply announces {found} bytes of values, not {expected}")
            }
            ReplyError::Address { expected, found } => {
                write!(f, "the reply repeats address 0x{found:04X}, not 0x{expected:04X}")
            }
            ReplyError::Value { expected, found } => {
                write!(f, "the reply repeats the value 0x{found:04X}, not 0x{expected:04X}")
            }
        }
    }
}

impl core::error::Error for ReplyError {}

/// Whether the reply is of the kind and the size that the request asked for.
fn belongs(reply: &Reply, request: &Request) -> bool {
    match (request, reply) {
        (Request::ReadBits { count, .. }, Reply::Bits(bits)) => bits.len() == *count,
        (Request::ReadWords { count, .. }, Reply::Words(words)) => words.len() == usize::from(*count),
        (Request::ReadBits { .. } | Request::ReadWords { .. }, _) => false,
        (_, reply) => matches!(reply, Reply::Written),
    }
}

/// Appends the data of a reply that belongs to its request.
fn put_reply(out: &mut Adu, request: &Request, reply: &Reply) {
    match reply {
        Reply::Bits(bits) => out.put_counted(bits.as_packed()),
        Reply::Words(words) => out.put_counted_words(words),
        Reply::Written => {
            let (address, value) = fields(request);
            out.put_word(address);
            out.put_word(value);
        }
    }
}

fn exception(body: &[u8]) -> ReplyError {
    match body {
        [code] => ReplyError::Exception(Exception::from_code(*code)),
        _ => wrong_length(EXCEPTION_LEN, body),
    }
}

fn read_bits(body: &[u8], count: u16) -> Result<Reply, ReplyError> {
    let packed = counted(body, usize::from(count).div_ceil(8))?;
    let bits = Bits::from_packed(packed, count);
    bits.map(Reply::Bits).ok_or_else(|| wrong_length(MOST_READ_LEN, body))
}

fn read_words(body: &[u8], count: u16) -> Result<Reply, ReplyError> {
    let packed = counted(body, usize::from(count).saturating_mul(2))?;
    let words = unpack_words(packed);
    words.map(Reply::Words).ok_or_else(|| wrong_length(MOST_READ_LEN, body))
}

/// The values behind a byte count that is `expected` and tells the truth.
fn counted(body: &[u8], expected: usize) -> Result<&[u8], ReplyError> {
    let pdu_len = expected.saturating_add(2);
    let [found, packed @ ..] = body else { return Err(wrong_length(pdu_len, body)) };
    if usize::from(*found) != expected {
        return Err(ReplyError::ByteCount { expected, found: *found });
    }
    if packed.len() != expected {
        return Err(wrong_length(pdu_len, body));
    }
    Ok(packed)
}

fn written(body: &[u8], request: &Request) -> Result<Reply, ReplyError> {
    let (address, value) = two_words(body).ok_or_else(|| wrong_length(WRITTEN_LEN, body))?;
    let (sent_address, sent_value) = fields(request);
    if address != sent_address {
        Err(ReplyError::Address { expected: sent_address, found: address })
    } else if value != sent_value {
        Err(ReplyError::Value { expected: sent_value, found: value })
    } else {
        Ok(Reply::Written)
    }
}

/// `expected` bytes of PDU, while there are a function code and `body`.
fn wrong_length(expected: usize, body: &[u8]) -> ReplyError {
    ReplyError::Length { expected, found: body.len().saturating_add(1) }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;
    use stepdrive_spec::modbus::{Table, Words};

    const READ_COILS: Request = Request::ReadBits { table: Table::Coils, address: 0x2000, count: 9 };
    const READ_TWO: Request =
        Request::ReadWords { table: Table::HoldingRegisters, address: 0x1105, count: 2 };
    const SET_COIL: Request = Request::WriteCoil { address: 0x2000, value: true };
    const SET_REGISTER: Request = Request::WriteRegister { address: 0x1101, value: 1000 };

    fn write_coils() -> Request {
        Request::WriteCoils { address: 0x2000, values: [true; 9].into_iter().collect() }
    }

    fn write_registers() -> Request {
        Request::WriteRegisters { address: 0x1105, values: [1, 2, 3].into_iter().collect() }
    }

    fn words(values: &[u16]) -> Reply {
        Reply::Words(values.iter().copied().collect())
    }

    /// The PDU with which a server answers.
    fn answer(request: &Request, outcome: &Result<Reply, Exception>) -> Vec<u8> {
        let mut out = Adu::new();
        encode_reply(&mut out, 0x1234, 7, request, outcome);
        let (header, pdu) = out.split_at(7);
        let length = u8::try_from(pdu.len() + 1).expect("a PDU has at most 253 bytes");
        assert_eq!(header, [0x12, 0x34, 0, 0, 0, length, 7]);
        pdu.to_vec()
    }

    /// The reply is encoded as the PDU, and the PDU means the reply.
    fn same(request: &Request, reply: Reply, pdu: &[u8]) {
        assert_eq!(decode_reply(pdu, request).as_ref(), Ok(&reply));
        assert_eq!(answer(request, &Ok(reply)), pdu);
    }

    #[test]
    fn bits_are_answered_lowest_address_in_the_lowest_bit() {
        let bits = [true, false, true, true, false, false, false, false, true].into_iter().collect();
        //                                    func  bytes data
        same(&READ_COILS, Reply::Bits(bits), &[0x01, 0x02, 0x0D, 0x01]);
        let inputs = Request::ReadBits { table: Table::DiscreteInputs, address: 0x1200, count: 3 };
        let bits = [true; 3].into_iter().collect();
        same(&inputs, Reply::Bits(bits), &[0x02, 0x01, 0x07]);
    }

    #[test]
    fn padding_bits_of_a_reply_are_ignored() {
        let bits = [true; 9].into_iter().collect();
        //                            func  bytes data
        assert_eq!(decode_reply(&[0x01, 0x02, 0xFF, 0xFF], &READ_COILS), Ok(Reply::Bits(bits)));
    }

    #[test]
    fn words_are_answered_high_byte_first() {
        //                                           func  bytes data
        same(&READ_TWO, words(&[0x0102, 0xA0B0]), &[0x03, 0x04, 0x01, 0x02, 0xA0, 0xB0]);
        let inputs = Request::ReadWords { table: Table::InputRegisters, address: 0x1004, count: 1 };
        same(&inputs, words(&[0x7E03]), &[0x04, 0x02, 0x7E, 0x03]);
    }

    #[test]
    fn the_largest_reads_fit() {
        let request = Request::ReadWords { table: Table::InputRegisters, address: 0, count: 125 };
        let pdu = [&[0x04, 250], &[0xAB; 250][..]].concat();
        same(&request, words(&[0xABAB; 125]), &pdu);
        let request = Request::ReadBits { table: Table::Coils, address: 0, count: 2000 };
        let pdu = [&[0x01, 250], &[0xFF; 250][..]].concat();
        same(&request, Reply::Bits([true; 2000].into_iter().collect()), &pdu);
    }

    #[test]
    fn single_writes_are_answered_with_their_echo() {
        //                                    func  address     value
        same(&SET_COIL, Reply::Written, &[0x05, 0x20, 0x00, 0xFF, 0x00]);
        same(&SET_REGISTER, Reply::Written, &[0x06, 0x11, 0x01, 0x03, 0xE8]);
    }

    #[test]
    fn multiple_writes_are_answered_with_address_and_quantity() {
        //                                          func  address     quantity
        same(&write_coils(), Reply::Written, &[0x0F, 0x20, 0x00, 0x00, 0x09]);
        same(&write_registers(), Reply::Written, &[0x10, 0x11, 0x05, 0x00, 0x03]);
    }

    #[test]
    fn exceptions_are_answered_with_the_highest_bit_of_the_function_set() {
        for code in 1..=u8::MAX {
            let exception = Exception::from_code(code);
            for request in [&READ_COILS, &READ_TWO, &SET_COIL, &SET_REGISTER] {
                let pdu = [request.function() | 0x80, code];
                assert_eq!(answer(request, &Err(exception)), pdu);
                assert_eq!(decode_reply(&pdu, request), Err(ReplyError::Exception(exception)));
            }
        }
    }

    #[test]
    fn refusals_of_unknown_functions_are_exceptions_too() {
        for (function, answered) in [(0x00, 0x80), (0x2B, 0xAB), (0x7F, 0xFF), (0x80, 0x80), (0x83, 0x83)] {
            let mut out = Adu::new();
            let refusal = Refusal { function, exception: Exception::IllegalFunction };
            encode_refusal(&mut out, 1, 2, refusal);
            //                transaction protocol    length      unit  func      exception
            assert_eq!(*out, [0x00, 0x01, 0x00, 0x00, 0x00, 0x03, 0x02, answered, 0x01]);
        }
    }

    #[test]
    fn a_reply_that_does_not_belong_to_the_request_is_sent_as_a_server_failure() {
        let bits = |count| Reply::Bits([true].into_iter().cycle().take(count).collect());
        let misfits = [
            (&READ_COILS, words(&[1])),
            (&READ_COILS, bits(8)),
            (&READ_COILS, Reply::Written),
            (&READ_TWO, bits(2)),
            (&READ_TWO, words(&[1])),
            (&READ_TWO, words(&[1, 2, 3])),
            (&SET_COIL, bits(1)),
            (&SET_REGISTER, words(&[1000])),
        ];
        for (request, reply) in misfits {
            assert_eq!(answer(request, &Ok(reply)), [request.function() | 0x80, 4]);
        }
    }

    #[test]
    fn a_buffer_keeps_nothing_of_the_reply_before() {
        let mut out = Adu::new();
        encode_reply(&mut out, 1, 1, &READ_TWO, &Ok(words(&[1, 2])));
        encode_reply(&mut out, 2, 1, &SET_COIL, &Err(Exception::ServerDeviceBusy));
        //                transaction protocol    length      unit  func  exception
        assert_eq!(*out, [0x00, 0x02, 0x00, 0x00, 0x00, 0x03, 0x01, 0x85, 0x06]);
    }

    #[test]
    fn a_reply_or_exception_for_another_function_is_told() {
        let expected = 0x03;
        for found in [0x00, 0x04, 0x10, 0x84, 0xFF] {
            let wrong = Err(ReplyError::Function { expected, found });
            assert_eq!(decode_reply(&[found, 0x02, 0x00, 0x00], &READ_TWO), wrong);
            assert_eq!(decode_reply(&[found], &READ_TWO), wrong);
        }
        assert_eq!(decode_reply(&[], &READ_TWO), Err(ReplyError::Empty));
    }

    #[test]
    fn a_byte_count_for_another_quantity_is_told() {
        let read = |pdu: &[u8], request| decode_reply(pdu, request);
        let wrong = |expected, found| Err(ReplyError::ByteCount { expected, found });
        //             func  bytes data
        assert_eq!(read(&[0x03, 0x02, 0x00, 0x01], &READ_TWO), wrong(4, 2));
        assert_eq!(read(&[0x03, 0x05, 0x00, 0x01, 0x00, 0x02, 0x00], &READ_TWO), wrong(4, 5));
        assert_eq!(read(&[0x01, 0x01, 0xFF], &READ_COILS), wrong(2, 1));
    }

    #[test]
    fn replies_of_another_length_are_told() {
        let length = |pdu: &[u8], request: &Request, expected| {
            let found = pdu.len();
            assert_eq!(decode_reply(pdu, request), Err(ReplyError::Length { expected, found }));
        };
        //         func  bytes data
        length(&[0x03], &READ_TWO, 6);
        length(&[0x03, 0x04, 0x01, 0x02, 0xA0], &READ_TWO, 6);
        length(&[0x03, 0x04, 0x01, 0x02, 0xA0, 0xB0, 0x00], &READ_TWO, 6);
        length(&[0x01, 0x02, 0x0D], &READ_COILS, 4);
        //         func  address     value
        length(&[0x05, 0x20, 0x00, 0xFF], &SET_COIL, 5);
        length(&[0x10, 0x11, 0x05, 0x00, 0x03, 0x00], &write_registers(), 5);
        //         func  exception
        length(&[0x83], &READ_TWO, 2);
        length(&[0x83, 0x02, 0x00], &READ_TWO, 2);
    }

    #[test]
    fn an_echo_that_differs_is_told() {
        let address = ReplyError::Address { expected: 0x2000, found: 0x2001 };
        let value = |expected, found| Err(ReplyError::Value { expected, found });
        //                       func  address     value
        assert_eq!(decode_reply(&[0x05, 0x20, 0x01, 0xFF, 0x00], &SET_COIL), Err(address));
        assert_eq!(decode_reply(&[0x0F, 0x20, 0x01, 0x00, 0x09], &write_coils()), Err(address));
        assert_eq!(decode_reply(&[0x05, 0x20, 0x00, 0x00, 0x00], &SET_COIL), value(0xFF00, 0));
        assert_eq!(decode_reply(&[0x06, 0x11, 0x01, 0x03, 0xE9], &SET_REGISTER), value(1000, 1001));
        assert_eq!(decode_reply(&[0x10, 0x11, 0x05, 0x00, 0x02], &write_registers()), value(3, 2));
    }

    #[test]
    fn more_values_than_modbus_allows_are_refused_even_when_asked_for() {
        let request = Request::ReadWords { table: Table::InputRegisters, address: 0, count: 126 };
        let pdu = [&[0x04, 252], &[0; 252][..]].concat();
        assert_eq!(decode_reply(&pdu, &request), Err(ReplyError::Length { expected: 252, found: 254 }));
        let request = Request::ReadBits { table: Table::Coils, address: 0, count: 2001 };
        let pdu = [&[0x01, 251], &[0; 251][..]].concat();
        assert_eq!(decode_reply(&pdu, &request), Err(ReplyError::Length { expected: 252, found: 253 }));
        assert_eq!(answer(&request, &Ok(Reply::Words(Words::new()))), [0x81, 4]);
    }

    #[test]
    fn errors_say_what_was_found_and_what_was_expected() {
        let told = [
            (ReplyError::Exception(Exception::ServerDeviceBusy), "Modbus exception 06 (server device busy)"),
            (ReplyError::Empty, "the reply has no function code"),
            (
                ReplyError::Function { expected: 3, found: 0x84 },
                "the reply is an exception to function 04, not 03",
            ),
            (ReplyError::Function { expected: 3, found: 0x10 }, "the reply is to function 10, not 03"),
            (ReplyError::Length { expected: 5, found: 6 }, "the reply has 6 bytes of PDU, not 5"),
            (ReplyError::ByteCount { expected: 4, found: 2 }, "the reply announces 2 bytes of values, not 4"),
            (
                ReplyError::Address { expected: 0x2000, found: 1 },
                "the reply repeats address 0x0001, not 0x2000",
            ),
            (
                ReplyError::Value { expected: 0xFF00, found: 0 },
                "the reply repeats the value 0x0000, not 0xFF00",
            ),
        ];
        for (error, text) in told {
            assert_eq!(error.to_string(), text);
        }
    }
}
