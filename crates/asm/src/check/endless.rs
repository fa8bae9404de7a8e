//! Loops that can neither end nor wait.

use super::Check;
use super::graph::{Graph, NODES, Step, place};
use super::motor::takes_time;
use super::walk::Walk;
use crate::diagnostic::Code;

/// Reports every place where a program can only go round and round without doing anything that takes time.
///
/// An instruction is stuck when no path from it leads to an end, a wait or a motion, nor back to its caller. From a
/// stuck instruction all ways lead to stuck ones, so following any one of them must come round.
pub(super) fn check(check: &mut Check<'_>, graph: &Graph<'_>, walk: &Walk) {
    let rests = spread(
        graph,
        |node| rests(graph, node),
        |step| match step {
            Step::Goes(next) => next.clone(),
            Step::Calls(target, behind) => target.iter().chain(behind).copied().collect(),
            Step::Starts(target) => target.iter().copied().collect(),
            Step::Ends | Step::Returns => Vec::new(),
        },
    );
    let returns = spread(
        graph,
        |node| matches!(graph.at(node), Step::Returns),
        |step| match step {
            Step::Goes(behind) | Step::Calls(_, behind) => behind.clone(),
            Step::Ends | Step::Returns | Step::Starts(_) => Vec::new(),
        },
    );
    let is_stuck = |node: &usize| !rests[*node] && !returns[*node];
    let stuck: Vec<usize> = walk.nodes().filter(is_stuck).collect();
    for (last, first) in rounds(graph, &stuck) {
        let labels = [(place(last), "goes round"), (place(first), "from here")];
        let help = "give it a wait or a way out; `END` leaves the motor as it is";
        check.warn(Code::EndlessLoop, "this loop can neither end nor wait", &labels, help);
    }
}

/// `true` when the program may end here, or rest.
fn rests(graph: &Graph<'_>, node: usize) -> bool {
    let ends = match graph.at(node) {
        Step::Ends | Step::Starts(None) => true,
        Step::Goes(_) | Step::Calls(..) | Step::Returns | Step::Starts(Some(_)) => false,
    };
    ends || graph.runs_off(place(node))
        || graph.lost_jump(place(node)).is_some()
        || graph.instruction(node).is_some_and(takes_time)
}

/// The nodes from which a path leads to one of the seeds.
fn spread(graph: &Graph<'_>, seed: impl Fn(usize) -> bool, next: impl Fn(&Step) -> Vec<usize>) -> Vec<bool> {
    let mut before = vec![Vec::new(); NODES];
    for node in 0..NODES {
        for next in next(graph.at(node)) {
            before[next].push(node);
        }
    }
    let mut found: Vec<bool> = (0..NODES).map(seed).collect();
    let mut work: Vec<usize> = (0..NODES).filter(|node| found[*node]).collect();
    while let Some(node) = work.pop() {
        for earlier in &before[node] {
            if !std::mem::replace(&mut found[*earlier], true) {
                work.push(*earlier);
            }
        }
    }
    found
}

/// The rounds among stuck nodes: for each its last node, and the first one to which that goes back.
fn rounds(graph: &Graph<'_>, stuck: &[usize]) -> Vec<(usize, usize)> {
    let mut visited_from = vec![None; NODES];
    let mut rounds = Vec::new();
    for start in stuck {
        let mut node = *start;
        while visited_from[node].is_none() {
            visited_from[node] = Some(*start);
            let Some(next) = one_way(graph, node) else { break };
            if visited_from[next] == Some(*start) {
                rounds.push((node, next));
            }
            node = next;
        }
    }
    rounds
}

/// One of the ways on from a stuck node.
fn one_way(graph: &Graph<'_>, node: usize) -> Option<usize> {
    match graph.at(node) {
        Step::Goes(next) => next.first().copied(),
        Step::Calls(target, behind) => behind.first().or(target.as_ref()).copied(),
        Step::Starts(target) => *target,
        Step::Ends | Step::Returns => None,
    }
}
