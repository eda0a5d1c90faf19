//! A Parquet file's columns by name.

use nalgebra::DMatrix;

use super::{
    footer::Footer,
    pages::{Budget, Values, read_chunk},
};

/// The most numbers read of a column: 256 MiB of f64, three hundred times what a demonstration of Ant's holds.
pub(in crate::demo) const MAX_NUMBERS: usize = 1 << 25;

/// The most bytes decompressed for a column.
const MAX_DECOMPRESSED: usize = 1 << 31;

/// Keys of notes that writers of Parquet add for themselves.
const WRITERS_KEYS: [&str; 2] = ["ARROW:schema", "pandas"];

/// The file, of which each column is decoded when it is asked for.
pub(in crate::demo) struct Table {
    file: Vec<u8>,
    footer: Footer,
}

impl Table {
    /// The columns of `file`. Errors: it is no Parquet.
    pub(in crate::demo) fn new(file: Vec<u8>) -> Result<Self, String> {
        let footer = Footer::read(&file)?;
        Ok(Self { file, footer })
    }

    /// How many rows there are.
    pub(in crate::demo) fn rows(&self) -> usize {
        self.footer.rows
    }

    /// The key-value metadata, less what writers add for themselves.
    pub(in crate::demo) fn notes(&self) -> Vec<(String, String)> {
        self.footer.notes.iter().filter(|(key, _)| !WRITERS_KEYS.contains(&key.as_str())).cloned().collect()
    }

    /// The names of the columns, in order.
    pub(in crate::demo) fn columns(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.footer.leaves.iter().map(|leaf| leaf.column.as_str()).collect();
        names.dedup();
        names
    }

    /// Whether there is a column `name`.
    pub(in crate::demo) fn has(&self, name: &str) -> bool {
        self.footer.leaves.iter().any(|leaf| leaf.column == name)
    }

    /// The numbers of column `name`.
    pub(in crate::demo) fn numbers(&self, name: &str) -> Result<Vec<f64>, String> {
        match self.flat(name, "f64")? {
            Values::F64(values) => Ok(values),
            other => Err(wrong_type(name, other.name(), "f64")),
        }
    }

    /// The truth values of column `name`.
    pub(in crate::demo) fn flags(&self, name: &str) -> Result<Vec<bool>, String> {
        match self.flat(name, "bool")? {
            Values::Bool(values) => Ok(values),
            other => Err(wrong_type(name, other.name(), "bool")),
        }
    }

    /// The whole numbers of column `name`.
    pub(in crate::demo) fn whole_numbers(&self, name: &str) -> Result<Vec<i64>, String> {
        match self.flat(name, "a whole number")? {
            Values::I32(values) => Ok(values.into_iter().map(i64::from).collect()),
            Values::I64(values) => Ok(values),
            other => Err(wrong_type(name, other.name(), "a whole number")),
        }
    }

    /// The lists of column `name`, one a column of the matrix.
    pub(in crate::demo) fn lists(&self, name: &str) -> Result<DMatrix<f64>, String> {
        let expected = "a list of f64";
        let (values, lengths) = self.column(name, 1, expected)?;
        let width = equal_lengths(name, &lengths)?.unwrap_or(0);
        match values {
            Values::F64(values) => Ok(DMatrix::from_vec(width, lengths.len(), values)),
            other => Err(wrong_type(name, &format!("a list of {}", other.name()), expected)),
        }
    }

    /// The values of column `name`, lists or single ones, and how many a row has.
    pub(in crate::demo) fn values(&self, name: &str) -> Result<(Values, usize), String> {
        let lists = self.footer.leaves.iter().any(|leaf| leaf.column == name && leaf.max_repetition == 1);
        let (values, lengths) = self.column(name, u32::from(lists), "numbers or lists of numbers")?;
        Ok((values, equal_lengths(name, &lengths)?.unwrap_or(1)))
    }

    /// The values of column `name`, which must have one a row.
    pub(in crate::demo) fn flat(&self, name: &str, expected: &str) -> Result<Values, String> {
        Ok(self.column(name, 0, expected)?.0)
    }

    /// The values of column `name`, whose rows are in as many `lists`, and then each row's length.
    fn column(&self, name: &str, lists: u32, expected: &str) -> Result<(Values, Vec<usize>), String> {
        let mut leaves = self.footer.leaves.iter().enumerate().filter(|(_, leaf)| leaf.column == name);
        let Some((place, leaf)) = leaves.next() else {
            return Err(format!("it has no column `{name}`; it has {}", self.columns().join(", ")));
        };
        if !leaf.plain || leaves.next().is_some() {
            return Err(wrong_type(name, "structures or nested lists", expected));
        }
        let Some(physical) = leaf.physical else {
            return Err(wrong_type(name, "text or bytes", expected));
        };
        let mut values = Values::none(physical);
        if leaf.max_repetition != lists {
            let found =
                if leaf.max_repetition == 0 { values.name().into() } else { format!("a list of {}", values.name()) };
            return Err(wrong_type(name, &found, expected));
        }
        let mut budget = Budget { numbers: MAX_NUMBERS, bytes: MAX_DECOMPRESSED };
        let mut lengths = Vec::new();
        for group in &self.footer.groups {
            read_chunk(&self.file, leaf, &group.chunks[place], &mut budget, &mut values, &mut lengths)
                .map_err(|reason| format!("its column `{name}` has {reason}"))?;
        }
        let rows = if lists == 0 { values.len() } else { lengths.len() };
        if rows != self.footer.rows {
            return Err(format!("its column `{name}` has {rows} of {} rows", self.footer.rows));
        }
        Ok((values, lengths))
    }
}

/// The length that all rows of column `name` have; absent where there are none.
fn equal_lengths(name: &str, lengths: &[usize]) -> Result<Option<usize>, String> {
    let Some(&width) = lengths.first() else { return Ok(None) };
    match lengths.iter().position(|&length| length != width) {
        None => Ok(Some(width)),
        Some(row) => Err(format!(
            "its column `{name}` has {} numbers in row {row} and {width} before; all rows need as many",
            lengths[row]
        )),
    }
}

/// What to say of a column of another type.
fn wrong_type(name: &str, found: &str, expected: &str) -> String {
    format!("its column `{name}` holds {found}; expected {expected}")
}
