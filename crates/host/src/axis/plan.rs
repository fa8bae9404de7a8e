//! What a move will be: travel, time, and what is sent for it.

use super::motor::Profile;
use crate::trust::Trust;
use crate::units::{Amount, Goal};
use std::time::Duration;

/// A move before it is made, or as it was made.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What was asked for.
    pub goal: Goal,
    /// Where the axis stands.
    pub from: Amount,
    /// Where it will stand: the nearest to the goal that the controller counts.
    pub to: Amount,
    /// From one to the other.
    pub distance: Amount,
    /// The same in full steps, in the motor's direction.
    pub full_steps: f64,
    /// Whether the goal is not exactly what the controller counts, so that [`Plan::to`] is rounded.
    pub rounded: bool,
    /// How long it will take, estimated from speed and acceleration.
    pub duration: Duration,
    /// What that supposes, where the controller does not tell all that it is estimated from; in words.
    pub supposed: Option<String>,
    /// What is sent, a line or a request each, in order.
    pub sent: Vec<String>,
    /// Whether the position can be believed.
    pub trust: Trust,
}

/// How long a motion over a distance in full steps takes: speed up, turn at the highest speed if there is room for it,
/// and slow down.
pub(super) fn duration(distance: f64, profile: &Profile) -> Duration {
    let seconds = seconds(distance.abs(), profile);
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

fn seconds(distance: f64, profile: &Profile) -> f64 {
    if distance == 0.0 {
        return 0.0;
    }
    let max = profile.max.max(f64::MIN_POSITIVE);
    let (start, stop) = (profile.start.min(max), profile.stop.min(max));
    let (up, down) =
        (profile.acceleration.max(f64::MIN_POSITIVE), profile.deceleration.max(f64::MIN_POSITIVE));
    // The speed at which speeding up and slowing down fill the distance.
    let peak = ((2.0 * distance + start * start / up + stop * stop / down) / (1.0 / up + 1.0 / down)).sqrt();
    if peak <= start.max(stop) {
        return distance / start.max(stop);
    }
    let top = peak.min(max);
    let ramps = (top * top - start * start) / (2.0 * up) + (top * top - stop * stop) / (2.0 * down);
    (top - start) / up + (top - stop) / down + (distance - ramps).max(0.0) / top
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PROFILE: Profile =
        Profile { start: 0.0, stop: 0.0, max: 1000.0, acceleration: 1000.0, deceleration: 1000.0 };

    #[test]
    fn a_trapezoid_takes_its_ramps_and_its_plateau() {
        assert_eq!(duration(2000.0, &PROFILE), Duration::from_secs(3));
        assert_eq!(duration(-1000.0, &PROFILE), Duration::from_secs(2));
        assert_eq!(duration(250.0, &PROFILE), Duration::from_secs(1), "a triangle");
        assert_eq!(duration(0.0, &PROFILE), Duration::ZERO);
    }

    #[test]
    fn a_move_that_is_over_before_it_speeds_up_turns_at_the_start_speed() {
        let profile = Profile { start: 100.0, stop: 100.0, ..PROFILE };
        assert_eq!(duration(1.0, &PROFILE).as_millis(), 63);
        assert!(duration(1.0, &profile) < Duration::from_millis(11));
        let slow = Profile { max: 50.0, ..profile };
        assert_eq!(duration(100.0, &slow), Duration::from_secs(2));
    }

    proptest! {
        #[test]
        fn no_numbers_panic_and_a_longer_way_takes_no_less(
            far in 0.0..1e9, more in 0.0..1e9, start in 0.0..1e4, max in 0.0..2e4, up in 0.0..1e5, down in 0.0..1e5,
        ) {
            let profile = Profile { start, stop: start, max, acceleration: up, deceleration: down };
            let (near, far) = (duration(far, &profile), duration(far + more, &profile));
            prop_assert!(far + Duration::from_micros(1) >= near, "{near:?} {far:?}");
        }
    }
}
