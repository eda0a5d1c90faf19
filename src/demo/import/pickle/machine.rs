//! The stack machine that a pickle is a program for, without the instructions that run code.

use std::collections::HashMap;

use super::{super::MAX_UNFOLDED, Array, Global, Id, Object, Pickle, PickleError};

/// The most instructions that are followed: some fifty a step for 80,000 steps.
/// Each adds at most one object, one place on the stack or one entry of a collection. So their
/// memory is bounded too, to some 400 MiB.
pub(super) const MAX_INSTRUCTIONS: usize = 1 << 22;

/// All objects that the program `bytes` makes.
pub(super) fn run(bytes: &[u8]) -> Result<Pickle<'_>, PickleError> {
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
            return Ok(Pickle {
                objects: machine.objects,
                root,
            });
        }
        machine.step(code)?;
    }
    Err(PickleError::TooLong)
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
    fn take(&mut self, n: usize) -> Result<&'a [u8], PickleError> {
        let (taken, rest) = self.rest.split_at_checked(n).ok_or(PickleError::Ended)?;
        self.rest = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, PickleError> {
        Ok(self.take(1)?[0])
    }

    /// A number of `n` bytes, lowest first.
    fn unsigned(&mut self, n: usize) -> Result<u64, PickleError> {
        Ok(self
            .take(n)?
            .iter()
            .rev()
            .fold(0, |value, &byte| value << 8 | u64::from(byte)))
    }

    /// A run of bytes after its length, a number of `n` bytes.
    fn prefixed(&mut self, n: usize) -> Result<&'a [u8], PickleError> {
        let length = usize::try_from(self.unsigned(n)?).map_err(|_| PickleError::Ended)?;
        self.take(length)
    }

    /// The text up to the end of the line.
    fn line(&mut self) -> Result<&'a str, PickleError> {
        let end = self
            .rest
            .iter()
            .position(|&byte| byte == b'\n')
            .ok_or(PickleError::Ended)?;
        let line = text(self.take(end)?)?;
        self.take(1)?;
        Ok(line)
    }

    fn push(&mut self, object: Object<'a>) -> Result<(), PickleError> {
        self.stack.push(self.objects.len());
        self.objects.push(object);
        Ok(())
    }

    fn pop(&mut self) -> Result<Id, PickleError> {
        let floor = self.marks.last().copied().unwrap_or(0);
        if self.stack.len() <= floor {
            return Err(PickleError::EmptyStack);
        }
        self.stack.pop().ok_or(PickleError::EmptyStack)
    }

    /// The top `n` objects.
    fn pop_many(&mut self, n: usize) -> Result<Vec<Id>, PickleError> {
        let mut ids = (0..n).map(|_| self.pop()).collect::<Result<Vec<_>, _>>()?;
        ids.reverse();
        Ok(ids)
    }

    /// The objects pushed since the last mark.
    fn pop_marked(&mut self) -> Result<Vec<Id>, PickleError> {
        let mark = self.marks.pop().ok_or(PickleError::EmptyStack)?;
        Ok(self.stack.split_off(mark.min(self.stack.len())))
    }

    /// The object on top of the stack, to be changed.
    fn top(&mut self) -> Result<&mut Object<'a>, PickleError> {
        let id = *self.stack.last().ok_or(PickleError::EmptyStack)?;
        Ok(&mut self.objects[id])
    }

    fn remember(&mut self, key: u64) -> Result<(), PickleError> {
        let id = *self.stack.last().ok_or(PickleError::EmptyStack)?;
        self.memo.insert(key, id);
        Ok(())
    }

    fn recall(&mut self, key: u64) -> Result<(), PickleError> {
        let id = *self.memo.get(&key).ok_or(PickleError::NeverMade(key))?;
        self.stack.push(id);
        Ok(())
    }

    fn append(&mut self, items: Vec<Id>) -> Result<(), PickleError> {
        match self.top()? {
            Object::List(list) => list.extend(items),
            _ => return Err(wrong("appends to", "a list")),
        }
        Ok(())
    }

    fn insert(&mut self, items: &[Id]) -> Result<(), PickleError> {
        let (pairs, []) = items.as_chunks::<2>() else {
            return Err(PickleError::KeyAlone);
        };
        match self.top()? {
            Object::Dict(entries) => entries.extend(pairs.iter().map(|&[key, value]| (key, value))),
            _ => return Err(wrong("inserts into", "a dictionary")),
        }
        Ok(())
    }

    /// Executes one instruction.
    fn step(&mut self, code: u8) -> Result<(), PickleError> {
        match code {
            // PROTO, FRAME: how it was written.
            0x80 => {
                let protocol = self.byte()?;
                if protocol > 5 {
                    Err(PickleError::Protocol(protocol))
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
                    _ => Err(wrong("names a function by", "text")),
                }
            }
            b'R' => self.call(),
            b'b' => self.build(),
            _ => Err(PickleError::Instruction(code)),
        }
    }

    /// A whole number of any length, of which 64 bits are enough here.
    fn long(&mut self) -> Result<(), PickleError> {
        let bytes = self.prefixed(1)?;
        if bytes.len() > 8 {
            return Err(PickleError::LongNumber);
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
    fn call(&mut self) -> Result<(), PickleError> {
        let ids = self.pop_many(2)?;
        let Object::Global(function) = self.objects[ids[0]] else {
            return Err(wrong("calls", "a function"));
        };
        let Object::Tuple(arguments) = &self.objects[ids[1]] else {
            return Err(wrong("calls a function with", "a tuple"));
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
                    return Err(PickleError::TooMuchText);
                }
                let bytes: Option<_> = encoded
                    .chars()
                    .map(|c| u8::try_from(u32::from(c)).ok())
                    .collect();
                Object::Bytes(bytes.ok_or(PickleError::Encoding("latin1"))?)
            }
            _ => {
                return Err(PickleError::Call(function));
            }
        };
        self.push(made)
    }

    /// Gives an array or a type its state.
    fn build(&mut self) -> Result<(), PickleError> {
        let state = self.pop()?;
        let Object::Tuple(state) = &self.objects[state] else {
            return Err(wrong("builds an object from", "a tuple"));
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
            _ => return Err(PickleError::Build),
        }
        Ok(())
    }
}

/// The error about an object of another kind than `action` needs.
fn wrong(action: &'static str, needed: &'static str) -> PickleError {
    PickleError::WrongObject { action, needed }
}

/// Bytes as text.
fn text(bytes: &[u8]) -> Result<&str, PickleError> {
    std::str::from_utf8(bytes).map_err(|_| PickleError::Encoding("UTF-8"))
}

/// The function or class `name` of `module`.
fn global(module: &str, name: &str) -> Result<Global, PickleError> {
    match (module, name) {
        ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => {
            Ok(Global::Reconstruct)
        }
        ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Ok(Global::Scalar),
        ("numpy", "ndarray") => Ok(Global::Ndarray),
        ("numpy", "dtype") => Ok(Global::Dtype),
        ("_codecs", "encode") => Ok(Global::Encode),
        _ => Err(PickleError::UnknownFunction {
            module: module.to_owned(),
            name: name.to_owned(),
        }),
    }
}
