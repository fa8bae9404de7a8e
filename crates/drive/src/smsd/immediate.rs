//! Instructions that the host gives by the standard protocol: carried out at once, and answered.

use super::commands::{Refusal, Why};
use super::interpreter::{operand, wait};
use super::{Session, Smsd, StandardSession};
use stepdrive_spec::smsd::instructions::{Instruction, NotAnInstruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Answer, Code, code_of, exists_in};
use stepdrive_spec::time::Instant;

/// Where `MODE_N_PROGRAMS` stands in the answer to `GET_MODE`: above what `SET_MODE` sets.
const MODE_N_PROGRAMS_SHIFT: u32 = 19;

/// The highest line that the answer to `GET_STACK` has room for; it is past the end of a memory area.
const LAST_LINE: u16 = 0xFF;

impl Smsd {
    /// The instruction in a word, if this controller has it.
    ///
    /// # Errors
    /// What the word is answered with: `ERROR_NO_COMMAND` or, when a reserved bit is set, `ERROR_RANGE`.
    pub(super) fn instruction(&self, word: u32) -> Result<Instruction, Code> {
        let instruction = Instruction::from_word(word).map_err(|problem| match problem {
            NotAnInstruction::ReservedBits(_) => Code::ErrorRange,
            NotAnInstruction::UnknownCode(_) => Code::ErrorNoCommand,
        })?;
        let known = exists_in(instruction.opcode, self.config.protocol_version);
        known.then_some(instruction).ok_or(Code::ErrorNoCommand)
    }

    /// Carries out an instruction and answers with the status after it; `GET_STATUS_AND_CLR` with that before, since the
    /// chip answers and then clears.
    ///
    /// ASSUMED: what the motor's state does not allow is answered as if it had been carried out, and sets `CMD_ERROR`.
    ///
    /// # Errors
    /// What it is answered with when it is not for any state of the controller. Nothing has changed then.
    pub(super) fn instruct(
        &mut self,
        now: Instant,
        session: &mut StandardSession,
        instruction: Instruction,
    ) -> Result<Answer, Code> {
        let opcode = instruction.opcode;
        let (before, data) = (self.status(now), self.return_data(now, opcode));
        match self.act_at_once(now, session, instruction) {
            Ok(()) => {}
            Err(Why::NoCall) => return Err(Code::ErrorPrograms),
            Err(why) if why.is_operand() => return Err(Code::ErrorRange),
            Err(why) => self.refuse(Refusal { opcode: Some(opcode), why, place: None }),
        }
        let status = if opcode == Opcode::GetStatusAndClr { before } else { self.status(now) };
        let relay_is_on = opcode == Opcode::GetRele && self.relay;
        let code = if relay_is_on { Code::StatusReleSet } else { code_of(opcode) };
        Ok(Answer { status, code, data })
    }

    /// ASSUMED: bits of the data beyond those of the operand are not looked at, as in a program.
    ///
    /// ASSUMED: waits, jumps, loops and calls act in a program only; their operands are looked at all the same. There is
    /// nothing that `RETURN_PROGRAM` could return from.
    fn act_at_once(
        &mut self,
        now: Instant,
        session: &mut StandardSession,
        instruction: Instruction,
    ) -> Result<(), Why> {
        #[allow(
            clippy::wildcard_enum_match_arm,
            reason = "`execute` lists every instruction that acts on the motor or the controller"
        )]
        match instruction.opcode {
            Opcode::GetStatusAndClr => self.motor.clear_flags(),
            Opcode::StepClock => self.step_clock(now),
            Opcode::StopUsb => session.stop(),
            Opcode::GetSpeed
            | Opcode::StatusInEvent
            | Opcode::GetMode
            | Opcode::GetAbsPos
            | Opcode::GetElPos
            | Opcode::GetRele
            | Opcode::GetMinSpeed
            | Opcode::GetMaxSpeed
            | Opcode::GetStack
            | Opcode::End
            | Opcode::WaitIn0
            | Opcode::WaitIn1
            | Opcode::WaitContinue
            | Opcode::GotoProgram
            | Opcode::GotoProgramIfIn0
            | Opcode::GotoProgramIfIn1
            | Opcode::GotoProgramIfZero
            | Opcode::GotoProgramIfInZero
            | Opcode::LoopProgram
            | Opcode::CallProgram => {}
            Opcode::SetWait | Opcode::SetWait2 => drop(wait(instruction)?),
            Opcode::SetMaskEvent => self.set_mask(now, mask(instruction)?),
            Opcode::ReturnProgram => return Err(Why::NoCall),
            opcode => self.execute(now, opcode, operand(instruction))?,
        }
        Ok(())
    }

    /// `RETURN_DATA`: what an instruction asks for; 0 for one that asks for nothing.
    fn return_data(&self, now: Instant, opcode: Opcode) -> u32 {
        let register = |reg: Reg| self.value(now, &Session::AUTHORISED, reg, 0);
        #[allow(clippy::wildcard_enum_match_arm, reason = "most ask for nothing")]
        match opcode {
            Opcode::GetSpeed => register(Reg::Speed),
            Opcode::GetAbsPos => register(Reg::AbsPos),
            Opcode::GetElPos => register(Reg::ElPos),
            Opcode::GetMinSpeed => register(Reg::MinSpeed),
            Opcode::GetMaxSpeed => register(Reg::MaxSpeed),
            Opcode::StatusInEvent => {
                u32::from_le_bytes([self.inputs.levels(), self.inputs.mask(), self.waiting(), 0])
            }
            Opcode::GetMode => {
                self.memory.motor.data() | u32::from(self.memory.mode_n_programs) << MODE_N_PROGRAMS_SHIFT
            }
            Opcode::GetStack => {
                let place = self.interpreter.place();
                u32::from(place.line.min(LAST_LINE)) | u32::from(place.area) << 8
            }
            _ => 0,
        }
    }
}

/// The mask of `SET_MASK_EVENT`, 8 bits; those above are no part of it (App. B).
fn mask(instruction: Instruction) -> Result<u8, Why> {
    let value = operand(instruction);
    u8::try_from(value).map_err(|_| Why::OutOfRange { value, min: 0, max: u8::MAX.into() })
}
