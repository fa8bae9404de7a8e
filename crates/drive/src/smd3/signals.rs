//! The signals at the connectors: limits, step and direction, and who else takes them.

use super::Smd3;
use super::profile::UNITS;
use super::ramp::Gate;
use stepdrive_motion::Direction;
use stepdrive_spec::smd3::commands::{Command, Mode};
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::time::Instant;

impl Smd3 {
    /// Acts on a signal that has changed.
    pub(super) fn act_on_signal(&mut self, now: Instant, signal: Signal, present: bool) {
        match signal {
            Signal::Step => self.act_on_edge(now, present),
            Signal::Joystick => self.plug_joystick(now, present),
            Signal::JoystickCw => self.push_button(now, Direction::Forward, present),
            Signal::JoystickCcw => self.push_button(now, Direction::Reverse, present),
            Signal::ResetFault if present => self.clear_errors(now),
            // Limits and the enable input count by their level.
            Signal::LimitNegative
            | Signal::LimitPositive
            | Signal::Enable
            | Signal::Dir
            | Signal::ResetFault => {}
        }
    }

    /// Whether a signal is present.
    pub(super) fn present(&self, signal: Signal) -> bool {
        self.signals & signal.bit() != 0
    }

    /// Whether the limit input of a direction is active, its polarity taken into account.
    pub(super) fn limit_active(&self, direction: Direction) -> bool {
        let (signal, polarity) = match direction {
            Direction::Forward => (Signal::LimitPositive, Command::LpPlus),
            Direction::Reverse => (Signal::LimitNegative, Command::LpMinus),
        };
        self.present(signal) != self.settings.is_on(polarity)
    }

    /// Whether the limit input of a direction is enabled.
    pub(super) fn limit_used(&self, direction: Direction) -> bool {
        let enable = match direction {
            Direction::Forward => Command::LPlus,
            Direction::Reverse => Command::LMinus,
        };
        self.settings.is_on(Command::L) && self.settings.is_on(enable)
    }

    /// What the limits stop.
    pub(super) fn gate(&self) -> Gate {
        let blocks = |direction| self.limit_used(direction) && self.limit_active(direction);
        Gate {
            forward: blocks(Direction::Forward),
            reverse: blocks(Direction::Reverse),
            soft: self.settings.is_on(Command::Lsm),
        }
    }

    /// An edge of the step input.
    fn act_on_edge(&mut self, now: Instant, rising: bool) {
        if self.errors != 0 || !(rising || self.settings.is_on(Command::Edge)) {
            return;
        }
        let direction = if self.present(Signal::Dir) { Direction::Forward } else { Direction::Reverse };
        match self.mode() {
            Mode::StepDirection => {
                let profile = self.settings.profile();
                self.ramp.step(now, &profile, direction, self.units_per_edge());
            }
            Mode::TriggeredVelocity => self.toggle(now, direction),
            Mode::Remote | Mode::Joystick | Mode::Bake | Mode::Home => {}
        }
    }

    /// What an edge moves: a microstep, or a full step when it is interpolated.
    fn units_per_edge(&self) -> i64 {
        if self.settings.is_on(Command::Interp) {
            return UNITS;
        }
        UNITS.checked_div(i64::from(self.settings.resolution())).unwrap_or(UNITS)
    }
}
