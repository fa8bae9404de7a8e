//! The interpreter of user programs (ch. 5 and App. B; decisions 16, 17 and 22 to 24).
//!
//! It is driven by events: an instruction has its effect at one instant, and the next one is due when its time has
//! passed and what it waits for has come. A program that waits costs nothing.

use super::Smsd;
use super::commands::{Place, Refusal, Why, number};
use arrayvec::ArrayVec;
use core::time::Duration;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, Operand};
use stepdrive_spec::smsd::timing::{CALL_DEPTH, INSTRUCTION_TIME, LOOP_DEPTH};
use stepdrive_spec::time::Instant;

/// The inputs that cut `SET_WAIT_2` short.
const INTERRUPTING: [Input; 3] = [Input::In0, Input::In1, Input::SetZero];

/// Where the program is, and what runs.
#[derive(Clone, Debug, Default)]
pub(super) struct Interpreter {
    /// The line that runs, or ran last.
    place: Place,
    /// How many instructions have run since power-up.
    executed: u64,
    running: Option<Running>,
}

/// A running program.
#[derive(Clone, Debug)]
struct Running {
    /// The line after the one that runs.
    next: Place,
    /// When the instruction that runs had its effect.
    started: Instant,
    /// When the instruction that runs has taken its time at the earliest.
    due: Instant,
    hold: Hold,
    calls: ArrayVec<Call, CALL_DEPTH>,
    loops: ArrayVec<Loop, LOOP_DEPTH>,
}

/// What an instruction waits for besides its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hold {
    /// Nothing.
    None,
    /// `READY`.
    Ready,
    /// A signal.
    Signal(Input),
    /// Nothing, but a signal ends its time early.
    Interruptible,
}

/// A subprogram that has not returned.
#[derive(Clone, Copy, Debug)]
struct Call {
    /// The line behind the call.
    back: Place,
    /// How many loops were open at the call: the subprogram's own come on top and go with it.
    loops: usize,
}

/// A loop that has not ended: the lines from `first` up to, not including, `end` of one memory area.
#[derive(Clone, Copy, Debug)]
struct Loop {
    area: u8,
    first: u16,
    end: u16,
    /// Cycles left, the present one included.
    cycles: u16,
}

impl Loop {
    fn holds(self, place: Place) -> bool {
        place.area == self.area && (self.first..self.end).contains(&place.line)
    }
}

/// How the program goes on after an instruction.
#[derive(Clone, Copy, Debug)]
enum Flow {
    /// With the next line, once the instruction's time has passed and its hold is gone.
    On(Duration, Hold),
    /// At another line.
    Jump(Place),
    /// At a line that follows in the text: behind the body of a loop, or behind a call. It may end a loop.
    Behind(Place),
    /// At the first line of another program, with nothing left of this one.
    Restart(u8),
    /// Not at all.
    End,
}

impl Interpreter {
    /// The line that runs, or ran last: `N_PROGRAM` and `N_COMMAND`.
    pub(super) fn place(&self) -> Place {
        self.place
    }

    /// `PROGRAM_RUN`.
    pub(super) fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// The memory area that is executing.
    pub(super) fn executing(&self) -> Option<u8> {
        self.is_running().then_some(self.place.area)
    }

    /// How many instructions have run since power-up.
    pub(super) fn executed(&self) -> u64 {
        self.executed
    }

    /// When the next instruction is due; `None` while nothing runs or the present one waits for something else.
    pub(super) fn next_wake(&self) -> Option<Instant> {
        let running = self.running.as_ref()?;
        matches!(running.hold, Hold::None | Hold::Interruptible).then_some(running.due)
    }

    /// The inputs that the program waits for, a bit each.
    pub(super) fn waiting(&self) -> u8 {
        match self.running.as_ref().map(|running| running.hold) {
            Some(Hold::Signal(input)) => input.bit(),
            Some(Hold::Interruptible) => INTERRUPTING.iter().fold(0, |bits, input| bits | input.bit()),
            Some(Hold::None | Hold::Ready) | None => 0,
        }
    }
}

impl Smsd {
    /// `START_PROGRAM_MEMx`: the program of this area runs from its first line, whatever ran before.
    pub(super) fn start_program(&mut self, now: Instant, area: u8) {
        self.interpreter.running = Some(Running::new(now, area));
    }

    /// `STOP_PROGRAM_MEM`: the program ends; the motor goes on as it was.
    pub(super) fn stop_program(&mut self) {
        self.interpreter.running = None;
    }

    /// Lets the program go on if what it waits for is there. To be called after everything that may have brought it.
    pub(super) fn release_program(&mut self, now: Instant) {
        let Some(running) = &self.interpreter.running else { return };
        let released = match running.hold {
            Hold::None => false,
            Hold::Ready => self.ready(),
            Hold::Signal(input) => self.inputs.signals(input),
            Hold::Interruptible => INTERRUPTING.iter().any(|input| self.inputs.signals(*input)),
        };
        if let Some(running) = self.interpreter.running.as_mut().filter(|_| released) {
            // An interrupted wait still takes an instruction's time; `due` of every other hold is that time already.
            if running.hold == Hold::Interruptible {
                running.due = running.due.min(now.max(running.started + INSTRUCTION_TIME));
            }
            running.hold = Hold::None;
            running.due = running.due.max(now);
        }
    }

    /// Runs the instruction that is due.
    pub(super) fn run_instruction(&mut self, now: Instant) {
        let Some(mut running) = self.interpreter.running.take() else { return };
        self.interpreter.place = running.next;
        let Some(word) = self.word_at(running.next) else { return };
        self.interpreter.executed = self.interpreter.executed.saturating_add(1);
        let outcome = match Instruction::from_word(word) {
            Ok(instruction) => {
                self.perform(now, &mut running, instruction).map_err(|why| (Some(instruction.opcode), why))
            }
            Err(_) => Err((None, Why::NotAnInstruction(word))),
        };
        match outcome {
            Ok(flow) => {
                self.interpreter.running = running.follow(now, flow);
                self.release_program(now);
            }
            Err((opcode, why)) => self.refuse(Refusal { opcode, why, place: Some(self.interpreter.place) }),
        }
    }

    /// The word at a line; `None` past the program's size or the end of its area.
    fn word_at(&self, place: Place) -> Option<u32> {
        let area = self.memory.area(usize::from(place.area));
        let within = place.line < u16::from(area.size());
        area.words().get(usize::from(place.line)).copied().filter(|_| within)
    }

    fn perform(
        &mut self,
        now: Instant,
        running: &mut Running,
        instruction: Instruction,
    ) -> Result<Flow, Why> {
        let target = Place::from_data(instruction.data);
        let jump_if = |condition: bool| if condition { Flow::Jump(target) } else { ON };
        #[allow(
            clippy::wildcard_enum_match_arm,
            reason = "`execute` lists every instruction that is not flow"
        )]
        let flow = match instruction.opcode {
            Opcode::End | Opcode::StopProgramMem => Flow::End,
            Opcode::GotoProgram => Flow::Jump(target),
            Opcode::GotoProgramIfIn0 => jump_if(self.inputs.signals(Input::In0)),
            Opcode::GotoProgramIfIn1 => jump_if(self.inputs.signals(Input::In1)),
            Opcode::GotoProgramIfInZero => jump_if(self.inputs.signals(Input::SetZero)),
            Opcode::GotoProgramIfZero => jump_if(self.motor.position(now) == 0),
            Opcode::WaitIn0 => Flow::On(INSTRUCTION_TIME, Hold::Signal(Input::In0)),
            Opcode::WaitIn1 => Flow::On(INSTRUCTION_TIME, Hold::Signal(Input::In1)),
            Opcode::WaitContinue => Flow::On(INSTRUCTION_TIME, Hold::Signal(Input::Continue)),
            Opcode::SetWait => Flow::On(wait(instruction)?, Hold::None),
            Opcode::SetWait2 => Flow::On(wait(instruction)?, Hold::Interruptible),
            Opcode::LoopProgram => running.open_loop(self.interpreter.place, instruction.data)?,
            Opcode::CallProgram => running.call(target)?,
            Opcode::ReturnProgram => running.give_back()?,
            Opcode::StartProgramMem0 => Flow::Restart(0),
            Opcode::StartProgramMem1 => Flow::Restart(1),
            Opcode::StartProgramMem2 => Flow::Restart(2),
            Opcode::StartProgramMem3 => Flow::Restart(3),
            opcode => {
                self.execute(now, opcode, operand(instruction))?;
                // What is left are motions, which `CMD` takes as well, and settings, which hold nothing.
                let hold = if opcode.info().in_cmd { Hold::Ready } else { Hold::None };
                Flow::On(INSTRUCTION_TIME, hold)
            }
        };
        Ok(flow)
    }
}

/// On with the next line after an instruction's own time.
const ON: Flow = Flow::On(INSTRUCTION_TIME, Hold::None);

/// The operand of an instruction, as [`Smsd::execute`] takes it.
pub(super) fn operand(instruction: Instruction) -> i32 {
    let signed = instruction.opcode.info().operand == Operand::Position;
    if signed { instruction.position() } else { instruction.data.cast_signed() }
}

/// The time of a wait.
pub(super) fn wait(instruction: Instruction) -> Result<Duration, Why> {
    let milliseconds: u32 = number(instruction.opcode, instruction.data.cast_signed())?;
    Ok(Duration::from_millis(u64::from(milliseconds)).max(INSTRUCTION_TIME))
}

impl Running {
    fn new(now: Instant, area: u8) -> Running {
        Running {
            next: Place { area, line: 0 },
            started: now,
            due: now,
            hold: Hold::None,
            calls: ArrayVec::new(),
            loops: ArrayVec::new(),
        }
    }

    /// The program as it goes on after an instruction; `None` when it has ended.
    fn follow(mut self, now: Instant, flow: Flow) -> Option<Running> {
        match flow {
            Flow::On(time, hold) => {
                self.next.line = self.next.line.saturating_add(1);
                self.take_time(now, time, hold);
                self.close_loops();
            }
            Flow::Jump(target) => self.jump(now, target),
            Flow::Behind(place) => {
                self.next = place;
                self.take_time(now, INSTRUCTION_TIME, Hold::None);
                self.close_loops();
            }
            Flow::Restart(area) => {
                self = Running::new(now, area);
                self.take_time(now, INSTRUCTION_TIME, Hold::None);
            }
            Flow::End => return None,
        }
        Some(self)
    }

    /// The instruction takes its time, and then the target is due. A jump out of a loop leaves it (ASSUMED); a jump
    /// within a loop stays in it, and a call takes its loops along.
    fn jump(&mut self, now: Instant, target: Place) {
        self.next = target;
        self.take_time(now, INSTRUCTION_TIME, Hold::None);
        let own = self.own_loops();
        while self.loops.len() > own && self.loops.last().is_some_and(|inner| !inner.holds(target)) {
            self.loops.pop();
        }
    }

    fn take_time(&mut self, now: Instant, time: Duration, hold: Hold) {
        self.started = now;
        self.due = now + time;
        self.hold = hold;
    }

    /// Starts the next cycle of a loop whose last line has run, or goes on behind it after its last cycle.
    fn close_loops(&mut self) {
        let own = self.own_loops();
        while self.loops.len() > own
            && let Some(inner) = self.loops.last_mut()
            && inner.area == self.next.area
            && inner.end == self.next.line
        {
            if inner.cycles > 1 {
                inner.cycles -= 1;
                self.next.line = inner.first;
                return;
            }
            self.loops.pop();
        }
    }

    /// How many of the open loops belong to callers.
    fn own_loops(&self) -> usize {
        self.calls.last().map_or(0, |call| call.loops)
    }

    /// `LOOP_PROGRAM` at `place`. With no cycles its body is skipped, with no instructions it does nothing.
    fn open_loop(&mut self, place: Place, data: u32) -> Result<Flow, Why> {
        let [instructions, cycles] = [data, data >> 10].map(|bits| u16::try_from(bits & 0x3FF).unwrap_or(0));
        let first = place.line.saturating_add(1);
        let end = first.saturating_add(instructions);
        if cycles == 0 {
            return Ok(Flow::Behind(Place { line: end, ..place }));
        }
        if instructions > 0 {
            let opened = Loop { area: place.area, first, end, cycles };
            self.loops.try_push(opened).map_err(|_| Why::TooManyLoops)?;
        }
        Ok(ON)
    }

    /// `CALL_PROGRAM`.
    fn call(&mut self, target: Place) -> Result<Flow, Why> {
        let back = Place { line: self.next.line.saturating_add(1), ..self.next };
        let call = Call { back, loops: self.loops.len() };
        self.calls.try_push(call).map_err(|_| Why::TooManyCalls)?;
        Ok(Flow::Jump(target))
    }

    /// `RETURN_PROGRAM`: behind the call, as if the call had been a line like any other.
    fn give_back(&mut self) -> Result<Flow, Why> {
        let call = self.calls.pop().ok_or(Why::NoCall)?;
        self.loops.truncate(call.loops);
        Ok(Flow::Behind(call.back))
    }
}
