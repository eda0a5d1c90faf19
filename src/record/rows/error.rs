//! The ways in which a file is no table of results.

use polars::error::PolarsError;

use crate::{
    parquet::{Entries, ParquetError},
    record::Stamp,
};

/// Errors of a table of results; the message names the column, where it is of one.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// It is no Parquet, or a column is missing or of another type.
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    /// A column that every row has lacks entries.
    #[error("its column `{0}` has nulls; it may have none")]
    Nulls(&'static str),
    /// An axis is of a type that no axis has.
    #[error("its column `{column}` holds {found}; no axis does")]
    Axis {
        /// The column's name.
        column: String,
        /// Its entries.
        found: Entries,
    },
    /// There is no row to take the run's keys from.
    #[error("it has no rows")]
    NoRows,
    /// It claims more rows than are read.
    #[error("it claims {0} rows, more than are read")]
    TooManyRows(usize),
    /// A row is neither an iteration nor an evaluation episode.
    #[error("row {0} names no iteration and no episode")]
    NamelessRow(usize),
    /// It does not say which run it is of.
    #[error("its metadata has no `{}`", Stamp::KEY)]
    NoStamp,
    /// The run that it is of cannot be understood.
    #[error(transparent)]
    Stamp(#[from] serde_json::Error),
    /// The rows cannot be encoded.
    #[error(transparent)]
    Encoding(#[from] PolarsError),
}
