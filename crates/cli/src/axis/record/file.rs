//! The file that is recorded to.

use crate::Failure;
use crate::table::{Column, CsvWriter, Format, ParquetWriter, Row};
use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::time::Instant;

/// How long rows of CSV may wait until they are in the file.
const FLUSHED_EVERY: Duration = Duration::from_secs(1);

/// A recording that is written.
pub(super) struct Sink {
    path: PathBuf,
    writer: Writer,
    flushed: Instant,
    /// From one row to the next.
    period: Duration,
}

enum Writer {
    Csv(Box<CsvWriter<File>>),
    Parquet(Box<ParquetWriter>),
}

/// Refuses a file that is there, unless it may be replaced.
pub(super) fn check_free(path: &Path, force: bool) -> Result<(), Failure> {
    if path.exists() && !force { Err(exists(path)) } else { Ok(()) }
}

impl Sink {
    /// Begins a recording.
    pub(super) fn create(
        path: &Path,
        force: bool,
        columns: &[Column],
        period: Duration,
    ) -> Result<Sink, Failure> {
        let format = Format::of(path)?;
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(true).create_new(!force);
        let file = options.open(path).map_err(|error| {
            let taken = error.kind() == io::ErrorKind::AlreadyExists;
            if taken { exists(path) } else { cannot_write(path, &error) }
        })?;
        let writer = match format {
            Format::Csv => CsvWriter::new(file, columns).map(|writer| Writer::Csv(Box::new(writer))),
            Format::Parquet => {
                ParquetWriter::new(file, columns).map(|writer| Writer::Parquet(Box::new(writer)))
            }
        };
        let writer = writer.map_err(|error| cannot_write(path, &error))?;
        Ok(Sink { path: path.to_owned(), writer, flushed: Instant::now(), period })
    }

    /// Writes a row. A row of CSV is in the file after a second at most.
    pub(super) fn write(&mut self, row: &Row) -> Result<(), Failure> {
        let written = match &mut self.writer {
            Writer::Csv(csv) => {
                let due = self.flushed.elapsed() + self.period >= FLUSHED_EVERY;
                csv.write(row).and_then(|()| if due { csv.flush() } else { Ok(()) }).map(|()| due)
            }
            Writer::Parquet(parquet) => parquet.write(row).map(|()| false),
        };
        if written.map_err(|error| cannot_write(&self.path, &error))? {
            self.flushed = Instant::now();
        }
        Ok(())
    }

    /// Ends the recording.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let finished = match self.writer {
            Writer::Csv(csv) => csv.finish(),
            Writer::Parquet(parquet) => parquet.finish(),
        };
        finished.map_err(|error| cannot_write(&self.path, &error))
    }
}

fn exists(path: &Path) -> Failure {
    Failure::Usage(format!("{} exists; --force replaces it", path.display()))
}

fn cannot_write(path: &Path, error: &io::Error) -> Failure {
    Failure::Failed(format!("cannot write {}: {error}", path.display()))
}
