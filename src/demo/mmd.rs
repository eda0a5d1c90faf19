//! MMD^2 between two samples (appendix, Eq. 4), its gradient and its witness function.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::Kernel;

/// Which estimator of MMD^2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// The V-statistic of Eq. (4): all pairs, 0 or above.
    V,
    /// The unbiased U-statistic: no sample is paired with itself; may be negative.
    U,
}

/// The demonstration's side of the MMD: its points and their mean kernel value, which stay while the policy's change.
#[derive(Debug, Clone)]
pub struct Target {
    points: DMatrix<f32>,
    kernel: Kernel,
    estimator: Estimator,
    /// The mean of the kernel over pairs of `points`.
    self_similarity: f64,
}

impl Target {
    /// The target with `points` (`[dim x m]`, one column a point).
    pub fn new(points: DMatrix<f32>, kernel: Kernel, estimator: Estimator) -> Self {
        Self { points, kernel, estimator, self_similarity: 0.0 } // TODO
    }

    /// MMD^2 between `samples` (`[dim x n]`) and the target.
    pub fn mmd_squared(&self, samples: &DMatrix<f32>) -> f64 {
        let _ = (samples, &self.points, self.kernel, self.estimator, self.self_similarity);
        todo!()
    }

    /// MMD^2, and its gradient with respect to each sample (`[dim x n]`).
    pub fn mmd_squared_gradient(&self, samples: &DMatrix<f32>, gradient: &mut DMatrix<f32>) -> f64 {
        let _ = (samples, gradient);
        todo!()
    }

    /// MMD^2, and the witness function at each sample (`[n]`): the mean kernel value to `samples` minus that to the target.
    pub fn mmd_squared_witness(&self, samples: &DMatrix<f32>, witness: &mut [f64]) -> f64 {
        let _ = (samples, witness);
        todo!()
    }
}
