//! Experience: several environments stepped together under one policy.

use std::time::{Duration, Instant};

use nalgebra::DMatrix;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::{
    algo::{Agent, Batch, Segment, SegmentEnd},
    env::{EnvError, EpisodeEnd, Task},
    nn::Pass,
    rng::{Rng, Seed, Stream},
};

/// The environments of a run, each somewhere in an episode.
pub struct Rollout {
    tasks: Vec<Task>,
    lanes: Vec<Lane>,
    pass: Pass,
}

/// What belongs to one environment beside its physics.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Lane {
    resets: Rng,
    noise: Rng,
    observation: Vec<f64>,
    episode: Episode,
}

/// An episode under way, or ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// Sum of dense rewards.
    pub dense_return: f64,
    /// Sum of the rewards that are trained on.
    pub training_return: f64,
    /// Steps.
    pub length: u64,
}

/// What one rollout gave.
pub struct Collected {
    /// For the update.
    pub batch: Batch,
    /// The episodes that ended, environment by environment.
    pub episodes: Vec<Episode>,
    /// Time spent in the environments.
    pub physics: Duration,
}

impl Rollout {
    /// `tasks`, each at the start of its first episode.
    pub fn new(mut tasks: Vec<Task>, seed: Seed) -> Self {
        let lanes = (0u32..)
            .zip(&mut tasks)
            .map(|(index, task)| {
                let mut resets = seed.stream(Stream::Environment, index);
                let mut observation = vec![0.0; task.spaces().observation_dim];
                task.reset(&mut resets, &mut observation);
                Lane { resets, noise: seed.stream(Stream::Action, index), observation, episode: Episode::default() }
            })
            .collect();
        Self { tasks, lanes, pass: Pass::default() }
    }

    /// Steps every environment `steps` times under `agent`'s policy, whose normaliser sees each observation before the
    /// policy does.
    ///
    /// Errors: the physics failed.
    pub fn collect(&mut self, agent: &mut Agent, steps: usize) -> Result<Collected, EnvError> {
        let Self { tasks, lanes, pass } = self;
        let spaces = tasks[0].spaces();
        let (observation_dim, action_dim) = (spaces.observation_dim, spaces.action_dim);
        let samples = steps * tasks.len();
        let mut observations = DMatrix::<f32>::zeros(observation_dim, samples);
        let mut raw_observations = DMatrix::<f64>::zeros(observation_dim, samples);
        let mut actions = DMatrix::<f32>::zeros(action_dim, samples);
        let mut rewards = vec![0.0; samples];
        let mut segments: Vec<Vec<Segment>> = vec![Vec::new(); tasks.len()];
        let mut starts: Vec<usize> = (0..tasks.len()).map(|lane| lane * steps).collect();
        let mut episodes: Vec<Vec<Episode>> = vec![Vec::new(); tasks.len()];
        let mut inputs = DMatrix::<f32>::zeros(observation_dim, tasks.len());
        let mut action = vec![0.0; action_dim];
        let std: Vec<f32> = agent.policy.log_std().iter().map(|s| s.exp()).collect();
        let mut physics = Duration::ZERO;

        for t in 0..steps {
            for lane in lanes.iter() {
                agent.normalizer.update(&lane.observation);
            }
            for (lane, input) in lanes.iter().zip(inputs.as_mut_slice().chunks_exact_mut(observation_dim)) {
                agent.normalizer.normalize(&lane.observation, input);
            }
            agent.policy.forward(&inputs, pass);
            let means = pass.output();
            for (index, lane) in lanes.iter_mut().enumerate() {
                let sample = index * steps + t;
                for (row, std) in std.iter().enumerate() {
                    let noise: f32 = StandardNormal.sample(&mut lane.noise);
                    actions[(row, sample)] = means[(row, index)] + std * noise;
                }
            }
            for (index, lane) in lanes.iter().enumerate() {
                let sample = index * steps + t;
                observations.column_mut(sample).copy_from(&inputs.column(index));
                raw_observations.column_mut(sample).copy_from_slice(&lane.observation);
            }
            let began = Instant::now();
            for (index, (task, lane)) in tasks.iter_mut().zip(lanes.iter_mut()).enumerate() {
                let sample = index * steps + t;
                action.iter_mut().zip(actions.column(sample).iter()).for_each(|(a, &sampled)| *a = f64::from(sampled));
                let transition = task.step(&action, &mut lane.observation)?;
                rewards[sample] = transition.reward;
                lane.episode.dense_return += transition.dense_reward;
                lane.episode.training_return += transition.reward;
                lane.episode.length += 1;
                if let Some(end) = transition.end {
                    let end = match end {
                        EpisodeEnd::Terminated => SegmentEnd::Terminated,
                        EpisodeEnd::Truncated => bootstrapped(agent, &lane.observation),
                    };
                    segments[index].push(Segment { range: starts[index]..sample + 1, end });
                    starts[index] = sample + 1;
                    episodes[index].push(std::mem::take(&mut lane.episode));
                    task.reset(&mut lane.resets, &mut lane.observation);
                }
            }
            physics += began.elapsed();
        }
        for (index, lane) in lanes.iter().enumerate() {
            let end = (index + 1) * steps;
            if starts[index] < end {
                let end_of_segment = bootstrapped(agent, &lane.observation);
                segments[index].push(Segment { range: starts[index]..end, end: end_of_segment });
            }
        }
        let batch = Batch { observations, raw_observations, actions, rewards, segments: segments.concat() };
        Ok(Collected { batch, episodes: episodes.concat(), physics })
    }

    /// Takes the steps of `batch` again, from the state in which its rollout began, with the physics alone: what
    /// `mcpo-run bench` holds a rollout against. Episodes begin as they did.
    ///
    /// Errors: the physics failed.
    pub fn replay(&mut self, batch: &Batch) -> Result<(), EnvError> {
        let Self { tasks, lanes, .. } = self;
        let steps = batch.len() / tasks.len();
        let mut action = vec![0.0; batch.actions.nrows()];
        for Segment { range, .. } in &batch.segments {
            let index = range.start / steps;
            let (task, lane) = (&mut tasks[index], &mut lanes[index]);
            for column in batch.actions.columns_range(range.clone()).column_iter() {
                action.iter_mut().zip(column.iter()).for_each(|(a, &sampled)| *a = f64::from(sampled));
                task.advance(&action)?;
            }
            if range.end < (index + 1) * steps {
                task.reset(&mut lane.resets, &mut lane.observation);
            }
        }
        Ok(())
    }

    /// Everything the next rollout depends on, the agent apart.
    pub fn save(&self) -> RolloutState {
        RolloutState { lanes: self.lanes.clone(), tasks: self.tasks.iter().map(Task::save).collect() }
    }

    /// Puts back what [`save`](Rollout::save) gave.
    ///
    /// Errors: the state is of other environments.
    pub fn restore(&mut self, state: RolloutState) -> Result<(), EnvError> {
        for (task, saved) in self.tasks.iter_mut().zip(&state.tasks) {
            task.restore(saved)?;
        }
        self.lanes = state.lanes;
        Ok(())
    }
}

/// A saved [`Rollout`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RolloutState {
    lanes: Vec<Lane>,
    tasks: Vec<Vec<f64>>,
}

fn bootstrapped(agent: &Agent, observation: &[f64]) -> SegmentEnd {
    let mut last_observation = vec![0.0; observation.len()];
    agent.normalizer.normalize(observation, &mut last_observation);
    SegmentEnd::Bootstrapped { last_observation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        env::{EnvId, Reward},
        nn::{GaussianPolicy, Mlp, Normalizer},
    };

    fn agent() -> Agent {
        let mut rng = Seed(0).stream(Stream::Network, 0);
        Agent {
            policy: GaussianPolicy::new(11, &[8], 3, 0.5, &mut rng),
            value: Mlp::new(&[11, 8, 1], 0.0, &mut rng),
            normalizer: Normalizer::new(11, 10.0),
        }
    }

    fn rollout(lanes: usize) -> Rollout {
        let task = || Task::new(EnvId::Hopper, Reward::Dense, 1000).expect("a task");
        Rollout::new((0..lanes).map(|_| task()).collect(), Seed(0))
    }

    #[test]
    fn a_replay_ends_where_the_rollout_did() {
        let (mut first, mut second) = (rollout(3), rollout(3));
        let mut agent = agent();
        first.collect(&mut agent, 37).expect("physics"); // so that episodes are under way
        second.restore(first.save()).expect("the same environments");
        let collected = first.collect(&mut agent, 100).expect("physics");
        assert!(collected.episodes.len() >= 3, "an untrained hopper falls soon");
        second.replay(&collected.batch).expect("physics");
        for (index, (one, other)) in first.tasks.iter().zip(&second.tasks).enumerate() {
            assert!(first.lanes[index].episode.length > 0, "this seed's rollout ends within all three episodes");
            assert_eq!(one.pose(), other.pose(), "environment {index}");
        }
    }
}
