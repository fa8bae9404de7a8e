//! The flags of every reply, and the faults behind the error flags: latched, and the motor is disabled while there is
//! one.

use super::Smd3;
use super::supply::{Bake, Lowering, Supply};
use stepdrive_motion::{Direction, Phase};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smd3::flags::{ErrorFlag, FlagBits, Flags, StatusFlag};
use stepdrive_spec::smd3::signals::{Sensor, Signal};
use stepdrive_spec::time::Instant;

/// Above this the winding is protected, °C (manual, `TOVR`).
pub(super) const TRIP: f64 = 190.0;

/// ASSUMED: what a sensor that is broken, or a short-circuited RTD, is read as, °C. The error flags say what is wrong.
const FAULTY_SENSOR: f64 = 0.0;

impl Smd3 {
    /// Both sets of flags, as they begin every reply.
    pub fn flags(&self) -> Flags {
        let set = |on: bool, flag: StatusFlag| if on { flag.mask() } else { 0 };
        let status = set(self.present(Signal::Joystick), StatusFlag::Jscon)
            | set(self.limit_active(Direction::Reverse), StatusFlag::LimitNegative)
            | set(self.limit_active(Direction::Forward), StatusFlag::LimitPositive)
            | set(self.present(Signal::Enable), StatusFlag::Exten)
            | set(self.settings.is_on(Command::Ident), StatusFlag::Ident)
            | set(self.standby(), StatusFlag::Standby)
            | set(self.bake, StatusFlag::Bake)
            | set(self.ramp.at_speed(), StatusFlag::AtSpeed);
        Flags { status, error: self.errors }
    }

    /// `CLR`, or the reset fault input: clears what is gone. ASSUMED: a configuration error is gone once it has been
    /// reported, since factory defaults are in force.
    pub(super) fn clear_errors(&mut self, now: Instant) {
        self.errors &= self.causes(now);
    }

    /// Latches the faults whose cause is there; the motor is disabled with the first, and then carries no current that
    /// would show a short circuit.
    pub(super) fn latch_errors(&mut self, now: Instant) {
        self.raise(now, self.causes(now));
        if self.motor_short && self.energised(now) {
            self.raise(now, ErrorFlag::MotorShort.mask());
        }
    }

    /// Latches error flags.
    pub(super) fn raise(&mut self, now: Instant, errors: FlagBits) {
        self.errors |= errors;
        if self.errors != 0 {
            self.homing = None;
            self.bake = false;
            self.joystick.let_go();
            let profile = self.settings.profile();
            self.ramp.release(now, &profile);
        }
    }

    /// What `TMOT` shows at `now`, °C. ASSUMED: a short-circuited thermocouple shows the ambient temperature.
    pub(super) fn shown_temperature(&self, now: Instant) -> f64 {
        match (self.sensor, self.has_rtd()) {
            (Sensor::Connected, _) => self.winding.temperature(now),
            (Sensor::Short, false) => self.thermal.ambient_c,
            (Sensor::Short, true) | (Sensor::Open, _) => FAULTY_SENSOR,
        }
    }

    /// When the temperature trips, if it does as things are.
    pub(super) fn trip(&self) -> Option<Instant> {
        let watched = self.on && self.sensor == Sensor::Connected && !ErrorFlag::Tovr.is_in(self.errors);
        self.trip.filter(|_| watched)
    }

    /// Whether a current flows at `now`.
    fn energised(&self, now: Instant) -> bool {
        let temperature = self.winding.temperature(now);
        self.supply_due().amperes(now, temperature, &self.thermal) > 0.0
    }

    /// The faults whose cause is there, but for a short circuit of the motor, which shows only under current.
    fn causes(&self, now: Instant) -> FlagBits {
        let set = |on: bool, flag: ErrorFlag| if on { flag.mask() } else { 0 };
        let disabled = self.settings.is_on(Command::Exten) && !self.present(Signal::Enable);
        set(self.sensor == Sensor::Short && self.has_rtd(), ErrorFlag::Tshort)
            | set(self.sensor == Sensor::Open, ErrorFlag::Topen)
            | set(self.shown_temperature(now) > TRIP, ErrorFlag::Tovr)
            | set(disabled, ErrorFlag::ExternalDisable)
    }

    fn has_rtd(&self) -> bool {
        self.settings.is_on(Command::Tsel)
    }

    /// Where the current comes from, as things are.
    pub(super) fn supply_due(&self) -> Supply {
        let amperes = |setting| self.settings.get(setting);
        if self.errors != 0 || !self.on {
            return Supply::Off;
        }
        if self.bake {
            let sensed = self.sensor == Sensor::Connected;
            return Supply::Bake(Bake { setpoint: amperes(Command::Baket), sensed });
        }
        match self.ramp.phase() {
            Phase::Accelerating | Phase::Decelerating => Supply::Steady(amperes(Command::Ia)),
            Phase::Constant => Supply::Steady(amperes(Command::Ir)),
            Phase::Stopped => self.supply_at_standstill(),
        }
    }

    fn supply_at_standstill(&self) -> Supply {
        let hold = self.settings.get(Command::Ih);
        let Some(still) = self.ramp.standstill() else { return Supply::Steady(hold) };
        let from = if still.from_constant { Command::Ir } else { Command::Ia };
        Supply::Lowering(Lowering {
            since: still.since,
            from: self.settings.get(from),
            hold,
            delay: self.settings.time(Command::Pddel, 1e-3),
            step: self.settings.time(Command::Ihd, 1e-3),
        })
    }
}
