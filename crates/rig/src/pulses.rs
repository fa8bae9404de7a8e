//! Pulses given to inputs.

use alloc::vec::Vec;
use core::time::Duration;
use stepdrive_spec::time::Instant;

/// A train of pulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Train {
    /// How many; at least 1.
    pub count: u32,
    /// How long the signal is there.
    pub width: Duration,
    /// From the beginning of one to the beginning of the next; longer than `width`.
    pub period: Duration,
}

impl Train {
    /// One pulse.
    pub fn single(width: Duration) -> Train {
        Train { count: 1, width, period: width.saturating_mul(2) }
    }
}

/// The trains under way, at most one for each input.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pulses(Vec<Running>);

#[derive(Clone, Copy, Debug)]
struct Running {
    bit: u16,
    train: Train,
    /// The pulses that have not ended.
    left: u32,
    high: bool,
    /// When it next rises or falls.
    edge: Instant,
}

impl Pulses {
    /// Begins a train with its first pulse.
    pub(crate) fn begin(&mut self, now: Instant, bit: u16, train: Train) {
        self.end(bit);
        if train.count > 0 {
            self.0.push(Running { bit, train, left: train.count, high: true, edge: now + train.width });
        }
    }

    /// Ends the train on an input.
    pub(crate) fn end(&mut self, bit: u16) {
        self.0.retain(|running| running.bit != bit);
    }

    /// The inputs that have a pulse now, a bit each.
    pub(crate) fn levels(&self) -> u16 {
        self.0.iter().filter(|running| running.high).fold(0, |bits, running| bits | running.bit)
    }

    /// When one of them next rises or falls.
    pub(crate) fn next_wake(&self) -> Option<Instant> {
        self.0.iter().map(|running| running.edge).min()
    }

    /// Lets those rise or fall whose time has come.
    pub(crate) fn advance(&mut self, now: Instant) {
        for running in self.0.iter_mut().filter(|running| running.edge <= now) {
            let Train { width, period, .. } = running.train;
            if running.high {
                running.left -= 1;
                running.edge = running.edge + period.saturating_sub(width);
            } else {
                running.edge = running.edge + width;
            }
            running.high = !running.high;
        }
        self.0.retain(|running| running.left > 0);
    }
}
