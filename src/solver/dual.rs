//! The dual of the two-constraint problem (appendix, Eq. 5 to 14, with Eq. 11 corrected).
//!
//! Owns the optimum's multipliers, case by case, given five scalars. Does not know vectors or the
//! operator H: the caller composes the step from `H^-1 g` and `H^-1 b`. Start at [`solve`].
//!
//! The problem (Eq. 5): minimise `g.x` subject to `b.x <= c` and `x.Hx/2 <= delta`. In the norm of
//! H the second constraint is a ball of radius `sqrt(2 delta)` around the origin, the first a
//! half-space whose boundary lies at the signed distance `c / sqrt(s)`, so that everything happens
//! in the plane of `H^-1 g` and `H^-1 b`:
//!
//! 1. The solution without the half-space is `x = -H^-1 g / lambda`, `lambda = sqrt(q / (2
//!    delta))`. It is the optimum if it meets the half-space: `b.x = -r / lambda <= c`.
//! 2. Otherwise the optimum lies where boundary and sphere meet: `lambda = sqrt((q - r^2/s) / (2
//!    delta - c^2/s))` and `nu = -(lambda c + r) / s` (Eq. 10).
//! 3. They do not meet when `c^2/s >= 2 delta` (Eq. 14): the half-space holds the whole ball (`c >=
//!    0`) or nothing of it.
//!
//! Errata of the appendix that this module corrects: Eq. 11 prints `b.H^-1 g` where its square
//! belongs, which takes the root of a negative number in a quarter of random problems; its outer
//! `max{., 0}` says nothing, and its cases by `nu* = 0` and `nu* > 0` are circular, since `nu*`
//! needs `lambda*`; the order of the tests above replaces both. `s = 0` and `q = 0` are not covered
//! there.

/// Minimise `g.x` subject to `b.x <= slack` and `x.Hx/2 <= radius`, given by its scalars.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DualProblem {
    /// `g.H^-1 g`, 0 or above.
    pub q: f64,
    /// `g.H^-1 b`. By Cauchy and Schwarz `r^2 <= q s`; where an inexact `H^-1` breaks this, the
    /// excess counts as rounding.
    pub r: f64,
    /// `b.H^-1 b`, 0 or above.
    pub s: f64,
    /// `c`: how much the linear constraint may still grow; negative when it is violated.
    pub slack: f64,
    /// `delta`, finite and above 0.
    pub radius: f64,
}

/// The optimum, by case. In a case with both multipliers, the step is
/// `x = -(H^-1 g + nu H^-1 b) / lambda` (Eq. 8 and 12).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DualSolution {
    /// `c >= 0`, and the solution without the linear constraint meets it: Eq. 11, first line, `nu =
    /// 0`. The half-space that holds the whole ball (after Eq. 14) is of this case.
    Inactive {
        /// Multiplier of the quadratic constraint, above 0.
        lambda: f64,
    },
    /// `c >= 0`, and both constraints bind: Eq. 10 and the second line of Eq. 11, corrected.
    Active {
        /// Multiplier of the quadratic constraint, above 0.
        lambda: f64,
        /// Multiplier of the linear constraint, 0 or above.
        nu: f64,
    },
    /// `c < 0`, but the ball reaches the half-space (`c^2/s < 2 delta`, after Eq. 14): the origin
    /// is infeasible and the step is not. The closed forms are those of the two cases above.
    Recoverable {
        /// Multiplier of the quadratic constraint, above 0.
        lambda: f64,
        /// Multiplier of the linear constraint; 0 where the solution without the constraint happens
        /// to meet it.
        nu: f64,
    },
    /// `c < 0`, and no point of the ball meets the linear constraint: there is no step, and Eq. 13
    /// is to recover.
    Infeasible,
    /// `s = 0`: b is zero, so the linear constraint has no direction; with `c >= 0` it holds
    /// everywhere (with `c < 0` the problem is [`Infeasible`](DualSolution::Infeasible)). As
    /// [`Inactive`](DualSolution::Inactive); not in the appendix.
    DegenerateB {
        /// Multiplier of the quadratic constraint, above 0.
        lambda: f64,
    },
    /// `q = 0`: g is zero, as under a sparse reward that was never met, so every feasible point is
    /// an optimum. This is the one nearest to the origin, `x = nearest * H^-1 b` (Eq. 14), which no
    /// finite multipliers give; not in the appendix.
    DegenerateG {
        /// `min(c, 0) / s`: 0 where the origin is feasible.
        nearest: f64,
    },
    /// The scalars belong to no problem: one is NaN or infinite (an infinite slack apart), or `q`
    /// or `s` is negative, so that H is not positive definite. There is no step.
    Undefined,
}

impl DualSolution {
    /// `(lambda, nu)` of `x = -(H^-1 g + nu H^-1 b) / lambda`; `None` if there is no such step.
    pub fn multipliers(&self) -> Option<(f64, f64)> {
        match *self {
            Self::Inactive { lambda } | Self::DegenerateB { lambda } => Some((lambda, 0.0)),
            Self::Active { lambda, nu } | Self::Recoverable { lambda, nu } => Some((lambda, nu)),
            Self::DegenerateG { .. } | Self::Infeasible | Self::Undefined => None,
        }
    }

    /// `(alpha, beta)` of `x = alpha H^-1 g + beta H^-1 b`, for every case that has a step;
    /// `(0, 0)` if the optimum is to stay, `None` if there is no step.
    pub fn coefficients(&self) -> Option<(f64, f64)> {
        match *self {
            Self::DegenerateG { nearest } => Some((0.0, nearest)),
            _ => self
                .multipliers()
                .map(|(lambda, nu)| (-1.0 / lambda, -nu / lambda)),
        }
    }

    /// The case's name in results: it does not change between versions.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Inactive { .. } => "inactive",
            Self::Active { .. } => "active",
            Self::Recoverable { .. } => "recoverable",
            Self::Infeasible => "infeasible",
            Self::DegenerateB { .. } => "degenerate_b",
            Self::DegenerateG { .. } => "degenerate_g",
            Self::Undefined => "undefined",
        }
    }
}

/// The optimum of `problem`, within rounding at every scale of its numbers: nothing in here is
/// compared with an absolute threshold.
/// An infinite slack stands for no linear constraint.
/// Panics unless the radius is finite and above 0, since that number is ours.
pub fn solve(problem: &DualProblem) -> DualSolution {
    if !is_square(problem.s) {
        return DualSolution::Undefined;
    }
    solve_lazily(problem.q, problem.r, problem.slack, problem.radius, || {
        problem.s
    })
}

/// The greatest value of `q - r^2/s`, relative to `q`, when it should be 0 (g parallel to b) and
/// `H^-1` was applied in f32.
/// Added to the difference, it keeps lambda above 0 and the step inside the ball.
/// That costs at most 3e-7 of the objective's range `sqrt(2 delta q)` (the greatest value over all
/// `q - r^2/s`).
const ROUNDING: f64 = 1e-12;

/// Whether `square` can be the square of a norm.
fn is_square(square: f64) -> bool {
    square >= 0.0 && square.is_finite()
}

/// As [`solve`], asking for `s` only if the optimum depends on it, since `s` costs the solution of
/// `H w = b`.
/// It does not if `g` is zero and the origin feasible, or if the solution without the linear
/// constraint meets it.
pub(super) fn solve_lazily(
    q: f64,
    r: f64,
    slack: f64,
    radius: f64,
    s: impl FnOnce() -> f64,
) -> DualSolution {
    assert!(
        radius > 0.0 && radius.is_finite(),
        "the radius is {radius}; it must be finite and above 0"
    );
    if !is_square(q) || !r.is_finite() || slack.is_nan() || slack == f64::NEG_INFINITY {
        return DualSolution::Undefined;
    }
    let (c, ball) = (slack, 2.0 * radius);
    let free = (q / ball).sqrt();
    let meets = |lambda: f64| lambda * c + r >= 0.0;
    // With g = 0, every feasible point is an optimum, and the origin is one without s.
    if free == 0.0 && c >= 0.0 {
        return DualSolution::DegenerateG { nearest: 0.0 };
    }
    // r = 0 may mean b = 0, which is not known before s is; that case has its own name, if there is
    // a constraint at all.
    if free > 0.0 && (r != 0.0 || c == f64::INFINITY) && meets(free) {
        return without_linear_constraint(free, c);
    }
    let s = s();
    if !is_square(s) {
        return DualSolution::Undefined;
    }
    if s == 0.0 {
        return if c < 0.0 {
            DualSolution::Infeasible
        } else {
            DualSolution::DegenerateB { lambda: free }
        };
    }
    // c / sqrt(s) is squared after dividing: c^2 may be out of range when the distance is not.
    let distance = c / s.sqrt();
    let chord = ball - distance * distance;
    if c < 0.0 && chord <= 0.0 {
        return DualSolution::Infeasible;
    }
    if free == 0.0 {
        return DualSolution::DegenerateG { nearest: c / s };
    }
    // With r = 0, the second question waited for s above.
    if chord <= 0.0 || meets(free) {
        return without_linear_constraint(free, c);
    }
    let across = (q - r * (r / s)).max(0.0) + ROUNDING * q;
    // Exact arithmetic gives lambda c + r <= 0 here, hence nu >= 0. Rounding may not, least of all
    // where the boundary touches the ball and `across / chord` is one rounding by another: hence
    // the bound, and Eq. 10's maximum.
    let bound = (across / chord).sqrt();
    let lambda = if c > 0.0 { bound.min(-r / c) } else { bound };
    let nu = (-(lambda * c + r) / s).max(0.0);
    if c < 0.0 {
        DualSolution::Recoverable { lambda, nu }
    } else {
        DualSolution::Active { lambda, nu }
    }
}

/// The case of `nu = 0`, named by where the origin lies.
fn without_linear_constraint(lambda: f64, slack: f64) -> DualSolution {
    if slack < 0.0 {
        DualSolution::Recoverable { lambda, nu: 0.0 }
    } else {
        DualSolution::Inactive { lambda }
    }
}

#[cfg(test)]
mod tests;
