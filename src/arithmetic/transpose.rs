//! Transposed copies of matrices.
//!
//! A network that learns transposes its weights for each minibatch: number by number that is a
//! twelfth of an iteration with minibatches of 64, twice as long as in blocks that stay in
//! registers.

use nalgebra::{DMatrixView, DMatrixViewMut};

/// Writes the transpose of `a` (`[m x n]`) to `transposed` (`[n x m]`).
pub fn transpose(a: DMatrixView<'_, f32>, mut transposed: DMatrixViewMut<'_, f32>) {
    assert_eq!(
        transposed.shape(),
        (a.ncols(), a.nrows()),
        "the shape of a transpose"
    );
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(blocks::Blocks {
            simd,
            a,
            transposed,
        });
    }
    a.transpose_to(&mut transposed);
}

#[cfg(target_arch = "x86_64")]
mod blocks {
    use std::{arch::x86_64::__m256, array};

    use nalgebra::{DMatrixView, DMatrixViewMut};
    use pulp::{NullaryFnOnce, cast, x86::V3};

    /// Rows and columns of a block: eight registers of eight numbers.
    const SIDE: usize = 8;

    pub(super) struct Blocks<'a> {
        pub(super) simd: V3,
        pub(super) a: DMatrixView<'a, f32>,
        pub(super) transposed: DMatrixViewMut<'a, f32>,
    }

    impl NullaryFnOnce for Blocks<'_> {
        type Output = ();

        #[inline(always)]
        fn call(self) {
            let Self {
                simd,
                a,
                mut transposed,
            } = self;
            let (rows, columns) = (a.nrows() - a.nrows() % SIDE, a.ncols() - a.ncols() % SIDE);
            for column in (0..columns).step_by(SIDE) {
                let from: [&[f32]; SIDE] =
                    array::from_fn(|j| a.column(column + j).data.into_slice());
                for row in (0..rows).step_by(SIDE) {
                    let block = from.map(|from| {
                        let numbers: [f32; SIDE] = array::from_fn(|i| from[row..row + SIDE][i]);
                        cast(numbers)
                    });
                    for (i, numbers) in turned(simd, block).into_iter().enumerate() {
                        let to = transposed.column_mut(row + i).data.into_slice_mut();
                        to[column..column + SIDE].copy_from_slice(&cast::<_, [f32; SIDE]>(numbers));
                    }
                }
            }
            // What is left over below the blocks, and beside them.
            for column in 0..a.ncols() {
                let first = if column < columns { rows } else { 0 };
                for row in first..a.nrows() {
                    transposed[(column, row)] = a[(row, column)];
                }
            }
        }
    }

    /// The transpose of a block: in pairs of numbers, fours, and halves of registers.
    #[inline(always)]
    fn turned(simd: V3, block: [__m256; SIDE]) -> [__m256; SIDE] {
        let avx = simd.avx;
        let pairs: [_; SIDE] = array::from_fn(|i| {
            let (a, b) = (block[i & !1], block[i | 1]);
            if i % 2 == 0 {
                avx._mm256_unpacklo_ps(a, b)
            } else {
                avx._mm256_unpackhi_ps(a, b)
            }
        });
        let fours: [_; SIDE] = array::from_fn(|i| {
            let first = i & !3 | (i & 2) >> 1;
            let (a, b) = (pairs[first], pairs[first + 2]);
            if i % 2 == 0 {
                avx._mm256_shuffle_ps::<0b01_00_01_00>(a, b)
            } else {
                avx._mm256_shuffle_ps::<0b11_10_11_10>(a, b)
            }
        });
        array::from_fn(|i| {
            let (a, b) = (fours[i & 3], fours[i | 4]);
            if i < 4 {
                avx._mm256_permute2f128_ps::<0x20>(a, b)
            } else {
                avx._mm256_permute2f128_ps::<0x31>(a, b)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    #[test]
    #[should_panic(expected = "the shape of a transpose")]
    fn refuses_a_shape_that_does_not_fit() {
        let (a, mut transposed) = (DMatrix::zeros(3, 2), DMatrix::zeros(3, 2));
        transpose(a.as_view(), transposed.as_view_mut());
    }

    #[test]
    fn every_number_comes_to_its_place_and_nothing_else_is_written() {
        for (rows, columns) in [
            (1, 1),
            (8, 8),
            (16, 24),
            (6, 400),
            (17, 9),
            (23, 31),
            (8, 0),
        ] {
            // As a part of a larger matrix on both sides, with a border that must stay.
            let a = DMatrix::from_fn(rows + 3, columns + 2, |i, j| (i * 1000 + j) as f32);
            let mut transposed = DMatrix::from_element(columns + 4, rows + 1, f32::NAN);
            transpose(
                a.view((2, 1), (rows, columns)),
                transposed.view_mut((3, 0), (columns, rows)),
            );
            for ((j, i), number) in transposed
                .iter()
                .enumerate()
                .map(|(at, number)| (transposed.vector_to_matrix_index(at), number))
            {
                let inside = (3..columns + 3).contains(&j) && i < rows;
                let wanted = if inside { a[(i + 2, j - 2)] } else { f32::NAN };
                assert!(
                    *number == wanted || (number.is_nan() && wanted.is_nan()),
                    "{rows} x {columns}: ({j}, {i}) is {number}"
                );
            }
        }
    }
}
