//! User programs of the SMSD.

use stepdrive_asm::{SourceFile, assemble};

/// Far end, half a second, back, half a second, for ever.
pub const SHUTTLE: &str = "
again:
GO_TO 16000
SET_WAIT 500ms
GO_TO 0
SET_WAIT 500ms
GOTO_PROGRAM again
";

/// The words of a program that fits into area 0.
///
/// # Panics
/// When it has an error.
pub fn words(text: &str) -> Vec<u32> {
    let image = assemble(&SourceFile::new("program", text)).image;
    image.expect("a program without errors").area(0).to_vec()
}
