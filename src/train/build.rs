//! From a specification to the objects that train.

use super::{Clones, TrainError};
use crate::{
    algo::{Agent, AlgoError, Learner, Start, pretraining::Pretraining},
    demo::Demonstration,
    env::{EnvError, Spaces, Task},
    nn::{GaussianPolicy, Mlp, Normalizer},
    plan::RunSpec,
    rng::Stream,
};

/// `count` copies of the run's task.
///
/// # Errors
///
/// The environment cannot be built, or does not have the reward.
pub fn tasks(spec: &RunSpec, count: usize) -> Result<Vec<Task>, EnvError> {
    (0..count)
        .map(|_| Task::new(spec.env, spec.reward, spec.max_steps))
        .collect()
}

/// The untrained agent: policy first, then value network, from the one stream of the run.
pub fn agent(spec: &RunSpec, spaces: Spaces) -> Agent {
    let mut rng = spec.seed.stream(Stream::Network, 0);
    let hidden: Vec<usize> = spec
        .network
        .hidden
        .iter()
        .map(|width| width.size())
        .collect();
    let std = spec.network.initial_std.get();
    let policy = GaussianPolicy::new(
        spaces.observation_dim,
        &hidden,
        spaces.action_dim,
        std,
        &mut rng,
    );
    let widths = [&[spaces.observation_dim], hidden.as_slice(), &[1]].concat();
    // The value network starts at zero: as long as a sparse reward was never seen, advantages are
    // exactly zero, and the policy stands still instead of following the noise of random values.
    let value = Mlp::new(&widths, 0.0, &mut rng);
    Agent {
        policy,
        value,
        normalizer: Normalizer::new(spaces.observation_dim, spec.network.observation_clip.get()),
    }
}

/// The run's learner, before its first rollout.
/// Behaviour cloning, if the run has any, is left to `clones`, which calls `alive` now and then.
///
/// # Errors
///
/// The demonstration is missing or does not fit, or behaviour cloning diverged.
pub fn learner(
    spec: &RunSpec,
    clones: &mut Clones<'_>,
    alive: &mut dyn FnMut(),
) -> Result<Learner, TrainError> {
    let mut agent = agent(
        spec,
        Task::new(spec.env, spec.reward, spec.max_steps)?.spaces(),
    );
    let demonstration = spec
        .algorithm
        .uses_demonstration()
        .then(|| demonstration(spec))
        .transpose()?;
    if let (Some(hyperparameters), Some(demonstration)) = (spec.algorithm.cloning(), &demonstration)
    {
        let start = Pretraining {
            hyperparameters,
            agent: &agent,
            demonstration,
            seed: spec.seed,
        };
        agent = clones(&start, alive)?;
    }
    spec.algorithm
        .start(Start {
            agent,
            demonstration,
            seed: spec.seed,
        })
        .map_err(before_any)
}

/// The agent after `start`, trained in this process; `alive` is called after each epoch.
///
/// # Errors
///
/// The loss is no longer finite.
pub fn cloned(start: &Pretraining<'_>, alive: &mut dyn FnMut()) -> Result<Agent, TrainError> {
    start.train(alive).map_err(before_any)
}

/// An error of the algorithm before the first iteration.
fn before_any(source: AlgoError) -> TrainError {
    TrainError::Algo {
        iteration: 0,
        source,
    }
}

/// The run's demonstration, checked against its environment.
fn demonstration(spec: &RunSpec) -> Result<Demonstration, TrainError> {
    let path = spec
        .demonstration
        .as_deref()
        .ok_or(TrainError::NoDemonstration)?;
    Ok(Demonstration::read_for(path, spec.env)?)
}
