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

    /// What a signal there means for the motor and the program, in a sentence.
    pub const fn about(self) -> &'static str {
        match self {
            Input::In0 => {
                "General purpose: a program can wait for it (WAIT_IN0, SET_WAIT_2) or branch by it (GOTO_PROGRAM_IF_IN0), and \
                 GO_UNTIL turns the motor until it signals."
            }
            Input::In1 => {
                "The mark: SCAN_MARK stops the motor at it and remembers the position; a program can also wait for it \
                 (WAIT_IN1, SET_WAIT_2) or branch by it (GOTO_PROGRAM_IF_IN1)."
            }
            Input::SetZero => {
                "The home switch: SCAN_ZERO stops the motor at it and takes the position as zero; a program can also branch by \
                 it (GOTO_PROGRAM_IF_IN_ZERO), and it cuts SET_WAIT_2 short."
            }
            Input::Sw => {
                "The switch input of the motor chip: its level is SW_F, and that it was closed stays in SW_EVN until that is \
                 cleared; GO_UNTIL can turn the motor until it signals."
            }
            Input::En => {
                "Enable of the control by pulses: after STEP_CLOCK pulses at STEP count while this signals."
            }
            Input::Step => {
                "A pulse here turns the motor by one microstep after STEP_CLOCK, while EN signals."
            }
            Input::Dir => {
                "The direction of the control by pulses: after STEP_CLOCK a pulse at STEP turns the motor forward while this \
                 signals, and backward otherwise."
            }
            Input::Continue => {
                "Synchronises the programs of several controllers: a program that has come to WAIT_CONTINUE goes on when this \
                 signals."
            }
        }
    }

    /// Where the maker says so.
    pub const fn source(self) -> &'static str {
        match self {
            Input::In0 => "ch. 4.2 (TARGET_INPUT), App. B, 0x27, 0x2A, 0x3C",
            Input::In1 => "ch. 4.2 (SCAN_MARK), App. B, 0x18, 0x28, 0x2B, 0x3C",
            Input::SetZero => "ch. 4.2 (SCAN_ZERO), App. B, 0x16, 0x3A, 0x3C",
            Input::Sw => "ch. 4.3 (SW_F, SW_EVN)",
            Input::En | Input::Step | Input::Dir => "App. B, 0x34",
            Input::Continue => "App. B, 0x3B",
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

    #[test]
    fn each_input_has_a_sentence_of_its_own() {
        for input in Input::ALL {
            assert!(input.about().ends_with('.') && !input.source().is_empty(), "{input}");
            let alike = Input::ALL.into_iter().filter(|other| other.about() == input.about());
            assert_eq!(alike.count(), 1, "{input}");
        }
    }
}
