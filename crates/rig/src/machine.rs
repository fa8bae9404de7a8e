//! A controller and what hangs on it, driven as one.

use crate::mechanics::{Mechanics, Switch};
use alloc::vec::Vec;
use stepdrive_drive::controller::{Controller, ROTOR_UNITS, Signal};
use stepdrive_drive::smd3::Smd3;
use stepdrive_drive::smsd::{Session, Smsd};
use stepdrive_spec::modbus::{Exception, Reply, Request};
use stepdrive_spec::smd3::commands as smd3_commands;
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::time::Instant;

/// A controller of either family with its motor, mechanics and switches.
///
/// # How to use one
///
/// Calls carry the time, which must not run backward. `handle` takes a request and [`Machine::set_signal`] a
/// signal; both first bring the machine up to their time. [`Machine::next_wake`] and [`Machine::advance`] let time pass
/// without either. Events, and memory to be stored, are fetched from [`Machine::drive_mut`] after each call.
#[derive(Clone, Debug)]
pub struct Machine<C: Controller> {
    drive: C,
    mechanics: Mechanics,
    switches: Vec<Switch<C::Signal>>,
    /// The signals that come from elsewhere than the switches, a bit each.
    signals: u16,
    /// When something next happens by itself; kept up to date so that a read costs one comparison.
    wake: Option<Instant>,
}

impl Machine<Smsd> {
    /// Answers a request at `now`.
    ///
    /// # Errors
    /// The exception to answer with; see [`Smsd::handle`].
    pub fn handle(
        &mut self,
        now: Instant,
        session: &mut Session,
        request: &Request,
    ) -> Result<Reply, Exception> {
        self.advance(now);
        if matches!(request, Request::ReadBits { .. } | Request::ReadWords { .. }) {
            return self.drive.handle(now, session, request);
        }
        self.mechanics.follow(self.drive.rotor(now));
        let reply = self.drive.handle(now, session, request);
        self.plan_wake(now);
        reply
    }
}

impl Machine<Smd3> {
    /// Answers a line at `now`; see [`Smd3::handle`].
    pub fn handle(
        &mut self,
        now: Instant,
        line: Result<Option<smd3_commands::Request>, Error>,
    ) -> smd3_commands::Reply {
        self.advance(now);
        self.mechanics.follow(self.drive.rotor(now));
        let reply = self.drive.handle(now, line);
        self.plan_wake(now);
        reply
    }
}

impl<C: Controller> Machine<C> {
    /// Switches a machine on: `drive` makes the controller from the signals that the switches give it, a bit each.
    pub fn power_up(
        mechanics: Mechanics,
        switches: Vec<Switch<C::Signal>>,
        drive: impl FnOnce(u16) -> C,
    ) -> Machine<C> {
        let closed = switches.iter().filter(|switch| switch.closed(mechanics.place(0)));
        let signals = closed.fold(0, |bits, switch| bits | switch.input.bit());
        let mut machine = Machine { drive: drive(signals), mechanics, switches, signals: 0, wake: None };
        machine.plan_wake(Instant::ZERO);
        machine
    }

    /// Brings a signal to an input at `now`, or takes it away. The switches on the same input signal besides.
    pub fn set_signal(&mut self, now: Instant, input: C::Signal, present: bool) {
        self.advance(now);
        self.mechanics.follow(self.drive.rotor(now));
        self.signals = if present { self.signals | input.bit() } else { self.signals & !input.bit() };
        let level = self.level(now, input);
        self.drive.set_signal(now, input, level);
        self.plan_wake(now);
    }

    /// When the machine next wants [`Machine::advance`] called; `None` while nothing will happen by itself.
    pub fn next_wake(&self) -> Option<Instant> {
        self.wake
    }

    /// Lets everything happen that is due up to `now`, each thing at its own instant: first the switches that the motion
    /// has come to, then what the controller does, so that a program whose move ends on a switch sees it.
    pub fn advance(&mut self, now: Instant) {
        while let Some(at) = self.wake.filter(|at| *at <= now) {
            self.mechanics.follow(self.drive.rotor(at));
            self.signal_switches(at);
            self.drive.handle_wake(at);
            self.plan_wake(at);
        }
    }

    /// The controller.
    pub fn drive(&self) -> &C {
        &self.drive
    }

    /// The controller, to fetch events and unsaved memory from.
    pub fn drive_mut(&mut self) -> &mut C {
        &mut self.drive
    }

    /// Where the carriage is at `now`, in full steps on its travel.
    pub fn carriage(&self, now: Instant) -> f64 {
        self.mechanics.place(self.drive.rotor(now)) as f64 / ROTOR_UNITS as f64
    }

    /// Whether the rotor is being driven against an end of the travel at `now`.
    pub fn stalled(&self, now: Instant) -> bool {
        self.drive.speed(now) > 0.0 && self.mechanics.stalled(self.drive.rotor(now), self.drive.direction())
    }

    /// Tells the controller the levels of the inputs that switches are wired to.
    fn signal_switches(&mut self, now: Instant) {
        for number in 0..self.switches.len() {
            if let Some(input) = self.switches.get(number).map(|switch| switch.input) {
                let level = self.level(now, input);
                self.drive.set_signal(now, input, level);
            }
        }
    }

    /// Whether a signal is at an input at `now`.
    fn level(&self, now: Instant, input: C::Signal) -> bool {
        let place = self.mechanics.place(self.drive.rotor(now));
        let closed = |switch: &Switch<C::Signal>| switch.input == input && switch.closed(place);
        self.signals & input.bit() != 0 || self.switches.iter().any(closed)
    }

    fn plan_wake(&mut self, now: Instant) {
        let rotor = self.drive.rotor(now);
        let edge = self.mechanics.next_edge(&self.switches, rotor, self.drive.direction());
        let switch = edge.and_then(|place| self.drive.when_rotor_reaches(place));
        self.wake = [self.drive.next_wake(), switch].into_iter().flatten().min();
    }
}
