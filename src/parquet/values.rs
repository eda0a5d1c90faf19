//! A column's decoded values, and the bounds on how much of a file is decoded.

use std::sync::Arc;

use super::{
    error::{PageError, ThriftError},
    footer::Physical,
    thrift::{Reader, text},
};

/// The memory of a text beside its bytes.
const ENTRY: usize = 32;

/// A column's values, one after another.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Values {
    Bool(Vec<bool>),
    I32(Vec<i32>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
    Text(Vec<Arc<str>>),
}

impl Values {
    /// An empty column of the type `physical`.
    pub(super) fn none(physical: Physical) -> Self {
        match physical {
            Physical::Bool => Self::Bool(vec![]),
            Physical::I32 => Self::I32(vec![]),
            Physical::I64 => Self::I64(vec![]),
            Physical::F32 => Self::F32(vec![]),
            Physical::F64 => Self::F64(vec![]),
            Physical::Bytes => Self::Text(vec![]),
        }
    }

    /// An empty column of the same type.
    pub(super) fn none_yet(&self) -> Self {
        match self {
            Self::Bool(_) => Self::Bool(vec![]),
            Self::I32(_) => Self::I32(vec![]),
            Self::I64(_) => Self::I64(vec![]),
            Self::F32(_) => Self::F32(vec![]),
            Self::F64(_) => Self::F64(vec![]),
            Self::Text(_) => Self::Text(vec![]),
        }
    }

    /// The values' type, in the words of a message.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Bool(_) => "bool",
            Self::I32(_) => "i32",
            Self::I64(_) => "i64",
            Self::F32(_) => "f32",
            Self::F64(_) => "f64",
            Self::Text(_) => "text",
        }
    }

    /// The number of values.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Bool(values) => values.len(),
            Self::I32(values) => values.len(),
            Self::I64(values) => values.len(),
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }

    /// The values as f64, truth values as 0 and 1; `None` for text.
    pub(crate) fn widened(self) -> Option<Vec<f64>> {
        Some(match self {
            Self::Bool(values) => values
                .into_iter()
                .map(|value| f64::from(u8::from(value)))
                .collect(),
            Self::I32(values) => values.into_iter().map(f64::from).collect(),
            Self::I64(values) => values.into_iter().map(|value| value as f64).collect(),
            Self::F32(values) => values.into_iter().map(f64::from).collect(),
            Self::F64(values) => values,
            Self::Text(_) => return None,
        })
    }

    /// Appends `n` values that stand in `bytes` one after another; text counts against `budget`.
    pub(super) fn extend_plain(
        &mut self,
        bytes: &[u8],
        n: usize,
        budget: &mut Budget,
    ) -> Result<(), PageError> {
        fn words<const N: usize, T>(
            bytes: &[u8],
            n: usize,
            of: fn([u8; N]) -> T,
        ) -> Result<impl Iterator<Item = T>, ThriftError> {
            let words = bytes.as_chunks::<N>().0;
            let words = words.get(..n).ok_or(ThriftError::Ended)?;
            Ok(words.iter().map(move |&word| of(word)))
        }
        match self {
            Self::Bool(values) => {
                let bytes = bytes.get(..n.div_ceil(8)).ok_or(ThriftError::Ended)?;
                values.extend((0..n).map(|i| bytes[i / 8] >> (i % 8) & 1 == 1));
            }
            Self::I32(values) => values.extend(words(bytes, n, i32::from_le_bytes)?),
            Self::I64(values) => values.extend(words(bytes, n, i64::from_le_bytes)?),
            Self::F32(values) => values.extend(words(bytes, n, f32::from_le_bytes)?),
            Self::F64(values) => values.extend(words(bytes, n, f64::from_le_bytes)?),
            Self::Text(values) => {
                let mut reader = Reader { rest: bytes };
                for _ in 0..n {
                    let text = text(reader.prefixed()?)?;
                    budget.spend_text(text.len() + ENTRY)?;
                    values.push(text.into());
                }
            }
        }
        Ok(())
    }

    /// Appends the values of `dictionary` at `indices`; text counts against `budget`.
    pub(super) fn extend_from(
        &mut self,
        dictionary: &Self,
        indices: &[u32],
        budget: &mut Budget,
    ) -> Result<(), PageError> {
        fn look_up<T: Clone>(
            values: &mut Vec<T>,
            dictionary: &[T],
            indices: &[u32],
        ) -> Result<(), PageError> {
            for &index in indices {
                values.push(
                    dictionary
                        .get(index as usize)
                        .ok_or(PageError::NotInDictionary)?
                        .clone(),
                );
            }
            Ok(())
        }
        match (self, dictionary) {
            (Self::Bool(values), Self::Bool(dictionary)) => look_up(values, dictionary, indices),
            (Self::I32(values), Self::I32(dictionary)) => look_up(values, dictionary, indices),
            (Self::I64(values), Self::I64(dictionary)) => look_up(values, dictionary, indices),
            (Self::F32(values), Self::F32(dictionary)) => look_up(values, dictionary, indices),
            (Self::F64(values), Self::F64(dictionary)) => look_up(values, dictionary, indices),
            (Self::Text(values), Self::Text(dictionary)) => {
                let before = values.len();
                look_up(values, dictionary, indices)?;
                values[before..]
                    .iter()
                    .try_for_each(|text| budget.spend_text(text.len()))
            }
            _ => Err(PageError::NotInDictionary),
        }
    }
}

/// The amount that may still be read of a file, so that a small file cannot fill the memory.
pub(super) struct Budget {
    /// The count of values, gaps included.
    pub(super) numbers: usize,
    /// The count of decompressed bytes.
    pub(super) bytes: usize,
    /// Bytes of text, counted as often as it stands in a row or a dictionary.
    pub(super) text: usize,
}

impl Budget {
    pub(super) fn spend_text(&mut self, bytes: usize) -> Result<(), PageError> {
        self.text = self.text.checked_sub(bytes).ok_or(PageError::TooMuch)?;
        Ok(())
    }
}
