//! The packets of the SMSD's standard binary protocol, both ends: what it speaks over USB, and with its standard firmware
//! over TCP.
//!
//! | | controller | host |
//! |---|---|---|
//! | stream to packets | [`PacketReader`] | [`PacketReader`] |
//! | request | [`decode_request`] | [`encode_request`] |
//! | reply | [`encode_reply`], [`encode_greeting`] | [`decode_reply`], [`Packet::is_greeting`] |
//!
//! A packet is a header of six bytes and at most 1024 bytes of data. All numbers are little-endian.
//!
//! ```text
//!  0         1         2          3                    4             6 ..= 1029
//! +---------+---------+----------+--------------------+-------------+----------
//! | XOR_SUM |   VER   | CMD_TYPE | CMD_IDENTIFICATION | LENGTH_DATA | DATA
//! +---------+---------+----------+--------------------+-------------+----------
//!                                  echoed by the reply  bytes of DATA
//! ```
//!
//! Over USB a packet stands between a start byte, FA, and a stop byte, FB. Where one of these or the escape byte, FE, is
//! among its bytes, the checksum included, there is FE instead and then the byte with its highest bit the other way. Over
//! TCP packets follow one another as they are. [`Framing`] is which of the two.
//!
//! Sources: "sheet" is the sheet of facts on the standard protocol, by its sections; "decision" is our reading where it is
//! silent.

mod buffer;
mod data;
mod packet;
mod reader;
mod reply;
mod request;
mod stuffing;

pub use buffer::PacketBuf;
pub use packet::{MAX_PACKET, Packet, checksum, encode_packet};
pub use reader::{PacketReader, Taken};
pub use reply::{ReplyError, decode_reply, encode_greeting, encode_reply};
pub use request::{decode_request, encode_request};
pub use stuffing::{ESCAPE, Framing, START, STOP};
