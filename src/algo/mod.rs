//! The algorithms: one file each, with its hyperparameters, over shared parts.
//!
//! Owns what turns a batch of experience into a better policy. Never steps an environment, reads a
//! file or prints. Start at [`mcpo`], whose update reads like the paper; [`OnPolicy`] is what the
//! training loop sees. A new algorithm is a file with its [`Definition`] and a line in the
//! [`catalogue`], or a crate of its own that calls [`catalogue::register`].

pub mod adversarial;
mod algorithm;
pub mod batch;
pub mod catalogue;
pub mod cloning;
pub mod critic;
pub mod definition;
pub mod discriminator;
pub mod gae;
pub mod gail;
pub mod mcpo;
pub mod mimicry;
pub mod mmd_il;
#[cfg(test)]
mod one_step;
pub mod operations;
pub mod penalty;
pub mod pofd;
pub mod ppo;
pub mod pretraining;
mod random;
#[cfg(test)]
mod reference;
pub mod revision;
mod stopwatch;
pub mod tolerance;
pub mod trpo;
pub mod trust_region;

use serde::{Deserialize, Serialize};

pub use algorithm::{Algorithm, Entry};
pub use batch::{Batch, Segment, SegmentEnd};
pub use definition::{About, Definition, Learner, Start};

use crate::{
    nn::{GaussianPolicy, Mlp, Normalizer},
    rng::Rng,
};

/// The learner's parameters: a policy, a value network, and the normaliser of both networks'
/// inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Agent {
    /// The policy.
    pub policy: GaussianPolicy,
    /// The value network, `[observation_dim] -> [1]`.
    pub value: Mlp,
    /// The running normaliser of observations.
    pub normalizer: Normalizer,
}

impl Agent {
    /// Widths of the hidden layers, which all networks of a run share.
    pub fn hidden(&self) -> &[usize] {
        let widths = self.value.widths();
        &widths[1..widths.len() - 1]
    }
}

/// An error of an algorithm.
#[derive(Debug, thiserror::Error)]
pub enum AlgoError {
    /// A number is no longer finite.
    #[error("{what} is {value} in this update: training diverged")]
    Diverged {
        /// The quantity.
        what: &'static str,
        /// NaN or an infinity.
        value: f64,
    },
    /// The linearised problem has no solution of any case.
    #[error(
        "the update's linear problem is undefined (q = {q}, r = {r}, s = {s:?}): training diverged"
    )]
    Undefined {
        /// `g.H^-1 g`.
        q: f64,
        /// `b.H^-1 g`.
        r: f64,
        /// `b.H^-1 b`, where it was needed.
        s: Option<f64>,
    },
    /// A saved state is of another algorithm or shape.
    #[error("the saved state of {algorithm} cannot be read: {source}")]
    State {
        /// The algorithm's name.
        algorithm: &'static str,
        /// The reader's error.
        source: postcard::Error,
    },
    /// An algorithm takes a demonstration that its definition does not ask for.
    #[error("this algorithm learns from a demonstration, and its definition does not say so")]
    NoDemonstration,
    /// The demonstration does not fit the algorithm.
    #[error(transparent)]
    Demonstration(#[from] crate::demo::DemoError),
}

/// One algorithm that learns from its own rollouts. The training loop collects a batch with the
/// agent's policy, and hands it to [`update`](OnPolicy::update), once an iteration.
pub trait OnPolicy: Send {
    /// The agent whose policy acts.
    fn agent(&self) -> &Agent;

    /// The agent, for the rollout, which updates the normaliser.
    fn agent_mut(&mut self) -> &mut Agent;

    /// Improves the policy on one batch. `rng` is the stream of updates.
    ///
    /// # Errors
    ///
    /// A loss or parameter is no longer finite.
    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError>;

    /// Everything that the next update depends on, the agent included.
    fn save(&self) -> Vec<u8>;

    /// Restores a state of [`save`](OnPolicy::save).
    ///
    /// # Errors
    ///
    /// The bytes are of another algorithm or shape.
    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError>;
}

/// The record of one update; a quantity that the algorithm does not have is `None`, and a null in
/// the results.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Update {
    /// Mean KL of the new policy from the old one, nats.
    pub kl: Option<f64>,
    /// Entropy of the new policy, nats.
    pub entropy: Option<f64>,
    /// The surrogate's gain: new value minus old.
    pub surrogate_gain: Option<f64>,
    /// Mean squared error of the value network after the update's last pass.
    pub value_loss: Option<f64>,
    /// Share of samples whose probability ratio was clipped (PPO).
    pub clip_fraction: Option<f64>,
    /// `D(theta_k)`: MMD^2 to the demonstration, before the update.
    pub mmd: Option<f64>,
    /// `D(theta_k+1)`, after the update.
    pub mmd_after: Option<f64>,
    /// `d_k`, the tolerance in force.
    pub d: Option<f64>,
    /// The case of the dual; see `algo::mcpo`.
    pub case: Option<String>,
    /// Multiplier of the KL constraint.
    pub lambda: Option<f64>,
    /// Multiplier of the mimicry constraint.
    pub nu: Option<f64>,
    /// The fraction of the step that the line search took; 0 when it rejected all.
    pub step_fraction: Option<f64>,
    /// Second-order corrections of the accepted trial.
    pub corrections: Option<u64>,
    /// Products that conjugate gradient took.
    pub cg_iterations: Option<u64>,
    /// Steps of the recovery by Eq. (13).
    pub recovery_steps: Option<u64>,
    /// The discriminator's loss (POfD, GAIL).
    pub discriminator_loss: Option<f64>,
    /// Loss of behaviour cloning on the demonstration.
    /// In pre-training, before the update: it tells how much of the clone is left. In BC, at the
    /// end of cloning.
    pub cloning_loss: Option<f64>,
    /// Seconds in each named part of the update, for `mcpo-run bench`.
    #[serde(default)]
    pub seconds: Vec<(String, f64)>,
}

/// Serialises a `state` to be saved.
pub fn to_bytes<T: Serialize>(state: &T) -> Vec<u8> {
    postcard::to_stdvec(state).expect("a state of numbers and vectors always serialises")
}

/// The state of `algorithm` in `bytes`.
///
/// # Errors
///
/// The bytes are of another state.
pub fn from_bytes<'a, T: Deserialize<'a>>(
    algorithm: &'static str,
    bytes: &'a [u8],
) -> Result<T, AlgoError> {
    postcard::from_bytes(bytes).map_err(|source| AlgoError::State { algorithm, source })
}

/// `value`, or the error that training diverged when it is not finite.
pub(crate) fn finite(what: &'static str, value: f64) -> Result<f64, AlgoError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(AlgoError::Diverged { what, value })
    }
}
