//! Kernel values between all pairs of points, block by block.
//!
//! Owns how exponents are computed. Points are scaled so that the kernel is `2^(-|x - y|^2 / 2)`,
//! and that exponent is one matrix product: `x.y - |x|^2 / 2 - |y|^2 / 2`, with the norms as two
//! more numbers of each point; again from differences where that formula cancels. Knows nothing of
//! what the values are summed for. Start at [`between`] and [`within`].

use std::{array, ops::Range};

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector};
use pulp::Arch;

use super::Kernel;
use crate::arithmetic::{exp2_nonpositive, product::product};

/// Points a block has on each side: whole tiles of the product on every machine, and one block of
/// kernel values (225 KiB) stays in a core's own cache.
const BLOCK: usize = 240;

/// How many kernel values are added in f32, starting from zero, before their sum is added in f64.
/// The rounding of so few terms is no greater than a kernel value's own.
const GROUP: usize = 16;

/// A squared distance below this share of `|x|^2 + |y|^2` has lost digits to cancellation (about
/// `4e-7 (|x|^2 + |y|^2)` absolute), so it is computed again from the differences.
/// The other distances have a relative error below 1e-4.
const CLOSE: f32 = 0.01;

/// Points, one a column, moved and scaled.
/// Moving a common centre to 0 keeps norms small, and so cancellation.
/// The scale is such that their kernel is `2^(-|x - y|^2 / 2)`.
#[derive(Debug, Clone)]
pub(super) struct Points {
    /// For each point x: x, 1, and `-|x|^2 / 2` `[(dim + 2) x n]`.
    columns: DMatrix<f32>,
    /// For each point x: x, `-|x|^2 / 2`, and 1 `[n x (dim + 2)]`; times [`columns`](Self::columns)
    /// it gives exponents.
    rows: DMatrix<f32>,
    /// The factor that the points were scaled by.
    scale: f64,
}

impl Points {
    /// The points of `points` (`[dim x n]`), moved by `centre` (`[dim]`) and scaled for `kernel`.
    pub(super) fn new(points: &DMatrix<f32>, centre: &DVector<f32>, kernel: Kernel) -> Self {
        assert_eq!(
            points.nrows(),
            centre.len(),
            "points and their target have the same dimension"
        );
        let (dim, n) = points.shape();
        // exp(-k d^2) = 2^(-(s d)^2 / 2).
        let scale = (2.0 * kernel.scale * std::f64::consts::LOG2_E).sqrt();
        let mut columns = DMatrix::from_element(dim + 2, n, 1.0);
        for (mut column, point) in columns.column_iter_mut().zip(points.column_iter()) {
            let mut squared_norm = 0.0;
            for ((to, &x), &centre) in column.iter_mut().zip(point.iter()).zip(centre) {
                *to = ((f64::from(x) - f64::from(centre)) * scale) as f32;
                squared_norm += f64::from(*to) * f64::from(*to);
            }
            column[dim + 1] = (-0.5 * squared_norm) as f32;
        }
        let mut rows = columns.transpose();
        rows.swap_columns(dim, dim + 1);
        Self {
            columns,
            rows,
            scale,
        }
    }

    /// The number of points.
    pub(super) fn len(&self) -> usize {
        self.columns.ncols()
    }

    /// The number of coordinates of a point.
    pub(super) fn dim(&self) -> usize {
        self.columns.nrows() - 2
    }

    /// The factor that the points were scaled by, along each axis.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// The centred and scaled points of a range `[dim x range]`.
    pub(super) fn columns(&self, range: Range<usize>) -> DMatrixView<'_, f32> {
        self.columns
            .view((0, range.start), (self.dim(), range.len()))
    }

    /// The coordinates of point `i`.
    fn point(&self, i: usize) -> &[f32] {
        let (dim, height) = (self.dim(), self.columns.nrows());
        &self.columns.as_slice()[i * height..i * height + dim]
    }

    /// `-|x|^2 / 2` of the points of a range.
    fn norms(&self, range: Range<usize>) -> &[f32] {
        let start = self.dim() * self.len();
        &self.rows.as_slice()[start + range.start..start + range.end]
    }
}

/// The kernel values between some points of one set, one a row, and some of another, one a column.
pub(super) struct Block<'a> {
    /// The points of the rows.
    pub(super) rows: Range<usize>,
    /// The points of the columns.
    pub(super) columns: Range<usize>,
    /// The values `[rows x columns]`.
    pub(super) values: DMatrixView<'a, f32>,
}

impl Block<'_> {
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

    /// Adds to `sums` (one a point of the rows' set) each row's sum over the columns.
    pub(super) fn add_row_sums(&self, sums: &mut [f64]) {
        let sums = &mut sums[self.rows.clone()];
        let mut partial = [0.0; BLOCK];
        let partial = &mut partial[..self.rows.len()];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                let columns = self.values.ncols();
                for first in (0..columns).step_by(GROUP) {
                    partial.fill(0.0);
                    for column in first..columns.min(first + GROUP) {
                        let values = self.values.column(column).data.into_slice();
                        partial
                            .iter_mut()
                            .zip(values)
                            .for_each(|(sum, value)| *sum += value);
                    }
                    sums.iter_mut()
                        .zip(&*partial)
                        .for_each(|(sum, &value)| *sum += f64::from(value));
                }
            },
        );
    }
}

/// Visits the kernel's values between every point of `rows` and every point of `columns`, in a
/// fixed order.
pub(super) fn between(rows: &Points, columns: &Points, mut visit: impl FnMut(Block<'_>)) {
    let mut buffer = vec![0.0; BLOCK * BLOCK];
    for j in blocks(columns.len()) {
        for i in blocks(rows.len()) {
            visit(block(rows, i, columns, j.clone(), &mut buffer));
        }
    }
}

/// Visits the kernel's values between every two points of `points`, in a fixed order.
///
/// A block off the diagonal is visited once and stands for its transpose too. A block on the
/// diagonal is visited whole, with 0 for each point's value with itself: that value is 1, has no
/// gradient, and counts as the estimator decides.
pub(super) fn within(points: &Points, mut visit: impl FnMut(Block<'_>)) {
    let mut buffer = vec![0.0; BLOCK * BLOCK];
    for j in blocks(points.len()) {
        for i in blocks(j.start) {
            visit(block(points, i, points, j.clone(), &mut buffer));
        }
        let size = j.len();
        block(points, j.clone(), points, j.clone(), &mut buffer);
        for own in buffer[..size * size].iter_mut().step_by(size + 1) {
            *own = 0.0;
        }
        let values = DMatrixView::from_slice(&buffer[..size * size], size, size);
        visit(Block {
            rows: j.clone(),
            columns: j,
            values,
        });
    }
}

/// The ranges of at most [`BLOCK`] that cover `0..n`.
fn blocks(n: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n)
        .step_by(BLOCK)
        .map(move |start| start..n.min(start + BLOCK))
}

/// Computes one block of kernel values in `buffer`.
fn block<'a>(
    x: &Points,
    rows: Range<usize>,
    y: &Points,
    columns: Range<usize>,
    buffer: &'a mut [f32],
) -> Block<'a> {
    let (height, width) = (rows.len(), columns.len());
    let buffer = &mut buffer[..height * width];
    product(
        x.rows.rows_range(rows.clone()),
        y.columns.columns_range(columns.clone()),
        0.0,
        DMatrixViewMut::from_slice(buffer, height, width),
    );
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (j, exponents) in columns.clone().zip(buffer.chunks_exact_mut(height)) {
                correct(x, rows.clone(), y, j, exponents);
            }
        },
    );
    exp2_nonpositive(buffer);
    Block {
        rows,
        columns,
        values: DMatrixView::from_slice(buffer, height, width),
    }
}

/// Recomputes the exponents between `rows` of `x` and point `j` of `y` that have lost digits.
#[inline(always)]
fn correct(x: &Points, rows: Range<usize>, y: &Points, j: usize, exponents: &mut [f32]) {
    let (norms, norm) = (x.norms(rows.clone()), y.norms(j..j + 1)[0]);
    let cancels = |exponent: f32, other: f32| exponent > CLOSE * (other + norm);
    if exponents
        .iter()
        .zip(norms)
        .fold(false, |any, (&exponent, &other)| {
            any | cancels(exponent, other)
        })
    {
        for ((i, exponent), &other) in rows.zip(exponents).zip(norms) {
            if cancels(*exponent, other) {
                *exponent = -0.5 * squared_distance(x.point(i), y.point(j));
            }
        }
    }
}

/// `|x - y|^2` from the differences.
pub(super) fn squared_distance(x: &[f32], y: &[f32]) -> f32 {
    x.iter().zip(y).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The sum of one column of a block, always in the same order: every [`GROUP`]th value in f32, at
/// most `BLOCK / GROUP` of them, and those sums in f64.
#[inline(always)]
fn column_sum(values: &[f32]) -> f64 {
    let (groups, rest) = values.as_chunks::<GROUP>();
    let mut lanes = [0.0; GROUP];
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
    let eight: [f64; 8] = array::from_fn(|i| f64::from(lanes[i]) + f64::from(lanes[i + 8]));
    let four: [f64; 4] = array::from_fn(|i| eight[i] + eight[i + 4]);
    (four[0] + four[2]) + (four[1] + four[3])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points that differ little from each other and are far from 0: the worst case for the
    /// expanded square.
    fn cluster(dim: usize, n: usize, spread: f32) -> DMatrix<f32> {
        DMatrix::from_fn(dim, n, |i, j| {
            3.0 + spread * ((7 * i + 13 * j * j) as f32).sin()
        })
    }

    fn kernel_value(x: &[f32], y: &[f32], scale: f64) -> f64 {
        let squared: f64 = x
            .iter()
            .zip(y)
            .map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2))
            .sum();
        (-scale * squared).exp()
    }

    #[test]
    fn values_agree_with_double_loops_across_blocks() {
        let kernel = Kernel { scale: 0.5 };
        // 1 and 257: a whole block, and some more points; 3 points from the origin as the centre of
        // none.
        for (n, spread) in [(1, 1.0), (257, 1.0), (300, 1e-3)] {
            let (a, b) = (cluster(11, n, spread), cluster(11, 270, 0.9 * spread));
            let (x, y) = (
                Points::new(&a, &DVector::zeros(11), kernel),
                Points::new(&b, &DVector::zeros(11), kernel),
            );
            let mut seen = DMatrix::from_element(n, 270, f32::NAN);
            between(&x, &y, |block| {
                let (rows, columns) = (block.rows, block.columns);
                seen.view_mut((rows.start, columns.start), (rows.len(), columns.len()))
                    .copy_from(&block.values);
            });
            for (i, j) in (0..n).flat_map(|i| (0..270).map(move |j| (i, j))) {
                let expected = kernel_value(a.column(i).as_slice(), b.column(j).as_slice(), 0.5);
                // The argument's error: 4e-7 (|x|^2 + |y|^2) / 2 with norms of about 100, far pairs
                // only.
                assert!(
                    (f64::from(seen[(i, j)]) - expected).abs() <= 4e-5 * expected + 1e-7,
                    "{n}: {i}, {j}"
                );
            }
        }
    }

    #[test]
    fn pairs_within_a_set_come_once_and_no_point_meets_itself() {
        let points = Points::new(
            &cluster(3, 600, 1.0),
            &DVector::zeros(3),
            Kernel { scale: 0.5 },
        );
        let mut times = DMatrix::<u8>::zeros(600, 600);
        within(&points, |block| {
            for (i, j) in block
                .rows
                .clone()
                .flat_map(|i| block.columns.clone().map(move |j| (i, j)))
            {
                times[(i, j)] += 1;
                if block.rows != block.columns {
                    times[(j, i)] += 1;
                }
                let value = block.values[(i - block.rows.start, j - block.columns.start)];
                assert_eq!(value == 0.0, i == j, "{i}, {j}");
            }
        });
        assert!(times.iter().all(|&n| n == 1));
    }

    #[test]
    fn a_point_that_is_not_a_number_is_not_hidden() {
        let kernel = Kernel { scale: 0.5 };
        let points = Points::new(
            &DMatrix::from_element(2, 1, f32::NAN),
            &DVector::zeros(2),
            kernel,
        );
        let fine = Points::new(
            &DMatrix::from_element(2, 9, 1.0),
            &DVector::zeros(2),
            kernel,
        );
        let mut sums = vec![0.0; 9];
        between(&points, &fine, |block| block.add_column_sums(&mut sums));
        assert!(sums.iter().all(|sum| sum.is_nan()));
    }
}
