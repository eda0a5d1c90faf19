//! From a specification to the objects that train: the one `match` over algorithms.

use super::TrainError;
use crate::{
    algo::{Agent, OnPolicy, mcpo::Mcpo, ppo::Ppo},
    demo::Demonstration,
    env::{EnvError, Spaces, Task},
    nn::{GaussianPolicy, Mlp, Normalizer},
    plan::RunSpec,
    rng::Stream,
    spec::Algorithm,
};

/// `count` copies of the run's task.
pub fn tasks(spec: &RunSpec, count: usize) -> Result<Vec<Task>, EnvError> {
    (0..count).map(|_| Task::new(spec.env, spec.reward, spec.max_steps)).collect()
}

/// The untrained agent: policy first, then value network, from the one stream of the run.
pub fn agent(spec: &RunSpec, spaces: Spaces) -> Agent {
    let mut rng = spec.seed.stream(Stream::Network, 0);
    let hidden: Vec<usize> = spec.network.hidden.iter().map(|width| width.size()).collect();
    let std = spec.network.initial_std.get();
    let policy = GaussianPolicy::new(spaces.observation_dim, &hidden, spaces.action_dim, std, &mut rng);
    let widths = [&[spaces.observation_dim], hidden.as_slice(), &[1]].concat();
    // A value network that starts at zero: while a sparse reward was never seen, advantages are exactly zero, and the
    // policy stands still instead of following the noise of random values.
    let value = Mlp::new(&widths, 0.0, &mut rng);
    Agent { policy, value, normalizer: Normalizer::new(spaces.observation_dim, spec.network.observation_clip.get()) }
}

/// The run's algorithm, before its first update.
///
/// Errors: the demonstration is missing or does not fit.
pub fn algorithm(spec: &RunSpec, agent: Agent) -> Result<Box<dyn OnPolicy>, TrainError> {
    Ok(match &spec.algorithm {
        Algorithm::Ppo(hyperparameters) => Box::new(Ppo::new(hyperparameters.clone(), agent)),
        Algorithm::Mcpo(hyperparameters) => {
            Box::new(Mcpo::new(hyperparameters.clone(), agent, &demonstration(spec)?, spec.seed))
        }
    })
}

/// The run's demonstration, checked against its environment.
fn demonstration(spec: &RunSpec) -> Result<Demonstration, TrainError> {
    let path = spec.demonstration.as_deref().ok_or(TrainError::NoDemonstration)?;
    Ok(Demonstration::read_for(path, spec.env)?)
}
