//! The rig under control: its clock, its world, and what can be seen of it.
//!
//! The control API and scenarios go through here.

use crate::recording::{Entry, Happened, state_digest};
use crate::scenario::{self, PlayError, Playing};
use crate::world::World;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_rig::action::{Action, ActionError};
use stepdrive_rig::condition::{Condition, ConditionError};
use stepdrive_rig::course::{self, Arrival, Goal};
use stepdrive_rig::file::{ClockMode, RigFile};
use stepdrive_rig::group::Group;
use stepdrive_spec::time::Instant;

/// The most that may happen in the rig before whoever else waits for it gets a turn: some milliseconds of computing.
const SLICE: u32 = 50_000;

/// How long whoever else waits for the rig has for its turn: a lock that is taken again at once is seldom had by another.
const TURN: Duration = Duration::from_millis(1);

/// Controls a running rig. Clones control the same one.
#[derive(Clone)]
pub struct Control {
    world: Arc<World>,
    /// The turn to move rig time: one at a time.
    turn: Arc<tokio::sync::Mutex<()>>,
}

impl fmt::Debug for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control").finish_non_exhaustive()
    }
}

/// What rig time is to be moved to.
#[derive(Clone, Debug)]
pub enum Until {
    /// The end of the time given.
    Time,
    /// When nothing will happen by itself.
    Idle,
    /// When a condition holds.
    Condition(Condition),
}

impl Until {
    /// Reads `idle`, or a condition.
    ///
    /// # Errors
    /// The text is neither.
    pub fn parse(text: &str, rig: &RigFile) -> Result<Until, ConditionError> {
        match text.trim() {
            "idle" => Ok(Until::Idle),
            condition => Condition::parse(condition, rig).map(Until::Condition),
        }
    }

    fn goal(&self) -> Goal<'_> {
        match self {
            Until::Time => Goal::Time,
            Until::Idle => Goal::Idle,
            Until::Condition(condition) => Goal::Condition(condition),
        }
    }
}

/// How moving rig time ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moved {
    /// The rig time now.
    pub now: Instant,
    /// Whether what it was moved to was reached, and not only the end of the time given.
    pub reached: bool,
}

impl Control {
    /// Controls this rig.
    pub(crate) fn new(world: Arc<World>) -> Control {
        Control { world, turn: Arc::default() }
    }

    /// The rig file.
    pub fn rig(&self) -> &RigFile {
        self.world.rig()
    }

    /// The present rig time.
    pub fn now(&self) -> Instant {
        self.world.clock().now()
    }

    /// How rig time passes.
    pub fn clock(&self) -> ClockMode {
        self.world.clock().mode()
    }

    /// How much of the speed that was asked for is reached: 1 is all of it.
    pub fn speed_reached(&self) -> f64 {
        self.world.clock().reached()
    }

    /// Lets rig time pass as `mode` says from now on. Nothing jumps.
    pub fn set_clock(&self, mode: ClockMode) {
        let at = self.world.clock().set_mode(mode);
        self.world.write(|| Entry::new(at, Happened::Clock(mode.to_string())));
    }

    /// Moves rig time forward as fast as this computer can, and leaves the clock paused there: to what is given, or for
    /// `within` at most. Clients are answered meanwhile.
    ///
    /// Whoever sets the clock meanwhile ends it. While a scenario is played only a time can be moved to, since conditions are the scenario's then: `None`.
    pub async fn run(&self, until: &Until, within: Duration) -> Option<Moved> {
        let _turn = self.turn.lock().await;
        self.set_clock(ClockMode::Paused);
        let end = self.now() + within;
        let moved = match (self.run_until(until.goal(), end).await, until) {
            (Some(moved), Until::Time) => Moved { reached: moved.now >= end, ..moved },
            (Some(moved), Until::Idle | Until::Condition(_)) => moved,
            (None, Until::Time) => self.play_to(end).await,
            (None, Until::Idle | Until::Condition(_)) => return None,
        };
        self.world.write(|| Entry::new(moved.now, Happened::Clock(format!("stepped to {}", moved.now))));
        Some(moved)
    }

    /// Carries out an action now, as in [`stepdrive_rig::action`].
    ///
    /// # Errors
    /// The text is none.
    pub fn act(&self, text: &str) -> Result<(), ActionError> {
        let action = Action::parse(text, self.rig())?;
        self.world.apply(&action);
        Ok(())
    }

    /// Plays a scenario from now on, in step with the rig's clock: while that is paused, the scenario waits until it goes
    /// on or is moved. Must be called in a tokio runtime. What comes of it is told by what is returned; dropping that ends
    /// the scenario.
    ///
    /// # Errors
    /// There is a mistake in it, or another one is being played.
    pub fn play(&self, text: &str) -> Result<Playing, PlayError> {
        scenario::begin(&self.world, text)
    }

    /// The name of the scenario that is being played.
    pub fn playing(&self) -> Option<String> {
        self.world.playing()
    }

    /// Looks at the rig as it is now; `look` is given each group, brought up to its time.
    pub fn each_group(&self, mut look: impl FnMut(&Group)) {
        for number in 0..self.world.groups() {
            self.world.visit_group(number, |group| look(group));
        }
    }

    /// Ends the recording with the state of the rig, if one is made.
    pub(crate) fn end_recording(&self) {
        let Some(recorder) = self.world.recorder() else { return };
        self.world.clock().set_mode(ClockMode::Paused);
        self.world.visit_all(|groups| {
            let end = groups.iter().map(|group| group.now()).max().unwrap_or(Instant::ZERO);
            while course::run(groups, Goal::Time, end, &mut SLICE.clone()) != Arrival::TimeOver {}
            let digest = state_digest(self.rig(), groups.iter().map(|group| &**group));
            recorder.end(end, digest);
        });
    }

    /// Lets the scenario that is played bring the rig to `end`.
    async fn play_to(&self, end: Instant) -> Moved {
        while self.jump_to(end) {
            let behind = self.world.visit_all(|groups| groups.iter().any(|group| group.now() < end));
            if !behind {
                return Moved { now: end, reached: true };
            }
            tokio::time::sleep(TURN).await;
        }
        Moved { now: self.now(), reached: false }
    }

    /// Moves the clock; `false` when somebody has set it going.
    fn jump_to(&self, to: Instant) -> bool {
        self.now() >= to && self.clock() == ClockMode::Paused || self.world.clock().jump_to(to).is_ok()
    }

    /// The clock follows the machines, so that whoever visits them meanwhile finds them up to its time. `None` while a
    /// scenario is played.
    async fn run_until(&self, goal: Goal<'_>, end: Instant) -> Option<Moved> {
        loop {
            let arrival = self.world.visit_unplayed(|groups| {
                let arrival = course::run(groups, goal, end, &mut SLICE.clone());
                let to = match arrival {
                    Arrival::Reached(at) | Arrival::OutOfBudget(at) => at,
                    Arrival::TimeOver => end,
                };
                self.jump_to(to).then_some(arrival)
            })?;
            match arrival {
                Some(Arrival::Reached(now)) => return Some(Moved { now, reached: true }),
                Some(Arrival::TimeOver) => return Some(Moved { now: end, reached: false }),
                Some(Arrival::OutOfBudget(_)) => tokio::time::sleep(TURN).await,
                None => return Some(Moved { now: self.now(), reached: false }),
            }
        }
    }
}
