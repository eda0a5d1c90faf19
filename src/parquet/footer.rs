//! A Parquet file's description of itself: columns, row groups, notes.

use super::{
    error::{DescriptionError, ThriftError},
    thrift::{Kind, Reader},
};

/// The largest description that is read, bytes.
const MAX_FOOTER: usize = 1 << 24;

/// How numbers are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Physical {
    Bool,
    I32,
    I64,
    F32,
    F64,
    Bytes,
}

/// One leaf of the schema.
#[derive(Debug, Clone)]
pub(super) struct Leaf {
    /// The name of its column.
    pub(super) column: String,
    /// The type of its values; absent if it is none of these.
    pub(super) physical: Option<Physical>,
    /// Whether its whole numbers are unsigned.
    pub(super) unsigned: bool,
    /// The definition level of a value that is present.
    pub(super) max_definition: u32,
    /// The number of lists around a value.
    pub(super) max_repetition: u32,
    /// Whether it is its column's only leaf, and the groups above it are only those of lists.
    pub(super) plain: bool,
}

/// A row group's part of a leaf.
#[derive(Debug, Clone, Default)]
pub(super) struct Chunk {
    pub(super) codec: i64,
    pub(super) values: i64,
    /// The offset of its first page.
    pub(super) offset: i64,
}

/// A row group: the [`Chunk`] of each leaf, in order.
pub(super) struct RowGroup {
    pub(super) chunks: Vec<Chunk>,
}

/// The whole description.
pub(super) struct Footer {
    pub(super) leaves: Vec<Leaf>,
    pub(super) groups: Vec<RowGroup>,
    pub(super) rows: usize,
    pub(super) notes: Vec<(String, String)>,
}

/// A node of the schema, as the file has it.
#[derive(Default)]
struct Node {
    physical: Option<i64>,
    repetition: i64,
    converted: i64,
    name: String,
    children: i64,
}

impl Footer {
    /// The description at the end of `file`.
    pub(super) fn read(file: &[u8]) -> Result<Self, DescriptionError> {
        let no_parquet = || DescriptionError::NotParquet;
        let described = file.strip_suffix(b"PAR1").ok_or_else(no_parquet)?;
        let (described, length) = described.split_last_chunk::<4>().ok_or_else(no_parquet)?;
        let length = u32::from_le_bytes(*length) as usize;
        if !file.starts_with(b"PAR1") || length > described.len() || length > MAX_FOOTER {
            return Err(no_parquet());
        }
        let mut reader = Reader {
            rest: &described[described.len() - length..],
        };
        let (mut nodes, mut groups, mut notes, mut rows) = (vec![], vec![], vec![], 0);
        reader.structure(|reader, id, kind| {
            match (id, kind) {
                (2, Kind::List) => nodes = reader.list(Kind::Struct, node)?,
                (3, Kind::Int) => rows = reader.int()?,
                (4, Kind::List) => groups = reader.list(Kind::Struct, row_group)?,
                (5, Kind::List) => notes = reader.list(Kind::Struct, note)?,
                _ => reader.skip(kind)?,
            }
            Ok(())
        })?;
        let leaves = leaves(&nodes)?;
        if let Some(group) = groups
            .iter()
            .find(|group| group.chunks.len() != leaves.len())
        {
            return Err(DescriptionError::RowGroup {
                found: group.chunks.len(),
                expected: leaves.len(),
            });
        }
        let rows = usize::try_from(rows).map_err(|_| DescriptionError::Rows(rows))?;
        Ok(Self {
            leaves,
            groups,
            rows,
            notes,
        })
    }
}

fn node(reader: &mut Reader<'_>) -> Result<Node, ThriftError> {
    let mut node = Node::default();
    reader.structure(|reader, id, kind| {
        match (id, kind) {
            (1, Kind::Int) => node.physical = Some(reader.int()?),
            (3, Kind::Int) => node.repetition = reader.int()?,
            (4, Kind::Binary) => node.name = reader.string()?,
            (5, Kind::Int) => node.children = reader.int()?,
            (6, Kind::Int) => node.converted = reader.int()?,
            _ => reader.skip(kind)?,
        }
        Ok(())
    })?;
    Ok(node)
}

fn row_group(reader: &mut Reader<'_>) -> Result<RowGroup, ThriftError> {
    let mut chunks = Vec::new();
    reader.structure(|reader, id, kind| match (id, kind) {
        (1, Kind::List) => {
            chunks = reader.list(Kind::Struct, chunk)?;
            Ok(())
        }
        _ => reader.skip(kind),
    })?;
    Ok(RowGroup { chunks })
}

fn chunk(reader: &mut Reader<'_>) -> Result<Chunk, ThriftError> {
    let mut chunk = Chunk {
        codec: -1,
        values: -1,
        offset: -1,
    };
    let mut dictionary = None;
    reader.structure(|reader, id, kind| match (id, kind) {
        (3, Kind::Struct) => reader.structure(|reader, id, kind| {
            match (id, kind) {
                (4, Kind::Int) => chunk.codec = reader.int()?,
                (5, Kind::Int) => chunk.values = reader.int()?,
                (9, Kind::Int) => chunk.offset = reader.int()?,
                (11, Kind::Int) => dictionary = Some(reader.int()?),
                _ => reader.skip(kind)?,
            }
            Ok(())
        }),
        _ => reader.skip(kind),
    })?;
    // Some writers give a dictionary the offset 0 if there is none.
    chunk.offset = dictionary
        .filter(|&offset| offset > 0)
        .map_or(chunk.offset, |offset| offset.min(chunk.offset));
    Ok(chunk)
}

fn note(reader: &mut Reader<'_>) -> Result<(String, String), ThriftError> {
    let (mut key, mut value) = Default::default();
    reader.structure(|reader, id, kind| {
        match (id, kind) {
            (1, Kind::Binary) => key = reader.string()?,
            (2, Kind::Binary) => value = reader.string()?,
            _ => reader.skip(kind)?,
        }
        Ok(())
    })?;
    Ok((key, value))
}

/// The leaves of a tree whose `nodes` list parents before children.
fn leaves(nodes: &[Node]) -> Result<Vec<Leaf>, DescriptionError> {
    const REQUIRED: i64 = 0;
    const REPEATED: i64 = 2;
    const UNSIGNED: std::ops::RangeInclusive<i64> = 11..=14; // of 8 to 64 bits
    let (root, nodes) = nodes.split_first().ok_or(DescriptionError::NoColumns)?;
    // One entry for each open group: the children to come, and the levels and column of its
    // content.
    let mut open = vec![(root.children, 0, 0, None::<String>, true)];
    let mut leaves: Vec<Leaf> = Vec::new();
    for node in nodes {
        while open.last().is_some_and(|group| group.0 == 0) {
            open.pop();
        }
        let (left, definition, repetition, column, plain) =
            open.last_mut().ok_or(DescriptionError::Nodes)?;
        *left -= 1;
        let max_definition = *definition + u32::from(node.repetition != REQUIRED);
        let max_repetition = *repetition + u32::from(node.repetition == REPEATED);
        let column = column.clone().unwrap_or_else(|| node.name.clone());
        let plain = *plain;
        if node.children > 0 {
            if open.len() > 8 {
                return Err(DescriptionError::TooDeep);
            }
            open.push((
                node.children,
                max_definition,
                max_repetition,
                Some(column),
                plain && node.children == 1,
            ));
            continue;
        }
        let physical = match node.physical {
            Some(0) => Some(Physical::Bool),
            Some(1) => Some(Physical::I32),
            Some(2) => Some(Physical::I64),
            Some(4) => Some(Physical::F32),
            Some(5) => Some(Physical::F64),
            Some(6) => Some(Physical::Bytes),
            Some(3 | 7) => None,
            _ => return Err(DescriptionError::UnknownType(column)),
        };
        let plain = plain && (max_repetition == 1 || open.len() == 1);
        let unsigned = UNSIGNED.contains(&node.converted);
        leaves.push(Leaf {
            column,
            physical,
            unsigned,
            max_definition,
            max_repetition,
            plain,
        });
    }
    if open.iter().any(|group| group.0 != 0) {
        return Err(DescriptionError::Nodes);
    }
    Ok(leaves)
}
