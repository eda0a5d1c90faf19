//! MMD^2, gradient and witness against double loops in f64 and finite differences.

use super::*;

/// Points around `offset` that repeat nothing.
fn points(dim: usize, n: usize, seed: usize, offset: f32) -> DMatrix<f32> {
    DMatrix::from_fn(dim, n, |i, j| {
        offset + (((37 * seed + 11 * i + 5 * j * j + 3 * i * j) as f32) * 0.37).sin()
    })
}

fn k(x: &[f64], y: &[f64], scale: f64) -> f64 {
    (-scale * x.iter().zip(y).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()).exp()
}

fn widened(points: &DMatrix<f32>) -> Vec<Vec<f64>> {
    points
        .column_iter()
        .map(|x| x.iter().map(|&value| f64::from(value)).collect())
        .collect()
}

/// The mean kernel value between points of one set.
fn mean_within(x: &[Vec<f64>], scale: f64, estimator: Estimator) -> f64 {
    let n = x.len();
    let mut sum = 0.0;
    for i in 0..n {
        for j in (0..n).filter(|&j| i != j || estimator == Estimator::V) {
            sum += k(&x[i], &x[j], scale);
        }
    }
    sum / (n * if estimator == Estimator::V { n } else { n - 1 }) as f64
}

/// The definition, pair by pair.
fn by_loops(x: &[Vec<f64>], y: &[Vec<f64>], scale: f64, estimator: Estimator) -> f64 {
    let cross: f64 = x
        .iter()
        .flat_map(|a| y.iter().map(|b| k(a, b, scale)))
        .sum();
    mean_within(x, scale, estimator) - 2.0 * cross / (x.len() * y.len()) as f64
        + mean_within(y, scale, estimator)
}

fn target(y: &DMatrix<f32>, scale: f64, estimator: Estimator) -> Target {
    Target::new(y.clone(), Kernel { scale }, estimator)
}

#[test]
fn a_sample_that_is_not_a_number_makes_the_mmd_none() {
    let mut samples = points(3, 5, 1, 0.0);
    samples[(1, 2)] = f32::NAN;
    for estimator in [Estimator::V, Estimator::U] {
        assert!(
            target(&points(3, 4, 2, 0.0), 0.5, estimator)
                .mmd_squared(&samples)
                .is_nan(),
            "{estimator:?}"
        );
    }
}

#[test]
fn equal_samples_have_no_distance() {
    for offset in [0.0, 50.0] {
        let y = points(6, 300, 1, offset);
        let mut shuffled = y.clone();
        shuffled.swap_columns(0, 299);
        shuffled.swap_columns(17, 260);
        let v = target(&y, 0.5, Estimator::V).mmd_squared(&shuffled);
        // 300^2 kernel values in another order, whose sums of 16 round by 1e-7 each, this way and
        // that.
        assert!((0.0..1e-9).contains(&v), "{v}");
        assert!(target(&y, 0.5, Estimator::U).mmd_squared(&shuffled) < 0.0);
    }
}

#[test]
fn one_sample_and_one_point_count_with_themselves() {
    let (x, y) = (points(2, 1, 1, 0.0), points(2, 1, 2, 0.0));
    let expected = 2.0 - 2.0 * k(&widened(&x)[0], &widened(&y)[0], 0.5);
    for estimator in [Estimator::V, Estimator::U] {
        assert!(
            (target(&y, 0.5, estimator).mmd_squared(&x) - expected).abs() < 1e-6,
            "{estimator:?}"
        );
    }
}

#[test]
fn mmd_agrees_with_double_loops() {
    // Widths 1 to 3 blocks, far from the origin, and samples that nearly coincide with the target.
    for (n, m, offset) in [(2, 3, 0.0), (255, 257, 0.0), (300, 520, 40.0)] {
        let y = points(17, m, 2, offset);
        let near = DMatrix::from_fn(17, n, |i, j| y[(i, j % m)] + 1e-3 * ((i + j) as f32).cos());
        for x in [points(17, n, 3, offset), near] {
            for (scale, estimator) in [
                (0.5, Estimator::V),
                (0.5, Estimator::U),
                (0.05, Estimator::V),
            ] {
                let expected = by_loops(&widened(&x), &widened(&y), scale, estimator);
                let got = target(&y, scale, estimator).mmd_squared(&x);
                // Norms are about 9: 4e-7 (9 + 9) / 2 relative at most for each mean kernel value,
                // which are below 1.
                assert!(
                    (got - expected).abs() < 4e-6,
                    "{n} {m} {offset} {estimator:?}: {got}, expected {expected}"
                );
                assert!(estimator == Estimator::U || got >= 0.0);
            }
        }
    }
}

#[test]
fn a_small_mmd_keeps_its_digits() {
    // As in recovery: every sample 1e-2 beside its own point of the target. 1 % of MMD^2 is what a
    // tolerance needs.
    let y = points(23, 400, 4, 0.0);
    let x = DMatrix::from_fn(23, 400, |i, j| {
        y[(i, j)] + 1e-2 * ((3 * i + j) as f32).cos()
    });
    let expected = by_loops(&widened(&x), &widened(&y), 0.5, Estimator::V);
    assert!(expected < 1e-5, "{expected}");
    let got = target(&y, 0.5, Estimator::V).mmd_squared(&x);
    assert!(
        (got - expected).abs() < 0.01 * expected,
        "{got}, expected {expected}"
    );
}

#[test]
fn the_gradient_agrees_with_finite_differences() {
    for (n, estimator) in [
        (1, Estimator::V),
        (5, Estimator::V),
        (5, Estimator::U),
        (300, Estimator::V),
    ] {
        let (x, y) = (points(4, n, 5, 20.0), points(4, 270, 6, 20.3));
        let target = target(&y, 0.4, estimator);
        let mut gradient = DMatrix::from_element(4, n, f32::NAN);
        let value = target.mmd_squared_gradient(&x, &mut gradient);
        assert_eq!(value, target.mmd_squared(&x));
        let (x, y) = (widened(&x), widened(&y));
        let step = 1e-5;
        for (i, j) in [(0, 0), (3, n / 2), (1, n - 1)] {
            let moved = |by: f64| {
                let mut x = x.clone();
                x[j][i] += by;
                by_loops(&x, &y, 0.4, estimator)
            };
            let expected = (moved(step) - moved(-step)) / (2.0 * step);
            let got = f64::from(gradient[(i, j)]);
            // A gradient is of the order of 1 / n; f32 sums of up to 270 weighted points.
            assert!(
                (got - expected).abs() < 1e-5 / n as f64,
                "{n} {estimator:?} ({i}, {j}): {got}, {expected}"
            );
        }
    }
}

/// Blocks of one, two and three sizes, a partial strip and a partial vector among them; points that
/// cancel, since every sample is near its own point.
#[test]
fn at_the_targets_states_value_and_gradient_are_those_of_the_same_samples() {
    for (states, action_dim, m) in [(4, 1, 1), (17, 6, 239), (11, 3, 290), (2, 8, 740)] {
        let y = points(states + action_dim, m, 5, 2.0);
        let actions = DMatrix::from_fn(action_dim, m, |i, j| {
            y[(states + i, j)] + 1e-2 * ((5 * i + 3 * j) as f32).cos()
        });
        let mut x = y.clone();
        x.rows_mut(states, action_dim).copy_from(&actions);
        for estimator in [Estimator::V, Estimator::U] {
            let target = target(&y, 0.5, estimator);
            let value = target.mmd_squared(&x);
            assert_eq!(
                target.mmd_squared_at_states(&actions).to_bits(),
                value.to_bits()
            );
            let mut by_all = DMatrix::from_element(states + action_dim, m, f32::NAN);
            target.mmd_squared_gradient(&x, &mut by_all);
            let mut gradient = DMatrix::from_element(action_dim, m, f32::NAN);
            let same = target.mmd_squared_at_states_gradient(&actions, &mut gradient);
            assert_eq!(same.to_bits(), value.to_bits());
            // Sums of up to 740 points of norm 2, of which each is weighted by at most 1, over m.
            let by_actions = by_all.rows(states, action_dim);
            let error = (gradient - by_actions).amax();
            assert!(
                error < 1e-6,
                "{states} {action_dim} {m} {estimator:?}: {error}"
            );
        }
    }
}

#[test]
fn the_witness_agrees_with_loops_and_leaves_the_sample_out_under_u() {
    for (n, estimator) in [(1, Estimator::U), (300, Estimator::V), (300, Estimator::U)] {
        let (x, y) = (points(4, n, 7, 0.0), points(4, 50, 8, 0.3));
        let target = target(&y, 0.5, estimator);
        let mut witness = vec![f64::NAN; n];
        assert_eq!(
            target.mmd_squared_witness(&x, &mut witness),
            target.mmd_squared(&x)
        );
        let (x, y) = (widened(&x), widened(&y));
        let left_out = |i, j| i == j && estimator == Estimator::U && n > 1;
        for i in 0..n {
            let others: Vec<f64> = (0..n)
                .filter(|&j| !left_out(i, j))
                .map(|j| k(&x[i], &x[j], 0.5))
                .collect();
            let own = others.iter().sum::<f64>() / others.len() as f64;
            let other = y.iter().map(|y| k(&x[i], y, 0.5)).sum::<f64>() / 50.0;
            assert!(
                (witness[i] - (own - other)).abs() < 1e-5,
                "{n} {estimator:?} {i}"
            );
        }
    }
}

#[test]
fn twenty_thousand_points_count_as_what_they_repeat() {
    // All pairs at once would take 1.6 GB. Each of four points 5,000 times is the same distribution
    // as each once.
    let (x, y) = (points(3, 2, 9, 0.0), points(3, 4, 10, 0.0));
    let many = DMatrix::from_fn(3, 20_000, |i, j| y[(i, j % 4)]);
    let expected = by_loops(&widened(&x), &widened(&y), 0.5, Estimator::V);
    assert!((target(&many, 0.5, Estimator::V).mmd_squared(&x) - expected).abs() < 1e-6);
}
