//! The driver of the SMSD over the standard protocol against the virtual controller, over a link in memory that can be made
//! to fail, on virtual time.

mod bench;
mod cancelled;
mod commands;
mod faults;
mod link;
mod login;
mod programs;
mod properties;
mod registers;
mod settings;
