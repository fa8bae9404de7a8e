//! Modbus TCP, both ends.
//!
//! | | server | client |
//! |---|---|---|
//! | stream to frames | [`split`] | [`split`] |
//! | request | [`decode_request`] | [`encode_request`] |
//! | reply | [`encode_reply`], [`encode_refusal`] | [`decode_reply`] |
//!
//! A frame on the wire, the *ADU*, is an MBAP header of seven bytes and a *PDU*: a function code and its data, at most
//! 253 bytes. All numbers are big-endian.
//!
//! ```text
//!  0           2           4           6     7     8 ..= 259
//! +-----------+-----------+-----------+-----+-----+----------
//! |transaction| protocol  |  length   | unit| func| data
//! +-----------+-----------+-----------+-----+-----+----------
//!               0 = Modbus  counts from unit to the end: 2 to 254
//! ```
//!
//! Sources: *Modbus Messaging on TCP/IP Implementation Guide* V1.0b for the header, *Modbus Application Protocol
//! Specification* V1.1b3 for the PDU; sections are given where they are used.

mod frame;
mod reply;
mod request;

pub use frame::{Adu, Frame, MAX_ADU, Split, split};
pub use reply::{ReplyError, decode_reply, encode_refusal, encode_reply};
pub use request::{Refusal, decode_request, encode_request};
