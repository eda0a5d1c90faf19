//! The mimicry constraint: MMD^2 between the policy and the demonstration, and its gradient, in both readings.

use serde::{Deserialize, Serialize};

use crate::demo::{Bandwidth, Estimator};

/// How MMD^2 to the demonstration is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Where the policy's samples come from.
    pub samples: Samples,
    /// V-statistic (Eq. 4) or U-statistic.
    pub estimator: Estimator,
    /// The Gaussian kernel's bandwidth.
    pub bandwidth: Bandwidth,
}

/// Where the policy's samples come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Samples {
    /// The demonstration's states under the policy's mean action; the gradient by backpropagation.
    DemoStates,
    /// The agent's rollout; the gradient by the score function.
    Rollout,
}

impl Default for Hyperparameters {
    fn default() -> Self {
        Self {
            samples: Samples::DemoStates,
            estimator: Estimator::V,
            bandwidth: Bandwidth::Fixed(crate::quantity::constant(1.0)),
        }
    }
}
