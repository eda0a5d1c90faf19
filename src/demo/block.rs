//! A block of kernel values, and its sums.
//!
//! Owns the order in which kernel values are added: of the same values always the same bits. Knows
//! nothing of how they are computed. Start at [`Block`].

use std::{array, ops::Range};

use nalgebra::{DMatrix, DMatrixView};
use pulp::Arch;

use crate::arithmetic::product::product;

/// Points that a block has along its rows: whole tiles of the product on every machine. A sum over
/// them in f32 adds 15 numbers to each of its lanes.
pub(super) const ROWS: usize = 240;

/// Points that a block has along its columns. So few keep its values (15 KiB) in a core's nearest
/// cache.
///
/// It is also how many kernel values are added in f32, starting from zero, before their sum is
/// added in f64. The rounding of so few terms is no greater than a kernel value's own.
pub(super) const COLUMNS: usize = 16;

/// The kernel values between some points of one set, one a row, and some of another, one a column.
pub(super) struct Block<'a> {
    /// The points of the rows, at most [`ROWS`].
    pub(super) rows: Range<usize>,
    /// The points of the columns, at most [`COLUMNS`].
    pub(super) columns: Range<usize>,
    /// The values `[rows x columns]`.
    pub(super) values: DMatrixView<'a, f32>,
}

impl<'a> Block<'a> {
    /// The block with `values`, column after column.
    pub(super) fn new(rows: &Range<usize>, columns: &Range<usize>, values: &'a [f32]) -> Self {
        Self {
            rows: rows.clone(),
            columns: columns.clone(),
            values: DMatrixView::from_slice(values, rows.len(), columns.len()),
        }
    }

    /// Adds to `sums` (one a point of the columns' set) each column's sum over the rows.
    pub(super) fn add_column_sums(&self, sums: &mut [f64]) {
        let sums = &mut sums[self.columns.clone()];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                sums.iter_mut()
                    .zip(self.values.column_iter())
                    .for_each(|(sum, k)| *sum += column_sum(k.as_slice()))
            },
        );
    }

    /// Adds to `sums` (one a column for each point of the columns' set) the numbers of the rows'
    /// points, `of_rows` (one a column), weighted by the values.
    pub(super) fn add_weighted(&self, of_rows: DMatrixView<'_, f32>, sums: &mut DMatrix<f32>) {
        let sums = sums.columns_range_mut(self.columns.clone());
        product(of_rows, self.values, 1.0, sums);
    }

    /// Adds to `sums` (one a point of the rows' set) each row's sum over the columns.
    pub(super) fn add_row_sums(&self, sums: &mut [f64]) {
        let sums = &mut sums[self.rows.clone()];
        let mut partial = [0.0; ROWS];
        let partial = &mut partial[..self.rows.len()];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for column in self.values.column_iter() {
                    partial
                        .iter_mut()
                        .zip(column.data.into_slice())
                        .for_each(|(sum, value)| *sum += value);
                }
                sums.iter_mut()
                    .zip(&*partial)
                    .for_each(|(sum, &value)| *sum += f64::from(value));
            },
        );
    }
}

/// Partial sums of the values in f32 that are added up together: every sixteenth value.
const LANES: usize = 16;

/// The sum of one column of a block, always in the same order: each lane in f32, of at most
/// `ROWS / LANES` values, and the lanes in f64.
#[inline(always)]
fn column_sum(values: &[f32]) -> f64 {
    let (groups, rest) = values.as_chunks::<LANES>();
    let mut lanes = [0.0; LANES];
    for group in groups {
        lanes
            .iter_mut()
            .zip(group)
            .for_each(|(lane, value)| *lane += value);
    }
    lanes
        .iter_mut()
        .zip(rest)
        .for_each(|(lane, value)| *lane += value);
    total(|i| lanes[i])
}

/// The sum of the lanes of one sum.
#[inline(always)]
fn total(lane: impl Fn(usize) -> f32) -> f64 {
    let eight: [f64; 8] = array::from_fn(|i| f64::from(lane(i)) + f64::from(lane(i + 8)));
    let four: [f64; 4] = array::from_fn(|i| eight[i] + eight[i + 4]);
    (four[0] + four[2]) + (four[1] + four[3])
}

/// The sums of rows over a whole block of columns, strip after strip, with the bits that
/// [`Block::add_column_sums`] gives for the transpose.
pub(super) struct RowSums {
    /// One lane a column `[ROWS x LANES]`.
    lanes: Vec<f32>,
}

impl RowSums {
    pub(super) fn new() -> Self {
        Self {
            lanes: vec![0.0; ROWS * LANES],
        }
    }

    /// Adds the values of the next strip.
    pub(super) fn add(&mut self, block: &Block<'_>) {
        Arch::new().dispatch(
            #[inline(always)]
            || {
                let lanes = self.lanes.chunks_exact_mut(ROWS);
                for (lane, column) in lanes.zip(block.values.column_iter()) {
                    lane.iter_mut()
                        .zip(column.data.into_slice())
                        .for_each(|(sum, value)| *sum += value);
                }
            },
        );
    }

    /// Adds to `sums` the sum of each of their rows, and starts anew.
    pub(super) fn take(&mut self, sums: &mut [f64]) {
        let rows = sums.len();
        let lanes: [&[f32]; LANES] = array::from_fn(|i| &self.lanes[i * ROWS..][..rows]);
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (row, sum) in sums.iter_mut().enumerate() {
                    *sum += total(|i| lanes[i][row]);
                }
            },
        );
        self.lanes.fill(0.0);
    }
}
