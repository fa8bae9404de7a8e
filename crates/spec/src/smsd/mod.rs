//! Smart Motor Devices SMSD-4.2LAN and SMSD-8.0LAN, the firmware with Modbus TCP.
//!
//! Sources in the tables: "ch." and "App." are chapters and appendices of the maker's *Data communications protocol,
//! Modbus TCP/IP version* (31 May 2024); "decision" is our reading where it is silent or contradicts itself.

pub mod inputs;
pub mod instructions;
pub mod mode;
pub mod models;
pub mod powerstep01;
pub mod registers;
pub mod ring;
pub mod standard;
pub mod status;
pub mod timing;
