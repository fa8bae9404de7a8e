//! What both families have in common: the seam between a controller and the world around it.

use crate::smd3::Smd3;
use crate::smsd::Smsd;
use stepdrive_motion::Direction;
use stepdrive_spec::smd3;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::time::Instant;

/// Units of the rotor's place to the full step: the finest microstep of either family.
pub const ROTOR_UNITS: i64 = 256;

/// A controller as the world around it sees it: signals go in, the rotor turns, and time passes.
///
/// Calls carry the time, which must not run backward; wake-ups that are due are handled before anything later goes in.
pub trait Controller {
    /// The signals that it takes.
    type Signal: Signal;

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
}

/// A signal of a controller.
pub trait Signal: Copy + Eq {
    /// Its bit in a set of signals.
    fn bit(self) -> u16;
}

impl Signal for Input {
    fn bit(self) -> u16 {
        Input::bit(self).into()
    }
}

impl Signal for smd3::signals::Signal {
    fn bit(self) -> u16 {
        smd3::signals::Signal::bit(self)
    }
}

impl Controller for Smsd {
    type Signal = Input;

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
}

impl Controller for Smd3 {
    type Signal = smd3::signals::Signal;

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
}
