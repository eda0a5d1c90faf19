//! Parquet as others write it: lists, or one column a number, under the names of [`super::arrays`].

use super::{
    Imported,
    arrays::{Array, assemble},
};
use crate::{
    demo::parquet::{Table, Values},
    env::EnvId,
};

/// The demonstration of `env` in the Parquet `file`.
pub(super) fn read(file: Vec<u8>, env: EnvId) -> Result<Imported, String> {
    let table = Table::new(file)?;
    let mut imported = assemble(env, table.columns(), &|name| array(&table, name))?;
    imported.demonstration.provenance = table.notes();
    Ok(imported)
}

/// Column `name`, or the columns `name_0`, `name_1` ... side by side.
fn array(table: &Table, name: &str) -> Result<Option<Array>, String> {
    if table.has(name) {
        let (values, width) = table.values(name)?;
        return Ok(Some(Array::new(values.len().checked_div(width).unwrap_or(0), widened(values))));
    }
    let mut columns = Vec::new();
    while let column = format!("{name}_{}", columns.len())
        && table.has(&column)
    {
        columns.push(widened(table.flat(&column, "numbers")?));
    }
    let rows = table.rows();
    let numbers = (0..rows).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
    Ok((!columns.is_empty()).then(|| Array::new(rows, numbers)))
}

/// As f64, truth values as 0 and 1.
fn widened(values: Values) -> Vec<f64> {
    match values {
        Values::Bool(values) => values.into_iter().map(|value| f64::from(u8::from(value))).collect(),
        Values::I32(values) => values.into_iter().map(f64::from).collect(),
        Values::I64(values) => values.into_iter().map(|value| value as f64).collect(),
        Values::F32(values) => values.into_iter().map(f64::from).collect(),
        Values::F64(values) => values,
    }
}
