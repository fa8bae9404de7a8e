//! What became of a scenario.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::time::Duration;
use stepdrive_rig::duration;

/// What became of a scenario. It displays as text for people, a line a step.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Report {
    /// The scenario's name.
    pub name: String,
    /// Whether every step passed.
    pub passed: bool,
    /// When it began, in nanoseconds of rig time.
    pub began_ns: u64,
    /// When it ended, in nanoseconds of rig time.
    pub ended_ns: u64,
    /// The steps, all of them.
    pub steps: Vec<StepReport>,
}

/// What became of a step.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepReport {
    /// Its number, from 1.
    pub number: usize,
    /// Its name.
    pub name: String,
    /// When its `do` was done, in nanoseconds of rig time; `None` when it did not come to that.
    pub began_ns: Option<u64>,
    /// When it was over, in nanoseconds of rig time; `None` when it did not come to that.
    pub ended_ns: Option<u64>,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// What became of a step. In JSON it is `outcome`, with `why` for what went wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", content = "why", rename_all = "kebab-case")]
pub enum Outcome {
    /// All was done, and what was expected came.
    Passed,
    /// What was expected or waited for did not come. A sentence says what came instead.
    Failed(String),
    /// What was to be done could not be done. A sentence says why.
    CouldNot(String),
    /// The scenario ended before.
    Skipped,
}

/// Something that happened to a step.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepEvent {
    /// The step's number, from 1.
    pub number: usize,
    /// The step's name.
    pub name: String,
    /// When, in nanoseconds of rig time.
    pub now_ns: u64,
    /// What became of the step; `None` when it has begun.
    #[serde(flatten)]
    pub outcome: Option<Outcome>,
}

impl Outcome {
    /// What went wrong.
    pub fn why(&self) -> Option<&str> {
        match self {
            Outcome::Passed | Outcome::Skipped => None,
            Outcome::Failed(why) | Outcome::CouldNot(why) => Some(why),
        }
    }

    /// A sign and a word for it, of one width.
    const fn label(&self) -> &'static str {
        match self {
            Outcome::Passed => "✓ ok     ",
            Outcome::Failed(_) => "✗ FAILED ",
            Outcome::CouldNot(_) => "✗ ERROR  ",
            Outcome::Skipped => "- skipped",
        }
    }
}

impl Report {
    /// The report as `JUnit` XML, which continuous integration reads: a test suite with a test case a step. Times are rig
    /// time.
    pub fn to_junit(&self) -> String {
        super::junit::write(self)
    }

    /// How long something was after the scenario began.
    fn since(&self, nanos: u64) -> Duration {
        Duration::from_nanos(nanos.saturating_sub(self.began_ns))
    }
}

impl StepEvent {
    /// The event as a person reads it; `began_ns` is when the scenario began.
    pub fn text(&self, began_ns: u64) -> String {
        let at = duration::display(Duration::from_nanos(self.now_ns.saturating_sub(began_ns))).to_string();
        match &self.outcome {
            None => tame(&format!("… begins  {at:>12}  {}. {}", self.number, self.name)),
            Some(outcome) => line(outcome, &at, self.number, &self.name),
        }
    }
}

/// A line about a step, without anything that would disturb a terminal.
fn line(outcome: &Outcome, at: &str, number: usize, name: &str) -> String {
    let why = outcome.why().map_or(String::new(), |why| format!(": {why}"));
    tame(&format!("{} {at:>12}  {number}. {name}{why}", outcome.label()))
}

fn tame(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect()
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for step in &self.steps {
            let at = step.ended_ns.map(|at| duration::display(self.since(at)).to_string());
            writeln!(f, "{}", line(&step.outcome, at.as_deref().unwrap_or(""), step.number, &step.name))?;
        }
        let passed = self.steps.iter().filter(|step| step.outcome == Outcome::Passed).count();
        let verdict = if self.passed { "passed" } else { "FAILED" };
        let took = duration::display(self.since(self.ended_ns));
        let (name, count) = (tame(&self.name), self.steps.len());
        write!(f, "{verdict}: {name}, {passed} of {count} steps ok, {took} of rig time")
    }
}
