//! The temperature of the winding: heated by the current, cooled by its surroundings, first order, so that it is a closed
//! form of time between two events (decision 34).

use arrayvec::ArrayVec;
use core::time::Duration;
use stepdrive_spec::time::Instant;

/// How a motor and its surroundings warm up: rig parameters, all ASSUMED (decision 34).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermal {
    /// Temperature around the motor, °C.
    pub ambient_c: f64,
    /// Time in which a difference falls to 1/e.
    pub time_constant: Duration,
    /// How far above ambient 1 A in both phases brings the winding in the end, in kelvin.
    pub rise_k: f64,
    /// How many times faster than the winding by itself the bake regulator makes it approach its set-point.
    pub bake_gain: f64,
}

impl Default for Thermal {
    fn default() -> Thermal {
        Thermal { ambient_c: 20.0, time_constant: Duration::from_mins(10), rise_k: 150.0, bake_gain: 10.0 }
    }
}

impl Thermal {
    /// With every number in a range in which nothing overflows; what is not a number becomes the lower end.
    pub(super) fn sane(self) -> Thermal {
        let within = |value: f64, low: f64, high: f64| value.max(low).min(high);
        Thermal {
            ambient_c: within(self.ambient_c, -273.15, 1e4),
            time_constant: self.time_constant.clamp(Duration::from_millis(1), Duration::from_secs(1 << 32)),
            rise_k: within(self.rise_k, 1e-3, 1e4),
            bake_gain: within(self.bake_gain, 1.1, 1e4),
        }
    }
}

/// A stretch of time in which the temperature approaches a goal exponentially.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) until: Instant,
    /// The temperature it approaches, °C.
    pub(super) goal: f64,
    /// The time constant.
    pub(super) seconds: f64,
}

/// What is to come, in order; the last part has no end.
pub(super) type Parts = ArrayVec<Part, 3>;

impl Part {
    /// Heated so as to be `rise` kelvin above ambient in the end.
    pub(super) fn passive(until: Instant, rise: f64, thermal: &Thermal) -> Part {
        Part { until, goal: thermal.ambient_c + rise, seconds: thermal.time_constant.as_secs_f64() }
    }

    /// The temperature after `time`, starting from `temperature`.
    fn after(&self, temperature: f64, time: Duration) -> f64 {
        self.goal + (temperature - self.goal) * libm::exp(-time.as_secs_f64() / self.seconds)
    }

    /// When it comes to `mark`, having been at `temperature` at `start`; `None` when it does not within the part.
    pub(super) fn when(&self, start: Instant, temperature: f64, mark: f64) -> Option<Instant> {
        let share = (temperature - self.goal) / (mark - self.goal);
        if !share.is_finite() || share < 1.0 {
            return None;
        }
        let nanos = libm::ceil(self.seconds * libm::log(share) * 1e9);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
        let at = Instant::from_nanos(start.as_nanos().saturating_add(nanos as u64));
        (at < self.until).then_some(at)
    }
}

/// The winding's temperature from an instant on.
#[derive(Clone, Debug)]
pub(super) struct Winding {
    since: Instant,
    /// The temperature then.
    temperature: f64,
    parts: Parts,
}

impl Winding {
    /// At ambient temperature, without current.
    pub(super) fn cold(now: Instant, thermal: &Thermal) -> Winding {
        let rest = Part::passive(Instant::FAR_FUTURE, 0.0, thermal);
        Winding { since: now, temperature: thermal.ambient_c, parts: [rest].into_iter().collect() }
    }

    pub(super) fn temperature(&self, now: Instant) -> f64 {
        let mut temperature = self.temperature;
        for (start, part) in self.timed() {
            if start >= now {
                break;
            }
            temperature = part.after(temperature, now.min(part.until).since(start));
        }
        temperature
    }

    /// From `now` on the temperature goes these ways.
    pub(super) fn drive(&mut self, now: Instant, parts: Parts) {
        *self = Winding { since: now, temperature: self.temperature(now), parts };
    }

    /// From `now` on it is held at a temperature.
    pub(super) fn hold(&mut self, now: Instant, temperature: f64) {
        let held = Part { until: Instant::FAR_FUTURE, goal: temperature, seconds: 1.0 };
        *self = Winding { since: now, temperature, parts: [held].into_iter().collect() };
    }

    /// When the temperature rises above `mark`; `None` when it does not, or is there already.
    pub(super) fn when_above(&self, mark: f64) -> Option<Instant> {
        let mut temperature = self.temperature;
        for (start, part) in self.timed() {
            if temperature <= mark
                && part.goal > mark
                && let Some(at) = part.when(start, temperature, mark)
            {
                return Some(at);
            }
            temperature = part.after(temperature, part.until.since(start));
        }
        None
    }

    /// The parts with their starts.
    fn timed(&self) -> impl Iterator<Item = (Instant, &Part)> {
        let starts = self.parts.iter().map(|part| part.until.max(self.since));
        core::iter::once(self.since).chain(starts).zip(&self.parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEATED: Thermal =
        Thermal { ambient_c: 20.0, time_constant: Duration::from_mins(10), rise_k: 150.0, bake_gain: 10.0 };

    fn at(seconds: u64) -> Instant {
        Instant::ZERO + Duration::from_secs(seconds)
    }

    #[test]
    fn parts_follow_each_other_without_a_jump() {
        let mut winding = Winding::cold(at(0), &HEATED);
        let warm = Part::passive(at(600), 100.0, &HEATED);
        let cool = Part::passive(Instant::FAR_FUTURE, 0.0, &HEATED);
        winding.drive(at(0), [warm, cool].into_iter().collect());
        let peak = 20.0 + 100.0 * (1.0 - libm::exp(-1.0));
        assert!((winding.temperature(at(600)) - peak).abs() < 1e-9);
        let later = 20.0 + (peak - 20.0) * libm::exp(-0.5);
        assert!((winding.temperature(at(900)) - later).abs() < 1e-9);
    }

    #[test]
    fn the_instant_of_a_temperature_is_solved() {
        let mut winding = Winding::cold(at(0), &HEATED);
        winding.drive(at(0), [Part::passive(Instant::FAR_FUTURE, 100.0, &HEATED)].into_iter().collect());
        let when = winding.when_above(70.0).expect("it gets that warm");
        assert!((when.since(at(0)).as_secs_f64() - 600.0 * libm::log(2.0)).abs() < 1e-6);
        assert!((winding.temperature(when) - 70.0).abs() < 1e-6);
        assert_eq!(winding.when_above(120.0), None);
    }

    #[test]
    fn odd_parameters_are_brought_into_range() {
        let odd = Thermal {
            ambient_c: f64::NAN,
            time_constant: Duration::ZERO,
            rise_k: f64::NEG_INFINITY,
            bake_gain: 0.0,
        };
        let sane = odd.sane();
        assert_eq!(sane, sane.sane());
        assert!(sane.bake_gain > 1.0 && sane.rise_k > 0.0 && !sane.time_constant.is_zero());
    }
}
