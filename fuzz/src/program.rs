//! The language of user programs.

use stepdrive_asm::check::CheckOptions;
use stepdrive_asm::{Image, Origin, SourceFile, Style, assemble, disassemble, format, render, report};

/// A text, or an image when the bytes are one: whatever it is, it is looked at without harm; what it comes to is text
/// again that comes to the same words; and laying it out changes neither the words nor a laid out text.
///
/// # Panics
/// When that does not hold.
pub fn program_text(data: &[u8]) {
    if let Ok(image) = Image::from_bytes(data) {
        assert_eq!(Image::from_bytes(&image.to_bytes()).as_ref(), Ok(&image));
        comes_back(&image);
    }
    let Ok(source) = SourceFile::from_bytes("fuzzed", data.to_vec()) else { return };
    let assembly = assemble(&source);
    let mut findings = assembly.diagnostics.clone();
    findings.extend(assembly.check(&CheckOptions::default()));
    assert_eq!(report(&findings, Some(&source)).len(), findings.len());
    assert_eq!(render(&findings, Origin::Text(&source), Style::Plain).is_empty(), findings.is_empty());
    let Some(image) = assembly.image else { return assert!(!findings.is_empty()) };
    comes_back(&image);
    if let Ok(formatted) = format(&source) {
        let laid_out = SourceFile::new("formatted", formatted.clone());
        assert_eq!(assemble(&laid_out).image, Some(image));
        assert_eq!(format(&laid_out), Ok(formatted));
    }
}

/// Words become text that becomes the same words.
fn comes_back(image: &Image) {
    let text = SourceFile::new("disassembled", disassemble(image));
    assert_eq!(assemble(&text).image.as_ref(), Some(image), "{}", text.text());
}
