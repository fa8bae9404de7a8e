//! Bytes in and out for both ends of each protocol: what a server needs to read requests and write replies, and what
//! a client needs to write requests and read replies.
//!
//! The values on the other side of the bytes are those of [`stepdrive_spec`]. This crate knows no controller: whether
//! a register exists is not its business. It is `no_std`, allocates nothing, keeps nothing between calls but the start of
//! a line of text or of a packet, reads no clock and does no I/O; whatever bytes a peer sends, it answers with a value and never panics.
#![no_std]
#![cfg_attr(
    not(test),
    deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::as_conversions, clippy::panic)
)]

pub mod modbus;
pub mod smd3;
pub mod smsd;
