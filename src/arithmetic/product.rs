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
        start: Zero,
        beta,
        c,
    });
}

/// `c = start + a b`, each chain going on from the element of `start`: with the chains that a product
/// of other inner indices left there, the bits are those of one product over all of them. Shapes
/// `[m x k] [k x n] [m x n]`.
pub fn product_onto(
    start: DMatrixView<'_, f32>,
    a: DMatrixView<'_, f32>,
    b: DMatrixView<'_, f32>,
    c: DMatrixViewMut<'_, f32>,
) {
    assert_eq!(a.ncols(), b.nrows(), "inner dimensions of a product");
    assert_eq!(c.shape(), (a.nrows(), b.ncols()), "the shape of a product");
    assert_eq!(c.shape(), start.shape(), "the shape of a product's start");
    Arch::new().dispatch(Product {
        a,
        right: Right::Plain(b),
        start,
        beta: 0.0,
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
        start: Zero,
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
        start: Zero,
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

/// Where the chains of a product start.
trait Start {
    /// The numbers at `rows` of the N columns from `column` on, of which `last` is the last that
    /// exists.
    fn tile<S: Simd, const V: usize, const N: usize>(
        &self,
        simd: S,
        rows: &Range<usize>,
        column: usize,
        last: usize,
    ) -> [[S::f32s; V]; N];
}

struct Zero;

impl Start for Zero {
    #[inline(always)]
    fn tile<S: Simd, const V: usize, const N: usize>(
        &self,
        simd: S,
        _: &Range<usize>,
        _: usize,
        _: usize,
    ) -> [[S::f32s; V]; N] {
        [[simd.splat_f32s(0.0); V]; N]
    }
}

impl Start for DMatrixView<'_, f32> {
    #[inline(always)]
    fn tile<S: Simd, const V: usize, const N: usize>(
        &self,
        simd: S,
        rows: &Range<usize>,
        column: usize,
        last: usize,
    ) -> [[S::f32s; V]; N] {
        let mut start = [[simd.splat_f32s(0.0); V]; N];
        for (j, start) in start.iter_mut().enumerate() {
            *start = load::<S, V>(simd, &column_of(self, column + j.min(last))[rows.clone()]);
        }
        start
    }
}

struct Product<'a, F> {
    a: DMatrixView<'a, f32>,
    right: Right<'a>,
    start: F,
    beta: f32,
    c: DMatrixViewMut<'a, f32>,
}

impl<F: Start> WithSimd for Product<'_, F> {
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

impl<F: Start> Product<'_, F> {
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
        let start = self.start.tile::<S, V, N>(simd, &rows, column, last);
        let sums = match &self.right {
            Right::Plain(b) => {
                let columns: [&[f32]; N] =
                    array::from_fn(|j| &column_of(b, column + j.min(last))[..self.a.ncols()]);
                sums::<S, V, N>(simd, start, &self.a, &rows, |l| {
                    array::from_fn(|j| simd.splat_f32s(columns[j][l]))
                })
            }
            Right::Transposed(b) | Right::TransposedAndOnes(b) if column + N <= b.nrows() => {
                sums::<S, V, N>(simd, start, &self.a, &rows, |l| {
                    let numbers = &column_of(b, l)[column..column + N];
                    array::from_fn(|j| simd.splat_f32s(numbers[j]))
                })
            }
            // This is at the right edge: the column after `b`'s last is the ones.
            Right::Transposed(b) | Right::TransposedAndOnes(b) => {
                sums::<S, V, N>(simd, start, &self.a, &rows, |l| {
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

/// The sums, from `sums` on, over l of `a`'s `rows` in column l times each of the N numbers that
/// `right` has for l.
#[inline(always)]
fn sums<S: Simd, const V: usize, const N: usize>(
    simd: S,
    mut sums: [[S::f32s; V]; N],
    a: &DMatrixView<'_, f32>,
    rows: &Range<usize>,
    right: impl Fn(usize) -> [S::f32s; N],
) -> [[S::f32s; V]; N] {
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
mod tests;
