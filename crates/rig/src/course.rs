//! Groups brought forward together, to a time or to the first instant at which a condition holds.

use crate::condition::Condition;
use crate::group::Group;
use alloc::vec::Vec;
use core::time::Duration;
use stepdrive_spec::time::Instant;

/// The farthest apart that a flowing quantity is looked at between two events; the first looks are closer.
const FARTHEST_LOOK: Duration = Duration::from_millis(10);

/// The first look after an event.
const FIRST_LOOK: Duration = Duration::from_micros(1);

/// How far groups came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// The goal was reached at this instant, at which all groups stand.
    Reached(Instant),
    /// The time given is over, and all groups stand at its end.
    TimeOver,
    /// As much has happened as the budget allowed. All groups have got at least to this instant.
    OutOfBudget(Instant),
}

/// What groups are brought forward to.
#[derive(Clone, Copy, Debug)]
pub enum Goal<'a> {
    /// The end of the time given.
    Time,
    /// Until nothing will happen by itself. A motor that turns for ever, with no switch ahead, is no event.
    Idle,
    /// Until a condition holds. All drives that it looks at must be in the groups.
    Condition(&'a Condition),
}

/// Brings all `groups` forward to the first instant at which the goal is reached, or to `until`, doing at most `budget`
/// things, which is counted down.
///
/// A flag is seen at the very nanosecond at which it changes. Of a quantity that flows, such as a position, the instant
/// is found by bisection, to the nanosecond, between looks at most 10 ms apart: what comes and goes between two looks,
/// with nothing else happening, is not seen.
pub fn run(groups: &mut [&mut Group], goal: Goal<'_>, until: Instant, budget: &mut u32) -> Arrival {
    let arrival = match goal {
        Goal::Time => Arrival::TimeOver,
        Goal::Idle => until_idle(groups, until, budget),
        Goal::Condition(condition) => {
            let all = groups.iter_mut().map(|group| &mut **group);
            let mut concerned: Vec<&mut Group> = all.filter(|group| concerns(condition, group)).collect();
            until_it_holds(&mut concerned, condition, until, budget)
        }
    };
    let to = match arrival {
        Arrival::Reached(at) | Arrival::OutOfBudget(at) => at,
        Arrival::TimeOver => until,
    };
    if advance_all(groups, to, budget) { arrival } else { Arrival::OutOfBudget(slowest(groups, to)) }
}

/// Whether a condition looks at a drive of a group.
fn concerns(condition: &Condition, group: &Group) -> bool {
    condition.drives().any(|drive| group.members().iter().any(|member| member.drive() == drive))
}

/// Each group goes as far as anything happens in it; the last of those instants is when all are idle.
fn until_idle(groups: &mut [&mut Group], until: Instant, budget: &mut u32) -> Arrival {
    for group in groups.iter_mut() {
        while let Some(at) = group.next_wake().filter(|at| *at <= until) {
            if group.advance(at, budget) < at {
                return Arrival::OutOfBudget(slowest(groups, until));
            }
        }
    }
    if groups.iter().any(|group| group.next_wake().is_some()) {
        return Arrival::TimeOver;
    }
    Arrival::Reached(groups.iter().map(|group| group.now()).max().unwrap_or(until))
}

fn until_it_holds(
    groups: &mut [&mut Group],
    condition: &Condition,
    until: Instant,
    budget: &mut u32,
) -> Arrival {
    let mut now = groups.iter().map(|group| group.now()).max().unwrap_or(until);
    loop {
        if !advance_all(groups, now, budget) {
            return Arrival::OutOfBudget(slowest(groups, now));
        }
        if holds(groups, condition, now) {
            return Arrival::Reached(now);
        }
        if now >= until {
            return Arrival::TimeOver;
        }
        let next = groups.iter().filter_map(|group| group.next_wake()).min();
        let end = next.unwrap_or(Instant::FAR_FUTURE).min(until);
        now = match look_between(groups, condition, now, end, budget) {
            Look::Holds(at) => at,
            Look::Never => end,
            Look::OutOfBudget(at) => return Arrival::OutOfBudget(at),
        };
    }
}

/// Brings all groups to `to`; `false` when the budget is used up before.
fn advance_all(groups: &mut [&mut Group], to: Instant, budget: &mut u32) -> bool {
    groups.iter_mut().all(|group| group.advance(to, budget) >= to)
}

/// The time of the group that is behind, at most `to`.
fn slowest(groups: &[&mut Group], to: Instant) -> Instant {
    groups.iter().map(|group| group.now()).min().unwrap_or(to).min(to)
}

fn holds(groups: &[&mut Group], condition: &Condition, at: Instant) -> bool {
    let look = |drive, quantity| groups.iter().find_map(|group| group.look(drive, quantity, at));
    condition.holds(&mut |drive, quantity| look(drive, quantity).unwrap_or(0.0))
}

/// What was seen between two events.
enum Look {
    /// The condition holds from this instant on.
    Holds(Instant),
    /// It does not hold.
    Never,
    /// It does not hold up to this instant; nothing later was looked at.
    OutOfBudget(Instant),
}

/// Looks whether the condition comes to hold after `from` and before `to`, with nothing happening in between. A look
/// is paid for like an event.
fn look_between(
    groups: &[&mut Group],
    condition: &Condition,
    from: Instant,
    to: Instant,
    budget: &mut u32,
) -> Look {
    if !condition.flows() {
        return Look::Never;
    }
    let (mut before, mut pace) = (from, FIRST_LOOK);
    while before + pace < to {
        let after = before + pace;
        if *budget == 0 {
            return Look::OutOfBudget(before);
        }
        *budget -= 1;
        if holds(groups, condition, after) {
            return Look::Holds(bisect(groups, condition, before, after));
        }
        before = after;
        pace = pace.saturating_mul(2).min(FARTHEST_LOOK);
    }
    // The instant before something happens counts as well: a move ends at its target.
    let last = Instant::from_nanos(to.as_nanos().saturating_sub(1));
    if last > before && holds(groups, condition, last) {
        return Look::Holds(bisect(groups, condition, before, last));
    }
    Look::Never
}

/// The first instant at which the condition holds, after `before`, where it does not, up to `after`, where it does.
fn bisect(groups: &[&mut Group], condition: &Condition, before: Instant, after: Instant) -> Instant {
    let (mut before, mut after) = (before, after);
    while after.since(before) > Duration::from_nanos(1) {
        let middle = before + after.since(before) / 2;
        if holds(groups, condition, middle) {
            after = middle;
        } else {
            before = middle;
        }
    }
    after
}
