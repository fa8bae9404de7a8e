//! Tables of quantities over time, as `stepdrive record` writes and `stepdrive plot` reads them, in CSV and Parquet.
//!
//! The first column is `time [s]`, seconds since the first row on a clock that nobody sets; the second is `utc`, the same
//! as a date. The others are quantities: a name, and a unit in brackets. An empty cell is a value that could not be had.

mod csv;
mod parquet;

pub(crate) use self::csv::CsvWriter;
pub(crate) use self::parquet::ParquetWriter;

use crate::Failure;
use std::fmt;
use std::fs::File;
use std::path::Path;

/// The heading of the first column.
pub(crate) const TIME: &str = "time [s]";

/// The heading of the second column.
pub(crate) const UTC: &str = "utc";

/// What a table is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Csv,
    Parquet,
}

impl Format {
    /// The format that a file's name says.
    pub(crate) fn of(path: &Path) -> Result<Format, Failure> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "csv" => Ok(Format::Csv),
            "parquet" => Ok(Format::Parquet),
            _ => Err(Failure::Usage(format!(
                "{}: a recording's name ends in .csv or .parquet, which says what it is written in",
                path.display()
            ))),
        }
    }

    /// Its name.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Format::Csv => "csv",
            Format::Parquet => "parquet",
        }
    }
}

/// A quantity. It displays as its heading: `stage.position [mm]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Column {
    /// Its name, with the axis' before it.
    pub(crate) name: String,
    /// Its unit; empty for a plain number.
    pub(crate) unit: String,
}

impl Column {
    /// The column under a heading.
    fn under(heading: &str) -> Column {
        let parts = heading.strip_suffix(']').and_then(|rest| rest.rsplit_once(" ["));
        let (name, unit) = parts.unwrap_or((heading, ""));
        Column { name: name.to_owned(), unit: unit.to_owned() }
    }

    /// Whether a person who says `word` means it: its heading, its name, or its name without the axis'.
    pub(crate) fn is_called(&self, word: &str) -> bool {
        let behind = self.name.rsplit_once('.').map_or(self.name.as_str(), |(_, behind)| behind);
        word == self.to_string() || word == self.name || word == behind
    }
}

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.unit.is_empty() {
            f.pad(&self.name)
        } else {
            f.pad(&format!("{} [{}]", self.name, self.unit))
        }
    }
}

/// A row that is written.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// Seconds since the first row.
    pub(crate) seconds: f64,
    /// The date of it.
    pub(crate) utc: chrono::DateTime<chrono::Utc>,
    /// A value for each column.
    pub(crate) values: Vec<Option<f64>>,
}

/// A column with its values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Series {
    /// What it is.
    pub(crate) column: Column,
    /// A value for each row.
    pub(crate) values: Vec<Option<f64>>,
}

/// A table that was read.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Table {
    /// The date of the first row, as it stands there.
    pub(crate) started: Option<String>,
    /// When each row was, in seconds.
    pub(crate) times: Vec<f64>,
    /// The quantities.
    pub(crate) series: Vec<Series>,
}

impl Table {
    /// Reads a recording.
    pub(crate) fn read(path: &Path) -> Result<Table, Failure> {
        let format = Format::of(path)?;
        let file = File::open(path).map_err(|error| cannot_read(path, &error.to_string()))?;
        let table = match format {
            Format::Csv => csv::read(file),
            Format::Parquet => parquet::read(file),
        };
        table.map_err(|why| cannot_read(path, &why))
    }

    /// A table without rows under these headings.
    fn with_headings<'a>(headings: impl IntoIterator<Item = &'a str>) -> Result<Table, String> {
        let mut headings = headings.into_iter().peekable();
        if headings.next() != Some(TIME) {
            return Err(format!(
                "it is no recording of `stepdrive record`: its first column is not `{TIME}`"
            ));
        }
        let _ = headings.next_if_eq(&UTC);
        let series = headings.map(|heading| Series { column: Column::under(heading), values: Vec::new() });
        Ok(Table { series: series.collect(), ..Table::default() })
    }

    /// Takes the time of a row. Rows stand in the order of time.
    fn push_time(&mut self, seconds: f64) -> Result<(), String> {
        let is_next = self.times.last().is_none_or(|last| *last <= seconds);
        if !seconds.is_finite() || !is_next {
            return Err(format!("row {}: {seconds} is no time that can follow", self.times.len() + 1));
        }
        self.times.push(seconds);
        Ok(())
    }
}

fn cannot_read(path: &Path, why: &str) -> Failure {
    Failure::Usage(format!("cannot read {}: {why}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_is_a_name_and_a_unit_in_brackets() {
        for (heading, name, unit) in [
            ("stage.position [mm]", "stage.position", "mm"),
            ("stage.SPEED [full steps/s]", "stage.SPEED", "full steps/s"),
            ("stage.Inputs", "stage.Inputs", ""),
            ("odd] [name", "odd] [name", ""),
        ] {
            let column = Column::under(heading);
            assert_eq!((column.name.as_str(), column.unit.as_str()), (name, unit));
            assert_eq!(column.to_string(), heading);
        }
    }

    #[test]
    fn a_column_is_called_by_its_heading_its_name_or_what_stands_behind_the_axis() {
        let column = Column::under("10.0.0.5:502.position [mm]");
        for word in ["10.0.0.5:502.position [mm]", "10.0.0.5:502.position", "position"] {
            assert!(column.is_called(word), "{word}");
        }
        assert!(!column.is_called("pos") && !column.is_called("mm") && !column.is_called(""));
    }

    #[test]
    fn the_name_of_a_file_says_its_format() {
        assert_eq!(Format::of(Path::new("a/run.CSV")).ok(), Some(Format::Csv));
        assert_eq!(Format::of(Path::new("run.parquet")).ok(), Some(Format::Parquet));
        assert!(Format::of(Path::new("run.xlsx")).is_err() && Format::of(Path::new("run")).is_err());
    }

    #[test]
    fn both_formats_give_back_what_was_written() {
        let columns = [Column::under("a.position [mm]"), Column::under("a.Inputs")];
        let utc = chrono::DateTime::from_timestamp_millis(1_700_000_000_125).expect("a date");
        let rows = [[Some(-0.1), Some(3.0)], [None, None], [Some(1.0 / 3.0), None]];
        let rows = rows.iter().zip([0.0, 0.1, 0.2]).map(|(values, seconds)| Row {
            seconds,
            utc,
            values: values.to_vec(),
        });
        let rows: Vec<Row> = rows.collect();

        let mut text = Vec::new();
        let mut csv = CsvWriter::new(&mut text, &columns).expect("written");
        for row in &rows {
            csv.write(row).expect("written");
        }
        csv.finish().expect("written");

        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.parquet");
        let file = File::create(&path).expect("created");
        let mut parquet = ParquetWriter::new(file, &columns).expect("written");
        for row in &rows {
            parquet.write(row).expect("written");
        }
        parquet.finish().expect("written");

        let table = super::csv::read(text.as_slice()).expect("read");
        assert_eq!(Table::read(&path).ok(), Some(table.clone()));
        assert_eq!(table.started.as_deref(), Some("2023-11-14T22:13:20.125Z"));
        assert_eq!(table.times, [0.0, 0.1, 0.2]);
        assert_eq!(table.series[0].column, columns[0]);
        assert_eq!(table.series[0].values, [Some(-0.1), None, Some(1.0 / 3.0)]);
        assert_eq!(table.series[1].values, [Some(3.0), None, None]);
    }
}
