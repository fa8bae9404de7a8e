//! Time as an argument: a point on the rig's clock.

use core::fmt;
use core::ops::Add;
use core::time::Duration;

/// A point on the rig's clock, in nanoseconds since the rig was switched on.
///
/// Nanoseconds because the fastest thing a controller does, a microstep at 15 600 full steps a second and 1/128, comes
/// every 500 ns. 64 bits of them last for 584 years; arithmetic saturates there instead of wrapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant(u64);

impl Instant {
    /// The moment the rig was switched on.
    pub const ZERO: Instant = Instant(0);
    /// The end of representable time, about 584 years on: later than anything that will happen.
    pub const FAR_FUTURE: Instant = Instant(u64::MAX);

    /// The instant `nanos` nanoseconds after [`Instant::ZERO`].
    pub const fn from_nanos(nanos: u64) -> Instant {
        Instant(nanos)
    }

    /// Nanoseconds since [`Instant::ZERO`].
    pub const fn as_nanos(self) -> u64 {
        self.0
    }

    /// The time from `earlier` to `self`; zero when `earlier` is the later of the two.
    pub const fn since(self, earlier: Instant) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Instant {
    type Output = Instant;

    fn add(self, duration: Duration) -> Instant {
        let nanos = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        Instant(self.0.saturating_add(nanos))
    }
}

impl fmt::Display for Instant {
    /// Seconds with nine decimals, as in `2.000000500 s`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:09} s", self.0 / 1_000_000_000, self.0 % 1_000_000_000)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn adding_a_duration_moves_forward_and_saturates_at_the_end_of_time() {
        assert_eq!(Instant::ZERO + Duration::from_micros(3), Instant::from_nanos(3_000));
        assert_eq!(Instant::FAR_FUTURE + Duration::from_secs(1), Instant::FAR_FUTURE);
    }

    #[test]
    fn since_never_goes_negative() {
        let early = Instant::from_nanos(5);
        let late = Instant::from_nanos(9);
        assert_eq!(late.since(early), Duration::from_nanos(4));
        assert_eq!(early.since(late), Duration::ZERO);
    }

    #[test]
    fn an_instant_prints_as_seconds() {
        assert_eq!(Instant::from_nanos(2_000_000_500).to_string(), "2.000000500 s");
    }
}
