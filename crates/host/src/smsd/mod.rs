//! The drivers of the SMSD-4.2LAN and SMSD-8.0LAN.
//!
//! [`Smsd`] is what they offer. [`SmsdClient`] is a controller's host over Modbus TCP. It connects when something is asked of
//! it, logs in by itself on every new connection, and finds out the word order by it. [`SmsdUsbClient`] is one over the
//! standard protocol: USB, or TCP with the standard firmware. What a register, an instruction or an input is stands in
//! [`stepdrive_spec::smsd`]; nothing of it is repeated here.
//!
//! What follows is about Modbus; about the standard protocol see [`SmsdUsbClient`].
//!
//! # What is repeated and what is not
//!
//! Reads, and writes of registers that only hold a value, are repeated when a reply is lost. What acts is not: `CMD`,
//! `MEM_CMD`, `Password_CMD` and the coils that act. When such a reply is lost, the client looks what has become of it, on
//! the same connection if it still answers, so that what it sees is behind what was lost; where that does not settle it,
//! [`Error::Uncertain`](crate::Error::Uncertain) says what was seen. A controller answers in order on each connection, but
//! not across two: a state that had to be read on another connection may be older than what was sent, and the error says so.
//!
//! # Dropping
//!
//! Every method may be dropped at any point. A request that has not begun to go out then never will; the reply to one that
//! did is thrown away when it comes. Nothing else is affected.

mod client;
mod commands;
mod driver;
mod login;
mod modbus;
mod network;
mod options;
mod passwords;
mod program;
mod registers;
mod session;
mod settings;
mod snapshot;
mod trouble;
mod usb;
mod value;

pub use client::SmsdClient;
pub use commands::Way;
pub use driver::{Answer, Progress, Smsd, Step};
pub use network::LanParameters;
pub use options::{SmsdOptions, WordOrder};
pub use registers::Reading;
pub use settings::Identity;
pub use snapshot::{ProgramState, Snapshot, State};
pub use stepdrive_proto::smsd::Framing;
pub use usb::SmsdUsbClient;
