//! Non-volatile memory on disk: one transactional file (`redb`) for all drives of a rig.
//!
//! A record is stored under `drive/model/record`. Writes go through one thread that commits
//! all that wait in one transaction, so a drive's reply can wait for its own without holding up others.

use redb::backends::InMemoryBackend;
use redb::{
    Builder, Database, DatabaseError, ReadableDatabase, ReadableTable, StorageBackend, StorageError,
    TableDefinition,
};
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Once, mpsc};
use std::thread;
use stepdrive_drive::smsd::{Memory, Record};
use stepdrive_spec::smsd::models::Model;
use tokio::sync::oneshot;

/// The file in the state folder.
const FILE: &str = "memory.redb";
/// Its name while it is being made.
const UNFINISHED: &str = "memory.redb.new";
/// The file whose lock says that a process uses the folder.
const LOCK: &str = "lock";

/// Records by `drive/model/record`.
const RECORDS: TableDefinition<'_, &str, &[u8]> = TableDefinition::new("smsd");

/// How much of the file is held in memory: all there is of some hundred drives.
const CACHE: usize = 1 << 20;

/// Why memory could not be read or written. Each displays as one line that names the file and says what to do.
#[derive(Clone, Debug, thiserror::Error)]
pub enum StoreError {
    /// The folder cannot be made or written.
    #[error("the state folder {folder} cannot be used: {why}; choose another with --state DIR")]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why not.
        why: String,
    },
    /// Another process has the file.
    #[error(
        "{file} is in use by another stepdrive; end that one, or choose another state folder with --state DIR"
    )]
    InUse {
        /// The file.
        file: PathBuf,
    },
    /// The file cannot be read.
    #[error("{file} cannot be read: {why}; choose another state folder with --state DIR")]
    Read {
        /// The file.
        file: PathBuf,
        /// Why not.
        why: String,
    },
    /// The file is not what was written.
    #[error(
        "{file} is damaged ({why}); it was left as it is: move it away to start with factory settings, or choose another state folder with --state DIR"
    )]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The file cannot be written.
    #[error("{file} cannot be written: {why}")]
    Write {
        /// The file.
        file: PathBuf,
        /// Why not.
        why: String,
    },
}

/// What a rig remembers, read and ready to be written.
#[derive(Debug)]
pub struct Store {
    file: PathBuf,
    records: BTreeMap<String, Vec<u8>>,
    jobs: mpsc::Sender<Job>,
    /// Ends when the file has been closed.
    closed: oneshot::Receiver<()>,
}

/// Writes the records of one drive.
#[derive(Clone, Debug)]
pub(crate) struct Saver {
    prefix: String,
    jobs: mpsc::Sender<Job>,
}

/// Records to be written, and who waits for them.
struct Job {
    records: Vec<(String, Vec<u8>)>,
    done: oneshot::Sender<Result<(), StoreError>>,
}

impl Store {
    /// Opens the store in a folder, making both when they are not there.
    ///
    /// # Errors
    /// When the folder cannot be used, another process has the store, or its file is damaged; the file is left as it is
    /// then.
    pub fn open(folder: &Path) -> Result<Store, StoreError> {
        let unusable = |why: io::Error| StoreError::Folder { folder: folder.into(), why: why.to_string() };
        fs::create_dir_all(folder).map_err(unusable)?;
        let file = folder.join(FILE);
        let lock = File::create(folder.join(LOCK)).map_err(unusable)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(StoreError::InUse { file }),
            Err(TryLockError::Error(error)) => return Err(unusable(error)),
        }
        if !file.try_exists().map_err(unusable)? {
            create(folder, &file).map_err(|why| StoreError::Write { file: file.clone(), why })?;
        }
        let records = read(&file)?;
        let database = open(&file)?;
        let (jobs, queue) = mpsc::channel();
        let (closing, closed) = oneshot::channel();
        let mut writer = Writer { file: file.clone(), database: Some(database), pending: BTreeMap::new() };
        let run = move || {
            writer.run(&queue);
            drop(writer);
            drop(lock);
            // Nobody waits for it when the rig was just dropped.
            let _ = closing.send(());
        };
        thread::Builder::new().name("store".into()).spawn(run).map_err(unusable)?;
        Ok(Store { file, records, jobs, closed })
    }

    /// What a drive remembers, once; factory settings when it has never been stored. Another model of the same name is
    /// another drive.
    ///
    /// # Errors
    /// When a record does not hold what it should.
    pub fn load(&mut self, drive: &str, model: Model) -> Result<Memory, StoreError> {
        let mut memory = Memory::factory();
        let prefix = prefix(drive, model);
        for record in Record::ALL {
            if let Some(bytes) = self.records.remove(&format!("{prefix}{}", record.name())) {
                let damaged =
                    |error| StoreError::Damaged { file: self.file.clone(), why: format!("{drive}: {error}") };
                memory.decode(record, &bytes).map_err(damaged)?;
            }
        }
        Ok(memory)
    }

    /// Returns once everything handed in is written and the file is closed: not while anybody can hand in more.
    pub async fn close(self) {
        let Store { jobs, closed, .. } = self;
        drop(jobs);
        // An error says that the thread has ended in another way, and the file is closed then too.
        let _ = closed.await;
    }

    /// What writes a drive's records from now on.
    pub(crate) fn saver(&self, drive: &str, model: Model) -> Saver {
        Saver { prefix: prefix(drive, model), jobs: self.jobs.clone() }
    }
}

fn prefix(drive: &str, model: Model) -> String {
    format!("{drive}/{model}/")
}

impl Saver {
    /// Hands records in to be written, now. What it returns ends when they and everything handed in before them is
    /// safely on disk; with no records it only waits for those before. They are written whether it is awaited or not.
    pub(crate) fn save(
        &self,
        records: Vec<(Record, Vec<u8>)>,
    ) -> impl Future<Output = Result<(), StoreError>> + use<> {
        let named = |(record, bytes): (Record, Vec<u8>)| (format!("{}{}", self.prefix, record.name()), bytes);
        let (done, outcome) = oneshot::channel();
        // When the thread has ended, the job is dropped here and `outcome` tells of it.
        let _ = self.jobs.send(Job { records: records.into_iter().map(named).collect(), done });
        async {
            let ended = |_| StoreError::Write { file: FILE.into(), why: "the store has ended".into() };
            outcome.await.map_err(ended)?
        }
    }
}

/// The thread that writes.
struct Writer {
    file: PathBuf,
    /// `None` after a failure: the database does not get over one, and is opened anew for the next commit.
    database: Option<Database>,
    /// Records that could not be written yet, the newest of each name.
    pending: BTreeMap<String, Vec<u8>>,
}

impl Writer {
    /// Writes what comes, all that waits in one transaction, until everybody who could send has gone.
    fn run(&mut self, queue: &mpsc::Receiver<Job>) {
        while let Ok(first) = queue.recv() {
            let mut waiting = Vec::new();
            for job in std::iter::once(first).chain(queue.try_iter()) {
                self.pending.extend(job.records);
                waiting.push(job.done);
            }
            let outcome = self.commit();
            for done in waiting {
                // Whoever asked may have gone; the records are written all the same.
                let _ = done.send(outcome.clone());
            }
        }
    }

    fn commit(&mut self) -> Result<(), StoreError> {
        if self.pending.is_empty() {
            return Ok(());
        }
        let failed =
            |error: redb::Error| StoreError::Write { file: self.file.clone(), why: error.to_string() };
        let database = match self.database.take() {
            Some(database) => database,
            None => open(&self.file)?,
        };
        write(&database, &self.pending).map_err(failed)?;
        self.database = Some(database);
        self.pending.clear();
        Ok(())
    }
}

fn open(file: &Path) -> Result<Database, StoreError> {
    Builder::new().set_cache_size(CACHE).open(file).map_err(|error| {
        let (file, why) = (file.into(), error.to_string());
        if matches!(error, DatabaseError::Storage(StorageError::Io(_))) {
            StoreError::Write { file, why }
        } else {
            StoreError::Damaged { file, why }
        }
    })
}

fn write(database: &Database, records: &BTreeMap<String, Vec<u8>>) -> Result<(), redb::Error> {
    let mut transaction = database.begin_write()?;
    // So that a damaged last commit is not taken for one that was interrupted, and silently undone.
    transaction.set_two_phase_commit(true);
    {
        let mut table = transaction.open_table(RECORDS)?;
        for (name, bytes) in records {
            table.insert(name.as_str(), bytes.as_slice())?;
        }
    }
    transaction.commit()?;
    Ok(())
}

/// Makes an empty store. It appears under its name whole or not at all.
fn create(folder: &Path, file: &Path) -> Result<(), String> {
    let unfinished = folder.join(UNFINISHED);
    let made = || -> Result<(), redb::Error> {
        if unfinished.try_exists()? {
            fs::remove_file(&unfinished)?;
        }
        let database = Builder::new().set_cache_size(CACHE).create(&unfinished)?;
        write(&database, &BTreeMap::new())?;
        drop(database);
        fs::rename(&unfinished, file)?;
        File::open(folder)?.sync_all()?;
        Ok(())
    };
    made().map_err(|error| error.to_string())
}

/// Reads all records of a store and checks every page of it. That is done on a copy in memory, so that the file stays
/// as it is, damaged or not.
fn read(file: &Path) -> Result<BTreeMap<String, Vec<u8>>, StoreError> {
    let damaged = |why: String| StoreError::Damaged { file: file.into(), why };
    let bytes =
        fs::read(file).map_err(|error| StoreError::Read { file: file.into(), why: error.to_string() })?;
    // A structure that is broken in the right places makes the database panic where it should return an error.
    let checked = quietly(move || read_copy(&bytes).map_err(|error| error.to_string()));
    checked.unwrap_or_else(|| Err("its structure is broken".into())).map_err(damaged)
}

fn read_copy(bytes: &[u8]) -> Result<BTreeMap<String, Vec<u8>>, redb::Error> {
    let copy = InMemoryBackend::new();
    copy.set_len(bytes.len() as u64)?;
    copy.write(0, bytes)?;
    // An empty file would be taken for a new store; a store is never empty.
    let mut database = match bytes {
        [] => return Err(redb::Error::Corrupted("the file is empty".into())),
        _ => Builder::new().set_cache_size(CACHE).create_with_backend(copy)?,
    };
    if !database.check_integrity()? {
        return Err(redb::Error::Corrupted("a page does not match its checksum".into()));
    }
    let mut records = BTreeMap::new();
    for entry in database.begin_read()?.open_table(RECORDS)?.iter()? {
        let (name, bytes) = entry?;
        records.insert(name.value().to_owned(), bytes.value().to_vec());
    }
    Ok(records)
}

/// Runs `check` on a thread of its own and gives `None` when it panics, without the message that a panic prints.
fn quietly<T: Send + 'static>(check: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    const NAME: &str = "store-check";
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let others = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if thread::current().name() != Some(NAME) {
                others(panic);
            }
        }));
    });
    thread::Builder::new().name(NAME.into()).spawn(check).ok()?.join().ok()
}
