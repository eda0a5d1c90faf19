//! One number for many tasks: interquartile mean, median, mean and optimality gap (Agarwal et al.,
//! 2021).

use super::{Bootstrap, Estimate};
use crate::rng::Rng;

/// The score that the optimality gap is measured from.
const OPTIMAL: f64 = 1.0;

/// Aggregates of normalised scores, each with its stratified bootstrap interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aggregates {
    /// The mean of the middle half of all tasks' samples together; at either end a quarter, rounded
    /// down, is left out.
    pub iqm: Estimate,
    /// The median over tasks of their means.
    pub median: Estimate,
    /// The mean over tasks of their means.
    pub mean: Estimate,
    /// By how much samples fall short of 1, where higher samples count as 0: the mean over tasks of
    /// their means.
    pub optimality_gap: Estimate,
}

impl Aggregates {
    /// The aggregates of `tasks`, one entry a task with any number of samples.
    /// The samples should be normalised, so that tasks compare.
    /// `None` without tasks, or if one has no samples.
    pub fn of(tasks: &[&[f64]], bootstrap: &Bootstrap, rng: &mut Rng) -> Option<Self> {
        let of_resample = |tasks: &[Vec<f64>]| {
            let means: Vec<f64> = tasks
                .iter()
                .map(|task| mean(task.iter().copied()))
                .collect();
            let gap = |task: &Vec<f64>| OPTIMAL - mean(task.iter().map(|score| score.min(OPTIMAL)));
            let gap = mean(tasks.iter().map(gap));
            vec![
                interquartile_mean(tasks.concat()),
                median(means.clone()),
                mean(means.into_iter()),
                gap,
            ]
        };
        match bootstrap.estimate(tasks, rng, of_resample)?[..] {
            [iqm, median, mean, optimality_gap] => Some(Self {
                iqm,
                median,
                mean,
                optimality_gap,
            }),
            _ => None,
        }
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

/// The middle of `values`, at least one; the mean of the two middle values if their number is even.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let (below, above) = (values[(values.len() - 1) / 2], values[values.len() / 2]);
    (below + above) / 2.0
}

/// The mean of `samples`, at least one, without the quarters at both ends.
fn interquartile_mean(mut samples: Vec<f64>) -> f64 {
    samples.sort_by(f64::total_cmp);
    let cut = samples.len() / 4;
    mean(samples[cut..samples.len() - cut].iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Seed, Stream};

    fn aggregates(tasks: &[&[f64]], bootstrap: &Bootstrap) -> Option<Aggregates> {
        Aggregates::of(tasks, bootstrap, &mut Seed(1).stream(Stream::Bootstrap, 0))
    }

    #[test]
    fn a_task_without_samples_has_none() {
        assert_eq!(aggregates(&[&[1.0, 2.0], &[]], &Bootstrap::default()), None);
        assert_eq!(aggregates(&[], &Bootstrap::default()), None);
    }

    /// `scipy.stats.trim_mean(numpy.arange(n)**2.0, 0.25)` (SciPy 1.17.1).
    #[test]
    fn means_are_those_of_scipy() {
        for (n, wanted) in [
            (1, 0.0),
            (2, 0.5),
            (3, 5.0 / 3.0),
            (4, 2.5),
            (7, 11.0),
            (8, 13.5),
            (30, 231.5),
        ] {
            let samples = (0..n).rev().map(|i| f64::from(i).powi(2)).collect();
            assert!(
                (interquartile_mean(samples) - wanted).abs() < 1e-12,
                "{n} samples"
            );
        }
    }

    /// By hand: means 0.5, 1.5 and 4; short of 1 by 0.5, 0.25 and 0.
    #[test]
    fn tasks_with_fewer_samples_weigh_as_much() {
        let found = aggregates(
            &[&[0.5], &[0.5, 2.5], &[4.0; 3]],
            &Bootstrap {
                resamples: 1,
                confidence: 0.9,
            },
        );
        let found = found.expect("there are samples");
        let values =
            [found.median, found.mean, found.optimality_gap].map(|estimate| estimate.value);
        assert_eq!(values, [1.5, 2.0, 0.25]);
        assert_eq!(median(vec![4.0, 1.0, 3.0, 2.0]), 2.5);
    }

    /// The bootstrap's whole distribution, which so few samples allow to enumerate (numpy 2.4.6,
    /// SciPy 1.17.1):
    /// ```text
    /// a, b = [0.1, 0.9, 0.4], [1.0, 0.2, 0.6]
    /// all = [trim_mean(x + y, 0.25) for x in product(a, repeat=3) for y in product(b, repeat=3)]
    /// numpy.percentile(all, [2.5, 97.5]), numpy.percentile(all, [25, 75])
    /// ```
    #[test]
    fn intervals_are_those_of_the_whole_distribution() {
        let tasks: [&[f64]; 2] = [&[0.1, 0.9, 0.4], &[1.0, 0.2, 0.6]];
        for (confidence, low, high) in [(0.95, 0.225, 0.85), (0.5, 0.4, 0.65)] {
            let found = aggregates(
                &tasks,
                &Bootstrap {
                    resamples: 20_000,
                    confidence,
                },
            )
            .expect("samples")
            .iqm;
            assert!((found.value - 0.525).abs() < 1e-12);
            // The distribution is discrete: an end is met exactly, or missed by an atom of 0.025.
            assert!(
                (found.low - low).abs() < 1e-9 && (found.high - high).abs() < 1e-9,
                "{found:?}"
            );
        }
    }
}
