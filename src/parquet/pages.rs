//! A column's pages: decompression, levels, values.

use std::{io::Read, sync::Arc};

use super::{
    footer::{Chunk, Leaf, Physical},
    thrift::{Kind, Reader},
};

/// The largest page, bytes once decompressed; writers make pages of about a megabyte.
const MAX_PAGE: usize = 1 << 28;

/// What a text takes beside its bytes.
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
    /// None yet, of the type `physical`.
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

    /// None yet, of the same type.
    fn none_yet(&self) -> Self {
        match self {
            Self::Bool(_) => Self::Bool(vec![]),
            Self::I32(_) => Self::I32(vec![]),
            Self::I64(_) => Self::I64(vec![]),
            Self::F32(_) => Self::F32(vec![]),
            Self::F64(_) => Self::F64(vec![]),
            Self::Text(_) => Self::Text(vec![]),
        }
    }

    /// Their type, as a message calls it.
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

    /// How many there are.
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

    /// As f64, truth values as 0 and 1; `None` of text.
    pub(crate) fn widened(self) -> Option<Vec<f64>> {
        Some(match self {
            Self::Bool(values) => values.into_iter().map(|value| f64::from(u8::from(value))).collect(),
            Self::I32(values) => values.into_iter().map(f64::from).collect(),
            Self::I64(values) => values.into_iter().map(|value| value as f64).collect(),
            Self::F32(values) => values.into_iter().map(f64::from).collect(),
            Self::F64(values) => values,
            Self::Text(_) => return None,
        })
    }

    /// Appends `n` values that `bytes` hold one after another; text at the expense of `budget`.
    fn extend_plain(&mut self, bytes: &[u8], n: usize, budget: &mut Budget) -> Result<(), String> {
        fn words<const N: usize, T>(
            bytes: &[u8],
            n: usize,
            of: fn([u8; N]) -> T,
        ) -> Result<impl Iterator<Item = T>, String> {
            let words = bytes.as_chunks::<N>().0;
            let words = words.get(..n).ok_or("a page ends too early")?;
            Ok(words.iter().map(move |&word| of(word)))
        }
        match self {
            Self::Bool(values) => {
                let bytes = bytes.get(..n.div_ceil(8)).ok_or("a page ends too early")?;
                values.extend((0..n).map(|i| bytes[i / 8] >> (i % 8) & 1 == 1));
            }
            Self::I32(values) => values.extend(words(bytes, n, i32::from_le_bytes)?),
            Self::I64(values) => values.extend(words(bytes, n, i64::from_le_bytes)?),
            Self::F32(values) => values.extend(words(bytes, n, f32::from_le_bytes)?),
            Self::F64(values) => values.extend(words(bytes, n, f64::from_le_bytes)?),
            Self::Text(values) => {
                let mut reader = Reader { rest: bytes };
                for _ in 0..n {
                    let text = std::str::from_utf8(prefixed(&mut reader)?).map_err(|_| "text that is not UTF-8")?;
                    budget.spend_text(text.len() + ENTRY)?;
                    values.push(text.into());
                }
            }
        }
        Ok(())
    }

    /// Appends the values of `dictionary` at `indices`; text at the expense of `budget`.
    fn extend_from(&mut self, dictionary: &Self, indices: &[u32], budget: &mut Budget) -> Result<(), String> {
        fn look_up<T: Clone>(values: &mut Vec<T>, dictionary: &[T], indices: &[u32]) -> Result<(), String> {
            for &index in indices {
                values.push(dictionary.get(index as usize).ok_or("a value is not in its dictionary")?.clone());
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
                values[before..].iter().try_for_each(|text| budget.spend_text(text.len()))
            }
            _ => Err("a dictionary is of another type than its column".into()),
        }
    }
}

/// What may still be read of a file, so that a small file cannot fill the memory.
pub(super) struct Budget {
    /// Values, gaps among them.
    pub(super) numbers: usize,
    /// Bytes that are decompressed.
    pub(super) bytes: usize,
    /// Bytes of text, as often as it stands in a row or a dictionary.
    pub(super) text: usize,
}

impl Budget {
    fn spend_text(&mut self, bytes: usize) -> Result<(), String> {
        self.text = self.text.checked_sub(bytes).ok_or("more text than is read")?;
        Ok(())
    }
}

/// What has been read of a column.
pub(super) struct Column {
    pub(super) values: Values,
    /// For a column of lists, the length of each row.
    pub(super) lengths: Vec<usize>,
    /// Whether each row has a value; absent where gaps are refused.
    pub(super) there: Option<Vec<bool>>,
}

/// A page as its header describes it.
#[derive(Default)]
struct Page {
    kind: i64,
    size: i64,
    compressed_size: i64,
    values: i64,
    encoding: i64,
    /// Bytes of definition and repetition levels, where the header tells (version 2).
    definition_bytes: i64,
    repetition_bytes: i64,
    compressed: bool,
}

impl Page {
    fn read(reader: &mut Reader<'_>) -> Result<Self, String> {
        let mut page = Self { compressed: true, ..Self::default() };
        reader.structure(|reader, id, kind| {
            match (id, kind) {
                (1, Kind::Int) => page.kind = reader.int()?,
                (2, Kind::Int) => page.size = reader.int()?,
                (3, Kind::Int) => page.compressed_size = reader.int()?,
                // The headers of data, dictionary and version 2 data pages; a page has the one of its kind.
                (5 | 7 | 8, Kind::Struct) => reader.structure(|reader, field, kind| {
                    match (id, field, kind) {
                        (_, 1, Kind::Int) => page.values = reader.int()?,
                        (5 | 7, 2, Kind::Int) | (8, 4, Kind::Int) => page.encoding = reader.int()?,
                        (8, 5, Kind::Int) => page.definition_bytes = reader.int()?,
                        (8, 6, Kind::Int) => page.repetition_bytes = reader.int()?,
                        (8, 7, Kind::Bool(compressed)) => page.compressed = compressed,
                        _ => reader.skip(kind)?,
                    }
                    Ok(())
                })?,
                _ => reader.skip(kind)?,
            }
            Ok(())
        })?;
        Ok(page)
    }
}

/// Appends a row group's part of a column to `column`.
pub(super) fn read_chunk(
    file: &[u8],
    leaf: &Leaf,
    chunk: &Chunk,
    budget: &mut Budget,
    column: &mut Column,
) -> Result<(), String> {
    let start = usize::try_from(chunk.offset).ok().filter(|&start| start < file.len());
    let mut reader = Reader { rest: &file[start.ok_or("a column lies outside the file")?..] };
    let claimed = size(chunk.values)?;
    let mut dictionary = None;
    let mut held = 0;
    while held < claimed {
        let page = Page::read(&mut reader)?;
        let stored = reader.take(size(page.compressed_size)?)?;
        let n = size(page.values)?;
        if n > budget.numbers || size(page.size)? > budget.bytes.min(MAX_PAGE) {
            return Err("more than is read".into());
        }
        budget.bytes -= size(page.size)?;
        match page.kind {
            0 | 3 => {
                budget.numbers -= n;
                held += n;
                if held > claimed {
                    return Err(format!("a column claims {claimed} values and has more"));
                }
                data_page(leaf, chunk, &page, stored, dictionary.as_ref(), budget, column)?;
            }
            2 => {
                let bytes = decompress(chunk.codec, stored, size(page.size)?)?;
                let mut entries = column.values.none_yet();
                entries.extend_plain(&bytes, n, budget)?;
                dictionary = Some(entries);
            }
            _ => {}
        }
    }
    Ok(())
}

/// Appends a data page.
fn data_page(
    leaf: &Leaf,
    chunk: &Chunk,
    page: &Page,
    stored: &[u8],
    dictionary: Option<&Values>,
    budget: &mut Budget,
    column: &mut Column,
) -> Result<(), String> {
    let n = size(page.values)?;
    let (definition_width, repetition_width) = (width(leaf.max_definition), width(leaf.max_repetition));
    let decompressed;
    let (repetitions, definitions, rest) = if page.kind == 3 {
        let mut levels = Reader { rest: stored };
        let repetitions = levels.take(size(page.repetition_bytes)?)?;
        let definitions = levels.take(size(page.definition_bytes)?)?;
        let before = repetitions.len() + definitions.len();
        let codec = if page.compressed { chunk.codec } else { 0 };
        let rest = size(page.size)?.checked_sub(before).ok_or("a page's levels are larger than the page")?;
        decompressed = decompress(codec, levels.rest, rest)?;
        (repetitions, definitions, decompressed.as_slice())
    } else {
        decompressed = decompress(chunk.codec, stored, size(page.size)?)?;
        let mut levels = Reader { rest: &decompressed };
        let repetitions = if leaf.max_repetition > 0 { prefixed(&mut levels)? } else { &[] };
        let definitions = if leaf.max_definition > 0 { prefixed(&mut levels)? } else { &[] };
        (repetitions, definitions, levels.rest)
    };
    let definitions = hybrid(definitions, definition_width, n)?;
    let is_there = |level: &u32| *level == leaf.max_definition;
    let n_there = definitions.iter().filter(|level| is_there(level)).count();
    match &mut column.there {
        Some(there) => there.extend(definitions.iter().map(is_there)),
        None if n_there < n && leaf.max_repetition > 0 => return Err("gaps or empty lists".into()),
        None if n_there < n => return Err("gaps".into()),
        None => {}
    }
    if leaf.max_repetition > 0 {
        for level in hybrid(repetitions, repetition_width, n)? {
            if level == 0 {
                column.lengths.push(0);
            }
            *column.lengths.last_mut().ok_or("a column begins within a row")? += 1;
        }
    }
    match page.encoding {
        _ if n_there == 0 => Ok(()),
        0 => column.values.extend_plain(rest, n_there, budget),
        2 | 8 => {
            let dictionary = dictionary.ok_or("a page has no dictionary")?;
            let (&width, indices) = rest.split_first().ok_or("a page ends too early")?;
            column.values.extend_from(dictionary, &hybrid(indices, u32::from(width), n_there)?, budget)
        }
        3 => match &mut column.values {
            Values::Bool(values) => {
                let bits = hybrid(prefixed(&mut Reader { rest })?, 1, n_there)?;
                values.extend(bits.into_iter().map(|bit| bit == 1));
                Ok(())
            }
            _ => Err("numbers are stored as runs".into()),
        },
        other => Err(format!("numbers are stored in Parquet's encoding {other}; plain and dictionary are read")),
    }
}

/// A count or size, which is 0 or above.
fn size(claimed: i64) -> Result<usize, String> {
    usize::try_from(claimed).map_err(|_| format!("a page or column claims a size of {claimed}"))
}

/// How many bits a level up to `most` takes.
fn width(most: u32) -> u32 {
    u32::BITS - most.leading_zeros()
}

/// A run of bytes after its length in four bytes.
fn prefixed<'a>(reader: &mut Reader<'a>) -> Result<&'a [u8], String> {
    let length = reader.take(4)?;
    reader.take(u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize)
}

/// `n` numbers of `width` bits in Parquet's mixture of runs and packed groups of eight.
fn hybrid(bytes: &[u8], width: u32, n: usize) -> Result<Vec<u32>, String> {
    if width > 32 {
        return Err(format!("numbers have {width} bits"));
    }
    let mut reader = Reader { rest: bytes };
    let mut numbers = Vec::with_capacity(n);
    if width == 0 {
        numbers.resize(n, 0);
    }
    while numbers.len() < n {
        let header = reader.varint()?;
        let left = n - numbers.len();
        if header & 1 == 0 {
            let mut word = [0; 4];
            let stored = reader.take(width.div_ceil(8) as usize)?;
            word[..stored.len()].copy_from_slice(stored);
            let run = usize::try_from(header >> 1).map_or(left, |run| run.min(left));
            numbers.resize(numbers.len() + run, u32::from_le_bytes(word));
        } else {
            let packed = usize::try_from(header >> 1).map_or(left, |groups| groups.saturating_mul(8).min(left));
            // The last group may be cut where no number is left.
            let stored = (header >> 1).saturating_mul(u64::from(width)).min(reader.rest.len() as u64);
            let stored = reader.take(stored as usize)?;
            if (stored.len() as u64) * 8 < packed as u64 * u64::from(width) {
                return Err("a page ends too early".into());
            }
            numbers.extend((0..packed as u64).map(|i| bits(stored, i * u64::from(width), width)));
        }
    }
    Ok(numbers)
}

/// The `width` bits of `bytes` from bit `start` on, which must be there.
fn bits(bytes: &[u8], start: u64, width: u32) -> u32 {
    let first = (start / 8) as usize;
    let last = bytes.len().min(first + 5);
    let word = bytes[first..last].iter().rev().fold(0u64, |word, &byte| word << 8 | u64::from(byte));
    (word >> (start % 8) & ((1u64 << width) - 1)) as u32
}

/// `stored` as it was before compression: `size` bytes.
fn decompress(codec: i64, stored: &[u8], size: usize) -> Result<Vec<u8>, String> {
    let damaged = |error: String| format!("a page does not decompress: {error}");
    let bytes = match codec {
        _ if size == 0 => Vec::new(),
        0 => stored.to_vec(),
        1 => {
            let length = snap::raw::decompress_len(stored).map_err(|error| damaged(error.to_string()))?;
            if length != size {
                return Err(damaged(format!("it has {length} bytes instead of {size}")));
            }
            snap::raw::Decoder::new().decompress_vec(stored).map_err(|error| damaged(error.to_string()))?
        }
        2 => {
            let mut bytes = Vec::new();
            let mut decoder = flate2::read::MultiGzDecoder::new(stored).take(size as u64 + 1);
            decoder.read_to_end(&mut bytes).map_err(|error| damaged(error.to_string()))?;
            bytes
        }
        6 => zstd::bulk::decompress(stored, size).map_err(|error| damaged(error.to_string()))?,
        other => {
            return Err(format!("it is compressed with Parquet's codec {other}; none, snappy, gzip and zstd are read"));
        }
    };
    if bytes.len() != size {
        return Err(damaged(format!("it has {} bytes instead of {size}", bytes.len())));
    }
    Ok(bytes)
}
