//! Training: one run, from its specification to its last evaluation.
//!
//! Owns the loops, the rollout and the evaluation. Knows no algorithm by name, and nothing of files
//! or processes: what happens is told to a [`RunSink`]. Start at [`run`].

pub mod build;
pub mod evaluate;
mod offline;
mod on_policy;
pub mod rollout;

pub use crate::measured::{EvaluationEpisode, Iteration};

use crate::{
    algo::{Agent, AlgoError, Learner, pretraining::Pretraining},
    demo::DemoError,
    env::EnvError,
    plan::RunSpec,
};

/// The sink's answer to a row: whether training goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// Training goes on.
    Continue,
    /// Training stops here, cleanly.
    Stop,
}

/// Returns the agent that a pre-training leads to, by training it or from where such agents are
/// kept under the training's [key](Pretraining::key).
/// Calls its second argument now and then, as a sign of life.
pub type Clones<'a> =
    dyn FnMut(&Pretraining<'_>, &mut dyn FnMut()) -> Result<Agent, TrainError> + 'a;

/// The receiver of everything that happens in training.
pub trait RunSink {
    /// An iteration ended. `checkpoint` gives the whole state, if the sink wants to keep it.
    ///
    /// # Errors
    ///
    /// The sink could not keep it; the run ends.
    fn iteration(
        &mut self,
        row: &Iteration,
        checkpoint: &dyn Fn() -> Vec<u8>,
    ) -> Result<Flow, SinkError>;

    /// An evaluation ended.
    ///
    /// # Errors
    ///
    /// As for [`iteration`](Self::iteration).
    fn evaluation(&mut self, episodes: &[EvaluationEpisode]) -> Result<(), SinkError>;

    /// The policy after `env_steps`, to be kept: at the intervals of
    /// `checkpoint.keep_policy_every`, and at the end.
    ///
    /// # Errors
    ///
    /// As for [`iteration`](Self::iteration).
    fn policy(&mut self, env_steps: u64, last: bool, agent: &Agent) -> Result<(), SinkError>;

    /// Some work was done that is none of the above: called often, so that a watcher notices a
    /// standstill.
    fn alive(&mut self) {}
}

/// A sink could not keep what it was told.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SinkError(pub String);

/// An error that ends a run early.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The environment failed.
    #[error(transparent)]
    Env(#[from] EnvError),
    /// The demonstration cannot be used.
    #[error(transparent)]
    Demo(#[from] DemoError),
    /// An algorithm that needs a demonstration was given none.
    #[error(
        "this algorithm needs a demonstration; name its file with \
         `environments.<env>.demonstrations`"
    )]
    NoDemonstration,
    /// The update failed.
    #[error("iteration {iteration}: {source}")]
    Algo {
        /// The iteration, counted from 1.
        iteration: u64,
        /// The algorithm's error.
        source: AlgoError,
    },
    /// The sink failed.
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// A checkpoint that does not fit.
    #[error("cannot resume from the checkpoint: {0}")]
    Checkpoint(String),
}

/// How a run ended without error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The run used its budget.
    Finished,
    /// The sink asked the run to stop.
    Stopped,
}

/// Trains `spec` from its start, or from `checkpoint`, and tells `sink` everything that happens.
///
/// # Errors
///
/// The demonstration or a checkpoint cannot be used, training diverged, or the sink failed.
pub fn run(
    spec: &RunSpec,
    checkpoint: Option<&[u8]>,
    sink: &mut dyn RunSink,
) -> Result<Ending, TrainError> {
    run_with(spec, &mut build::cloned, checkpoint, sink)
}

/// As [`run`], with cloned agents from `clones`.
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
            // A resumed run has this row already.
            if checkpoint.is_none()
                && sink.iteration(&Iteration::before_any(*learned), &Vec::new)? == Flow::Stop
            {
                return Ok(Ending::Stopped);
            }
            offline::run(spec, Some(&agent), sink)
        }
        Learner::Uniform => offline::run(spec, None, sink),
    }
}
