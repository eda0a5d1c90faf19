//! Kernel values between all pairs of points, block by block.
//!
//! Owns how squared distances are computed: `|x|^2 + |y|^2 - 2 x.y` with the cross products of a block in one matrix
//! product, and again from differences where that formula cancels. Knows nothing of what the values are summed for.
//! Start at [`between`] and [`within`].

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector};
use pulp::Arch;

use super::Kernel;
use crate::arithmetic::{exp, product::product_tn};

/// Points a block has on each side; one block of kernel values (256 KiB) stays in a core's own cache.
const BLOCK: usize = 256;

/// A squared distance below this share of `|x|^2 + |y|^2` has lost digits to cancellation (about `4e-7 (|x|^2 + |y|^2)`
/// absolute), so it is computed again from the differences. What is left has a relative error below 1e-4.
const CLOSE: f32 = 0.01;

/// Points, one a column, moved so that a common centre is at 0, which keeps norms and so cancellation small.
#[derive(Debug, Clone)]
pub(super) struct Points {
    columns: DMatrix<f32>,
    squared_norms: Vec<f32>,
}

impl Points {
    /// `points` (`[dim x n]`) less `centre` (`[dim]`).
    pub(super) fn centred(points: &DMatrix<f32>, centre: &DVector<f32>) -> Self {
        assert_eq!(points.nrows(), centre.len(), "points and their target have the same dimension");
        let mut columns = points.clone();
        for mut column in columns.column_iter_mut() {
            column -= centre;
        }
        let squared_norms = columns
            .column_iter()
            .map(|x| x.iter().map(|&value| f64::from(value) * f64::from(value)).sum::<f64>() as f32)
            .collect();
        Self { columns, squared_norms }
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.squared_norms.len()
    }

    /// The centred points `[dim x n]`.
    pub(super) fn columns(&self) -> &DMatrix<f32> {
        &self.columns
    }

    /// Point `i`, as numbers.
    fn point(&self, i: usize) -> &[f32] {
        let dim = self.columns.nrows();
        &self.columns.as_slice()[i * dim..(i + 1) * dim]
    }
}

/// The kernel's values between some points of one set, one a row, and some of another, one a column.
pub(super) struct Block<'a> {
    /// Which points the rows are.
    pub(super) rows: Range<usize>,
    /// Which points the columns are.
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
            || sums.iter_mut().zip(self.values.column_iter()).for_each(|(sum, k)| *sum += lane_sum(k.as_slice())),
        );
    }

    /// Adds to `sums` (one a point of the rows' set) each row's sum over the columns.
    pub(super) fn add_row_sums(&self, sums: &mut [f64]) {
        let sums = &mut sums[self.rows.clone()];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for column in self.values.column_iter() {
                    sums.iter_mut().zip(column.as_slice()).for_each(|(sum, &value)| *sum += f64::from(value));
                }
            },
        );
    }
}

/// Visits the kernel's values between every point of `rows` and every point of `columns`, in a fixed order.
pub(super) fn between(kernel: Kernel, rows: &Points, columns: &Points, mut visit: impl FnMut(Block<'_>)) {
    let mut buffer = vec![0.0; BLOCK * BLOCK];
    for j in blocks(columns.len()) {
        for i in blocks(rows.len()) {
            visit(block(kernel, rows, i, columns, j.clone(), &mut buffer));
        }
    }
}

/// Visits the kernel's values between every two points of `points`, in a fixed order.
///
/// A block off the diagonal comes once and stands for its transpose too. A block on the diagonal comes whole, with 0 for
/// each point's value with itself: that value is 1 and has no gradient, and what it counts for is the estimator's affair.
pub(super) fn within(kernel: Kernel, points: &Points, mut visit: impl FnMut(Block<'_>)) {
    let mut buffer = vec![0.0; BLOCK * BLOCK];
    for j in blocks(points.len()) {
        for i in blocks(j.start) {
            visit(block(kernel, points, i, points, j.clone(), &mut buffer));
        }
        let size = j.len();
        block(kernel, points, j.clone(), points, j.clone(), &mut buffer);
        for own in buffer[..size * size].iter_mut().step_by(size + 1) {
            *own = 0.0;
        }
        let values = DMatrixView::from_slice(&buffer[..size * size], size, size);
        visit(Block { rows: j.clone(), columns: j, values });
    }
}

/// The ranges of at most [`BLOCK`] that cover `0..n`.
fn blocks(n: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n).step_by(BLOCK).map(move |start| start..n.min(start + BLOCK))
}

/// One block of kernel values, in `buffer`.
fn block<'a>(
    kernel: Kernel,
    x: &Points,
    rows: Range<usize>,
    y: &Points,
    columns: Range<usize>,
    buffer: &'a mut [f32],
) -> Block<'a> {
    let (height, width) = (rows.len(), columns.len());
    let buffer = &mut buffer[..height * width];
    product_tn(
        x.columns.columns_range(rows.clone()),
        y.columns.columns_range(columns.clone()),
        0.0,
        DMatrixViewMut::from_slice(buffer, height, width),
    );
    let scale = kernel.scale as f32;
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (j, values) in columns.clone().zip(buffer.chunks_exact_mut(height)) {
                exponents(scale, x, rows.clone(), y, j, values);
            }
        },
    );
    exp(buffer);
    Block { rows, columns, values: DMatrixView::from_slice(buffer, height, width) }
}

/// Turns the cross products of some points of `x` with point `j` of `y` into exponents `-scale |x - y|^2`.
#[inline(always)]
fn exponents(scale: f32, x: &Points, rows: Range<usize>, y: &Points, j: usize, values: &mut [f32]) {
    let norm = y.squared_norms[j];
    let norms = &x.squared_norms[rows.clone()];
    let mut cancels = false;
    for (value, &other) in values.iter_mut().zip(norms) {
        let squared = other + norm - 2.0 * *value;
        cancels |= squared < CLOSE * (other + norm);
        *value = -scale * squared;
    }
    if cancels {
        for (i, (value, &other)) in rows.zip(values.iter_mut().zip(norms)) {
            if *value > -scale * CLOSE * (other + norm) {
                *value = -scale * squared_distance(x.point(i), y.point(j));
            }
        }
    }
}

/// `|x - y|^2` from the differences.
pub(super) fn squared_distance(x: &[f32], y: &[f32]) -> f32 {
    x.iter().zip(y).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The sum, by eight running sums so that the additions do not wait for each other; always in the same order.
#[inline(always)]
fn lane_sum(values: &[f32]) -> f64 {
    let (chunks, rest) = values.as_chunks::<8>();
    let mut lanes = [0.0; 8];
    for chunk in chunks {
        for (lane, &value) in lanes.iter_mut().zip(chunk) {
            *lane += f64::from(value);
        }
    }
    lanes.iter().sum::<f64>() + rest.iter().map(|&value| f64::from(value)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points that differ little from each other and are far from 0: the worst case for the expanded square.
    fn cluster(dim: usize, n: usize, spread: f32) -> DMatrix<f32> {
        DMatrix::from_fn(dim, n, |i, j| 3.0 + spread * ((7 * i + 13 * j * j) as f32).sin())
    }

    fn kernel_value(x: &[f32], y: &[f32], scale: f64) -> f64 {
        let squared: f64 = x.iter().zip(y).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum();
        (-scale * squared).exp()
    }

    #[test]
    fn values_agree_with_double_loops_across_blocks() {
        let kernel = Kernel { scale: 0.5 };
        // 1 and 257: a whole block, and one more point; 3 points from the origin as the centre of none.
        for (n, spread) in [(1, 1.0), (257, 1.0), (300, 1e-3)] {
            let (a, b) = (cluster(11, n, spread), cluster(11, 270, 0.9 * spread));
            let (x, y) = (Points::centred(&a, &DVector::zeros(11)), Points::centred(&b, &DVector::zeros(11)));
            let mut seen = DMatrix::from_element(n, 270, f32::NAN);
            between(kernel, &x, &y, |block| {
                let (rows, columns) = (block.rows, block.columns);
                seen.view_mut((rows.start, columns.start), (rows.len(), columns.len())).copy_from(&block.values);
            });
            for (i, j) in (0..n).flat_map(|i| (0..270).map(move |j| (i, j))) {
                let expected = kernel_value(a.column(i).as_slice(), b.column(j).as_slice(), 0.5);
                // The argument's error: 4e-7 (|x|^2 + |y|^2) / 2 with norms of about 100, far pairs only.
                assert!((f64::from(seen[(i, j)]) - expected).abs() <= 4e-5 * expected + 1e-7, "{n}: {i}, {j}");
            }
        }
    }

    #[test]
    fn pairs_within_a_set_come_once_and_no_point_meets_itself() {
        let points = Points::centred(&cluster(3, 600, 1.0), &DVector::zeros(3));
        let mut times = DMatrix::<u8>::zeros(600, 600);
        within(Kernel { scale: 0.5 }, &points, |block| {
            for (i, j) in block.rows.clone().flat_map(|i| block.columns.clone().map(move |j| (i, j))) {
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
        let points = Points::centred(&DMatrix::from_element(2, 1, f32::NAN), &DVector::zeros(2));
        let fine = Points::centred(&DMatrix::from_element(2, 9, 1.0), &DVector::zeros(2));
        let mut sums = vec![0.0; 9];
        between(Kernel { scale: 0.5 }, &points, &fine, |block| block.add_column_sums(&mut sums));
        assert!(sums.iter().all(|sum| sum.is_nan()));
    }
}
