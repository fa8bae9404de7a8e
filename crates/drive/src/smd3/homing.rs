//! Looking for a limit switch (decision 31): to the switch at `VMAX`, back off at `VSTART` until it opens, and at
//! `VSTART` onto it again. There is zero.

use super::Smd3;
use super::ramp::Course;
use stepdrive_motion::Direction;
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::time::Instant;

/// A search in progress, by what it waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Homing {
    direction: Direction,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The switch closes.
    Seek,
    /// The motor stands.
    Stop,
    /// After a stop that went past the switch: it closes again on the way back.
    Return,
    /// The switch opens.
    BackOff,
    /// The switch closes, slowly.
    Approach,
}

impl Smd3 {
    /// `RUNH`. A search that is under way gives place to the new one.
    pub(super) fn start_homing(&mut self, now: Instant, direction: Direction) -> Result<(), Error> {
        if !self.limit_used(direction) {
            return Err(Error::ActionFailed);
        }
        self.homing = Some(Homing { direction, stage: Stage::Seek });
        let profile = self.settings.profile();
        self.ramp.follow(now, &profile, Course::Velocity(direction));
        Ok(())
    }

    /// Goes through as many stages as are over by now. The limit stops the motion itself, before this looks.
    pub(super) fn advance_homing(&mut self, now: Instant) {
        while let Some(homing) = self.homing {
            let next = self.next_stage(homing);
            if next == Some(homing.stage) {
                return;
            }
            self.homing = next.map(|stage| Homing { stage, ..homing });
            self.enter_stage(now, homing, next);
        }
    }

    /// The stage that follows, which may be the same; `None` when the search is over, found or given up.
    fn next_stage(&self, homing: Homing) -> Option<Stage> {
        let closed = self.gate().blocks(homing.direction);
        let standing = self.ramp.is_standing();
        match homing.stage {
            Stage::Seek if closed => Some(Stage::Stop),
            Stage::Stop if standing && closed => Some(Stage::BackOff),
            Stage::Stop if standing => Some(Stage::Return),
            Stage::Return if closed => Some(Stage::BackOff),
            Stage::BackOff if !closed => Some(Stage::Approach),
            Stage::Approach if closed => None,
            // Something else has stopped the motor, as the other limit does on the way back.
            Stage::Seek | Stage::Return | Stage::BackOff | Stage::Approach if standing => None,
            Stage::Seek | Stage::Stop | Stage::Return | Stage::BackOff | Stage::Approach => {
                Some(homing.stage)
            }
        }
    }

    fn enter_stage(&mut self, now: Instant, homing: Homing, next: Option<Stage>) {
        let profile = self.settings.profile();
        match next {
            Some(Stage::Return | Stage::BackOff) => {
                self.ramp.crawl(now, &profile, opposite(homing.direction));
            }
            Some(Stage::Approach) => {
                self.ramp.halt(now, &profile);
                self.ramp.crawl(now, &profile, homing.direction);
            }
            None if homing.stage == Stage::Approach => {
                self.ramp.halt(now, &profile);
                if self.gate().blocks(homing.direction) {
                    self.ramp.set_position(now, 0);
                    self.ramp.set_relative(now, 0);
                }
            }
            None | Some(Stage::Seek | Stage::Stop) => {}
        }
    }
}

fn opposite(direction: Direction) -> Direction {
    match direction {
        Direction::Forward => Direction::Reverse,
        Direction::Reverse => Direction::Forward,
    }
}
