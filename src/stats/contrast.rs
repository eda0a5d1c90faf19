//! A weighted sum of independent means, as a difference of two: Welch's test, and Student's for one
//! sample.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::{Interval, mean_and_variance};

/// A weighted sum of means with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contrast {
    /// The sum.
    pub estimate: f64,
    /// Its standard error; 0 where the samples of each mean are equal.
    pub error: f64,
    /// Degrees of freedom, by Satterthwaite (1946).
    freedom: f64,
}

impl Contrast {
    /// The sum of the means of `parts`, each with its weight: weights 1 and -1 give Welch's (1947)
    /// difference of two means. `None` without parts, or where one has fewer than two samples.
    pub fn of(parts: &[(f64, &[f64])]) -> Option<Self> {
        let mut estimate = 0.0;
        let mut variances = Vec::with_capacity(parts.len());
        for &(weight, samples) in parts {
            let (mean, variance) = mean_and_variance(samples)?;
            estimate += weight * mean;
            variances.push((
                weight * weight * variance / samples.len() as f64,
                samples.len() as f64 - 1.0,
            ));
        }
        let all: f64 = variances.iter().map(|(own, _)| own).sum();
        // Shares of the sum, since the squares of small variances would be 0.
        let shares: f64 = variances
            .iter()
            .map(|(own, freedom)| (own / all).powi(2) / freedom)
            .sum();
        (!parts.is_empty()).then(|| Self {
            estimate,
            error: all.sqrt(),
            freedom: 1.0 / shares,
        })
    }

    /// The confidence that the sum of the true means is below `limit`: one minus the p value of the
    /// one-sided test that it is not.
    pub fn confidence_below(&self, limit: f64) -> f64 {
        let distance = limit - self.estimate;
        match self.student() {
            Some(student) => student.cdf(distance / self.error),
            None => {
                (1.0 + if distance == 0.0 {
                    0.0
                } else {
                    distance.signum()
                }) / 2.0
            }
        }
    }

    /// The two-sided interval at `confidence`.
    pub fn interval(&self, confidence: f64) -> Interval {
        super::check_confidence(confidence);
        let half = self.student().map_or(0.0, |student| {
            student.inverse_cdf(0.5 + confidence / 2.0) * self.error
        });
        Interval {
            mean: self.estimate,
            low: self.estimate - half,
            high: self.estimate + half,
        }
    }

    /// The distribution of the estimate's distance in units of its error; `None` if the error is 0.
    fn student(&self) -> Option<StudentsT> {
        (self.error > 0.0)
            .then(|| StudentsT::new(0.0, 1.0, self.freedom).ok())
            .flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: [f64; 5] = [1.5, -0.3, 2.25, 0.0, 4.1];
    const Y: [f64; 3] = [0.2, 1.1, -0.7];

    #[test]
    fn too_few_samples_have_no_error() {
        assert_eq!(Contrast::of(&[]), None);
        assert_eq!(Contrast::of(&[(1.0, &X), (-1.0, &[2.0])]), None);
    }

    #[test]
    fn small_numbers_are_compared_as_large_ones() {
        let p = |scale: f64| {
            let scaled = |samples: &[f64]| samples.iter().map(|x| scale * x).collect::<Vec<f64>>();
            Contrast::of(&[(1.0, &scaled(&X)), (-1.0, &scaled(&Y))])
                .expect("enough")
                .confidence_below(0.0)
        };
        assert!((p(1e-100) - p(1.0)).abs() < 1e-9);
    }

    #[test]
    fn equal_samples_leave_no_doubt() {
        let certain =
            Contrast::of(&[(1.0, &[3.0, 3.0]), (-1.0, &[1.0, 1.0, 1.0])]).expect("enough");
        assert_eq!(
            certain.interval(0.95),
            Interval {
                mean: 2.0,
                low: 2.0,
                high: 2.0
            }
        );
        assert_eq!(
            [1.0, 2.0, 3.0].map(|limit| certain.confidence_below(limit)),
            [0.0, 0.5, 1.0]
        );
    }

    /// `scipy.stats.ttest_ind(x - limit, y, equal_var=False)` (SciPy 1.17.1): its
    /// `confidence_interval(0.95)`, and the p value of `alternative="greater"`.
    #[test]
    fn two_means_are_compared_as_scipy_does() {
        let welch = Contrast::of(&[(1.0, &X), (-1.0, &Y)]).expect("enough");
        let interval = welch.interval(0.95);
        assert!((welch.estimate - 1.31).abs() < 1e-12);
        assert!(
            (interval.low - -1.0284329439349165).abs() < 1e-8
                && (interval.high - 3.6484329439349166).abs() < 1e-8,
            "{interval:?}"
        );
        for (limit, wanted) in [
            (0.5, 0.2143630144696548),
            (-1.0, 0.026029959579998273),
            (3.0, 0.9363767063362815),
        ] {
            assert!(
                (welch.confidence_below(limit) - wanted).abs() < 1e-9,
                "{limit}"
            );
        }
    }

    /// `scipy.stats.ttest_1samp(x, 1.0)`.
    #[test]
    fn one_mean_is_compared_as_scipy_does() {
        let one = Contrast::of(&[(1.0, &X)]).expect("enough");
        let p = 2.0
            * one
                .confidence_below(1.0)
                .min(1.0 - one.confidence_below(1.0));
        assert!((p - 0.5586380858294251).abs() < 1e-9, "{p}");
    }

    /// By hand: half of either difference.
    #[test]
    fn weights_average_over_tasks() {
        let all = Contrast::of(&[(0.5, &X), (-0.5, &Y), (0.5, &X), (-0.5, &Y)]).expect("enough");
        let one = Contrast::of(&[(1.0, &X), (-1.0, &Y)]).expect("enough");
        assert!((all.estimate - one.estimate).abs() < 1e-12);
        assert!((all.error - one.error / 2.0_f64.sqrt()).abs() < 1e-12);
        assert!((all.freedom - 2.0 * one.freedom).abs() < 1e-9);
    }
}
