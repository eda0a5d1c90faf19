//! The definition of an algorithm, written once, beside its code.
//!
//! Owns the form of it: a [`Definition`], which each algorithm's file fills in and the
//! [catalogue](super::catalogue) lists. The matrix format, the schema, training, `plan`'s costs,
//! `bench` and the reports ask it and name no algorithm. Start at [`Definition`].

use std::fmt;

use serde::{Serialize, de::DeserializeOwned};

use super::{
    Agent, AlgoError, OnPolicy, Update, cloning,
    operations::{Counter, Operations},
    revision::Part,
};
use crate::{demo::Demonstration, env::EnvId, rng::Seed};

/// An algorithm with hyperparameters of the type `H`: a struct, empty where it has none, that
/// refuses unknown fields. Its fields' documentation is that of the keys in the schema.
pub struct Definition<H: 'static> {
    /// Its name, its needs and its costs.
    pub about: About,
    /// The hyperparameters' defaults for an environment.
    pub defaults: fn(EnvId) -> H,
    /// Behaviour cloning on the demonstration before the first rollout, if there is any; runs that
    /// begin alike share the cloned agent.
    pub cloning: Option<fn(&H) -> &cloning::Hyperparameters>,
    /// The learner of a run, ready for its first rollout.
    pub start: fn(H, Start) -> Result<Learner, AlgoError>,
    /// The work of an update, part by part, without the policy's passes of the rollout.
    pub operations: fn(&H, &Counter<'_>) -> Vec<Operations>,
}

/// The facts about an algorithm that others need before it runs.
#[derive(Debug)]
pub struct About {
    /// Its name in matrices, folders and records: lower-case letters, digits and `_`.
    pub name: &'static str,
    /// Its name in figures and tables.
    pub label: &'static str,
    /// Whether it learns from a demonstration.
    pub demonstration: bool,
    /// Whether it trains on the dense reward, whatever the environment's reward says.
    pub dense: bool,
    /// Whether it trains in the environment; other algorithms are only evaluated there.
    pub trains: bool,
    /// Default of `rollout.steps`, the steps of one iteration, if it is not the environment's.
    pub steps: Option<u64>,
    /// The forward passes of a network, or work that takes as long, for one step's sample in an
    /// iteration: a guess for `plan`, which recorded speeds soon replace.
    pub passes: f64,
    /// The part that its numbers depend on; `None` if it computes nothing.
    pub part: Option<&'static Part>,
    /// Hyperparameters that are newer than some recorded runs, each with its neutral value, under
    /// which nothing changes, as JSON.
    /// A run with that value has the fingerprint that it had before the key was there, and a record
    /// that does not name the key is read as if it had that value.
    pub later: &'static [(&'static str, &'static str)],
}

impl About {
    /// An algorithm that learns from its own rollouts alone, on the environment's reward, at the
    /// cost of PPO.
    pub const fn new(name: &'static str, label: &'static str, part: &'static Part) -> Self {
        Self {
            name,
            label,
            demonstration: false,
            dense: false,
            trains: true,
            steps: None,
            passes: 60.0,
            part: Some(part),
            later: &[],
        }
    }
}

/// The data that an algorithm starts from.
pub struct Start {
    /// The run's agent: untrained, or cloned where the definition says so.
    pub agent: Agent,
    /// The run's demonstration, where the definition asks for one.
    pub demonstration: Option<Demonstration>,
    /// The run's seed.
    pub seed: Seed,
}

impl Start {
    /// The agent and the demonstration.
    ///
    /// # Errors
    ///
    /// The definition asks for no demonstration.
    pub fn with_demonstration(self) -> Result<(Agent, Demonstration), AlgoError> {
        Ok((
            self.agent,
            self.demonstration.ok_or(AlgoError::NoDemonstration)?,
        ))
    }

    /// The learner that `build` makes of the agent, the demonstration and the seed.
    ///
    /// # Errors
    ///
    /// The definition asks for no demonstration.
    pub fn imitate<T: OnPolicy + 'static>(
        self,
        build: impl FnOnce(Agent, &Demonstration, Seed) -> T,
    ) -> Result<Learner, AlgoError> {
        let seed = self.seed;
        let (agent, demonstration) = self.with_demonstration()?;
        Ok(Learner::on_policy(build(agent, &demonstration, seed)))
    }
}

/// The ways in which a run reaches its last policy.
pub enum Learner {
    /// Learns from its own rollouts.
    OnPolicy(Box<dyn OnPolicy>),
    /// Has learned from the demonstration alone, and takes no steps of its own; with the record of
    /// that learning.
    Offline(Agent, Box<Update>),
    /// Learns nothing: uniform actions.
    Uniform,
}

impl Learner {
    /// A learner from its own rollouts.
    pub fn on_policy(algorithm: impl OnPolicy + 'static) -> Self {
        Self::OnPolicy(Box::new(algorithm))
    }
}

/// Hyperparameters that a matrix can set and a record can hold; every suitable type has this trait.
pub trait Tunable:
    fmt::Debug + Clone + Serialize + DeserializeOwned + schemars::JsonSchema + Send + Sync + 'static
{
}

impl<
    T: fmt::Debug
        + Clone
        + Serialize
        + DeserializeOwned
        + schemars::JsonSchema
        + Send
        + Sync
        + 'static,
> Tunable for T
{
}

impl<H> fmt::Debug for Definition<H> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.about.fmt(f)
    }
}
