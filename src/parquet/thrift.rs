//! A reader of Thrift's compact protocol, in which Parquet describes itself; it trusts nothing that
//! a file claims.

use super::error::ThriftError;

/// The most elements of one list; no file of ours has as many columns, row groups or notes.
const MAX_ELEMENTS: u64 = 100_000;

/// The deepest nesting of structures.
const MAX_DEPTH: usize = 16;

/// The kind of a field's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A truth value; in a structure, the kind is the value.
    Bool(bool),
    /// A byte.
    Byte,
    /// A number of 16, 32 or 64 bits.
    Int,
    /// A number of 64 bits with a fraction.
    Double,
    /// Bytes, or text.
    Binary,
    /// A list or a set.
    List,
    /// Keys and values.
    Map,
    /// Numbered fields.
    Struct,
}

impl Kind {
    fn of(code: u8) -> Result<Self, ThriftError> {
        Ok(match code {
            1 => Self::Bool(true),
            2 => Self::Bool(false),
            3 => Self::Byte,
            4..=6 => Self::Int,
            7 => Self::Double,
            8 => Self::Binary,
            9 | 10 => Self::List,
            11 => Self::Map,
            12 => Self::Struct,
            _ => return Err(ThriftError::UnknownKind(code)),
        })
    }
}

/// Bytes that are read from the front.
pub(super) struct Reader<'a> {
    pub(super) rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// A run of bytes after its length in four bytes.
    pub(super) fn prefixed(&mut self) -> Result<&'a [u8], ThriftError> {
        let length = self.take(4)?;
        self.take(u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize)
    }

    /// The next `n` bytes.
    pub(super) fn take(&mut self, n: usize) -> Result<&'a [u8], ThriftError> {
        let (taken, rest) = self.rest.split_at_checked(n).ok_or(ThriftError::Ended)?;
        self.rest = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, ThriftError> {
        Ok(self.take(1)?[0])
    }

    /// An unsigned number with seven bits in each byte.
    pub(super) fn varint(&mut self) -> Result<u64, ThriftError> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(ThriftError::LongNumber)
    }

    /// A signed number, with its sign in the lowest bit.
    pub(super) fn int(&mut self) -> Result<i64, ThriftError> {
        let value = self.varint()?;
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// A length-prefixed run of bytes.
    fn binary(&mut self) -> Result<&'a [u8], ThriftError> {
        let length = usize::try_from(self.varint()?).map_err(|_| ThriftError::Ended)?;
        self.take(length)
    }

    /// A string.
    pub(super) fn string(&mut self) -> Result<String, ThriftError> {
        Ok(text(self.binary()?)?.to_owned())
    }

    /// The elements of a list of `kind`.
    pub(super) fn list<T>(
        &mut self,
        kind: Kind,
        mut element: impl FnMut(&mut Self) -> Result<T, ThriftError>,
    ) -> Result<Vec<T>, ThriftError> {
        let (size, found) = self.list_header()?;
        if found != kind && size > 0 {
            return Err(ThriftError::WrongKind {
                found,
                expected: kind,
            });
        }
        (0..size).map(|_| element(self)).collect()
    }

    fn list_header(&mut self) -> Result<(u64, Kind), ThriftError> {
        let header = self.byte()?;
        let size = if header >> 4 == 15 {
            self.varint()?
        } else {
            u64::from(header >> 4)
        };
        if size > MAX_ELEMENTS {
            return Err(ThriftError::LongList(size));
        }
        Ok((size, Kind::of(header & 15)?))
    }

    /// Reads the fields of a structure: `field` gets each one's number and kind, and reads or
    /// [`skip`](Reader::skip)s it.
    pub(super) fn structure(
        &mut self,
        mut field: impl FnMut(&mut Self, i64, Kind) -> Result<(), ThriftError>,
    ) -> Result<(), ThriftError> {
        let mut id = 0i64;
        loop {
            let header = self.byte()?;
            if header == 0 {
                return Ok(());
            }
            id = if header >> 4 == 0 {
                self.int()?
            } else {
                id.wrapping_add(i64::from(header >> 4))
            };
            field(self, id, Kind::of(header & 15)?)?;
        }
    }

    /// Passes over a value of `kind`.
    pub(super) fn skip(&mut self, kind: Kind) -> Result<(), ThriftError> {
        self.skip_nested(kind, 0)
    }

    fn skip_nested(&mut self, kind: Kind, depth: usize) -> Result<(), ThriftError> {
        if depth > MAX_DEPTH {
            return Err(ThriftError::TooDeep);
        }
        match kind {
            Kind::Bool(_) => Ok(()),
            Kind::Byte => self.byte().map(drop),
            Kind::Int => self.varint().map(drop),
            Kind::Double => self.take(8).map(drop),
            Kind::Binary => self.binary().map(drop),
            Kind::Struct => self.structure(|reader, _, kind| reader.skip_nested(kind, depth + 1)),
            Kind::List => {
                let (size, kind) = self.list_header()?;
                (0..size).try_for_each(|_| self.skip_element(kind, depth))
            }
            Kind::Map => {
                let size = self.varint()?;
                if size == 0 {
                    return Ok(());
                }
                let kinds = self.byte()?;
                let (key, value) = (Kind::of(kinds >> 4)?, Kind::of(kinds & 15)?);
                (0..size).try_for_each(|_| {
                    self.skip_element(key, depth)
                        .and_then(|()| self.skip_element(value, depth))
                })
            }
        }
    }

    /// As [`skip`](Reader::skip) for an element of a collection, where a truth value takes a byte.
    fn skip_element(&mut self, kind: Kind, depth: usize) -> Result<(), ThriftError> {
        if let Kind::Bool(_) = kind {
            self.byte().map(drop)
        } else {
            self.skip_nested(kind, depth + 1)
        }
    }
}

/// `bytes` as text.
pub(super) fn text(bytes: &[u8]) -> Result<&str, ThriftError> {
    std::str::from_utf8(bytes).map_err(|_| ThriftError::NotUtf8)
}
