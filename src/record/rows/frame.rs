//! From rows to the columns of a table, and back, as the catalogue says.

use std::sync::Arc;

use polars::prelude::{Column as Series, NamedFrom, Series as Untyped};

use super::TableError;
use crate::{
    measured::{Cell, Column, Field},
    parquet::{Cells, Entries, ParquetError, Table},
};

/// The columns of `rows`, in the catalogue's order.
pub(super) fn to_columns<R>(columns: &[&Column<R>], rows: &[R]) -> Vec<Series> {
    columns
        .iter()
        .map(|column| to_column(column, rows))
        .collect()
}

fn to_column<R>(column: &Column<R>, rows: &[R]) -> Series {
    fn cells<R, T>(rows: &[R], field: &Field<R, T>) -> Vec<T> {
        rows.iter().map(field.get).collect()
    }
    match &column.cell {
        Cell::Whole(field) => named(column.name, cells(rows, field)),
        Cell::Number(field) => named(column.name, cells(rows, field)),
        Cell::Truth(field) => named(column.name, cells(rows, field)),
        Cell::Word(field) => named(column.name, cells(rows, field)),
        Cell::MaybeWhole(field) => named(column.name, cells(rows, field)),
        Cell::MaybeNumber(field) => named(column.name, cells(rows, field)),
        Cell::MaybeWord(field) => named(column.name, cells(rows, field)),
    }
}

/// The column `name` of `cells`.
pub(super) fn named<T>(name: &str, cells: Vec<T>) -> Series
where
    Untyped: NamedFrom<Vec<T>, [T]>,
{
    Untyped::new(name.into(), cells).into()
}

/// The first `most` rows of a table.
///
/// # Errors
///
/// A column is missing or of another type, or a cell is null that may not be.
pub(super) fn to_rows<R: Default + Clone>(
    columns: &[&Column<R>],
    table: &Table,
    most: usize,
) -> Result<Vec<R>, TableError> {
    // A table of fewer columns may have more rows than there is memory for.
    if let Some(missing) = columns.iter().find(|column| !table.has(column.name)) {
        table.cells(missing.name)?;
    }
    let mut rows = Vec::new();
    for column in columns {
        let cells = table.cells(column.name)?;
        rows.resize(table.rows().min(most), R::default()); // there are as many cells as the table claims rows
        fill(&mut rows, column, cells)?;
    }
    Ok(rows)
}

/// Puts the `cells` of `column` into the rows.
fn fill<R>(rows: &mut [R], column: &Column<R>, cells: Cells) -> Result<(), TableError> {
    let text = |cell: Option<Arc<str>>| cell.map(|text| text.to_string());
    match (&column.cell, cells) {
        (Cell::Whole(field), Cells::Unsigned(cells)) => {
            put(rows, field, required(column.name, cells, rows.len())?)
        }
        (Cell::Number(field), Cells::Numbers(cells)) => {
            put(rows, field, required(column.name, cells, rows.len())?)
        }
        (Cell::Truth(field), Cells::Truths(cells)) => {
            put(rows, field, required(column.name, cells, rows.len())?)
        }
        (Cell::Word(field), Cells::Texts(cells)) => {
            put(
                rows,
                field,
                required(column.name, cells, rows.len())?
                    .iter()
                    .map(|text| text.to_string())
                    .collect(),
            );
        }
        (Cell::MaybeWhole(field), Cells::Unsigned(cells)) => put(rows, field, cells),
        (Cell::MaybeNumber(field), Cells::Numbers(cells)) => put(rows, field, cells),
        (Cell::MaybeWord(field), Cells::Texts(cells)) => {
            put(rows, field, cells.into_iter().map(text).collect())
        }
        (_, other) => {
            let found = Entries::Single(other.name());
            return Err(ParquetError::wrong_type(column.name, found, expected(column)).into());
        }
    }
    Ok(())
}

fn put<R, T>(rows: &mut [R], field: &Field<R, T>, cells: Vec<T>) {
    for (row, cell) in rows.iter_mut().zip(cells) {
        (field.set)(row, cell);
    }
}

/// The first `most` cells of the column `name`, none of which may be null.
fn required<T>(
    name: &'static str,
    cells: Vec<Option<T>>,
    most: usize,
) -> Result<Vec<T>, TableError> {
    let all: Option<Vec<T>> = cells.into_iter().take(most).collect();
    all.ok_or(TableError::Nulls(name))
}

/// The content of a column, in the words of a message.
fn expected<R>(column: &Column<R>) -> &'static str {
    match column.cell {
        Cell::Whole(_) | Cell::MaybeWhole(_) => "whole numbers",
        Cell::Number(_) | Cell::MaybeNumber(_) => "numbers",
        Cell::Truth(_) => "truth values",
        Cell::Word(_) | Cell::MaybeWord(_) => "text",
    }
}
