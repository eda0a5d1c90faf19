//! Products of f32 matrices.
//!
//! Each element is one chain of fused multiplications and additions in the order of the inner
//! index, whatever the shape, its place in it, and the width of the machine's registers. So the
//! columns of `a b` have the same bits alone and in any batch, which neither nalgebra nor the usual
//! libraries promise; only CPUs without fused multiplication (x86 before 2013) give other last
//! bits.
//!
//! A tile of the result stays in registers while columns of `a` stream past it. Nothing is packed
//! or allocated: a column of `a` is read as it lies. At the shapes of this crate's networks that is
//! measured at 1.2 times the rate of `matrixmultiply` for a thousand columns and three times for
//! eight, with AVX-512 and without. It is meant for factors that fit a second-level cache; an inner
//! dimension of many thousands is better cut by the caller.

use std::{array, ops::Range};

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};
use pulp::{Arch, Simd, WithSimd};

/// `c = a b + beta c`. Shapes `[m x k] [k x n] [m x n]`. The old content of `c` is ignored if
/// `beta` is zero.
pub fn product(
    a: DMatrixView<'_, f32>,
    b: DMatrixView<'_, f32>,
    beta: f32,
    c: DMatrixViewMut<'_, f32>,
) {
    assert_eq!(a.ncols(), b.nrows(), "inner dimensions of a product");
    assert_eq!(c.shape(), (a.nrows(), b.ncols()), "the shape of a product");
    Arch::new().dispatch(Product {
        a,
        right: Right::Plain(b),
        beta,
        c,
    });
}

/// `c = a^T b + beta c`. Shapes `[k x m] [k x n] [m x n]`. Allocates a transposed copy of `a`.
pub fn product_tn(
    a: DMatrixView<'_, f32>,
    b: DMatrixView<'_, f32>,
    beta: f32,
    c: DMatrixViewMut<'_, f32>,
) {
    let transposed: DMatrix<f32> = a.transpose();
    product(transposed.as_view(), b, beta, c);
}

/// `c = a b^T + beta c`. Shapes `[m x k] [n x k] [m x n]`.
pub fn product_nt(
    a: DMatrixView<'_, f32>,
    b: DMatrixView<'_, f32>,
    beta: f32,
    c: DMatrixViewMut<'_, f32>,
) {
    assert_eq!(a.ncols(), b.ncols(), "inner dimensions of a product");
    assert_eq!(c.shape(), (a.nrows(), b.nrows()), "the shape of a product");
    Arch::new().dispatch(Product {
        a,
        right: Right::Transposed(b),
        beta,
        c,
    });
}

/// `c = a [b^T 1] + beta c`: beside `a b^T`, the last column of `c` is the sum of `a`'s columns.
/// Shapes `[m x k] [n x k] [m x (n + 1)]`.
pub fn product_nt_and_sum(
    a: DMatrixView<'_, f32>,
    b: DMatrixView<'_, f32>,
    beta: f32,
    c: DMatrixViewMut<'_, f32>,
) {
    assert_eq!(a.ncols(), b.ncols(), "inner dimensions of a product");
    assert_eq!(
        c.shape(),
        (a.nrows(), b.nrows() + 1),
        "the shape of a product"
    );
    Arch::new().dispatch(Product {
        a,
        right: Right::TransposedAndOnes(b),
        beta,
        c,
    });
}

/// The right factor.
enum Right<'a> {
    /// `b` of `a b`.
    Plain(DMatrixView<'a, f32>),
    /// `b` of `a b^T`.
    Transposed(DMatrixView<'a, f32>),
    /// `b` of `a [b^T 1]`.
    TransposedAndOnes(DMatrixView<'a, f32>),
}

struct Product<'a> {
    a: DMatrixView<'a, f32>,
    right: Right<'a>,
    beta: f32,
    c: DMatrixViewMut<'a, f32>,
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // The tile, a column's part of `a` and a number of `b` fill the registers, and the tile has
        // enough sums to hide a multiplication's latency.
        if S::REGISTER_COUNT >= 32 {
            self.tiles::<S, 3, 8>(simd)
        } else {
            self.tiles::<S, 2, 6>(simd)
        }
    }
}

impl Product<'_> {
    /// Computes tiles of `V` vectors by `N` columns.
    /// At the lower edge they have one vector, maybe a partial one; at the right edge some columns
    /// are computed twice.
    #[inline(always)]
    fn tiles<S: Simd, const V: usize, const N: usize>(mut self, simd: S) {
        let (rows, columns) = self.c.shape();
        let tall = V * S::F32_LANES;
        let edge = rows - rows % tall;
        for row in (0..edge).step_by(tall) {
            self.row_of_tiles::<S, V, N>(simd, row, tall, columns);
        }
        for row in (edge..rows).step_by(S::F32_LANES) {
            self.row_of_tiles::<S, 1, N>(simd, row, S::F32_LANES.min(rows - row), columns);
        }
    }

    /// Computes the tiles of `height` from `row` on.
    #[inline(always)]
    fn row_of_tiles<S: Simd, const V: usize, const N: usize>(
        &mut self,
        simd: S,
        row: usize,
        height: usize,
        columns: usize,
    ) {
        for column in (0..columns).step_by(N) {
            let width = N.min(columns - column);
            if width == 1 {
                self.tile::<S, V, 1>(simd, (row, height), (column, width));
            } else {
                self.tile::<S, V, N>(simd, (row, height), (column, width));
            }
        }
    }

    /// Computes the tile at `(row, column)`, of which `height` rows and `width` columns exist.
    #[inline(always)]
    fn tile<S: Simd, const V: usize, const N: usize>(
        &mut self,
        simd: S,
        (row, height): (usize, usize),
        (column, width): (usize, usize),
    ) {
        let (rows, last) = (row..row + height, width - 1);
        let sums = match &self.right {
            Right::Plain(b) => {
                let columns: [&[f32]; N] =
                    array::from_fn(|j| &column_of(b, column + j.min(last))[..self.a.ncols()]);
                sums::<S, V, N>(simd, &self.a, &rows, |l| {
                    array::from_fn(|j| simd.splat_f32s(columns[j][l]))
                })
            }
            Right::Transposed(b) | Right::TransposedAndOnes(b) if column + N <= b.nrows() => {
                sums::<S, V, N>(simd, &self.a, &rows, |l| {
                    let numbers = &column_of(b, l)[column..column + N];
                    array::from_fn(|j| simd.splat_f32s(numbers[j]))
                })
            }
            // This is at the right edge: the column after `b`'s last is the ones.
            Right::Transposed(b) | Right::TransposedAndOnes(b) => {
                sums::<S, V, N>(simd, &self.a, &rows, |l| {
                    let numbers = &column_of(b, l)[column..];
                    array::from_fn(|j| {
                        simd.splat_f32s(numbers.get(j.min(last)).copied().unwrap_or(1.0))
                    })
                })
            }
        };
        let beta = simd.splat_f32s(self.beta);
        for (j, sums) in sums.into_iter().enumerate().take(width) {
            let place = &mut self.c.column_mut(column + j).data.into_slice_mut()[rows.clone()];
            let mut results = sums;
            if self.beta != 0.0 {
                let before = load::<S, V>(simd, place);
                results = array::from_fn(|v| simd.mul_add_e_f32s(beta, before[v], sums[v]));
            }
            store(simd, results, place);
        }
    }
}

/// The sums over l of `a`'s `rows` in column l times each of the N numbers that `right` has for l.
#[inline(always)]
fn sums<S: Simd, const V: usize, const N: usize>(
    simd: S,
    a: &DMatrixView<'_, f32>,
    rows: &Range<usize>,
    right: impl Fn(usize) -> [S::f32s; N],
) -> [[S::f32s; V]; N] {
    let mut sums = [[simd.splat_f32s(0.0); V]; N];
    for l in 0..a.ncols() {
        let left = load::<S, V>(simd, &column_of(a, l)[rows.clone()]);
        let right = right(l);
        for j in 0..N {
            for v in 0..V {
                sums[j][v] = simd.mul_add_e_f32s(left[v], right[j], sums[j][v]);
            }
        }
    }
    sums
}

/// Column `j`, as a slice.
#[inline(always)]
fn column_of<'a>(matrix: &'a DMatrixView<'_, f32>, j: usize) -> &'a [f32] {
    matrix.column(j).data.into_slice()
}

/// Loads V vectors, or one that may be partial.
#[inline(always)]
fn load<S: Simd, const V: usize>(simd: S, numbers: &[f32]) -> [S::f32s; V] {
    if V == 1 {
        [simd.partial_load_f32s(numbers); V]
    } else {
        let (vectors, _) = S::as_simd_f32s(numbers);
        array::from_fn(|v| vectors[v])
    }
}

/// Stores V vectors, or one that may be partial.
#[inline(always)]
fn store<S: Simd, const V: usize>(simd: S, vectors: [S::f32s; V], numbers: &mut [f32]) {
    if V == 1 {
        simd.partial_store_f32s(numbers, vectors[0]);
    } else {
        let (places, _) = S::as_mut_simd_f32s(numbers);
        places.copy_from_slice(&vectors);
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
    fn assert_is_product(
        a: &DMatrix<f32>,
        b: &DMatrix<f32>,
        beta: f32,
        before: &DMatrix<f32>,
        c: &DMatrix<f32>,
    ) {
        for i in 0..a.nrows() {
            for j in 0..b.ncols() {
                let sum: f64 = (0..a.ncols())
                    .map(|l| f64::from(a[(i, l)]) * f64::from(b[(l, j)]))
                    .sum();
                let exact = sum + f64::from(beta) * f64::from(before[(i, j)]);
                // Rounding of k additions of numbers below 1, each at most 2^-24 of the sum's
                // magnitude.
                let tolerance = 1e-7 * a.ncols() as f64 + 1e-6;
                assert!(
                    (f64::from(c[(i, j)]) - exact).abs() <= tolerance,
                    "({i}, {j})"
                );
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
    fn all_agree_with_plain_loops() {
        for (m, k, n) in [
            (1, 1, 1),
            (3, 2, 5),
            (17, 300, 8),
            (40, 17, 33),
            (6, 400, 70),
            (65, 515, 9),
        ] {
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
                let (with_ones, before) = (
                    b.clone().insert_column(n, 1.0),
                    before.insert_column(n, 0.3),
                );
                let mut c = before.clone();
                product_nt_and_sum(a.as_view(), b.transpose().as_view(), beta, c.as_view_mut());
                assert_is_product(&a, &with_ones, beta, &before, &c);
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
        assert_is_product(
            &inner_a.into_owned(),
            &inner_b.into_owned(),
            1.0,
            &part(&before),
            &part(&c),
        );
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
        product(
            DMatrix::zeros(5, 0).as_view(),
            DMatrix::zeros(0, 6).as_view(),
            0.0,
            c.as_view_mut(),
        );
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

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn bits_do_not_depend_on_the_width_of_registers() {
        let Some(narrow) = pulp::x86::V3::try_new() else {
            return;
        };
        for (m, k, n) in [(100, 17, 13), (6, 300, 9), (35, 64, 1)] {
            let (a, b, before) = (matrix(m, k, 1), matrix(k, n, 2), matrix(m, n, 3));
            let (mut with_narrow, mut with_best) = (before.clone(), before.clone());
            let right = Right::Plain(b.as_view());
            Simd::vectorize(
                narrow,
                Product {
                    a: a.as_view(),
                    right,
                    beta: 1.0,
                    c: with_narrow.as_view_mut(),
                },
            );
            product(a.as_view(), b.as_view(), 1.0, with_best.as_view_mut());
            assert_eq!(with_narrow, with_best, "{m} x {k} x {n}");
        }
    }
}
