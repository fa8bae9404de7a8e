//! AML SMD3: a drive for stepper motors in vacuum, spoken to in lines of text over USB.
//!
//! Sources in the tables: "manual" is the chapter *USB interface* of the maker's manual, by its own headings; "decision"
//! is our reading where it is silent or contradicts itself.

pub mod commands;
pub mod errors;
pub mod flags;
pub mod signals;
pub mod text;
pub mod units;
