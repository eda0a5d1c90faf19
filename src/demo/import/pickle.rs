//! A pickle that holds plain data and numpy arrays, read without running any of it.
//!
//! Pickle is a program for a small stack machine, and its `GLOBAL` and `REDUCE` call whatever
//! Python function the file names. This machine knows the instructions that data needs and, by
//! name, the handful of numpy's functions that make an array; the rest is an error that names it.
//! Objects live in one vector and refer to each other by place, so that sharing and even cycles
//! cost nothing; nothing here recurses over them.

use std::collections::HashMap;

use super::{MAX_NUMBERS, MAX_UNFOLDED};

/// The most instructions that are followed: some fifty a step for 80,000 steps.
/// Each adds at most one object, one place on the stack or one entry of a collection. So their
/// memory is bounded too, to some 400 MiB.
const MAX_INSTRUCTIONS: usize = 1 << 22;

/// An object's place.
pub(super) type Id = usize;

/// A function or class that a file may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Global {
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
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let mut machine = Machine {
            rest: bytes,
            objects: vec![],
            stack: vec![],
            marks: vec![],
            memo: HashMap::new(),
            encoded: 0,
        };
        for _ in 0..MAX_INSTRUCTIONS {
            let code = machine.byte()?;
            if code == b'.' {
                let root = machine.pop()?;
                return Ok(Self {
                    objects: machine.objects,
                    root,
                });
            }
            machine.step(code)?;
        }
        Err(format!(
            "the pickle has more than {MAX_INSTRUCTIONS} instructions"
        ))
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

/// The stack machine.
struct Machine<'a> {
    rest: &'a [u8],
    objects: Vec<Object<'a>>,
    stack: Vec<Id>,
    /// Heights of the stack at which collections begin.
    marks: Vec<usize>,
    memo: HashMap<u64, Id>,
    /// The bytes that were made from texts: the file's length does not bound their number.
    encoded: usize,
}

impl<'a> Machine<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self
            .rest
            .split_at_checked(n)
            .ok_or("the pickle ends too early")?;
        self.rest = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    /// A number of `n` bytes, lowest first.
    fn unsigned(&mut self, n: usize) -> Result<u64, String> {
        Ok(self
            .take(n)?
            .iter()
            .rev()
            .fold(0, |value, &byte| value << 8 | u64::from(byte)))
    }

    /// A run of bytes after its length, a number of `n` bytes.
    fn prefixed(&mut self, n: usize) -> Result<&'a [u8], String> {
        let length = usize::try_from(self.unsigned(n)?).map_err(|_| "the pickle ends too early")?;
        self.take(length)
    }

    /// The text up to the end of the line.
    fn line(&mut self) -> Result<&'a str, String> {
        let end = self
            .rest
            .iter()
            .position(|&byte| byte == b'\n')
            .ok_or("the pickle ends too early")?;
        let line = text(self.take(end)?)?;
        self.take(1)?;
        Ok(line)
    }

    fn push(&mut self, object: Object<'a>) -> Result<(), String> {
        self.stack.push(self.objects.len());
        self.objects.push(object);
        Ok(())
    }

    fn pop(&mut self) -> Result<Id, String> {
        let floor = self.marks.last().copied().unwrap_or(0);
        if self.stack.len() <= floor {
            return Err("the pickle takes from an empty stack".into());
        }
        self.stack
            .pop()
            .ok_or_else(|| "the pickle takes from an empty stack".into())
    }

    /// The top `n` objects.
    fn pop_many(&mut self, n: usize) -> Result<Vec<Id>, String> {
        let mut ids = (0..n).map(|_| self.pop()).collect::<Result<Vec<_>, _>>()?;
        ids.reverse();
        Ok(ids)
    }

    /// The objects pushed since the last mark.
    fn pop_marked(&mut self) -> Result<Vec<Id>, String> {
        let mark = self.marks.pop().ok_or("the pickle lacks a mark")?;
        Ok(self.stack.split_off(mark.min(self.stack.len())))
    }

    /// The object on top of the stack, to be changed.
    fn top(&mut self) -> Result<&mut Object<'a>, String> {
        let id = *self
            .stack
            .last()
            .ok_or("the pickle takes from an empty stack")?;
        Ok(&mut self.objects[id])
    }

    fn remember(&mut self, key: u64) -> Result<(), String> {
        let id = *self
            .stack
            .last()
            .ok_or("the pickle takes from an empty stack")?;
        self.memo.insert(key, id);
        Ok(())
    }

    fn recall(&mut self, key: u64) -> Result<(), String> {
        let id = *self
            .memo
            .get(&key)
            .ok_or_else(|| format!("the pickle recalls {key}, which it never made"))?;
        self.stack.push(id);
        Ok(())
    }

    fn append(&mut self, items: Vec<Id>) -> Result<(), String> {
        match self.top()? {
            Object::List(list) => list.extend(items),
            _ => return Err("the pickle appends to something that is not a list".into()),
        }
        Ok(())
    }

    fn insert(&mut self, items: &[Id]) -> Result<(), String> {
        let (pairs, []) = items.as_chunks::<2>() else {
            return Err("the pickle has a key without a value".into());
        };
        match self.top()? {
            Object::Dict(entries) => entries.extend(pairs.iter().map(|&[key, value]| (key, value))),
            _ => return Err("the pickle inserts into something that is not a dictionary".into()),
        }
        Ok(())
    }

    /// Executes one instruction.
    fn step(&mut self, code: u8) -> Result<(), String> {
        match code {
            // PROTO, FRAME: how it was written.
            0x80 => {
                let protocol = self.byte()?;
                if protocol > 5 {
                    Err(format!("the pickle has the unknown protocol {protocol}"))
                } else {
                    Ok(())
                }
            }
            0x95 => self.take(8).map(drop),
            // Single values.
            b'N' => self.push(Object::None),
            0x88 => self.push(Object::Bool(true)),
            0x89 => self.push(Object::Bool(false)),
            b'K' => self
                .unsigned(1)
                .and_then(|value| self.push(Object::Int(value as i64))),
            b'M' => self
                .unsigned(2)
                .and_then(|value| self.push(Object::Int(value as i64))),
            b'J' => self
                .unsigned(4)
                .and_then(|value| self.push(Object::Int(i64::from(value as u32 as i32)))),
            0x8a => self.long(),
            b'G' => {
                let bytes = self.unsigned(8)?;
                self.push(Object::Float(f64::from_bits(bytes.swap_bytes())))
            }
            0x8c => self
                .prefixed(1)
                .and_then(|bytes| self.push(Object::Text(text(bytes)?))),
            b'X' => self
                .prefixed(4)
                .and_then(|bytes| self.push(Object::Text(text(bytes)?))),
            0x8d => self
                .prefixed(8)
                .and_then(|bytes| self.push(Object::Text(text(bytes)?))),
            b'C' => self
                .prefixed(1)
                .and_then(|bytes| self.push(Object::Bytes(bytes.to_vec()))),
            b'B' => self
                .prefixed(4)
                .and_then(|bytes| self.push(Object::Bytes(bytes.to_vec()))),
            0x8e => self
                .prefixed(8)
                .and_then(|bytes| self.push(Object::Bytes(bytes.to_vec()))),
            // Collections.
            b'(' => {
                self.marks.push(self.stack.len());
                Ok(())
            }
            b'}' => self.push(Object::Dict(vec![])),
            b']' => self.push(Object::List(vec![])),
            b')' => self.push(Object::Tuple(vec![])),
            0x85..=0x87 => {
                let items = self.pop_many(usize::from(code - 0x84))?;
                self.push(Object::Tuple(items))
            }
            b't' => {
                let items = self.pop_marked()?;
                self.push(Object::Tuple(items))
            }
            b'a' => {
                let item = self.pop()?;
                self.append(vec![item])
            }
            b'e' => {
                let items = self.pop_marked()?;
                self.append(items)
            }
            b's' => {
                let items = self.pop_many(2)?;
                self.insert(&items)
            }
            b'u' => {
                let items = self.pop_marked()?;
                self.insert(&items)
            }
            // The memo.
            b'q' => self.unsigned(1).and_then(|key| self.remember(key)),
            b'r' => self.unsigned(4).and_then(|key| self.remember(key)),
            0x94 => self.remember(self.memo.len() as u64),
            b'h' => self.unsigned(1).and_then(|key| self.recall(key)),
            b'j' => self.unsigned(4).and_then(|key| self.recall(key)),
            // numpy.
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.push(Object::Global(global(module, name)?))
            }
            0x93 => {
                let names = self.pop_many(2)?;
                match (&self.objects[names[0]], &self.objects[names[1]]) {
                    (&Object::Text(module), &Object::Text(name)) => {
                        self.push(Object::Global(global(module, name)?))
                    }
                    _ => Err("the pickle names a function by something that is not text".into()),
                }
            }
            b'R' => self.call(),
            b'b' => self.build(),
            _ => Err(format!(
                "the pickle uses the instruction 0x{code:02x}, which plain data and arrays do not need"
            )),
        }
    }

    /// A whole number of any length, of which 64 bits are enough here.
    fn long(&mut self) -> Result<(), String> {
        let bytes = self.prefixed(1)?;
        if bytes.len() > 8 {
            return Err("the pickle has a whole number beyond 64 bits".into());
        }
        let negative = bytes.last().is_some_and(|&byte| byte >= 0x80);
        let start = if negative { -1i64 } else { 0 };
        self.push(Object::Int(
            bytes
                .iter()
                .rev()
                .fold(start, |value, &byte| value << 8 | i64::from(byte)),
        ))
    }

    /// Calls one of the known functions.
    fn call(&mut self) -> Result<(), String> {
        let ids = self.pop_many(2)?;
        let Object::Global(function) = self.objects[ids[0]] else {
            return Err("the pickle calls something that is not a function".into());
        };
        let Object::Tuple(arguments) = &self.objects[ids[1]] else {
            return Err("the pickle calls a function without arguments".into());
        };
        let argument = |i: usize| arguments.get(i).map(|&id| &self.objects[id]);
        let made = match (function, argument(0), argument(1)) {
            (Global::Reconstruct, Some(Object::Global(Global::Ndarray)), _) => Object::Array(None),
            (Global::Dtype, Some(&Object::Text(name)), _) => {
                // `<f8`, `f8` and, from older numpy, `f8` with the order to come by BUILD.
                let little = !name.starts_with('>');
                Object::Dtype {
                    name: name.trim_start_matches(['<', '>', '=', '|']),
                    little,
                }
            }
            (Global::Scalar, Some(Object::Dtype { .. }), Some(Object::Bytes(_))) => {
                Object::Scalar {
                    dtype: arguments[0],
                    bytes: arguments[1],
                }
            }
            (Global::Encode, Some(&Object::Text(encoded)), Some(Object::Text("latin1"))) => {
                // One text can be encoded many times, so the file's length does not bound this.
                self.encoded += encoded.len();
                if self.encoded > MAX_UNFOLDED {
                    return Err(format!(
                        "the pickle encodes texts of more than {} MiB",
                        MAX_UNFOLDED >> 20
                    ));
                }
                let bytes: Option<_> = encoded
                    .chars()
                    .map(|c| u8::try_from(u32::from(c)).ok())
                    .collect();
                Object::Bytes(bytes.ok_or("the pickle encodes text that is not latin1")?)
            }
            _ => {
                return Err(format!(
                    "the pickle calls {function:?} in a way that numpy does not"
                ));
            }
        };
        self.push(made)
    }

    /// Gives an array or a type its state.
    fn build(&mut self) -> Result<(), String> {
        let state = self.pop()?;
        let Object::Tuple(state) = &self.objects[state] else {
            return Err("the pickle builds an object from something that is not a tuple".into());
        };
        // numpy's states of types and arrays have nine entries at most.
        let state = state[..state.len().min(9)].to_vec();
        let item = |i: usize| state.get(i).map(|&id| &self.objects[id]);
        let order = item(1).cloned();
        let array = match (item(1), item(2), item(3), item(4)) {
            (
                Some(Object::Tuple(_)),
                Some(Object::Dtype { .. }),
                Some(&Object::Bool(fortran)),
                Some(Object::Bytes(_)),
            ) => Some(Array {
                shape: state[1],
                dtype: state[2],
                fortran,
                bytes: state[4],
            }),
            _ => None,
        };
        match (self.top()?, order, array) {
            (Object::Array(place), _, Some(array)) => *place = Some(array),
            (Object::Dtype { little, .. }, Some(Object::Text(order)), _) => *little = order != ">",
            _ => return Err("the pickle builds an object in a way that numpy does not".into()),
        }
        Ok(())
    }
}

/// Bytes as text.
fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|_| "the pickle has text that is not UTF-8".into())
}

/// The function or class `name` of `module`.
fn global(module: &str, name: &str) -> Result<Global, String> {
    match (module, name) {
        ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => {
            Ok(Global::Reconstruct)
        }
        ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Ok(Global::Scalar),
        ("numpy", "ndarray") => Ok(Global::Ndarray),
        ("numpy", "dtype") => Ok(Global::Dtype),
        ("_codecs", "encode") => Ok(Global::Encode),
        _ => Err(format!(
            "the pickle names `{module}.{name}`; numpy's array, scalar and dtype alone are known"
        )),
    }
}
