//! From a specification to the objects that train: the one `match` over algorithms.

use super::{RunSink, TrainError};
use crate::{
    algo::{
        Agent, OnPolicy, Update, cloning,
        gail::gail,
        mcpo::Mcpo,
        mmd_il::MmdIl,
        penalty::Penalty,
        pofd::pofd,
        ppo::Ppo,
        pretraining::{Pretrained, Pretraining},
        trpo::Trpo,
    },
    demo::Demonstration,
    env::{EnvError, Spaces, Task},
    nn::{GaussianPolicy, Mlp, Normalizer, Pass},
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

/// What a run does.
pub enum Learner {
    /// Learns from its own rollouts.
    OnPolicy(Box<dyn OnPolicy>),
    /// Learned from the demonstration alone, and takes no step of its own; with what that was like.
    Offline(Agent, Box<Update>),
    /// Learns nothing: uniform actions.
    Uniform,
}

/// The run's algorithm, before its first rollout; `sink` may know the result of behaviour cloning from another run.
///
/// Errors: the demonstration is missing or does not fit, or behaviour cloning diverged.
pub fn learner(spec: &RunSpec, sink: &mut dyn RunSink) -> Result<Learner, TrainError> {
    let agent = agent(spec, Task::new(spec.env, spec.reward, spec.max_steps)?.spaces());
    let mut cloned = |hyperparameters: &cloning::Hyperparameters, agent: Agent, demonstration: &Demonstration| {
        let start = Pretraining { hyperparameters, agent: &agent, demonstration, seed: spec.seed };
        sink.pretrained(&start.key(), &mut |alive| {
            start.train(alive).map_err(|source| TrainError::Algo { iteration: 0, source })
        })
    };
    let on_policy: Box<dyn OnPolicy> = match spec.algorithm.clone() {
        Algorithm::Mcpo(h) => Box::new(Mcpo::new(h, agent, &demonstration(spec)?, spec.seed)),
        Algorithm::Ppo(h) | Algorithm::Expert(h) => Box::new(Ppo::new(h, agent)),
        Algorithm::Pretraining(h) => {
            let demonstration = demonstration(spec)?;
            let agent = cloned(&h.cloning, agent, &demonstration)?;
            Box::new(Pretrained::new(h, agent, demonstration))
        }
        Algorithm::Pofd(h) => Box::new(pofd(h, agent, &demonstration(spec)?, spec.seed)),
        Algorithm::MmdIl(h) => Box::new(MmdIl::new(h, agent, &demonstration(spec)?, spec.seed)),
        Algorithm::Trpo(h) => Box::new(Trpo::new(h, agent)),
        Algorithm::Gail(h) => Box::new(gail(h, agent, &demonstration(spec)?, spec.seed)),
        Algorithm::Penalty(h) => Box::new(Penalty::new(h, agent, &demonstration(spec)?, spec.seed)),
        Algorithm::Bc(h) => {
            let demonstration = demonstration(spec)?;
            let agent = cloned(&h, agent, &demonstration)?;
            let cloning_loss = Some(cloning::loss_of(h.loss, &agent, &demonstration, &mut Pass::default()));
            return Ok(Learner::Offline(agent, Box::new(Update { cloning_loss, ..Update::default() })));
        }
        Algorithm::Random(_) => return Ok(Learner::Uniform),
    };
    Ok(Learner::OnPolicy(on_policy))
}

/// The run's demonstration, checked against its environment.
fn demonstration(spec: &RunSpec) -> Result<Demonstration, TrainError> {
    let path = spec.demonstration.as_deref().ok_or(TrainError::NoDemonstration)?;
    Ok(Demonstration::read_for(path, spec.env)?)
}
