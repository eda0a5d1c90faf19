//! MCPO's hyperparameters, and the paper's values of them (Tables 1 and 2).

use serde::{Deserialize, Serialize};

use crate::{
    algo::{critic, mimicry, tolerance::Tolerance, trust_region::TrustRegion},
    env::EnvId,
    quantity::{Count, CountOrNone, NonNegative, Positive, UnitInterval, constant},
};

/// MCPO's hyperparameters; the defaults are the paper's Tables 1 and 2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// The tolerance d on MMD^2 at the first iteration: a number, or a share of the MMD^2 of doing
    /// nothing.
    pub d: Tolerance,
    /// The annealing factor: `d_k+1 = d_k (1 + epsilon)`.
    pub epsilon: NonNegative,
    /// d grows no further than this; no ceiling when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub max_d: Option<Positive>,
    /// How MMD^2 to the demonstration is measured.
    pub mmd: mimicry::Hyperparameters,
    /// The trust region.
    #[serde(flatten)]
    pub region: TrustRegion,
    /// The value network and the advantages.
    #[serde(flatten)]
    pub critic: critic::Hyperparameters,
    /// How many times a trial whose D exceeds the bound is moved back before the step is halved
    /// (`samples = "demo_states"`).
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
            region: TrustRegion::default(),
            critic: critic::Hyperparameters::with_minibatch(if env == EnvId::MountainCar {
                64
            } else {
                128
            }),
            max_corrections: constant(3),
            recovery_steps: constant(500),
            recovery_learning_rate: constant(1e-3),
            recovery_depth: constant(0.01),
        }
    }
}
