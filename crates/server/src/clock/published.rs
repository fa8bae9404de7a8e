//! The line of rig time where everybody can read it without waiting for each other: a sequence lock.

use super::course::{Line, Speed};
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::sync::atomic::{AtomicU64, fence};
use stepdrive_spec::time::Instant;

/// A line that is read often and changed seldom, by one at a time.
///
/// A lock for readers and writers would be simpler, but every reader writes to it. Measured on two cores, the present
/// time then takes 155 ns instead of 39 as soon as two threads ask for it; what it takes at least is the 28 ns of
/// looking at the system's clock.
pub(super) struct Published {
    /// Odd while the line is withdrawn.
    version: AtomicU64,
    wall: AtomicU64,
    rig: AtomicU64,
    speed: AtomicU64,
}

impl Published {
    pub(super) fn new(line: Line) -> Published {
        Published {
            version: AtomicU64::new(0),
            wall: AtomicU64::new(line.wall),
            rig: AtomicU64::new(line.rig.as_nanos()),
            speed: AtomicU64::new(line.speed.0),
        }
    }

    /// Does something with the line; `None` when the line was withdrawn before or during that. `read` may look at the
    /// clock: what it sees is before the next change.
    pub(super) fn read<R>(&self, read: impl FnOnce(Line) -> R) -> Option<R> {
        let version = self.version.load(Acquire);
        let outcome = read(Line {
            wall: self.wall.load(Relaxed),
            rig: Instant::from_nanos(self.rig.load(Relaxed)),
            speed: Speed(self.speed.load(Relaxed)),
        });
        // Stronger than `Acquire`, which holds back loads but not the processor's reading of its clock.
        fence(SeqCst);
        (version.is_multiple_of(2) && self.version.load(Relaxed) == version).then_some(outcome)
    }

    /// Nobody reads the line from now on. A clock that is looked at after this is later than what any reader saw.
    pub(super) fn withdraw(&self) {
        self.version.fetch_add(1, SeqCst);
        fence(SeqCst);
    }

    /// Lets everybody read the line that goes on.
    pub(super) fn publish(&self, line: Line) {
        self.wall.store(line.wall, Relaxed);
        self.rig.store(line.rig.as_nanos(), Relaxed);
        self.speed.store(line.speed.0, Relaxed);
        self.version.fetch_add(1, Release);
    }
}
