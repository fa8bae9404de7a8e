//! What each instruction makes of the motor, and which state it needs.

use super::Check;
use super::graph::{Graph, Loop, place};
use super::walk::Walk;
use crate::diagnostic::{Code, Place};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};

/// A state of the motor between two instructions of a program. A motion instruction holds the program until the
/// controller is READY (decision 22), so the motor turns there only after a `RUN`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// At rest, de-energised.
    Free,
    /// At rest, energised.
    Held,
    /// Turning at constant speed, READY.
    Turning,
}

impl State {
    /// How many there are.
    pub(super) const COUNT: usize = 3;
    /// The state in which a program begins, unless another one started it.
    pub(super) const AT_START: State = State::Free;

    const ALL: [State; State::COUNT] = [State::Free, State::Held, State::Turning];
}

/// A set of states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct States(u8);

impl States {
    /// Adds a state; `true` when it is new.
    pub(super) fn add(&mut self, state: State) -> bool {
        let before = self.0;
        self.0 |= 1 << state as u8;
        self.0 != before
    }

    /// `true` for no state at all.
    pub(super) fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Its states.
    pub(super) fn iter(self) -> impl Iterator<Item = State> {
        State::ALL.into_iter().filter(move |state| self.0 & 1 << *state as u8 != 0)
    }
}

/// What an instruction does to the motor, or asks of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effect {
    /// Nothing.
    Nothing,
    /// It turns until something stops it.
    Runs,
    /// It must be at rest, and moves.
    Moves,
    /// It goes somewhere, or turns until an input stops it.
    Travels,
    /// It is held at rest.
    Stops,
    /// It is de-energised.
    Frees,
    /// Nothing, but it takes time.
    Waits,
    /// It must be at rest.
    NeedsRest,
    /// It must be de-energised.
    NeedsFree,
}

#[rustfmt::skip]
fn effect(opcode: Opcode) -> Effect {
    use Opcode as O;
    match opcode {
        O::RunF | O::RunR => Effect::Runs,
        O::MoveF | O::MoveR => Effect::Moves,
        O::GoToF | O::GoToR | O::GoTo | O::GoZero | O::GoMark | O::GoUntilF | O::GoUntilR | O::ScanZeroF | O::ScanZeroR
        | O::ScanMarkF | O::ScanMarkR | O::ScanMark2F | O::ScanMark2R => Effect::Travels,
        O::SoftStop | O::HardStop => Effect::Stops,
        O::SoftHiZ | O::HardHiZ | O::ResetPowerstep01 => Effect::Frees,
        O::SetWait | O::SetWait2 | O::WaitIn0 | O::WaitIn1 | O::WaitContinue => Effect::Waits,
        O::SetMinSpeed | O::SetAcc | O::SetDec => Effect::NeedsRest,
        O::SetMode => Effect::NeedsFree,
        O::End | O::StopProgramMem | O::ResetPos | O::SetMaxSpeed | O::SetFsSpeed | O::SetMaskEvent | O::SetRele | O::ClrRele
        | O::GotoProgram | O::GotoProgramIfIn0 | O::GotoProgramIfIn1 | O::GotoProgramIfZero | O::GotoProgramIfInZero
        | O::LoopProgram | O::CallProgram | O::ReturnProgram | O::StartProgramMem0 | O::StartProgramMem1
        | O::StartProgramMem2 | O::StartProgramMem3 | O::GetRele | O::StepClock | O::StopUsb | O::GetSpeed
        | O::StatusInEvent | O::GetMode | O::GetAbsPos | O::GetElPos | O::GetStatusAndClr | O::GetMinSpeed
        | O::GetMaxSpeed | O::GetStack => Effect::Nothing,
    }
}

/// The state behind an instruction, when the program gets that far: one that was refused has stopped it.
pub(super) fn after(instruction: Instruction, state: State) -> State {
    match effect(instruction.opcode) {
        Effect::Runs => State::Turning,
        Effect::Moves | Effect::Travels | Effect::Stops => State::Held,
        Effect::Frees | Effect::NeedsFree => State::Free,
        Effect::NeedsRest if state == State::Turning => State::Held,
        Effect::Nothing | Effect::Waits | Effect::NeedsRest => state,
    }
}

/// `true` for an instruction that puts current into the motor.
pub(super) fn energises(opcode: Opcode) -> bool {
    let effect = effect(opcode);
    matches!(effect, Effect::Runs | Effect::Moves | Effect::Travels | Effect::Stops)
}

/// `true` for an instruction that takes time: a motion, a stop, a wait.
pub(super) fn takes_time(instruction: Instruction) -> bool {
    let no_wait = matches!(instruction.opcode, Opcode::SetWait | Opcode::SetWait2) && instruction.data == 0;
    energises(instruction.opcode) || effect(instruction.opcode) == Effect::Waits && !no_wait
}

/// `true` for a loop.
pub(super) fn is_loop(instruction: Instruction) -> bool {
    Loop::of(Place { memory: 0, line: 0 }, instruction).is_some()
}

/// Reports instructions that the motor may not be ready for.
pub(super) fn check(check: &mut Check<'_>, graph: &Graph<'_>, walk: &Walk) {
    for node in walk.nodes() {
        let Some(instruction) = graph.instruction(node) else { continue };
        let wrong =
            walk.states(node).iter().find_map(|state| Some((state, problem(instruction.opcode, state)?)));
        if let Some((state, problem)) = wrong {
            let name = instruction.opcode.name();
            let mut labels = vec![(place(node), "refused then, which stops the program")];
            labels.extend(walk.cause(node, state).map(|cause| (place(cause), problem.cause)));
            check.warn(problem.code, format!("{} at `{name}`", problem.message), &labels, problem.help);
        }
    }
}

/// Why an instruction is refused in a state.
struct Problem {
    code: Code,
    message: &'static str,
    /// What to say of the instruction that brought it about.
    cause: &'static str,
    help: &'static str,
}

const TURNS: Problem = Problem {
    code: Code::MotorMayTurn,
    message: "the motor may still turn",
    cause: "it turns since here",
    help: "stop it first, with `SOFT_STOP`",
};

const ENERGISED: Problem = Problem {
    code: Code::MayBeEnergised,
    message: "the motor may be energised",
    cause: "it is energised since here",
    help: "de-energise it first, with `SOFT_HI_Z`",
};

fn problem(opcode: Opcode, state: State) -> Option<Problem> {
    match effect(opcode) {
        Effect::NeedsFree => (state != State::Free).then_some(ENERGISED),
        Effect::Moves | Effect::NeedsRest => (state == State::Turning).then_some(TURNS),
        Effect::Runs | Effect::Travels | Effect::Stops | Effect::Frees | Effect::Nothing | Effect::Waits => {
            None
        }
    }
}
