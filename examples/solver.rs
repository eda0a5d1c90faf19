//! The problem inside one step of MCPO, without reinforcement learning: the least `g.x` under `b.x
//! <= c` and `x.Hx/2 <= delta`.
//!
//!     cargo run --release --example solver
//!
//! Each row is another slack c, and so another case of the dual. The last column is found without
//! the dual, by looking at a million points of the ball's surface, where the optimum of a linear
//! function must lie.

#![expect(clippy::print_stdout, reason = "an example shows what it finds")]

use std::f64::consts::TAU;

use mcpo_run::solver::{
    LinearConstraint, LinearOperator, conjugate_gradient::Limits, constrained_step, dot,
};

/// The diagonal of H, in place of a Fisher matrix: a solver asks for its products alone.
const CURVATURES: [f32; 2] = [1.0, 4.0];
/// The gradient of what is minimised; in MCPO, of the surrogate loss.
const G: [f32; 2] = [1.0, 2.0];
/// The gradient of what is bounded; in MCPO, of the MMD^2 to the demonstration.
const B: [f32; 2] = [-1.0, 0.5];
/// The radius: in MCPO, the bound on the mean KL.
const DELTA: f64 = 0.5;

struct Diagonal;

impl LinearOperator for Diagonal {
    fn dim(&self) -> usize {
        CURVATURES.len()
    }

    fn apply(&mut self, x: &[f32], product: &mut [f32]) {
        for (i, curvature) in CURVATURES.iter().enumerate() {
            product[i] = curvature * x[i];
        }
    }
}

/// Shows every case.
pub fn main() {
    println!(
        "{:>6} {:>12} {:>7} {:>7} {:>17} {:>8} {:>8}",
        "c", "case", "lambda", "nu", "x", "g.x", "searched"
    );
    for slack in [1.5, 0.3, -0.5, -1.2] {
        show(slack);
    }
}

fn show(slack: f64) {
    let constraint = LinearConstraint {
        gradient: &B,
        slack,
    };
    let limits = Limits {
        iterations: 10,
        relative_residual: 1e-7,
    };
    let found = constrained_step(&mut Diagonal, &G, Some(constraint), DELTA, limits);
    let searched = search(slack);
    let case = found.solution.name();
    let (Some(step), Some((lambda, nu))) = (&found.step, found.solution.multipliers()) else {
        println!(
            "{slack:6.2} {case:>12}: no point of the ball meets the constraint, so MCPO recovers instead"
        );
        assert_eq!(searched, None);
        return;
    };
    let x = step.as_slice();
    let searched = searched.expect("a point near the optimum is feasible");
    let shown = format!("({:.4}, {:.4})", x[0], x[1]);
    println!(
        "{slack:6.2} {case:>12} {lambda:7.4} {nu:7.4} {shown:>17} {:8.4} {searched:8.4}",
        dot(&G, x)
    );

    let mut product = [0.0; 2];
    Diagonal.apply(x, &mut product);
    assert!(dot(&B, x) <= slack + 1e-6, "the linear constraint");
    assert!(dot(x, &product) / 2.0 <= DELTA + 1e-6, "the ball");
    for i in 0..2 {
        // Karush, Kuhn and Tucker: g + lambda H x + nu b = 0 at the optimum.
        let gradient = f64::from(G[i]) + lambda * f64::from(product[i]) + nu * f64::from(B[i]);
        assert!(gradient.abs() < 1e-5, "stationarity: {gradient}");
    }
    assert!((dot(&G, x) - searched).abs() < 1e-4, "the search agrees");
}

/// The least `g.x` over a million points of the ball's surface that meet the constraint; `None`
/// where none does.
fn search(slack: f64) -> Option<f64> {
    let points = 1_000_000;
    let surface = (0..points).map(|i| {
        let angle = TAU * f64::from(i) / f64::from(points);
        let along = |direction: f64, curvature: f32| {
            (2.0 * DELTA / f64::from(curvature)).sqrt() * direction
        };
        [
            along(angle.cos(), CURVATURES[0]),
            along(angle.sin(), CURVATURES[1]),
        ]
    });
    let times = |v: &[f32; 2], x: &[f64; 2]| f64::from(v[0]) * x[0] + f64::from(v[1]) * x[1];
    surface
        .filter(|x| times(&B, x) <= slack)
        .map(|x| times(&G, &x))
        .min_by(f64::total_cmp)
}
