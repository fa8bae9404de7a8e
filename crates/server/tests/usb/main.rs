//! The standard protocol of an SMSD as a client meets it: at the serial port that stands for USB, over TCP, and over the
//! LAN of the standard firmware. The packets are made from the sheet of facts, not by the project's own codec.

mod bad;
mod bench;
mod faults;
mod lan;
mod memory;
mod session;
mod standard;
