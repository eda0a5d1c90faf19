//! The constrained step: from vectors and an operator to the optimum of Eq. 5, by conjugate
//! gradient and the dual.

use super::{
    LinearOperator, Step, conjugate_gradient,
    conjugate_gradient::{Limits, Stop},
    dot,
    dual::{self, DualSolution},
    line_search::WayBack,
};

/// `b.x <= slack`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearConstraint<'a> {
    /// `b` (`[dim]`), the gradient of what is bounded.
    pub gradient: &'a [f32],
    /// `c`: how much the constrained quantity may still grow; negative when the bound is violated.
    pub slack: f64,
}

/// The result of [`constrained_step`].
#[derive(Debug, Clone, PartialEq)]
pub struct ConstrainedStep {
    /// The optimum `x` (`[dim]`): zero if the optimum is to stay, `None` if there is no step
    /// (infeasible or undefined).
    pub step: Option<Step>,
    /// The case with its multipliers.
    pub solution: DualSolution,
    /// `q = g.H^-1 g`.
    pub q: f64,
    /// `r = b.H^-1 g`; 0 without a linear constraint.
    pub r: f64,
    /// `s = b.H^-1 b`; `None` if the optimum does not depend on it: without a constraint, if the
    /// solution without the constraint meets it, or if `g` is zero and the origin feasible.
    pub s: Option<f64>,
    /// `w = H^-1 b` with s; `None` if s is.
    pub way_back: Option<WayBack>,
    /// `g.x`, the linear change of the objective under the whole step, 0 or below unless a violated
    /// constraint must be met; 0 without a step.
    pub objective_change: f64,
    /// Products taken by conjugate gradient, both solutions together.
    pub products: usize,
}

/// Minimises `g.x` subject to `b.x <= slack` and `x.Hx/2 <= radius` (Eq. 5; `g` and `b` `[dim]`,
/// radius finite and above 0); without a linear constraint, subject to the second alone.
///
/// `H^-1 b` is solved for only if the optimum depends on it, see [`ConstrainedStep::s`]. Where
/// conjugate gradient stops early, `x` is made of inexact solutions: `b.x` is exact all the same,
/// since `r` is taken as `b.(H^-1 g)`, while `x.Hx/2` is exact where the constraint is inactive and
/// else a few percent off (measured: within 6 % of the radius after 10 iterations at condition
/// numbers where 10 leave a quarter of the residual). It is not scaled back: a line search that
/// tests the true quantities follows. A Hessian with no positive curvature along `g` or `b` makes
/// the problem [`Undefined`](DualSolution::Undefined).
pub fn constrained_step(
    hessian: &mut dyn LinearOperator,
    objective: &[f32],
    constraint: Option<LinearConstraint<'_>>,
    radius: f64,
    limits: Limits,
) -> ConstrainedStep {
    let u = Inverse::of(hessian, objective, limits);
    let mut w = None;
    let (r, slack) = constraint.map_or((0.0, f64::INFINITY), |b| {
        (dot(b.gradient, &u.vector), b.slack)
    });
    let solution = dual::solve_lazily(u.square, r, slack, radius, || {
        let b = constraint
            .expect("without a constraint the slack is infinite, and s is not asked for")
            .gradient;
        w.insert(Inverse::of(hessian, b, limits)).square
    });
    let step = solution.coefficients().map(|(alpha, beta)| match &w {
        Some(w) => u
            .vector
            .iter()
            .zip(&w.vector)
            .map(|(&u, &w)| sum(alpha, u, beta, w))
            .collect(),
        None => u.vector.iter().map(|&u| sum(alpha, u, 0.0, 0.0)).collect(),
    });
    let step = step.map(Step::new);
    ConstrainedStep {
        objective_change: step.as_ref().map_or(0.0, |x| dot(objective, x.as_slice())),
        step,
        solution,
        q: u.square,
        r,
        s: w.as_ref().map(|w| w.square),
        products: u.products + w.as_ref().map_or(0, |w| w.products),
        way_back: w.map(Inverse::into_way_back),
    }
}

/// `w = H^-1 b`: of all ways that change b's constraint, the shortest in H's norm.
pub fn way_back(hessian: &mut dyn LinearOperator, b: &[f32], limits: Limits) -> WayBack {
    Inverse::of(hessian, b, limits).into_way_back()
}

/// `alpha u + beta w`, in f64: if g and b are nearly parallel, the two terms cancel.
fn sum(alpha: f64, u: f32, beta: f64, w: f32) -> f32 {
    (alpha * f64::from(u) + beta * f64::from(w)) as f32
}

/// `H^-1 v` with `v.H^-1 v`.
struct Inverse {
    vector: Vec<f32>,
    square: f64,
    products: usize,
}

impl Inverse {
    fn of(hessian: &mut dyn LinearOperator, v: &[f32], limits: Limits) -> Self {
        let solved = conjugate_gradient::solve(hessian, v, limits);
        // A breakdown at the first product leaves zero, which would look like the solution of v =
        // 0.
        let square = match solved.stop {
            Stop::Breakdown { .. } if solved.iterations == 1 => f64::NAN,
            _ => dot(v, &solved.x),
        };
        Self {
            vector: solved.x,
            square,
            products: solved.iterations,
        }
    }

    fn into_way_back(self) -> WayBack {
        WayBack {
            direction: Step::new(self.vector),
            slope: self.square,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A diagonal matrix that counts its products.
    struct Diagonal(Vec<f32>, usize);

    impl LinearOperator for Diagonal {
        fn dim(&self) -> usize {
            self.0.len()
        }

        fn apply(&mut self, x: &[f32], product: &mut [f32]) {
            self.1 += 1;
            product
                .iter_mut()
                .zip(&self.0)
                .zip(x)
                .for_each(|((y, &d), &x)| *y = d * x);
        }
    }

    const LIMITS: Limits = Limits {
        iterations: 10,
        relative_residual: 1e-7,
    };

    fn hessian() -> Diagonal {
        Diagonal(vec![1.0, 4.0], 0)
    }

    fn step(found: &ConstrainedStep) -> &[f32] {
        found.step.as_ref().expect("there is a step").as_slice()
    }

    #[test]
    fn an_operator_that_is_not_positive_definite_gives_no_step() {
        for entry in [0.0, -1.0, f32::NAN] {
            let found = constrained_step(&mut Diagonal(vec![entry], 0), &[1.0], None, 0.5, LIMITS);
            assert_eq!(
                (&found.solution, &found.step),
                (&DualSolution::Undefined, &None),
                "{entry}"
            );
            assert!(found.q.is_nan());
        }
        let mut broken_along_b = Diagonal(vec![1.0, f32::NAN], 0);
        let b = LinearConstraint {
            gradient: &[1.0, 1.0],
            slack: -0.5,
        };
        let found = constrained_step(&mut broken_along_b, &[0.0, 0.0], Some(b), 0.5, LIMITS);
        assert_eq!(found.solution, DualSolution::Undefined);
    }

    #[test]
    fn a_gradient_that_is_not_finite_gives_no_step() {
        let found = constrained_step(&mut hessian(), &[f32::NAN, 0.0], None, 0.5, LIMITS);
        assert_eq!(
            (found.solution, found.step),
            (DualSolution::Undefined, None)
        );
        let b = LinearConstraint {
            gradient: &[f32::NAN, 0.0],
            slack: 1.0,
        };
        let found = constrained_step(&mut hessian(), &[1.0, 0.0], Some(b), 0.5, LIMITS);
        assert_eq!(
            (found.solution, found.step),
            (DualSolution::Undefined, None)
        );
    }

    #[test]
    fn an_infeasible_problem_has_its_scalars_and_no_step() {
        let b = LinearConstraint {
            gradient: &[1.0, 0.0],
            slack: -1.5,
        };
        let found = constrained_step(&mut hessian(), &[1.0, 0.0], Some(b), 0.5, LIMITS);
        assert_eq!(
            (found.solution, found.step, found.objective_change),
            (DualSolution::Infeasible, None, 0.0)
        );
        assert_eq!((found.q, found.r, found.s), (1.0, 1.0, Some(1.0)));
    }

    #[test]
    fn without_a_constraint_the_step_ends_on_the_ball() {
        let mut hessian = hessian();
        let found = constrained_step(&mut hessian, &[0.0, 2.0], None, 0.5, LIMITS);
        assert_eq!(found.solution, DualSolution::Inactive { lambda: 1.0 });
        assert_eq!(step(&found), [0.0, -0.5]);
        assert_eq!(
            (found.q, found.r, found.s, found.objective_change),
            (1.0, 0.0, None, -1.0)
        );
        assert_eq!((found.products, hessian.1), (1, 1));
    }

    #[test]
    fn an_inactive_constraint_costs_no_product() {
        let mut hessian = hessian();
        let b = LinearConstraint {
            gradient: &[1.0, 1.0],
            slack: 0.0,
        };
        let found = constrained_step(&mut hessian, &[0.0, 2.0], Some(b), 0.5, LIMITS);
        assert_eq!(
            (found.solution, found.r, found.s),
            (DualSolution::Inactive { lambda: 1.0 }, 0.5, None)
        );
        assert_eq!((found.products, hessian.1), (1, 1));
    }

    #[test]
    fn an_active_constraint_is_met_exactly() {
        // In the coordinates sqrt(H) x the ball is the unit circle, g = (1, 1), b = (-1, 0), and x1
        // >= -0.6 there.
        let b = LinearConstraint {
            gradient: &[-1.0, 0.0],
            slack: 0.6,
        };
        let found = constrained_step(&mut hessian(), &[1.0, 2.0], Some(b), 0.5, LIMITS);
        assert_eq!(found.solution.name(), "active");
        let x = step(&found);
        assert!(
            (x[0] + 0.6).abs() < 1e-6 && (x[1] + 0.4).abs() < 1e-6,
            "{x:?}"
        );
        assert!((found.objective_change + 1.4).abs() < 1e-6);
    }

    #[test]
    fn parallel_gradients_stay_inside_the_ball() {
        // u and w differ by f32 rounding alone, which the division by lambda must not blow up into
        // a direction.
        let n = 1000;
        let mut hessian = Diagonal(
            (0..n).map(|i| 1.0 + (i as f32 * 0.7).sin().abs()).collect(),
            0,
        );
        let g: Vec<f32> = (0..n).map(|i| (i as f32).sin()).collect();
        let b: Vec<f32> = g.iter().map(|g| -0.3 * g).collect();
        let limits = Limits {
            iterations: 30,
            relative_residual: 1e-7,
        };
        let unit = constrained_step(&mut hessian, &b, None, 0.5, limits)
            .q
            .sqrt();
        for distance in [-0.5, 0.0, 0.5] {
            let constraint = LinearConstraint {
                gradient: &b,
                slack: distance * unit,
            };
            let found = constrained_step(&mut hessian, &g, Some(constraint), 0.5, limits);
            let x = step(&found);
            let mut product = vec![0.0; n];
            hessian.apply(x, &mut product);
            assert!(
                dot(x, &product) <= 1.01,
                "{distance}: {:?}, x.Hx = {}",
                found.solution,
                dot(x, &product)
            );
            assert!(
                (dot(&b, x) / unit - distance).abs() < 1e-3,
                "{distance}: b.x = {}",
                dot(&b, x) / unit
            );
        }
    }
}
