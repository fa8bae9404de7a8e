//! An axis: legs put together into runs, moves, reversals and stops.

use crate::leg::{Direction, Leg};
use crate::limits::clamp;
use crate::profile::{Crossing, Profile};
use crate::segment::Phase;
use crate::{FASTEST, Limits};
use core::time::Duration;
use stepdrive_spec::time::Instant;

/// The largest count an axis starts at or is sent to, either side of zero: 2^52, so that every count is an exact `f64`.
pub const MAX_COUNT: i64 = 1 << 52;

/// What an axis is trying to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// To stand, or to come to a standstill.
    Stand,
    /// To run for ever, at [`Limits::run_speed`] of `speed`.
    Run {
        /// The direction to run in.
        direction: Direction,
        /// The speed asked for, in counts per second, not yet limited.
        speed: f64,
    },
    /// To stand at this count.
    MoveTo(i64),
}

/// The motion of one axis on the rig's clock.
///
/// The methods fall into three groups.
///
/// *Commands*: [`Axis::run`], [`Axis::move_to`], [`Axis::brake`], [`Axis::halt`], [`Axis::set_limits`]. Each takes the
/// instant at which it happens and the limits that hold from then on, first lives through everything due by then, and
/// is accepted in any state. A command that changes neither goal nor limits changes nothing. An instant earlier than
/// the latest one seen is taken as that one.
///
/// *Time*: [`Axis::next_wake`] says when the axis next changes phase by itself, [`Axis::handle_wake`] makes it so. The
/// order is: after every command and every wake, ask `next_wake`; at that instant call `handle_wake`; then inspect.
/// After `handle_wake(now)` the next wake is later than `now`. Waking late is allowed: what was due happens at its own
/// instant, in order.
///
/// *Inspection* looks at any instant from [`Axis::leg_start`] to [`Axis::next_wake`] and changes nothing. The present
/// leg answers: earlier instants see its start, later ones its end.
///
/// ```
/// use core::time::Duration;
/// use stepdrive_motion::{Axis, Limits};
/// use stepdrive_spec::time::Instant;
///
/// let limits = Limits { start: 0.0, stop: 0.0, max: 1e3, acc: 1e3, dec: 1e3, zero_wait: Duration::ZERO };
/// let mut axis = Axis::new(0);
/// axis.move_to(Instant::ZERO, 2000, &limits);
/// assert_eq!(axis.when_reaches(500), Some(Instant::from_nanos(1_000_000_000)));
/// while let Some(wake) = axis.next_wake() {
///     axis.handle_wake(wake);
/// }
/// assert_eq!(axis.count(Instant::from_nanos(3_000_000_000)), 2000);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    goal: Goal,
    limits: Limits,
    /// The latest instant that was lived through.
    now: Instant,
    /// The motion in progress; `None` at a standstill.
    leg: Option<Leg>,
    /// The count at the last standstill.
    count: i64,
    /// The direction of the motion in progress or of the last one.
    direction: Direction,
    /// When the last motion ended.
    stopped: Option<Instant>,
    /// When the standstill before a start in the other direction is over; `None` when nothing waits for that.
    resume: Option<Instant>,
}

impl Axis {
    /// An axis that stands at `count`, clamped to ±[`MAX_COUNT`].
    pub fn new(count: i64) -> Axis {
        let still = Limits { start: 0.0, stop: 0.0, max: 0.0, acc: 0.0, dec: 0.0, zero_wait: Duration::ZERO };
        Axis {
            goal: Goal::Stand,
            limits: still.sane(),
            now: Instant::ZERO,
            leg: None,
            count: within_reach(count),
            direction: Direction::Forward,
            stopped: None,
            resume: None,
        }
    }

    /// Runs in `direction` at [`Limits::run_speed`] of `speed` until told otherwise. In the same direction the speed
    /// changes at the limits' accelerations; against it the axis brakes to a standstill first.
    pub fn run(&mut self, now: Instant, direction: Direction, speed: f64, limits: &Limits) {
        self.command(now, Goal::Run { direction, speed: clamp(speed, 0.0, FASTEST) }, limits);
    }

    /// Goes to `target`, clamped to ±[`MAX_COUNT`], and stands there. An axis that turns away from it, or is too fast
    /// to stop there, brakes to a standstill and returns.
    pub fn move_to(&mut self, now: Instant, target: i64, limits: &Limits) {
        self.command(now, Goal::MoveTo(within_reach(target)), limits);
    }

    /// Brakes to a standstill.
    pub fn brake(&mut self, now: Instant, limits: &Limits) {
        self.command(now, Goal::Stand, limits);
    }

    /// Stands at once, at the present count.
    pub fn halt(&mut self, now: Instant) {
        self.handle_wake(now);
        self.goal = Goal::Stand;
        self.resume = None;
        self.stand(self.now);
    }

    /// Goes on with what is in progress under other limits.
    pub fn set_limits(&mut self, now: Instant, limits: &Limits) {
        // The goal may be reached by `now`, and then is not taken up again.
        self.handle_wake(now);
        self.command(now, self.goal, limits);
    }

    /// The next instant at which the axis changes phase by itself: the end of a segment, of a leg, of the standstill
    /// before a start in the other direction. `None` while it stands or cruises with nothing more to come.
    pub fn next_wake(&self) -> Option<Instant> {
        self.leg.as_ref().map_or(self.resume, |leg| leg.next_boundary(self.now))
    }

    /// Lives through everything due by `now`: legs end, wait and start at their own instants.
    pub fn handle_wake(&mut self, now: Instant) {
        while let Some(due) = self.next_turn().filter(|&due| due <= now) {
            self.now = self.now.max(due);
            self.resume = None;
            self.stand(due);
            self.set_off(due);
        }
        self.now = self.now.max(now);
    }

    /// The count the rotor stands at or has last emitted.
    pub fn count(&self, at: Instant) -> i64 {
        self.leg.as_ref().map_or(self.count, |leg| leg.count(at))
    }

    /// The speed, without sign, in counts per second.
    pub fn speed(&self, at: Instant) -> f64 {
        self.leg.as_ref().map_or(0.0, |leg| leg.speed(at))
    }

    /// What the generator is doing.
    pub fn phase(&self, at: Instant) -> Phase {
        self.leg.as_ref().map_or(Phase::Stopped, |leg| leg.phase(at))
    }

    /// The direction of the motion in progress; at a standstill, of the last one; forward before the first. At a
    /// reversal it changes when the axis starts in the other direction.
    pub fn direction(&self) -> Direction {
        self.direction
    }

    /// What the axis is trying to do. A move that has arrived has become [`Goal::Stand`].
    pub fn goal(&self) -> Goal {
        self.goal
    }

    /// The count at which the motion in progress, or one that waits for its turn, will stand as it is planned; `None` when
    /// there is none, and of a run.
    pub fn destination(&self) -> Option<i64> {
        match (self.goal, &self.leg) {
            (Goal::MoveTo(target), _) => Some(target),
            (Goal::Stand, Some(leg)) => leg.end().map(|end| leg.count(end)),
            (Goal::Stand, None) | (Goal::Run { .. }, _) => None,
        }
    }

    /// Whether the axis stands with nothing left to do. The standstill at a reversal is not that.
    pub fn is_standing(&self) -> bool {
        self.leg.is_none() && self.resume.is_none()
    }

    /// Whether the last command is done: a run turns in its direction at its speed, anything else stands.
    pub fn is_settled(&self, at: Instant) -> bool {
        match self.goal {
            Goal::Run { direction, .. } if self.leg.is_some() => {
                self.direction == direction && self.phase(at) == Phase::Constant
            }
            Goal::Run { .. } | Goal::Stand | Goal::MoveTo(_) => self.is_standing(),
        }
    }

    /// When the present leg or standstill began; a leg begins anew with every command that changes it.
    pub fn leg_start(&self) -> Instant {
        self.leg.as_ref().map_or(self.stopped.unwrap_or_default(), |leg| leg.start)
    }

    /// The plan of the present leg, `None` at a standstill: what [`crate::check`] judges.
    pub fn profile(&self) -> Option<&Profile> {
        self.leg.as_ref().map(|leg| &leg.profile)
    }

    /// When the present leg will emit `count`, as the first instant at which [`Axis::count`] has come to it; `None` when
    /// that count is behind, present, emitted already, or past the end of the leg. A leg that comes after this one is not
    /// looked at: ask again after each wake and each command.
    pub fn when_reaches(&self, count: i64) -> Option<Instant> {
        self.leg.as_ref()?.when_reaches(count).filter(|&at| at > self.now)
    }

    /// On which side of `speed` (counts per second, 0 or more) the axis is at `at`, and since when within the present
    /// leg. Where [`Crossing::since`] is `None` the side is the one at [`Axis::leg_start`]; ask before a command to
    /// carry an older instant over.
    pub fn crossing(&self, at: Instant, speed: f64) -> Crossing<Instant> {
        self.leg.as_ref().map_or(Crossing { above: false, since: None }, |leg| leg.crossing(at, speed))
    }

    fn command(&mut self, now: Instant, goal: Goal, limits: &Limits) {
        self.handle_wake(now);
        let limits = limits.sane();
        if goal == self.goal && limits == self.limits {
            return;
        }
        self.goal = goal;
        self.limits = limits;
        self.resume = None;
        self.replan(self.now);
    }

    /// Plans anew from the state the axis is in.
    fn replan(&mut self, now: Instant) {
        if let Some(leg) = &self.leg {
            let origin = leg.count(now);
            let profile = self.onward(leg.direction, origin, leg.fraction(now), leg.speed(now));
            if !profile.is_empty() {
                self.leg = Some(Leg { start: now, origin, direction: leg.direction, profile });
                return;
            }
        }
        self.stand(now);
        self.set_off(now);
    }

    /// What to do while turning in `direction`, `s0` past `count` at the speed `v0`: towards the goal, or brake.
    fn onward(&self, direction: Direction, count: i64, s0: f64, v0: f64) -> Profile {
        let towards_goal = match self.goal {
            Goal::Run { direction: wanted, speed } if wanted == direction => {
                Some(Profile::run(s0, v0, speed, &self.limits))
            }
            Goal::MoveTo(target) => {
                direction.ahead(count, target).and_then(|n| Profile::distance(s0, v0, n, &self.limits))
            }
            Goal::Run { .. } | Goal::Stand => None,
        };
        towards_goal.unwrap_or_else(|| Profile::brake(s0, v0, &self.limits))
    }

    /// Starts towards the goal from a standstill, or waits until the other direction is allowed.
    fn set_off(&mut self, now: Instant) {
        let (direction, profile) = self.first_leg();
        if profile.is_empty() {
            self.goal = Goal::Stand;
            return;
        }
        if direction != self.direction
            && let Some(rested) = self.rested().filter(|&rested| rested > now)
        {
            self.resume = Some(rested);
            return;
        }
        self.direction = direction;
        self.leg = Some(Leg { start: now, origin: self.count, direction, profile });
    }

    /// When the axis may start in the other direction, unless it never moved.
    #[expect(clippy::arithmetic_side_effects, reason = "an Instant saturates at the end of the clock")]
    fn rested(&self) -> Option<Instant> {
        self.stopped.map(|stopped| stopped + self.limits.zero_wait)
    }

    /// The first leg towards the goal from a standstill; empty when there is nothing to do.
    fn first_leg(&self) -> (Direction, Profile) {
        let stay = || Profile::brake(0.0, 0.0, &self.limits);
        match self.goal {
            Goal::Stand => (self.direction, stay()),
            Goal::Run { direction, speed } => (direction, Profile::run(0.0, 0.0, speed, &self.limits)),
            Goal::MoveTo(target) => {
                let way = Profile::distance(0.0, 0.0, self.count.abs_diff(target), &self.limits);
                (Direction::towards(self.count, target), way.unwrap_or_else(stay))
            }
        }
    }

    /// Ends the motion in progress, if there is one, where it is at `at`.
    fn stand(&mut self, at: Instant) {
        if let Some(leg) = self.leg.take() {
            self.count = leg.count(at);
            self.stopped = Some(at);
        }
    }

    /// The next instant at which a leg ends or may start.
    fn next_turn(&self) -> Option<Instant> {
        self.leg.as_ref().map_or(self.resume, Leg::end)
    }
}

/// `count` within ±[`MAX_COUNT`].
fn within_reach(count: i64) -> i64 {
    count.clamp(-MAX_COUNT, MAX_COUNT)
}
