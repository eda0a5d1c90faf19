//! The constrained problem as a user of the library meets it: random problems of every case,
//! against optima found without the dual.
//!
//! In the coordinates `y = L^T x` of a Cholesky factor `H = L L^T` the quadratic constraint is a
//! ball, so the least of a linear function over ball and half-space is either where the function is
//! least on the sphere, or on the circle where boundary and sphere meet: two points to compare in
//! the plane of both vectors. A sweep of that plane and random points of the whole ball, neither of
//! which knows this, guard the reasoning.

use mcpo_run::solver::{
    self, LinearConstraint, LinearOperator,
    conjugate_gradient::Limits,
    dual::{DualProblem, DualSolution, solve},
};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

type Vector = Vec<f64>;
type Matrix = Vec<Vector>;

/// Minimise `g.x` subject to `b.x <= slack` and `x.Hx/2 <= radius`, in full.
struct Problem {
    factor: Matrix, // L
    g: Vector,
    b: Vector,
    slack: f64,
    radius: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn uniform(rng: &mut impl Rng) -> f64 {
    rng.random_range(-1.0..1.0)
}

impl Problem {
    /// A problem in 1 to 6 dimensions; the boundary lies at `distance` times the ball's radius from
    /// the origin.
    fn random(rng: &mut impl Rng, distance: f64) -> Self {
        let n = rng.random_range(1..=6);
        let entry = |i: usize, j: usize, rng: &mut _| match i.cmp(&j) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => 10f64.powf(uniform(rng)),
            std::cmp::Ordering::Greater => uniform(rng),
        };
        let factor: Matrix = (0..n)
            .map(|i| (0..n).map(|j| entry(i, j, rng)).collect())
            .collect();
        let g: Vector = (0..n).map(|_| uniform(rng)).collect();
        let b: Vector = (0..n).map(|_| uniform(rng)).collect();
        let mut problem = Self {
            factor,
            g,
            b,
            slack: 0.0,
            radius: 10f64.powf(3.0 * uniform(rng)),
        };
        problem.place(distance);
        problem
    }

    fn place(&mut self, distance: f64) {
        let b = self.in_ball(&self.b);
        self.slack = distance * self.reach() * dot(&b, &b).sqrt();
    }

    /// The ball's radius in the coordinates `y`.
    fn reach(&self) -> f64 {
        (2.0 * self.radius).sqrt()
    }

    /// `L^-1 v`: what `v.x` is the product of with `y`.
    fn in_ball(&self, v: &[f64]) -> Vector {
        let mut y: Vector = Vec::new();
        for (i, row) in self.factor.iter().enumerate() {
            y.push((v[i] - dot(&row[..i], &y)) / row[i]);
        }
        y
    }

    /// `H^-1 v = L^-T L^-1 v`.
    fn inverse(&self, v: &[f64]) -> Vector {
        let n = v.len();
        let mut x = self.in_ball(v);
        for i in (0..n).rev() {
            x[i] = (x[i] - (i + 1..n).map(|k| self.factor[k][i] * x[k]).sum::<f64>())
                / self.factor[i][i];
        }
        x
    }

    fn quadratic(&self, x: &[f64]) -> f64 {
        let n = x.len();
        let y: Vector = (0..n)
            .map(|j| (j..n).map(|i| self.factor[i][j] * x[i]).sum())
            .collect();
        dot(&y, &y) / 2.0
    }

    fn scalars(&self) -> DualProblem {
        let (u, w) = (self.inverse(&self.g), self.inverse(&self.b));
        let (q, r, s) = (dot(&self.g, &u), dot(&self.g, &w), dot(&self.b, &w));
        DualProblem {
            q,
            r,
            s,
            slack: self.slack,
            radius: self.radius,
        }
    }

    /// The step that a solution stands for, or `None`.
    fn step(&self, solution: &DualSolution) -> Option<Vector> {
        let (alpha, beta) = solution.coefficients()?;
        let (u, w) = (self.inverse(&self.g), self.inverse(&self.b));
        let x: Vector = u
            .iter()
            .zip(&w)
            .map(|(u, w)| alpha * u + beta * w)
            .collect();
        if let Some((lambda, nu)) = solution.multipliers() {
            for ((x, u), w) in x.iter().zip(&u).zip(&w) {
                let from_multipliers = -(u + nu * w) / lambda;
                assert!(
                    (x - from_multipliers).abs() <= 1e-9 * (x.abs() + (u / lambda).abs()),
                    "{solution:?}"
                );
            }
        }
        Some(x)
    }

    /// The signed distance of the boundary from the origin, in the coordinates `y`.
    fn boundary(&self) -> f64 {
        let b = self.in_ball(&self.b);
        match dot(&b, &b).sqrt() {
            0.0 if self.slack >= 0.0 => f64::INFINITY,
            0.0 => f64::NEG_INFINITY,
            length => self.slack / length,
        }
    }

    /// The least `g.x`, by the candidates of the module's docs, where a point satisfies both
    /// constraints.
    fn optimum(&self) -> f64 {
        let ((g1, g2), boundary, reach) = (self.plane(), self.boundary(), self.reach());
        let length = g1.hypot(g2);
        if length == 0.0 || -reach * g1 / length <= boundary {
            return -reach * length;
        }
        let half_chord = (reach * reach - boundary * boundary).max(0.0).sqrt();
        (boundary * g1 - half_chord * g2).min(boundary * g1 + half_chord * g2)
    }

    /// g in the plane of both vectors: its part along b, and its part across.
    fn plane(&self) -> (f64, f64) {
        let (g, b) = (self.in_ball(&self.g), self.in_ball(&self.b));
        let length = dot(&b, &b).sqrt();
        let along = if length > 0.0 {
            dot(&g, &b) / length
        } else {
            0.0
        };
        let across: Vector = g
            .iter()
            .zip(&b)
            .map(|(g, b)| {
                if length > 0.0 {
                    g - along * b / length
                } else {
                    *g
                }
            })
            .collect();
        (along, dot(&across, &across).sqrt())
    }

    /// Checks that the solution's step is feasible and as good as the optimum, and returns the
    /// solution.
    fn check(&self, rng: &mut impl Rng) -> DualSolution {
        let solution = solve(&self.scalars());
        let (g, b, reach) = (self.in_ball(&self.g), self.in_ball(&self.b), self.reach());
        let (g_range, b_range) = (reach * dot(&g, &g).sqrt(), reach * dot(&b, &b).sqrt());
        // A ball that only touches the half-space may count as either.
        let touching = 1e-12 * reach;
        let Some(x) = self.step(&solution) else {
            assert!(
                self.boundary() <= -reach + touching,
                "{solution:?} for {:?}",
                self.scalars()
            );
            return solution;
        };
        assert!(
            self.boundary() >= -reach - touching,
            "{solution:?} for {:?}",
            self.scalars()
        );
        // The step is a difference; where g and b are nearly parallel, of large numbers.
        let (alpha, beta) = solution.coefficients().expect("a step was found");
        let lost = 1e-13 * (alpha * dot(&g, &g).sqrt()).hypot(beta * dot(&b, &b).sqrt()) / reach;
        let (found, linear) = (dot(&self.g, &x), dot(&self.b, &x));
        assert!(
            linear <= self.slack + (1e-9 + lost) * b_range,
            "half-space: {solution:?} for {:?}",
            self.scalars()
        );
        assert!(
            self.quadratic(&x) <= self.radius * (1.0 + 1e-9),
            "ball: {solution:?} for {:?}",
            self.scalars()
        );
        let optimum = self.optimum();
        assert!(
            (found - optimum).abs() <= 1e-6 * g_range,
            "{found}, not {optimum}: {solution:?} for {:?}",
            self.scalars()
        );
        // No feasible point is better: first of the plane's circle, then of the whole ball.
        let ((g1, g2), b1) = (self.plane(), dot(&b, &b).sqrt());
        for turn in 0..400 {
            let (sine, cosine) = (f64::from(turn) * std::f64::consts::TAU / 400.0).sin_cos();
            let feasible = reach * b1 * cosine <= self.slack;
            assert!(
                !feasible || reach * (g1 * cosine + g2 * sine) >= found - 1e-9 * g_range,
                "{solution:?}"
            );
        }
        for _ in 0..40 {
            let direction: Vector = g.iter().map(|_| uniform(rng)).collect();
            let scale = reach * rng.random_range(0.0..1.0) / dot(&direction, &direction).sqrt();
            let y: Vector = direction.iter().map(|d| scale * d).collect();
            assert!(
                dot(&b, &y) > self.slack || dot(&g, &y) >= found - 1e-9 * g_range,
                "{solution:?}"
            );
        }
        solution
    }
}

const PROBLEMS: usize = 3000;

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(11)
}

/// Random problems until `PROBLEMS` of them had the case `name`, each checked, whatever its case.
fn check_until(name: &str, mut problem: impl FnMut(&mut ChaCha8Rng) -> Problem) {
    let mut rng = rng();
    let mut met = 0;
    for _ in 0..20 * PROBLEMS {
        let problem = problem(&mut rng);
        met += usize::from(problem.check(&mut rng).name() == name);
        if met == PROBLEMS {
            return;
        }
    }
    panic!("only {met} problems of the case {name}");
}

fn anywhere(rng: &mut impl Rng, distances: std::ops::Range<f64>) -> Problem {
    let distance = rng.random_range(distances);
    Problem::random(rng, distance)
}

#[test]
fn inactive() {
    check_until("inactive", |rng| anywhere(rng, 0.0..1.5));
}

#[test]
fn active() {
    check_until("active", |rng| anywhere(rng, 0.0..1.0));
}

#[test]
fn active_through_the_origin() {
    check_until("active", |rng| Problem::random(rng, 0.0));
}

#[test]
fn recoverable() {
    check_until("recoverable", |rng| anywhere(rng, -1.0..0.0));
}

#[test]
fn infeasible() {
    check_until("infeasible", |rng| anywhere(rng, -3.0..-1.0));
}

#[test]
fn without_a_direction_of_the_constraint() {
    for (name, slack) in [
        ("degenerate_b", 0.0),
        ("degenerate_b", 0.3),
        ("infeasible", -0.3),
    ] {
        check_until(name, |rng| {
            let mut problem = Problem::random(rng, 0.0);
            problem.b.fill(0.0);
            Problem { slack, ..problem }
        });
    }
}

#[test]
fn without_a_direction_of_the_objective() {
    for distances in [-1.0..0.0, 0.0..2.0] {
        check_until("degenerate_g", |rng| {
            let mut problem = anywhere(rng, distances.clone());
            problem.g.fill(0.0);
            problem
        });
    }
}

#[test]
fn gradients_that_are_parallel_or_nearly() {
    let parallel = |rng: &mut ChaCha8Rng, distances| {
        let mut problem = anywhere(rng, distances);
        let (factor, off) = (uniform(rng), 10f64.powf(rng.random_range(-18.0..-3.0)));
        problem.b = problem
            .g
            .iter()
            .map(|g| factor * g + off * uniform(rng))
            .collect();
        let reach = (2.0 * problem.radius).sqrt();
        problem.place(problem.slack / reach);
        problem
    };
    check_until("inactive", |rng| parallel(rng, 0.0..1.0));
    check_until("active", |rng| parallel(rng, 0.0..1.0));
    check_until("recoverable", |rng| parallel(rng, -1.0..0.0));
}

#[test]
fn boundaries_that_nearly_touch_the_ball() {
    let touching = |rng: &mut ChaCha8Rng, side: f64| {
        let off = 10f64.powf(rng.random_range(-17.0..-3.0));
        Problem::random(rng, side * (1.0 - off))
    };
    check_until("recoverable", |rng| touching(rng, -1.0));
    check_until("inactive", |rng| touching(rng, 1.0));
}

/// Conjugate gradient sees the matrix as products alone.
struct Products(Matrix);

impl LinearOperator for Products {
    fn dim(&self) -> usize {
        self.0.len()
    }

    fn apply(&mut self, x: &[f32], product: &mut [f32]) {
        let n = x.len();
        let transposed: Vector = (0..n)
            .map(|j| (j..n).map(|i| self.0[i][j] * f64::from(x[i])).sum())
            .collect();
        product
            .iter_mut()
            .zip(&self.0)
            .for_each(|(p, row)| *p = dot(row, &transposed) as f32);
    }
}

#[test]
fn the_constrained_step_is_the_optimum_within_f32() {
    let mut rng = rng();
    let limits = Limits {
        iterations: 60,
        relative_residual: 1e-7,
    };
    for _ in 0..PROBLEMS {
        let problem = anywhere(&mut rng, -0.9..1.2);
        let single = |v: &[f64]| v.iter().map(|&x| x as f32).collect::<Vec<f32>>();
        let (g, b) = (single(&problem.g), single(&problem.b));
        let constraint = LinearConstraint {
            gradient: &b,
            slack: problem.slack,
        };
        let mut hessian = Products(problem.factor.clone());
        let found =
            solver::constrained_step(&mut hessian, &g, Some(constraint), problem.radius, limits);
        let optimum = problem.optimum();
        let range = (2.0 * problem.radius * problem.scalars().q).sqrt();
        // Condition numbers reach 1e4 here, and where the chord is short the objective goes with
        // the root of an error.
        assert!(
            (found.objective_change - optimum).abs() < 0.01 * range,
            "{found:?} but {optimum}"
        );
        let x: Vector = found
            .step
            .expect("a step")
            .as_slice()
            .iter()
            .map(|&x| f64::from(x))
            .collect();
        let reach = (2.0 * problem.radius * problem.scalars().s).sqrt();
        assert!(
            dot(&problem.b, &x) <= problem.slack + 1e-3 * reach,
            "{:?}",
            found.solution
        );
        assert!(
            problem.quadratic(&x) <= 1.02 * problem.radius,
            "{:?}",
            found.solution
        );
    }
}
