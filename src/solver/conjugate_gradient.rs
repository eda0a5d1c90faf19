//! Conjugate gradient for `A x = b`, where `A` is known by its products (Hestenes and Stiefel,
//! 1952).

use super::{LinearOperator, dot};

/// When to stop the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// The most products.
    pub iterations: usize,
    /// Stop once the residual's norm is at or below this fraction of the right-hand side's.
    pub relative_residual: f64,
}

/// Why [`solve`] stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// The residual is as small as [`Limits::relative_residual`] asks, or the right-hand side is
    /// zero.
    Converged,
    /// [`Limits::iterations`] products are spent.
    IterationLimit,
    /// A direction `p` of the search had `p.Ap` at or below 0 or not finite. The operator is not
    /// positive definite, or the right-hand side is not finite, or only rounding is left of the
    /// residual.
    Breakdown {
        /// `p.Ap`.
        curvature: f64,
    },
}

/// The result of [`solve`].
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The approximate solution `[dim]`. Conjugate gradient leaves a residual orthogonal to it, so
    /// `x.Ax` is `x.rhs` (up to f32 rounding) however early it stopped: that quadratic form costs a
    /// dot product, not an operator product.
    pub x: Vec<f32>,
    /// Products taken.
    pub iterations: usize,
    /// The residual's norm relative to the right-hand side's, as the recursion has it; 0 for a zero
    /// right-hand side.
    pub relative_residual: f64,
    /// Why it stopped.
    pub stop: Stop,
}

/// The approximate solution of `operator x = rhs`, starting from zero, with one product an
/// iteration. A zero right-hand side gives zero without a product; a breakdown gives the last sound
/// `x`.
pub fn solve(operator: &mut dyn LinearOperator, rhs: &[f32], limits: Limits) -> Solution {
    debug_assert_eq!(rhs.len(), operator.dim());
    let mut x = vec![0.0f32; rhs.len()];
    let initial = dot(rhs, rhs);
    // The residual relative to zero would be NaN.
    if initial == 0.0 {
        return Solution {
            x,
            iterations: 0,
            relative_residual: 0.0,
            stop: Stop::Converged,
        };
    }
    let enough = limits.relative_residual * limits.relative_residual;
    let mut residual = rhs.to_vec();
    let mut direction = rhs.to_vec();
    let mut product = vec![0.0f32; rhs.len()];
    let mut squared = initial;
    let mut iterations = 0;
    let stop = loop {
        // Asked before the limit, so that the last iteration that is allowed can still converge.
        if squared / initial <= enough {
            break Stop::Converged;
        }
        if iterations == limits.iterations {
            break Stop::IterationLimit;
        }
        operator.apply(&direction, &mut product);
        iterations += 1;
        let curvature = dot(&direction, &product);
        // Written so that NaN is a breakdown too.
        if !(curvature > 0.0 && curvature.is_finite()) {
            break Stop::Breakdown { curvature };
        }
        let length = squared / curvature;
        add_scaled(&mut x, length as f32, &direction);
        // Followed along with x: computing it from x would take a second product.
        add_scaled(&mut residual, -length as f32, &product);
        let next = dot(&residual, &residual);
        let conjugation = (next / squared) as f32;
        for (p, &r) in direction.iter_mut().zip(&residual) {
            *p = r + conjugation * *p;
        }
        squared = next;
    };
    Solution {
        x,
        iterations,
        relative_residual: (squared / initial).sqrt(),
        stop,
    }
}

/// `y += a x`.
fn add_scaled(y: &mut [f32], a: f32, x: &[f32]) {
    for (y, &x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A dense matrix, row by row, that counts its products.
    struct Dense {
        rows: Vec<Vec<f32>>,
        products: usize,
    }

    impl Dense {
        fn new(rows: Vec<Vec<f32>>) -> Self {
            Self { rows, products: 0 }
        }

        /// `M M^T + I` of a square matrix: positive definite.
        fn from_factor(factor: &[Vec<f32>]) -> Self {
            let entry = |i: usize, j: usize| {
                dot(&factor[i], &factor[j]) as f32 + f32::from(u8::from(i == j))
            };
            Self::new(
                (0..factor.len())
                    .map(|i| (0..factor.len()).map(|j| entry(i, j)).collect())
                    .collect(),
            )
        }
    }

    impl LinearOperator for Dense {
        fn dim(&self) -> usize {
            self.rows.len()
        }

        fn apply(&mut self, x: &[f32], product: &mut [f32]) {
            self.products += 1;
            product
                .iter_mut()
                .zip(&self.rows)
                .for_each(|(y, row)| *y = dot(row, x) as f32);
        }
    }

    const EXACT: Limits = Limits {
        iterations: 100,
        relative_residual: 1e-6,
    };

    #[test]
    fn a_direction_without_positive_curvature_stops_with_what_it_has() {
        let mut negative = Dense::new(vec![vec![-1.0, 0.0], vec![0.0, -1.0]]);
        let solution = solve(&mut negative, &[3.0, 4.0], EXACT);
        assert_eq!(solution.stop, Stop::Breakdown { curvature: -25.0 });
        assert_eq!(
            (solution.x, solution.iterations, solution.relative_residual),
            (vec![0.0, 0.0], 1, 1.0)
        );
        // The first direction (1, 1) has curvature 1; the second meets the negative one: the
        // first's share stays.
        let mut indefinite = Dense::new(vec![vec![2.0, 0.0], vec![0.0, -1.0]]);
        let solution = solve(&mut indefinite, &[1.0, 1.0], EXACT);
        assert!(matches!(solution.stop, Stop::Breakdown { curvature } if curvature < 0.0));
        assert_eq!((solution.x, solution.iterations), (vec![2.0, 2.0], 2));
    }

    #[test]
    fn a_product_or_right_hand_side_that_is_not_finite_stops_it() {
        let mut broken = Dense::new(vec![vec![f32::NAN]]);
        let solution = solve(&mut broken, &[1.0], EXACT);
        assert!(matches!(solution.stop, Stop::Breakdown { curvature } if curvature.is_nan()));
        assert_eq!(solution.x, [0.0]);
        let mut identity = Dense::new(vec![vec![1.0]]);
        for bad in [f32::NAN, f32::INFINITY] {
            let solution = solve(&mut identity, &[bad], EXACT);
            assert!(matches!(solution.stop, Stop::Breakdown { .. }), "{bad}");
        }
    }

    #[test]
    fn a_zero_right_hand_side_takes_no_product() {
        let mut identity = Dense::new(vec![vec![1.0, 0.0], vec![0.0, 1.0]]);
        let solution = solve(&mut identity, &[0.0, 0.0], EXACT);
        assert_eq!(
            (solution.x, solution.iterations, solution.stop),
            (vec![0.0, 0.0], 0, Stop::Converged)
        );
        assert_eq!((solution.relative_residual, identity.products), (0.0, 0));
    }

    #[test]
    fn it_takes_no_more_products_than_allowed_and_says_what_is_left() {
        let diagonal = |i: usize| {
            (0..8)
                .map(|j| if i == j { (i + 1) as f32 } else { 0.0 })
                .collect()
        };
        let mut operator = Dense::new((0..8).map(diagonal).collect());
        let rhs = [1.0; 8];
        for iterations in 0..8 {
            operator.products = 0;
            let solution = solve(
                &mut operator,
                &rhs,
                Limits {
                    iterations,
                    relative_residual: 0.0,
                },
            );
            assert_eq!(
                (solution.iterations, operator.products, solution.stop),
                (iterations, iterations, Stop::IterationLimit)
            );
            let left: f64 = (0..8)
                .map(|i| f64::from(1.0 - (i + 1) as f32 * solution.x[i]).powi(2))
                .sum();
            assert!((solution.relative_residual - (left / 8.0).sqrt()).abs() < 1e-6);
            // What `Solution::x` promises of an early stop.
            let quadratic: f64 = (0..8)
                .map(|i| (i + 1) as f64 * f64::from(solution.x[i]).powi(2))
                .sum();
            assert!((quadratic - dot(&rhs, &solution.x)).abs() < 1e-6);
        }
    }

    #[test]
    fn it_stops_at_the_residual_asked_for() {
        let diagonal = |i: usize| {
            (0..8)
                .map(|j| if i == j { (i + 1) as f32 } else { 0.0 })
                .collect()
        };
        let mut operator = Dense::new((0..8).map(diagonal).collect());
        let solution = solve(
            &mut operator,
            &[1.0; 8],
            Limits {
                iterations: 8,
                relative_residual: 0.1,
            },
        );
        assert_eq!(solution.stop, Stop::Converged);
        assert!(solution.relative_residual <= 0.1 && solution.iterations < 8);
    }

    proptest! {
        #[test]
        fn it_solves_positive_definite_systems(
            factor in prop::collection::vec(prop::collection::vec(-1.0f32..1.0, 6), 6),
            x in prop::collection::vec(-1.0f32..1.0, 6),
        ) {
            let mut operator = Dense::from_factor(&factor);
            let mut rhs = vec![0.0; 6];
            operator.apply(&x, &mut rhs);
            let solution = solve(&mut operator, &rhs, EXACT);
            // Eigenvalues lie in [1, 13], so the error of x is at most 13 times the residual's
            // 1e-6, plus f32 rounding.
            for (found, wanted) in solution.x.iter().zip(&x) {
                prop_assert!((found - wanted).abs() < 1e-4, "{solution:?} for {x:?}");
            }
        }
    }
}
