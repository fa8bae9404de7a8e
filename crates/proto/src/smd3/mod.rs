//! The lines of text that an AML SMD3 is spoken to in, both ends.
//!
//! | | server | client |
//! |---|---|---|
//! | stream to lines | [`LineReader`] | [`split_reply`] |
//! | request | [`decode_line`], [`Line::decode`] | [`encode_request`] |
//! | reply | [`encode_reply`] | [`decode_reply`] |
//!
//! A request is a mnemonic and at most one argument, a reply the two sets of flags and at most one item, each ended by
//! CR LF:
//!
//! ```text
//! host   VMAX,500\r\n                       VMAX\r\n
//! drive  0x0040,0x0000,5.00000E+02\r\n      0x0040,0x0000,-2 (Argument validation)\r\n
//! ```
//!
//! Every line is answered, an empty one with the flags alone.
//!
//! Sources: "manual" is the chapter *USB interface* of the maker's manual, by its own headings; "decision" is our reading
//! where it is silent or contradicts itself.

mod buffer;
mod float;
mod number;
mod reader;
mod reply;
mod request;

pub use buffer::LineBuf;
pub use reader::{Line, LineReader, MAX_LINE};
pub use reply::{ReplyError, decode_reply, encode_reply, split_reply};
pub use request::{decode_line, encode_request};

/// What ends a line that is sent. The manual's "0x07,0x0D" is a slip.
const TERMINATOR: &[u8] = b"\r\n";

/// An item without the spaces and tabs around it, which do not belong to it (manual, *White space*).
fn trim(mut item: &[u8]) -> &[u8] {
    while let [b' ' | b'\t', rest @ ..] | [rest @ .., b' ' | b'\t'] = item {
        item = rest;
    }
    item
}

/// What stands before the first comma, without white space around it, and what stands behind that comma, if there is one.
fn next_item(items: &[u8]) -> (&[u8], Option<&[u8]>) {
    let mut parts = items.splitn(2, |byte| *byte == b',');
    (trim(parts.next().unwrap_or_default()), parts.next())
}
