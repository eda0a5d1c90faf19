//! Training: one run, from its specification to its last evaluation.
//!
//! Owns the loops, the rollout and the evaluation. Knows no algorithm by name, and nothing of files or processes: what
//! happens is told to a [`RunSink`]. Start at [`run`].

pub mod build;
pub mod evaluate;
mod offline;
mod on_policy;
pub mod rollout;

use serde::{Deserialize, Serialize};

use crate::{
    algo::{Agent, AlgoError, Learner, Update, pretraining::Pretraining},
    demo::DemoError,
    env::EnvError,
    plan::RunSpec,
};

/// One iteration of training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Iteration {
    /// Counted from 1; 0 for what was learned before the first step.
    pub iteration: u64,
    /// Environment steps so far, this iteration's included.
    pub env_steps: u64,
    /// Episodes that ended in this iteration's rollout.
    pub episodes: u64,
    /// Mean dense return of those episodes.
    pub dense_return: Option<f64>,
    /// Mean return of those episodes in the reward that is trained on.
    pub training_return: Option<f64>,
    /// Mean length of those episodes, steps.
    pub episode_length: Option<f64>,
    /// The record of the update.
    pub update: Update,
    /// Seconds in the environments' physics, part of the rollout's.
    pub physics_seconds: f64,
    /// Seconds of the rollout.
    pub rollout_seconds: f64,
    /// Seconds of the update.
    pub update_seconds: f64,
}

impl Iteration {
    /// The row of what was learned before the first step in an environment.
    fn before_any(update: Update) -> Self {
        Self {
            iteration: 0,
            env_steps: 0,
            episodes: 0,
            dense_return: None,
            training_return: None,
            episode_length: None,
            update,
            physics_seconds: 0.0,
            rollout_seconds: 0.0,
            update_seconds: 0.0,
        }
    }
}

/// One evaluation episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvaluationEpisode {
    /// Environment steps of training behind the policy.
    pub env_steps: u64,
    /// Whether this is the evaluation at the end of training.
    pub last: bool,
    /// Counted from 0 within the evaluation.
    pub episode: u64,
    /// Return in the dense reward.
    pub dense_return: f64,
    /// Return in the reward that is trained on.
    pub training_return: f64,
    /// Steps.
    pub length: u64,
}

/// The sink's answer to a row: whether training goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    Continue,
    /// Stop here, cleanly.
    Stop,
}

/// Gives the agent that a pre-training leads to: by that training, or from where such agents are kept under the training's
/// [key](Pretraining::key). Calls what it is given beside it now and then, as a sign of life.
pub type Clones<'a> = dyn FnMut(&Pretraining<'_>, &mut dyn FnMut()) -> Result<Agent, TrainError> + 'a;

/// Where training tells what happens.
pub trait RunSink {
    /// An iteration ended. `checkpoint` gives the whole state when the sink wants to keep it.
    ///
    /// # Errors
    ///
    /// The sink could not keep it; the run ends.
    fn iteration(&mut self, row: &Iteration, checkpoint: &dyn Fn() -> Vec<u8>) -> Result<Flow, SinkError>;

    /// An evaluation ended.
    ///
    /// # Errors
    ///
    /// As for [`iteration`](Self::iteration).
    fn evaluation(&mut self, episodes: &[EvaluationEpisode]) -> Result<(), SinkError>;

    /// The policy after `env_steps`, to be kept: at the intervals of `checkpoint.keep_policy_every`, and at the end.
    ///
    /// # Errors
    ///
    /// As for [`iteration`](Self::iteration).
    fn policy(&mut self, env_steps: u64, last: bool, agent: &Agent) -> Result<(), SinkError>;

    /// A part of something long was done that is none of the above: called often, for those who look out for a standstill.
    fn alive(&mut self) {}
}

/// A sink could not keep what it was told.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SinkError(pub String);

/// An error that ends a run before its time.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The environment.
    #[error(transparent)]
    Env(#[from] EnvError),
    /// The demonstration.
    #[error(transparent)]
    Demo(#[from] DemoError),
    /// An algorithm that needs a demonstration was given none.
    #[error("this algorithm needs a demonstration; name its file with `environments.<env>.demonstrations`")]
    NoDemonstration,
    /// The update.
    #[error("iteration {iteration}: {source}")]
    Algo {
        /// The iteration, counted from 1.
        iteration: u64,
        /// The algorithm's error.
        source: AlgoError,
    },
    /// The sink.
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// A checkpoint that does not fit.
    #[error("cannot resume from the checkpoint: {0}")]
    Checkpoint(String),
}

/// How a run ended without error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// It used its budget.
    Finished,
    /// The sink asked it to stop.
    Stopped,
}

/// Trains `spec` from its start, or from `checkpoint`, and tells `sink` what happens.
///
/// # Errors
///
/// The demonstration or a checkpoint cannot be used, training diverged, or the sink failed.
pub fn run(spec: &RunSpec, checkpoint: Option<&[u8]>, sink: &mut dyn RunSink) -> Result<Ending, TrainError> {
    run_with(spec, &mut build::cloned, checkpoint, sink)
}

/// The same, where cloned agents come from `clones`.
///
/// # Errors
///
/// As for [`run`], and those of `clones`.
pub fn run_with(
    spec: &RunSpec,
    clones: &mut Clones<'_>,
    checkpoint: Option<&[u8]>,
    sink: &mut dyn RunSink,
) -> Result<Ending, TrainError> {
    match build::learner(spec, clones, &mut || sink.alive())? {
        Learner::OnPolicy(algorithm) => on_policy::run(spec, algorithm, checkpoint, sink),
        Learner::Offline(agent, learned) => {
            // A run that was stopped here has this row already.
            if checkpoint.is_none() && sink.iteration(&Iteration::before_any(*learned), &Vec::new)? == Flow::Stop {
                return Ok(Ending::Stopped);
            }
            offline::run(spec, Some(&agent), sink)
        }
        Learner::Uniform => offline::run(spec, None, sink),
    }
}
