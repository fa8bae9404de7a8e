//! The eight inputs and their bit numbers.

use core::fmt;

/// A signal input of the controller. Its number is its bit in `Inputs`, `Mask` and `Wait`, and its value in
/// `TARGET_INPUT`.
///
/// ASSUMED: the names are the maker's, the numbers are ours; no document found says which input is which bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Input {
    /// `IN0`: general purpose.
    In0 = 0,
    /// `IN1`: general purpose; the mark signal of `SCAN_MARK`.
    In1 = 1,
    /// `SET_ZERO`: the zero signal of `SCAN_ZERO`.
    SetZero = 2,
    /// `SW`: the switch input of the motor chip, seen in `SW_F` and `SW_EVN`.
    Sw = 3,
    /// `EN`: enable, of the step / direction control.
    En = 4,
    /// `STEP`: step, of the step / direction control.
    Step = 5,
    /// `DIR`: direction, of the step / direction control.
    Dir = 6,
    /// `CONTINUE`: synchronises the programs of several controllers.
    Continue = 7,
}

impl Input {
    /// All eight, by number.
    pub const ALL: [Input; 8] = [
        Input::In0,
        Input::In1,
        Input::SetZero,
        Input::Sw,
        Input::En,
        Input::Step,
        Input::Dir,
        Input::Continue,
    ];

    /// The input with this number; `None` above 7.
    pub fn from_number(number: u16) -> Option<Input> {
        Input::ALL.get(usize::from(number)).copied()
    }

    /// The input with this name, as in `SET_ZERO`.
    pub fn from_name(name: &str) -> Option<Input> {
        Input::ALL.into_iter().find(|input| input.name() == name)
    }

    /// 0 to 7.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The input's bit in `Inputs`, `Mask` and `Wait`.
    pub const fn bit(self) -> u8 {
        1 << self.number()
    }

    /// The maker's name.
    pub const fn name(self) -> &'static str {
        match self {
            Input::In0 => "IN0",
            Input::In1 => "IN1",
            Input::SetZero => "SET_ZERO",
            Input::Sw => "SW",
            Input::En => "EN",
            Input::Step => "STEP",
            Input::Dir => "DIR",
            Input::Continue => "CONTINUE",
        }
    }
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_lead_back_to_the_input() {
        for input in Input::ALL {
            assert_eq!(Input::from_number(u16::from(input.number())), Some(input));
            assert_eq!(Input::from_name(input.name()), Some(input));
        }
        assert_eq!(Input::from_number(8), None);
        assert_eq!(Input::from_name("IN2"), None);
    }
}
