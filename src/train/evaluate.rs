//! Evaluation: whole episodes with the policy's mean action and a frozen normaliser, or with
//! uniform actions.

use nalgebra::DMatrix;
use rand::RngExt as _;

use super::{EvaluationEpisode, rollout::Episode};
use crate::{
    algo::Agent,
    demo::Demonstration,
    env::{EnvError, EpisodeEnd, Task},
    nn::Pass,
    rng::{Rng, Seed, Stream},
};

/// The index of the evaluation at the end of training, however many came before it.
pub const LAST: u32 = u16::MAX as u32;

/// One evaluation of a run.
#[derive(Debug, Clone, Copy)]
pub struct Evaluation {
    /// The run's seed.
    pub seed: Seed,
    /// Counted from 0 within the run; [`LAST`] at its end.
    pub index: u32,
    /// The environment steps that the policy was trained for.
    pub env_steps: u64,
    /// The number of episodes.
    pub count: u64,
    /// Whether it is the evaluation at the end of training.
    pub last: bool,
}

/// The episodes of `evaluation`.
/// Their initial states depend on its seed and index alone, so that all runs of a seed are
/// evaluated on the same ones.
/// `alive` is called after each step.
///
/// # Errors
///
/// The physics failed.
pub fn evaluation(
    actor: &mut Actor<'_>,
    tasks: &mut [Task],
    evaluation: Evaluation,
    alive: &mut dyn FnMut(),
) -> Result<Vec<EvaluationEpisode>, EnvError> {
    let Evaluation {
        seed,
        index,
        env_steps,
        count,
        last,
    } = evaluation;
    let starts = (0..count as u32)
        .map(|episode| seed.stream(Stream::Evaluation, index << 16 | episode))
        .collect();
    let row = |(episode, played): (u64, Episode)| EvaluationEpisode {
        env_steps,
        last,
        episode,
        dense_return: played.dense_return,
        training_return: played.training_return,
        length: played.length,
    };
    Ok((0..)
        .zip(episodes(actor, tasks, starts, alive)?)
        .map(row)
        .collect())
}

/// The source of actions.
pub enum Actor<'a> {
    /// The policy's mean action, with a frozen normaliser.
    MeanAction(&'a Agent),
    /// Uniform actions within the environment's bounds, drawn from this generator.
    Uniform(&'a mut Rng),
}

/// Plays one episode for each of `starts`, the generators of initial states, as many at once as
/// there are `tasks`.
/// The episodes come in the order of `starts`; those of a policy do not depend on the number of
/// tasks.
/// `alive` is called after each step.
///
/// # Errors
///
/// The physics failed.
pub fn episodes(
    actor: &mut Actor<'_>,
    tasks: &mut [Task],
    starts: Vec<Rng>,
    alive: &mut dyn FnMut(),
) -> Result<Vec<Episode>, EnvError> {
    let spaces = tasks[0].spaces();
    let mut results = vec![Episode::default(); starts.len()];
    let mut waiting = starts.into_iter().enumerate();
    let mut observations = vec![vec![0.0; spaces.observation_dim]; tasks.len()];
    // The episode that each task plays; tasks without one are left out of the forward passes.
    let mut playing: Vec<Option<usize>> = Vec::new();
    for (task, observation) in tasks.iter_mut().zip(&mut observations) {
        playing.push(waiting.next().map(|(episode, mut start)| {
            task.reset(&mut start, observation);
            episode
        }));
    }
    let mut pass = Pass::default();
    let mut inputs = DMatrix::<f32>::zeros(spaces.observation_dim, 0);
    let mut action = vec![0.0; spaces.action_dim];
    while playing.iter().any(Option::is_some) {
        alive();
        let active: Vec<usize> = (0..tasks.len())
            .filter(|&index| playing[index].is_some())
            .collect();
        if let Actor::MeanAction(agent) = actor {
            // Columns are only lost once no episode waits, so the matrix is seldom made anew.
            if inputs.ncols() != active.len() {
                inputs = DMatrix::zeros(spaces.observation_dim, active.len());
            }
            for (&index, input) in active.iter().zip(
                inputs
                    .as_mut_slice()
                    .chunks_exact_mut(spaces.observation_dim),
            ) {
                agent.normalizer.normalize(&observations[index], input);
            }
            agent.policy.forward(&inputs, &mut pass);
        }
        for (column, &index) in active.iter().enumerate() {
            match actor {
                Actor::MeanAction(_) => {
                    action
                        .iter_mut()
                        .zip(pass.output().column(column).iter())
                        .for_each(|(a, &m)| *a = f64::from(m));
                }
                Actor::Uniform(rng) => {
                    let bound = spaces.action_bound;
                    action
                        .iter_mut()
                        .for_each(|a| *a = rng.random_range(-bound..=bound));
                }
            }
            let transition = tasks[index].step(&action, &mut observations[index])?;
            // Always there: only a task's own step ends its episode.
            let Some(episode) = playing[index] else {
                continue;
            };
            let result = &mut results[episode];
            result.dense_return += transition.dense_reward;
            result.training_return += transition.reward;
            result.length += 1;
            if transition.end.is_some() {
                playing[index] = waiting.next().map(|(episode, mut start)| {
                    tasks[index].reset(&mut start, &mut observations[index]);
                    episode
                });
            }
        }
    }
    Ok(results)
}

/// Records one episode of `agent`'s mean action from an initial state drawn from `start`, step by
/// step.
///
/// # Errors
///
/// The physics failed.
pub fn record(agent: &Agent, task: &mut Task, mut start: Rng) -> Result<Demonstration, EnvError> {
    let spaces = task.spaces();
    let mut observation = vec![0.0; spaces.observation_dim];
    task.reset(&mut start, &mut observation);
    let mut pass = Pass::default();
    let mut input = DMatrix::<f32>::zeros(spaces.observation_dim, 1);
    let (mut observations, mut actions, mut poses, mut rewards) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let end = loop {
        poses.push(task.pose());
        observations.extend_from_slice(&observation);
        agent
            .normalizer
            .normalize(&observation, input.as_mut_slice());
        agent.policy.forward(&input, &mut pass);
        let action: Vec<f64> = pass.output().iter().map(|&mean| f64::from(mean)).collect();
        let transition = task.step(&action, &mut observation)?;
        actions.extend(action);
        rewards.push(transition.dense_reward);
        if let Some(end) = transition.end {
            break end;
        }
    };
    let n = rewards.len();
    let ended_by = |how: EpisodeEnd| (1..=n).map(|step| step == n && end == how).collect();
    Ok(Demonstration {
        observations: DMatrix::from_vec(spaces.observation_dim, n, observations),
        actions: DMatrix::from_vec(spaces.action_dim, n, actions),
        rewards: Some(rewards),
        episode_starts: vec![0],
        terminated: ended_by(EpisodeEnd::Terminated),
        truncated: ended_by(EpisodeEnd::Truncated),
        poses: Some(poses),
        provenance: Vec::new(),
    })
}
