//! PPO with the clipped surrogate (Schulman et al., 2017).

use serde::{Deserialize, Serialize};

use crate::{
    env::EnvId,
    quantity::{Count, Discount, NonNegative, Positive, UnitInterval, constant},
};

/// PPO's hyperparameters; the defaults are the paper's Table 1 where it names one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Discount gamma.
    pub discount: Discount,
    /// GAE's lambda.
    pub gae_lambda: UnitInterval,
    /// Adam's step size, for the policy and the value network.
    pub learning_rate: Positive,
    /// L2 penalty on the value network's parameters.
    pub l2_penalty: NonNegative,
    /// Half-width of the interval in which the probability ratio counts.
    pub clip: Positive,
    /// Passes over each batch.
    pub epochs: Count,
    /// Samples in a minibatch.
    pub minibatch: Count,
    /// Weight of the entropy bonus.
    pub entropy_weight: NonNegative,
    /// The gradient's norm is clipped to this, for each network.
    pub max_gradient_norm: Positive,
    /// Whether advantages are centred and scaled to unit variance, minibatch by minibatch.
    pub normalize_advantages: bool,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        Self {
            discount: constant(0.99),
            gae_lambda: constant(0.95),
            learning_rate: constant(1e-4),
            l2_penalty: constant(1e-3),
            clip: constant(0.2),
            epochs: constant(10),
            minibatch: constant(if env == EnvId::MountainCar { 64 } else { 1024 }),
            entropy_weight: constant(0.0),
            max_gradient_norm: constant(0.5),
            normalize_advantages: true,
        }
    }
}
