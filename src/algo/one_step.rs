//! A task for tests that takes milliseconds: one step an episode, observations on a line, actions
//! on a line.

use nalgebra::DMatrix;
use rand::RngExt as _;
use rand_distr::{Distribution, StandardNormal};

use super::{Agent, Batch, Segment, SegmentEnd};
use crate::{
    demo::Demonstration,
    nn::{GaussianPolicy, Mlp, Normalizer, Pass},
    rng::{Rng, Seed, Stream},
};

/// An agent for the task, with small networks and a standard deviation of `std`.
pub fn agent(std: f64) -> Agent {
    let mut rng = Seed(1).stream(Stream::Network, 0);
    Agent {
        policy: GaussianPolicy::new(1, &[16, 16], 1, std, &mut rng),
        value: Mlp::new(&[1, 16, 16, 1], 0.0, &mut rng),
        normalizer: Normalizer::new(1, 10.0),
    }
}

/// `n` episodes of one step: the raw observation is uniform in [-1, 1], the reward
/// `reward(observation, action)`. The agent's normaliser is used, and left as it is.
pub fn batch(agent: &Agent, n: usize, reward: impl Fn(f64, f64) -> f64, rng: &mut Rng) -> Batch {
    let raw = DMatrix::from_fn(1, n, |_, _| f64::from(rng.random_range(-1.0f32..1.0)));
    let observations = agent.normalizer.normalize_columns(&raw);
    let mut pass = Pass::default();
    agent.policy.forward(&observations, &mut pass);
    let std = agent.policy.log_std()[0].exp();
    let means = pass.output().into_owned();
    let actions = means.map(|mean| {
        let noise: f32 = StandardNormal.sample(rng);
        mean + std * noise
    });
    let rewards = raw
        .iter()
        .zip(&actions)
        .map(|(&s, &a)| reward(s, a.into()))
        .collect();
    let segments = (0..n)
        .map(|i| Segment {
            range: i..i + 1,
            end: SegmentEnd::Terminated,
        })
        .collect();
    Batch {
        raw_observations: raw,
        observations,
        means,
        actions,
        rewards,
        segments,
    }
}

/// A demonstration of `m` steps with the action `action(observation)`.
pub fn demonstration(m: usize, action: impl Fn(f64) -> f64) -> Demonstration {
    let observations = DMatrix::from_fn(1, m, |_, i| 2.0 * i as f64 / m as f64 - 1.0);
    Demonstration {
        actions: observations.map(action),
        observations,
        rewards: None,
        episode_starts: vec![0],
        terminated: vec![false; m],
        truncated: vec![false; m],
        poses: None,
        provenance: Vec::new(),
    }
}

/// The mean reward of the policy's mean action.
pub fn score(agent: &Agent, reward: impl Fn(f64, f64) -> f64) -> f64 {
    let raw = DMatrix::from_fn(1, 101, |_, i| i as f64 / 50.0 - 1.0);
    let mut pass = Pass::default();
    agent
        .policy
        .forward(&agent.normalizer.normalize_columns(&raw), &mut pass);
    raw.iter()
        .zip(pass.output().iter())
        .map(|(&s, &a)| reward(s, a.into()))
        .sum::<f64>()
        / 101.0
}
