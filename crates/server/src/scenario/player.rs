//! A scenario being played: each step at its own instant.

use super::act::Deed;
use super::client::{Client, Peer};
use super::report::{Outcome, Report, StepEvent, StepReport};
use super::send::Sending;
use super::{Scenario, Start, Step};
use crate::recording::{Entry, Happened};
use crate::world::World;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_rig::action::{Action, Change};
use stepdrive_rig::condition::Condition;
use stepdrive_rig::course::{self, Arrival, Goal};
use stepdrive_rig::duration;
use stepdrive_rig::file::{ClockMode, RigFile};
use stepdrive_rig::group::Group;
use stepdrive_spec::time::Instant;

/// A scenario being played. It does nothing by itself: [`Player::go_on`] lets time pass.
#[derive(Debug)]
pub(super) struct Player {
    scenario: Scenario,
    /// Whether `clock` is carried out.
    moves_clock: bool,
    /// When it began; before its first call the earliest time at which it may.
    begun: Instant,
    started: bool,
    phase: Phase,
    /// When the step before ended.
    ready: Instant,
    /// What became of the steps that are over.
    steps: Vec<StepReport>,
    events: Vec<StepEvent>,
    /// The connections of the present step.
    clients: Vec<Client>,
    over: Option<Instant>,
}

/// What the present step is at.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Its time has not come.
    Waiting,
    /// It began at this instant, and this is the number of what is to be done next, from 0.
    Doing(Instant, usize),
    /// It began at this instant, and what is expected has not come.
    Expecting(Instant),
}

/// How far the present step has come.
enum Progress {
    /// It goes on at the same instant.
    GoesOn,
    /// No farther: time has to pass, or the budget is used up.
    Waits,
    /// It is over.
    Ends(Outcome),
}

impl Player {
    /// Plays on a rig that nobody else has.
    pub(super) fn headless(scenario: Scenario) -> Player {
        Player::new(scenario, Instant::ZERO, false)
    }

    /// Plays on a running rig, from `now` on.
    pub(super) fn live(scenario: Scenario, now: Instant) -> Player {
        Player::new(scenario, now, true)
    }

    fn new(scenario: Scenario, begun: Instant, moves_clock: bool) -> Player {
        Player {
            scenario,
            moves_clock,
            begun,
            started: false,
            phase: Phase::Waiting,
            ready: begun,
            steps: Vec::new(),
            events: Vec::new(),
            clients: Vec::new(),
            over: None,
        }
    }

    /// The scenario.
    pub(super) fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Whether there is nothing left to do.
    pub(super) fn is_over(&self) -> bool {
        self.over.is_some()
    }

    /// When it must be called by then: the next step's time, or the end of the time that something may take.
    pub(super) fn next_due(&self) -> Option<Instant> {
        self.step().map(|step| match self.phase {
            Phase::Waiting => self.start_of(step).min(self.end()),
            Phase::Doing(at, _) => at,
            Phase::Expecting(began) => self.end_of_expecting(step, began),
        })
    }

    /// Whether it waits for something that may come without anything happening, as a position does.
    pub(super) fn watches(&self) -> bool {
        let condition = self.step().and_then(|step| match (self.phase, &step.start) {
            (Phase::Waiting, Start::When(condition)) => Some(condition),
            (Phase::Expecting(_), _) => step.expect.as_ref(),
            (Phase::Waiting | Phase::Doing(..), _) => None,
        });
        condition.is_some_and(Condition::flows)
    }

    /// Whether something has happened since it was asked last.
    pub(super) fn has_news(&self) -> bool {
        !self.events.is_empty()
    }

    /// What has happened since it was asked last.
    pub(super) fn take_events(&mut self) -> Vec<StepEvent> {
        std::mem::take(&mut self.events)
    }

    /// What became of it; of steps that have not ended, that they were skipped.
    pub(super) fn report(&self) -> Report {
        let left = self.scenario.steps.iter().enumerate().skip(self.steps.len());
        let skipped = left.map(|(place, step)| StepReport {
            number: place + 1,
            name: step.name.clone(),
            began_ns: None,
            ended_ns: None,
            outcome: Outcome::Skipped,
        });
        let steps: Vec<StepReport> = self.steps.iter().cloned().chain(skipped).collect();
        Report {
            name: self.scenario.name.clone(),
            passed: steps.iter().all(|step| step.outcome == Outcome::Passed),
            began_ns: self.begun.as_nanos(),
            ended_ns: self.over.unwrap_or(self.ready).as_nanos(),
            steps,
        }
    }

    /// Brings all groups to `to`, doing what is to be done on the way, or as far as `budget` allows, which is counted
    /// down. It stops where the scenario is over.
    pub(super) fn go_on(&mut self, world: &World, groups: &mut [&mut Group], to: Instant, budget: &mut u32) {
        if !self.started {
            self.started = true;
            self.begun = groups.iter().map(|group| group.now()).fold(self.begun, Instant::max);
            self.ready = self.begun;
        }
        let steps = Arc::clone(&self.scenario.steps);
        while let Some(step) = steps.get(self.steps.len()).filter(|_| self.over.is_none()) {
            let progress = match self.phase {
                Phase::Waiting => self.wait(step, world.rig(), groups, to, budget),
                Phase::Doing(at, next) => self.act(step, world, groups, (at, next), budget),
                Phase::Expecting(began) => self.expect(step, began, world.rig(), groups, to, budget),
            };
            match progress {
                Progress::GoesOn => {}
                Progress::Waits => return,
                Progress::Ends(outcome) => self.end_step(world, step, now_of(groups), outcome),
            }
        }
    }

    fn step(&self) -> Option<&Step> {
        self.scenario.steps.get(self.steps.len()).filter(|_| self.over.is_none())
    }

    /// When the whole must be over.
    fn end(&self) -> Instant {
        self.begun + self.scenario.deadline
    }

    /// When the step begins, or the end of the time that this may take.
    fn start_of(&self, step: &Step) -> Instant {
        match step.start {
            Start::AtOnce => self.ready,
            Start::At(at) => self.begun + at,
            Start::After(after) => self.ready + after,
            Start::When(_) => step.within.map_or(self.end(), |within| self.ready + within),
        }
    }

    fn end_of_expecting(&self, step: &Step, began: Instant) -> Instant {
        (began + step.within.unwrap_or_default()).min(self.end())
    }

    /// Waits for the step's time.
    fn wait(
        &mut self,
        step: &Step,
        rig: &RigFile,
        groups: &mut [&mut Group],
        to: Instant,
        budget: &mut u32,
    ) -> Progress {
        let start = self.start_of(step);
        if start < self.ready {
            let (start, ready) = (self.since(start), self.since(self.ready));
            let why = format!("it was to be at {start}, but the step before ended only at {ready}");
            return Progress::Ends(Outcome::CouldNot(why));
        }
        let limit = start.min(self.end());
        let goal = match &step.start {
            Start::When(condition) => Goal::Condition(condition),
            Start::AtOnce | Start::At(_) | Start::After(_) => Goal::Time,
        };
        match (course::run(groups, goal, limit.min(to), budget), &step.start) {
            (Arrival::OutOfBudget(_), _) => Progress::Waits,
            (Arrival::TimeOver, _) if to < limit => Progress::Waits,
            (Arrival::TimeOver, Start::When(condition)) => {
                Progress::Ends(Outcome::Failed(self.did_not_come(condition, step.within, limit, rig, groups)))
            }
            (Arrival::TimeOver, _) if self.end() < start => {
                let (start, deadline) = (self.since(start), duration::display(self.scenario.deadline));
                let why = format!("it was to be at {start}, after the scenario's deadline of {deadline}");
                Progress::Ends(Outcome::CouldNot(why))
            }
            (Arrival::TimeOver | Arrival::Reached(_), _) => {
                let at = now_of(groups);
                self.tell(step, at, None);
                self.phase = Phase::Doing(at, 0);
                Progress::GoesOn
            }
        }
    }

    /// Does the next of what the step does.
    fn act(
        &mut self,
        step: &Step,
        world: &World,
        groups: &mut [&mut Group],
        (began, next): (Instant, usize),
        budget: &mut u32,
    ) -> Progress {
        let Some(act) = step.acts.get(next) else {
            self.leave(world, began);
            self.phase = Phase::Expecting(began);
            return Progress::GoesOn;
        };
        // What was done before may have effects at the same instant: they come first, as they would from a client.
        if groups.iter_mut().any(|group| group.advance(began, budget) < began || is_due(group, began)) {
            return Progress::Waits;
        }
        let done = match act.what() {
            Deed::Clock(mode) => {
                self.set_clock(world, began, *mode);
                Ok(())
            }
            Deed::Rig(action) => {
                self.apply(world, groups, action);
                Ok(())
            }
            Deed::Send(sending) => match peer(world, groups, sending.drive) {
                Some(mut peer) => self.send(&mut peer, sending),
                None => Err("there is no such drive".to_owned()),
            },
        };
        if let Err(why) = done {
            return Progress::Ends(Outcome::CouldNot(format!("`{}`: {why}", act.text())));
        }
        self.phase = Phase::Doing(began, next + 1);
        Progress::GoesOn
    }

    fn set_clock(&self, world: &World, at: Instant, mode: ClockMode) {
        if self.moves_clock {
            world.clock().set_mode(mode);
            world.write(|| Entry::new(at, Happened::Clock(mode.to_string())));
        }
    }

    fn apply(&mut self, world: &World, groups: &mut [&mut Group], action: &Action) {
        let Some(drive) = action.drive(world.rig()) else { return };
        let Some(peer) = peer(world, groups, drive) else { return };
        world.apply_to(peer.group, action);
        if let Action::Drive { change: Change::Power(_), .. } = action {
            // Whoever was connected is not any more.
            let now = peer.group.now();
            let gone = self.clients.extract_if(.., |client| client.drive() == drive);
            gone.for_each(|client| client.shut(world, now));
        }
    }

    fn send(&mut self, peer: &mut Peer<'_>, sending: &Sending) -> Result<(), String> {
        let sent = self.client(peer, sending.drive).and_then(|client| client.send(peer, sending));
        peer.world.look_after(sending.drive);
        sent
    }

    /// The step's connection to a drive.
    fn client(&mut self, peer: &mut Peer<'_>, drive: usize) -> Result<&mut Client, String> {
        let known = self.clients.iter().position(|client| client.drive() == drive);
        let place = known.unwrap_or(self.clients.len());
        if known.is_none() {
            let (client, connected) = Client::connect(peer, drive, self.scenario.password);
            // Also one that was not let in has to leave.
            self.clients.push(client);
            connected?;
        }
        self.clients.get_mut(place).ok_or_else(String::new)
    }

    fn leave(&mut self, world: &World, now: Instant) {
        self.clients.drain(..).for_each(|client| client.shut(world, now));
    }

    /// Waits for what the step expects.
    fn expect(
        &mut self,
        step: &Step,
        began: Instant,
        rig: &RigFile,
        groups: &mut [&mut Group],
        to: Instant,
        budget: &mut u32,
    ) -> Progress {
        let Some(condition) = &step.expect else { return Progress::Ends(Outcome::Passed) };
        let limit = self.end_of_expecting(step, began);
        match course::run(groups, Goal::Condition(condition), limit.min(to), budget) {
            Arrival::Reached(_) => Progress::Ends(Outcome::Passed),
            Arrival::OutOfBudget(_) => Progress::Waits,
            Arrival::TimeOver if to < limit => Progress::Waits,
            Arrival::TimeOver => Progress::Ends(Outcome::Failed(self.not_as_expected(
                condition,
                step.within,
                limit,
                rig,
                groups,
            ))),
        }
    }

    fn did_not_come(
        &self,
        condition: &Condition,
        within: Option<Duration>,
        limit: Instant,
        rig: &RigFile,
        groups: &[&mut Group],
    ) -> String {
        let values = self.values(condition, rig, groups);
        format!("{condition} did not come {}: {values}", self.in_what_time(within, limit))
    }

    fn not_as_expected(
        &self,
        condition: &Condition,
        within: Option<Duration>,
        limit: Instant,
        rig: &RigFile,
        groups: &[&mut Group],
    ) -> String {
        let values = self.values(condition, rig, groups);
        match within {
            None | Some(Duration::ZERO) => format!("expected {condition}: {values}"),
            within => format!("expected {condition} {}: {values}", self.in_what_time(within, limit)),
        }
    }

    /// How long something might take that had to come until `limit`.
    fn in_what_time(&self, within: Option<Duration>, limit: Instant) -> String {
        match within.filter(|_| limit < self.end()) {
            Some(within) => format!("within {}", duration::display(within)),
            None => {
                format!("before the scenario's deadline of {}", duration::display(self.scenario.deadline))
            }
        }
    }

    /// The values for which a condition does not hold, and when that was.
    fn values(&self, condition: &Condition, rig: &RigFile, groups: &[&mut Group]) -> String {
        let now = now_of(groups);
        let mut values: Vec<String> = Vec::new();
        condition.holds(&mut |drive, quantity| {
            let value = groups.iter().find_map(|group| group.look(drive, quantity, now)).unwrap_or(0.0);
            let name = rig.drives.get(drive).map_or("", |drive| &drive.name);
            let told = format!("{name}.{quantity} was {value}");
            if !values.contains(&told) {
                values.push(told);
            }
            value
        });
        format!("{} at {}", values.join(" and "), self.since(now))
    }

    fn since(&self, at: Instant) -> String {
        duration::display(at.since(self.begun)).to_string()
    }

    fn tell(&mut self, step: &Step, at: Instant, outcome: Option<Outcome>) {
        let (number, name) = (self.steps.len() + 1, step.name.clone());
        self.events.push(StepEvent { number, name, now_ns: at.as_nanos(), outcome });
    }

    /// The step is over: the next one follows, unless that was the last or ends the whole.
    fn end_step(&mut self, world: &World, step: &Step, at: Instant, outcome: Outcome) {
        self.leave(world, at);
        self.tell(step, at, Some(outcome.clone()));
        let began_ns = match self.phase {
            Phase::Waiting => None,
            Phase::Doing(began, _) | Phase::Expecting(began) => Some(began.as_nanos()),
        };
        let goes_on = outcome == Outcome::Passed || self.scenario.keep_going && at < self.end();
        let (number, name) = (self.steps.len() + 1, step.name.clone());
        self.steps.push(StepReport { number, name, began_ns, ended_ns: Some(at.as_nanos()), outcome });
        self.phase = Phase::Waiting;
        self.ready = at;
        if !goes_on || self.steps.len() == self.scenario.steps.len() {
            self.over = Some(at);
        }
    }
}

/// The time at which all groups stand.
fn now_of(groups: &[&mut Group]) -> Instant {
    groups.iter().map(|group| group.now()).max().unwrap_or(Instant::ZERO)
}

fn is_due(group: &Group, at: Instant) -> bool {
    group.next_wake().is_some_and(|wake| wake <= at)
}

/// A drive among all groups.
fn peer<'a>(world: &'a World, groups: &'a mut [&mut Group], drive: usize) -> Option<Peer<'a>> {
    let group = groups.get_mut(world.group_of(drive))?;
    let member = group.members().iter().position(|member| member.drive() == drive)?;
    Some(Peer { world, group, member })
}
