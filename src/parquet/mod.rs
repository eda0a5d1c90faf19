//! Parquet files, read without trusting them.
//!
//! polars writes this crate's files but does not read them. It reserves whatever memory a file
//! claims to need, so that one flipped bit can abort the process, past every handler; and
//! demonstrations and results come from strangers, too. The reader here knows what writers of such
//! files use (pyarrow, pandas, polars, DuckDB): numbers, truth values, text and lists of numbers,
//! plain or by dictionary, in pages of either version. What a file claims is checked against what
//! it holds, and what is read of it is bounded. Start at [`Table`].

mod cells;
mod error;
mod footer;
mod hybrid;
mod pages;
mod table;
#[cfg(test)]
mod tests;
mod thrift;
mod values;

pub(crate) use cells::{Cell, Cells};
pub use error::{Entries, ParquetError};
pub(crate) use table::{MAX_NUMBERS, Table};
pub(crate) use values::Values;
