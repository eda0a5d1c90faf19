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
    let near =
        |x: f64| (-16.0f64..-2.0).prop_map(move |exponent| x - x.signum() * 10f64.powf(exponent));
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
        prop_assert!(
            linear <= slack + 1e-12 * reach + (lost * s).sqrt(),
            "b.x = {linear}: {solution:?}"
        );
        prop_assert!(
            quadratic <= radius * (1.0 + 1e-12) + lost,
            "x.Hx/2 = {quadratic}: {solution:?}"
        );
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
        prop_assert!(
            lambda * (radius - quadratic - lost) <= 1e-6 * range,
            "{solution:?}: the ball is slack"
        );
        prop_assert!(
            nu * (slack - linear) <= 1e-6 * range + nu * (lost * s).sqrt(),
            "{solution:?}: the half-space is slack"
        );
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
        prop_assert_eq!(
            scaled_g,
            solve(&problem).coefficients().map(|(alpha, beta)| (alpha / unit, beta))
        );
        let scaled = DualProblem {
            q,
            r: r * unit,
            s: s * unit * unit,
            slack: slack * unit,
            radius,
        };
        let scaled_b = solve(&scaled).coefficients();
        prop_assert_eq!(
            scaled_b,
            solve(&problem).coefficients().map(|(alpha, beta)| (alpha, beta / unit))
        );
        let scaled = DualProblem {
            q: q * unit,
            r: r * unit,
            s: s * unit,
            slack: slack * unit,
            radius: radius * unit,
        };
        prop_assert_eq!(solve(&scaled).coefficients(), solve(&problem).coefficients());
    }
}
