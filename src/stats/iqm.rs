//! The interquartile mean: the mean of the middle half of all samples (Agarwal et al., 2021).

use super::{Bootstrap, Estimate};
use crate::rng::Rng;

/// The interquartile mean over all tasks' samples together, with its stratified bootstrap interval; the samples should be
/// normalised, so that tasks compare. A quarter of the samples, rounded down, is left out at either end. `None` without
/// tasks, or if one has no samples.
pub fn iqm(tasks: &[&[f64]], bootstrap: &Bootstrap, rng: &mut Rng) -> Option<Estimate> {
    bootstrap.estimate(tasks, rng, |tasks| vec![interquartile_mean(tasks.concat())])?.pop()
}

/// The mean of what is left of `samples`, at least one, without the quarters at both ends.
fn interquartile_mean(mut samples: Vec<f64>) -> f64 {
    samples.sort_by(f64::total_cmp);
    let cut = samples.len() / 4;
    let middle = &samples[cut..samples.len() - cut];
    middle.iter().sum::<f64>() / middle.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Seed, Stream};

    #[test]
    fn a_task_without_samples_has_none() {
        let mut rng = Seed(1).stream(Stream::Bootstrap, 0);
        assert_eq!(iqm(&[&[1.0, 2.0], &[]], &Bootstrap::default(), &mut rng), None);
    }

    /// `scipy.stats.trim_mean(numpy.arange(n)**2.0, 0.25)` (SciPy 1.17.1).
    #[test]
    fn means_are_those_of_scipy() {
        for (n, wanted) in [(1, 0.0), (2, 0.5), (3, 5.0 / 3.0), (4, 2.5), (7, 11.0), (8, 13.5), (30, 231.5)] {
            let samples = (0..n).rev().map(|i| f64::from(i).powi(2)).collect();
            assert!((interquartile_mean(samples) - wanted).abs() < 1e-12, "{n} samples");
        }
    }

    /// The bootstrap's whole distribution, which so few samples allow to enumerate (numpy 2.4.6, SciPy 1.17.1):
    /// ```text
    /// a, b = [0.1, 0.9, 0.4], [1.0, 0.2, 0.6]
    /// all = [trim_mean(x + y, 0.25) for x in product(a, repeat=3) for y in product(b, repeat=3)]
    /// numpy.percentile(all, [2.5, 97.5]), numpy.percentile(all, [25, 75])
    /// ```
    #[test]
    fn intervals_are_those_of_the_whole_distribution() {
        let tasks: [&[f64]; 2] = [&[0.1, 0.9, 0.4], &[1.0, 0.2, 0.6]];
        for (confidence, low, high) in [(0.95, 0.225, 0.85), (0.5, 0.4, 0.65)] {
            let mut rng = Seed(1).stream(Stream::Bootstrap, 0);
            let found = iqm(&tasks, &Bootstrap { resamples: 20_000, confidence }, &mut rng).expect("there are samples");
            assert!((found.value - 0.525).abs() < 1e-12);
            // The distribution is discrete: an end is met exactly, or missed by an atom of 0.025.
            assert!((found.low - low).abs() < 1e-9 && (found.high - high).abs() < 1e-9, "{found:?}");
        }
    }
}
