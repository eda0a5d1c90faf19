//! The plan: from a specification to an ordered list of fully resolved runs.
//!
//! Owns the product of the axes, the resolution of hyperparameters, and every run's id and fingerprint. Pure: reads no
//! file, starts nothing. Start at [`RunSpec`].

use std::{collections::BTreeMap, path::PathBuf};

use serde::{Deserialize, Serialize};

use crate::{
    env::{EnvId, Reward},
    rng::Seed,
    spec::{Algorithm, Budget, Checkpoint, Evaluation, Network, Rollout},
};

/// One run, with nothing left to default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunSpec {
    /// The experiment's name.
    pub experiment: String,
    /// The run's folder under `runs/`: `<env>/<algorithm and axes>/seed-<n>`.
    pub id: String,
    /// The seed of everything random in it.
    pub seed: Seed,
    /// The environment.
    pub env: EnvId,
    /// The values of the block's axes that apply to it, `d` and `epsilon` with dots resolved, for reports.
    pub axes: BTreeMap<String, toml::Value>,
    /// The reward that is trained on.
    pub reward: Reward,
    /// The time limit in steps.
    pub max_steps: u64,
    /// The demonstration's file, for algorithms that use one.
    pub demonstration: Option<PathBuf>,
    /// The algorithm and its hyperparameters.
    pub algorithm: Algorithm,
    /// The networks.
    pub network: Network,
    /// How experience is collected.
    pub rollout: Rollout,
    /// How long the run is.
    pub budget: Budget,
    /// How and when it is evaluated.
    pub evaluation: Evaluation,
    /// When checkpoints are written.
    pub checkpoint: Checkpoint,
}
