//! A profile put on the axis: where it started, when, and in which direction.

use crate::num;
use crate::profile::{Crossing, Profile};
use crate::segment::Phase;
use stepdrive_spec::time::Instant;

/// The direction in which counts are emitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Counts grow.
    Forward,
    /// Counts fall.
    Reverse,
}

impl Direction {
    /// The direction from one count to another; forward when they are the same.
    pub fn towards(from: i64, to: i64) -> Direction {
        if to < from { Direction::Reverse } else { Direction::Forward }
    }

    /// The count `counts` away from `from` in this direction; saturates.
    pub fn step(self, from: i64, counts: i64) -> i64 {
        match self {
            Direction::Forward => from.saturating_add(counts),
            Direction::Reverse => from.saturating_sub(counts),
        }
    }

    /// How far `to` lies ahead of `from` in this direction; `None` when it lies behind.
    pub(crate) fn ahead(self, from: i64, to: i64) -> Option<u64> {
        (from == to || Direction::towards(from, to) == self).then(|| from.abs_diff(to))
    }
}

/// A motion in one direction, from `start` on. Instants before it are taken as it, instants after its end see its end.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Leg {
    pub(crate) start: Instant,
    pub(crate) origin: i64,
    pub(crate) direction: Direction,
    pub(crate) profile: Profile,
}

impl Leg {
    pub(crate) fn count(&self, at: Instant) -> i64 {
        self.direction.step(self.origin, num::whole(self.position(at)))
    }

    /// The part of the next count that the generator has covered, in `0..1`.
    pub(crate) fn fraction(&self, at: Instant) -> f64 {
        let s = self.position(at);
        s - libm::floor(s)
    }

    pub(crate) fn speed(&self, at: Instant) -> f64 {
        self.profile.speed(self.nanos(at))
    }

    pub(crate) fn phase(&self, at: Instant) -> Phase {
        self.profile.phase(self.nanos(at))
    }

    /// The end of the leg; `None` when it does not end within the clock.
    pub(crate) fn end(&self) -> Option<Instant> {
        self.instant(self.profile.duration_ns()?)
    }

    /// The first change of phase after `after`, the end included.
    pub(crate) fn next_boundary(&self, after: Instant) -> Option<Instant> {
        self.instant(self.profile.next_boundary(self.nanos(after))?)
    }

    /// When the leg comes to `count`, its start for the count it starts at; `None` for one behind or past its end.
    pub(crate) fn when_reaches(&self, count: i64) -> Option<Instant> {
        self.instant(self.profile.when_reaches(self.direction.ahead(self.origin, count)?)?)
    }

    pub(crate) fn crossing(&self, at: Instant, speed: f64) -> Crossing<Instant> {
        let Crossing { above, since } = self.profile.crossing(self.nanos(at), speed);
        Crossing { above, since: since.and_then(|ns| self.instant(ns)) }
    }

    fn position(&self, at: Instant) -> f64 {
        self.profile.position(self.nanos(at))
    }

    /// Nanoseconds of the profile at an instant of the rig.
    fn nanos(&self, at: Instant) -> u64 {
        at.as_nanos().saturating_sub(self.start.as_nanos())
    }

    /// The instant of the rig at a nanosecond of the profile, unless the clock does not reach that far.
    fn instant(&self, ns: u64) -> Option<Instant> {
        self.start.as_nanos().checked_add(ns).map(Instant::from_nanos)
    }
}
