//! Kernel values between all pairs of points, block by block.
//!
//! Owns the order of the blocks. Knows nothing of what the values are summed for. Start at
//! [`between`] and [`within`].

use std::ops::Range;

use nalgebra::DMatrixViewMut;

use super::{
    block::{Block, COLUMNS, ROWS},
    exponents::{First, Points, Side, from_products},
};
use crate::arithmetic::product::product;

/// Visits the kernel's values between every point of `rows` and every point of `columns`, in a
/// fixed order.
pub(super) fn between(rows: &Points, columns: &Points, mut visit: impl FnMut(Block<'_>)) {
    let mut buffer = [0.0; ROWS * COLUMNS];
    for j in blocks(columns.len()) {
        for i in blocks(rows.len()) {
            for columns_of_j in strips(&j) {
                visit(block(rows, &i, columns, &columns_of_j, &mut buffer));
            }
        }
    }
}

/// Visits the kernel's values between every two points of `points`, in a fixed order.
///
/// Where the rows are other points than the columns, a block comes once and stands for its
/// transpose too, as the second argument tells. Where they are not, there is 0 for each point's
/// value with itself: that value is 1, has no gradient, and counts as the estimator decides.
pub(super) fn within(points: &Points, mut visit: impl FnMut(Block<'_>, bool)) {
    let mut buffer = [0.0; ROWS * COLUMNS];
    for j in blocks(points.len()) {
        for i in blocks(j.end) {
            for columns in strips(&j) {
                block(points, &i, points, &columns, &mut buffer);
                if i == j {
                    forget_own(&i, &columns, &mut buffer);
                }
                visit(Block::new(&i, &columns, &buffer), i != j);
            }
        }
    }
}

/// The ranges of at most [`ROWS`] that cover `0..n`.
pub(super) fn blocks(n: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n)
        .step_by(ROWS)
        .map(move |start| start..n.min(start + ROWS))
}

/// The ranges of at most [`COLUMNS`] that cover `range`.
pub(super) fn strips(range: &Range<usize>) -> impl Iterator<Item = Range<usize>> + use<> {
    let end = range.end;
    range
        .clone()
        .step_by(COLUMNS)
        .map(move |start| start..end.min(start + COLUMNS))
}

/// Computes one block of kernel values in `buffer`.
fn block<'a>(
    x: &Points,
    rows: &Range<usize>,
    y: &Points,
    columns: &Range<usize>,
    buffer: &'a mut [f32],
) -> Block<'a> {
    let all = 0..x.dim();
    let values = &mut buffer[..rows.len() * columns.len()];
    product(
        x.rows(all.clone(), rows.clone()),
        y.columns(all, columns.clone()),
        0.0,
        DMatrixViewMut::from_slice(values, rows.len(), columns.len()),
    );
    from_products(Side::of(x, rows), Side::of(y, columns), First::Rows, values);
    Block::new(rows, columns, values)
}

/// The kernel value of a point with itself counts elsewhere: sets it to 0 in a block whose columns
/// are among its rows.
pub(super) fn forget_own(rows: &Range<usize>, columns: &Range<usize>, values: &mut [f32]) {
    for (j, values) in columns.clone().zip(values.chunks_exact_mut(rows.len())) {
        values[j - rows.start] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::demo::Kernel;

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
        within(&points, |block, mirrored| {
            for (i, j) in block
                .rows
                .clone()
                .flat_map(|i| block.columns.clone().map(move |j| (i, j)))
            {
                times[(i, j)] += 1;
                if mirrored {
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
