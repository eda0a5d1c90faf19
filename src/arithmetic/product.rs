//! Products of f32 matrices.

use nalgebra::{DMatrixView, DMatrixViewMut};

/// `c = a b + beta c`. Shapes `[m x k] [k x n] [m x n]`.
pub fn product(a: DMatrixView<'_, f32>, b: DMatrixView<'_, f32>, beta: f32, c: DMatrixViewMut<'_, f32>) {
    let _ = (a, b, beta, c);
    todo!()
}

/// `c = a^T b + beta c`. Shapes `[k x m] [k x n] [m x n]`.
pub fn product_tn(a: DMatrixView<'_, f32>, b: DMatrixView<'_, f32>, beta: f32, c: DMatrixViewMut<'_, f32>) {
    let _ = (a, b, beta, c);
    todo!()
}

/// `c = a b^T + beta c`. Shapes `[m x k] [n x k] [m x n]`.
pub fn product_nt(a: DMatrixView<'_, f32>, b: DMatrixView<'_, f32>, beta: f32, c: DMatrixViewMut<'_, f32>) {
    let _ = (a, b, beta, c);
    todo!()
}
