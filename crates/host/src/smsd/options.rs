//! What a client has to know of its controller beforehand.

use crate::wire::Timeouts;
use std::fmt;
use std::time::Duration;
use stepdrive_spec::smsd::registers::Reg;

/// Which half of a 32-bit value stands at the lower address (decision 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WordOrder {
    /// The low word.
    LowFirst,
    /// The high word.
    HighFirst,
}

impl WordOrder {
    /// Both.
    pub const ALL: [WordOrder; 2] = [WordOrder::LowFirst, WordOrder::HighFirst];

    /// As in rig files and targets: `low-first`, `high-first`.
    pub const fn name(self) -> &'static str {
        match self {
            WordOrder::LowFirst => "low-first",
            WordOrder::HighFirst => "high-first",
        }
    }

    /// The order with this name.
    pub fn from_name(name: &str) -> Option<WordOrder> {
        WordOrder::ALL.into_iter().find(|order| order.name() == name)
    }

    pub(super) const fn other(self) -> WordOrder {
        match self {
            WordOrder::LowFirst => WordOrder::HighFirst,
            WordOrder::HighFirst => WordOrder::LowFirst,
        }
    }

    /// The two words of a value as they follow each other.
    pub(super) const fn split(self, value: u32) -> [u16; 2] {
        let [a, b, c, d] = value.to_le_bytes();
        let (low, high) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
        match self {
            WordOrder::LowFirst => [low, high],
            WordOrder::HighFirst => [high, low],
        }
    }

    /// The value of two words that follow each other.
    pub(super) const fn join(self, words: [u16; 2]) -> u32 {
        let [low, high] = match self {
            WordOrder::LowFirst => words,
            WordOrder::HighFirst => [words[1], words[0]],
        };
        (high as u32) << 16 | low as u32
    }
}

impl fmt::Display for WordOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// How to speak to a controller.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct SmsdOptions {
    /// Modbus unit identifier. A controller answers its own, 0 and 255; any other it leaves unanswered.
    pub unit: u8,
    /// Which word of a 32-bit value comes first; `None` finds out from the order in which the password is accepted.
    pub word_order: Option<WordOrder>,
    /// The password, its high half in the upper 32 bits.
    pub password: u64,
    /// To connect, and for each reply.
    pub timeouts: Timeouts,
    /// How often a request that may be repeated is made before its trouble is told. At least 1.
    pub tries: u32,
    /// How long a procedure of `MEM_CMD` may take.
    pub memory_timeout: Duration,
}

impl Default for SmsdOptions {
    /// A controller as it leaves the factory; the word order is found out.
    fn default() -> SmsdOptions {
        SmsdOptions {
            unit: u8::try_from(Reg::LanId.info().default).unwrap_or(1),
            word_order: None,
            password: from_halves(default_of(Reg::PasswordLow32), default_of(Reg::PasswordHigh32)),
            timeouts: Timeouts::default(),
            tries: 3,
            memory_timeout: Duration::from_secs(2),
        }
    }
}

impl fmt::Debug for SmsdOptions {
    /// Everything but the password.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SmsdOptions")
            .field("unit", &self.unit)
            .field("word_order", &self.word_order)
            .field("timeouts", &self.timeouts)
            .field("tries", &self.tries)
            .field("memory_timeout", &self.memory_timeout)
            .finish_non_exhaustive()
    }
}

/// The low and the high half of a password.
pub(super) fn halves(password: u64) -> [u32; 2] {
    let low = u32::try_from(password & u64::from(u32::MAX)).unwrap_or(u32::MAX);
    let high = u32::try_from(password >> 32).unwrap_or(u32::MAX);
    [low, high]
}

fn from_halves(low: u32, high: u32) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

fn default_of(reg: Reg) -> u32 {
    u32::try_from(reg.info().default).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_split_and_joined_in_either_order() {
        for order in WordOrder::ALL {
            assert_eq!(order.join(order.split(0x0123_4567)), 0x0123_4567);
            assert_eq!(WordOrder::from_name(order.name()), Some(order));
        }
        assert_eq!(WordOrder::LowFirst.split(0x0123_4567), [0x4567, 0x0123]);
        assert_eq!(WordOrder::HighFirst.split(0x0123_4567), [0x0123, 0x4567]);
    }

    #[test]
    fn the_default_password_is_the_maker_s_and_is_never_shown() {
        let options = SmsdOptions::default();
        assert_eq!(options.password, 0x0123_4567_89AB_CDEF);
        assert_eq!(halves(options.password), [0x89AB_CDEF, 0x0123_4567]);
        let shown = format!("{options:?}");
        assert!(!shown.contains("password") && !shown.contains(&options.password.to_string()), "{shown}");
    }
}
