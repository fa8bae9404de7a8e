//! The counters of errors that the standard protocol answers (`ERROR_GET`). They are volatile.

use super::Smsd;
use stepdrive_spec::smsd::standard::{COUNTERS, Counter};

/// The counters, in the order of the reply, but for the one that the motor chip keeps.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counters([u32; COUNTERS]);

impl Smsd {
    /// Counts something that the controller itself does not see: a failure to store its memory, a connection that could
    /// not be served, half a packet that was dropped. A counter that is full stays so.
    pub fn count(&mut self, counter: Counter) {
        if let Some(count) = self.counters.0.get_mut(counter as usize) {
            *count = count.saturating_add(1);
        }
    }

    /// The counters since power-up, in the order of the reply.
    ///
    /// ASSUMED: power-off clears them. Those of failures that nothing in a rig causes stay 0.
    pub fn counters(&self) -> [u32; COUNTERS] {
        let Counters(mut counters) = self.counters;
        if let Some(starts) = counters.get_mut(Counter::Starts as usize) {
            *starts = self.motor.starts();
        }
        counters
    }
}
