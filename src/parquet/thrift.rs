//! A reader of Thrift's compact protocol, in which Parquet describes itself; it trusts nothing that
//! a file claims.

/// The most elements of one list; no file of ours has as many columns, row groups or notes.
const MAX_ELEMENTS: u64 = 100_000;

/// The deepest nesting of structures.
const MAX_DEPTH: usize = 16;

/// The kind of a field's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Bool(bool),
    Byte,
    /// A number of 16, 32 or 64 bits.
    Int,
    Double,
    Binary,
    List,
    Map,
    Struct,
}

impl Kind {
    fn of(code: u8) -> Result<Self, String> {
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
            _ => return Err(format!("no thrift value has the kind {code}")),
        })
    }
}

/// Bytes that are read from the front.
pub(super) struct Reader<'a> {
    pub(super) rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// A run of bytes after its length in four bytes.
    pub(super) fn prefixed(&mut self) -> Result<&'a [u8], String> {
        let length = self.take(4)?;
        self.take(u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize)
    }

    /// The next `n` bytes.
    pub(super) fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.rest.split_at_checked(n).ok_or("it ends too early")?;
        self.rest = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    /// An unsigned number with seven bits in each byte.
    pub(super) fn varint(&mut self) -> Result<u64, String> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err("a number is longer than 64 bits".into())
    }

    /// A signed number, with its sign in the lowest bit.
    pub(super) fn int(&mut self) -> Result<i64, String> {
        let value = self.varint()?;
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// A length-prefixed run of bytes.
    fn binary(&mut self) -> Result<&'a [u8], String> {
        let length = usize::try_from(self.varint()?).map_err(|_| "a string is too long")?;
        self.take(length)
    }

    /// A string.
    pub(super) fn string(&mut self) -> Result<String, String> {
        String::from_utf8(self.binary()?.to_vec()).map_err(|_| "a string is not UTF-8".into())
    }

    /// The elements of a list of `kind`.
    pub(super) fn list<T>(
        &mut self,
        kind: Kind,
        mut element: impl FnMut(&mut Self) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        let (size, found) = self.list_header()?;
        if found != kind && size > 0 {
            return Err(format!("a list holds {found:?} instead of {kind:?}"));
        }
        (0..size).map(|_| element(self)).collect()
    }

    fn list_header(&mut self) -> Result<(u64, Kind), String> {
        let header = self.byte()?;
        let size = if header >> 4 == 15 {
            self.varint()?
        } else {
            u64::from(header >> 4)
        };
        if size > MAX_ELEMENTS {
            return Err(format!("a list claims {size} elements"));
        }
        Ok((size, Kind::of(header & 15)?))
    }

    /// Reads the fields of a structure: `field` gets each one's number and kind, and reads or
    /// [`skip`](Reader::skip)s it.
    pub(super) fn structure(
        &mut self,
        mut field: impl FnMut(&mut Self, i64, Kind) -> Result<(), String>,
    ) -> Result<(), String> {
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
    pub(super) fn skip(&mut self, kind: Kind) -> Result<(), String> {
        self.skip_nested(kind, 0)
    }

    fn skip_nested(&mut self, kind: Kind, depth: usize) -> Result<(), String> {
        if depth > MAX_DEPTH {
            return Err("its description nests too deep".into());
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
    fn skip_element(&mut self, kind: Kind, depth: usize) -> Result<(), String> {
        if let Kind::Bool(_) = kind {
            self.byte().map(drop)
        } else {
            self.skip_nested(kind, depth + 1)
        }
    }
}
