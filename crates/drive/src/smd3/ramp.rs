//! The motion: what the ramp generator follows, its position counters, and the standstill afterwards.
//!
//! ASSUMED: positions are counted in 1/256 full step whatever `RES` is; `RES` sets the grain of the profile's values and
//! the size of an external step. So every position that can be shown can be stood on.

use super::profile::{self, Profile, UNITS};
use core::time::Duration;
use stepdrive_motion::{Axis, Direction, FASTEST, Phase};
use stepdrive_spec::time::Instant;

/// The position counters have 32 bits.
const RING: i64 = 1 << 32;

/// ASSUMED: after an external step the motor counts as standing when none has followed for this time, 2^20 clocks as the
/// motion chip's own standstill detection.
const STEP_STANDSTILL: Duration = Duration::from_nanos(87_381_333);

/// What is followed until it is reached or stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Course {
    /// At `VMAX` in a direction.
    Velocity(Direction),
    /// To this count.
    Position(i64),
}

/// What the generator does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    Stand,
    Follow(Course),
    /// Brakes as the profile says. `resumable`: a new acceleration or deceleration takes the course up again.
    Brake {
        course: Course,
        resumable: bool,
    },
    /// At `VSTART` in a direction, without ramps.
    Crawl(Direction),
    /// External steps, to this count.
    Steps(i64),
    /// `SSTOP`.
    SoftStop,
}

/// Which directions the limit inputs block, and how a motion in such a direction is stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Gate {
    pub(super) forward: bool,
    pub(super) reverse: bool,
    /// With the profile instead of at once.
    pub(super) soft: bool,
}

impl Gate {
    pub(super) fn blocks(self, direction: Direction) -> bool {
        match direction {
            Direction::Forward => self.forward,
            Direction::Reverse => self.reverse,
        }
    }
}

/// The last standstill.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Standstill {
    pub(super) since: Instant,
    /// The motor stopped dead out of constant speed: it had the run current, not the acceleration current.
    pub(super) from_constant: bool,
}

/// The ramp generator.
#[derive(Clone, Debug)]
pub(super) struct Ramp {
    axis: Axis,
    order: Order,
    gate: Gate,
    /// What the axis did when it was last looked at; it changes at wake-ups and commands only.
    phase: Phase,
    standstill: Option<Standstill>,
    /// When the rest after a standstill (`TZW`) is over.
    rest: Option<Instant>,
    /// A position to go to when the rest is over.
    waiting: Option<i64>,
    /// The counts at which `PACT` and `PREL` are 0.
    zero: i64,
    relative_zero: i64,
}

impl Ramp {
    pub(super) fn power_up() -> Ramp {
        Ramp {
            axis: Axis::new(0),
            order: Order::Stand,
            gate: Gate::default(),
            phase: Phase::Stopped,
            standstill: None,
            rest: None,
            waiting: None,
            zero: 0,
            relative_zero: 0,
        }
    }

    /// As at power-up, with the rotor where it is at `now`.
    pub(super) fn without_supply(&self, now: Instant) -> Ramp {
        Ramp { axis: Axis::new(self.axis.count(now)), ..Ramp::power_up() }
    }

    // ---- time

    pub(super) fn next_wake(&self) -> Option<Instant> {
        self.axis.next_wake()
    }

    pub(super) fn handle_wake(&mut self, now: Instant, profile: &Profile) {
        self.axis.handle_wake(now);
        self.settle(now, profile);
    }

    /// When the rest after the last motion is over.
    pub(super) fn rest_over(&self) -> Option<Instant> {
        self.rest
    }

    /// Ends the rest, and starts what waited for that.
    pub(super) fn end_rest(&mut self, now: Instant, profile: &Profile) {
        self.rest = None;
        if let Some(target) = self.waiting.take() {
            self.follow(now, profile, Course::Position(target));
        }
    }

    // ---- commands

    /// Follows a course, whatever was done before. Positioning begins when the rest after the last motion is over; out
    /// of a standstill nothing begins towards an active limit.
    pub(super) fn follow(&mut self, now: Instant, profile: &Profile, course: Course) {
        self.waiting = None;
        match course {
            Course::Position(target) if self.rest.is_some() => self.waiting = Some(target),
            Course::Position(_) | Course::Velocity(_) => {
                self.begin(now, profile, Order::Follow(course), self.direction_of(now, course));
            }
        }
    }

    /// Goes `steps` full steps from where it is.
    pub(super) fn move_by(&mut self, now: Instant, profile: &Profile, steps: i64) {
        let target = self.axis.count(now).saturating_add(steps.saturating_mul(UNITS));
        self.follow(now, profile, Course::Position(target));
    }

    /// Goes to a position in full steps, as the counter turns over the shorter way.
    pub(super) fn move_to(&mut self, now: Instant, profile: &Profile, position: i64) {
        let target = self.axis.count(now).saturating_add(self.distance_to(now, position));
        self.follow(now, profile, Course::Position(target));
    }

    /// Turns at `VSTART` from the first microstep on.
    pub(super) fn crawl(&mut self, now: Instant, profile: &Profile, direction: Direction) {
        self.begin(now, profile, Order::Crawl(direction), direction);
    }

    /// Carries out one external step of `units`.
    pub(super) fn step(&mut self, now: Instant, profile: &Profile, direction: Direction, units: i64) {
        let from = if let Order::Steps(target) = self.order { target } else { self.axis.count(now) };
        self.begin(now, profile, Order::Steps(direction.step(from, units)), direction);
    }

    /// Brakes as the profile says.
    pub(super) fn stop(&mut self, now: Instant, profile: &Profile, resumable: bool) {
        self.waiting = None;
        match self.order {
            Order::Follow(course) | Order::Brake { course, .. } => {
                self.order = Order::Brake { course, resumable };
                self.apply(now, profile);
            }
            Order::Crawl(_) | Order::Steps(_) => self.axis.halt(now),
            Order::Stand | Order::SoftStop => {}
        }
        self.settle(now, profile);
    }

    /// Brakes so as to stand on a full step within a second.
    pub(super) fn soft_stop(&mut self, now: Instant, profile: &Profile) {
        self.waiting = None;
        if self.turning() && !matches!(self.order, Order::Steps(_)) {
            let (count, speed) = (self.axis.count(now), self.axis.speed(now));
            let (target, limits) = profile::soft_stop(count, speed, self.axis.direction());
            self.order = Order::SoftStop;
            self.axis.move_to(now, target, &limits);
        } else {
            self.axis.halt(now);
        }
        self.settle(now, profile);
    }

    /// Stands at once.
    pub(super) fn halt(&mut self, now: Instant, profile: &Profile) {
        self.waiting = None;
        self.axis.halt(now);
        self.settle(now, profile);
    }

    /// The motor is disabled: it stands at once, and there is no current to be lowered.
    pub(super) fn release(&mut self, now: Instant, profile: &Profile) {
        self.halt(now, profile);
        self.standstill = None;
    }

    /// Goes on under another profile.
    pub(super) fn set_profile(&mut self, now: Instant, profile: &Profile) {
        self.apply(now, profile);
        self.settle(now, profile);
    }

    /// Takes up the course that `STOP` was about to end.
    pub(super) fn resume(&mut self) {
        if let Order::Brake { course, resumable: true } = self.order {
            self.order = Order::Follow(course);
        }
    }

    /// The limit inputs have changed.
    pub(super) fn set_gate(&mut self, now: Instant, profile: &Profile, gate: Gate) {
        if gate != self.gate {
            self.gate = gate;
            self.settle(now, profile);
        }
    }

    /// `PACT`, in units.
    pub(super) fn set_position(&mut self, now: Instant, units: i64) {
        self.zero = self.axis.count(now).saturating_sub(units);
    }

    /// `PREL`, in units.
    pub(super) fn set_relative(&mut self, now: Instant, units: i64) {
        self.relative_zero = self.axis.count(now).saturating_sub(units);
    }

    // ---- motion as it is

    pub(super) fn turning(&self) -> bool {
        self.phase != Phase::Stopped
    }

    /// Whether nothing is under way. The standstill at a reversal is not that.
    pub(super) fn is_standing(&self) -> bool {
        self.order == Order::Stand && self.waiting.is_none()
    }

    /// Whether it stands and has rested.
    pub(super) fn standby(&self) -> bool {
        self.is_standing() && self.rest.is_none()
    }

    /// Whether it turns at the speed it was sent to.
    pub(super) fn at_speed(&self) -> bool {
        self.phase == Phase::Constant && matches!(self.order, Order::Follow(_) | Order::Crawl(_))
    }

    pub(super) fn phase(&self) -> Phase {
        self.phase
    }

    pub(super) fn standstill(&self) -> Option<Standstill> {
        self.standstill
    }

    /// The course that is followed.
    pub(super) fn course(&self) -> Option<Course> {
        if let Order::Follow(course) = self.order { Some(course) } else { None }
    }

    pub(super) fn direction(&self) -> Direction {
        self.axis.direction()
    }

    /// The speed without sign, in full steps a second.
    pub(super) fn speed(&self, now: Instant) -> f64 {
        self.axis.speed(now) / UNITS as f64
    }

    /// Units that the rotor has turned since power-up.
    pub(super) fn rotor(&self, now: Instant) -> i64 {
        self.axis.count(now)
    }

    pub(super) fn when_rotor_reaches(&self, place: i64) -> Option<Instant> {
        self.axis.when_reaches(place)
    }

    /// The rotor's units when the motion in progress, or one that waits for the end of the rest, ends as it is planned;
    /// `None` when there is none, and of a run.
    pub(super) fn destination(&self) -> Option<i64> {
        self.waiting.or_else(|| self.axis.destination())
    }

    /// `PACT` in full steps.
    pub(super) fn position(&self, now: Instant) -> f64 {
        wrap(self.axis.count(now).saturating_sub(self.zero)) as f64 / UNITS as f64
    }

    /// `PREL` in full steps.
    pub(super) fn relative(&self, now: Instant) -> f64 {
        wrap(self.axis.count(now).saturating_sub(self.relative_zero)) as f64 / UNITS as f64
    }

    // ---- inside

    /// Units to a position in full steps. Half-way round goes in reverse.
    fn distance_to(&self, now: Instant, position: i64) -> i64 {
        let here = self.axis.count(now).saturating_sub(self.zero);
        wrap(position.saturating_mul(UNITS).saturating_sub(here))
    }

    fn direction_of(&self, now: Instant, course: Course) -> Direction {
        match course {
            Course::Velocity(direction) => direction,
            Course::Position(target) => Direction::towards(self.axis.count(now), target),
        }
    }

    fn begin(&mut self, now: Instant, profile: &Profile, order: Order, direction: Direction) {
        self.waiting = None;
        if self.axis.is_standing() && self.gate.blocks(direction) {
            return;
        }
        self.order = order;
        self.apply(now, profile);
        self.settle(now, profile);
    }

    /// Puts the order to the axis. An order and limits that it has already change nothing.
    fn apply(&mut self, now: Instant, profile: &Profile) {
        match self.order {
            Order::Stand | Order::SoftStop => {}
            Order::Follow(Course::Velocity(direction)) => {
                self.axis.run(now, direction, FASTEST, &profile.velocity(profile.amax));
            }
            Order::Follow(Course::Position(target)) => {
                self.axis.move_to(now, target, &profile.positioning());
            }
            Order::Brake { course: Course::Velocity(_), .. } => {
                self.axis.brake(now, &profile.velocity(profile.dmax));
            }
            Order::Brake { course: Course::Position(_), .. } => {
                self.axis.brake(now, &profile.positioning());
            }
            Order::Crawl(direction) => {
                self.axis.run(now, direction, FASTEST, &profile.crawling());
            }
            Order::Steps(target) => {
                self.axis.move_to(now, target, &profile::external_steps());
            }
        }
    }

    /// Settles what follows from a wake-up or a command: limits that block, standstill, rest.
    fn settle(&mut self, now: Instant, profile: &Profile) {
        self.guard(now, profile);
        let before = core::mem::replace(&mut self.phase, self.axis.phase(now));
        if before != Phase::Stopped && self.phase == Phase::Stopped {
            self.standstill = Some(Standstill { since: now, from_constant: before == Phase::Constant });
        }
        if !self.axis.is_standing() {
            self.rest = None;
        } else if self.order != Order::Stand {
            let rest = if matches!(self.order, Order::Steps(_)) { STEP_STANDSTILL } else { profile.tzw };
            self.order = Order::Stand;
            self.rest = self.standstill.map(|still| still.since + rest).filter(|over| *over > now);
        }
    }

    /// Stops what moves towards an active limit, and forgets where it was going.
    fn guard(&mut self, now: Instant, profile: &Profile) {
        if self.axis.phase(now) == Phase::Stopped || !self.gate.blocks(self.axis.direction()) {
            return;
        }
        match self.order {
            Order::Follow(course) | Order::Brake { course, .. } if self.gate.soft => {
                self.order = Order::Brake { course, resumable: false };
                self.apply(now, profile);
            }
            Order::SoftStop if self.gate.soft => {}
            Order::Follow(_)
            | Order::Brake { .. }
            | Order::Crawl(_)
            | Order::Steps(_)
            | Order::SoftStop
            | Order::Stand => self.axis.halt(now),
        }
    }
}

/// A number of units as the counter shows it.
fn wrap(units: i64) -> i64 {
    let half = RING / 2;
    units.saturating_add(half).rem_euclid(RING).saturating_sub(half)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_counter_turns_over_at_32_bits() {
        assert_eq!(wrap((1 << 31) - 1), (1 << 31) - 1);
        assert_eq!(wrap(1 << 31), -(1 << 31));
        assert_eq!(wrap(-(1 << 31) - 1), (1 << 31) - 1);
        assert!((-(1 << 31)..1 << 31).contains(&wrap(i64::MAX)));
    }
}
