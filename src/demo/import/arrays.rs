//! Named arrays of numbers, as `.npz` files and other programs' Parquet tables hold them.

use std::collections::BTreeSet;

use nalgebra::DMatrix;

use super::{ArraysError, MAX_NUMBERS};

/// Numbers in rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Array {
    rows: usize,
    /// The numbers, row after row.
    numbers: Vec<f64>,
}

impl Array {
    /// `numbers` in `rows`; without numbers the array has no rows, however many a file claims.
    pub(super) fn new(rows: usize, numbers: Vec<f64>) -> Self {
        Self {
            rows: if numbers.is_empty() { 0 } else { rows },
            numbers,
        }
    }

    /// The number of rows.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The numbers, row after row.
    pub(super) fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// The array with each row as a column.
    pub(super) fn into_columns(self) -> DMatrix<f64> {
        DMatrix::from_vec(
            self.numbers.len().checked_div(self.rows).unwrap_or(0),
            self.rows,
            self.numbers,
        )
    }
}

/// Looks up an array by its name; `None` where there is none.
pub(super) type Named<'a> = dyn Fn(&str) -> Result<Option<Array>, ArraysError> + 'a;

/// A file's arrays, with a record of which were asked for.
pub(super) struct Arrays<'a> {
    named: &'a Named<'a>,
    used: BTreeSet<&'static str>,
    /// The count of numbers that were read.
    read: usize,
}

impl<'a> Arrays<'a> {
    pub(super) fn new(named: &'a Named<'a>) -> Self {
        Self {
            named,
            used: BTreeSet::new(),
            read: 0,
        }
    }

    /// The first array that has one of `names`, and its name.
    pub(super) fn first(
        &mut self,
        names: &[&'static str],
    ) -> Result<Option<(&'static str, Array)>, ArraysError> {
        for &name in names {
            if let Some(array) = (self.named)(name)? {
                self.read += array.numbers.len();
                if self.read > MAX_NUMBERS {
                    return Err(ArraysError::TooManyNumbers);
                }
                self.used.insert(name);
                return Ok(Some((name, array)));
            }
        }
        Ok(None)
    }

    /// As [`first`](Self::first), where one of `names` must be there.
    pub(super) fn required(&mut self, names: &[&'static str]) -> Result<Array, ArraysError> {
        self.first(names)?
            .map(|(_, array)| array)
            .ok_or_else(|| ArraysError::NoneOf(names.to_vec()))
    }

    /// As [`first`](Self::first), for an array that has a number for each of `n` steps.
    pub(super) fn of_each_step(
        &mut self,
        names: &[&'static str],
        n: usize,
    ) -> Result<Option<(&'static str, Vec<f64>)>, ArraysError> {
        match self.first(names)? {
            Some((name, array)) if array.numbers.len() != n => Err(ArraysError::Numbers {
                name,
                found: array.numbers.len(),
                steps: n,
            }),
            found => Ok(found.map(|(name, array)| (name, array.numbers))),
        }
    }

    /// The `names` that were never asked for.
    pub(super) fn unused<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Vec<&'n str> {
        // A column `obs_3` belongs to `obs`.
        let stem = |name: &'n str| {
            name.rsplit_once('_')
                .filter(|(_, place)| place.parse::<usize>().is_ok())
        };
        let is_used = |name: &str| self.used.contains(name);
        let all = names
            .into_iter()
            .filter(|name| !is_used(name) && !stem(name).is_some_and(|(stem, _)| is_used(stem)));
        all.collect()
    }
}

/// The numbers in `bytes`, whose numpy type is `name` (`f8`, `b1` ...), lowest byte first if
/// `little`; absent for types that hold no numbers, and if bytes are left over.
pub(super) fn decode(name: &str, little: bool, bytes: &[u8]) -> Option<Vec<f64>> {
    fn words<const N: usize>(
        bytes: &[u8],
        little: bool,
        of: fn([u8; N]) -> f64,
    ) -> Option<Vec<f64>> {
        let (words, []) = bytes.as_chunks::<N>() else {
            return None;
        };
        let in_order = |mut word: [u8; N]| {
            if !little {
                word.reverse();
            }
            of(word)
        };
        Some(words.iter().copied().map(in_order).collect())
    }
    match name {
        "f8" => words(bytes, little, f64::from_le_bytes),
        "f4" => words(bytes, little, |word| f32::from_le_bytes(word).into()),
        "i8" => words(bytes, little, |word| i64::from_le_bytes(word) as f64),
        "i4" => words(bytes, little, |word| i32::from_le_bytes(word).into()),
        "i2" => words(bytes, little, |word| i16::from_le_bytes(word).into()),
        "i1" => words(bytes, little, |word| i8::from_le_bytes(word).into()),
        "u8" => words(bytes, little, |word| u64::from_le_bytes(word) as f64),
        "u4" => words(bytes, little, |word| u32::from_le_bytes(word).into()),
        "u2" => words(bytes, little, |word| u16::from_le_bytes(word).into()),
        "u1" | "b1" => words(bytes, little, |word| u8::from_le_bytes(word).into()),
        _ => None,
    }
}
