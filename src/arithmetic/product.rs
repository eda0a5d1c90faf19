//! Products of f32 matrices.
//!
//! Every element is summed in the same order however many columns pass together, so the columns of `a b` have the same
//! bits alone and in a batch. nalgebra has no such property, and its transposed products run at a tenth of this rate.

use nalgebra::{DMatrixView, DMatrixViewMut};

/// `c = a b + beta c`. Shapes `[m x k] [k x n] [m x n]`.
pub fn product(a: DMatrixView<'_, f32>, b: DMatrixView<'_, f32>, beta: f32, c: DMatrixViewMut<'_, f32>) {
    strided(Strided::of(a), Strided::of(b), beta, c);
}

/// `c = a^T b + beta c`. Shapes `[k x m] [k x n] [m x n]`.
pub fn product_tn(a: DMatrixView<'_, f32>, b: DMatrixView<'_, f32>, beta: f32, c: DMatrixViewMut<'_, f32>) {
    strided(Strided::of(a).transposed(), Strided::of(b), beta, c);
}

/// `c = a b^T + beta c`. Shapes `[m x k] [n x k] [m x n]`.
pub fn product_nt(a: DMatrixView<'_, f32>, b: DMatrixView<'_, f32>, beta: f32, c: DMatrixViewMut<'_, f32>) {
    strided(Strided::of(a), Strided::of(b).transposed(), beta, c);
}

/// A view with its strides, which can be transposed without moving a number.
#[derive(Clone, Copy)]
struct Strided<'a> {
    /// Keeps what the view borrows, and answers for its extent.
    view: DMatrixView<'a, f32>,
    rows: usize,
    columns: usize,
    row_stride: isize,
    column_stride: isize,
}

impl<'a> Strided<'a> {
    fn of(view: DMatrixView<'a, f32>) -> Self {
        let ((rows, columns), (row_stride, column_stride)) = (view.shape(), view.strides());
        Self { view, rows, columns, row_stride: row_stride as isize, column_stride: column_stride as isize }
    }

    fn transposed(self) -> Self {
        Self {
            view: self.view,
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
        }
    }
}

/// `c = a b + beta c`.
#[expect(unsafe_code, reason = "sgemm takes pointers; measured: ten times nalgebra's transposed product")]
fn strided(a: Strided<'_>, b: Strided<'_>, beta: f32, mut c: DMatrixViewMut<'_, f32>) {
    assert_eq!(a.columns, b.rows, "inner dimensions of a product");
    assert_eq!(c.shape(), (a.rows, b.columns), "the shape of a product");
    let (row_stride, column_stride) = c.strides();
    // SAFETY: the views borrow all elements that their shapes and strides reach, and the shapes agree (asserted above).
    // `c` is borrowed mutably, so it overlaps neither `a` nor `b`, and as a mutable view of nalgebra no two of its
    // elements share a place.
    unsafe {
        matrixmultiply::sgemm(
            a.rows,
            a.columns,
            b.columns,
            1.0,
            a.view.as_ptr(),
            a.row_stride,
            a.column_stride,
            b.view.as_ptr(),
            b.row_stride,
            b.column_stride,
            beta,
            c.as_mut_ptr(),
            row_stride as isize,
            column_stride as isize,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Numbers in -1..1 without a pattern.
    fn matrix(rows: usize, columns: usize, seed: u32) -> DMatrix<f32> {
        let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
        DMatrix::from_fn(rows, columns, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        })
    }

    /// Plain loops in f64.
    fn assert_is_product(a: &DMatrix<f32>, b: &DMatrix<f32>, beta: f32, before: &DMatrix<f32>, c: &DMatrix<f32>) {
        for i in 0..a.nrows() {
            for j in 0..b.ncols() {
                let sum: f64 = (0..a.ncols()).map(|l| f64::from(a[(i, l)]) * f64::from(b[(l, j)])).sum();
                let exact = sum + f64::from(beta) * f64::from(before[(i, j)]);
                // Rounding of k additions of numbers below 1, each at most 2^-24 of the sum's magnitude.
                let tolerance = 1e-7 * a.ncols() as f64 + 1e-6;
                assert!((f64::from(c[(i, j)]) - exact).abs() <= tolerance, "({i}, {j})");
            }
        }
    }

    #[test]
    #[should_panic(expected = "inner dimensions")]
    fn refuses_shapes_that_do_not_fit() {
        let (a, b, mut c) = (matrix(2, 3, 1), matrix(4, 2, 2), matrix(2, 2, 3));
        product(a.as_view(), b.as_view(), 0.0, c.as_view_mut());
    }

    #[test]
    fn all_three_agree_with_plain_loops() {
        for (m, k, n) in [(1, 1, 1), (3, 2, 5), (17, 300, 8), (40, 17, 33), (6, 400, 70), (65, 515, 9)] {
            for beta in [0.0, 1.0, -0.5] {
                let (a, b, before) = (matrix(m, k, 1), matrix(k, n, 2), matrix(m, n, 3));
                let mut c = before.clone();
                product(a.as_view(), b.as_view(), beta, c.as_view_mut());
                assert_is_product(&a, &b, beta, &before, &c);
                let mut c = before.clone();
                product_tn(a.transpose().as_view(), b.as_view(), beta, c.as_view_mut());
                assert_is_product(&a, &b, beta, &before, &c);
                let mut c = before.clone();
                product_nt(a.as_view(), b.transpose().as_view(), beta, c.as_view_mut());
                assert_is_product(&a, &b, beta, &before, &c);
            }
        }
    }

    #[test]
    fn views_into_larger_matrices_leave_the_rest_alone() {
        let (a, b, mut c) = (matrix(9, 8, 1), matrix(7, 10, 2), matrix(12, 11, 3));
        let (inner_a, inner_b) = (a.view((1, 2), (5, 4)), b.view((2, 3), (4, 6)));
        let before = c.clone();
        product(inner_a, inner_b, 1.0, c.view_mut((3, 4), (5, 6)));
        let part = |m: &DMatrix<f32>| m.view((3, 4), (5, 6)).into_owned();
        assert_is_product(&inner_a.into_owned(), &inner_b.into_owned(), 1.0, &part(&before), &part(&c));
        c.view_mut((3, 4), (5, 6)).copy_from(&part(&before));
        assert_eq!(c, before);
    }

    #[test]
    fn zero_beta_ignores_what_was_there() {
        let (a, b) = (matrix(5, 4, 1), matrix(4, 6, 2));
        let mut c = DMatrix::from_element(5, 6, f32::NAN);
        product(a.as_view(), b.as_view(), 0.0, c.as_view_mut());
        assert!(c.iter().all(|x| x.is_finite()));
        // Also when there is nothing to sum.
        let mut c = DMatrix::from_element(5, 6, f32::NAN);
        product(DMatrix::zeros(5, 0).as_view(), DMatrix::zeros(0, 6).as_view(), 0.0, c.as_view_mut());
        assert!(c.iter().all(|&x| x == 0.0));
    }

    #[test]
    fn bits_of_a_column_do_not_depend_on_how_many_pass_together() {
        for (m, k) in [(300, 17), (400, 300), (6, 400), (1, 400), (64, 600)] {
            let (a, b) = (matrix(m, k, 1), matrix(k, 1000, 2));
            let transposed = a.transpose();
            for beta in [0.0, 1.0] {
                let before = matrix(m, 1000, 3);
                let mut all = before.clone();
                product(a.as_view(), b.as_view(), beta, all.as_view_mut());
                for n in [1, 2, 5, 6, 7, 64] {
                    let some_b = b.columns(0, n);
                    let mut some = before.columns(0, n).into_owned();
                    product(a.as_view(), some_b, beta, some.as_view_mut());
                    assert_eq!(some, all.columns(0, n), "{m} x {k}, {n} columns");
                    let mut some = before.columns(0, n).into_owned();
                    product_tn(transposed.as_view(), some_b, beta, some.as_view_mut());
                    assert_eq!(some, all.columns(0, n), "transposed {m} x {k}, {n} columns");
                }
            }
        }
    }
}
