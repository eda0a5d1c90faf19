//! Pre-training (Silver et al., 2016): behaviour cloning on the demonstration, then PPO.
//!
//! Owns the order of the two. Knows nothing of either's inside. Start at [`pretrained`].
//!
//! The cloned policy keeps the standard deviation it started with (mean squared error does not see it), the normaliser
//! starts at the demonstration's statistics, and the value network and both optimisers start fresh.

use serde::{Deserialize, Serialize};

use super::{Agent, AlgoError, cloning, ppo};
use crate::{demo::Demonstration, env::EnvId, rng::Rng};

/// Pre-training's hyperparameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Behaviour cloning, before the first rollout.
    pub cloning: cloning::Hyperparameters,
    /// PPO, from then on.
    pub ppo: ppo::Hyperparameters,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        Self { cloning: cloning::Hyperparameters::for_env(env), ppo: ppo::Hyperparameters::for_env(env) }
    }
}

/// `agent` after behaviour cloning; what follows is PPO as it is.
///
/// Errors: the loss is no longer finite.
pub fn pretrained(
    hyperparameters: &cloning::Hyperparameters,
    mut agent: Agent,
    demonstration: &Demonstration,
    rng: &mut Rng,
) -> Result<Agent, AlgoError> {
    cloning::clone_behaviour(hyperparameters, demonstration, &mut agent, rng, |epoch, loss, _| {
        tracing::debug!(epoch, loss, "behaviour cloning");
    })?;
    Ok(agent)
}
