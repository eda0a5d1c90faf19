//! A pickle that holds plain data and numpy arrays, read without running any of it.
//!
//! Pickle is a program for a small stack machine, and its `GLOBAL` and `REDUCE` call whatever
//! Python function the file names. This machine knows the instructions that data needs and, by
//! name, the handful of numpy's functions that make an array; the rest is an error that names it.
//! Objects live in one vector and refer to each other by place, so that sharing and even cycles
//! cost nothing; nothing here recurses over them.

mod error;
mod machine;

pub use error::PickleError;

use super::MAX_NUMBERS;

/// An object's place.
pub(super) type Id = usize;

/// A function or class that a file may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Global {
    /// `numpy.core.multiarray._reconstruct`, which makes an empty array.
    Reconstruct,
    /// `numpy.core.multiarray.scalar`.
    Scalar,
    /// `numpy.ndarray`.
    Ndarray,
    /// `numpy.dtype`.
    Dtype,
    /// `_codecs.encode`, by which Python 2's protocols write bytes.
    Encode,
}

/// An object in a pickle.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Object<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
    Bytes(Vec<u8>),
    Tuple(Vec<Id>),
    List(Vec<Id>),
    Dict(Vec<(Id, Id)>),
    Global(Global),
    /// The name of a type of number (`f8`), and whether its bytes come lowest first.
    Dtype {
        name: &'a str,
        little: bool,
    },
    /// Absent until it is built.
    Array(Option<Array>),
    /// A single number of the type, and its bytes.
    Scalar {
        dtype: Id,
        bytes: Id,
    },
}

/// A numpy array: places of its shape, type and bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Array {
    pub(super) shape: Id,
    pub(super) dtype: Id,
    pub(super) fortran: bool,
    pub(super) bytes: Id,
}

/// All objects that a pickle made.
pub(super) struct Pickle<'a> {
    objects: Vec<Object<'a>>,
    root: Id,
}

impl<'a> Pickle<'a> {
    /// Reads `bytes`. Errors: they end early, or use an instruction or function beyond plain data.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, PickleError> {
        machine::run(bytes)
    }

    /// The object that was pickled.
    pub(super) fn root(&self) -> &Object<'a> {
        self.get(self.root)
    }

    /// The object at `id`.
    pub(super) fn get(&self, id: Id) -> &Object<'a> {
        &self.objects[id]
    }

    /// The value of `object`, a dictionary, under the text `key`.
    pub(super) fn entry(&self, object: &Object<'a>, key: &str) -> Option<&Object<'a>> {
        let Object::Dict(entries) = object else {
            return None;
        };
        let found = entries
            .iter()
            .rev()
            .find(|(name, _)| matches!(self.get(*name), Object::Text(text) if *text == key));
        found.map(|&(_, value)| self.get(value))
    }

    /// The numbers of `object`, an array of any shape or a list or tuple of numbers, widened.
    pub(super) fn numbers(&self, object: &Object<'a>) -> Option<Vec<f64>> {
        match object {
            Object::Array(Some(array)) => {
                let Object::Bytes(bytes) = self.get(array.bytes) else {
                    return None;
                };
                let Object::Tuple(shape) = self.get(array.shape) else {
                    return None;
                };
                let mut size = 1usize;
                for &length in shape {
                    let Object::Int(length) = self.get(length) else {
                        return None;
                    };
                    size = size.checked_mul(usize::try_from(*length).ok()?)?;
                }
                // The only order read is C's; a vector has the same in Fortran's.
                let ordered = !array.fortran || shape.len() <= 1;
                if size > MAX_NUMBERS || bytes.len() > 8 * size {
                    return None;
                }
                let numbers = self.decode(array.dtype, bytes)?;
                (ordered && numbers.len() == size).then_some(numbers)
            }
            Object::Scalar { .. } | Object::Int(_) | Object::Float(_) | Object::Bool(_) => {
                Some(vec![self.number(object)?])
            }
            Object::List(items) | Object::Tuple(items) => items
                .iter()
                .map(|&item| self.number(self.get(item)))
                .collect(),
            _ => None,
        }
    }

    /// `object` as a number; `None` if it is none.
    pub(super) fn number(&self, object: &Object<'a>) -> Option<f64> {
        match object {
            Object::Int(value) => Some(*value as f64),
            Object::Float(value) => Some(*value),
            Object::Bool(value) => Some(f64::from(u8::from(*value))),
            Object::Scalar { dtype, bytes } => {
                let Object::Bytes(bytes) = self.get(*bytes) else {
                    return None;
                };
                if bytes.len() > 8 {
                    return None;
                }
                self.decode(*dtype, bytes)?.first().copied()
            }
            _ => None,
        }
    }

    /// The numbers in `bytes`, which are of type `dtype`.
    fn decode(&self, dtype: Id, bytes: &[u8]) -> Option<Vec<f64>> {
        let Object::Dtype { name, little } = *self.get(dtype) else {
            return None;
        };
        super::arrays::decode(name, little, bytes)
    }
}
