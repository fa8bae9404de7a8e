//! Tables in Parquet.

use super::{Column, Row, TIME, Table, UTC};
use chrono::{DateTime, SecondsFormat};
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::record::Field;
use parquet::schema::types::{Type, TypePtr};
use std::fs::File;
use std::io;
use std::panic;
use std::sync::Arc;

/// How many rows are kept until they are written together.
const GROUP: usize = 65_536;

/// Writes a table as Parquet. The file is none until [`ParquetWriter::finish`] has written its end.
pub(crate) struct ParquetWriter {
    writer: SerializedFileWriter<File>,
    columns: usize,
    rows: Vec<Row>,
}

impl ParquetWriter {
    /// Begins a table of these columns.
    pub(crate) fn new(file: File, columns: &[Column]) -> io::Result<ParquetWriter> {
        let writer = schema(columns)
            .and_then(|schema| SerializedFileWriter::new(file, schema, Arc::new(WriterProperties::new())));
        Ok(ParquetWriter { writer: writer.map_err(io_error)?, columns: columns.len(), rows: Vec::new() })
    }

    /// Writes a row, which need not be in the file yet.
    pub(crate) fn write(&mut self, row: &Row) -> io::Result<()> {
        self.rows.push(row.clone());
        if self.rows.len() < GROUP {
            return Ok(());
        }
        self.write_group().map_err(io_error)
    }

    /// Ends the table.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        if !self.rows.is_empty() {
            self.write_group().map_err(io_error)?;
        }
        self.writer.close().map(|_| ()).map_err(io_error)
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        let rows = std::mem::take(&mut self.rows);
        let mut group = self.writer.next_row_group()?;
        let times: Vec<f64> = rows.iter().map(|row| row.seconds).collect();
        write_doubles(&mut group, &times, None)?;
        write_dates(&mut group, &rows)?;
        for column in 0..self.columns {
            let cells = || rows.iter().map(|row| row.values.get(column).copied().flatten());
            let present: Vec<f64> = cells().flatten().collect();
            let defined: Vec<i16> = cells().map(|cell| i16::from(cell.is_some())).collect();
            write_doubles(&mut group, &present, Some(&defined))?;
        }
        group.close().map(|_| ())
    }
}

fn schema(columns: &[Column]) -> Result<TypePtr, ParquetError> {
    let double = |name: &str, repetition| {
        Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(repetition).build().map(Arc::new)
    };
    let utc = LogicalType::timestamp(true, TimeUnit::MICROS);
    let utc = Type::primitive_type_builder(UTC, Physical::INT64)
        .with_logical_type(Some(utc))
        .with_repetition(Repetition::REQUIRED)
        .build()?;
    let mut fields = vec![double(TIME, Repetition::REQUIRED)?, Arc::new(utc)];
    for column in columns {
        fields.push(double(&column.to_string(), Repetition::OPTIONAL)?);
    }
    Type::group_type_builder("recording").with_fields(fields).build().map(Arc::new)
}

fn write_doubles(
    group: &mut SerializedRowGroupWriter<'_, File>,
    values: &[f64],
    defined: Option<&[i16]>,
) -> Result<(), ParquetError> {
    let mut column = group.next_column()?.ok_or_else(too_few)?;
    column.typed::<DoubleType>().write_batch(values, defined, None)?;
    column.close()
}

fn write_dates(group: &mut SerializedRowGroupWriter<'_, File>, rows: &[Row]) -> Result<(), ParquetError> {
    let dates: Vec<i64> = rows.iter().map(|row| row.utc.timestamp_micros()).collect();
    let mut column = group.next_column()?.ok_or_else(too_few)?;
    column.typed::<Int64Type>().write_batch(&dates, None, None)?;
    column.close()
}

fn too_few() -> ParquetError {
    ParquetError::General("the schema has too few columns".to_owned())
}

fn io_error(error: ParquetError) -> io::Error {
    io::Error::other(error)
}

/// Reads a table from Parquet.
pub(super) fn read(file: File) -> Result<Table, String> {
    // The library panics on some files that are damaged.
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| ()));
    let read = panic::catch_unwind(|| read_rows(file));
    panic::set_hook(hook);
    match read {
        Ok(Ok(table)) => Ok(table),
        Ok(Err(Wrong::Table(why))) => Err(why),
        Ok(Err(Wrong::File(error))) => Err(format!("it is no whole Parquet file: {error}")),
        Err(_) => Err("it is no whole Parquet file: its pages are damaged".to_owned()),
    }
}

/// Why a table cannot be read.
enum Wrong {
    File(ParquetError),
    Table(String),
}

impl From<ParquetError> for Wrong {
    fn from(error: ParquetError) -> Wrong {
        Wrong::File(error)
    }
}

impl From<String> for Wrong {
    fn from(why: String) -> Wrong {
        Wrong::Table(why)
    }
}

fn read_rows(file: File) -> Result<Table, Wrong> {
    let reader = SerializedFileReader::new(file)?;
    let fields = reader.metadata().file_metadata().schema().get_fields();
    let names: Vec<String> = fields.iter().map(|field| field.name().to_owned()).collect();
    let mut table = Table::with_headings(names.iter().map(String::as_str))?;
    let dated = names.get(1).is_some_and(|name| name == UTC);
    for row in reader.get_row_iter(None)? {
        let row = row?;
        let mut fields = row.get_column_iter().map(|(_, field)| field);
        table.push_time(fields.next().and_then(number).unwrap_or(f64::NAN))?;
        let date = if dated { fields.next().and_then(date) } else { None };
        table.started = table.started.take().or(date);
        for (series, field) in table.series.iter_mut().zip(fields) {
            series.values.push(number(field).filter(|value| value.is_finite()));
        }
    }
    Ok(table)
}

fn number(field: &Field) -> Option<f64> {
    if let Field::Double(value) = field { Some(*value) } else { None }
}

fn date(field: &Field) -> Option<String> {
    let Field::TimestampMicros(micros) = field else { return None };
    let date = DateTime::from_timestamp_micros(*micros)?;
    Some(date.to_rfc3339_opts(SecondsFormat::Millis, true))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::Seek;

    fn read_bytes(bytes: &[u8]) -> Result<Table, String> {
        let mut file = tempfile::tempfile().expect("a file");
        io::Write::write_all(&mut file, bytes).and_then(|()| file.rewind()).expect("written");
        read(file)
    }

    fn written(rows: usize) -> Vec<u8> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.parquet");
        let column = Column { name: "a.position".to_owned(), unit: "mm".to_owned() };
        let mut writer = ParquetWriter::new(File::create(&path).expect("created"), &[column]).expect("begun");
        for number in 0..rows {
            let value = (number % 3 != 0).then_some(number as f64 / 8.0);
            let row = Row { seconds: number as f64, utc: DateTime::UNIX_EPOCH, values: vec![value] };
            writer.write(&row).expect("written");
        }
        writer.finish().expect("finished");
        fs::read(path).expect("there")
    }

    #[test]
    fn a_table_of_several_groups_is_read_whole() {
        let table = read_bytes(&written(GROUP + 5)).expect("read");
        assert_eq!((table.times.len(), table.series[0].values.len()), (GROUP + 5, GROUP + 5));
        assert_eq!(table.series[0].values[GROUP], Some(GROUP as f64 / 8.0));
        assert_eq!(read_bytes(&written(0)).map(|table| table.times.len()), Ok(0));
    }

    #[test]
    fn a_damaged_file_is_told_or_read_but_never_panics() {
        let whole = written(20);
        for end in 0..whole.len() {
            assert!(read_bytes(&whole[..end]).is_err(), "cut at {end}");
        }
        for place in 0..whole.len() {
            for bit in 0..8 {
                let mut damaged = whole.clone();
                damaged[place] ^= 1 << bit;
                let _ = read_bytes(&damaged);
            }
        }
    }
}
