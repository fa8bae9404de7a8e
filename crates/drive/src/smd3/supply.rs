//! The current in the motor's phases.

use super::winding::{Part, Parts, Thermal};
use core::time::Duration;
use stepdrive_spec::smd3::units::CURRENT_STEPS;
use stepdrive_spec::time::Instant;

/// ASSUMED: the most that bake drives through each phase, in amperes: the full scale.
const MOST_BAKE_CURRENT: f64 = 1.0;

/// ASSUMED: turning or holding, the phases carry sine and cosine of the current, so together they are heated half as much
/// as in bake, where each carries all of it.
const SHARE_OF_BAKE: f64 = 0.5;

/// Where the current comes from, and how it changes by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Supply {
    /// The motor is disabled.
    Off,
    /// A constant current, in amperes.
    Steady(f64),
    /// After a standstill.
    Lowering(Lowering),
    /// Bake.
    Bake(Bake),
}

/// Held for `PDDEL`, then lowered to the hold current by one step of current every `IHD`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lowering {
    pub(super) since: Instant,
    pub(super) from: f64,
    pub(super) hold: f64,
    pub(super) delay: Duration,
    pub(super) step: Duration,
}

/// Bake, to a temperature.
///
/// ASSUMED: the regulator is a PI on the heating power whose integral time is the winding's time constant and which does
/// not wind up. Then the regulated temperature approaches the set-point exponentially, [`Thermal::bake_gain`] times as
/// fast as the winding would by itself, without overshoot; farther away the current is at its most, or off. Each of the
/// three is an exponential, so hours of bake are at most three [`Part`]s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bake {
    pub(super) setpoint: f64,
    /// What the regulator is told is the winding's temperature; else it is told the ambient temperature.
    pub(super) sensed: bool,
}

impl Supply {
    /// The current of a phase, at its peak while turning, at `now` with the winding at `temperature`.
    pub(super) fn amperes(&self, now: Instant, temperature: f64, thermal: &Thermal) -> f64 {
        match self {
            Supply::Off => 0.0,
            Supply::Steady(amperes) => *amperes,
            Supply::Lowering(lowering) => lowering.amperes(now),
            Supply::Bake(bake) => {
                let seen = if bake.sensed { temperature } else { thermal.ambient_c };
                bake.amperes(seen, thermal)
            }
        }
    }

    /// How it heats the winding from `now`, at `temperature`, on.
    pub(super) fn parts(&self, now: Instant, temperature: f64, thermal: &Thermal) -> Parts {
        let forever = |amperes: f64| Part::passive(Instant::FAR_FUTURE, sine_rise(amperes, thermal), thermal);
        match self {
            Supply::Off => [forever(0.0)].into_iter().collect(),
            Supply::Steady(amperes) => [forever(*amperes)].into_iter().collect(),
            Supply::Lowering(lowering) => lowering.parts(thermal),
            Supply::Bake(bake) => bake.parts(now, temperature, thermal),
        }
    }
}

/// What a current heats a winding by in the end, in kelvin, turning or holding.
fn sine_rise(amperes: f64, thermal: &Thermal) -> f64 {
    thermal.rise_k * SHARE_OF_BAKE * amperes * amperes
}

impl Lowering {
    fn amperes(&self, now: Instant) -> f64 {
        let Some(lowered_for) = now.since(self.since).checked_sub(self.delay) else { return self.from };
        let steps = lowered_for.as_nanos().checked_div(self.step.as_nanos());
        let Some(steps) = steps.and_then(|steps| u32::try_from(steps).ok()) else { return self.hold };
        (self.from - f64::from(steps) / CURRENT_STEPS).max(self.hold)
    }

    /// How many steps lie between the two currents.
    fn steps(&self) -> u32 {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates, and negative is none"
        )]
        let steps = ((self.from - self.hold) * CURRENT_STEPS + 0.5) as u32;
        steps
    }

    /// Three parts: before, while and after it is lowered. While it is lowered the mean of the heat counts: the steps
    /// take seconds, the winding minutes.
    fn parts(&self, thermal: &Thermal) -> Parts {
        let steps = self.steps();
        let start = self.since + self.delay;
        let end = start + self.step.saturating_mul(steps);
        let rise = |step: u32| sine_rise(self.from - f64::from(step) / CURRENT_STEPS, thermal);
        let mean = (0..steps).map(rise).sum::<f64>() / f64::from(steps.max(1));
        [
            Part::passive(start, rise(0), thermal),
            Part::passive(end, mean, thermal),
            Part::passive(Instant::FAR_FUTURE, sine_rise(self.hold, thermal), thermal),
        ]
        .into_iter()
        .collect()
    }
}

impl Bake {
    /// The heating in kelvin that the regulator asks for at a temperature, of which it gets between none and the most.
    fn demand(&self, temperature: f64, thermal: &Thermal) -> f64 {
        temperature - thermal.ambient_c + thermal.bake_gain * (self.setpoint - temperature)
    }

    fn amperes(&self, temperature: f64, thermal: &Thermal) -> f64 {
        let most = most_rise(thermal);
        let share = self.demand(temperature, thermal).clamp(0.0, most) / thermal.rise_k;
        if share > 0.0 { libm::sqrt(share) } else { 0.0 }
    }

    fn parts(&self, now: Instant, temperature: f64, thermal: &Thermal) -> Parts {
        if !self.sensed {
            let rise = self.amperes(thermal.ambient_c, thermal);
            let rise = rise * rise * thermal.rise_k;
            return [Part::passive(Instant::FAR_FUTURE, rise, thermal)].into_iter().collect();
        }
        let mut parts = Parts::new();
        let (mut start, mut temperature) = (now, temperature);
        let mut regime = self.regime(temperature, thermal);
        while parts.len() < parts.capacity() {
            let (part, next) = self.part(regime, start, temperature, thermal);
            parts.push(part);
            let Some((boundary, neighbour)) = next else { break };
            (start, temperature, regime) = (part.until, boundary, neighbour);
        }
        parts
    }

    fn regime(&self, temperature: f64, thermal: &Thermal) -> Regime {
        let demand = self.demand(temperature, thermal);
        if demand > most_rise(thermal) {
            Regime::Full
        } else if demand < 0.0 {
            Regime::Off
        } else {
            Regime::Regulated
        }
    }

    /// The part in a regime, and the temperature and regime in which it ends, if it does.
    fn part(
        &self,
        regime: Regime,
        start: Instant,
        temperature: f64,
        thermal: &Thermal,
    ) -> (Part, Option<(f64, Regime)>) {
        let forever = Instant::FAR_FUTURE;
        let part = match regime {
            Regime::Full => Part::passive(forever, most_rise(thermal), thermal),
            Regime::Off => Part::passive(forever, 0.0, thermal),
            Regime::Regulated => Part {
                until: forever,
                goal: self.setpoint,
                seconds: thermal.time_constant.as_secs_f64() / thermal.bake_gain,
            },
        };
        let full_below = self.boundary(most_rise(thermal), thermal);
        let off_above = self.boundary(0.0, thermal);
        let (boundary, neighbour) = match regime {
            Regime::Full => (full_below, Regime::Regulated),
            Regime::Off => (off_above, Regime::Regulated),
            Regime::Regulated if part.goal < temperature => (full_below, Regime::Full),
            Regime::Regulated => (off_above, Regime::Off),
        };
        match part.when(start, temperature, boundary) {
            Some(until) => (Part { until, ..part }, Some((boundary, neighbour))),
            None => (part, None),
        }
    }

    /// The temperature at which the regulator asks for so much heating.
    fn boundary(&self, demand: f64, thermal: &Thermal) -> f64 {
        (thermal.bake_gain * self.setpoint - thermal.ambient_c - demand) / (thermal.bake_gain - 1.0)
    }
}

/// The heating in kelvin at the most that bake drives.
fn most_rise(thermal: &Thermal) -> f64 {
    thermal.rise_k * MOST_BAKE_CURRENT * MOST_BAKE_CURRENT
}

/// What the regulator does with the current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Regime {
    /// The most.
    Full,
    /// As much as it asks for.
    Regulated,
    /// None.
    Off,
}
