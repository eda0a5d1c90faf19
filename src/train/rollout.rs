//! Experience: several environments stepped together under one policy.

use std::{
    mem,
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

use nalgebra::DMatrix;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::{
    algo::{Agent, Batch, Segment, SegmentEnd},
    arithmetic::threads,
    env::{EnvError, EpisodeEnd, Spaces, Task, Transition},
    nn::Pass,
    rng::{Rng, Seed, Stream},
};

/// The environments of a run, each somewhere in an episode.
pub struct Rollout {
    /// The environments in their order, one group for each thread that steps them.
    groups: Vec<Vec<Lane>>,
    pass: Pass,
}

/// One environment with its data.
struct Lane {
    task: Task,
    own: Own,
    action: Vec<f64>,
    /// The transition of its last step.
    stepped: Option<Result<Transition, EnvError>>,
    /// The observation after that step, if it ended an episode.
    last_observation: Vec<f64>,
}

/// The saved state of one environment beside its physics.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Own {
    resets: Rng,
    noise: Rng,
    observation: Vec<f64>,
    episode: Episode,
}

impl Lane {
    /// Takes a step under `action`, and starts the next episode if one ended.
    fn step(&mut self) {
        let Self {
            task,
            own,
            action,
            stepped,
            last_observation,
        } = self;
        let transition = task.step(action, &mut own.observation);
        if transition
            .as_ref()
            .is_ok_and(|transition| transition.end.is_some())
        {
            last_observation.copy_from_slice(&own.observation);
            task.reset(&mut own.resets, &mut own.observation);
        }
        *stepped = Some(transition);
    }
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

/// The experience of one rollout.
pub struct Collected {
    /// The samples for the update.
    pub batch: Batch,
    /// The episodes that ended, environment by environment.
    pub episodes: Vec<Episode>,
    /// The time spent in the environments.
    pub physics: Duration,
}

impl Rollout {
    /// `tasks`, each at the start of its first episode.
    pub fn new(tasks: Vec<Task>, seed: Seed) -> Self {
        let lane = |(index, mut task): (u32, Task)| {
            let mut resets = seed.stream(Stream::Environment, index);
            let spaces = task.spaces();
            let mut observation = vec![0.0; spaces.observation_dim];
            task.reset(&mut resets, &mut observation);
            let noise = seed.stream(Stream::Action, index);
            let last_observation = observation.clone();
            let own = Own {
                resets,
                noise,
                observation,
                episode: Episode::default(),
            };
            Lane {
                task,
                own,
                action: vec![0.0; spaces.action_dim],
                stepped: None,
                last_observation,
            }
        };
        let threads = threads::count().min(tasks.len());
        let mut lanes = (0u32..).zip(tasks).map(lane).collect::<Vec<_>>();
        // This thread steps the first group itself.
        let groups = (1..=threads)
            .rev()
            .map(|left| lanes.split_off(lanes.len() - lanes.len() / left));
        let mut groups: Vec<_> = groups.collect();
        groups.reverse();
        Self {
            groups,
            pass: Pass::default(),
        }
    }

    /// Steps every environment `steps` times under `agent`'s policy, whose normaliser sees each
    /// observation before the policy does.
    ///
    /// # Errors
    ///
    /// The physics failed.
    pub fn collect(&mut self, agent: &mut Agent, steps: usize) -> Result<Collected, EnvError> {
        let [own, others @ ..] = self.groups.as_mut_slice() else {
            unreachable!("a run has an environment")
        };
        let pass = &mut self.pass;
        thread::scope(|scope| {
            // Each group is sent to its thread to be stepped, and comes back: nobody waits for a
            // lock, and no lane is shared.
            let workers: Vec<_> = others
                .iter()
                .map(|_| {
                    let (to_worker, work) = mpsc::channel::<Vec<Lane>>();
                    let (done, from_worker) = mpsc::channel();
                    scope.spawn(move || {
                        for mut group in work {
                            group.iter_mut().for_each(Lane::step);
                            if done.send(group).is_err() {
                                return;
                            }
                        }
                    });
                    (to_worker, from_worker)
                })
                .collect();
            let step = |own: &mut Vec<Lane>, others: &mut [Vec<Lane>]| {
                for ((to_worker, _), group) in workers.iter().zip(&mut *others) {
                    to_worker
                        .send(mem::take(group))
                        .expect("a thread that steps environments lives as long as the rollout");
                }
                own.iter_mut().for_each(Lane::step);
                for ((_, from_worker), group) in workers.iter().zip(others) {
                    *group = from_worker
                        .recv()
                        .expect("a thread that steps environments lives as long as the rollout");
                }
            };
            collect(agent, own, others, pass, steps, step)
        })
    }

    /// Takes the steps of `batch` again, from the state in which its rollout began, with the
    /// physics alone; `mcpo-run bench` compares a rollout with this.
    /// Episodes begin as they did then.
    ///
    /// # Errors
    ///
    /// The physics failed.
    pub fn replay(&mut self, batch: &Batch) -> Result<(), EnvError> {
        let mut lanes: Vec<&mut Lane> = self.groups.iter_mut().flatten().collect();
        let steps = batch.len() / lanes.len();
        let mut action = vec![0.0; batch.actions.nrows()];
        for Segment { range, .. } in &batch.segments {
            let index = range.start / steps;
            let Lane { task, own, .. } = &mut *lanes[index];
            for column in batch.actions.columns_range(range.clone()).column_iter() {
                action
                    .iter_mut()
                    .zip(column.iter())
                    .for_each(|(a, &sampled)| *a = f64::from(sampled));
                task.advance(&action)?;
            }
            if range.end < (index + 1) * steps {
                task.reset(&mut own.resets, &mut own.observation);
            }
        }
        Ok(())
    }

    /// Everything that the next rollout depends on, except for the agent.
    pub fn save(&self) -> RolloutState {
        let lanes = || self.groups.iter().flatten();
        RolloutState {
            lanes: lanes().map(|lane| lane.own.clone()).collect(),
            tasks: lanes().map(|lane| lane.task.save()).collect(),
        }
    }

    /// Restores a state of [`save`](Rollout::save).
    ///
    /// # Errors
    ///
    /// The state is of other environments.
    pub fn restore(&mut self, state: RolloutState) -> Result<(), EnvError> {
        let saved = state.lanes.into_iter().zip(&state.tasks);
        for (lane, (own, task)) in self.groups.iter_mut().flatten().zip(saved) {
            lane.task.restore(task)?;
            lane.own = own;
        }
        Ok(())
    }
}

/// As [`Rollout::collect`], where `step` steps all lanes, those of `own` and of `others`.
fn collect(
    agent: &mut Agent,
    own: &mut Vec<Lane>,
    others: &mut [Vec<Lane>],
    pass: &mut Pass,
    steps: usize,
    step: impl Fn(&mut Vec<Lane>, &mut [Vec<Lane>]),
) -> Result<Collected, EnvError> {
    let spaces = own[0].task.spaces();
    let count = own.len() + others.iter().map(Vec::len).sum::<usize>();
    let mut filling = Filling::new(spaces, count, steps);
    let mut inputs = DMatrix::<f32>::zeros(spaces.observation_dim, count);
    // The policy does not change during a rollout; only the normaliser does.
    let std: Vec<f32> = agent.policy.log_std().iter().map(|s| s.exp()).collect();
    let mut physics = Duration::ZERO;

    for t in 0..steps {
        // All lanes' observations enter the normaliser before it is used for any of them, so that
        // all are normalised in the same units.
        for lane in own.iter().chain(others.iter().flatten()) {
            agent.normalizer.update(&lane.own.observation);
        }
        let lanes = own.iter().chain(others.iter().flatten());
        for (lane, input) in lanes.zip(
            inputs
                .as_mut_slice()
                .chunks_exact_mut(spaces.observation_dim),
        ) {
            agent.normalizer.normalize(&lane.own.observation, input);
        }
        agent.policy.forward(&inputs, pass);
        for (index, lane) in own
            .iter_mut()
            .chain(others.iter_mut().flatten())
            .enumerate()
        {
            filling.act(index, t, lane, &inputs, pass, &std);
        }
        let began = Instant::now();
        step(own, others);
        physics += began.elapsed();
        for (index, lane) in own
            .iter_mut()
            .chain(others.iter_mut().flatten())
            .enumerate()
        {
            filling.take(index, t, lane, agent)?;
        }
    }
    for (index, lane) in own.iter().chain(others.iter().flatten()).enumerate() {
        filling.cut(index, lane, agent);
    }
    Ok(filling.collected(physics))
}

/// A batch that is filled by the steps of its lanes.
struct Filling {
    /// The steps of each lane.
    steps: usize,
    /// The batch; its segments come from the lanes' below.
    batch: Batch,
    /// The ended segments of each lane.
    segments: Vec<Vec<Segment>>,
    /// The first sample of each lane's current segment.
    starts: Vec<usize>,
    /// The ended episodes of each lane.
    episodes: Vec<Vec<Episode>>,
}

impl Filling {
    fn new(
        Spaces {
            observation_dim,
            action_dim,
            ..
        }: Spaces,
        lanes: usize,
        steps: usize,
    ) -> Self {
        let samples = steps * lanes;
        let batch = Batch {
            observations: DMatrix::zeros(observation_dim, samples),
            raw_observations: DMatrix::zeros(observation_dim, samples),
            means: DMatrix::zeros(action_dim, samples),
            actions: DMatrix::zeros(action_dim, samples),
            rewards: vec![0.0; samples],
            segments: Vec::new(),
        };
        Self {
            steps,
            batch,
            segments: vec![Vec::new(); lanes],
            starts: (0..lanes).map(|lane| lane * steps).collect(),
            episodes: vec![Vec::new(); lanes],
        }
    }

    /// Draws the action of lane `index` in its step `t`.
    /// The lanes' inputs are the columns of `inputs`; the policy's means for them are the columns
    /// of the output in `pass`.
    fn act(
        &mut self,
        index: usize,
        t: usize,
        lane: &mut Lane,
        inputs: &DMatrix<f32>,
        pass: &Pass,
        std: &[f32],
    ) {
        let Batch {
            observations,
            raw_observations,
            means,
            actions,
            ..
        } = &mut self.batch;
        let sample = index * self.steps + t;
        observations
            .column_mut(sample)
            .copy_from(&inputs.column(index));
        raw_observations
            .column_mut(sample)
            .copy_from_slice(&lane.own.observation);
        means
            .column_mut(sample)
            .copy_from(&pass.output().column(index));
        for (row, (std, action)) in std.iter().zip(&mut lane.action).enumerate() {
            let noise: f32 = StandardNormal.sample(&mut lane.own.noise);
            actions[(row, sample)] = means[(row, sample)] + std * noise;
            *action = f64::from(actions[(row, sample)]);
        }
    }

    /// Records the transition of that step.
    fn take(
        &mut self,
        index: usize,
        t: usize,
        lane: &mut Lane,
        agent: &Agent,
    ) -> Result<(), EnvError> {
        let sample = index * self.steps + t;
        let transition = lane.stepped.take().expect("every lane has been stepped")?;
        let episode = &mut lane.own.episode;
        self.batch.rewards[sample] = transition.reward;
        episode.dense_return += transition.dense_reward;
        episode.training_return += transition.reward;
        episode.length += 1;
        if let Some(end) = transition.end {
            let end = match end {
                EpisodeEnd::Terminated => SegmentEnd::Terminated,
                EpisodeEnd::Truncated => bootstrapped(agent, &lane.last_observation),
            };
            self.segments[index].push(Segment {
                range: self.starts[index]..sample + 1,
                end,
            });
            self.starts[index] = sample + 1;
            self.episodes[index].push(mem::take(episode));
        }
        Ok(())
    }

    /// Ends the current segment of lane `index`, if there is one, where its rollout ends.
    fn cut(&mut self, index: usize, lane: &Lane, agent: &Agent) {
        let range = self.starts[index]..(index + 1) * self.steps;
        if !range.is_empty() {
            self.segments[index].push(Segment {
                range,
                end: bootstrapped(agent, &lane.own.observation),
            });
        }
    }

    fn collected(self, physics: Duration) -> Collected {
        let batch = Batch {
            segments: self.segments.concat(),
            ..self.batch
        };
        Collected {
            batch,
            episodes: self.episodes.concat(),
            physics,
        }
    }
}

/// A saved [`Rollout`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RolloutState {
    lanes: Vec<Own>,
    tasks: Vec<Vec<f64>>,
}

fn bootstrapped(agent: &Agent, observation: &[f64]) -> SegmentEnd {
    let mut last_observation = vec![0.0; observation.len()];
    agent
        .normalizer
        .normalize(observation, &mut last_observation);
    SegmentEnd::Bootstrapped { last_observation }
}

#[cfg(test)]
mod tests;
