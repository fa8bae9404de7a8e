//! What both families have in common: the seam between a controller and the world around it.

use crate::smd3::{self as smd3_drive, Smd3, Stored};
use crate::smsd::{self as smsd_drive, Smsd};
use core::fmt::Debug;
use stepdrive_motion::Direction;
use stepdrive_spec::smd3;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::standard::Counter;
use stepdrive_spec::time::Instant;

/// Units of the rotor's place to the full step: the finest microstep of either family.
pub const ROTOR_UNITS: i64 = 256;

/// A controller as the world around it sees it: signals go in, the rotor turns, and time passes.
///
/// Calls carry the time, which must not run backward; wake-ups that are due are handled before anything later goes in.
pub trait Controller {
    /// The signals that it takes.
    type Signal: Signal;

    /// What can be looked at: registers, readable commands, flags, inputs.
    type Quantity: Copy + Eq + Debug;

    /// The names of its outputs. The place of a name is the bit of that output in [`Controller::outputs`].
    const OUTPUTS: &'static [&'static str];

    /// When it next wants [`Controller::handle_wake`] called; `None` while nothing will happen by itself.
    fn next_wake(&self) -> Option<Instant>;

    /// Does what was due up to `now`, each thing at its own instant.
    fn handle_wake(&mut self, now: Instant);

    /// Brings a signal at `now`, or takes it away.
    fn set_signal(&mut self, now: Instant, signal: Self::Signal, present: bool);

    /// Where the rotor would be at `now` if nothing held it, in [`ROTOR_UNITS`] to the full step, from where it was at
    /// power-up. Between two calls that change the controller or handle a wake-up it goes one way only.
    fn rotor(&self, now: Instant) -> i64;

    /// The direction in which the rotor turns now, or turned last.
    fn direction(&self) -> Direction;

    /// The speed of the rotor at `now`, in full steps per second, without sign.
    fn speed(&self, now: Instant) -> f64;

    /// The instant at which the rotor, as it turns now, first reaches or passes `place`; `None` when it will not before
    /// the next wake-up changes its course.
    fn when_rotor_reaches(&self, place: i64) -> Option<Instant>;

    /// Where the rotor will be when the motion in progress ends as it is planned, if nothing holds it; `None` when there is
    /// none, and of a run.
    fn destination(&self) -> Option<i64>;

    /// The rotor has begun to stay behind what it is driven: something holds it. A controller may notice.
    fn note_stall(&mut self) {}

    /// All quantities with their names, which are unique whatever their case, in the order of the makers' tables.
    fn quantities() -> impl Iterator<Item = (&'static str, Self::Quantity)>;

    /// The quantity of this name, in any case. A space of a name may be written as an underscore, as in `MOTOR_SHORT`,
    /// unless that is a name itself.
    fn find_quantity(name: &str) -> Option<Self::Quantity> {
        let spelt = |fits: fn(&str, &str) -> bool| {
            Self::quantities().find(|(known, _)| fits(known, name)).map(|(_, quantity)| quantity)
        };
        spelt(str::eq_ignore_ascii_case).or_else(|| spelt(is_with_underscores))
    }

    /// The value of a quantity at `now`, which may lie between the last call and the next wake-up; flags as 0 and 1.
    /// While the controller is switched off nothing answers, and all that it would have to tell is 0.
    fn look(&self, now: Instant, quantity: Self::Quantity) -> f64;

    /// Whether the value of a quantity may change between two wake-ups. All others change only when the controller is
    /// called or woken.
    fn flows(quantity: Self::Quantity) -> bool;

    /// The levels of its outputs, a bit each in the order of [`Controller::OUTPUTS`].
    fn outputs(&self) -> u8;

    /// The supply goes at `now`: no current flows, the motor stands where it is, and everything volatile is lost. Until
    /// [`Controller::switch_on`] the controller takes part in nothing; what is done to it from outside, as a fault, counts.
    fn switch_off(&mut self, now: Instant);

    /// The supply comes back at `now`, with the signals at `signals` (a bit each): as at power-up, with what non-volatile
    /// memory holds. [`Controller::rotor`] begins at 0 again.
    fn switch_on(&mut self, now: Instant, signals: u16);

    /// Calls `field` with each of the byte strings that make up what survives power-off.
    fn for_each_record(&self, field: &mut dyn FnMut(&[u8]));
}

/// Whether `name` is `known` in any case, with underscores for its spaces.
fn is_with_underscores(known: &str, name: &str) -> bool {
    let letter = |byte: u8| if byte == b' ' { b'_' } else { byte.to_ascii_uppercase() };
    known.bytes().map(letter).eq(name.bytes().map(|byte| byte.to_ascii_uppercase()))
}

/// A signal of a controller.
pub trait Signal: Copy + Eq + 'static {
    /// All signals of the controller, in the order of their bits.
    const ALL: &'static [Self];

    /// Its bit in a set of signals.
    fn bit(self) -> u16;
}

impl Signal for Input {
    const ALL: &'static [Input] = &Input::ALL;

    fn bit(self) -> u16 {
        Input::bit(self).into()
    }
}

impl Signal for smd3::signals::Signal {
    const ALL: &'static [smd3::signals::Signal] = &smd3::signals::Signal::ALL;

    fn bit(self) -> u16 {
        smd3::signals::Signal::bit(self)
    }
}

impl Controller for Smsd {
    type Signal = Input;
    type Quantity = smsd_drive::Quantity;

    const OUTPUTS: &'static [&'static str] = &["relay"];

    fn next_wake(&self) -> Option<Instant> {
        Smsd::next_wake(self).map(|(at, _)| at)
    }

    fn handle_wake(&mut self, now: Instant) {
        Smsd::handle_wake(self, now);
    }

    fn set_signal(&mut self, now: Instant, signal: Input, present: bool) {
        self.set_input(now, signal, present);
    }

    fn rotor(&self, now: Instant) -> i64 {
        Smsd::rotor(self, now)
    }

    fn direction(&self) -> Direction {
        Smsd::direction(self)
    }

    fn speed(&self, now: Instant) -> f64 {
        Smsd::speed(self, now)
    }

    fn when_rotor_reaches(&self, place: i64) -> Option<Instant> {
        Smsd::when_rotor_reaches(self, place)
    }

    fn destination(&self) -> Option<i64> {
        Smsd::destination(self)
    }

    fn note_stall(&mut self) {
        self.count(Counter::StallPowerstep01);
    }

    fn quantities() -> impl Iterator<Item = (&'static str, smsd_drive::Quantity)> {
        smsd_drive::Quantity::all()
    }

    fn look(&self, now: Instant, quantity: smsd_drive::Quantity) -> f64 {
        Smsd::look(self, now, quantity)
    }

    fn flows(quantity: smsd_drive::Quantity) -> bool {
        quantity.flows()
    }

    fn outputs(&self) -> u8 {
        u8::from(self.relay())
    }

    fn switch_off(&mut self, now: Instant) {
        Smsd::switch_off(self, now);
    }

    fn switch_on(&mut self, now: Instant, signals: u16) {
        Smsd::switch_on(self, now, signals.to_le_bytes()[0]);
    }

    fn for_each_record(&self, field: &mut dyn FnMut(&[u8])) {
        for record in smsd_drive::Record::ALL {
            field(&self.memory().encode(record));
        }
    }
}

impl Controller for Smd3 {
    type Signal = smd3::signals::Signal;
    type Quantity = smd3_drive::Quantity;

    const OUTPUTS: &'static [&'static str] = &[];

    fn next_wake(&self) -> Option<Instant> {
        Smd3::next_wake(self).map(|(at, _)| at)
    }

    fn handle_wake(&mut self, now: Instant) {
        Smd3::handle_wake(self, now);
    }

    fn set_signal(&mut self, now: Instant, signal: smd3::signals::Signal, present: bool) {
        Smd3::set_signal(self, now, signal, present);
    }

    fn rotor(&self, now: Instant) -> i64 {
        Smd3::rotor(self, now)
    }

    fn direction(&self) -> Direction {
        Smd3::direction(self)
    }

    fn speed(&self, now: Instant) -> f64 {
        Smd3::speed(self, now)
    }

    fn when_rotor_reaches(&self, place: i64) -> Option<Instant> {
        Smd3::when_rotor_reaches(self, place)
    }

    fn destination(&self) -> Option<i64> {
        Smd3::destination(self)
    }

    fn quantities() -> impl Iterator<Item = (&'static str, smd3_drive::Quantity)> {
        smd3_drive::Quantity::all()
    }

    fn look(&self, now: Instant, quantity: smd3_drive::Quantity) -> f64 {
        Smd3::look(self, now, quantity)
    }

    fn flows(quantity: smd3_drive::Quantity) -> bool {
        quantity.flows()
    }

    fn outputs(&self) -> u8 {
        0
    }

    fn switch_off(&mut self, now: Instant) {
        Smd3::switch_off(self, now);
    }

    fn switch_on(&mut self, now: Instant, signals: u16) {
        Smd3::switch_on(self, now, signals);
    }

    fn for_each_record(&self, field: &mut dyn FnMut(&[u8])) {
        match self.stored() {
            Stored::Nothing => field(&[]),
            Stored::Intact(settings) => field(&settings.encode()),
            // No settings are as short as that.
            Stored::Damaged => field(&[0]),
        }
    }
}
