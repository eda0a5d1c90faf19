//! Statistics over seeds.
//!
//! Owns intervals and the summaries that reports of reinforcement learning have come to use
//! (Agarwal et al., 2021). Knows no environment or algorithm: samples come as numbers, one a seed,
//! grouped in strata, one a task; episodes of one seed are not samples. Start at [`t_interval`],
//! which holds for few seeds; the bootstrap's intervals do not ([`bootstrap`]). [`Aggregates`] sums
//! up many tasks, [`Contrast`] compares means, [`best_of`] compares with a published best sample,
//! and [`holm`] allows for many comparisons.

mod aggregates;
pub mod best_of;
pub mod bootstrap;
mod contrast;
mod holm;
mod normal;
mod performance_profile;
mod probability_of_improvement;

pub use aggregates::Aggregates;
pub use bootstrap::{Bootstrap, Estimate};
pub use contrast::Contrast;
pub use holm::holm;
pub use performance_profile::performance_profile;
pub use probability_of_improvement::{probability_of_improvement, share_above};

use statrs::distribution::{ContinuousCDF, StudentsT};

/// A mean with its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The sample mean.
    pub mean: f64,
    /// Lower end; the mean itself for one sample.
    pub low: f64,
    /// Upper end; the mean itself for one sample.
    pub high: f64,
}

/// The mean of `samples` with its two-sided Student t interval at `confidence` (such as 0.95);
/// `None` for no samples. Panics unless the confidence is between 0 and 1.
pub fn t_interval(samples: &[f64], confidence: f64) -> Option<Interval> {
    check_confidence(confidence);
    let n = samples.len() as f64;
    match (samples, mean_and_variance(samples)) {
        (_, Some((mean, variance))) => {
            let student =
                StudentsT::new(0.0, 1.0, n - 1.0).expect("one or more degrees of freedom");
            let half = student.inverse_cdf(0.5 + confidence / 2.0) * (variance / n).sqrt();
            Some(Interval {
                mean,
                low: mean - half,
                high: mean + half,
            })
        }
        ([only], None) => Some(Interval {
            mean: *only,
            low: *only,
            high: *only,
        }),
        (_, None) => None,
    }
}

/// The mean of `samples` and their variance, over n - 1; `None` for fewer than two.
fn mean_and_variance(samples: &[f64]) -> Option<(f64, f64)> {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (samples.len() > 1).then_some((mean, variance))
}

fn check_confidence(confidence: f64) {
    assert!(
        confidence > 0.0 && confidence < 1.0,
        "the confidence is {confidence}; it must be between 0 and 1"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `tests/reference/aggregates.py`: rliable's values to twelve digits, and the ends of its
    /// bootstrap to 0.01 of a score, since both are drawn; those of a share to the one sample (of
    /// 35, or the pairs of five) by which drawn ends can differ.
    #[test]
    fn summaries_are_those_of_rliable() {
        let reference: serde_json::Value =
            serde_json::from_str(include_str!("../../tests/reference/aggregates.json"))
                .expect("JSON");
        let rows = |key: &str| -> Vec<Vec<f64>> {
            serde_json::from_value(reference[key].clone()).expect("numbers")
        };
        let (ours, others) = (rows("ours"), rows("others"));
        let tasks =
            |rows: &'static [Vec<f64>]| -> Vec<&[f64]> { rows.iter().map(Vec::as_slice).collect() };
        let (ours, others) = (tasks(ours.leak()), tasks(others.leak()));
        let mut rng = crate::rng::Seed(1).stream(crate::rng::Stream::Bootstrap, 0);
        let bootstrap = Bootstrap {
            resamples: 20_000,
            confidence: 0.95,
        };
        let close = |found: &[Estimate], wanted: &[Vec<f64>], error: f64| {
            for (index, found) in found.iter().enumerate() {
                let [value, low, high] = [0, 1, 2].map(|row| wanted[row][index]);
                assert!(
                    (found.value - value).abs() < 1e-12,
                    "{index}: {found:?} {value}"
                );
                assert!(
                    (found.low - low).abs() < error && (found.high - high).abs() < error,
                    "{found:?} {low} {high}"
                );
            }
        };
        let Aggregates {
            iqm,
            median,
            mean,
            optimality_gap,
        } = Aggregates::of(&ours, &bootstrap, &mut rng).expect("samples");
        close(
            &[iqm, median, mean, optimality_gap],
            &rows("iqm median mean optimality_gap"),
            0.01,
        );
        let thresholds: Vec<f64> =
            serde_json::from_value(reference["thresholds"].clone()).expect("numbers");
        let profile =
            performance_profile(&ours, &thresholds, &bootstrap, &mut rng).expect("samples");
        close(&profile, &rows("profile"), 1.01 / 35.0);
        let improvement =
            probability_of_improvement(&ours, &others, &bootstrap, &mut rng).expect("samples");
        close(&[improvement], &rows("improvement"), 0.01);
    }

    #[test]
    fn no_samples_have_no_mean_and_one_has_no_width() {
        assert_eq!(t_interval(&[], 0.95), None);
        assert_eq!(
            t_interval(&[3.0], 0.95),
            Some(Interval {
                mean: 3.0,
                low: 3.0,
                high: 3.0
            })
        );
    }

    #[test]
    #[should_panic(expected = "between 0 and 1")]
    fn a_confidence_in_percent_is_our_own_bug() {
        t_interval(&[1.0, 2.0], 95.0);
    }

    /// `scipy.stats.t.interval(confidence, len(x) - 1, numpy.mean(x), scipy.stats.sem(x))` (SciPy
    /// 1.17.1).
    #[test]
    fn intervals_are_those_of_scipy() {
        let x = [1.5, -0.3, 2.25, 0.0, 4.1];
        for (confidence, low, high) in [
            (0.95, -0.7121970071635071, 3.7321970071635073),
            (0.5, 0.9171646363731433, 2.102835363626857),
        ] {
            let found = t_interval(&x, confidence).expect("there are samples");
            assert!((found.mean - 1.51).abs() < 1e-12);
            assert!(
                (found.low - low).abs() < 1e-9 && (found.high - high).abs() < 1e-9,
                "{found:?}"
            );
        }
        // `scipy.stats.t.interval(0.95, n - 1)` by the number of samples; here the standard error
        // is 1.
        for (n, quantile) in [
            (2, 12.706204736174694),
            (3, 4.302652729749462),
            (10, 2.262157162798205),
        ] {
            let mut samples = vec![0.0; n];
            (samples[0], samples[1]) = (-1.0, 1.0);
            let error = (2.0 / ((n - 1) * n) as f64).sqrt();
            let found = t_interval(&samples, 0.95).expect("there are samples");
            assert!(
                (found.high / error - quantile).abs() < 1e-8,
                "{n} samples: {}",
                found.high / error
            );
        }
    }
}
