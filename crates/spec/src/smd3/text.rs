//! The text that a command such as `SER` is answered with.

use core::fmt;

/// ASSUMED: most characters that the drive answers as a text.
pub const MAX_TEXT: usize = 32;

/// A STRING that can stand in a reply: 1 to [`MAX_TEXT`] characters 0x20 to 0x7E without a comma, and without a space at
/// either end.
///
/// So that a drive can have its own serial number, it holds its characters. A constant is written as
/// `const FW: Text = Text::new("20168.1").expect("short");`.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Text {
    bytes: [u8; MAX_TEXT],
    len: u8,
}

impl Text {
    /// This text, when it can stand in a reply.
    pub const fn new(text: &str) -> Option<Text> {
        let mut rest = text.as_bytes();
        if rest.len() > MAX_TEXT || rest.trim_ascii().len() < rest.len() {
            return None;
        }
        let mut new = Text { bytes: [0; MAX_TEXT], len: 0 };
        while let [byte, tail @ ..] = rest {
            if !matches!(*byte, b' '..=b'~') || *byte == b',' {
                return None;
            }
            new.bytes[new.len as usize] = *byte;
            new.len += 1;
            rest = tail;
        }
        if new.len == 0 { None } else { Some(new) }
    }

    /// Its characters.
    pub fn as_str(&self) -> &str {
        let bytes = self.bytes.get(..usize::from(self.len)).unwrap_or_default();
        // ASCII, as `new` holds.
        core::str::from_utf8(bytes).unwrap_or_default()
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_text_is_what_it_was_made_of() {
        const SERIAL: Text = Text::new("20168-001").expect("short");
        assert_eq!(SERIAL.as_str(), "20168-001");
        assert_eq!(SERIAL.to_string(), "20168-001");
        let longest = "x".repeat(MAX_TEXT);
        assert_eq!(Text::new(&longest).map(|text| text.to_string()), Some(longest));
    }

    #[test]
    fn what_would_not_come_back_as_one_item_is_no_text() {
        for text in ["", " a", "a ", "a,b", "a\tb", "a\r", "\u{7f}", "µ", &"x".repeat(MAX_TEXT + 1)] {
            assert_eq!(Text::new(text), None, "{text:?}");
        }
        assert!(Text::new("1234 abc").is_some());
    }
}
