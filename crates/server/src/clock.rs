//! Where time comes from. Everything else takes it as an argument.

use std::time::Duration;
use stepdrive_rig::file::ClockMode;
use stepdrive_spec::time::Instant;

/// The rig's clock.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Clock {
    /// Rig time is the time since the rig was started.
    Real {
        /// When that was.
        started: tokio::time::Instant,
    },
}

impl Clock {
    /// Starts the clock: it is [`Instant::ZERO`] now.
    pub(crate) fn start(mode: ClockMode) -> Clock {
        match mode {
            ClockMode::Real => Clock::Real { started: tokio::time::Instant::now() },
        }
    }

    /// The present rig time.
    pub(crate) fn now(self) -> Instant {
        match self {
            Clock::Real { started } => Instant::ZERO + started.elapsed(),
        }
    }

    /// Waits until it is `at`; for ever when `at` is `None`. It may wake up to a few milliseconds late.
    pub(crate) async fn sleep_until(self, at: Option<Instant>) {
        let Some(at) = at else { return std::future::pending().await };
        match self {
            Clock::Real { started } => {
                tokio::time::sleep_until(started + Duration::from_nanos(at.as_nanos())).await;
            }
        }
    }
}
