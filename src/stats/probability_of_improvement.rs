//! The probability of improvement: how often one method's sample is above another's (Agarwal et
//! al., 2021).

use super::{Bootstrap, Estimate};
use crate::rng::Rng;

/// The mean over tasks of the probability that a random sample of `x` is above one of `y`, ties
/// counting half (the Mann-Whitney statistic over the number of pairs), with its stratified
/// bootstrap interval. Both hold the same tasks in the same order, each with any number of samples.
/// `None` without tasks, if a task has no samples, or if the numbers of tasks differ.
pub fn probability_of_improvement(
    x: &[&[f64]],
    y: &[&[f64]],
    bootstrap: &Bootstrap,
    rng: &mut Rng,
) -> Option<Estimate> {
    if x.len() != y.len() {
        return None;
    }
    let mean_over_tasks = |strata: &[Vec<f64>]| {
        let (x, y) = strata.split_at(x.len());
        vec![x.iter().zip(y).map(|(x, y)| share_above(x, y)).sum::<f64>() / x.len() as f64]
    };
    bootstrap
        .estimate(&[x, y].concat(), rng, mean_over_tasks)?
        .pop()
}

/// The share of pairs in which `x` is above `y`, ties counting half; NaN where either is empty.
pub fn share_above(x: &[f64], y: &[f64]) -> f64 {
    let above = |a: f64, b: f64| {
        if a > b {
            1.0
        } else {
            f64::from(u8::from(a == b)) / 2.0
        }
    };
    let pairs: f64 = x
        .iter()
        .map(|&a| y.iter().map(|&b| above(a, b)).sum::<f64>())
        .sum();
    pairs / (x.len() * y.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Seed, Stream};

    fn estimate(x: &[&[f64]], y: &[&[f64]], confidence: f64) -> Option<Estimate> {
        let mut rng = Seed(1).stream(Stream::Bootstrap, 0);
        probability_of_improvement(
            x,
            y,
            &Bootstrap {
                resamples: 20_000,
                confidence,
            },
            &mut rng,
        )
    }

    #[test]
    fn tasks_that_do_not_match_have_none() {
        assert_eq!(estimate(&[&[1.0]], &[&[1.0], &[2.0]], 0.95), None);
        assert_eq!(estimate(&[&[1.0]], &[&[]], 0.95), None);
        assert_eq!(estimate(&[], &[], 0.95), None);
    }

    #[test]
    fn methods_apart_are_certain_and_equal_ones_are_even() {
        let certain = estimate(&[&[3.0, 4.0]], &[&[1.0, 2.0]], 0.95);
        assert_eq!(
            certain,
            Some(Estimate {
                value: 1.0,
                low: 1.0,
                high: 1.0
            })
        );
        assert_eq!(
            estimate(&[&[1.0, 2.0, 3.0]], &[&[1.0, 2.0, 3.0]], 0.95).map(|found| found.value),
            Some(0.5)
        );
    }

    /// `scipy.stats.mannwhitneyu(x, y, alternative="greater").statistic / (len(x) * len(y))` (SciPy
    /// 1.17.1).
    #[test]
    fn shares_are_those_of_scipy() {
        assert!((share_above(&[3.0, 5.0, 5.0], &[5.0, 1.0]) - 2.0 / 3.0).abs() < 1e-12);
        assert!((share_above(&[1.0, 2.0, 4.0, 8.0], &[3.0, 2.0, 9.0]) - 0.375).abs() < 1e-12);
    }

    /// The mean over both tasks of SciPy's numbers as above, and over the bootstrap's whole
    /// distribution: the percentiles (numpy 2.4.6) of `product(*[product(stratum,
    /// repeat=len(stratum)) for stratum in x + y])`.
    #[test]
    fn intervals_are_those_of_the_whole_distribution() {
        let x: [&[f64]; 2] = [&[3.0, 1.0, 2.0], &[0.5, 2.5]];
        let y: [&[f64]; 2] = [&[2.0, 1.5], &[1.0, 2.5]];
        for (confidence, low, high) in [(0.95, 0.125, 0.875), (0.8, 0.25, 0.7083333333333333)] {
            let found = estimate(&x, &y, confidence).expect("there are samples");
            assert!((found.value - 0.4791666666666667).abs() < 1e-12);
            assert!(
                (found.low - low).abs() < 1e-9 && (found.high - high).abs() < 1e-9,
                "{found:?}"
            );
        }
    }
}
