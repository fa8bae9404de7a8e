//! What is of the standard protocol only, over USB or TCP.

mod commands;
mod faults;
pub(crate) mod line;
mod login;
mod programs;
mod registers;
mod settings;
