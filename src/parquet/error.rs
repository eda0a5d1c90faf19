//! The ways in which a file is no table, or not the one that was expected.
//!
//! From the outside in: [`ParquetError`] is about a file and its columns, [`DescriptionError`] about
//! what it says of itself at its end, [`PageError`] about the bytes of one column, and
//! [`ThriftError`] about the protocol below both.

use std::{fmt, io};

use super::thrift::Kind;

/// Errors of reading a Parquet file; the message names the column, where it is of one.
#[derive(Debug, thiserror::Error)]
pub enum ParquetError {
    /// It is no Parquet, or describes itself in a way that cannot be.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A column is missing.
    #[error("it has no column `{column}`; it has {}", present.join(", "))]
    NoColumn {
        /// The column's name.
        column: String,
        /// The columns that there are.
        present: Vec<String>,
    },
    /// A column is of another type.
    #[error("its column `{column}` holds {found}; expected {expected}")]
    WrongType {
        /// The column's name.
        column: String,
        /// Its entries.
        found: Entries,
        /// The entries that it should have.
        expected: &'static str,
    },
    /// Lists that should be equally long are not.
    #[error(
        "its column `{column}` has {found} numbers in row {row} and {expected} before; all rows need as many"
    )]
    Ragged {
        /// The column's name.
        column: String,
        /// The first row of another length.
        row: usize,
        /// Its length.
        found: usize,
        /// The length of the rows before.
        expected: usize,
    },
    /// A column has not as many rows as the file.
    #[error("its column `{column}` has {found} of {expected} rows")]
    Rows {
        /// The column's name.
        column: String,
        /// The number of its rows.
        found: usize,
        /// The number that the file claims.
        expected: usize,
    },
    /// A column's pages cannot be read.
    #[error("its column `{column}` has {source}")]
    Pages {
        /// The column's name.
        column: String,
        /// The fault in its pages.
        source: PageError,
    },
}

impl ParquetError {
    /// The error about `column`, which holds `found`.
    pub(crate) fn wrong_type(column: &str, found: Entries, expected: &'static str) -> Self {
        Self::WrongType {
            column: column.to_owned(),
            found,
            expected,
        }
    }
}

/// The entries of a column, in the words of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entries {
    /// One entry in a row.
    Single(&'static str),
    /// A list of entries in a row.
    Lists(&'static str),
}

impl fmt::Display for Entries {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Single(entry) => f.write_str(entry),
            Self::Lists(entry) => write!(f, "a list of {entry}"),
        }
    }
}

/// Errors of a file's description of itself.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// It does not begin and end as Parquet does.
    #[error("it is not a Parquet file")]
    NotParquet,
    /// The description cannot be decoded.
    #[error(transparent)]
    Thrift(#[from] ThriftError),
    /// There is no schema.
    #[error("it describes no columns")]
    NoColumns,
    /// The schema's tree has not as many nodes as its groups claim.
    #[error("its schema has other nodes than it claims")]
    Nodes,
    /// The schema has groups within groups without end.
    #[error("its columns nest too deep")]
    TooDeep,
    /// A column is of a type that Parquet does not have.
    #[error("its column `{0}` has no known type")]
    UnknownType(String),
    /// A row group does not have the schema's columns.
    #[error("a row group has {found} columns instead of {expected}")]
    RowGroup {
        /// The number of its columns.
        found: usize,
        /// The number of the schema's.
        expected: usize,
    },
    /// The number of rows is none.
    #[error("it claims {0} rows")]
    Rows(i64),
}

/// Errors of a column's pages; each message is what the column has.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// Rows without a value.
    #[error("gaps")]
    Gaps,
    /// Lists without a value, or of none.
    #[error("gaps or empty lists")]
    GapsOrEmptyLists,
    /// More values, bytes or text than are read of one column.
    #[error("more than is read")]
    TooMuch,
    /// Its first page lies beyond the end.
    #[error("its place outside the file")]
    Outside,
    /// A count or size is below 0.
    #[error("a page or part that claims a size of {0}")]
    Size(i64),
    /// Its pages hold more values than a row group claims.
    #[error("more than the {0} values that it claims")]
    MoreThanClaimed(usize),
    /// Levels, which tell gaps and lists, contradict the page.
    #[error("levels that do not fit their page")]
    Levels,
    /// A value's place is in no dictionary.
    #[error("a value that is not in its dictionary")]
    NotInDictionary,
    /// Small numbers are packed into more bits than they can have.
    #[error("numbers of {0} bits")]
    Width(u32),
    /// The values are encoded in a way that is not read.
    #[error("values in Parquet's encoding {0}; plain and dictionary are read")]
    Encoding(i64),
    /// The pages are compressed in a way that is not read.
    #[error("pages in Parquet's codec {0}; none, snappy, gzip and zstd are read")]
    Codec(i64),
    /// A page is damaged below its compression.
    #[error("a page that does not decompress: {0}")]
    Compression(#[source] io::Error),
    /// A page is not as large as it claims.
    #[error("a page of {found} bytes instead of {expected}")]
    PageSize {
        /// Its size, bytes.
        found: usize,
        /// The size that it claims, bytes.
        expected: usize,
    },
    /// A page's header, levels or text cannot be decoded.
    #[error("a damaged page: {0}")]
    Thrift(#[from] ThriftError),
}

/// Errors of bytes that should be Thrift's compact protocol.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ThriftError {
    /// The bytes are used up.
    #[error("it ends too early")]
    Ended,
    /// A value's kind is none of the protocol's.
    #[error("no thrift value has the kind {0}")]
    UnknownKind(u8),
    /// A list holds other values than Parquet puts there.
    #[error("a list holds {found:?} instead of {expected:?}")]
    WrongKind {
        /// The kind of its elements.
        found: Kind,
        /// The kind of Parquet's.
        expected: Kind,
    },
    /// A number does not fit into 64 bits.
    #[error("a number is longer than 64 bits")]
    LongNumber,
    /// A list is longer than any that is read.
    #[error("a list claims {0} elements")]
    LongList(u64),
    /// Values lie within values without end.
    #[error("its description nests too deep")]
    TooDeep,
    /// A string is not text.
    #[error("a string is not UTF-8")]
    NotUtf8,
}
