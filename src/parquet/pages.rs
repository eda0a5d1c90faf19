//! A column's pages: decompression, levels, values.

use std::io::{self, Read};

use super::{
    error::{PageError, ThriftError},
    footer::{Chunk, Leaf},
    hybrid::hybrid,
    thrift::{Kind, Reader},
    values::{Budget, Values},
};

/// The largest page, bytes once decompressed; writers make pages of about a megabyte.
const MAX_PAGE: usize = 1 << 28;

/// A column as far as it has been read.
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
    /// Bytes of definition and repetition levels, if the header tells them (version 2).
    definition_bytes: i64,
    repetition_bytes: i64,
    compressed: bool,
}

impl Page {
    fn read(reader: &mut Reader<'_>) -> Result<Self, ThriftError> {
        let mut page = Self {
            compressed: true,
            ..Self::default()
        };
        reader.structure(|reader, id, kind| {
            match (id, kind) {
                (1, Kind::Int) => page.kind = reader.int()?,
                (2, Kind::Int) => page.size = reader.int()?,
                (3, Kind::Int) => page.compressed_size = reader.int()?,
                // The headers of data, dictionary and version 2 data pages; each page has the one
                // of its kind.
                (5 | 7 | 8, Kind::Struct) => reader.structure(|reader, field, kind| {
                    match (id, field, kind) {
                        (_, 1, Kind::Int) => page.values = reader.int()?,
                        (5 | 7, 2, Kind::Int) | (8, 4, Kind::Int) => {
                            page.encoding = reader.int()?
                        }
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
) -> Result<(), PageError> {
    let start = usize::try_from(chunk.offset)
        .ok()
        .filter(|&start| start < file.len());
    let mut reader = Reader {
        rest: &file[start.ok_or(PageError::Outside)?..],
    };
    let claimed = size(chunk.values)?;
    let mut dictionary = None;
    let mut held = 0;
    while held < claimed {
        let page = Page::read(&mut reader)?;
        let stored = reader.take(size(page.compressed_size)?)?;
        let n = size(page.values)?;
        // Before anything is decompressed, since these sizes are only claims.
        if n > budget.numbers || size(page.size)? > budget.bytes.min(MAX_PAGE) {
            return Err(PageError::TooMuch);
        }
        budget.bytes -= size(page.size)?;
        match page.kind {
            0 | 3 => {
                budget.numbers -= n;
                held += n;
                if held > claimed {
                    return Err(PageError::MoreThanClaimed(claimed));
                }
                data_page(
                    leaf,
                    chunk,
                    &page,
                    stored,
                    dictionary.as_ref(),
                    budget,
                    column,
                )?;
            }
            2 => {
                let bytes = decompress(chunk.codec, stored, size(page.size)?)?;
                let mut entries = column.values.none_yet();
                entries.extend_plain(&bytes, n, budget)?;
                dictionary = Some(entries);
            }
            // An index page holds no values.
            _ => {}
        }
    }
    Ok(())
}

/// Appends a data page to the column.
fn data_page(
    leaf: &Leaf,
    chunk: &Chunk,
    page: &Page,
    stored: &[u8],
    dictionary: Option<&Values>,
    budget: &mut Budget,
    column: &mut Column,
) -> Result<(), PageError> {
    let n = size(page.values)?;
    let (definition_width, repetition_width) =
        (width(leaf.max_definition), width(leaf.max_repetition));
    let decompressed;
    // Version 2 keeps the levels outside the compression, version 1 inside it.
    let (repetitions, definitions, rest) = if page.kind == 3 {
        let mut levels = Reader { rest: stored };
        let repetitions = levels.take(size(page.repetition_bytes)?)?;
        let definitions = levels.take(size(page.definition_bytes)?)?;
        let before = repetitions.len() + definitions.len();
        let codec = if page.compressed { chunk.codec } else { 0 };
        let rest = size(page.size)?
            .checked_sub(before)
            .ok_or(PageError::Levels)?;
        decompressed = decompress(codec, levels.rest, rest)?;
        (repetitions, definitions, decompressed.as_slice())
    } else {
        decompressed = decompress(chunk.codec, stored, size(page.size)?)?;
        let mut levels = Reader {
            rest: &decompressed,
        };
        let repetitions = if leaf.max_repetition > 0 {
            levels.prefixed()?
        } else {
            &[]
        };
        let definitions = if leaf.max_definition > 0 {
            levels.prefixed()?
        } else {
            &[]
        };
        (repetitions, definitions, levels.rest)
    };
    let definitions = hybrid(definitions, definition_width, n)?;
    let is_there = |level: &u32| *level == leaf.max_definition;
    let n_there = definitions.iter().filter(|level| is_there(level)).count();
    match &mut column.there {
        Some(there) => there.extend(definitions.iter().map(is_there)),
        None if n_there < n && leaf.max_repetition > 0 => return Err(PageError::GapsOrEmptyLists),
        None if n_there < n => return Err(PageError::Gaps),
        None => {}
    }
    if leaf.max_repetition > 0 {
        for level in hybrid(repetitions, repetition_width, n)? {
            if level == 0 {
                column.lengths.push(0);
            }
            *column.lengths.last_mut().ok_or(PageError::Levels)? += 1;
        }
    }
    match page.encoding {
        _ if n_there == 0 => Ok(()),
        0 => column.values.extend_plain(rest, n_there, budget),
        2 | 8 => {
            let dictionary = dictionary.ok_or(PageError::NotInDictionary)?;
            let (&width, indices) = rest.split_first().ok_or(ThriftError::Ended)?;
            column.values.extend_from(
                dictionary,
                &hybrid(indices, u32::from(width), n_there)?,
                budget,
            )
        }
        3 => match &mut column.values {
            Values::Bool(values) => {
                let bits = hybrid(Reader { rest }.prefixed()?, 1, n_there)?;
                values.extend(bits.into_iter().map(|bit| bit == 1));
                Ok(())
            }
            _ => Err(PageError::Encoding(page.encoding)),
        },
        other => Err(PageError::Encoding(other)),
    }
}

/// A count or size, which is 0 or above.
fn size(claimed: i64) -> Result<usize, PageError> {
    usize::try_from(claimed).map_err(|_| PageError::Size(claimed))
}

/// How many bits a level up to `most` takes.
fn width(most: u32) -> u32 {
    u32::BITS - most.leading_zeros()
}

/// `stored` without compression: `size` bytes.
fn decompress(codec: i64, stored: &[u8], size: usize) -> Result<Vec<u8>, PageError> {
    let bytes = match codec {
        _ if size == 0 => Vec::new(),
        0 => stored.to_vec(),
        1 => unsnapped(stored, size)?,
        2 => {
            let mut bytes = Vec::new();
            flate2::read::MultiGzDecoder::new(stored)
                .take(size as u64 + 1)
                .read_to_end(&mut bytes)
                .map_err(PageError::Compression)?;
            bytes
        }
        6 => zstd::bulk::decompress(stored, size).map_err(PageError::Compression)?,
        other => return Err(PageError::Codec(other)),
    };
    of_size(bytes.len(), size)?;
    Ok(bytes)
}

/// As [`decompress`] for snappy, which reserves what `stored` claims.
fn unsnapped(stored: &[u8], size: usize) -> Result<Vec<u8>, PageError> {
    let damaged = |error: snap::Error| PageError::Compression(io::Error::from(error));
    of_size(snap::raw::decompress_len(stored).map_err(damaged)?, size)?;
    snap::raw::Decoder::new()
        .decompress_vec(stored)
        .map_err(damaged)
}

/// Checks that a page has the size that it claims.
fn of_size(found: usize, expected: usize) -> Result<(), PageError> {
    if found == expected {
        Ok(())
    } else {
        Err(PageError::PageSize { found, expected })
    }
}
