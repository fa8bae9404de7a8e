//! Where a program can go from each instruction.

use super::{instruction, started_memory, words};
use crate::diagnostic::Place;
use crate::image::Image;
use crate::operand::{JUMP_BITS, LOOP_CYCLES_SHIFT, LOOP_MAX};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, Operand, PROGRAM_AREAS};

/// How many nodes a graph has: 256 for each memory, so that a place is its number.
pub(super) const NODES: usize = PROGRAM_AREAS << 8;

/// The number of a place.
pub(super) fn node(place: Place) -> usize {
    usize::from(place.memory) << 8 | usize::from(place.line)
}

/// The place with a number.
pub(super) fn place(node: usize) -> Place {
    let [line, memory, ..] = node.to_le_bytes();
    Place { memory, line }
}

/// What follows an instruction. Nodes that do not exist are left out: the program ends there.
#[derive(Clone, Debug)]
pub(super) enum Step {
    /// Nothing: the program ends, or stops with an error.
    Ends,
    /// Any of these.
    Goes(Vec<usize>),
    /// A subroutine, and behind its return any of these.
    Calls(Option<usize>, Vec<usize>),
    /// What follows the call.
    Returns,
    /// The beginning of a memory, with no call pending.
    Starts(Option<usize>),
}

/// A loop instruction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loop {
    /// Where it stands.
    pub(super) head: Place,
    /// How often its body is run.
    pub(super) cycles: u32,
    /// How many instructions its body has.
    pub(super) body: u32,
}

impl Loop {
    /// The loop that an instruction is.
    pub(super) fn of(head: Place, instruction: Instruction) -> Option<Loop> {
        let (cycles, body) = (instruction.data >> LOOP_CYCLES_SHIFT & LOOP_MAX, instruction.data & LOOP_MAX);
        (instruction.opcode == Opcode::LoopProgram).then_some(Loop { head, cycles, body })
    }

    /// The line of the last instruction of its body; its own when the body is empty.
    pub(super) fn last(&self) -> u32 {
        u32::from(self.head.line) + self.body
    }

    /// `true` when the place is in its body.
    pub(super) fn contains(&self, place: Place) -> bool {
        place.memory == self.head.memory
            && place.line > self.head.line
            && u32::from(place.line) <= self.last()
    }
}

/// The place that an instruction jumps to or calls.
pub(super) fn target(instruction: Instruction) -> Option<Place> {
    let [line, memory, ..] = (instruction.data & JUMP_BITS).to_le_bytes();
    (instruction.opcode.info().operand == Operand::Jump).then_some(Place { memory, line })
}

/// All paths through an image.
pub(super) struct Graph<'a> {
    image: &'a Image,
    steps: Vec<Step>,
    /// Every loop, in the order of the memories.
    pub(super) loops: Vec<Loop>,
    runs_off: Vec<bool>,
}

impl<'a> Graph<'a> {
    /// Finds them.
    pub(super) fn new(image: &'a Image) -> Graph<'a> {
        let loop_at = |(place, _)| Loop::of(place, instruction(image, place)?);
        let loops = image.words().filter_map(loop_at).collect();
        let mut graph = Graph { image, steps: vec![Step::Ends; NODES], loops, runs_off: vec![false; NODES] };
        let behind = graph.behind();
        for (place, _) in image.words() {
            if let Some(instruction) = instruction(image, place).filter(|one| !words::is_refused(*one)) {
                let (step, runs_off) = graph.step(place, instruction, &behind);
                graph.steps[node(place)] = step;
                graph.runs_off[node(place)] = runs_off;
            }
        }
        graph
    }

    /// What follows the instruction at a node.
    pub(super) fn at(&self, node: usize) -> &Step {
        self.steps.get(node).unwrap_or(&Step::Ends)
    }

    /// The instruction at a node.
    pub(super) fn instruction(&self, node: usize) -> Option<Instruction> {
        instruction(self.image, place(node))
    }

    /// `true` when the program may go on behind the last instruction of the memory.
    pub(super) fn runs_off(&self, place: Place) -> bool {
        self.runs_off.get(node(place)).copied().unwrap_or(false)
    }

    /// Where a jump goes that leads to no instruction.
    pub(super) fn lost_jump(&self, place: Place) -> Option<Place> {
        let instruction = instruction(self.image, place)?;
        let start = started_memory(instruction.opcode).map(|memory| Place { memory, line: 0 });
        target(instruction).or(start).filter(|target| self.existing(*target).is_none())
    }

    /// The beginnings of programs: that of memory 0, and of every memory to which no other one leads.
    pub(super) fn entries(&self) -> impl Iterator<Item = usize> + '_ {
        let begins = (0..).take(PROGRAM_AREAS).map(|memory| Place { memory, line: 0 });
        begins
            .filter(|begin| begin.memory == 0 || !self.is_led_to(begin.memory))
            .filter_map(|begin| self.existing(begin))
    }

    /// The beginning of every memory.
    pub(super) fn beginnings(&self) -> impl Iterator<Item = usize> + '_ {
        (0..).take(PROGRAM_AREAS).filter_map(|memory| self.existing(Place { memory, line: 0 }))
    }

    fn is_led_to(&self, memory: u8) -> bool {
        self.image.words().filter(|(place, _)| place.memory != memory).any(|(place, _)| {
            let Some(instruction) = instruction(self.image, place) else { return false };
            target(instruction).is_some_and(|target| target.memory == memory)
                || started_memory(instruction.opcode) == Some(memory)
        })
    }

    fn existing(&self, place: Place) -> Option<usize> {
        self.image.word(place).map(|_| node(place))
    }

    /// For every node what follows when it just goes on: the next one, and the beginnings of the loops that end at it.
    fn behind(&self) -> Vec<Vec<Option<usize>>> {
        let mut behind = vec![Vec::new(); NODES];
        for (place, _) in self.image.words() {
            let next = place.line.checked_add(1).and_then(|line| self.existing(Place { line, ..place }));
            behind[node(place)].push(next);
        }
        for one in self.loops.iter().filter(|one| one.cycles > 1 && one.body > 0) {
            let last = node(one.head) + one.body as usize;
            let in_memory = self.image.area(usize::from(one.head.memory)).len() > one.last() as usize;
            if in_memory {
                behind[last].push(Some(node(one.head) + 1));
            }
        }
        behind
    }

    fn step(&self, place: Place, instruction: Instruction, behind: &[Vec<Option<usize>>]) -> (Step, bool) {
        let after = |node: usize| behind.get(node).map_or(&[][..], Vec::as_slice);
        let existing = |nodes: &[Option<usize>]| nodes.iter().copied().flatten().collect::<Vec<usize>>();
        let next = after(node(place));
        let runs_off = next.contains(&None);
        let target = target(instruction).and_then(|target| self.existing(target));
        let opcode = instruction.opcode;
        if matches!(opcode, Opcode::End | Opcode::StopProgramMem) {
            (Step::Ends, false)
        } else if opcode == Opcode::ReturnProgram {
            (Step::Returns, false)
        } else if opcode == Opcode::GotoProgram {
            (Step::Goes(target.into_iter().collect()), false)
        } else if opcode == Opcode::CallProgram {
            (Step::Calls(target, existing(next)), runs_off)
        } else if let Some(memory) = started_memory(opcode) {
            (Step::Starts(self.existing(Place { memory, line: 0 })), false)
        } else if let Some(one) = Loop::of(place, instruction).filter(|one| one.body > 0) {
            let skipped = node(place) + one.body as usize;
            let in_memory = self.image.area(usize::from(place.memory)).len() > one.last() as usize;
            match (one.cycles, in_memory) {
                // The first that follows is the body; the others would be cycles of a loop that ends here.
                (1.., _) => (Step::Goes(existing(next.get(..1).unwrap_or(next))), runs_off),
                (0, true) => (Step::Goes(existing(after(skipped))), after(skipped).contains(&None)),
                (0, false) => (Step::Goes(Vec::new()), false),
            }
        } else {
            (Step::Goes(existing(next).into_iter().chain(target).collect()), runs_off)
        }
    }
}
