//! A Parquet file's columns by name.

use nalgebra::DMatrix;

use super::{
    cells::Cells,
    error::{Entries, ParquetError},
    footer::{Footer, Leaf, Physical},
    pages::{Column, read_chunk},
    values::{Budget, Values},
};

/// The most numbers that are read of a column: 256 MiB of f64, three hundred times as many as a
/// demonstration of Ant holds.
pub(crate) const MAX_NUMBERS: usize = 1 << 25;

/// The most bytes decompressed for a column.
const MAX_DECOMPRESSED: usize = 1 << 31;

/// The most bytes decompressed for a column of cells.
/// Its values are single, and its text is bounded too, each time that it occurs.
const MAX_CELLS_BYTES: usize = 1 << 28;
const MAX_TEXT: usize = 1 << 27;

/// Keys of notes that Parquet writers add on their own.
const WRITERS_KEYS: [&str; 2] = ["ARROW:schema", "pandas"];

/// A file whose columns are decoded when they are asked for.
pub(crate) struct Table {
    file: Vec<u8>,
    footer: Footer,
}

impl Table {
    /// The columns of `file`. Errors: it is no Parquet.
    pub(crate) fn new(file: Vec<u8>) -> Result<Self, ParquetError> {
        let footer = Footer::read(&file)?;
        Ok(Self { file, footer })
    }

    /// The number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.footer.rows
    }

    /// The key-value metadata, without the notes that writers add on their own.
    pub(crate) fn notes(&self) -> Vec<(String, String)> {
        self.footer
            .notes
            .iter()
            .filter(|(key, _)| !WRITERS_KEYS.contains(&key.as_str()))
            .cloned()
            .collect()
    }

    /// The names of the columns, in order.
    pub(crate) fn columns(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self
            .footer
            .leaves
            .iter()
            .map(|leaf| leaf.column.as_str())
            .collect();
        names.dedup();
        names
    }

    /// Whether there is a column `name`.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.footer.leaves.iter().any(|leaf| leaf.column == name)
    }

    /// The numbers of column `name`.
    pub(crate) fn numbers(&self, name: &str) -> Result<Vec<f64>, ParquetError> {
        match self.flat(name, "f64")? {
            Values::F64(values) => Ok(values),
            other => Err(ParquetError::wrong_type(
                name,
                Entries::Single(other.name()),
                "f64",
            )),
        }
    }

    /// The truth values of column `name`.
    pub(crate) fn flags(&self, name: &str) -> Result<Vec<bool>, ParquetError> {
        match self.flat(name, "bool")? {
            Values::Bool(values) => Ok(values),
            other => Err(ParquetError::wrong_type(
                name,
                Entries::Single(other.name()),
                "bool",
            )),
        }
    }

    /// The whole numbers of column `name`.
    pub(crate) fn whole_numbers(&self, name: &str) -> Result<Vec<i64>, ParquetError> {
        match self.flat(name, "a whole number")? {
            Values::I32(values) => Ok(values.into_iter().map(i64::from).collect()),
            Values::I64(values) => Ok(values),
            other => Err(ParquetError::wrong_type(
                name,
                Entries::Single(other.name()),
                "a whole number",
            )),
        }
    }

    /// The place of column `name` among the leaves, its first leaf, and whether that is the only one.
    fn leaf(&self, name: &str) -> Result<(usize, &Leaf, bool), ParquetError> {
        let mut leaves = self
            .footer
            .leaves
            .iter()
            .enumerate()
            .filter(|(_, leaf)| leaf.column == name);
        let (place, leaf) = leaves.next().ok_or_else(|| ParquetError::NoColumn {
            column: name.to_owned(),
            present: self.columns().into_iter().map(str::to_owned).collect(),
        })?;
        Ok((place, leaf, leaves.next().is_none()))
    }

    /// The cells of column `name`, which has at most one value a row.
    pub(crate) fn cells(&self, name: &str) -> Result<Cells, ParquetError> {
        let (place, leaf, alone) = self.leaf(name)?;
        let physical = leaf
            .physical
            .filter(|_| leaf.plain && leaf.max_repetition == 0 && alone);
        let physical = physical.ok_or_else(|| {
            ParquetError::wrong_type(
                name,
                Entries::Single("structures or lists"),
                "single values",
            )
        })?;
        let budget = Budget {
            numbers: self.footer.rows.min(MAX_NUMBERS),
            bytes: MAX_CELLS_BYTES,
            text: MAX_TEXT,
        };
        let column = Column {
            values: Values::none(physical),
            lengths: Vec::new(),
            there: Some(Vec::new()),
        };
        let Column { values, there, .. } = self.read(place, budget, column)?;
        let there = there.unwrap_or_default();
        self.whole(name, there.len())?;
        Ok(Cells::new(values, leaf.unsigned, &there))
    }

    /// The lists of column `name`, each a column of the matrix.
    pub(crate) fn lists(&self, name: &str) -> Result<DMatrix<f64>, ParquetError> {
        let expected = "a list of f64";
        let (values, lengths) = self.column(name, 1, expected)?;
        let width = equal_lengths(name, &lengths)?.unwrap_or(0);
        match values {
            Values::F64(values) => Ok(DMatrix::from_vec(width, lengths.len(), values)),
            other => Err(ParquetError::wrong_type(
                name,
                Entries::Lists(other.name()),
                expected,
            )),
        }
    }

    /// The values of column `name`, lists or single ones, and how many each row has.
    pub(crate) fn values(&self, name: &str) -> Result<(Values, usize), ParquetError> {
        let lists = self
            .footer
            .leaves
            .iter()
            .any(|leaf| leaf.column == name && leaf.max_repetition == 1);
        let (values, lengths) =
            self.column(name, u32::from(lists), "numbers or lists of numbers")?;
        Ok((values, equal_lengths(name, &lengths)?.unwrap_or(1)))
    }

    /// The values of column `name`, which must have one in each row.
    pub(crate) fn flat(&self, name: &str, expected: &'static str) -> Result<Values, ParquetError> {
        Ok(self.column(name, 0, expected)?.0)
    }

    /// The values of column `name`, nested in `lists` lists a row, and each row's length.
    fn column(
        &self,
        name: &str,
        lists: u32,
        expected: &'static str,
    ) -> Result<(Values, Vec<usize>), ParquetError> {
        let (place, leaf, alone) = self.leaf(name)?;
        if !leaf.plain || !alone {
            return Err(ParquetError::wrong_type(
                name,
                Entries::Single("structures or nested lists"),
                expected,
            ));
        }
        let Some(physical) = leaf
            .physical
            .filter(|physical| *physical != Physical::Bytes)
        else {
            return Err(ParquetError::wrong_type(
                name,
                Entries::Single("text or bytes"),
                expected,
            ));
        };
        let values = Values::none(physical);
        if leaf.max_repetition != lists {
            let found = if leaf.max_repetition == 0 {
                Entries::Single(values.name())
            } else {
                Entries::Lists(values.name())
            };
            return Err(ParquetError::wrong_type(name, found, expected));
        }
        let budget = Budget {
            numbers: MAX_NUMBERS,
            bytes: MAX_DECOMPRESSED,
            // Text was refused above.
            text: 0,
        };
        let column = self.read(
            place,
            budget,
            Column {
                values,
                lengths: Vec::new(),
                there: None,
            },
        )?;
        let rows = if lists == 0 {
            column.values.len()
        } else {
            column.lengths.len()
        };
        self.whole(name, rows)?;
        Ok((column.values, column.lengths))
    }

    /// Appends all row groups of the leaf at `place` to `column`.
    fn read(
        &self,
        place: usize,
        mut budget: Budget,
        mut column: Column,
    ) -> Result<Column, ParquetError> {
        let leaf = &self.footer.leaves[place];
        for group in &self.footer.groups {
            read_chunk(
                &self.file,
                leaf,
                &group.chunks[place],
                &mut budget,
                &mut column,
            )
            .map_err(|source| ParquetError::Pages {
                column: leaf.column.clone(),
                source,
            })?;
        }
        Ok(column)
    }

    fn whole(&self, name: &str, rows: usize) -> Result<(), ParquetError> {
        if rows != self.footer.rows {
            return Err(ParquetError::Rows {
                column: name.to_owned(),
                found: rows,
                expected: self.footer.rows,
            });
        }
        Ok(())
    }
}

/// The common length of the rows of column `name`; absent if there are no rows.
fn equal_lengths(name: &str, lengths: &[usize]) -> Result<Option<usize>, ParquetError> {
    let Some(&width) = lengths.first() else {
        return Ok(None);
    };
    match lengths.iter().position(|&length| length != width) {
        None => Ok(Some(width)),
        Some(row) => Err(ParquetError::Ragged {
            column: name.to_owned(),
            row,
            found: lengths[row],
            expected: width,
        }),
    }
}
