//! The inputs, their mask, motion that waits for a signal (ch. 4.4; decisions 15 and 19), and motion by `EN`, `STEP` and
//! `DIR`.

use super::Smsd;
use stepdrive_motion::Direction;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::time::Instant;

/// The levels of the inputs and the mask over them, a bit an input.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inputs {
    levels: u8,
    mask: u8,
}

impl Inputs {
    pub(super) fn power_up(levels: u8) -> Inputs {
        Inputs { levels, mask: u8::try_from(Reg::Mask.info().default).unwrap_or(u8::MAX) }
    }

    /// Sets a level. `true` when the signal has come: it was absent before.
    pub(super) fn set(&mut self, input: Input, level: bool) -> bool {
        let before = self.level(input);
        self.levels = if level { self.levels | input.bit() } else { self.levels & !input.bit() };
        level && !before
    }

    pub(super) fn levels(self) -> u8 {
        self.levels
    }

    pub(super) fn level(self, input: Input) -> bool {
        self.levels & input.bit() != 0
    }

    pub(super) fn mask(self) -> u8 {
        self.mask
    }

    /// `true` when the signal is present and the mask heeds it.
    pub(super) fn signals(self, input: Input) -> bool {
        self.levels & self.mask & input.bit() != 0
    }
}

/// A motion that ends with a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Seek {
    /// The input it waits for.
    pub(super) input: Input,
    /// What happens when the signal comes.
    pub(super) arrival: Arrival,
}

/// What a seeking motion does when its signal comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// `GO_UNTIL`: brake.
    Brake,
    /// `SCAN_ZERO`: stop at once, take the position as zero.
    Zero,
    /// `SCAN_MARK`: stop at once, remember the position.
    Mark,
    /// `SCAN_MARK2`: remember the position, then brake.
    MarkAndBrake,
}

impl Smsd {
    /// Turns in `direction` at `speed` (full steps per second) until the signal comes. When it is there already the
    /// motor does not start.
    pub(super) fn seek(&mut self, now: Instant, seek: Seek, direction: Direction, speed: f64) {
        let there = self.inputs.signals(seek.input);
        if !there {
            self.motor.run(now, direction, speed);
        }
        // Bridges that are shut down end the motion, and then nothing waits for the signal.
        self.seek = Some(seek).filter(|_| there || !self.motor.is_shut_down());
        self.act_on_signal(now);
    }

    /// Sets the mask; an input that it uncovers may signal at once.
    pub(super) fn set_mask(&mut self, now: Instant, mask: u8) {
        self.inputs.mask = mask;
        self.act_on_signal(now);
    }

    /// `Wait` (0x1110): the inputs that something waits for, a bit each.
    pub(super) fn waiting(&self) -> u8 {
        self.seek.map_or(0, |seek| seek.input.bit()) | self.interpreter.waiting()
    }

    /// Sets the level of an input at `now`: `true` when the signal is present.
    pub fn set_input(&mut self, now: Instant, input: Input, level: bool) {
        let came = self.inputs.set(input, level);
        if came && input == Input::Sw {
            self.motor.latch_switch_event();
        }
        if came && input == Input::Step && self.inputs.signals(Input::Step) {
            self.motor.step(now, self.step_direction());
        }
        self.act_on_signal(now);
    }

    /// The direction of a step. ASSUMED: forward with the signal at `DIR`.
    fn step_direction(&self) -> Direction {
        if self.inputs.signals(Input::Dir) { Direction::Forward } else { Direction::Reverse }
    }

    /// Ends the seeking motion if its signal is there, lets `EN` count, and lets the program go on that waited for a
    /// signal.
    pub(super) fn act_on_signal(&mut self, now: Instant) {
        self.end_seek(now);
        self.motor.enable_steps(now, self.inputs.signals(Input::En));
        self.release_program(now);
    }

    fn end_seek(&mut self, now: Instant) {
        let Some(seek) = self.seek.filter(|seek| self.inputs.signals(seek.input)) else { return };
        self.seek = None;
        match seek.arrival {
            Arrival::Brake => self.motor.soft_stop(now),
            Arrival::Zero => {
                self.motor.hard_stop(now);
                self.motor.reset_position(now);
            }
            Arrival::Mark => {
                self.motor.hard_stop(now);
                self.motor.set_mark(now);
            }
            Arrival::MarkAndBrake => {
                self.motor.set_mark(now);
                self.motor.soft_stop(now);
            }
        }
    }
}
