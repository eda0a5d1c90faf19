//! Damage of each kind, told as that kind.

use std::{collections::BTreeSet, fs};

use super::{
    ParquetError, Table,
    error::{DescriptionError, PageError, ThriftError},
};

/// Files that pyarrow wrote (tests/reference/parquet.py), and their columns.
const FILES: [&str; 3] = [
    "pyarrow_snappy.parquet",
    "pyarrow_v2_zstd.parquet",
    "pyarrow_plain_gzip.parquet",
];

fn file(name: &str) -> Vec<u8> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/");
    fs::read(format!("{folder}{name}")).expect(name)
}

/// The first error of reading all columns of `file`.
fn error(file: Vec<u8>) -> Option<ParquetError> {
    let read = || {
        let table = Table::new(file)?;
        table.lists("observation")?;
        table.numbers("reward")?;
        table.whole_numbers("episode")?;
        table.flags("terminated").map(drop)
    };
    read().err()
}

/// The kind of `error`, and what its message says.
fn kind(error: &ParquetError) -> (&'static str, &'static str) {
    match error {
        ParquetError::Description(description) => match description {
            DescriptionError::NotParquet => ("no Parquet", "it is not a Parquet file"),
            DescriptionError::Thrift(thrift) => kind_of_bytes(thrift),
            DescriptionError::NoColumns => ("no columns", "describes no columns"),
            DescriptionError::Nodes => ("nodes", "other nodes than it claims"),
            DescriptionError::TooDeep => ("columns' depth", "nest too deep"),
            DescriptionError::UnknownType(_) => ("unknown type", "has no known type"),
            DescriptionError::RowGroup { .. } => ("row group", "a row group has"),
            DescriptionError::Rows(_) => ("negative rows", "it claims -"),
        },
        ParquetError::NoColumn { .. } => ("no column", "it has no column `"),
        ParquetError::WrongType { .. } => ("type", "; expected "),
        ParquetError::Ragged { .. } => ("ragged", "all rows need as many"),
        ParquetError::Rows { .. } => ("rows", " rows"),
        ParquetError::Pages { source, .. } => match source {
            PageError::Gaps => ("gaps", "` has gaps"),
            PageError::GapsOrEmptyLists => ("empty lists", "` has gaps or empty lists"),
            PageError::TooMuch => ("too much", "` has more than is read"),
            PageError::Outside => ("outside", "` has its place outside the file"),
            PageError::Size(_) => ("size", "claims a size of -"),
            PageError::MoreThanClaimed(_) => ("claim", "` has more than the "),
            PageError::Levels => ("levels", "` has levels"),
            PageError::NotInDictionary => ("dictionary", "` has a value that is not"),
            PageError::Width(_) => ("width", "` has numbers of "),
            PageError::Encoding(_) => ("encoding", "` has values in Parquet's encoding"),
            PageError::Codec(_) => ("codec", "` has pages in Parquet's codec"),
            PageError::Compression(_) => ("compression", "that does not decompress: "),
            PageError::PageSize { .. } => ("page size", "` has a page of "),
            PageError::Thrift(_) => ("page", "` has a damaged page: "),
        },
    }
}

fn kind_of_bytes(error: &ThriftError) -> (&'static str, &'static str) {
    match error {
        ThriftError::Ended => ("ended", "it ends too early"),
        ThriftError::UnknownKind(_) => ("kind", "no thrift value has the kind "),
        ThriftError::WrongKind { .. } => ("list's kind", "a list holds "),
        ThriftError::LongNumber => ("long number", "longer than 64 bits"),
        ThriftError::LongList(_) => ("long list", "a list claims "),
        ThriftError::TooDeep => ("depth", "nests too deep"),
        ThriftError::NotUtf8 => ("UTF-8", "is not UTF-8"),
    }
}

#[test]
fn damage_is_told_as_what_it_is() {
    let mut seen = BTreeSet::new();
    for name in FILES {
        let whole = file(name);
        assert!(error(whole.clone()).is_none(), "{name}");
        for place in (0..whole.len()).step_by(2) {
            for flipped in [0x01, 0x02, 0x04, 0x10, 0x80, 0xff] {
                let mut bytes = whole.clone();
                bytes[place] ^= flipped;
                let Some(error) = error(bytes) else { continue };
                let (kind, says) = kind(&error);
                let message = error.to_string();
                assert!(message.contains(says), "{kind}: {message}");
                seen.insert(kind);
            }
        }
    }
    for kind in [
        "UTF-8",
        "compression",
        "dictionary",
        "empty lists",
        "ended",
        "kind",
        "no Parquet",
        "no column",
        "outside",
        "page",
        "page size",
        "row group",
        "rows",
        "size",
        "unknown type",
    ] {
        assert!(seen.contains(kind), "{kind}: {seen:?}");
    }
}
