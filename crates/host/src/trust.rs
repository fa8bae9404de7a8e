//! Whether a position can be believed.
//!
//! A stepper motor's controller counts the steps that it has made. That is where the axis stands only if it was told once
//! where zero is, by homing or by hand, and if the rotor has followed ever since. Nothing in either family measures that;
//! so what is known to spoil it is remembered here.
//!
//! | from | by | to |
//! |---|---|---|
//! | the start | | unknown: `not homed` |
//! | any | homing, taking the position as zero | trusted |
//! | any | a doubt that makes it unknown: de-energised, restarted, disabled, reset, stalled, homing failed | unknown |
//! | trusted | a doubt that makes it suspect: stopped dead while turning, stopped by a limit, moved unwatched | suspect |
//! | suspect, unknown | a doubt that makes it suspect | as it was |
//! | suspect | a doubt that makes it unknown | unknown |

use crate::error::Error;
use crate::units::{Decimal, shown};
use std::fmt;

/// How far a position can be believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Trust {
    /// It was set at a known place, and nothing is known that would have spoilt it.
    Trusted,
    /// It was, and something may have spoilt it by some steps.
    Suspect,
    /// It is a number without meaning.
    Unknown,
}

impl Trust {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Trust::Trusted => "trusted",
            Trust::Suspect => "suspect",
            Trust::Unknown => "unknown",
        }
    }
}

impl fmt::Display for Trust {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Why a position is not trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Doubt {
    /// Nobody has set zero yet, that is known here.
    NotHomed,
    /// The controller was switched off and on, or another one is there.
    Restarted,
    /// The motor was de-energised: its rotor can be turned without being counted.
    Freed,
    /// The motor was disabled by an emergency stop or a fault.
    Disabled,
    /// The motor chip was reset: its counter began at zero where the motor stood.
    Reset,
    /// The motor did not follow, as somebody saw.
    Stalled,
    /// Looking for the home switch came to nothing.
    HomingFailed,
    /// The motor was stopped dead out of motion, which may cost steps.
    StoppedDead,
    /// A limit switch stopped the motor, which may cost steps.
    LimitMet,
    /// The position changed, and nobody here had it changed; the controller may have started over meanwhile.
    MovedUnwatched,
}

impl Doubt {
    /// All of them.
    pub const ALL: [Doubt; 10] = [
        Doubt::NotHomed,
        Doubt::Restarted,
        Doubt::Freed,
        Doubt::Disabled,
        Doubt::Reset,
        Doubt::Stalled,
        Doubt::HomingFailed,
        Doubt::StoppedDead,
        Doubt::LimitMet,
        Doubt::MovedUnwatched,
    ];

    /// What becomes of trust.
    pub const fn trust(self) -> Trust {
        match self {
            Doubt::NotHomed
            | Doubt::Restarted
            | Doubt::Freed
            | Doubt::Disabled
            | Doubt::Reset
            | Doubt::Stalled
            | Doubt::HomingFailed => Trust::Unknown,
            Doubt::StoppedDead | Doubt::LimitMet | Doubt::MovedUnwatched => Trust::Suspect,
        }
    }

    /// Its name in records.
    pub const fn name(self) -> &'static str {
        match self {
            Doubt::NotHomed => "not-homed",
            Doubt::Restarted => "restarted",
            Doubt::Freed => "freed",
            Doubt::Disabled => "disabled",
            Doubt::Reset => "reset",
            Doubt::Stalled => "stalled",
            Doubt::HomingFailed => "homing-failed",
            Doubt::StoppedDead => "stopped-dead",
            Doubt::LimitMet => "limit-met",
            Doubt::MovedUnwatched => "moved-unwatched",
        }
    }
}

impl fmt::Display for Doubt {
    /// A clause, as in `the axis has not been homed`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Doubt::NotHomed => "the axis has not been homed",
            Doubt::Restarted => "the controller has started over",
            Doubt::Freed => "the motor was de-energised",
            Doubt::Disabled => "the motor was disabled by an emergency stop or a fault",
            Doubt::Reset => "the motor chip was reset",
            Doubt::Stalled => "the motor has stalled",
            Doubt::HomingFailed => "homing came to nothing",
            Doubt::StoppedDead => "the motor was stopped dead while it turned",
            Doubt::LimitMet => "a limit switch stopped the motor",
            Doubt::MovedUnwatched => "the position changed while nobody watched",
        })
    }
}

/// What a controller shows about what has happened to it since somebody last looked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Continuity {
    /// It has counted all the time.
    Kept,
    /// It has started over.
    Broken,
    /// It may have done either.
    Unclear,
}

/// The trust in one axis' position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrustState {
    doubt: Option<Doubt>,
    /// Where the motor stood when it was last looked at, in full steps; `None` while it turned.
    place: Option<f64>,
}

impl Default for TrustState {
    fn default() -> TrustState {
        TrustState::new()
    }
}

impl TrustState {
    /// Nothing is known.
    pub const fn new() -> TrustState {
        TrustState { doubt: Some(Doubt::NotHomed), place: None }
    }

    /// How far the position can be believed.
    pub fn trust(&self) -> Trust {
        self.doubt.map_or(Trust::Trusted, Doubt::trust)
    }

    /// Why not, if it is not trusted.
    pub const fn doubt(&self) -> Option<Doubt> {
        self.doubt
    }

    /// Where the motor stood when it was last looked at, in full steps.
    pub const fn place(&self) -> Option<f64> {
        self.place
    }

    /// Zero was set, at a place in full steps.
    pub const fn confirm(&mut self, place: f64) {
        *self = TrustState { doubt: None, place: Some(place) };
    }

    /// Something may have spoilt the position. What is worse counts, and of two as bad the later.
    pub fn raise(&mut self, doubt: Doubt) {
        if doubt.trust() >= self.trust() && self.doubt != Some(Doubt::NotHomed) {
            self.doubt = Some(doubt);
        }
    }

    /// The motor was seen standing at a place in full steps, or turning.
    pub const fn saw(&mut self, place: Option<f64>) {
        self.place = place;
    }

    /// What a controller shows after nobody had looked at it for a while.
    pub fn found(&mut self, continuity: Continuity) {
        match continuity {
            Continuity::Kept => {}
            Continuity::Broken => self.raise(Doubt::Restarted),
            Continuity::Unclear => self.raise(Doubt::MovedUnwatched),
        }
    }

    /// Reads what the state displays as, to go on after a restart of the program. What has happened meanwhile is to be
    /// told by [`TrustState::found`].
    ///
    /// # Errors
    /// [`Error::Usage`] when it is not that.
    pub fn parse(text: &str) -> Result<TrustState, Error> {
        let damaged =
            || Error::Usage(format!("`{}` is no record of trust, as in `trusted 12.5`", shown(text)));
        let (name, place) = text.trim().split_once(' ').unwrap_or((text.trim(), ""));
        let known = Doubt::ALL.into_iter().find(|doubt| doubt.name() == name);
        let doubt = if name == Trust::Trusted.name() { None } else { Some(known.ok_or_else(damaged)?) };
        let place = (!place.is_empty()).then(|| Decimal::parse(place).map(Decimal::as_f64));
        let place = place.transpose().map_err(|_| damaged())?;
        Ok(TrustState { doubt, place })
    }
}

impl fmt::Display for TrustState {
    /// `trusted` or the doubt's name, and the place: `limit-met 12.5`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.doubt.map_or(Trust::Trusted.name(), Doubt::name))?;
        match self.place.and_then(Decimal::from_f64) {
            Some(place) => write!(f, " {place}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn after(doubts: &[Doubt]) -> TrustState {
        let mut state = TrustState::new();
        state.confirm(0.0);
        for doubt in doubts {
            state.raise(*doubt);
        }
        state
    }

    #[test]
    fn at_the_start_nothing_is_known() {
        assert_eq!(TrustState::new().trust(), Trust::Unknown);
        assert_eq!(TrustState::new().doubt(), Some(Doubt::NotHomed));
    }

    #[test]
    fn homing_makes_any_state_trusted() {
        for doubt in Doubt::ALL {
            let mut state = after(&[doubt]);
            assert_ne!(state.trust(), Trust::Trusted, "{doubt:?}");
            state.confirm(3.0);
            assert_eq!((state.trust(), state.doubt(), state.place()), (Trust::Trusted, None, Some(3.0)));
        }
    }

    #[test]
    fn every_doubt_makes_a_trusted_position_what_it_says() {
        for doubt in Doubt::ALL {
            let state = after(&[doubt]);
            assert_eq!((state.trust(), state.doubt()), (doubt.trust(), Some(doubt)));
        }
        let suspect = [Doubt::StoppedDead, Doubt::LimitMet, Doubt::MovedUnwatched];
        assert!(Doubt::ALL.iter().all(|doubt| (doubt.trust() == Trust::Suspect) == suspect.contains(doubt)));
    }

    #[test]
    fn a_suspicion_does_not_make_an_unknown_position_any_better() {
        let state = after(&[Doubt::Freed, Doubt::LimitMet]);
        assert_eq!((state.trust(), state.doubt()), (Trust::Unknown, Some(Doubt::Freed)));
        let state = after(&[Doubt::LimitMet, Doubt::Freed]);
        assert_eq!((state.trust(), state.doubt()), (Trust::Unknown, Some(Doubt::Freed)));
    }

    #[test]
    fn of_two_doubts_as_bad_the_later_is_told_but_not_homed_stays_the_reason() {
        assert_eq!(after(&[Doubt::Freed, Doubt::Disabled]).doubt(), Some(Doubt::Disabled));
        let mut state = TrustState::new();
        state.raise(Doubt::Freed);
        assert_eq!(state.doubt(), Some(Doubt::NotHomed));
    }

    #[test]
    fn after_a_while_unwatched_trust_is_what_the_controller_shows() {
        for (continuity, doubt) in [
            (Continuity::Kept, None),
            (Continuity::Broken, Some(Doubt::Restarted)),
            (Continuity::Unclear, Some(Doubt::MovedUnwatched)),
        ] {
            let mut state = after(&[]);
            state.found(continuity);
            assert_eq!(state.doubt(), doubt, "{continuity:?}");
        }
    }

    #[test]
    fn a_record_that_is_none_is_refused() {
        for text in ["", "sure", "trusted x", "trusted 1 2", "unknown 3"] {
            assert!(TrustState::parse(text).is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn a_record_is_read_as_it_was_written(doubt in 0_usize..11, place in proptest::option::of(-8_388_608.0..8_388_607.0)) {
            let mut state = TrustState::new();
            state.confirm(0.0);
            if let Some(doubt) = Doubt::ALL.get(doubt) {
                state.raise(*doubt);
            }
            state.saw(place);
            let read = TrustState::parse(&state.to_string()).expect("a record");
            prop_assert_eq!(read.doubt(), state.doubt());
            let off = read.place().unwrap_or(0.0) - state.place().unwrap_or(0.0);
            prop_assert!(off.abs() < 1e-8);
        }

        #[test]
        fn no_text_panics(text in "\\PC*") {
            let _ = TrustState::parse(&text);
        }
    }
}
