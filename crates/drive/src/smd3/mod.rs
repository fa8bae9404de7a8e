//! The SMD3.
//!
//! [`Smd3`] is the controller. Its parts have a file each: `commands` what a command does, `settings` what is set and
//! stored, `ramp` the motion, `profile` what shapes it, `homing` the search for a limit switch, `joystick` and `signals`
//! what the connectors do,
//! `flags` status, faults and where the current comes from, `supply` the current, `winding` the temperature, `power` the
//! supply and what is done to the drive from outside, `quantities` what can be looked at.

mod commands;
mod flags;
mod homing;
mod joystick;
mod power;
mod profile;
mod quantities;
mod ramp;
mod settings;
mod signals;
mod supply;
mod winding;

pub use quantities::Quantity;
pub use settings::{DamagedSettings, Settings, SettingsBytes, Stored};
pub use winding::Thermal;

use homing::Homing;
use joystick::Joystick;
use ramp::Ramp;
use stepdrive_motion::Direction;
use stepdrive_spec::smd3::commands::{Command, Mode, Reply, Request};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::{ErrorFlag, FlagBits};
use stepdrive_spec::smd3::signals::{Sensor, Signal};
use stepdrive_spec::smd3::text::Text;
use stepdrive_spec::time::Instant;
use supply::Supply;
use winding::Winding;

/// ASSUMED: what `SER` answers where the rig says nothing else: product number, a hyphen, a number.
const SERIAL: Text = Text::new("20168-001").expect("a text");
/// ASSUMED: what `FW` answers where the rig says nothing else: product number, a dot, the revision.
const FIRMWARE: Text = Text::new("20168.1").expect("a text");

/// What a controller is, apart from what it remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// What `SER` answers.
    pub serial: Text,
    /// What `FW` answers.
    pub firmware: Text,
    /// How the motor warms up.
    pub thermal: Thermal,
}

impl Default for Config {
    fn default() -> Config {
        Config { serial: SERIAL, firmware: FIRMWARE, thermal: Thermal::default() }
    }
}

/// Why a controller wants to be woken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timer {
    /// The motion enters another phase or ends.
    Motion,
    /// The rest after a motion is over.
    Rest,
    /// A button of the joystick has been held for long.
    Joystick,
    /// The winding gets too warm.
    Temperature,
}

/// How the motor's phases are connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phases {
    /// The motor is disabled: nothing drives them.
    Off,
    /// Driven, although the current may be 0.
    Driven,
    /// Standing without current, freewheeling (`F` 1).
    Freewheeling,
    /// Standing without current, short-circuited, which brakes (`F` 2).
    Shorted,
}

/// A controller.
///
/// # How to use one
///
/// Calls carry the time, which must not run backward. What was due by then happens first, at its own instant; a signal
/// that depends on where the rotor is must have gone in before.
///
/// * **In**: [`Smd3::handle`] for a line, [`Smd3::set_signal`], [`Smd3::set_sensor`] and [`Smd3::short_motor`] for what is
///   wired to it.
/// * **Time**: [`Smd3::next_wake`] says when [`Smd3::handle_wake`] wants to be called.
/// * **Out**: when [`Smd3::memory_generation`] has grown, [`Smd3::stored`] is to be stored before the reply is sent, so that
///   what a client has seen survives power-off. Where that fails the reply is [`Error::ActionFailed`] instead.
/// * **Look**: everything else takes `&self` and changes nothing.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "most are faults, each on or off by itself")]
pub struct Smd3 {
    config: Config,
    thermal: Thermal,
    // What is wired to it, and done to it.
    on: bool,
    signals: u16,
    sensor: Sensor,
    motor_short: bool,
    held_at: Option<f64>,
    flash_worn: bool,
    store_damaged: bool,
    /// The last `STORE` ended the damage.
    damage_mended: bool,
    // What it remembers.
    stored: Stored,
    generation: u64,
    settings: Settings,
    // What it does.
    errors: FlagBits,
    ramp: Ramp,
    homing: Option<Homing>,
    joystick: Joystick,
    bake: bool,
    // Current and temperature, which follow from it.
    supply: Supply,
    winding: Winding,
    trip: Option<Instant>,
}

impl Smd3 {
    /// Units of [`Smd3::rotor`] to the full step.
    pub const ROTOR_UNITS: i64 = profile::UNITS;

    /// Switches a controller on at `now`: standing at position 0 with the hold current, the winding at ambient
    /// temperature, the signals at `signals` (a bit each).
    pub fn power_up(now: Instant, config: Config, stored: Stored, signals: u16) -> Smd3 {
        let thermal = config.thermal.sane();
        let mut drive = Smd3 {
            config,
            thermal,
            on: false,
            signals,
            sensor: Sensor::Connected,
            motor_short: false,
            held_at: None,
            flash_worn: false,
            store_damaged: false,
            damage_mended: false,
            stored,
            generation: 0,
            settings: Settings::factory(),
            errors: 0,
            ramp: Ramp::power_up(),
            homing: None,
            joystick: Joystick::default(),
            bake: false,
            supply: Supply::Off,
            winding: Winding::cold(now, &thermal),
            trip: None,
        };
        drive.switch_on(now, signals);
        drive
    }

    /// Answers a line at `now`: a request, `Ok(None)` for an empty line, or the error that the line itself was.
    pub fn handle(&mut self, now: Instant, line: Result<Option<Request>, Error>) -> Reply {
        self.handle_wake(now);
        let outcome = match line {
            Ok(Some(request)) => self.carry_out(now, request),
            Ok(None) => Ok(None),
            Err(error) => Err(error),
        };
        Reply { flags: self.flags(), outcome }
    }

    /// Brings a signal to an input at `now`, or takes it away.
    pub fn set_signal(&mut self, now: Instant, signal: Signal, present: bool) {
        self.handle_wake(now);
        if self.present(signal) != present {
            self.signals ^= signal.bit();
            if self.on {
                self.act_on_signal(now, signal, present);
                self.update(now);
            }
        }
    }

    /// Connects, breaks or short-circuits the temperature sensor at `now`.
    pub fn set_sensor(&mut self, now: Instant, sensor: Sensor) {
        self.handle_wake(now);
        self.sensor = sensor;
        self.update(now);
    }

    /// Short-circuits the motor's phases at `now`, or ends that. It is noticed while a current flows.
    pub fn short_motor(&mut self, now: Instant, shorted: bool) {
        self.handle_wake(now);
        self.motor_short = shorted;
        self.update(now);
    }

    /// When the controller next wants [`Smd3::handle_wake`] called, and why. `None` while nothing will happen by itself.
    pub fn next_wake(&self) -> Option<(Instant, Timer)> {
        let motion = self.ramp.next_wake().map(|at| (at, Timer::Motion));
        let rest = self.ramp.rest_over().map(|at| (at, Timer::Rest));
        let joystick = self.joystick.next_wake().map(|at| (at, Timer::Joystick));
        let temperature = self.trip().map(|at| (at, Timer::Temperature));
        [motion, rest, joystick, temperature].into_iter().flatten().min_by_key(|(at, _)| *at)
    }

    /// Does what was due up to `now`, each thing at its own instant.
    pub fn handle_wake(&mut self, now: Instant) {
        while let Some((at, timer)) = self.next_wake().filter(|(at, _)| *at <= now) {
            let profile = self.settings.profile();
            match timer {
                Timer::Motion => self.ramp.handle_wake(at, &profile),
                Timer::Rest => self.ramp.end_rest(at, &profile),
                Timer::Joystick => self.hold_button(at),
                Timer::Temperature => self.raise(at, ErrorFlag::Tovr.mask()),
            }
            self.update(at);
        }
    }

    /// What the flash is to hold.
    pub fn stored(&self) -> &Stored {
        &self.stored
    }

    /// The last `STORE` could not be written: the flash still holds what it held before.
    pub fn undo_store(&mut self, before: Stored) {
        self.stored = before;
        self.store_damaged |= core::mem::take(&mut self.damage_mended);
    }

    /// Grows with every `STORE`.
    pub fn memory_generation(&self) -> u64 {
        self.generation
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The mode of operation in effect.
    pub fn mode(&self) -> Mode {
        if self.joystick.auto() { Mode::Joystick } else { self.settings.mode() }
    }

    /// The signals at the inputs, a bit each.
    pub fn signals(&self) -> u16 {
        self.signals
    }

    /// `PACT` at `now`, in full steps.
    pub fn position(&self, now: Instant) -> f64 {
        self.ramp.position(now)
    }

    /// `VACT` at `now`, in full steps a second, negative in the negative direction.
    pub fn velocity(&self, now: Instant) -> f64 {
        let speed = self.speed(now);
        match self.direction() {
            Direction::Reverse if speed > 0.0 => -speed,
            Direction::Forward | Direction::Reverse => speed,
        }
    }

    /// The speed at `now` without sign, in full steps a second.
    pub fn speed(&self, now: Instant) -> f64 {
        self.ramp.speed(now)
    }

    /// Where the rotor would be at `now` if nothing held it, in [`Smd3::ROTOR_UNITS`] to the full step, from where it was
    /// at power-up. Between two calls that change the controller or handle a wake-up it goes one way only.
    pub fn rotor(&self, now: Instant) -> i64 {
        self.ramp.rotor(now)
    }

    /// The direction in which the rotor turns now, or turned last.
    pub fn direction(&self) -> Direction {
        self.ramp.direction()
    }

    /// The instant at which the rotor, as it turns now, first reaches or passes `place`; `None` when it will not before
    /// the next wake-up changes its course.
    pub fn when_rotor_reaches(&self, place: i64) -> Option<Instant> {
        self.ramp.when_rotor_reaches(place)
    }

    /// Where the rotor will be when the motion in progress, or the one that waits, ends as it is planned, if nothing holds
    /// it; `None` when there is none, and of a run.
    pub fn destination(&self) -> Option<i64> {
        self.ramp.destination()
    }

    /// The temperature of the winding at `now`, °C, whatever the sensor shows.
    pub fn temperature(&self, now: Instant) -> f64 {
        self.winding.temperature(now)
    }

    /// The current at `now`, in amperes: of each phase in bake, else at its peak.
    pub fn current(&self, now: Instant) -> f64 {
        self.supply.amperes(now, self.winding.temperature(now), &self.thermal)
    }

    /// How the phases are connected at `now`.
    pub fn phases(&self, now: Instant) -> Phases {
        if self.errors != 0 || !self.on {
            return Phases::Off;
        }
        let without_current = !self.ramp.turning() && !self.bake && self.current(now) <= 0.0;
        let freewheel = self.settings.get(Command::F);
        match (without_current, freewheel > 0.5, freewheel > 1.5) {
            (false, _, _) | (true, false, _) => Phases::Driven,
            (true, true, false) => Phases::Freewheeling,
            (true, true, true) => Phases::Shorted,
        }
    }

    /// Whether the motor stands, has rested, and nothing is under way.
    fn standby(&self) -> bool {
        self.ramp.standby() && self.homing.is_none()
    }

    /// Settles what follows from a change: limits, faults, homing, the mode, the current.
    fn update(&mut self, now: Instant) {
        if !self.on {
            return;
        }
        let profile = self.settings.profile();
        self.ramp.set_gate(now, &profile, self.gate());
        self.ramp.set_profile(now, &profile);
        self.latch_errors(now);
        self.advance_homing(now);
        self.switch_joystick_mode();
        self.bake &= self.mode() == Mode::Bake;
        self.supply_motor(now);
    }

    /// Lets the current be what it is to be, and the winding warm up accordingly.
    fn supply_motor(&mut self, now: Instant) {
        let supply = self.supply_due();
        if supply != self.supply {
            self.supply = supply;
            self.drive_winding(now);
        }
    }

    /// Lets the winding's temperature go as the current makes it from `now` on, or stay where it is held.
    fn drive_winding(&mut self, now: Instant) {
        if let Some(temperature) = self.held_at {
            self.winding.hold(now, temperature);
        } else {
            let parts = self.supply.parts(now, self.winding.temperature(now), &self.thermal);
            self.winding.drive(now, parts);
        }
        self.trip = self.winding.when_above(flags::TRIP);
    }
}
