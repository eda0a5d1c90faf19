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
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PROBLEM: DualProblem = DualProblem {
        q: 4.0,
        r: -2.0,
        s: 9.0,
        slack: 1.0,
        radius: 0.5,
    };

    #[test]
    fn numbers_of_no_problem_are_undefined() {
        let bad = [
            DualProblem {
                q: f64::NAN,
                ..PROBLEM
            },
            DualProblem {
                q: f64::INFINITY,
                ..PROBLEM
            },
            DualProblem {
                q: -1e-300,
                ..PROBLEM
            },
            DualProblem {
                r: f64::NAN,
                ..PROBLEM
            },
            DualProblem {
                r: f64::NEG_INFINITY,
                ..PROBLEM
            },
            DualProblem {
                s: f64::NAN,
                ..PROBLEM
            },
            DualProblem {
                s: f64::INFINITY,
                ..PROBLEM
            },
            DualProblem {
                s: -1.0,
                r: 2.0,
                ..PROBLEM
            }, // also where s is not needed
            DualProblem {
                slack: f64::NAN,
                ..PROBLEM
            },
            DualProblem {
                slack: f64::NEG_INFINITY,
                ..PROBLEM
            },
        ];
        for problem in bad {
            let solution = solve(&problem);
            assert_eq!(solution, DualSolution::Undefined, "{problem:?}");
            assert_eq!(
                (solution.multipliers(), solution.coefficients()),
                (None, None)
            );
        }
    }

    #[test]
    fn a_radius_that_is_none_is_our_own_bug() {
        for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let solved = std::panic::catch_unwind(|| solve(&DualProblem { radius, ..PROBLEM }));
            assert!(solved.is_err(), "{radius}");
        }
    }

    /// One problem a case, solved by hand: the ball has radius 1 and s = 9, so the boundary lies at
    /// c / 3.
    #[test]
    fn every_case_is_met() {
        let solve_with = |q: f64, r: f64, s: f64, slack: f64| {
            solve(&DualProblem {
                q,
                r,
                s,
                slack,
                radius: 0.5,
            })
        };
        let root = |x: f64| x.sqrt();
        let cases = [
            (
                "inactive",
                solve_with(4.0, 2.0, 9.0, 1.0),
                Some((-0.5, 0.0)),
            ), // away from the boundary
            (
                "inactive",
                solve_with(4.0, -2.0, 9.0, 3.0),
                Some((-0.5, 0.0)),
            ), // the boundary only touches the ball
            (
                "inactive",
                solve_with(4.0, -2.0, 9.0, f64::INFINITY),
                Some((-0.5, 0.0)),
            ),
            (
                "inactive",
                solve_with(4.0, 0.0, 0.0, f64::INFINITY),
                Some((-0.5, 0.0)),
            ),
            // No problem of exact arithmetic (r^2 > q s): the half-space holds the ball, whatever r
            // says.
            (
                "inactive",
                solve_with(4.0, -8.0, 9.0, 3.5),
                Some((-0.5, 0.0)),
            ),
            // g perpendicular to b, boundary through the origin: along -g to the sphere.
            (
                "active",
                solve_with(4.0, -6e-20, 9.0, 0.0),
                Some((-0.5, 0.0)),
            ),
            // q - r^2/s = 1, 2 delta - c^2/s = 8/9: lambda = sqrt(9/8).
            (
                "active",
                solve_with(2.0, -3.0, 9.0, 1.0),
                Some((-root(8.0 / 9.0), 1.0 / 9.0 - root(8.0 / 9.0) / 3.0)),
            ),
            (
                "recoverable",
                solve_with(4.0, 0.0, 9.0, -1.0),
                Some((-root(8.0 / 9.0) / 2.0, -1.0 / 9.0)),
            ),
            (
                "recoverable",
                solve_with(4.0, 6.0, 9.0, -1.0),
                Some((-0.5, 0.0)),
            ), // g along b: the free step meets it
            ("infeasible", solve_with(4.0, 2.0, 9.0, -3.0), None),
            ("infeasible", solve_with(4.0, 0.0, 0.0, -1e-30), None),
            ("infeasible", solve_with(0.0, 0.0, 9.0, -4.0), None),
            (
                "degenerate_b",
                solve_with(4.0, 0.0, 0.0, 0.0),
                Some((-0.5, 0.0)),
            ),
            (
                "degenerate_g",
                solve_with(0.0, 0.0, 9.0, 0.0),
                Some((0.0, 0.0)),
            ),
            (
                "degenerate_g",
                solve_with(0.0, 0.0, 0.0, 0.0),
                Some((0.0, 0.0)),
            ),
            (
                "degenerate_g",
                solve_with(0.0, 0.0, 9.0, -1.5),
                Some((0.0, -1.5 / 9.0)),
            ),
        ];
        for (at, (name, solution, wanted)) in cases.iter().enumerate() {
            assert_eq!(solution.name(), *name, "case {at}: {solution:?}");
            match (solution.coefficients(), wanted) {
                (None, None) => {}
                (Some((alpha, beta)), Some((a, b))) => {
                    assert!(
                        (alpha - a).abs() < 1e-11 && (beta - b).abs() < 1e-11,
                        "case {at}: {solution:?}"
                    );
                }
                other => panic!("case {at}: {other:?}"),
            }
        }
    }

    #[test]
    fn s_is_not_asked_for_where_it_does_not_matter() {
        let unneeded = || panic!("s was asked for");
        assert_eq!(
            solve_lazily(4.0, 2.0, 1.0, 0.5, unneeded),
            DualSolution::Inactive { lambda: 2.0 }
        );
        assert_eq!(
            solve_lazily(4.0, 6.0, -1.0, 0.5, unneeded),
            DualSolution::Recoverable {
                lambda: 2.0,
                nu: 0.0
            }
        );
        assert_eq!(
            solve_lazily(0.0, 0.0, 0.0, 0.5, unneeded),
            DualSolution::DegenerateG { nearest: 0.0 }
        );
        assert_eq!(
            solve_lazily(4.0, 0.0, f64::INFINITY, 0.5, unneeded),
            DualSolution::Inactive { lambda: 2.0 }
        );
    }

    /// g and b of lengths from 1e-12 to 1e12 at any angle, the boundary at any distance, in balls
    /// of any size; the special angles and distances are as likely as the others together.
    fn problems() -> impl Strategy<Value = DualProblem> {
        let length = || (-12.0f64..12.0).prop_map(|exponent| 10f64.powf(exponent));
        let length_or_zero = || prop_oneof![9 => length(), 1 => Just(0.0)];
        let near = |x: f64| {
            (-16.0f64..-2.0).prop_map(move |exponent| x - x.signum() * 10f64.powf(exponent))
        };
        let cosine = prop_oneof![
            -1.0f64..1.0,
            near(1.0),
            near(-1.0),
            Just(1.0),
            Just(-1.0),
            Just(0.0)
        ];
        let distance = prop_oneof![
            -2.0f64..2.0,
            near(1.0),
            near(-1.0),
            Just(1.0),
            Just(-1.0),
            Just(0.0)
        ];
        (
            length_or_zero(),
            length_or_zero(),
            cosine,
            distance,
            length(),
        )
            .prop_map(|(g, b, cosine, distance, radius)| {
                let slack = distance * (2.0 * radius).sqrt() * if b > 0.0 { b } else { 1.0 };
                DualProblem {
                    q: g * g,
                    r: cosine * g * b,
                    s: b * b,
                    slack,
                    radius,
                }
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8_000))]

        /// Karush, Kuhn and Tucker: with the multipliers of an infeasible problem's absence, each
        /// condition in the units of the problem. Stationarity, `g + lambda H x + nu b = 0`, is how
        /// coefficients follow from multipliers.
        #[test]
        fn the_optimum_satisfies_kkt(problem in problems()) {
            let DualProblem { q, r, s, slack, radius } = problem;
            let solution = solve(&problem);
            let reach = (2.0 * radius * s).sqrt();
            let Some((alpha, beta)) = solution.coefficients() else {
                prop_assert_eq!(solution, DualSolution::Infeasible);
                // The least b.x over the ball is -reach.
                prop_assert!(slack < 0.0 && -reach >= slack * (1.0 + 1e-12), "{:?}", problem);
                return Ok(());
            };
            prop_assert!(alpha.is_finite() && beta.is_finite(), "{:?}", solution);
            // Cancellation between the two terms loses this much of each scalar.
            let lost = 1e-14 * (alpha * alpha * q + beta * beta * s);
            let linear = alpha * r + beta * s;
            let quadratic = (alpha * alpha * q + 2.0 * alpha * beta * r + beta * beta * s) / 2.0;
            prop_assert!(linear <= slack + 1e-12 * reach + (lost * s).sqrt(), "b.x = {linear}: {solution:?}");
            prop_assert!(quadratic <= radius * (1.0 + 1e-12) + lost, "x.Hx/2 = {quadratic}: {solution:?}");
            let Some((lambda, nu)) = solution.multipliers() else {
                // g = 0: any feasible point is an optimum.
                prop_assert_eq!((solution.name(), q), ("degenerate_g", 0.0));
                return Ok(());
            };
            prop_assert!(lambda > 0.0 && nu >= 0.0, "{solution:?}");
            // The scale of the objective. Both slacks, times their multipliers, must vanish beside
            // it: 1e-6 is what ROUNDING may cost where g is parallel to b, and elsewhere it costs
            // next to nothing.
            let range = (2.0 * radius * q).sqrt();
            prop_assert!(lambda * (radius - quadratic - lost) <= 1e-6 * range, "{solution:?}: the ball is slack");
            prop_assert!(nu * (slack - linear) <= 1e-6 * range + nu * (lost * s).sqrt(), "{solution:?}: the half-space is slack");
        }

        #[test]
        fn the_optimum_scales_with_the_problem(problem in problems(), exponent in -20i32..20) {
            // Powers of 4 are exact, as are their roots: g, b and H in other units give the same
            // step in those units.
            let unit = 4f64.powi(exponent);
            let DualProblem { q, r, s, slack, radius } = problem;
            let scaled = DualProblem { q: q * unit * unit, r: r * unit, slack, s, radius };
            prop_assert_eq!(solve(&scaled).name(), solve(&problem).name());
            let scaled_g = solve(&scaled).coefficients();
            prop_assert_eq!(scaled_g, solve(&problem).coefficients().map(|(alpha, beta)| (alpha / unit, beta)));
            let scaled = DualProblem { q, r: r * unit, s: s * unit * unit, slack: slack * unit, radius };
            let scaled_b = solve(&scaled).coefficients();
            prop_assert_eq!(scaled_b, solve(&problem).coefficients().map(|(alpha, beta)| (alpha, beta / unit)));
            let scaled = DualProblem { q: q * unit, r: r * unit, s: s * unit, slack: slack * unit, radius: radius * unit };
            prop_assert_eq!(solve(&scaled).coefficients(), solve(&problem).coefficients());
        }
    }
}
