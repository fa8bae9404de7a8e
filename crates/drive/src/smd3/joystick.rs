//! The joystick, and the step input where an edge starts and stops the motor as a button of it does.

use super::Smd3;
use super::ramp::Course;
use core::time::Duration;
use stepdrive_motion::Direction;
use stepdrive_spec::smd3::commands::{Command, Mode};
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::time::Instant;

/// A press shorter than this is one step (manual).
const BRIEF: Duration = Duration::from_millis(500);

/// ASSUMED: the step of a brief press, in full steps. It is made when the button is let go, since only then it is known
/// to have been brief.
const BRIEF_STEP: i64 = 1;

/// The joystick as the drive knows it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Joystick {
    /// Joystick mode is in effect because a joystick was plugged in.
    auto: bool,
    /// It is to be in effect, or not any more, as soon as the motor is in standby.
    wanted: bool,
    held: Option<Held>,
}

/// A button held down in single step mode.
#[derive(Clone, Copy, Debug)]
struct Held {
    direction: Direction,
    /// When the press becomes a long one; `None` when it is one.
    long_at: Option<Instant>,
}

impl Joystick {
    /// Whether joystick mode is in effect because one was plugged in.
    pub(super) fn auto(self) -> bool {
        self.auto
    }

    /// When a press becomes a long one.
    pub(super) fn next_wake(self) -> Option<Instant> {
        self.held?.long_at
    }

    /// Nothing is held any more, as far as the motor goes.
    pub(super) fn let_go(&mut self) {
        self.held = None;
    }

    /// A mode was chosen: it counts.
    pub(super) fn yield_to_choice(&mut self) {
        *self = Joystick::default();
    }
}

impl Smd3 {
    /// The joystick is plugged in or out. Without it its buttons are not there, so what they started stops.
    pub(super) fn plug_joystick(&mut self, now: Instant, present: bool) {
        self.joystick.wanted = present && self.settings.is_on(Command::Autojs);
        if !present && self.mode() == Mode::Joystick {
            self.joystick.let_go();
            let profile = self.settings.profile();
            self.ramp.stop(now, &profile, false);
        }
    }

    /// Changes into joystick mode or back, once nothing is under way. ASSUMED: bake counts as under way.
    pub(super) fn switch_joystick_mode(&mut self) {
        if self.joystick.auto != self.joystick.wanted && self.standby() && !self.bake {
            self.joystick.auto = self.joystick.wanted;
            self.joystick.let_go();
        }
    }

    /// A button goes down or up. ASSUMED: while one is held the other does nothing.
    pub(super) fn push_button(&mut self, now: Instant, direction: Direction, pressed: bool) {
        let counts = self.mode() == Mode::Joystick && self.present(Signal::Joystick) && self.errors == 0;
        match (counts, self.settings.is_on(Command::Jsmode), pressed) {
            (true, true, true) => self.toggle(now, direction),
            (true, false, true) if self.joystick.held.is_none() => {
                self.joystick.held = Some(Held { direction, long_at: Some(now + BRIEF) });
            }
            (true, false, false) => self.release(now, direction),
            (true, true, false) | (true, false, true) | (false, _, _) => {}
        }
    }

    /// A press has become a long one: off it goes.
    pub(super) fn hold_button(&mut self, now: Instant) {
        if let Some(held) = &mut self.joystick.held {
            held.long_at = None;
            let course = Course::Velocity(held.direction);
            let profile = self.settings.profile();
            self.ramp.follow(now, &profile, course);
        }
    }

    /// An edge of the step input, or a press in continuous mode: runs in a direction, or stops what runs that way.
    pub(super) fn toggle(&mut self, now: Instant, direction: Direction) {
        let course = Course::Velocity(direction);
        let profile = self.settings.profile();
        if self.ramp.course() == Some(course) {
            self.ramp.stop(now, &profile, false);
        } else {
            self.ramp.follow(now, &profile, course);
        }
    }

    fn release(&mut self, now: Instant, direction: Direction) {
        let Some(held) = self.joystick.held.filter(|held| held.direction == direction) else { return };
        self.joystick.let_go();
        let profile = self.settings.profile();
        if held.long_at.is_none() {
            self.ramp.stop(now, &profile, false);
        } else if self.ramp.is_standing() {
            self.ramp.move_by(now, &profile, direction.step(0, BRIEF_STEP));
        }
    }
}
