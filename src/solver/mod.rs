//! The MCPO solver: minimise a linear function under a linear and a quadratic constraint, when the quadratic form is
//! known only by its products with vectors.
//!
//! Owns conjugate gradient, the dual of the two-constraint problem (appendix, Eq. 5 to 14), the backtracking line search
//! and Adam. Knows no word of reinforcement learning: vectors, operators and numbers alone. Start at [`dual`].
//!
//! Vectors are f32; their dot products are summed in f64.

pub mod adam;
pub mod conjugate_gradient;
pub mod dual;
pub mod line_search;

/// A symmetric positive definite matrix, known by its products.
pub trait LinearOperator {
    /// Rows, which are the columns.
    fn dim(&self) -> usize;

    /// Writes the product with `x` (`[dim]`) to `product` (`[dim]`).
    fn apply(&mut self, x: &[f32], product: &mut [f32]);
}

/// The dot product, summed in f64.
pub fn dot(a: &[f32], b: &[f32]) -> f64 {
    debug_assert_eq!(a.len(), b.len());
    // Eight partial sums: the order is fixed, and the compiler may still use the whole width of the machine.
    let mut sums = [0.0f64; 8];
    let (heads, tail) = a.as_chunks::<8>();
    let (other_heads, other_tail) = b.as_chunks::<8>();
    for (x, y) in heads.iter().zip(other_heads) {
        for lane in 0..8 {
            sums[lane] += f64::from(x[lane]) * f64::from(y[lane]);
        }
    }
    let rest: f64 = tail.iter().zip(other_tail).map(|(&x, &y)| f64::from(x) * f64::from(y)).sum();
    sums.iter().sum::<f64>() + rest
}
