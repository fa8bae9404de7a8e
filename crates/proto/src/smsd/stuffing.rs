//! How packets are told apart on a line, and the bytes that must not occur in one.

/// Begins a packet on USB (sheet §3).
pub const START: u8 = 0xFA;
/// Ends it.
pub const STOP: u8 = 0xFB;
/// Stands before a byte of the packet that would be one of the three.
pub const ESCAPE: u8 = 0xFE;

/// By what such a byte is changed behind [`ESCAPE`].
const FLIPPED: u8 = 0x80;

/// How packets follow one another on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// USB: between start and stop byte, with escapes (sheet §3).
    Stuffed,
    /// TCP of the standard firmware: one behind the other, told apart by their lengths (sheet §3).
    Raw,
}

/// What goes behind [`ESCAPE`] for this byte; `None` when it needs none.
pub(super) const fn escape(byte: u8) -> Option<u8> {
    match byte {
        START | STOP | ESCAPE => Some(byte ^ FLIPPED),
        _ => None,
    }
}

/// The byte for which this one stands behind [`ESCAPE`]; `None` when it does not belong there.
pub(super) const fn unescape(byte: u8) -> Option<u8> {
    match byte ^ FLIPPED {
        original @ (START | STOP | ESCAPE) => Some(original),
        _ => None,
    }
}
