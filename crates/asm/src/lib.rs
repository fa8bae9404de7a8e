//! The language for the user programs of the SMSD controllers: text to instruction words and back.
//!
//! A program is text ([`SourceFile`]) that [`assemble`] turns into the words of the four memories ([`Image`]).
//! [`disassemble`] goes the other way, for whatever words there are; [`format()`] lays a text out. [`check()`] looks for
//! what is allowed but hardly meant: a `MOVE_F` while the motor turns, a loop that never ends. What is wrong comes as
//! values ([`Diagnostic`]), which [`render()`] turns into text and [`report()`] into JSON.
//!
//! Nothing here reads a file or a clock. No text and no bytes make it panic, and the time it takes grows with their
//! length. Names, operands and ranges are those of `stepdrive_spec::smsd::instructions::INSTRUCTIONS`.
//! The language itself is on one page: `docs/programs.md`.
//!
//! ```
//! use stepdrive_asm::{SourceFile, assemble};
//! let source = SourceFile::new("example.smsd", "SET_MAX_SPEED 100\nEND\n");
//! let image = assemble(&source).image.expect("no errors");
//! assert_eq!(image.area(0), [0x0001_9060, 0]);
//! ```

pub mod check;
pub mod diagnostic;
pub mod image;
pub mod render;
pub mod report;
pub mod source;
pub mod source_map;

mod assemble;
mod disassemble;
mod fields;
mod format;
mod lex;
mod names;
mod operand;
mod parse;
mod value;

pub use assemble::{Assembly, assemble};
pub use check::{CheckOptions, check};
pub use diagnostic::{Code, Diagnostic, Place, Severity};
pub use disassemble::{bare, disassemble};
pub use format::format;
pub use image::{Image, ImageError};
pub use operand::allowed_operand;
pub use render::{Origin, Style, render};
pub use report::{Report, report};
pub use source::{SourceFile, Span};
pub use source_map::SourceMap;
