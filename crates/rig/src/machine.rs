//! A controller and what hangs on it, driven as one.

use crate::contacts::{Contacts, SwitchFault};
use crate::mechanics::{Mechanics, Switch, Way};
use crate::pulses::{Pulses, Train};
use alloc::vec::Vec;
use stepdrive_drive::controller::{Controller, ROTOR_UNITS, Signal};
use stepdrive_drive::smd3::Smd3;
use stepdrive_drive::smsd::{Session, Smsd, StandardSession};
use stepdrive_spec::modbus::{Exception, Reply, Request};
use stepdrive_spec::smd3::commands as smd3_commands;
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smsd::standard;
use stepdrive_spec::time::Instant;

/// A controller of either family with its motor, mechanics and switches.
///
/// # How to use one
///
/// Calls carry the time, which must not run backward. `handle` takes a request and [`Machine::set_signal`] a
/// signal; both first bring the machine up to their time. [`Machine::next_wake`] and [`Machine::advance`] let time pass
/// without either. Events, and memory to be stored, are fetched from [`Machine::drive_mut`] after each call.
///
/// # What an input sees
///
/// An input that is forced sees that and nothing else. Else the signal is there while a train of pulses gives it, while
/// [`Machine::set_signal`] brings it, or while one of the input's switches is closed.
#[derive(Clone, Debug)]
pub struct Machine<C: Controller> {
    drive: C,
    powered: bool,
    mechanics: Mechanics,
    switches: Vec<Switch<C::Signal>>,
    contacts: Contacts,
    pulses: Pulses,
    /// The signals that come from elsewhere than the switches, a bit each.
    signals: u16,
    /// The inputs that are forced, and what to, a bit each.
    forced: u16,
    forced_to: u16,
    /// What the controller was last told, a bit each.
    levels: u16,
    /// The rotor is held while it is driven, as far as the mechanics have followed.
    held: bool,
    /// When something next happens by itself; kept up to date so that a read costs one comparison.
    wake: Option<Instant>,
}

impl Machine<Smsd> {
    /// Answers a request at `now`. It must be switched on.
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
        self.change(now, |drive| drive.handle(now, session, request))
    }

    /// Answers a packet of the standard protocol at `now`; see [`Smsd::handle_standard`].
    pub fn handle_standard(
        &mut self,
        now: Instant,
        session: &mut StandardSession,
        request: Result<&standard::Request, standard::Malformed>,
    ) -> Option<standard::Reply> {
        self.change(now, |drive| drive.handle_standard(now, session, request))
    }
}

impl Machine<Smd3> {
    /// Answers a line at `now`; see [`Smd3::handle`]. It must be switched on.
    pub fn handle(
        &mut self,
        now: Instant,
        line: Result<Option<smd3_commands::Request>, Error>,
    ) -> smd3_commands::Reply {
        self.change(now, |drive| drive.handle(now, line))
    }
}

impl<C: Controller> Machine<C> {
    /// Switches a machine on: `drive` makes the controller from the signals that the switches give it, a bit each.
    pub fn power_up(
        mechanics: Mechanics,
        switches: Vec<Switch<C::Signal>>,
        drive: impl FnOnce(u16) -> C,
    ) -> Machine<C> {
        let closed = closed(&switches, mechanics.place(0));
        let mut machine = Machine {
            drive: drive(closed),
            powered: true,
            mechanics,
            switches,
            contacts: Contacts::new(0, closed),
            pulses: Pulses::default(),
            signals: 0,
            forced: 0,
            forced_to: 0,
            levels: closed,
            held: false,
            wake: None,
        };
        machine.plan_wake(Instant::ZERO);
        machine
    }

    /// Chooses how switches bounce that are to: the same seed, the same bounces.
    pub fn set_seed(&mut self, seed: u64) {
        self.contacts.set_seed(seed);
    }

    /// Does something to the controller at `now`: brings it up to its time, and finds out afterwards what comes next.
    pub fn change<R>(&mut self, now: Instant, act: impl FnOnce(&mut C) -> R) -> R {
        self.advance(now);
        self.follow(now);
        let outcome = act(&mut self.drive);
        self.plan_wake(now);
        outcome
    }

    /// Brings a signal to an input at `now`, or takes it away. The switches on the same input signal besides.
    pub fn set_signal(&mut self, now: Instant, input: C::Signal, present: bool) {
        self.rewire(now, |machine| {
            machine.signals = with(machine.signals, input.bit(), present);
        });
    }

    /// Forces an input to a level at `now`, whatever is wired to it; `None` releases it. A train of pulses on it ends.
    pub fn force(&mut self, now: Instant, input: C::Signal, level: Option<bool>) {
        self.rewire(now, |machine| {
            machine.pulses.end(input.bit());
            machine.forced = with(machine.forced, input.bit(), level.is_some());
            machine.forced_to = with(machine.forced_to, input.bit(), level == Some(true));
        });
    }

    /// The level that an input is forced to; `None` when it is not.
    pub fn forced(&self, input: C::Signal) -> Option<bool> {
        (self.forced & input.bit() != 0).then_some(self.forced_to & input.bit() != 0)
    }

    /// Gives pulses to an input from `now` on. They come through even where the input is forced. A train that was there
    /// before ends.
    pub fn pulse(&mut self, now: Instant, input: C::Signal, train: Train) {
        self.rewire(now, |machine| machine.pulses.begin(now, input.bit(), train));
    }

    /// Lets the switches of an input work badly from `now` on, or well again. `false` when the input has none; nothing
    /// has changed then.
    pub fn set_switch_fault(&mut self, now: Instant, input: C::Signal, fault: SwitchFault) -> bool {
        let has_switch = self.switches.iter().any(|switch| switch.input == input);
        if has_switch {
            self.rewire(now, |machine| machine.contacts.set_fault(input.bit(), fault));
        }
        has_switch
    }

    /// Holds the rotor where it is from `now` on, whatever the motor does, or lets it go. The steps meanwhile are lost.
    pub fn block_rotor(&mut self, now: Instant, blocked: bool) {
        self.advance(now);
        self.follow(now);
        self.mechanics.block(blocked);
        self.plan_wake(now);
    }

    /// Takes the supply away at `now`. Until [`Machine::switch_on`] nothing may be asked of the controller.
    pub fn switch_off(&mut self, now: Instant) {
        if self.powered {
            self.change(now, |drive| drive.switch_off(now));
            self.powered = false;
            self.plan_wake(now);
        }
    }

    /// Brings the supply back at `now`. The carriage is where it was left.
    pub fn switch_on(&mut self, now: Instant) {
        self.advance(now);
        if !self.powered {
            self.follow(now);
            self.powered = true;
            self.drive.switch_on(now, self.levels);
            self.mechanics.restart(self.drive.rotor(now));
            self.plan_wake(now);
        }
    }

    /// Whether it has its supply.
    pub fn powered(&self) -> bool {
        self.powered
    }

    /// When the machine next wants [`Machine::advance`] called; `None` while nothing will happen by itself.
    pub fn next_wake(&self) -> Option<Instant> {
        self.wake
    }

    /// Lets everything happen that is due up to `now`, each thing at its own instant: first the signals that the motion
    /// has come to, then what the controller does, so that a program whose move ends on a switch sees it.
    pub fn advance(&mut self, now: Instant) {
        while let Some(at) = self.wake.filter(|at| *at <= now) {
            self.wake_up(at);
        }
    }

    /// The controller.
    pub fn drive(&self) -> &C {
        &self.drive
    }

    /// The controller, to fetch events and unsaved memory from. What changes its course goes by [`Machine::change`].
    pub fn drive_mut(&mut self) -> &mut C {
        &mut self.drive
    }

    /// Where the carriage is at `now`, in full steps on its travel.
    pub fn carriage(&self, now: Instant) -> f64 {
        self.place(now) as f64 / ROTOR_UNITS as f64
    }

    /// Where the carriage will be when the motion at `now` ends as it is planned, in full steps on its travel, or beyond its
    /// end when nothing but that will stop it; `None` when there is no motion, and of a run.
    pub fn destination(&self, now: Instant) -> Option<f64> {
        let left = self.drive.destination().filter(|_| self.powered)?.saturating_sub(self.drive.rotor(now));
        Some(self.place(now).saturating_add(left) as f64 / ROTOR_UNITS as f64)
    }

    /// Whether the rotor is being driven against an end of the travel at `now`, or is held.
    pub fn stalled(&self, now: Instant) -> bool {
        self.drive.speed(now) > 0.0 && self.mechanics.stalled(self.drive.rotor(now), self.drive.direction())
    }

    /// The levels at the inputs, a bit each.
    pub fn levels(&self) -> u16 {
        self.levels
    }

    /// The levels of the outputs, a bit each; see [`Controller::OUTPUTS`].
    pub fn outputs(&self) -> u8 {
        if self.powered { self.drive.outputs() } else { 0 }
    }

    /// The switches along the travel.
    pub fn switches(&self) -> &[Switch<C::Signal>] {
        &self.switches
    }

    /// Changes what is wired to the inputs at `now`, and tells the controller.
    fn rewire(&mut self, now: Instant, act: impl FnOnce(&mut Machine<C>)) {
        self.advance(now);
        self.follow(now);
        act(self);
        self.signal(now);
        self.plan_wake(now);
    }

    /// Takes the carriage along to where the rotor is at `now`, and tells the controller of a stall that has begun: steps
    /// are lost, after the rotor went freely or stood.
    fn follow(&mut self, now: Instant) {
        let way = self.mechanics.follow(self.drive.rotor(now));
        if way == Way::CutShort || (way == Way::Held && !self.held) {
            self.drive.note_stall();
        }
        self.held = match way {
            Way::None => self.held,
            Way::Free => false,
            Way::CutShort | Way::Held => true,
        };
        self.held &= self.drive.speed(now) > 0.0;
    }

    fn wake_up(&mut self, at: Instant) {
        self.follow(at);
        self.pulses.advance(at);
        self.signal(at);
        if self.powered {
            self.drive.handle_wake(at);
        }
        self.plan_wake(at);
    }

    /// Tells the controller the levels that have changed.
    fn signal(&mut self, now: Instant) {
        let contacts = self.contacts.advance(now, closed(&self.switches, self.place(now)));
        let given = contacts | self.signals;
        let levels = (given & !self.forced) | (self.forced_to & self.forced) | self.pulses.levels();
        let changed = core::mem::replace(&mut self.levels, levels) ^ levels;
        if changed == 0 || !self.powered {
            return;
        }
        for signal in C::Signal::ALL.iter().filter(|signal| changed & signal.bit() != 0) {
            self.drive.set_signal(now, *signal, levels & signal.bit() != 0);
        }
    }

    fn place(&self, now: Instant) -> i64 {
        self.mechanics.place(self.drive.rotor(now))
    }

    fn plan_wake(&mut self, now: Instant) {
        let outside = self.contacts.next_wake().into_iter().chain(self.pulses.next_wake()).min();
        self.wake = if self.powered {
            let rotor = self.drive.rotor(now);
            let edge = self.mechanics.next_edge(&self.switches, rotor, self.drive.direction());
            let switch = edge.and_then(|place| self.drive.when_rotor_reaches(place));
            [self.drive.next_wake(), switch, outside].into_iter().flatten().min()
        } else {
            outside
        };
    }
}

/// The inputs whose switches are closed with the carriage at `place`, a bit each.
fn closed<S: Signal>(switches: &[Switch<S>], place: i64) -> u16 {
    let closed = switches.iter().filter(|switch| switch.closed(place));
    closed.fold(0, |bits, switch| bits | switch.input.bit())
}

/// `bits` with one of them set or cleared.
fn with(bits: u16, bit: u16, set: bool) -> u16 {
    if set { bits | bit } else { bits & !bit }
}
