//! Verification: replay the actions from each episode's first pose and compare.
//!
//! The car of MountainCar is put into every step's recorded pose instead: Gymnasium rounds its
//! state to f32 at each step, and over an episode the roundings that this replay does not share
//! would add up.

use std::path::Path;

use super::{DemoError, Demonstration};
use crate::env::{EnvId, EpisodeEnd, Reward, Task, Version};

/// The greatest deviations of a replay from the demonstration; infinite if the replay is not
/// finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// The deviation of an observation's number.
    pub observation: f64,
    /// The deviation of a reward; absent if the demonstration has none.
    pub reward: Option<f64>,
    /// The number of steps whose end differs.
    /// A time limit shorter than the environment's own is no difference: it is the recorder's
    /// choice.
    /// The rest of an episode after a difference is not compared.
    pub ends: usize,
}

/// The place of a number in a demonstration.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct At {
    /// The episode, counted from 0, as in the file's column.
    pub episode: usize,
    /// The step within the episode, from 0.
    pub step: usize,
    /// The place within the observation, from 0; 0 for a reward or an end.
    pub number: usize,
}

/// A replay beside its recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// The greatest deviations.
    pub deviation: Deviation,
    /// Where an observation deviates most.
    pub observation_at: At,
    /// Where a reward deviates most.
    pub reward_at: At,
    /// Where an episode first ends otherwise.
    pub end_at: Option<At>,
    /// The amount that the deviating rewards lack, if all of them are of steps that terminate and
    /// lack the same.
    lacking_at_the_end: Option<f64>,
}

impl Replay {
    /// The version of Gymnasium's environment that would deviate as this does, and how it differs.
    pub fn version(&self, env: EnvId, tolerance: &Tolerance) -> Option<(u32, &'static str)> {
        let is_meant = |version: &&Version| {
            let lacks = |bonus: f64| {
                self.lacking_at_the_end
                    .is_some_and(|lacking| (lacking - bonus).abs() < 1e-6)
            };
            version.unpaid_at_the_end.is_some_and(lacks)
                || version.moves_otherwise && self.deviation.observation > tolerance.observation
        };
        let version = env.versions().iter().find(is_meant)?;
        Some((version.number, version.difference?))
    }
}

/// The greatest deviations that count as agreement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// The bound for an observation's number.
    pub observation: f64,
    /// The bound for a reward.
    pub reward: f64,
}

impl Tolerance {
    /// The tolerance for a recording of Gymnasium's own environment: 1e-9; 1e-5 in MountainCar,
    /// which it computes in f32.
    /// Rewards get 1e-6 if all actions are f32 numbers, since Gymnasium then computes an action's
    /// cost in f32.
    pub fn of(demonstration: &Demonstration, env: EnvId) -> Self {
        if env.is_f32_in_gymnasium() {
            return Self {
                observation: 1e-5,
                reward: 1e-5,
            };
        }
        let rounded = demonstration
            .actions
            .iter()
            .all(|&action| f64::from(action as f32) == action);
        Self {
            observation: 1e-9,
            reward: if rounded { 1e-6 } else { 1e-9 },
        }
    }

    /// Whether `deviation` is within the tolerance.
    pub fn holds(&self, deviation: &Deviation) -> bool {
        deviation.observation <= self.observation
            && deviation.reward.is_none_or(|reward| reward <= self.reward)
            && deviation.ends == 0
    }
}

/// Replays `demonstration` in `env`, and returns the greatest deviations with their places.
///
/// # Errors
///
/// Shapes do not fit `env` (the message names `path`), no pose was recorded, or the physics
/// diverges.
pub fn verify(demonstration: &Demonstration, path: &Path, env: EnvId) -> Result<Replay, DemoError> {
    demonstration.check(path, env)?;
    let Some(poses) = &demonstration.poses else {
        return Err(DemoError::NoPoses(path.to_owned()));
    };
    let failed = |source| DemoError::Environment {
        path: path.to_owned(),
        source,
    };
    let mut task = Task::new(env, Reward::Dense, env.max_steps()).map_err(failed)?;
    let mut observation = vec![0.0; task.spaces().observation_dim];
    let mut greatest = Deviation {
        observation: 0.0,
        reward: demonstration.rewards.as_ref().map(|_| 0.0),
        ends: 0,
    };
    let (mut observation_at, mut reward_at, mut end_at) = (At::default(), At::default(), None);
    let mut lacking = Lacking::default();
    for (episode, steps) in demonstration.episodes().enumerate() {
        let start = steps.start;
        task.set_pose(&poses[start], &mut observation)
            .map_err(failed)?;
        for step in steps {
            let at = |number| At {
                episode,
                step: step - start,
                number,
            };
            // Gymnasium rounds the state at each step; over an episode its roundings would add up.
            if env.is_f32_in_gymnasium() {
                task.set_pose(&poses[step], &mut observation)
                    .map_err(failed)?;
            }
            for (i, (replayed, recorded)) in observation
                .iter()
                .zip(&demonstration.observations.column(step))
                .enumerate()
            {
                if raise(&mut greatest.observation, replayed - recorded) {
                    observation_at = at(i);
                }
            }
            let action = demonstration.actions.column(step);
            let transition = task
                .step(action.as_slice(), &mut observation)
                .map_err(failed)?;
            if let (Some(greatest), Some(rewards)) = (&mut greatest.reward, &demonstration.rewards)
            {
                let deviation = transition.dense_reward - rewards[step];
                if raise(greatest, deviation) {
                    reward_at = at(0);
                }
                lacking.see(deviation, demonstration.terminated[step]);
            }
            let agrees = match transition.end {
                Some(EpisodeEnd::Terminated) => demonstration.terminated[step],
                Some(EpisodeEnd::Truncated) => {
                    demonstration.truncated[step] && !demonstration.terminated[step]
                }
                // A limit shorter than the environment's own is the recorder's choice.
                None => !demonstration.terminated[step],
            };
            if !agrees {
                greatest.ends += 1;
                end_at = end_at.or(Some(at(0)));
                break;
            }
        }
    }
    let lacking_at_the_end = lacking.0.unwrap_or_default();
    Ok(Replay {
        deviation: greatest,
        observation_at,
        reward_at,
        end_at,
        lacking_at_the_end,
    })
}

/// The amount that deviating rewards lack: not seen yet, the same at each end that terminates, or
/// none in common.
#[derive(Default)]
struct Lacking(Option<Option<f64>>);

impl Lacking {
    /// Deviations below this are the rounding of f32 rewards.
    const ROUNDING: f64 = 1e-5;

    fn see(&mut self, deviation: f64, terminates: bool) {
        if deviation.abs() <= Self::ROUNDING {
            return;
        }
        self.0 = Some(match self.0 {
            None if terminates => Some(deviation),
            Some(Some(before)) if terminates && (before - deviation).abs() <= Self::ROUNDING => {
                Some(before)
            }
            _ => None,
        });
    }
}

/// Raises `greatest` to the magnitude of `deviation`, and returns whether it was below; a
/// `deviation` that is not finite counts as infinite.
fn raise(greatest: &mut f64, deviation: f64) -> bool {
    let magnitude = if deviation.is_finite() {
        deviation.abs()
    } else {
        f64::INFINITY
    };
    let is_greater = magnitude > *greatest;
    *greatest = greatest.max(magnitude);
    is_greater
}

#[cfg(test)]
mod tests;
