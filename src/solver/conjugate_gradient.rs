//! Conjugate gradient for `A x = b`, where `A` is known by its products (Hestenes and Stiefel, 1952).

use super::LinearOperator;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// At most so many products.
    pub iterations: usize,
    /// Stop once the residual's norm is below this fraction of the right-hand side's.
    pub relative_residual: f64,
}

/// What [`solve`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The approximate solution `[dim]`.
    pub x: Vec<f32>,
    /// Products taken.
    pub iterations: usize,
    /// The residual's norm relative to the right-hand side's; 0 for a zero right-hand side.
    pub relative_residual: f64,
}

/// The approximate solution of `operator x = rhs`, starting from zero. A zero right-hand side gives zero without a product.
pub fn solve(operator: &mut dyn LinearOperator, rhs: &[f32], limits: Limits) -> Solution {
    let _ = (operator, rhs, limits);
    todo!()
}
