//! A column of single values, some of which may be absent.

use std::sync::Arc;

use super::values::Values;

/// One entry a row; `None` where the file has a null.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cells {
    Truths(Vec<Option<bool>>),
    Signed(Vec<Option<i64>>),
    Unsigned(Vec<Option<u64>>),
    Numbers(Vec<Option<f64>>),
    Texts(Vec<Option<Arc<str>>>),
}

/// One entry of [`Cells`].
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cell {
    Null,
    Truth(bool),
    Signed(i64),
    Unsigned(u64),
    Number(f64),
    Text(Arc<str>),
}

impl Cells {
    /// `values` at the rows that are `there`; both must be equally many.
    pub(super) fn new(values: Values, unsigned: bool, there: &[bool]) -> Self {
        fn spread<T, U>(
            values: Vec<T>,
            there: &[bool],
            as_cell: impl Fn(T) -> U,
        ) -> Vec<Option<U>> {
            let mut values = values.into_iter().map(as_cell);
            there
                .iter()
                .map(|&there| if there { values.next() } else { None })
                .collect()
        }
        match values {
            Values::Bool(values) => Self::Truths(spread(values, there, |value| value)),
            Values::I32(values) if unsigned => {
                Self::Unsigned(spread(values, there, |value| u64::from(value as u32)))
            }
            Values::I32(values) => Self::Signed(spread(values, there, i64::from)),
            Values::I64(values) if unsigned => {
                Self::Unsigned(spread(values, there, |value| value as u64))
            }
            Values::I64(values) => Self::Signed(spread(values, there, |value| value)),
            Values::F32(values) => Self::Numbers(spread(values, there, f64::from)),
            Values::F64(values) => Self::Numbers(spread(values, there, |value| value)),
            Values::Text(values) => Self::Texts(spread(values, there, |value| value)),
        }
    }

    /// The cells' type, in the words of a message.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Truths(_) => "truth values",
            Self::Signed(_) => "whole numbers with a sign",
            Self::Unsigned(_) => "whole numbers",
            Self::Numbers(_) => "numbers",
            Self::Texts(_) => "text",
        }
    }

    /// The cell of `row`; [`Cell::Null`] beyond the last row too.
    pub(crate) fn get(&self, row: usize) -> Cell {
        fn of<T: Clone>(cells: &[Option<T>], row: usize, as_cell: fn(T) -> Cell) -> Cell {
            cells
                .get(row)
                .cloned()
                .flatten()
                .map_or(Cell::Null, as_cell)
        }
        match self {
            Self::Truths(cells) => of(cells, row, Cell::Truth),
            Self::Signed(cells) => of(cells, row, Cell::Signed),
            Self::Unsigned(cells) => of(cells, row, Cell::Unsigned),
            Self::Numbers(cells) => of(cells, row, Cell::Number),
            Self::Texts(cells) => of(cells, row, Cell::Text),
        }
    }

    /// The cells as f64; `None` for truth values and text.
    pub(crate) fn numbers(self) -> Option<Vec<Option<f64>>> {
        match self {
            Self::Numbers(cells) => Some(cells),
            Self::Signed(cells) => Some(
                cells
                    .into_iter()
                    .map(|cell| cell.map(|number| number as f64))
                    .collect(),
            ),
            Self::Unsigned(cells) => Some(
                cells
                    .into_iter()
                    .map(|cell| cell.map(|number| number as f64))
                    .collect(),
            ),
            Self::Truths(_) | Self::Texts(_) => None,
        }
    }
}
