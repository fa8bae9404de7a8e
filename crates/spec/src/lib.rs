//! The data sheets as data: registers, instructions, commands, inputs, status flags, limits, units, and the
//! vocabulary in which a request reaches a controller and its reply comes back.
//!
//! Every fact stands in one row of one table, with the place in the maker's document it was read from. The codec
//! (`stepdrive-proto`), the controllers (`stepdrive-drive`), the reference pages and whatever speaks to a controller
//! read these tables; adding a register touches one place.
//!
//! Three marks appear in comments and in the notes of the tables:
//!
//! * no mark: the maker's document says so;
//! * a decision: the document is silent or contradicts itself, and we settled it;
//! * **ASSUMED**: nobody knows; a person with the real controller can check it and change it here, in one place.
//!   `docs/assumptions.md` lists them all.
//!
//! This crate is `no_std`, allocates nothing, reads no clock and does no I/O.
#![no_std]

pub mod modbus;
pub mod smd3;
pub mod smsd;
pub mod time;
