//! `progress.parquet` and `evaluations.parquet`: one row an iteration, one row an evaluation
//! episode.
//!
//! Every row begins with its run's keys, and every file has the same columns of the same types
//! whatever the algorithm, so that all of them can be scanned as one table. A quantity that a run
//! does not have is null. The columns are those of [`measured`](crate::measured), to which [`keys`]
//! adds the run's.
//!
//! polars writes the files; [`crate::parquet`] reads them, since a record may be damaged, or a
//! stranger's.

mod documentation;
mod error;
mod frame;
pub mod keys;
#[cfg(test)]
pub(crate) mod tests;

use std::{collections::BTreeMap, path::Path};

use polars::prelude::{DataFrame, KeyValueMetadata, ParquetWriter, PolarsError, PolarsResult};

pub use documentation::documentation;
pub use error::TableError;
pub use keys::Keys;

use super::{RecordError, Stamp, io_error, read_bounded, write_atomically};
use crate::{
    measured::{Column, EvaluationEpisode, Iteration, evaluations, progress},
    parquet::{Entries, MAX_NUMBERS, ParquetError, Table},
};

/// The largest table that is read, bytes.
pub(super) const LIMIT: u64 = 1 << 28;

/// Columns of numbers, one entry an iteration; a null is `None`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Numbers(BTreeMap<&'static str, Vec<Option<f64>>>);

impl Numbers {
    /// The numbers of `column`; `None` if it was not read, or the file has no such column.
    pub fn get(&self, column: &Column<Iteration>) -> Option<&[Option<f64>]> {
        self.0.get(column.name).map(Vec::as_slice)
    }

    /// Adds the numbers of `column`.
    pub fn insert(&mut self, column: &Column<Iteration>, numbers: Vec<Option<f64>>) {
        self.0.insert(column.name, numbers);
    }

    /// The numbers in `rows` of those `columns` that hold numbers.
    pub fn of(rows: &[Iteration], columns: &[&Column<Iteration>]) -> Self {
        let numbers = |column: &&Column<Iteration>| {
            (
                column.name,
                rows.iter().map(|row| column.number(row)).collect(),
            )
        };
        Self(
            columns
                .iter()
                .filter(|column| column.holds_numbers())
                .map(numbers)
                .collect(),
        )
    }
}

fn to_frame<R>(columns: &[&Column<R>], keys: &Keys, rows: &[R]) -> PolarsResult<DataFrame> {
    let mut all = keys::to_columns(keys, rows.len());
    all.extend(frame::to_columns(columns, rows));
    DataFrame::new(rows.len(), all)
}

/// Writes the rows of iterations.
///
/// # Errors
///
/// The disk refuses.
pub fn write_progress(
    path: &Path,
    keys: &Keys,
    stamp: &Stamp,
    rows: &[Iteration],
) -> Result<(), RecordError> {
    write(path, to_frame(progress::COLUMNS, keys, rows), stamp)
}

/// Reads the rows of iterations; the seconds of an update's parts are not kept.
///
/// # Errors
///
/// There is no such file, or it has other columns.
pub fn read_progress(path: &Path) -> Result<Vec<Iteration>, RecordError> {
    frame::to_rows(progress::COLUMNS, &read(path)?, usize::MAX)
        .map_err(|error| malformed(path, error))
}

/// Writes the rows of evaluation episodes.
///
/// # Errors
///
/// The disk refuses.
pub fn write_evaluations(
    path: &Path,
    keys: &Keys,
    stamp: &Stamp,
    rows: &[EvaluationEpisode],
) -> Result<(), RecordError> {
    write(path, to_frame(evaluations::COLUMNS, keys, rows), stamp)
}

/// Reads the rows of evaluation episodes.
///
/// # Errors
///
/// There is no such file, or it has other columns.
pub fn read_evaluations(path: &Path) -> Result<Vec<EvaluationEpisode>, RecordError> {
    frame::to_rows(evaluations::COLUMNS, &read(path)?, usize::MAX)
        .map_err(|error| malformed(path, error))
}

/// Reads the keys of a file of either kind.
///
/// # Errors
///
/// There is no such file, it has other columns, or no rows.
pub fn read_keys(path: &Path) -> Result<Keys, RecordError> {
    keys::of(&read(path)?).map_err(|error| malformed(path, error))
}

/// Reads those `columns` that hold numbers and that the file has.
///
/// # Errors
///
/// There is no such file, it is no table of results, or one of these columns holds no numbers.
pub fn read_numbers(
    path: &Path,
    columns: &[&'static Column<Iteration>],
) -> Result<Numbers, RecordError> {
    let table = read(path)?;
    let mut numbers = Numbers::default();
    for column in columns
        .iter()
        .filter(|column| column.holds_numbers() && table.has(column.name))
    {
        let cells = table
            .cells(column.name)
            .map_err(|error| malformed(path, error))?;
        let found = Entries::Single(cells.name());
        let wrong = || ParquetError::wrong_type(column.name, found, "numbers");
        let cells = cells.numbers().ok_or_else(|| malformed(path, wrong()))?;
        numbers.insert(column, cells);
    }
    Ok(numbers)
}

/// Reads the stamp of a file of either kind.
///
/// # Errors
///
/// There is no such file, or it was not written by this program.
pub fn read_stamp(path: &Path) -> Result<Stamp, RecordError> {
    let notes = read(path)?.notes();
    let text = notes
        .into_iter()
        .find(|(key, _)| key == Stamp::KEY)
        .map(|(_, text)| text);
    let text = text.ok_or_else(|| malformed(path, TableError::NoStamp))?;
    serde_json::from_str(&text).map_err(|error| malformed(path, error))
}

fn write(path: &Path, frame: PolarsResult<DataFrame>, stamp: &Stamp) -> Result<(), RecordError> {
    let stamp =
        serde_json::to_string(stamp).map_err(|error| io_error("write", path)(error.into()))?;
    let mut bytes = Vec::new();
    frame
        .and_then(|mut frame| {
            ParquetWriter::new(&mut bytes)
                .with_key_value_metadata(Some(KeyValueMetadata::from_static(vec![(
                    Stamp::KEY.to_owned(),
                    stamp,
                )])))
                .set_parallel(false)
                .finish(&mut frame)
        })
        .map_err(|error: PolarsError| malformed(path, error))?;
    write_atomically(path, &bytes)
}

/// A table of results, whose columns are decoded when they are asked for.
///
/// # Errors
///
/// It is missing, no Parquet, or larger than any that this program writes.
pub(super) fn read(path: &Path) -> Result<Table, RecordError> {
    let absent = || io_error("read", path)(std::io::ErrorKind::NotFound.into());
    let table = Table::new(read_bounded(path, LIMIT)?.ok_or_else(absent)?)
        .map_err(|error| malformed(path, error))?;
    let cells = table.rows().saturating_mul(table.columns().len());
    if cells > MAX_NUMBERS {
        return Err(malformed(path, TableError::TooManyRows(table.rows())));
    }
    Ok(table)
}

pub(super) fn malformed(path: &Path, error: impl Into<TableError>) -> RecordError {
    RecordError::Table {
        path: path.to_owned(),
        source: error.into(),
    }
}
