//! The memory areas of user programs and the procedures of `MEM_CMD` (ch. 5; decisions 10 and 11).

use super::Smsd;
use arrayvec::ArrayVec;
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::instructions::{Instruction, PROGRAM_AREAS, PROGRAM_LINES};
use stepdrive_spec::smsd::timing::FRAM_TIME;
use stepdrive_spec::time::Instant;

/// Instructions in the buffer.
pub(super) const BUFFER_LINES: usize = 32;

/// The registers that control the procedures. Their values are checked when a procedure starts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ProcedureRegisters {
    pub(super) n_prog: u16,
    pub(super) n_str: u16,
    pub(super) sector_size: u16,
    pub(super) prog_size: u16,
    pub(super) mem_cmd: u16,
}

/// The buffer, the registers and the procedure at work.
#[derive(Clone, Debug)]
pub(super) struct Programs {
    pub(super) buffer: [u32; BUFFER_LINES],
    pub(super) registers: ProcedureRegisters,
    pub(super) b_complete: bool,
    procedure: Option<(Instant, Procedure)>,
}

/// A procedure of `MEM_CMD`, with what it works on as it stood when it was started.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(clippy::large_enum_variant, reason = "there is one, in place; boxing would need an allocator")]
pub(super) enum Procedure {
    /// 0: instructions to the buffer.
    Read { area: usize, first: usize, count: usize },
    /// 1: instructions from the buffer.
    Write { area: usize, first: usize, words: ArrayVec<u32, BUFFER_LINES> },
    /// 2: the whole area becomes END, its size 0.
    Erase { area: usize },
    /// 3: the size to `PROG_SIZE`.
    ReadSize { area: usize },
    /// 4: the size from `PROG_SIZE`.
    WriteSize { area: usize, size: u8 },
}

impl Programs {
    pub(super) fn power_up() -> Programs {
        Programs {
            buffer: [0; BUFFER_LINES],
            registers: ProcedureRegisters::default(),
            b_complete: false,
            procedure: None,
        }
    }

    pub(super) fn next_wake(&self) -> Option<Instant> {
        self.procedure.as_ref().map(|(done, _)| *done)
    }

    /// Whether a memory area cannot be written now, with a program running in `executing`: that program is in it, or a
    /// procedure is at work.
    pub(super) fn is_busy(&self, area: usize, executing: Option<u8>) -> bool {
        self.procedure.is_some() || executing.map(usize::from) == Some(area)
    }

    /// The procedure that the registers ask for, with a program running in `executing`.
    ///
    /// # Errors
    /// `IllegalDataValue` when an area, a line, a count, a size or an instruction in the buffer is not valid; else
    /// `ServerDeviceBusy` while another one works or when it would change the running program.
    pub(super) fn plan(&self, executing: Option<u8>) -> Result<Procedure, Exception> {
        let procedure = self.requested()?;
        let changed = match procedure {
            Procedure::Read { .. } | Procedure::ReadSize { .. } => None,
            Procedure::Write { area, .. } | Procedure::Erase { area } | Procedure::WriteSize { area, .. } => {
                Some(area)
            }
        };
        let busy = changed.map_or(self.procedure.is_some(), |area| self.is_busy(area, executing));
        if busy {
            return Err(Exception::ServerDeviceBusy);
        }
        Ok(procedure)
    }

    /// The procedure that the registers ask for, whatever goes on.
    fn requested(&self) -> Result<Procedure, Exception> {
        let registers = &self.registers;
        let area = usize::from(registers.n_prog);
        if area >= PROGRAM_AREAS {
            return Err(Exception::IllegalDataValue);
        }
        match registers.mem_cmd {
            0 => sector(registers).map(|(first, count)| Procedure::Read { area, first, count }),
            1 => {
                let (first, count) = sector(registers)?;
                let words: ArrayVec<u32, BUFFER_LINES> = self.buffer.iter().copied().take(count).collect();
                let valid = words.iter().all(|word| Instruction::from_word(*word).is_ok());
                valid.then_some(Procedure::Write { area, first, words }).ok_or(Exception::IllegalDataValue)
            }
            2 => Ok(Procedure::Erase { area }),
            3 => Ok(Procedure::ReadSize { area }),
            4 => {
                let size = u8::try_from(registers.prog_size).map_err(|_| Exception::IllegalDataValue)?;
                Ok(Procedure::WriteSize { area, size })
            }
            _ => Err(Exception::IllegalDataValue),
        }
    }

    /// Starts a procedure; it works for [`FRAM_TIME`].
    pub(super) fn start(&mut self, now: Instant, procedure: Procedure) {
        self.procedure = Some((now + FRAM_TIME, procedure));
    }
}

/// The first line and the count that the registers name, if they lie within a memory area.
fn sector(registers: &ProcedureRegisters) -> Result<(usize, usize), Exception> {
    let (first, count) = (usize::from(registers.n_str), usize::from(registers.sector_size));
    let valid = (1..=BUFFER_LINES).contains(&count) && first + count <= PROGRAM_LINES;
    valid.then_some((first, count)).ok_or(Exception::IllegalDataValue)
}

impl Smsd {
    /// The procedure at work has done its time: its effect shows, and `B_COMPLETE` is set.
    pub(super) fn finish_memory_procedure(&mut self) {
        let Some((_, procedure)) = self.programs.procedure.take() else { return };
        self.programs.b_complete = true;
        match procedure {
            Procedure::Read { area, first, count } => {
                let words = self.memory.area(area).words().iter().skip(first).take(count);
                for (slot, word) in self.programs.buffer.iter_mut().zip(words) {
                    *slot = *word;
                }
            }
            Procedure::Write { area, first, words } => {
                self.memory.area_mut(area).write(first, &words);
                self.unsaved.mark_program(area);
            }
            Procedure::Erase { area } => {
                self.memory.area_mut(area).erase();
                self.unsaved.mark_program(area);
            }
            Procedure::ReadSize { area } => {
                self.programs.registers.prog_size = u16::from(self.memory.area(area).size());
            }
            Procedure::WriteSize { area, size } => {
                self.memory.area_mut(area).set_size(size);
                self.unsaved.mark_program(area);
            }
        }
    }
}
