//! `CALL_PROGRAM` and `RETURN_PROGRAM`, and how deep calls and loops are nested.

use super::Check;
use super::graph::{Graph, NODES, Step, place};
use super::walk::{Routine, Walk};
use crate::diagnostic::Code;
use std::collections::{BTreeMap, BTreeSet};
use stepdrive_spec::smsd::timing::{CALL_DEPTH, LOOP_DEPTH};

/// Reports returns without call, recursion, and nesting that the controller does not follow.
pub(super) fn check(check: &mut Check<'_>, graph: &Graph<'_>, walk: &Walk) {
    for node in &walk.stray_returns {
        let labels = [(place(*node), "the program stops here with an error")];
        let help = "let `CALL_PROGRAM` lead here, or write `END` before it";
        check.warn(Code::ReturnWithoutCall, "no `CALL_PROGRAM` leads to this return", &labels, help);
    }
    let nest = Nest::new(graph, walk);
    for (_, call) in &nest.recursive {
        let labels = [(place(*call), "calls a subroutine that is not finished")];
        let help = format!(
            "each round adds a pending call, and {CALL_DEPTH} are the most: leave a subroutine by `RETURN_PROGRAM`, not by a jump"
        );
        check.warn(Code::RecursiveCall, "this call may call itself again", &labels, &help);
    }
    nest.too_deep(check, graph, walk);
}

/// What is around each routine when it runs.
struct Nest {
    /// How many calls are pending, and how many loops run, at most.
    depths: BTreeMap<Routine, (usize, usize)>,
    /// The calls that close a circle.
    recursive: BTreeSet<(Routine, usize)>,
}

impl Nest {
    fn new(graph: &Graph<'_>, walk: &Walk) -> Nest {
        let mut callees: BTreeMap<Routine, Vec<(usize, Routine)>> = BTreeMap::new();
        for (caller, call) in &walk.calls {
            if let Step::Calls(Some(entry), _) = graph.at(*call) {
                callees.entry(*caller).or_default().push((*call, Routine { entry: *entry, called: true }));
            }
        }
        let (order, recursive) = callers_first(&callees);
        let mut depths: BTreeMap<Routine, (usize, usize)> = BTreeMap::new();
        for caller in order {
            let (calls, loops) = depths.get(&caller).copied().unwrap_or_default();
            for (call, callee) in callees.get(&caller).into_iter().flatten() {
                if !recursive.contains(&(caller, *call)) {
                    let depth = depths.entry(*callee).or_default();
                    *depth = (depth.0.max(calls + 1), depth.1.max(loops + loops_around(graph, *call)));
                }
            }
        }
        Nest { depths, recursive }
    }

    fn too_deep(&self, check: &mut Check<'_>, graph: &Graph<'_>, walk: &Walk) {
        let depth = |routine: &Routine| self.depths.get(routine).copied().unwrap_or_default();
        let at_limit = |(caller, _): &&(Routine, usize)| depth(caller).0 == CALL_DEPTH;
        let deep_calls: BTreeSet<usize> = walk.calls.iter().filter(at_limit).map(|(_, call)| *call).collect();
        for call in deep_calls {
            let message = format!("{CALL_DEPTH} calls may be pending here already");
            let labels = [(place(call), "one more stops the program with an error")];
            check.warn(Code::CallTooDeep, message, &labels, "call from further out, or jump");
        }
        let at_limit =
            |(routine, head): &&(Routine, usize)| depth(routine).1 + loops_around(graph, *head) == LOOP_DEPTH;
        let deep_loops: BTreeSet<usize> = walk.loops.iter().filter(at_limit).map(|(_, head)| *head).collect();
        for head in deep_loops {
            let message = format!("{LOOP_DEPTH} loops may be running here already");
            let labels = [(place(head), "one more stops the program with an error")];
            let help = "loops around a call count as well";
            check.warn(Code::LoopTooDeep, message, &labels, help);
        }
    }
}

/// How many loops of its own memory are around an instruction.
fn loops_around(graph: &Graph<'_>, node: usize) -> usize {
    graph.loops.iter().filter(|one| one.cycles > 0 && one.contains(place(node))).count()
}

/// The routines, callers before callees as far as there is such an order, and the calls that stand against it.
fn callers_first(
    callees: &BTreeMap<Routine, Vec<(usize, Routine)>>,
) -> (Vec<Routine>, BTreeSet<(Routine, usize)>) {
    let mut order = Vec::new();
    let mut circular = BTreeSet::new();
    let mut entered: BTreeSet<Routine> = BTreeSet::new();
    let mut open: BTreeSet<Routine> = BTreeSet::new();
    for start in callees.keys() {
        // A depth-first search with its own stack: the nesting of hostile programs is deep.
        let mut stack = vec![(*start, 0)];
        while let Some((routine, next)) = stack.pop() {
            if next == 0 && !entered.insert(routine) {
                continue;
            }
            open.insert(routine);
            let Some((call, callee)) = callees.get(&routine).and_then(|calls| calls.get(next)) else {
                open.remove(&routine);
                order.push(routine);
                continue;
            };
            stack.push((routine, next + 1));
            if open.contains(callee) {
                circular.insert((routine, *call));
            } else {
                stack.push((*callee, 0));
            }
        }
    }
    debug_assert!(order.len() <= 2 * NODES);
    order.reverse();
    (order, circular)
}
