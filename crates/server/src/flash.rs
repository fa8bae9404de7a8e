//! The flash of an SMD3: a small file for each drive, replaced whole at every `STORE`.
//!
//! It is not in the store of the SMSDs, because an SMD3 has a way to say that its configuration is damaged, and comes up
//! all the same: with the factory's settings and the flag `CONFIGURATION ERROR`.

use crate::store::StoreError;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stepdrive_drive::smd3::{Settings, Stored};
use tokio::sync::Semaphore;

/// How many damaged configurations of a drive are kept beside the good one.
const KEPT: u32 = 1000;

/// The flash of a drive.
#[derive(Clone, Debug)]
pub(crate) struct Flash {
    file: Arc<PathBuf>,
    /// The turn to replace the file, so that an older configuration never follows a newer one. There is none any more
    /// once the flash is closed.
    turn: Arc<Semaphore>,
}

impl Flash {
    /// The flash of the drive with this name, in a state folder.
    pub(crate) fn new(folder: &Path, drive: &str) -> Flash {
        Flash { file: Arc::new(folder.join(format!("{drive}.smd3"))), turn: Arc::new(Semaphore::new(1)) }
    }

    /// What it holds, and where a damaged configuration was copied to.
    pub(crate) fn load(&self) -> Result<(Stored, Option<PathBuf>), StoreError> {
        let unreadable =
            |error: io::Error| StoreError::Read { file: self.file.to_path_buf(), why: error.to_string() };
        match fs::read(&*self.file) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok((Stored::Nothing, None)),
            Err(error) => Err(unreadable(error)),
            Ok(bytes) => match Settings::decode(&bytes) {
                Ok(settings) => Ok((Stored::Intact(settings), None)),
                Err(_) => Ok((Stored::Damaged, Some(self.keep(&bytes).map_err(unreadable)?))),
            },
        }
    }

    /// Why it could not be written.
    pub(crate) fn not_written(&self, error: &io::Error) -> StoreError {
        StoreError::Write { file: self.file.to_path_buf(), why: error.to_string() }
    }

    /// Copies a damaged configuration beside the file, unless the same is there already.
    fn keep(&self, bytes: &[u8]) -> io::Result<PathBuf> {
        for number in 1..KEPT {
            let copy = self.file.with_extension(format!("smd3.damaged{number}"));
            match fs::read(&copy) {
                Ok(kept) if kept == bytes => return Ok(copy),
                Ok(_) => {}
                Err(_) => return fs::write(&copy, bytes).map(|()| copy),
            }
        }
        Err(io::Error::other("there are too many damaged configurations beside it"))
    }

    /// Puts a configuration in the place of what it holds; `latest` is asked for it when its turn has come. What was there
    /// stays until the new one is safely written. Once begun it is brought to its end, whether it is awaited or not.
    pub(crate) async fn save(
        &self,
        latest: impl FnOnce() -> Option<Vec<u8>> + Send + 'static,
    ) -> io::Result<()> {
        let turn = Arc::clone(&self.turn).acquire_owned().await.map_err(io::Error::other)?;
        let file = Arc::clone(&self.file);
        let written = tokio::task::spawn_blocking(move || {
            let written = latest().map_or(Ok(()), |bytes| replace(&file, &bytes));
            drop(turn);
            written
        });
        written.await.map_err(io::Error::other)?
    }

    /// Returns once what was begun is written; nothing is written any more.
    pub(crate) async fn close(&self) {
        // An error says that it is closed already.
        let _turn = self.turn.acquire().await;
        self.turn.close();
    }
}

fn replace(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let unfinished = file.with_extension("smd3.new");
    let mut new = File::create(&unfinished)?;
    new.write_all(bytes)?;
    new.sync_all()?;
    fs::rename(&unfinished, file)?;
    file.parent().map_or(Ok(()), |folder| File::open(folder)?.sync_all())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_drive_has_nothing_in_its_flash() {
        let folder = tempfile::tempdir().expect("a folder");
        let flash = Flash::new(folder.path(), "uhv");
        assert_eq!(flash.load().expect("readable"), (Stored::Nothing, None));
    }

    #[test]
    fn what_is_written_is_read_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let flash = Flash::new(folder.path(), "uhv");
        replace(&flash.file, &Settings::factory().encode()).expect("written");
        assert_eq!(flash.load().expect("readable"), (Stored::Intact(Settings::factory()), None));
    }

    #[test]
    fn a_damaged_configuration_stays_and_is_kept_beside_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let flash = Flash::new(folder.path(), "uhv");
        let mut bytes = Settings::factory().encode().to_vec();
        bytes[9] ^= 0x40;
        fs::write(&*flash.file, &bytes).expect("written");
        for _ in 0..3 {
            let (stored, copy) = flash.load().expect("readable");
            assert_eq!(stored, Stored::Damaged);
            assert_eq!(fs::read(copy.expect("a copy")).expect("readable"), bytes);
        }
        assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 2);
        assert_eq!(fs::read(&*flash.file).expect("readable"), bytes);
    }

    #[test]
    fn a_configuration_with_any_byte_flipped_or_cut_off_anywhere_is_damaged() {
        let folder = tempfile::tempdir().expect("a folder");
        let flash = Flash::new(folder.path(), "uhv");
        let intact = Settings::factory().encode().to_vec();
        let flipped = (0..intact.len()).map(|at| {
            let mut bytes = intact.clone();
            bytes[at] ^= 1 << (at % 8);
            bytes
        });
        let cut = (0..intact.len()).map(|length| intact[..length].to_vec());
        for bytes in flipped.chain(cut) {
            fs::write(&*flash.file, &bytes).expect("written");
            let (stored, copy) = flash.load().expect("readable");
            assert_eq!(stored, Stored::Damaged);
            assert_eq!(fs::read(copy.expect("a copy")).expect("readable"), bytes);
            assert_eq!(fs::read(&*flash.file).expect("readable"), bytes);
        }
    }
}
