//! [`Smsd`](super::Smsd) over the standard binary protocol: the SMSD's USB port, or TCP with its standard firmware.

mod client;
mod commands;
mod driver;
mod login;
mod network;
mod primitives;
mod program;
mod registers;
mod session;
mod settings;
mod shown;
mod table;
mod trouble;

pub use client::SmsdUsbClient;
