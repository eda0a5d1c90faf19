//! The performance profile: the share of samples above each threshold (Agarwal et al., 2021; Dolan
//! and More, 2002).

use super::{Bootstrap, Estimate};
use crate::rng::Rng;

/// The mean over tasks of the share of samples above each of `thresholds`, in their order, each
/// with its own stratified bootstrap interval (pointwise: the band does not hold the whole curve at
/// that confidence). The samples should be normalised, so that one threshold means the same in all
/// tasks. `None` without tasks, or if one has no samples.
pub fn performance_profile(
    tasks: &[&[f64]],
    thresholds: &[f64],
    bootstrap: &Bootstrap,
    rng: &mut Rng,
) -> Option<Vec<Estimate>> {
    bootstrap.estimate(tasks, rng, |tasks| {
        thresholds
            .iter()
            .map(|&threshold| mean_share_above(tasks, threshold))
            .collect()
    })
}

fn mean_share_above(tasks: &[Vec<f64>], threshold: f64) -> f64 {
    let share = |task: &Vec<f64>| {
        task.iter().filter(|&&x| x > threshold).count() as f64 / task.len() as f64
    };
    tasks.iter().map(share).sum::<f64>() / tasks.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Seed, Stream};

    const TASKS: [&[f64]; 2] = [&[0.1, 0.9, 0.4], &[1.0, 0.2, 0.6]];

    fn profile(tasks: &[&[f64]], thresholds: &[f64], confidence: f64) -> Option<Vec<Estimate>> {
        let mut rng = Seed(1).stream(Stream::Bootstrap, 0);
        performance_profile(
            tasks,
            thresholds,
            &Bootstrap {
                resamples: 20_000,
                confidence,
            },
            &mut rng,
        )
    }

    #[test]
    fn a_task_without_samples_has_none() {
        assert_eq!(profile(&[&[1.0], &[]], &[0.5], 0.95), None);
        assert_eq!(profile(&TASKS, &[], 0.95), Some(vec![]));
    }

    #[test]
    fn tasks_with_fewer_samples_weigh_as_much() {
        let found = profile(&[&[1.0], &[0.0, 0.0, 0.0]], &[0.5], 0.95).expect("there are samples");
        assert_eq!(
            found,
            [Estimate {
                value: 0.5,
                low: 0.5,
                high: 0.5
            }]
        );
    }

    /// `(tasks > threshold).mean()`, and its percentiles over the bootstrap's whole distribution,
    /// `product(product(a, repeat=3), product(b, repeat=3))` (numpy 2.4.6).
    #[test]
    fn profiles_are_those_of_numpy() {
        let thresholds = [0.0, 0.25, 0.4, 1.0];
        let shares = [1.0, 2.0 / 3.0, 0.5, 0.0];
        let narrow = [
            (1.0, 1.0),
            (0.5, 5.0 / 6.0),
            (1.0 / 3.0, 2.0 / 3.0),
            (0.0, 0.0),
        ];
        let wide = [
            (1.0, 1.0),
            (1.0 / 3.0, 1.0),
            (1.0 / 6.0, 5.0 / 6.0),
            (0.0, 0.0),
        ];
        for (confidence, ends) in [(0.4, narrow), (0.95, wide)] {
            let found = profile(&TASKS, &thresholds, confidence).expect("there are samples");
            for ((found, share), (low, high)) in found.iter().zip(shares).zip(ends) {
                assert!((found.value - share).abs() < 1e-12, "{found:?}");
                assert!(
                    (found.low - low).abs() < 1e-9 && (found.high - high).abs() < 1e-9,
                    "{found:?} {low} {high}"
                );
            }
        }
    }
}
