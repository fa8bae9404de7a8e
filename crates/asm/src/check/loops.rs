//! `LOOP_PROGRAM`: bodies that are empty, too long, crossed or jumped into.

use super::Check;
use super::graph::{Graph, Loop, node, place, target};
use super::walk::Walk;
use crate::diagnostic::Code;

/// Reports loops that hardly do what was meant. How deep they are nested is seen to in [`super::calls`].
pub(super) fn check(check: &mut Check<'_>, graph: &Graph<'_>, walk: &Walk) {
    for one in graph.loops.iter().filter(|one| walk.reached(one.head)) {
        if one.cycles == 0 || one.body == 0 {
            let message =
                if one.body == 0 { "the loop has nothing to repeat" } else { "the loop is run 0 times" };
            check.warn(
                Code::IdleLoop,
                message,
                &[(one.head, "")],
                "take it out, or give it a body and cycles",
            );
            continue;
        }
        let size = check.image.area(usize::from(one.head.memory)).len();
        if one.last() as usize >= size {
            let message = format!(
                "the body has {} instructions, and only {} follow",
                one.body,
                size - 1 - usize::from(one.head.line)
            );
            let help = "the program ends before the first cycle does";
            check.warn(Code::LoopPastEnd, message, &[(one.head, "")], help);
        }
        crossing(check, graph, one);
    }
    for node in walk.nodes() {
        jump_in(check, graph, node);
    }
}

/// Reports a loop whose body ends in the middle of a later loop's.
fn crossing(check: &mut Check<'_>, graph: &Graph<'_>, outer: &Loop) {
    let inside = graph.loops.iter().filter(|inner| outer.contains(inner.head) && inner.body > 0);
    for inner in inside.filter(|inner| inner.last() > outer.last()) {
        let labels =
            [(inner.head, "its body goes on behind the other one's end"), (outer.head, "the loop around it")];
        let help = "let the inner body end first";
        check.warn(Code::LoopsCross, "the bodies of two loops cross", &labels, help);
    }
}

/// Reports a jump from outside a body into it.
fn jump_in(check: &mut Check<'_>, graph: &Graph<'_>, from: usize) {
    let Some(to) = graph.instruction(from).and_then(target) else { return };
    let entered = graph
        .loops
        .iter()
        .find(|one| one.cycles > 0 && one.contains(to) && !one.contains(place(from)) && node(to) != from);
    if let Some(entered) = entered {
        let message = format!("`{}` goes into the body of a loop", check.name(place(from)));
        let labels = [(place(from), "from outside"), (entered.head, "the loop, which does not count then")];
        let help = "jump to the loop itself, or to what stands behind it";
        check.warn(Code::JumpIntoLoop, message, &labels, help);
    }
}
