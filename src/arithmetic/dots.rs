//! Products whose result has few rows, as dot products of columns.
//!
//! A tile of [`product`](super::product) would leave most of a vector empty. Each dot product here
//! is sixteen sums, each over every sixteenth element, added up as halves, quarters and so on: the
//! same bits in any batch and on any width of registers.

use std::array;

use nalgebra::{DMatrixView, DMatrixViewMut};
use pulp::{Arch, Simd, WithSimd};

/// Partial sums of a dot product.
const SUMS: usize = 16;

/// `c = a^T b + beta c`: the dot products of `a`'s columns with `b`'s. Shapes
/// `[k x m] [k x n] [m x n]`, for a small m. The old content of `c` is ignored if `beta` is zero.
pub fn product_of_columns(
    a: DMatrixView<'_, f32>,
    b: DMatrixView<'_, f32>,
    beta: f32,
    c: DMatrixViewMut<'_, f32>,
) {
    assert_eq!(a.nrows(), b.nrows(), "inner dimensions of a product");
    assert_eq!(c.shape(), (a.ncols(), b.ncols()), "the shape of a product");
    Arch::new().dispatch(Dots { a, b, beta, c });
}

struct Dots<'a> {
    a: DMatrixView<'a, f32>,
    b: DMatrixView<'a, f32>,
    beta: f32,
    c: DMatrixViewMut<'a, f32>,
}

impl WithSimd for Dots<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // As many dot products at once as the registers hold sums for, with room left for the
        // numbers.
        match S::F32_LANES {
            16 => self.all::<S, 1, 4>(simd),
            8 => self.all::<S, 2, 2>(simd),
            4 => self.all::<S, 4, 1>(simd),
            _ => self.all::<S, SUMS, 1>(simd),
        }
    }
}

impl Dots<'_> {
    /// `V` vectors hold the sums of one dot product; tiles of up to `N` by `N`.
    #[inline(always)]
    fn all<S: Simd, const V: usize, const N: usize>(mut self, simd: S) {
        let (rows, columns) = self.c.shape();
        let mut column = 0;
        while column < columns {
            let width = if column + N <= columns { N } else { 1 };
            let mut row = 0;
            while row < rows {
                // Against one column alone, `a` is read in the order in which it lies.
                let height = if width == N && row + N <= rows { N } else { 1 };
                match (height == N, width == N) {
                    (true, _) => self.tile::<S, V, N, N>(simd, row, column),
                    (false, true) => self.tile::<S, V, 1, N>(simd, row, column),
                    (false, false) => self.tile::<S, V, 1, 1>(simd, row, column),
                }
                row += height;
            }
            column += width;
        }
    }

    /// The dot products of `A` columns of `a`, from `row` on, with `B` columns of `b`, from
    /// `column` on.
    #[inline(always)]
    fn tile<S: Simd, const V: usize, const A: usize, const B: usize>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
    ) {
        let left: [_; A] =
            array::from_fn(|i| self.a.column(row + i).data.into_slice().as_chunks::<SUMS>());
        let right: [_; B] = array::from_fn(|j| {
            self.b
                .column(column + j)
                .data
                .into_slice()
                .as_chunks::<SUMS>()
        });
        let mut sums = [[[simd.splat_f32s(0.0); V]; B]; A];
        for l in 0..left[0].0.len() {
            add(
                simd,
                &mut sums,
                array::from_fn(|i| load(simd, &left[i].0[l])),
                array::from_fn(|j| load(simd, &right[j].0[l])),
            );
        }
        // The rest is filled up with zeros, which add nothing.
        if !left[0].1.is_empty() {
            let filled = |rest: &[f32]| {
                let mut block = [0.0; SUMS];
                block[..rest.len()].copy_from_slice(rest);
                load(simd, &block)
            };
            add(
                simd,
                &mut sums,
                array::from_fn(|i| filled(left[i].1)),
                array::from_fn(|j| filled(right[j].1)),
            );
        }
        for (i, sums) in sums.into_iter().enumerate() {
            for (j, sums) in sums.into_iter().enumerate() {
                let place = &mut self.c[(row + i, column + j)];
                let sum = total::<S, V>(sums);
                *place = if self.beta == 0.0 {
                    sum
                } else {
                    sum + self.beta * *place
                };
            }
        }
    }
}

/// Adds the products of one block of `left` and `right` to the sums.
#[inline(always)]
fn add<S: Simd, const V: usize, const A: usize, const B: usize>(
    simd: S,
    sums: &mut [[[S::f32s; V]; B]; A],
    left: [[S::f32s; V]; A],
    right: [[S::f32s; V]; B],
) {
    for i in 0..A {
        for j in 0..B {
            for v in 0..V {
                sums[i][j][v] = simd.mul_add_e_f32s(left[i][v], right[j][v], sums[i][j][v]);
            }
        }
    }
}

#[inline(always)]
fn load<S: Simd, const V: usize>(_: S, block: &[f32; SUMS]) -> [S::f32s; V] {
    let (vectors, _) = S::as_simd_f32s(block);
    array::from_fn(|v| vectors[v])
}

/// The total of one dot product's sums.
#[inline(always)]
fn total<S: Simd, const V: usize>(vectors: [S::f32s; V]) -> f32 {
    let mut sums = [0.0; SUMS];
    S::as_mut_simd_f32s(&mut sums).0.copy_from_slice(&vectors);
    let eight: [f32; 8] = array::from_fn(|i| sums[i] + sums[i + 8]);
    let four: [f32; 4] = array::from_fn(|i| eight[i] + eight[i + 4]);
    (four[0] + four[2]) + (four[1] + four[3])
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    fn matrix(rows: usize, columns: usize, seed: f32) -> DMatrix<f32> {
        DMatrix::from_fn(rows, columns, |i, j| {
            ((i * columns + j) as f32 * 1.7 + seed).sin()
        })
    }

    #[test]
    #[should_panic(expected = "inner dimensions")]
    fn refuses_shapes_that_do_not_fit() {
        let (a, b, mut c) = (matrix(3, 2, 1.0), matrix(4, 2, 2.0), matrix(2, 2, 3.0));
        product_of_columns(a.as_view(), b.as_view(), 0.0, c.as_view_mut());
    }

    #[test]
    fn it_agrees_with_plain_loops() {
        for (m, k, n) in [
            (1, 1, 1),
            (3, 16, 5),
            (6, 400, 9),
            (8, 300, 4),
            (1, 37, 13),
            (5, 0, 2),
        ] {
            for beta in [0.0, 1.0, -0.5] {
                let (a, b) = (matrix(k, m, 1.0), matrix(k, n, 2.0));
                let before = if beta == 0.0 {
                    DMatrix::from_element(m, n, f32::NAN)
                } else {
                    matrix(m, n, 3.0)
                };
                let mut c = before.clone();
                product_of_columns(a.as_view(), b.as_view(), beta, c.as_view_mut());
                for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    let products = a
                        .column(i)
                        .iter()
                        .zip(b.column(j).iter())
                        .map(|(&x, &y)| f64::from(x) * f64::from(y))
                        .sum::<f64>();
                    let exact = if beta == 0.0 {
                        products
                    } else {
                        products + f64::from(beta) * f64::from(before[(i, j)])
                    };
                    // k roundings of sums below k, in sixteenths.
                    assert!(
                        (f64::from(c[(i, j)]) - exact).abs() <= 1e-7 * k as f64 + 1e-6,
                        "{m} {k} {n}: ({i}, {j})"
                    );
                }
            }
        }
    }

    #[test]
    fn bits_do_not_depend_on_what_is_computed_together() {
        let (a, b) = (matrix(300, 7, 1.0), matrix(300, 30, 2.0));
        let mut all = DMatrix::zeros(7, 30);
        product_of_columns(a.as_view(), b.as_view(), 0.0, all.as_view_mut());
        for (i, j) in (0..7).flat_map(|i| (0..30).map(move |j| (i, j))) {
            let mut one = DMatrix::zeros(1, 1);
            product_of_columns(a.columns(i, 1), b.columns(j, 1), 0.0, one.as_view_mut());
            assert_eq!(one[0].to_bits(), all[(i, j)].to_bits());
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn bits_do_not_depend_on_the_width_of_registers() {
        let Some(narrow) = pulp::x86::V3::try_new() else {
            return;
        };
        let (a, b) = (matrix(309, 6, 1.0), matrix(309, 11, 2.0));
        let (mut with_narrow, mut with_best) = (DMatrix::zeros(6, 11), DMatrix::zeros(6, 11));
        let dots = Dots {
            a: a.as_view(),
            b: b.as_view(),
            beta: 0.0,
            c: with_narrow.as_view_mut(),
        };
        Simd::vectorize(narrow, dots);
        product_of_columns(a.as_view(), b.as_view(), 0.0, with_best.as_view_mut());
        assert_eq!(with_narrow, with_best);
    }
}
