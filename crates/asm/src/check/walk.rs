//! Follows every path, with calls matched to their returns.
//!
//! A subroutine is followed once for every state in which the motor may be when it is called; what it leaves behind is
//! handed to every call in that state. So what one caller did before its call is not blamed on another one, and the
//! work is bounded by places × states × subroutines × states however the program is made.

use super::graph::{Graph, NODES, Step, node, place};
use super::motor::{self, State, States};
use crate::diagnostic::Place;
use std::collections::BTreeSet;

/// The beginning of a program or of a subroutine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Routine {
    /// Its first instruction.
    pub(super) entry: usize,
    /// `true` for a subroutine, `false` for a program.
    pub(super) called: bool,
}

/// What the walk found.
pub(super) struct Walk {
    /// In which states the motor may be before each instruction.
    states: Vec<States>,
    /// For each of these the instruction that energised the motor last.
    causes: Vec<[Option<usize>; State::COUNT]>,
    /// The calls that each routine makes: the routine and the instruction that calls.
    pub(super) calls: BTreeSet<(Routine, usize)>,
    /// The loops that each routine comes to.
    pub(super) loops: BTreeSet<(Routine, usize)>,
    /// Where a program comes to a return with no call pending.
    pub(super) stray_returns: BTreeSet<usize>,
}

impl Walk {
    /// `true` when a path leads to the place.
    pub(super) fn reached(&self, place: Place) -> bool {
        !self.states(node(place)).is_empty()
    }

    /// Every place that a path leads to.
    pub(super) fn places(&self) -> impl Iterator<Item = Place> + '_ {
        self.nodes().map(place)
    }

    /// The same as nodes.
    pub(super) fn nodes(&self) -> impl Iterator<Item = usize> + '_ {
        (0..NODES).filter(|node| !self.states(*node).is_empty())
    }

    /// In which states the motor may be before an instruction.
    pub(super) fn states(&self, node: usize) -> States {
        self.states.get(node).copied().unwrap_or_default()
    }

    /// The instruction that last set the motor going, or held it, on a path that comes to `node` in this state.
    pub(super) fn cause(&self, node: usize, state: State) -> Option<usize> {
        self.causes.get(node).and_then(|causes| causes.get(state as usize).copied()).flatten()
    }
}

/// Follows every path from every beginning.
pub(super) fn walk(graph: &Graph<'_>) -> Walk {
    let mut walker = Walker::new(graph);
    for entry in graph.entries().collect::<Vec<usize>>() {
        walker.begin(entry, State::AT_START);
    }
    // Memories that only lead to each other are programs too.
    for entry in graph.beginnings().collect::<Vec<usize>>() {
        let memory = place(entry).memory;
        if !walker.walk.places().any(|place| place.memory == memory) {
            walker.begin(entry, State::AT_START);
        }
    }
    walker.walk
}

/// A routine with the state in which it is entered, and what is known about it.
struct Context {
    routine: Routine,
    entered: State,
    seen: Vec<States>,
    /// The calls in this state, by context and instruction.
    callers: Vec<(usize, usize)>,
    /// The states in which it returns, and what energised the motor last before each.
    returns: States,
    causes: [Option<usize>; State::COUNT],
}

/// A path has come to an instruction of a context, in a state.
#[derive(Clone, Copy)]
struct Arrival {
    context: usize,
    node: usize,
    state: State,
}

struct Walker<'a> {
    graph: &'a Graph<'a>,
    contexts: Vec<Context>,
    /// The context of each subroutine and state, then of each program and state.
    index: Vec<Option<usize>>,
    work: Vec<Arrival>,
    walk: Walk,
}

impl<'a> Walker<'a> {
    fn new(graph: &'a Graph<'a>) -> Walker<'a> {
        let walk = Walk {
            states: vec![States::default(); NODES],
            causes: vec![[None; State::COUNT]; NODES],
            calls: BTreeSet::new(),
            loops: BTreeSet::new(),
            stray_returns: BTreeSet::new(),
        };
        Walker {
            graph,
            contexts: Vec::new(),
            index: vec![None; 2 * NODES * State::COUNT],
            work: Vec::new(),
            walk,
        }
    }

    /// Follows all paths of a program, and of all programs that it starts.
    fn begin(&mut self, entry: usize, state: State) {
        self.enter(Routine { entry, called: false }, state, None);
        while let Some(arrival) = self.work.pop() {
            self.follow(arrival);
        }
    }

    /// The context of a routine in a state; its paths are begun when it is new.
    fn enter(&mut self, routine: Routine, state: State, cause: Option<usize>) -> usize {
        let program = if routine.called { 0 } else { NODES };
        let slot = (program + routine.entry) * State::COUNT + state as usize;
        if let Some(context) = self.index[slot] {
            return context;
        }
        let context = self.contexts.len();
        self.index[slot] = Some(context);
        self.contexts.push(Context {
            routine,
            entered: state,
            seen: vec![States::default(); NODES],
            callers: Vec::new(),
            returns: States::default(),
            causes: [None; State::COUNT],
        });
        self.arrive(Arrival { context, node: routine.entry, state }, cause);
        context
    }

    fn arrive(&mut self, arrival: Arrival, cause: Option<usize>) {
        let Arrival { context, node, state } = arrival;
        if self.contexts[context].seen[node].add(state) {
            if self.walk.states[node].add(state) {
                self.walk.causes[node][state as usize] = cause;
            }
            self.work.push(arrival);
        }
    }

    fn follow(&mut self, arrival: Arrival) {
        let Arrival { context, node, state } = arrival;
        let Some(instruction) = self.graph.instruction(node) else { return };
        let after = motor::after(instruction, state);
        let cause =
            if motor::energises(instruction.opcode) { Some(node) } else { self.walk.cause(node, state) };
        let graph = self.graph;
        match graph.at(node) {
            Step::Ends => {}
            Step::Goes(nodes) => {
                if motor::is_loop(instruction) {
                    self.walk.loops.insert((self.contexts[context].routine, node));
                }
                for next in nodes {
                    self.arrive(Arrival { context, node: *next, state: after }, cause);
                }
            }
            Step::Calls(target, behind) => self.call(arrival, *target, behind),
            Step::Returns => self.leave(context, node, state),
            Step::Starts(target) => {
                if let Some(entry) = target {
                    self.enter(Routine { entry: *entry, called: false }, state, cause);
                }
            }
        }
    }

    fn call(&mut self, arrival: Arrival, target: Option<usize>, behind: &[usize]) {
        let Arrival { context, node, state } = arrival;
        let Some(entry) = target else { return };
        self.walk.calls.insert((self.contexts[context].routine, node));
        let cause = self.walk.cause(node, state);
        let callee = self.enter(Routine { entry, called: true }, state, cause);
        self.contexts[callee].callers.push((context, node));
        for returned in self.contexts[callee].returns.iter() {
            self.come_back(callee, (context, node), returned, behind);
        }
    }

    fn leave(&mut self, context: usize, node: usize, state: State) {
        if !self.contexts[context].routine.called {
            self.walk.stray_returns.insert(node);
            return;
        }
        if !self.contexts[context].returns.add(state) {
            return;
        }
        self.contexts[context].causes[state as usize] = self.walk.cause(node, state);
        let graph = self.graph;
        for caller in self.contexts[context].callers.clone() {
            if let Step::Calls(_, behind) = graph.at(caller.1) {
                self.come_back(context, caller, state, behind);
            }
        }
    }

    fn come_back(&mut self, returning: usize, caller: (usize, usize), state: State, behind: &[usize]) {
        let entered = self.contexts[returning].entered;
        let cause = if state == entered {
            self.walk.cause(caller.1, state)
        } else {
            self.contexts[returning].causes[state as usize]
        };
        for next in behind {
            self.arrive(Arrival { context: caller.0, node: *next, state }, cause);
        }
    }
}
