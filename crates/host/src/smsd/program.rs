//! User programs in the memory areas (ch. 5).

use super::client::SmsdClient;
use super::driver::Smsd;
use super::value::Slot;
use crate::Error;
use std::time::Duration;
use stepdrive_spec::smsd::instructions::{Instruction, PROGRAM_AREAS, PROGRAM_LINES};
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::{Instant, sleep};

/// Time between the first two looks whether a procedure has ended; then twice that each time.
const FIRST_LOOK: Duration = Duration::from_millis(2);
/// Most time between two looks.
const LAST_LOOK: Duration = Duration::from_millis(50);

/// A procedure of `MEM_CMD`; the number is its code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Procedure {
    /// Instructions to the buffer.
    Read = 0,
    /// Instructions from the buffer.
    Write = 1,
    /// Erases an area, its size too.
    Erase = 2,
    /// The size to `PROG_SIZE`.
    ReadSize = 3,
    /// The size from `PROG_SIZE`.
    WriteSize = 4,
}

impl Procedure {
    fn what(self) -> &'static str {
        match self {
            Procedure::Read => "reading instructions",
            Procedure::Write => "writing instructions",
            Procedure::Erase => "erasing the program",
            Procedure::ReadSize => "reading the size",
            Procedure::WriteSize => "writing the size",
        }
    }
}

impl SmsdClient {
    /// Stores a program of up to 255 instructions in memory area 0 to 3, and reads it back, telling how many instructions
    /// have been written or read back so far: twice the length of the program at its end. What was there is erased.
    ///
    /// # Errors
    /// Those of [`SmsdClient::write_at`]; [`Error::Usage`] when there is no such area or the program is too long;
    /// [`Error::Refused`] while the program in that area runs; [`Error::Differs`] when it does not read back as it was
    /// written; [`Error::Partly`] when part of it is in the memory.
    pub async fn store_program_with(
        &self,
        area: u8,
        program: &[Instruction],
        mut progress: impl FnMut(usize) + Send,
    ) -> Result<(), Error> {
        let size = size_of(program)?;
        let _turn = self.choose_area(area).await?;
        self.procedure(Procedure::Erase).await?;
        let mut written = 0;
        for block in program.chunks(block_lines()) {
            let outcome = self.write_block(written, block).await;
            outcome.map_err(|cause| incomplete(area, written, program.len(), cause))?;
            written += block.len();
            progress(written);
        }
        let sized = async {
            self.write(Reg::ProgSize, size).await?;
            self.procedure(Procedure::WriteSize).await
        };
        sized.await.map_err(|cause| incomplete(area, written, program.len(), cause))?;
        let found =
            self.read_back(|count| progress(written + count)).await.map_err(|cause| Error::Partly {
                done: format!("the program was written to memory {area}, but not read back"),
                cause: Box::new(cause),
            })?;
        compare(area, program, &found)
    }

    /// The program in memory area 0 to 3, telling how many instructions have been read so far.
    ///
    /// # Errors
    /// Those of [`SmsdClient::write_at`]; [`Error::Usage`] when there is no such area; [`Error::Device`] when what is there is
    /// no program.
    pub async fn fetch_program_with(
        &self,
        area: u8,
        progress: impl FnMut(usize) + Send,
    ) -> Result<Vec<Instruction>, Error> {
        let _turn = self.choose_area(area).await?;
        let words = self.read_back(progress).await?;
        let instruction = |(line, word): (usize, &u32)| {
            let instruction = Instruction::from_word(*word);
            instruction
                .map_err(|why| Error::Device(format!("line {line} of memory {area} is {word:#010X}: {why}")))
        };
        words.iter().enumerate().map(instruction).collect()
    }

    /// Erases memory area 0 to 3, and reads back that it is empty.
    ///
    /// # Errors
    /// Those of [`SmsdClient::store_program_with`].
    pub async fn erase_program(&self, area: u8) -> Result<(), Error> {
        let _turn = self.choose_area(area).await?;
        self.procedure(Procedure::Erase).await?;
        let found = self.read_back(|_| {}).await?;
        compare(area, &[], &found)
    }

    /// Takes the registers of `MEM_CMD` for itself, and names the area to it.
    async fn choose_area(&self, area: u8) -> Result<impl Drop + use<'_>, Error> {
        check_area(area)?;
        let turn = self.memory.lock().await;
        self.write(Reg::NProg, area.into()).await?;
        Ok(turn)
    }

    /// Writes instructions from a line on.
    async fn write_block(&self, first: usize, block: &[Instruction]) -> Result<(), Error> {
        self.choose_sector(first, block.len()).await?;
        let buffer = Slot::all(Reg::CmdBuffer.info()).zip(block);
        self.write_slots(buffer.map(|(slot, line)| (slot, i64::from(line.word()))).collect()).await?;
        self.procedure(Procedure::Write).await
    }

    /// The words of the program in the chosen area.
    async fn read_back(&self, mut progress: impl FnMut(usize) + Send) -> Result<Vec<u32>, Error> {
        self.procedure(Procedure::ReadSize).await?;
        let size = self.read(Reg::ProgSize).await?;
        let size = usize::try_from(size).ok().filter(|size| *size <= PROGRAM_LINES).ok_or_else(|| {
            Error::Device(format!("the size of the program reads {size}, and can be {PROGRAM_LINES} at most"))
        })?;
        let mut words = Vec::with_capacity(size);
        while words.len() < size {
            let count = block_lines().min(size - words.len());
            self.choose_sector(words.len(), count).await?;
            self.procedure(Procedure::Read).await?;
            let slots: Vec<Slot> = Slot::all(Reg::CmdBuffer.info()).take(count).collect();
            let values = self.read_run(super::value::Run { slots: &slots }).await?;
            words.extend(values.into_iter().map(|value| u32::try_from(value).unwrap_or(u32::MAX)));
            progress(words.len());
        }
        Ok(words)
    }

    async fn choose_sector(&self, first: usize, count: usize) -> Result<(), Error> {
        let number = |count: usize| i64::try_from(count).unwrap_or(i64::MAX);
        self.write_many(&[(Reg::NStr, number(first)), (Reg::SectorSize, number(count))]).await
    }

    /// Runs a procedure and waits for its end. The registers are set. When its reply is lost, `B_COMPLETE`, which was
    /// cleared before, says what has become of it.
    async fn procedure(&self, procedure: Procedure) -> Result<(), Error> {
        self.write(Reg::BComplete, 0).await?;
        let slot = Slot::new(Reg::MemCmd, 0)?;
        let lost = self.act_once(slot, i64::from(procedure as u8)).await?.err();
        let done = self.wait_for_completion().await;
        match (lost, done) {
            (_, Ok(true)) => self.write(Reg::BComplete, 0).await,
            (None, Ok(false)) => Err(Error::Device(format!(
                "{} ({slot} {}) has not ended within {:?}: B_COMPLETE stays FALSE",
                procedure.what(),
                procedure as u8,
                self.options.memory_timeout
            ))),
            (None, Err(error)) => Err(error),
            (Some(lost), outcome) => {
                let seen = match outcome {
                    Ok(_) => "B_COMPLETE stays FALSE, so it has not ended, if it was begun".to_owned(),
                    Err(error) => format!("B_COMPLETE could not be read ({error})"),
                };
                let command = format!("{slot} {} ({})", procedure as u8, procedure.what());
                Err(Error::Uncertain {
                    command,
                    state: format!("{seen}{}", self.but(&lost).await),
                    cause: lost.cause,
                })
            }
        }
    }

    /// Waits for `B_COMPLETE`; `false` when it does not come in time.
    async fn wait_for_completion(&self) -> Result<bool, Error> {
        let deadline = Instant::now() + self.options.memory_timeout;
        let mut pace = FIRST_LOOK;
        loop {
            sleep(pace).await;
            let late = Instant::now() >= deadline;
            if self.read(Reg::BComplete).await? != 0 {
                return Ok(true);
            } else if late {
                return Ok(false);
            }
            pace = LAST_LOOK.min(pace * 2);
        }
    }
}

/// How many instructions the buffer holds.
fn block_lines() -> usize {
    usize::from(Reg::CmdBuffer.info().count)
}

/// Fails when there is no such memory area.
pub(super) fn check_area(area: u8) -> Result<(), Error> {
    if usize::from(area) < PROGRAM_AREAS {
        return Ok(());
    }
    let last = PROGRAM_AREAS - 1;
    Err(Error::Usage(format!("there is no memory {area}; they are numbered 0 to {last}; nothing was sent")))
}

/// The length of a program that can be stored.
pub(super) fn size_of(program: &[Instruction]) -> Result<i64, Error> {
    let usage = |text: String| Err(Error::Usage(format!("{text}; nothing was sent")));
    if program.len() > PROGRAM_LINES {
        let (lines, most) = (program.len(), PROGRAM_LINES);
        return usage(format!("the program has {lines} instructions, and a memory area holds {most}"));
    }
    for (line, instruction) in program.iter().enumerate() {
        let Instruction { opcode, data } = instruction;
        if !opcode.info().in_program {
            return usage(format!("line {line} is {opcode}, which has no place in a program"));
        } else if Instruction::from_word(instruction.word()) != Ok(*instruction) {
            return usage(format!("line {line} is {opcode} {data}, whose operand takes more than 22 bits"));
        }
    }
    Ok(i64::try_from(program.len()).unwrap_or(i64::MAX))
}

fn incomplete(area: u8, written: usize, of: usize, cause: Error) -> Error {
    let done = format!("memory {area} was erased and {written} of {of} instructions were written to it");
    Error::Partly { done, cause: Box::new(cause) }
}

/// Fails when what was read back is not the program.
pub(super) fn compare(area: u8, program: &[Instruction], found: &[u32]) -> Result<(), Error> {
    if program.len() != found.len() {
        let (found, stored) = (found.len(), program.len());
        return Err(Error::Differs(format!(
            "memory {area} has {found} instructions, not the {stored} stored"
        )));
    }
    let differs = program.iter().zip(found).position(|(line, word)| line.word() != *word);
    let Some(line) = differs else { return Ok(()) };
    let read = found.get(line).copied().unwrap_or(0);
    let stored = program.get(line).map_or(0, |line| line.word());
    Err(Error::Differs(format!(
        "line {line} of memory {area} reads {read:#010X}, not {stored:#010X} as stored"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::instructions::Opcode;

    #[test]
    fn what_cannot_be_stored_is_told_before_anything_is_sent() {
        let text = |program: &[Instruction]| size_of(program).expect_err("refused").to_string();
        let end = Instruction { opcode: Opcode::End, data: 0 };
        assert_eq!(
            text(&[end; 256]),
            "the program has 256 instructions, and a memory area holds 255; nothing was sent"
        );
        assert_eq!(
            text(&[end, Instruction { opcode: Opcode::GetSpeed, data: 0 }]),
            "line 1 is GET_SPEED, which has no place in a program; nothing was sent"
        );
        assert_eq!(
            text(&[Instruction { opcode: Opcode::SetWait, data: 1 << 22 }]),
            "line 0 is SET_WAIT 4194304, whose operand takes more than 22 bits; nothing was sent"
        );
        assert_eq!(size_of(&[end; 255]), Ok(255));
    }

    #[test]
    fn a_program_that_reads_back_otherwise_is_told_by_its_line() {
        let line = Instruction { opcode: Opcode::MoveF, data: 5 };
        assert_eq!(compare(1, &[line, line], &[line.word(), line.word()]), Ok(()));
        let text = compare(1, &[line, line], &[line.word(), 0]).expect_err("differs").to_string();
        assert_eq!(text, "line 1 of memory 1 reads 0x00000000, not 0x00001500 as stored");
        let text = compare(1, &[line], &[]).expect_err("differs").to_string();
        assert_eq!(text, "memory 1 has 0 instructions, not the 1 stored");
    }
}
