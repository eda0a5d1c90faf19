//! MMD^2 between two samples (appendix, Eq. 4), its gradient and its witness function.
//!
//! Owns the estimators over kernel values. Knows nothing of where samples come from: a point is a
//! column of numbers, for MCPO the standardised observation above the raw action. Start at
//! [`Target`].
//!
//! Kernel values are f32 with a relative error below 1e-5 for points of squared norm below 50
//! (about the demonstration's mean); their sums are f64 of at most 16 in f32, in a fixed order.
//! Memory is a few blocks of kernel values beside the points, whatever their number. The work is
//! `n (n / 2 + m)` kernel values, also where samples have the target's states, with one product of
//! states for three of them.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{Kernel, exponents::Points, pairs, same_states};
use crate::arithmetic::product::product_nt;

/// Which estimator of MMD^2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// The V-statistic of Eq. (4): all pairs, 0 or above.
    V,
    /// The unbiased U-statistic: no sample is paired with itself; may be negative.
    U,
}

impl Estimator {
    /// The number of pairs of `n` points that count. A single point has no other, so it counts with
    /// itself under both.
    fn pairs(self, n: usize) -> f64 {
        n as f64 * self.partners(n)
    }

    /// The number of partners of each of `n` points.
    fn partners(self, n: usize) -> f64 {
        if self.counts_itself(n) {
            n as f64
        } else {
            (n - 1) as f64
        }
    }

    /// Whether a point's kernel value with itself, 1, counts.
    fn counts_itself(self, n: usize) -> bool {
        self == Self::V || n == 1
    }

    /// The mean kernel value over pairs, given the sum over pairs of different points.
    fn self_similarity(self, off_diagonal: f64, n: usize) -> f64 {
        let own = if self.counts_itself(n) { n as f64 } else { 0.0 };
        (off_diagonal + own) / self.pairs(n)
    }
}

/// The demonstration's side of the MMD: its points and their mean kernel value, which stay fixed
/// while the policy's points change.
#[derive(Debug, Clone)]
pub struct Target {
    points: Points,
    /// The points' mean, which is subtracted from both sides.
    centre: DVector<f32>,
    kernel: Kernel,
    estimator: Estimator,
    /// The mean of the kernel over pairs of `points`.
    self_similarity: f64,
}

/// The sums of a pass over all pairs, for each sample.
pub(super) struct Sums {
    /// The sum of kernel values to the other samples `[n]`.
    pub(super) to_samples: Vec<f64>,
    /// The sum of kernel values to the target's points `[n]`.
    pub(super) to_target: Vec<f64>,
}

impl Sums {
    /// The sums of `n` samples, at 0.
    pub(super) fn zeros(n: usize) -> Self {
        assert!(n > 0, "the MMD needs at least one sample");
        Self {
            to_samples: vec![0.0; n],
            to_target: vec![0.0; n],
        }
    }
}

/// For each sample the sum of the other points' last `k` coordinates, in the points' scale,
/// weighted by their kernel values `[k x n]`.
pub(super) struct WeightedSums {
    pub(super) of_samples: DMatrix<f32>,
    pub(super) of_target: DMatrix<f32>,
}

impl WeightedSums {
    /// The sums at 0.
    fn zeros(k: usize, n: usize) -> Self {
        Self {
            of_samples: DMatrix::zeros(k, n),
            of_target: DMatrix::zeros(k, n),
        }
    }
}

impl Target {
    /// The target with `points` (`[dim x m]`, one column a point, at least one).
    pub fn new(points: DMatrix<f32>, kernel: Kernel, estimator: Estimator) -> Self {
        assert!(points.ncols() > 0, "a demonstration has at least one point");
        let m = points.ncols();
        let centre = DVector::from_iterator(
            points.nrows(),
            points
                .row_iter()
                .map(|row| (row.iter().map(|&x| f64::from(x)).sum::<f64>() / m as f64) as f32),
        );
        let points = Points::new(&points, &centre, kernel);
        let mut sums = vec![0.0; m];
        pairs::within(&points, |block, mirrored| {
            block.add_column_sums(&mut sums);
            if mirrored {
                block.add_row_sums(&mut sums);
            }
        });
        let self_similarity = estimator.self_similarity(sums.iter().sum(), m);
        Self {
            points,
            centre,
            kernel,
            estimator,
            self_similarity,
        }
    }

    /// The number of coordinates of a point.
    pub fn dim(&self) -> usize {
        self.centre.len()
    }

    /// MMD^2 between `samples` (`[dim x n]`, at least one) and the target. NaN if a sample is.
    pub fn mmd_squared(&self, samples: &DMatrix<f32>) -> f64 {
        let samples = Points::new(samples, &self.centre, self.kernel);
        self.value(&self.pass(&samples, None))
    }

    /// MMD^2, and its gradient with respect to each sample (`[dim x n]`).
    pub fn mmd_squared_gradient(&self, samples: &DMatrix<f32>, gradient: &mut DMatrix<f32>) -> f64 {
        let samples = Points::new(samples, &self.centre, self.kernel);
        let mut weighted = WeightedSums::zeros(samples.dim(), samples.len());
        let sums = self.pass(&samples, Some(&mut weighted));
        self.gradient(&samples, &sums, &weighted, gradient);
        self.value(&sums)
    }

    /// MMD^2 between the target and samples at its own states: one for each of its points, that
    /// point with `actions` (`[action_dim x m]`) for its last coordinates.
    ///
    /// The same to the bit as [`mmd_squared`](Self::mmd_squared) of these samples, with one product
    /// of states for three kernel values.
    pub fn mmd_squared_at_states(&self, actions: &DMatrix<f32>) -> f64 {
        let samples = self.points.with_last(actions, &self.centre);
        let sums = same_states::sums(&self.points, &samples, actions.nrows(), None);
        self.value(&sums)
    }

    /// MMD^2 between the target and samples at its own states, and its gradient with respect to
    /// each action (`[action_dim x m]`).
    pub fn mmd_squared_at_states_gradient(
        &self,
        actions: &DMatrix<f32>,
        gradient: &mut DMatrix<f32>,
    ) -> f64 {
        let samples = self.points.with_last(actions, &self.centre);
        let mut weighted = WeightedSums::zeros(actions.nrows(), actions.ncols());
        let sums = same_states::sums(&self.points, &samples, actions.nrows(), Some(&mut weighted));
        self.gradient(&samples, &sums, &weighted, gradient);
        self.value(&sums)
    }

    /// The gradient with respect to each sample's last `k` coordinates (`[k x n]`).
    fn gradient(
        &self,
        samples: &Points,
        sums: &Sums,
        weighted: &WeightedSums,
        gradient: &mut DMatrix<f32>,
    ) {
        let (k, n) = weighted.of_samples.shape();
        assert_eq!(
            gradient.shape(),
            (k, n),
            "a gradient has its samples' shape"
        );
        // d k(x, y) / dx = -2 scale k(x, y) (x - y); a pair of samples counts twice, from either
        // end, and so does a pair with the target, by the 2 of Eq. (4).
        // The differences are in the points' scale.
        let factor = 4.0 * self.kernel.scale / samples.scale();
        let own = -factor / self.estimator.pairs(n);
        let other = factor / (n as f64 * self.points.len() as f64);
        let last = samples.columns(samples.dim() - k..samples.dim(), 0..n);
        for (j, mut column) in gradient.column_iter_mut().enumerate() {
            let (own_mean, other_mean) =
                (weighted.of_samples.column(j), weighted.of_target.column(j));
            for (i, slope) in column.iter_mut().enumerate() {
                let x = f64::from(last[(i, j)]);
                let from_samples = own * (x * sums.to_samples[j] - f64::from(own_mean[i]));
                let from_target = other * (x * sums.to_target[j] - f64::from(other_mean[i]));
                *slope = (from_samples + from_target) as f32;
            }
        }
    }

    /// MMD^2, and the witness function at each sample (`[n]`): the mean kernel value to `samples`
    /// minus that to the target.
    ///
    /// Twice the witness is a sample's cost in the policy gradient of MMD^2. Under [`Estimator::U`]
    /// the mean over `samples` leaves out the sample itself, which would otherwise add `1 / n` of
    /// its own making to every cost and none of it the policy's; the mean witness is then an
    /// unbiased estimate too.
    pub fn mmd_squared_witness(&self, samples: &DMatrix<f32>, witness: &mut [f64]) -> f64 {
        assert_eq!(samples.ncols(), witness.len(), "a sample has one witness");
        let samples = Points::new(samples, &self.centre, self.kernel);
        let sums = self.pass(&samples, None);
        let n = samples.len();
        let own = if self.estimator.counts_itself(n) {
            1.0
        } else {
            0.0
        };
        for ((value, to_samples), to_target) in witness
            .iter_mut()
            .zip(&sums.to_samples)
            .zip(&sums.to_target)
        {
            *value = (to_samples + own) / self.estimator.partners(n)
                - to_target / self.points.len() as f64;
        }
        self.value(&sums)
    }

    /// Visits every pair once; fills `weighted` too, for the gradient by all coordinates.
    fn pass(&self, samples: &Points, mut weighted: Option<&mut WeightedSums>) -> Sums {
        let mut sums = Sums::zeros(samples.len());
        let all = 0..samples.dim();
        pairs::within(samples, |block, mirrored| {
            block.add_column_sums(&mut sums.to_samples);
            if mirrored {
                block.add_row_sums(&mut sums.to_samples);
            }
            if let Some(WeightedSums { of_samples, .. }) = &mut weighted {
                block.add_weighted(samples.columns(all.clone(), block.rows.clone()), of_samples);
                if mirrored {
                    product_nt(
                        samples.columns(all.clone(), block.columns),
                        block.values,
                        1.0,
                        of_samples.columns_range_mut(block.rows),
                    );
                }
            }
        });
        pairs::between(&self.points, samples, |block| {
            block.add_column_sums(&mut sums.to_target);
            if let Some(WeightedSums { of_target, .. }) = &mut weighted {
                let points = self.points.columns(all.clone(), block.rows.clone());
                block.add_weighted(points, of_target);
            }
        });
        sums
    }

    /// MMD^2 from the sums.
    fn value(&self, sums: &Sums) -> f64 {
        let n = sums.to_samples.len();
        let samples = self
            .estimator
            .self_similarity(sums.to_samples.iter().sum(), n);
        let cross = sums.to_target.iter().sum::<f64>() / (n as f64 * self.points.len() as f64);
        let value = samples - 2.0 * cross + self.self_similarity;
        // The V-statistic is a squared norm, so a value below 0 is rounding. (`max` would hide a
        // NaN.)
        if self.estimator == Estimator::V && value < 0.0 {
            0.0
        } else {
            value
        }
    }
}

#[cfg(test)]
mod tests;
