//! `progress.parquet`: one row per iteration.

use serde::{Deserialize, Serialize};

use super::{Cell, Column, Field, Role, columns};
use crate::algo::Update;

/// One iteration of training.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Iteration {
    /// [`ITERATION`].
    pub iteration: u64,
    /// [`ENV_STEPS`].
    pub env_steps: u64,
    /// [`EPISODES`].
    pub episodes: u64,
    /// [`DENSE_RETURN`].
    pub dense_return: Option<f64>,
    /// [`TRAINING_RETURN`].
    pub training_return: Option<f64>,
    /// [`EPISODE_LENGTH`].
    pub episode_length: Option<f64>,
    /// The measurements of the update.
    pub update: Update,
    /// [`PHYSICS_SECONDS`].
    pub physics_seconds: f64,
    /// [`ROLLOUT_SECONDS`].
    pub rollout_seconds: f64,
    /// [`UPDATE_SECONDS`].
    pub update_seconds: f64,
}

impl Iteration {
    /// A row for an update before the first step in an environment.
    pub fn before_any(update: Update) -> Self {
        Self {
            update,
            ..Self::default()
        }
    }
}

columns! { Iteration;
    ITERATION "iteration" Whole = iteration, Position, "", "",
        "Counted from 1; 0 for what was learned before the first step in an environment";
    ENV_STEPS "env_steps" Whole = env_steps, Position, "environment steps", "",
        "Steps in the environments so far, this iteration's included";
    EPISODES "episodes" Whole = episodes, Measured, "", "",
        "Episodes that ended in this iteration's rollout";
    DENSE_RETURN "dense_return" MaybeNumber = dense_return, Measured,
        "return while training", "dense reward",
        "Mean return of those episodes in the dense reward";
    TRAINING_RETURN "training_return" MaybeNumber = training_return, Measured,
        "return", "training reward",
        "Mean return of those episodes in the reward that is trained on";
    EPISODE_LENGTH "episode_length" MaybeNumber = episode_length, Measured, "", "steps",
        "Mean length of those episodes";
    KL "kl" MaybeNumber = update.kl, Measured, "KL of the update", "nats",
        "Mean KL of the new policy from the old one";
    ENTROPY "entropy" MaybeNumber = update.entropy, Measured, "", "nats",
        "Entropy of the new policy";
    SURROGATE_GAIN "surrogate_gain" MaybeNumber = update.surrogate_gain, Measured, "", "",
        "The surrogate's new value less its old one";
    VALUE_LOSS "value_loss" MaybeNumber = update.value_loss, Measured, "", "",
        "Mean squared error of the value network after the update's last pass";
    CLIP_FRACTION "clip_fraction" MaybeNumber = update.clip_fraction, Measured, "", "",
        "Share of samples whose probability ratio was clipped (PPO)";
    MMD "mmd" MaybeNumber = update.mmd, Measured, "MMD² to the demonstration", "",
        "D of the policy before the update: MMD² to the demonstration";
    MMD_AFTER "mmd_after" MaybeNumber = update.mmd_after, Measured, "MMD² to the demonstration", "",
        "D of the policy after the update";
    TOLERANCE "d_k" ["d"] MaybeNumber = update.d, Measured, "tolerance d", "",
        "The tolerance in force, which epsilon lets grow; the key `d` is where it starts";
    CASE "case" MaybeWord = update.case, Measured, "", "",
        "What the update did: which case of the dual was met, or why none was solved";
    LAMBDA "lambda" MaybeNumber = update.lambda, Measured, "", "",
        "Multiplier of the KL constraint";
    NU "nu" MaybeNumber = update.nu, Measured, "", "",
        "Multiplier of the mimicry constraint";
    STEP_FRACTION "step_fraction" MaybeNumber = update.step_fraction, Measured, "", "",
        "The fraction of the step that the line search took; 0 where it took none";
    CORRECTIONS "corrections" MaybeWhole = update.corrections, Measured, "", "",
        "Second-order corrections of the step that was taken";
    CG_ITERATIONS "cg_iterations" MaybeWhole = update.cg_iterations, Measured, "", "",
        "Products that conjugate gradient took";
    RECOVERY_STEPS "recovery_steps" MaybeWhole = update.recovery_steps, Measured, "", "",
        "Steps of the recovery by Eq. (13)";
    DISCRIMINATOR_LOSS "discriminator_loss" MaybeNumber = update.discriminator_loss, Measured,
        "", "",
        "Loss of the discriminator (POfD, GAIL)";
    CLONING_LOSS "cloning_loss" MaybeNumber = update.cloning_loss, Measured, "", "",
        "Loss of behaviour cloning on the demonstration: before the update (pre-training), \
         at the end of cloning (BC)";
    PHYSICS_SECONDS "physics_seconds" Number = physics_seconds, Clock, "physics", "s",
        "Time in the environments' physics, a part of the rollout's";
    ROLLOUT_SECONDS "rollout_seconds" Number = rollout_seconds, Clock, "rollout", "s",
        "Time of the rollout";
    UPDATE_SECONDS "update_seconds" Number = update_seconds, Clock, "update", "s",
        "Time of the update";
}

/// The column that is called `name`, in the Parquet file or in a matrix file.
pub fn find(name: &str) -> Option<&'static Column<Iteration>> {
    COLUMNS
        .iter()
        .copied()
        .find(|column| column.name == name || column.alias == Some(name))
}
