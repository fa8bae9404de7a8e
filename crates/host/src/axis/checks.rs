//! What is checked before an axis moves.

use super::motor::{Fault, Look, Motion, Setup};
use super::plan::Plan;
use crate::direction::Direction;
use crate::error::Error;
use crate::units::Goal;

/// Whether a place is another than where the motor is shown to be.
pub(super) fn differs(place: f64, look: &Look) -> bool {
    (place - look.position).abs() > 2.0 * look.within
}

/// A motion to a count, in the direction in which it lies.
pub(super) fn to(target: i64, look: &Look, setup: &Setup) -> Motion {
    let ahead = target as f64 / f64::from(setup.parts) >= look.position;
    Motion::To { target, direction: if ahead { Direction::Positive } else { Direction::Negative } }
}

/// Fails when a goal is not one that the controller can be sent to.
pub(super) fn check_range(goal: Goal, end: f64, count: i64, look: &Look, setup: &Setup) -> Result<(), Error> {
    let parts = f64::from(setup.parts);
    let (low, high) = setup.range;
    let counted = |steps: f64| (low as f64..=high as f64).contains(&(steps * parts));
    let full_steps = |count: i64| count as f64 / parts;
    if !(low..=high).contains(&count) || !counted(end) {
        return Err(Error::Usage(format!(
            "{goal} ends at {end} full steps, where the counter does not reach: it has {} to {} full steps; take a place \
             nearer to it as zero; nothing was sent",
            full_steps(low),
            full_steps(high)
        )));
    }
    if (end - look.position).abs() * parts > setup.reach as f64 {
        return Err(Error::Usage(format!(
            "{goal} is {} full steps away, and one motion goes {} at most; go there in two; nothing was sent",
            (end - look.position).abs(),
            full_steps(setup.reach)
        )));
    }
    Ok(())
}

/// Faults in words.
pub(super) fn told(faults: &[Fault]) -> String {
    let told = faults.iter().map(|fault| format!("{} ({})", fault.name, fault.about.trim_end_matches('.')));
    told.collect::<Vec<_>>().join(", ")
}

/// A run ends at the soft limit that lies in its direction; there has to be one.
pub(super) fn check_room(direction: Direction, plan: &Plan) -> Result<(), Error> {
    let (from, to) = (plan.from, plan.to);
    let is_ahead =
        if direction == Direction::Positive { to.value > from.value } else { to.value < from.value };
    if is_ahead {
        return Ok(());
    }
    Err(Error::Refused(format!(
        "the axis stands at {from}, at or beyond the soft limit {to}; go the other way; nothing was sent"
    )))
}
