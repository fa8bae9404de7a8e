//! Files that are not what was written.

use crate::bench::Bench;
use std::fs;
use std::path::PathBuf;
use stepdrive_drive::smsd::Memory;
use stepdrive_server::store::{Store, StoreError};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use tempfile::TempDir;

/// A store with something in it, and what that is.
struct Specimen {
    folder: TempDir,
    /// The bytes of the file.
    intact: Vec<u8>,
    memory: Memory,
}

impl Specimen {
    /// The file of a drive that has been used a while and then switched off.
    async fn at_rest() -> Specimen {
        let bench = used().await;
        let folder = bench.stop().await;
        let intact = fs::read(folder.path().join("memory.redb")).expect("readable");
        Specimen::new(folder, intact).await
    }

    /// The file of such a drive as it is while it is in use, or after a kill.
    async fn in_use() -> Specimen {
        let bench = used().await;
        let intact = fs::read(bench.file()).expect("readable");
        Specimen::new(bench.stop().await, intact).await
    }

    async fn new(folder: TempDir, intact: Vec<u8>) -> Specimen {
        let mut specimen = Specimen { folder, intact, memory: Memory::factory() };
        specimen.memory = specimen.open(&specimen.intact).await.expect("intact");
        assert_eq!(specimen.memory.password, 0x0004_0003_0002_0001);
        specimen
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("memory.redb")
    }

    /// Opens a store of these bytes. After a failure the file must be as it was.
    async fn open(&self, bytes: &[u8]) -> Result<Memory, StoreError> {
        fs::write(self.file(), bytes).expect("written");
        let error = match Store::open(self.folder.path()) {
            Ok(mut store) => {
                let memory = store.load("stage", Model::Smsd42);
                store.close().await;
                return memory;
            }
            Err(error) => error,
        };
        assert!(fs::read(self.file()).expect("readable") == bytes, "the file was changed");
        Err(error)
    }

    /// Whether a store of these bytes is refused as damaged, in one line that names the file. If it is not, what it
    /// remembers has to be the whole truth: not every byte of a file means something.
    async fn refused(&self, bytes: &[u8], how: &str) -> bool {
        match self.open(bytes).await {
            Ok(memory) => {
                assert!(memory == self.memory, "{how}: the drive remembers something else");
                false
            }
            Err(error) => {
                let line = error.to_string();
                assert!(matches!(error, StoreError::Damaged { .. }), "{how}: {line}");
                let named = line.contains(&self.file().display().to_string());
                assert!(named && line.lines().count() == 1, "{how}: {line}");
                true
            }
        }
    }

    /// Flips bytes all over the file, one at a time, and returns how many of these were found out.
    async fn flip(&self) -> usize {
        let used = self.intact.iter().enumerate().skip(320).filter(|(_, byte)| **byte != 0);
        // The header densely, then a selection of the bytes that hold anything.
        let offsets = (0..320).step_by(3).chain(used.map(|(at, _)| at).step_by(281));
        let mut found = 0;
        for at in offsets {
            let mut bytes = self.intact.clone();
            bytes[at] ^= 0xFF;
            found += usize::from(self.refused(&bytes, &format!("byte {at}")).await);
        }
        found
    }
}

/// A drive that has been used a while.
async fn used() -> Bench {
    let bench = Bench::start().await;
    let mut client = bench.client().await;
    for current in 1..=20 {
        client.write(Reg::WorkCurrent, &[current]).await.expect("accepted");
    }
    let program: Vec<u32> = (0..32).map(|line| line << 10 | 0x10 << 4).collect();
    client.store_program(0, &program).await;
    client.write(Reg::PasswordLow32, &[1, 2, 3, 4, 1]).await.expect("changed");
    bench
}

#[tokio::test]
async fn flipped_bytes_in_a_file_at_rest_are_found_or_harmless() {
    assert!(Specimen::at_rest().await.flip().await > 20);
}

#[tokio::test]
async fn flipped_bytes_in_the_file_of_a_killed_server_are_found_or_harmless() {
    assert!(Specimen::in_use().await.flip().await > 20);
}

#[tokio::test]
async fn a_file_cut_short_is_damaged() {
    let specimen = Specimen::at_rest().await;
    let size = specimen.intact.len();
    for length in (0..400).step_by(37).chain((400..size).step_by(7001)).chain([size - 1]) {
        let how = format!("{length} bytes");
        assert!(specimen.refused(&specimen.intact[..length], &how).await, "{how}");
    }
}

#[tokio::test]
async fn a_file_of_something_else_is_damaged() {
    let specimen = Specimen::at_rest().await;
    let size = specimen.intact.len();
    for (how, bytes) in [
        ("empty", vec![]),
        ("zeros", vec![0; size]),
        ("ones", vec![0xFF; size]),
        ("text", b"It was a dark and stormy night. ".repeat(size / 32)),
        ("a header without the rest", [&specimen.intact[..4096], &vec![0; size - 4096]].concat()),
    ] {
        assert!(specimen.refused(&bytes, how).await, "{how}");
    }
}

#[tokio::test]
async fn a_record_of_the_wrong_size_is_damaged_and_named() {
    let specimen = Specimen::at_rest().await;
    let database = redb::Database::open(specimen.file()).expect("intact");
    let transaction = database.begin_write().expect("writable");
    let table = redb::TableDefinition::<&str, &[u8]>::new("smsd");
    transaction
        .open_table(table)
        .expect("there")
        .insert("stage/SMSD-4.2LAN/motor", &[1, 2, 3][..])
        .expect("put");
    transaction.commit().expect("written");
    drop(database);
    let bytes = fs::read(specimen.file()).expect("readable");
    let error = specimen.open(&bytes).await.expect_err("a motor configuration has four bytes");
    assert!(matches!(error, StoreError::Damaged { .. }), "{error}");
    assert!(error.to_string().contains("stage: the stored record `motor` is damaged"), "{error}");
}

#[tokio::test]
async fn a_file_that_cannot_be_read_is_not_called_damaged() {
    let folder = TempDir::new().expect("a temporary folder");
    fs::create_dir(folder.path().join("memory.redb")).expect("made");
    let error = Store::open(folder.path()).expect_err("a folder is no file");
    assert!(matches!(error, StoreError::Read { .. }), "{error}");
}

#[tokio::test]
async fn what_is_left_of_an_unfinished_first_start_does_not_matter() {
    let folder = TempDir::new().expect("a temporary folder");
    fs::write(folder.path().join("memory.redb.new"), "half a file").expect("written");
    let mut store = Store::open(folder.path()).expect("opened");
    assert_eq!(store.load("stage", Model::Smsd42).expect("empty"), Memory::factory());
    store.close().await;
}
