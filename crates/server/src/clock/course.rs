//! The course of rig time over wall time. Wall time is an argument here, in nanoseconds since the clock was started.

use super::CannotJump;
use stepdrive_rig::file::ClockMode;
use stepdrive_spec::time::Instant;

/// What "lately" is counted in, in nanoseconds of wall time: the present such period and the one before it.
const PERIOD: u64 = 5_000_000_000;

/// How fast rig time passes, in millionths of the speed of wall time: whole factors are exact, for days.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Speed(pub(super) u64);

impl Speed {
    const UNIT: u64 = 1_000_000;
    const PAUSED: Speed = Speed(0);
    const REAL: Speed = Speed(Speed::UNIT);
    /// The factors of a rig file go from 0.01 to 1 000 000.
    const SLOWEST: u64 = Speed::UNIT / 100;
    const FASTEST: u64 = Speed::UNIT * 1_000_000;

    fn of(mode: ClockMode) -> Speed {
        match mode {
            ClockMode::Real => Speed::REAL,
            ClockMode::Factor(factor) => Speed::times(factor),
            ClockMode::Paused => Speed::PAUSED,
        }
    }

    fn times(factor: f64) -> Speed {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates, and what is no number is the slowest"
        )]
        let millionths = (factor * Speed::UNIT as f64).round() as u64;
        Speed(millionths.clamp(Speed::SLOWEST, Speed::FASTEST))
    }

    /// How much rig time passes in so much wall time, whole nanoseconds.
    fn rig(self, wall: u64) -> u64 {
        if self == Speed::REAL {
            return wall;
        }
        narrow(u128::from(wall) * u128::from(self.0) / u128::from(Speed::UNIT))
    }

    /// In how much wall time so much rig time has passed; `None` when it stands.
    fn wall(self, rig: u64) -> Option<u64> {
        (self != Speed::PAUSED)
            .then(|| narrow((u128::from(rig) * u128::from(Speed::UNIT)).div_ceil(u128::from(self.0))))
    }
}

fn narrow(nanos: u128) -> u64 {
    u64::try_from(nanos).unwrap_or(u64::MAX)
}

/// A straight line: from `wall` and `rig` on at `speed`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) wall: u64,
    pub(super) rig: Instant,
    pub(super) speed: Speed,
}

impl Line {
    /// The rig time at a wall time.
    pub(super) fn rig_at(&self, wall: u64) -> Instant {
        let passed = self.speed.rig(wall.saturating_sub(self.wall));
        Instant::from_nanos(self.rig.as_nanos().saturating_add(passed))
    }

    /// The first wall time at which it is `rig` or later; `None` when that never comes.
    pub(super) fn wall_at(&self, rig: Instant) -> Option<u64> {
        let ahead = rig.as_nanos().saturating_sub(self.rig.as_nanos());
        Some(self.wall.saturating_add(self.speed.wall(ahead)?))
    }

    /// The line that goes on from `wall`, at another speed.
    fn then(&self, wall: u64, speed: Speed) -> Line {
        Line { wall, rig: self.rig_at(wall), speed }
    }
}

/// The course of rig time.
#[derive(Debug)]
pub(super) struct Course {
    mode: ClockMode,
    /// The line that it is on.
    line: Line,
    /// The line since the last change on which it would be, had nothing been held back.
    asked: Line,
    losses: Losses,
}

impl Course {
    /// From zero on.
    pub(super) fn start(mode: ClockMode) -> Course {
        let line = Line { wall: 0, rig: Instant::ZERO, speed: Speed::of(mode) };
        Course { mode, line, asked: line, losses: Losses::default() }
    }

    /// The line that it is on.
    pub(super) fn line(&self) -> Line {
        self.line
    }

    /// How it passes.
    pub(super) fn mode(&self) -> ClockMode {
        self.mode
    }

    /// Another speed from `wall` on, which is the returned rig time.
    pub(super) fn set_mode(&mut self, mode: ClockMode, wall: u64) -> Instant {
        self.mode = mode;
        self.begin(self.line.then(wall, Speed::of(mode)));
        self.line.rig
    }

    /// See [`super::Clock::jump_to`].
    pub(super) fn jump_to(&mut self, to: Instant, wall: u64) -> Result<(), CannotJump> {
        if self.line.speed != Speed::PAUSED {
            return Err(CannotJump::Running);
        }
        let now = self.line.rig;
        if to < now {
            return Err(CannotJump::Back { now, to });
        }
        self.begin(Line { wall, rig: to, speed: Speed::PAUSED });
        Ok(())
    }

    /// See [`super::Clock::hold_back`].
    pub(super) fn hold_back(&mut self, to: Instant, wall: u64) {
        let now = self.line.rig_at(wall);
        let to = to.max(self.asked.rig);
        // Paused, it is where the last change left it, so `to` is not before `now`.
        if to < now {
            self.losses.add(now.as_nanos() - to.as_nanos(), wall);
            self.line = Line { wall, rig: to, speed: self.line.speed };
        }
    }

    /// See [`super::Clock::reached`].
    pub(super) fn reached(&self, wall: u64) -> f64 {
        let (lost, since) = self.losses.lately(wall);
        let asked = self.asked.speed.rig(wall.saturating_sub(since.max(self.asked.wall)));
        if lost == 0 { 1.0 } else { asked.saturating_sub(lost) as f64 / asked.max(1) as f64 }
    }

    fn begin(&mut self, line: Line) {
        self.line = line;
        self.asked = line;
        self.losses = Losses::default();
    }
}

/// How much rig time was lost by holding back, in nanoseconds.
#[derive(Debug, Default)]
struct Losses {
    /// The period in which something was last lost, counted from 0.
    period: u64,
    in_it: u64,
    in_the_one_before: u64,
}

impl Losses {
    fn add(&mut self, lost: u64, wall: u64) {
        let (in_it, in_the_one_before) = self.at(wall);
        *self = Losses { period: wall / PERIOD, in_it: in_it.saturating_add(lost), in_the_one_before };
    }

    /// What was lost lately, and since which wall time that is.
    fn lately(&self, wall: u64) -> (u64, u64) {
        let (in_it, in_the_one_before) = self.at(wall);
        (in_it.saturating_add(in_the_one_before), (wall / PERIOD).saturating_sub(1) * PERIOD)
    }

    /// What was lost in the period of a wall time, not before the last loss, and in the one before.
    fn at(&self, wall: u64) -> (u64, u64) {
        match (wall / PERIOD).saturating_sub(self.period) {
            0 => (self.in_it, self.in_the_one_before),
            1 => (0, self.in_it),
            _ => (0, 0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAY: u64 = 24 * 3600 * 1_000_000_000;

    fn line(mode: ClockMode) -> Line {
        Course::start(mode).line()
    }

    #[test]
    fn whole_factors_are_exact_to_the_nanosecond_for_days() {
        for factor in [1_u32, 3, 7, 1_000, 999_983] {
            let line = line(ClockMode::Factor(f64::from(factor)));
            let wall = 10 * DAY + 12_345_678_901;
            let expected = (u128::from(wall) * u128::from(factor)).min(u128::from(u64::MAX));
            assert_eq!(u128::from(line.rig_at(wall).as_nanos()), expected, "x{factor}");
        }
        assert_eq!(line(ClockMode::Factor(0.01)).rig_at(10 * DAY).as_nanos(), DAY / 10);
    }

    #[test]
    fn the_wall_time_of_an_instant_is_the_first_at_which_it_has_come() {
        for factor in [0.01, 0.333_333, 1.0, 1.5, 100.0, 12_345.678_9, 1e6] {
            let line = Line { wall: 17, rig: Instant::from_nanos(5), ..line(ClockMode::Factor(factor)) };
            for nanos in [6, 7, 999, 1_000_001, 123_456_789_012_345, DAY * 100 + 1] {
                let at = Instant::from_nanos(nanos);
                let wall = line.wall_at(at).unwrap();
                assert!(line.rig_at(wall) >= at, "x{factor}: {nanos} is early");
                assert!(line.rig_at(wall - 1) < at, "x{factor}: {nanos} is late");
            }
        }
    }

    #[test]
    fn at_the_end_of_time_it_stays() {
        for mode in [ClockMode::Real, ClockMode::Factor(0.01), ClockMode::Factor(1e6)] {
            let line = Line { rig: Instant::from_nanos(u64::MAX - 1), ..line(mode) };
            assert_eq!(line.rig_at(u64::MAX), Instant::FAR_FUTURE);
        }
        assert_eq!(line(ClockMode::Factor(0.01)).wall_at(Instant::FAR_FUTURE), Some(u64::MAX));
        assert_eq!(line(ClockMode::Factor(1e6)).rig_at(DAY), Instant::FAR_FUTURE);
    }

    #[test]
    fn a_factor_that_no_rig_file_can_have_is_taken_as_the_nearest_that_it_can() {
        for (factor, millionths) in [
            (0.0, 10_000),
            (-5.0, 10_000),
            (f64::NAN, 10_000),
            (f64::NEG_INFINITY, 10_000),
            (0.01, 10_000),
            (1.0, 1_000_000),
            (1e6, 1_000_000_000_000),
            (1e7, 1_000_000_000_000),
            (f64::INFINITY, 1_000_000_000_000),
        ] {
            assert_eq!(Speed::of(ClockMode::Factor(factor)), Speed(millionths), "{factor}");
        }
    }

    #[test]
    fn what_was_lost_counts_in_its_period_and_the_next() {
        let mut losses = Losses::default();
        losses.add(3, 0);
        losses.add(4, PERIOD - 1);
        assert_eq!(losses.lately(PERIOD - 1), (7, 0));
        losses.add(10, PERIOD);
        assert_eq!(losses.lately(PERIOD), (17, 0));
        assert_eq!(losses.lately(2 * PERIOD), (10, PERIOD));
        assert_eq!(losses.lately(3 * PERIOD), (0, 2 * PERIOD));
        losses.add(1, 9 * PERIOD);
        assert_eq!(losses.lately(9 * PERIOD), (1, 8 * PERIOD));
    }
}
