//! The matrix file: from TOML text to a typed specification.
//!
//! Owns the format, the layers that make it up, and the errors that point at a line. Knows nothing of how runs are made
//! or trained. Start at [`ExperimentSpec`]; the format is documented in `experiments/README.md`.

use std::{collections::BTreeMap, path::PathBuf};

use serde::{Deserialize, Serialize};

use crate::{
    algo,
    env::{EnvId, Reward},
    quantity::{Count, EnvSteps, Positive},
};

/// One experiment file, after its layers are merged.
///
/// Hyperparameters stay TOML tables here: their defaults depend on the environment, so [`crate::plan`] resolves them run
/// by run. They were checked, key by key, when the file was read.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentSpec {
    /// Name of the experiment, and of its folder under the results.
    pub name: String,
    /// A sentence for people.
    pub description: String,
    /// How long each run is.
    pub budget: Budget,
    /// How experience is collected.
    pub rollout: Rollout,
    /// How and when policies are evaluated.
    pub evaluation: Evaluation,
    /// The networks' shapes.
    pub network: Network,
    /// When checkpoints are written.
    pub checkpoint: Checkpoint,
    /// The blocks of the matrix, in order.
    pub matrix: Vec<Block>,
    /// `[algorithms.NAME]`: overrides of hyperparameters.
    pub algorithms: BTreeMap<String, toml::Table>,
    /// `[environments.NAME]`: overrides of the task.
    pub environments: BTreeMap<EnvId, Environment>,
    /// `[[figures]]`.
    pub figures: Vec<Figure>,
    /// `[[tables]]`.
    pub tables: Vec<Table>,
    /// The folder of the file; relative paths in it start there.
    pub folder: PathBuf,
}

/// One `[[matrix]]` block: every combination of its lists is one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Seeds.
    pub seed: Vec<u64>,
    /// Environments.
    pub env: Vec<EnvId>,
    /// Algorithms, by name.
    pub algorithm: Vec<String>,
    /// Other axes: key (`d`, `epsilon`, `mcpo.max_kl` ...) and values, in the file's order.
    pub axes: Vec<(String, Vec<toml::Value>)>,
}

/// `[budget]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Steps in the environments, over all of a run.
    pub env_steps: EnvSteps,
}

/// `[rollout]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rollout {
    /// Steps of one iteration, over all environments.
    pub steps: Count,
    /// Environments stepped together in one process.
    pub environments: Count,
}

/// `[evaluation]`: episodes with the mean action and a frozen normaliser, on the dense and the sparse reward.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evaluation {
    /// Environment steps of training between two evaluations; the last policy is evaluated in any case.
    pub every: EnvSteps,
    /// Episodes of each evaluation under way.
    pub episodes: Count,
    /// Episodes of the evaluation at the end of training.
    pub final_episodes: Count,
}

/// `[network]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Widths of the hidden layers of policy, value and discriminator networks.
    pub hidden: Vec<Count>,
    /// The policy's standard deviation at the start, in units of the action.
    pub initial_std: Positive,
    /// Normalised observations are clipped to this, on either side.
    pub observation_clip: Positive,
}

/// `[checkpoint]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// Keep the policy every so many environment steps, for `demo collect`; none is kept when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub keep_policy_every: Option<EnvSteps>,
}

/// `[environments.NAME]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Environment {
    /// The reward that is trained on; the paper's sparse one when absent.
    pub reward: Option<Reward>,
    /// The time limit in steps; Gym's when absent.
    pub max_steps: Option<Count>,
    /// The demonstration's file; `experiments/demos/NAME.parquet` when absent.
    pub demonstrations: Option<PathBuf>,
}

/// `[[figures]]`: learning curves, one panel an environment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// File name without extension.
    pub name: String,
    /// Title above the panels.
    pub title: String,
    /// What is drawn: `return` (evaluations, dense), `training_return` or a column of `progress.parquet`.
    pub y: String,
    /// Axes whose values make one curve each, such as `["d"]`.
    pub series: Vec<String>,
    /// Runs that are drawn, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<String>,
    /// Whether the y axis is logarithmic.
    #[serde(default)]
    pub log_y: bool,
}

/// `[[tables]]`: returns at the end of training beside the paper's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// File name without extension.
    pub name: String,
    /// Title above the table.
    pub title: String,
    /// Axes whose values make one row each.
    pub rows: Vec<String>,
    /// The axis whose values make one column each.
    pub columns: String,
    /// Runs that count, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<String>,
    /// The paper's table to compare with: `table3`, `table4` or `table5`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reference: Option<String>,
}

/// An algorithm with its hyperparameters; externally tagged, so that errors keep their place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// PPO.
    Ppo(algo::ppo::Hyperparameters),
    /// MCPO.
    Mcpo(algo::mcpo::Hyperparameters),
}
