//! What is of Modbus only.

mod faults;
pub(crate) mod line;
mod login;
mod programs;
mod registers;
mod settings;
