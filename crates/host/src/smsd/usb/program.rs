//! User programs: a memory area is read and written whole, in one packet.

use super::client::SmsdUsbClient;
use super::trouble::Asked;
use crate::Error;
use crate::smsd::driver::Progress;
use crate::smsd::program::{check_area, compare, size_of};
use stepdrive_spec::smsd::instructions::{Instruction, PROGRAM_LINES};
use stepdrive_spec::smsd::standard::{Request, Words};

impl SmsdUsbClient {
    /// Stores a program and reads it back.
    pub(super) async fn store(
        &self,
        area: u8,
        program: &[Instruction],
        progress: Progress<'_>,
    ) -> Result<(), Error> {
        check_area(area)?;
        size_of(program)?;
        let words: Words = program.iter().map(|line| line.word()).collect();
        let _turn = self.whole.lock().await;
        self.told(&Request::WriteMemory { area, words }, &Asked::Store(area)).await?;
        progress(program.len());
        let found = self.words(area).await.map_err(|cause| Error::Partly {
            done: format!("the program was written to memory {area}, but not read back"),
            cause: Box::new(cause),
        })?;
        progress(program.len() + found.len());
        compare(area, program, without_padding(&found, program.len()))
    }

    /// The program in a memory area.
    pub(super) async fn fetch(&self, area: u8, progress: Progress<'_>) -> Result<Vec<Instruction>, Error> {
        check_area(area)?;
        let words = self.words(area).await?;
        progress(words.len());
        let instruction = |(line, word): (usize, &u32)| {
            let instruction = Instruction::from_word(*word);
            instruction
                .map_err(|why| Error::Device(format!("line {line} of memory {area} is {word:#010X}: {why}")))
        };
        words.iter().enumerate().map(instruction).collect()
    }
}

/// What was read back, without the END that a controller may fill the rest of the area with: whether one does is not known
/// (sheet §11).
fn without_padding(found: &[u32], stored: usize) -> &[u32] {
    match found.split_at_checked(stored) {
        Some((program, rest)) if found.len() == PROGRAM_LINES && rest.iter().all(|word| *word == 0) => {
            program
        }
        _ => found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn end_behind_a_program_up_to_the_end_of_the_area_is_padding() {
        let mut padded = vec![5; 3];
        padded.resize(PROGRAM_LINES, 0);
        assert_eq!(without_padding(&padded, 3), [5, 5, 5]);
        assert_eq!(without_padding(&padded, 2).len(), PROGRAM_LINES, "line 2 is no END");
        assert_eq!(without_padding(&[5, 0], 1), [5, 0], "the area does not end there");
        assert_eq!(without_padding(&[5], 3), [5]);
    }
}
