//! Scenarios: what is done to a rig, when, and what is expected of it, written down in TOML.
//!
//! ```toml
//! name = "the limit switch breaks while homing"
//! rig = "uhv.toml"           # for headless runs, beside the scenario; without it the demo rig
//! deadline = "10min"         # rig time for the whole; 1h by default
//! keep_going = false         # true: a step that fails does not end the scenario
//! password = "0x0123456789ABCDEF"   # of the SMSDs; the factory's by default
//!
//! [[step]]
//! name = "move out"          # for reports; by default what is done
//! at = "2s"                  # rig time since the start. Or:
//! # after = "500ms"          # after the step before has ended
//! # when = "stage.READY"     # as soon as this holds, after the step before has ended
//! do = ["input stage.IN0 1", "command stage GO_TO 5000"]
//! expect = "stage.ABS_POS >= 5000"
//! within = "5s"              # how long `expect` may take from the `do` on, and `when` from the step before on
//! ```
//!
//! A step has one of `at`, `after` and `when` at most, and `do` or `expect` at least. Without a time it comes as soon as
//! the step before has ended. Without `within`, `expect` must hold at once, and `when` may take until the deadline.
//! Conditions are those of [`stepdrive_rig::condition`]; they are met at the very nanosecond, as told in
//! [`stepdrive_rig::course::run`].
//!
//! What can be done is an action of [`stepdrive_rig::action`], or:
//!
//! | text | meaning |
//! |---|---|
//! | `clock MODE` | `real`, `x100`, `paused`: how rig time goes on; nothing in a headless run |
//! | `line DRIVE LINE` | sends a line to an SMD3 as a client does, as in `line uhv RUNR,1000` |
//! | `write DRIVE.REGISTER VALUE` | writes a register or coil of an SMSD; the value may be missing for a coil that acts |
//! | `command DRIVE COMMAND [OPERAND]` | writes the operand into `TARGET_POS`, `TARGET_SPEED` or `TARGET_INPUT`, then the command into `CMD` |
//!
//! The last three go over a connection of their own, which is recorded like any other, through whatever is wrong with the
//! drive's line. What the drive refuses fails the step, and so does no answer. When the refusal is the point, it is named
//! behind the rest: `line uhv STORE expecting -5`, `write stage.ACC 1 expecting 3` (the Modbus exception),
//! `command stage GO_ZERO expecting CMD_ERROR`.

mod act;
mod client;
mod headless;
mod junit;
mod player;
mod playing;
mod report;
mod send;
mod written;

pub use headless::{record_headless, run_headless};
pub use playing::{PlayError, Played, Playing};
pub use report::{Outcome, Report, StepEvent, StepReport};
pub use stepdrive_rig::file::Mistake;

pub(crate) use playing::begin;

use act::Act;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_rig::condition::Condition;
use stepdrive_rig::file::RigFile;

/// A scenario, checked against a rig.
#[derive(Clone, Debug)]
pub struct Scenario {
    name: String,
    /// Rig time for the whole.
    deadline: Duration,
    /// Whether a step that fails does not end it.
    keep_going: bool,
    /// What the SMSDs are logged in to with.
    password: u64,
    steps: Arc<[Step]>,
}

/// A step.
#[derive(Clone, Debug)]
struct Step {
    name: String,
    start: Start,
    within: Option<Duration>,
    acts: Vec<Act>,
    expect: Option<Condition>,
}

/// When a step begins.
#[derive(Clone, Debug)]
enum Start {
    /// When the step before has ended.
    AtOnce,
    /// This long after the scenario began.
    At(Duration),
    /// This long after the step before has ended.
    After(Duration),
    /// When this holds, after the step before has ended.
    When(Condition),
}

impl Scenario {
    /// Reads a scenario for a rig.
    ///
    /// # Errors
    /// The first mistake, with its place in `text`.
    pub fn parse(text: &str, rig: &RigFile) -> Result<Scenario, Mistake> {
        written::parse(text, rig)
    }

    /// The rig file that a scenario's text names for headless runs, relative to the scenario's own folder; `None` when it
    /// is for the demo rig.
    ///
    /// # Errors
    /// A mistake in the form of the file. What has to do with the rig is not looked at yet.
    pub fn rig_named(text: &str) -> Result<Option<String>, Mistake> {
        written::rig_named(text)
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The names of its steps, in order.
    pub fn steps(&self) -> impl Iterator<Item = &str> {
        self.steps.iter().map(|step| step.name.as_str())
    }
}
