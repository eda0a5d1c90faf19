//! Evaluation: whole episodes with the policy's mean action and a frozen normaliser.

use nalgebra::DMatrix;

use super::rollout::Episode;
use crate::{
    algo::Agent,
    env::{EnvError, Task},
    nn::Pass,
    rng::Rng,
};

/// Plays one episode for each of `starts`, the generators of their initial states, as many together as there are `tasks`.
/// The episodes come in the order of `starts`, and do not depend on how many tasks there are.
///
/// Errors: the physics failed.
pub fn episodes(agent: &Agent, tasks: &mut [Task], starts: Vec<Rng>) -> Result<Vec<Episode>, EnvError> {
    let spaces = tasks[0].spaces();
    let mut results = vec![Episode::default(); starts.len()];
    let mut waiting = starts.into_iter().enumerate();
    let mut observations = vec![vec![0.0; spaces.observation_dim]; tasks.len()];
    // Which episode each task plays; the tasks without one are left out of the passes.
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
        let active: Vec<usize> = (0..tasks.len()).filter(|&index| playing[index].is_some()).collect();
        if inputs.ncols() != active.len() {
            inputs = DMatrix::zeros(spaces.observation_dim, active.len());
        }
        for (&index, input) in active.iter().zip(inputs.as_mut_slice().chunks_exact_mut(spaces.observation_dim)) {
            agent.normalizer.normalize(&observations[index], input);
        }
        agent.policy.forward(&inputs, &mut pass);
        for (column, &index) in active.iter().enumerate() {
            action.iter_mut().zip(pass.output().column(column).iter()).for_each(|(a, &mean)| *a = f64::from(mean));
            let transition = tasks[index].step(&action, &mut observations[index])?;
            let Some(episode) = playing[index] else { continue };
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
