//! Other programs' Parquet: lists, or one column for each number, under the names of
//! [`super::assemble`].

use super::{ImportError, Imported, arrays::Array, assemble::assemble};
use crate::{
    env::EnvId,
    parquet::{Entries, ParquetError, Table, Values},
};

/// The demonstration of `env` in the Parquet `file`.
pub(super) fn read(file: Vec<u8>, env: EnvId) -> Result<Imported, ImportError> {
    let table = Table::new(file)?;
    let mut imported = assemble(env, table.columns(), &|name| Ok(array(&table, name)?))?;
    imported.demonstration.provenance = table.notes();
    Ok(imported)
}

/// Column `name`, or the columns `name_0`, `name_1` ... side by side.
fn array(table: &Table, name: &str) -> Result<Option<Array>, ParquetError> {
    if table.has(name) {
        let (values, width) = table.values(name)?;
        return Ok(Some(Array::new(
            values.len().checked_div(width).unwrap_or(0),
            widened(values, name)?,
        )));
    }
    let mut columns = Vec::new();
    while let column = format!("{name}_{}", columns.len())
        && table.has(&column)
    {
        columns.push(widened(table.flat(&column, "numbers")?, &column)?);
    }
    let rows = table.rows();
    let numbers = (0..rows)
        .flat_map(|row| columns.iter().map(move |column| column[row]))
        .collect();
    Ok((!columns.is_empty()).then(|| Array::new(rows, numbers)))
}

fn widened(values: Values, name: &str) -> Result<Vec<f64>, ParquetError> {
    values
        .widened()
        .ok_or_else(|| ParquetError::wrong_type(name, Entries::Single("text"), "numbers"))
}
