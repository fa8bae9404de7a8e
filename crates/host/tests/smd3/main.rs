//! The driver of the SMD3 against the virtual drive, over a line in memory that can be made to fail, on virtual time.

mod cancelled;
mod commands;
mod faults;
mod properties;
mod station;
