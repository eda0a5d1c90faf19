//! The MCPO solver: minimise a linear function under a linear and a quadratic constraint, when the
//! quadratic form is known only by its products with vectors.
//!
//! Owns the constrained step, conjugate gradient, the dual of the two-constraint problem (appendix,
//! Eq. 5 to 14), the backtracking line search and Adam. Knows no word of reinforcement learning:
//! vectors, operators and numbers alone. Start at [`constrained_step`], which reads like the
//! appendix, and at [`dual`], its heart.
//!
//! Vectors are f32; their dot products are summed in f64.

pub mod adam;
pub mod conjugate_gradient;
mod constrained;
pub mod dual;
pub mod line_search;

use pulp::Arch;

pub use constrained::{ConstrainedStep, LinearConstraint, constrained_step, way_back};

/// A symmetric positive definite matrix, known by its products.
pub trait LinearOperator {
    /// The number of rows, which is that of columns.
    fn dim(&self) -> usize;

    /// Writes the product with `x` (`[dim]`) to `product` (`[dim]`).
    fn apply(&mut self, x: &[f32], product: &mut [f32]);
}

/// A point in the space of parameters, `theta` (`[dim]`).
#[derive(Debug, Clone, PartialEq)]
pub struct Theta(Vec<f32>);

impl Theta {
    /// The point with these coordinates (`[dim]`).
    pub fn new(coordinates: Vec<f32>) -> Self {
        Self(coordinates)
    }

    /// The coordinates `[dim]`.
    pub fn as_slice(&self) -> &[f32] {
        &self.0
    }

    /// The point `theta + fraction * step`; `step` has the same dimension.
    pub fn moved(&self, step: &Step, fraction: f64) -> Self {
        let mut there = self.clone();
        there.place(self, step, fraction);
        there
    }

    /// Becomes `start + fraction * step` without allocating.
    fn place(&mut self, start: &Theta, step: &Step, fraction: f64) {
        debug_assert_eq!(start.0.len(), step.0.len());
        let fraction = fraction as f32;
        for ((there, &from), &along) in self.0.iter_mut().zip(&start.0).zip(&step.0) {
            *there = from + fraction * along;
        }
    }
}

impl Theta {
    /// Adds `fraction * step`.
    fn advance(&mut self, step: &Step, fraction: f64) {
        debug_assert_eq!(self.0.len(), step.0.len());
        let fraction = fraction as f32;
        self.0
            .iter_mut()
            .zip(&step.0)
            .for_each(|(here, &along)| *here += fraction * along);
    }
}

/// A difference of two [`Theta`]s, `x = theta - theta_k` (`[dim]`).
#[derive(Debug, Clone, PartialEq)]
pub struct Step(Vec<f32>);

impl Step {
    /// The step with these coordinates (`[dim]`).
    pub fn new(coordinates: Vec<f32>) -> Self {
        Self(coordinates)
    }

    /// The coordinates `[dim]`.
    pub fn as_slice(&self) -> &[f32] {
        &self.0
    }
}

/// The dot product, summed in f64.
pub fn dot(a: &[f32], b: &[f32]) -> f64 {
    debug_assert_eq!(a.len(), b.len());
    // There are so many partial sums that no addition waits for another. Their order does not
    // depend on the width of registers.
    const SUMS: usize = 32;
    let (heads, tail) = a.as_chunks::<SUMS>();
    let (other_heads, other_tail) = b.as_chunks::<SUMS>();
    let sums = Arch::new().dispatch(
        #[inline(always)]
        || {
            let mut sums = [0.0f64; SUMS];
            for (x, y) in heads.iter().zip(other_heads) {
                for lane in 0..SUMS {
                    sums[lane] += f64::from(x[lane]) * f64::from(y[lane]);
                }
            }
            sums
        },
    );
    let rest: f64 = tail
        .iter()
        .zip(other_tail)
        .map(|(&x, &y)| f64::from(x) * f64::from(y))
        .sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dot_equals_the_plain_loop_at_every_length() {
        for length in (0..40).chain([127, 1000]) {
            let a: Vec<f32> = (0..length).map(|i| (i as f32 * 0.7).sin()).collect();
            let b: Vec<f32> = (0..length).map(|i| (i as f32 * 1.3).cos()).collect();
            let plain: f64 = (0..length).map(|i| f64::from(a[i]) * f64::from(b[i])).sum();
            assert!((dot(&a, &b) - plain).abs() < 1e-12, "length {length}");
        }
    }

    #[test]
    fn dot_keeps_what_f32_sums_would_lose() {
        assert_eq!(dot(&[1e8, 1.0, -1e8], &[1.0, 1.0, 1.0]), 1.0);
    }

    #[test]
    fn a_point_moves_by_a_fraction_of_a_step() {
        let theta = Theta::new(vec![1.0, -2.0]);
        assert_eq!(
            theta.moved(&Step::new(vec![4.0, 8.0]), 0.25),
            Theta::new(vec![2.0, 0.0])
        );
        assert_eq!(theta.moved(&Step::new(vec![4.0, 8.0]), 0.0), theta);
    }
}
