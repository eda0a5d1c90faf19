//! Demonstrations, and how far a policy is from one.
//!
//! Owns the Parquet format, import, verification by re-simulation, the Gaussian kernel and the MMD. Knows nothing of
//! networks or updates. Start at [`Demonstration`] and [`mmd`].

mod kernel;
pub mod mmd;
mod pairs;
mod parquet;
mod verify;

use std::path::PathBuf;

use nalgebra::DMatrix;

pub use kernel::{Bandwidth, Kernel};
pub use mmd::Estimator;
pub use verify::{Deviation, verify};

use crate::env::{EnvId, Pose};

/// Episodes of somebody else's behaviour, step after step.
#[derive(Debug, Clone, PartialEq)]
pub struct Demonstration {
    /// Raw observations, each before its step `[observation_dim x n]`.
    pub observations: DMatrix<f64>,
    /// Raw actions, unclamped `[action_dim x n]`.
    pub actions: DMatrix<f64>,
    /// Dense rewards `[n]`; absent where the source had none.
    pub rewards: Option<Vec<f64>>,
    /// Index of the first step of each episode, in order; the first is 0.
    pub episode_starts: Vec<usize>,
    /// Whether the task ended the episode at this step `[n]`.
    pub terminated: Vec<bool>,
    /// Whether the time limit cut the episode at this step `[n]`.
    pub truncated: Vec<bool>,
    /// Poses before each step `[n]`; absent where the source had none.
    pub poses: Option<Vec<Pose>>,
    /// Where it comes from, as key and value: environment, seed, checkpoint, return ...
    pub provenance: Vec<(String, String)>,
}

/// What can go wrong with a demonstration; the message names the file.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// The file cannot be opened or read.
    #[error("cannot read the demonstration {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the reader said.
        reason: String,
    },
    /// The file is readable but not a demonstration of this environment.
    #[error("the demonstration {} does not fit {env}: {reason}", path.display())]
    Misfit {
        /// The file.
        path: PathBuf,
        /// The environment.
        env: EnvId,
        /// What does not fit.
        reason: String,
    },
}
