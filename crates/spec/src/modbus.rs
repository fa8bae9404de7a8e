//! The vocabulary of Modbus: what a client can ask of a controller and what it can be answered.
//!
//! `stepdrive-proto` turns bytes into these values and back; `stepdrive-drive` answers them. Neither knows the other.

use arrayvec::ArrayVec;
use core::fmt;

/// Most registers that one read may ask for (Modbus application protocol V1.1b3, §6.3 and §6.4).
pub const MAX_READ_WORDS: usize = 125;
/// Most registers that one write may carry (§6.12).
pub const MAX_WRITE_WORDS: usize = 123;
/// Most bits that one read may ask for (§6.1 and §6.2).
pub const MAX_READ_BITS: usize = 2000;
/// Most bits that one write may carry (§6.11).
pub const MAX_WRITE_BITS: usize = 1968;

/// The registers of one request or reply, in the order of their addresses.
pub type Words = ArrayVec<u16, MAX_READ_WORDS>;

/// The four address spaces of Modbus. The SMSD keeps them strictly apart (maker's document ch. 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Table {
    /// Bits that can be read and written; function codes 01, 05 and 0F. The maker's tables call them `DO`.
    Coils,
    /// Bits that can only be read; function code 02.
    DiscreteInputs,
    /// Words that can only be read; function code 04.
    InputRegisters,
    /// Words that can be read and written; function codes 03, 06 and 10.
    HoldingRegisters,
}

impl Table {
    /// `true` when the table holds bits and not words.
    pub const fn is_bits(self) -> bool {
        matches!(self, Table::Coils | Table::DiscreteInputs)
    }

    /// The maker's abbreviation: `DO`, `DI`, `IR`, `HR`.
    pub const fn abbreviation(self) -> &'static str {
        match self {
            Table::Coils => "DO",
            Table::DiscreteInputs => "DI",
            Table::InputRegisters => "IR",
            Table::HoldingRegisters => "HR",
        }
    }
}

/// A row of bits, eight to a byte, the lowest address in the lowest bit: the packing of Modbus.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Bits {
    bytes: [u8; MAX_READ_BITS / 8],
    len: u16,
}

impl Bits {
    /// No bits.
    pub const EMPTY: Bits = Bits { bytes: [0; MAX_READ_BITS / 8], len: 0 };

    /// Takes `len` bits from packed `bytes`. `None` when there are too few or too many bytes for `len`, or `len` is
    /// over [`MAX_READ_BITS`]. Padding bits after the last one are ignored, as servers must.
    pub fn from_packed(bytes: &[u8], len: u16) -> Option<Bits> {
        let size = usize::from(len).div_ceil(8);
        if bytes.len() != size {
            return None;
        }
        let mut bits = Bits { len, ..Bits::EMPTY };
        bits.bytes.get_mut(..size)?.copy_from_slice(bytes);
        if !len.is_multiple_of(8)
            && let Some(last) = bits.bytes.get_mut(size.checked_sub(1)?)
        {
            *last &= (1 << (len % 8)) - 1;
        }
        Some(bits)
    }

    /// Appends a bit. Returns `false`, and leaves the row as it was, when [`MAX_READ_BITS`] are there already.
    #[must_use]
    pub fn push(&mut self, value: bool) -> bool {
        let Some(byte) = self.bytes.get_mut(usize::from(self.len) / 8) else { return false };
        *byte |= u8::from(value) << (self.len % 8);
        self.len += 1;
        true
    }

    /// How many bits there are.
    pub const fn len(&self) -> u16 {
        self.len
    }

    /// `true` when there are none.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The bit at `index`, `None` past the end.
    pub fn get(&self, index: u16) -> Option<bool> {
        let byte = self.bytes.get(usize::from(index) / 8).filter(|_| index < self.len)?;
        Some(byte >> (index % 8) & 1 == 1)
    }

    /// The bits in order.
    pub fn iter(&self) -> impl Iterator<Item = bool> + '_ {
        (0..self.len).filter_map(|index| self.get(index))
    }

    /// The packed bytes, padding bits 0.
    pub fn as_packed(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len).div_ceil(8)).unwrap_or(&[])
    }
}

impl FromIterator<bool> for Bits {
    /// Collects up to [`MAX_READ_BITS`] bits; more are dropped.
    fn from_iter<I: IntoIterator<Item = bool>>(values: I) -> Bits {
        let mut bits = Bits::EMPTY;
        for value in values {
            if !bits.push(value) {
                break;
            }
        }
        bits
    }
}

impl fmt::Debug for Bits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter().map(u8::from)).finish()
    }
}

/// What a client asks of a controller.
///
/// A value of this type is well formed as Modbus: quantities are within the limits above and agree with the values.
/// Whether the addresses exist is for the controller to say.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(
    clippy::large_enum_variant,
    reason = "one lives at a time, on the stack; boxing would need an allocator"
)]
pub enum Request {
    /// Function codes 01 (coils) and 02 (discrete inputs): `count` is 1 to 2000.
    ReadBits {
        /// Which of the two tables of bits.
        table: Table,
        /// First address.
        address: u16,
        /// How many bits.
        count: u16,
    },
    /// Function codes 03 (holding registers) and 04 (input registers): `count` is 1 to 125.
    ReadWords {
        /// Which of the two tables of words.
        table: Table,
        /// First address.
        address: u16,
        /// How many registers.
        count: u16,
    },
    /// Function code 05.
    WriteCoil {
        /// Address of the coil.
        address: u16,
        /// `true` for FF00 on the wire.
        value: bool,
    },
    /// Function code 06.
    WriteRegister {
        /// Address of the register.
        address: u16,
        /// Its new value.
        value: u16,
    },
    /// Function code 0F: 1 to 1968 coils.
    WriteCoils {
        /// Address of the first.
        address: u16,
        /// Their new values.
        values: Bits,
    },
    /// Function code 10: 1 to 123 registers.
    WriteRegisters {
        /// Address of the first.
        address: u16,
        /// Their new values.
        values: Words,
    },
}

impl Request {
    /// The function code that carries this request.
    pub const fn function(&self) -> u8 {
        match self {
            Request::ReadBits { table: Table::Coils, .. } => 0x01,
            Request::ReadBits { .. } => 0x02,
            Request::ReadWords { table: Table::HoldingRegisters, .. } => 0x03,
            Request::ReadWords { .. } => 0x04,
            Request::WriteCoil { .. } => 0x05,
            Request::WriteRegister { .. } => 0x06,
            Request::WriteCoils { .. } => 0x0F,
            Request::WriteRegisters { .. } => 0x10,
        }
    }
}

/// What a controller answers to a request it carried out.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(
    clippy::large_enum_variant,
    reason = "one lives at a time, on the stack; boxing would need an allocator"
)]
pub enum Reply {
    /// The bits asked for by [`Request::ReadBits`].
    Bits(Bits),
    /// The registers asked for by [`Request::ReadWords`].
    Words(Words),
    /// A write was carried out.
    Written,
}

/// Why a request was not carried out (Modbus application protocol V1.1b3, §7).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Exception {
    /// 01: the controller does not know the function.
    IllegalFunction,
    /// 02: an address that is not listed, or not open to this client.
    IllegalDataAddress,
    /// 03: a quantity or value that is not allowed.
    IllegalDataValue,
    /// 04: the controller failed, as when its memory cannot be written.
    ServerDeviceFailure,
    /// 06: not now; the motor turns or is energised, or the memory works.
    ServerDeviceBusy,
    /// Any other code, as a client may meet it.
    Other(u8),
}

impl Exception {
    /// The code on the wire.
    pub const fn code(self) -> u8 {
        match self {
            Exception::IllegalFunction => 1,
            Exception::IllegalDataAddress => 2,
            Exception::IllegalDataValue => 3,
            Exception::ServerDeviceFailure => 4,
            Exception::ServerDeviceBusy => 6,
            Exception::Other(code) => code,
        }
    }

    /// The exception with this code on the wire.
    pub const fn from_code(code: u8) -> Exception {
        match code {
            1 => Exception::IllegalFunction,
            2 => Exception::IllegalDataAddress,
            3 => Exception::IllegalDataValue,
            4 => Exception::ServerDeviceFailure,
            6 => Exception::ServerDeviceBusy,
            other => Exception::Other(other),
        }
    }
}

impl fmt::Display for Exception {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self {
            Exception::IllegalFunction => "illegal function",
            Exception::IllegalDataAddress => "illegal data address",
            Exception::IllegalDataValue => "illegal data value",
            Exception::ServerDeviceFailure => "server device failure",
            Exception::ServerDeviceBusy => "server device busy",
            Exception::Other(_) => "unlisted exception",
        };
        write!(f, "Modbus exception {:02X} ({text})", self.code())
    }
}

impl core::error::Error for Exception {}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    #[test]
    fn bits_keep_their_order_and_pack_low_bit_first() {
        let bits: Bits = [true, false, true, true, false, false, false, false, true].into_iter().collect();
        assert_eq!(bits.as_packed(), [0b0000_1101, 0b0000_0001]);
        assert_eq!(bits.len(), 9);
        assert_eq!(bits.get(8), Some(true));
        assert_eq!(bits.get(9), None);
    }

    #[test]
    fn padding_bits_are_dropped_when_taking_packed_bytes() {
        let bits = Bits::from_packed(&[0xFF], 3).expect("one byte holds three bits");
        assert_eq!(bits.as_packed(), [0b111]);
        assert_eq!(bits.iter().collect::<Vec<_>>(), [true; 3]);
    }

    #[test]
    fn packed_bytes_of_another_size_are_refused() {
        assert_eq!(Bits::from_packed(&[0, 0], 8), None);
        assert_eq!(Bits::from_packed(&[], 1), None);
        assert_eq!(Bits::from_packed(&[0; 251], 2001), None);
    }

    #[test]
    fn a_full_row_of_bits_takes_no_more() {
        let mut bits: Bits = core::iter::repeat_n(true, MAX_READ_BITS).collect();
        assert_eq!(usize::from(bits.len()), MAX_READ_BITS);
        assert!(!bits.push(true));
        assert_eq!(usize::from(bits.len()), MAX_READ_BITS);
    }

    #[test]
    fn every_exception_code_survives_the_round_trip() {
        for code in 0..=u8::MAX {
            assert_eq!(Exception::from_code(code).code(), code);
        }
    }
}
