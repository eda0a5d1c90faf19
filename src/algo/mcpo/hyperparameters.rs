//! What a user can set of MCPO, and the paper's values of it (Tables 1 and 2).

use serde::{Deserialize, Serialize};

use crate::{
    algo::{critic, mimicry, tolerance::Tolerance, trust_region::Region},
    env::EnvId,
    quantity::{Count, CountOrNone, Discount, NonNegative, Positive, UnitInterval, constant},
};

/// MCPO's hyperparameters; the defaults are the paper's Tables 1 and 2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// The tolerance d on MMD^2 at the first iteration: a number, or a share of the MMD^2 of doing nothing.
    pub d: Tolerance,
    /// The annealing factor: `d_k+1 = d_k (1 + epsilon)`.
    pub epsilon: NonNegative,
    /// d grows no further than this; no ceiling when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub max_d: Option<Positive>,
    /// How MMD^2 to the demonstration is measured.
    pub mmd: mimicry::Hyperparameters,
    /// delta, the bound of the mean KL of one update.
    pub max_kl: Positive,
    /// Added to the Fisher matrix's diagonal.
    pub damping: NonNegative,
    /// Products of conjugate gradient, at most, for each of g and b.
    pub cg_iterations: Count,
    /// The most samples of the batch, evenly spaced, that make the Fisher matrix.
    pub fisher_samples: Count,
    /// Discount gamma.
    pub discount: Discount,
    /// GAE's lambda.
    pub gae_lambda: UnitInterval,
    /// Adam's step size for the value network.
    pub learning_rate: Positive,
    /// L2 penalty on the value network's parameters.
    pub l2_penalty: NonNegative,
    /// Passes of the value network over each batch.
    pub value_epochs: Count,
    /// Samples in a minibatch of the value network.
    pub minibatch: Count,
    /// Steps that the line search tries, each half the one before.
    pub line_search_steps: Count,
    /// How many times a trial whose D exceeds the bound is moved back before the step is halved (`samples =
    /// "demo_states"`).
    pub max_corrections: CountOrNone,
    /// Adam steps of one recovery, at most (`samples = "demo_states"`).
    pub recovery_steps: Count,
    /// Adam's step size in recovery.
    pub recovery_learning_rate: Positive,
    /// The share of the tolerance down to which recovery goes; 1 stops where the constraint is met.
    pub recovery_depth: UnitInterval,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        let (d, epsilon) = match env {
            EnvId::MountainCar => (1e-3, 5e-3),
            EnvId::InvertedPendulum => (1e-3, 1e-2),
            EnvId::InvertedDoublePendulum => (1e-3, 5e-2),
            EnvId::HalfCheetah => (1e-3, 1e-3),
            EnvId::Hopper => (1e-4, 1e-3),
            EnvId::Walker2d => (1e-2, 1e-3),
            EnvId::Ant => (1e-5, 1e-3),
            // The table has no other; these are in the middle of it.
            _ => (1e-3, 1e-3),
        };
        Self {
            d: Tolerance::Absolute(constant(d)),
            epsilon: constant(epsilon),
            max_d: None,
            mmd: mimicry::Hyperparameters::default(),
            max_kl: constant(5e-3),
            damping: constant(1e-2),
            cg_iterations: constant(10),
            fisher_samples: constant(1024),
            discount: constant(0.99),
            gae_lambda: constant(0.95),
            learning_rate: constant(1e-4),
            l2_penalty: constant(1e-3),
            value_epochs: constant(10),
            minibatch: constant(if env == EnvId::MountainCar { 64 } else { 128 }),
            line_search_steps: constant(10),
            max_corrections: constant(3),
            recovery_steps: constant(500),
            recovery_learning_rate: constant(1e-3),
            recovery_depth: constant(0.01),
        }
    }

    pub(super) fn region(&self) -> Region {
        Region {
            max_kl: self.max_kl.get(),
            damping: self.damping.get(),
            cg_iterations: self.cg_iterations.size(),
            fisher_samples: self.fisher_samples.size(),
        }
    }

    pub(super) fn critic_fit(&self) -> critic::Fit {
        critic::Fit {
            epochs: self.value_epochs.size(),
            minibatch: self.minibatch.size(),
            learning_rate: self.learning_rate.get(),
            l2_penalty: self.l2_penalty.get(),
        }
    }
}
