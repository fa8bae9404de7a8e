//! Tables in CSV.

use super::{Column, Row, TIME, Table, UTC};
use chrono::SecondsFormat;
use std::io::{self, Read, Write};

/// Writes a table as CSV. What was flushed survives whatever happens to the program.
pub(crate) struct CsvWriter<W: Write>(csv::Writer<W>);

impl<W: Write> CsvWriter<W> {
    /// Begins with the headings.
    pub(crate) fn new(to: W, columns: &[Column]) -> io::Result<CsvWriter<W>> {
        let mut writer = csv::Writer::from_writer(to);
        let headings = columns.iter().map(Column::to_string);
        writer.write_record([TIME, UTC].map(str::to_owned).into_iter().chain(headings)).map_err(io_error)?;
        writer.flush()?;
        Ok(CsvWriter(writer))
    }

    /// Writes a row, which need not be in the file yet.
    pub(crate) fn write(&mut self, row: &Row) -> io::Result<()> {
        let time = format!("{:.6}", row.seconds);
        let utc = row.utc.to_rfc3339_opts(SecondsFormat::Millis, true);
        let values = row.values.iter().map(|value| value.map_or_else(String::new, |value| value.to_string()));
        self.0.write_record([time, utc].into_iter().chain(values)).map_err(io_error)
    }

    /// Brings everything that was written to the file.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }

    /// Ends the table.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        self.0.flush()
    }
}

fn io_error(error: csv::Error) -> io::Error {
    let told = error.to_string();
    if let csv::ErrorKind::Io(error) = error.into_kind() { error } else { io::Error::other(told) }
}

/// Reads a table from CSV.
pub(super) fn read(text: impl Read) -> Result<Table, String> {
    let mut reader = csv::Reader::from_reader(text);
    let headings = reader.headers().map_err(|error| error.to_string())?.clone();
    let mut table = Table::with_headings(&headings)?;
    let dated = headings.get(1) == Some(UTC);
    for (number, record) in (1..).zip(reader.records()) {
        let record = record.map_err(|error| error.to_string())?;
        if dated && number == 1 {
            table.started = record.get(1).map(str::to_owned);
        }
        let time = record.get(0).unwrap_or_default();
        table.push_time(value(time, number, TIME)?.unwrap_or(f64::NAN))?;
        let cells = record.iter().skip(1 + usize::from(dated));
        for (series, cell) in table.series.iter_mut().zip(cells) {
            series.values.push(value(cell, number, &series.column.name)?);
        }
    }
    Ok(table)
}

fn value(cell: &str, row: u64, column: &str) -> Result<Option<f64>, String> {
    if cell.is_empty() {
        return Ok(None);
    }
    let number = cell.parse::<f64>().ok().filter(|value| value.is_finite());
    let no_number = || format!("row {row}, column `{column}`: `{}` is no number", cell.escape_debug());
    number.map(Some).ok_or_else(no_number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_without_dates_is_read_too() {
        let table = read(b"time [s],a [V]\n0,1\n0.5,\n".as_slice()).expect("read");
        assert_eq!(table.started, None);
        assert_eq!(table.series[0].values, [Some(1.0), None]);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        for (text, why) in [
            ("", "it is no recording of `stepdrive record`: its first column is not `time [s]`"),
            ("t,a\n0,1\n", "it is no recording of `stepdrive record`: its first column is not `time [s]`"),
            ("time [s],a\n0,1\n1,x\n", "row 2, column `a`: `x` is no number"),
            ("time [s],a\n0,inf\n", "row 1, column `a`: `inf` is no number"),
            ("time [s],a\n1,1\n0,1\n", "row 2: 0 is no time that can follow"),
            ("time [s],a\n,1\n", "row 1: NaN is no time that can follow"),
        ] {
            assert_eq!(read(text.as_bytes()), Err(why.to_owned()), "{text}");
        }
        let short = read(b"time [s],a\n0\n".as_slice()).expect_err("refused");
        assert!(short.contains("found record with 1 fields"), "{short}");
    }
}
