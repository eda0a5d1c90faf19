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
mod tests {
    use nalgebra::DMatrix;
    use rand::RngExt;

    use super::*;
    use crate::rng::{Seed, Stream};

    /// Two episodes of random actions, at most `limit` steps each.
    fn recorded(env: EnvId, limit: u64) -> Demonstration {
        let mut task = Task::new(env, Reward::Dense, limit).expect("a task");
        let mut rng = Seed(5).stream(Stream::Environment, 0);
        let spaces = task.spaces();
        let mut observation = vec![0.0; spaces.observation_dim];
        let (mut observations, mut actions, mut poses) = (vec![], vec![], vec![]);
        let (mut rewards, mut terminated, mut truncated, mut episode_starts) =
            (vec![], vec![], vec![], vec![]);
        for _ in 0..2 {
            episode_starts.push(rewards.len());
            task.reset(&mut rng, &mut observation);
            loop {
                let action: Vec<f64> = (0..spaces.action_dim)
                    .map(|_| rng.random_range(-1.0..1.0))
                    .collect();
                poses.push(task.pose());
                observations.extend_from_slice(&observation);
                let transition = task.step(&action, &mut observation).expect("a step");
                actions.extend(action);
                rewards.push(transition.dense_reward);
                terminated.push(transition.end == Some(EpisodeEnd::Terminated));
                truncated.push(transition.end == Some(EpisodeEnd::Truncated));
                if transition.end.is_some() {
                    break;
                }
            }
        }
        let n = rewards.len();
        Demonstration {
            observations: DMatrix::from_vec(spaces.observation_dim, n, observations),
            actions: DMatrix::from_vec(spaces.action_dim, n, actions),
            rewards: Some(rewards),
            episode_starts,
            terminated,
            truncated,
            poses: Some(poses),
            provenance: vec![],
        }
    }

    fn deviation(demonstration: &Demonstration, env: EnvId) -> Deviation {
        replay(demonstration, env).deviation
    }

    fn replay(demonstration: &Demonstration, env: EnvId) -> Replay {
        verify(demonstration, Path::new("d.parquet"), env).expect("it is replayed")
    }

    #[test]
    fn what_does_not_fit_or_has_no_pose_is_refused() {
        let demonstration = recorded(EnvId::Hopper, 5);
        let path = Path::new("d.parquet");
        let message = verify(&demonstration, path, EnvId::Walker2d)
            .expect_err("of Hopper")
            .to_string();
        assert!(
            message.contains("d.parquet") && message.contains("an observation has 11 numbers; 17"),
            "{message}"
        );
        let mut long = demonstration.clone();
        long.actions = DMatrix::zeros(4, long.len());
        let message = long
            .check(path, EnvId::Hopper)
            .expect_err("a long action")
            .to_string();
        assert!(
            message.contains("Hopper-v2: an action has 4 numbers; 3 are needed"),
            "{message}"
        );
        let without = Demonstration {
            poses: None,
            ..demonstration
        };
        let message = verify(&without, path, EnvId::Hopper)
            .expect_err("no pose")
            .to_string();
        assert!(message.contains("`qpos`"), "{message}");
    }

    #[test]
    fn each_change_is_seen_where_it_is() {
        let whole = recorded(EnvId::Hopper, 1000);
        let last = whole.len() - 1;
        assert!(whole.terminated[last], "random actions make it fall");
        let mut changed = whole.clone();
        changed.observations[(10, last)] += 1e-6;
        let seen = deviation(&changed, EnvId::Hopper);
        assert!(
            (seen.observation - 1e-6).abs() < 1e-9 && seen.reward == Some(0.0) && seen.ends == 0,
            "{seen:?}"
        );
        let mut changed = whole.clone();
        changed.rewards.as_mut().expect("rewards")[0] -= 0.5;
        let seen = deviation(&changed, EnvId::Hopper);
        assert!(
            seen.observation == 0.0 && seen.reward == Some(0.5) && seen.ends == 0,
            "{seen:?}"
        );
        let mut changed = whole.clone();
        changed.terminated[last] = false;
        assert_eq!(deviation(&changed, EnvId::Hopper).ends, 1);
        let mut changed = whole.clone();
        changed.actions[(0, 0)] += 0.1;
        assert!(deviation(&changed, EnvId::Hopper).observation > 1e-3);
        let mut changed = whole;
        changed.episode_starts = vec![0];
        assert!(
            deviation(&changed, EnvId::Hopper).ends > 0,
            "an episode that goes on after its end"
        );
    }

    #[test]
    fn the_greatest_deviation_is_found_where_it_is() {
        let whole = recorded(EnvId::Hopper, 1000);
        let (second, last) = (whole.episode_starts[1], whole.len() - 1);
        let mut changed = whole.clone();
        changed.observations[(3, second + 2)] += 1e-3;
        changed.rewards.as_mut().expect("rewards")[1] += 0.5;
        changed.terminated[last] = false;
        let replay = replay(&changed, EnvId::Hopper);
        assert_eq!(
            replay.observation_at,
            At {
                episode: 1,
                step: 2,
                number: 3
            }
        );
        assert_eq!(
            replay.reward_at,
            At {
                episode: 0,
                step: 1,
                number: 0
            }
        );
        assert_eq!(
            replay.end_at,
            Some(At {
                episode: 1,
                step: last - second,
                number: 0
            })
        );
        assert_eq!(
            replay.version(EnvId::Hopper, &Tolerance::of(&changed, EnvId::Hopper)),
            None
        );
    }

    #[test]
    fn a_reward_that_version_5_does_not_pay_is_known() {
        for (env, bonus) in [
            (EnvId::Hopper, 1.0),
            (EnvId::InvertedPendulum, 1.0),
            (EnvId::InvertedDoublePendulum, 10.0),
        ] {
            let mut theirs = recorded(env, 1000);
            let ends: Vec<usize> = theirs.episodes().map(|steps| steps.end - 1).collect();
            let tolerance = Tolerance::of(&theirs, env);
            for last in ends {
                assert!(
                    theirs.terminated[last],
                    "{env}: random actions make it fall"
                );
                theirs.rewards.as_mut().expect("rewards")[last] -= bonus;
            }
            let known = replay(&theirs, env)
                .version(env, &tolerance)
                .expect("version 5");
            assert!(
                known.0 == 5 && known.1.contains("the step in which"),
                "{known:?}"
            );
            theirs.rewards.as_mut().expect("rewards")[0] -= bonus;
            assert_eq!(replay(&theirs, env).version(env, &tolerance), None, "{env}");
        }
    }

    #[test]
    fn actions_in_f32_allow_rewards_in_f32() {
        let mut demonstration = recorded(EnvId::Ant, 5);
        assert_eq!(
            Tolerance::of(&demonstration, EnvId::Ant),
            Tolerance {
                observation: 1e-9,
                reward: 1e-9
            }
        );
        demonstration
            .actions
            .iter_mut()
            .for_each(|action| *action = f64::from(*action as f32));
        let tolerance = Tolerance::of(&demonstration, EnvId::Ant);
        assert_eq!(
            tolerance,
            Tolerance {
                observation: 1e-9,
                reward: 1e-6
            }
        );
        assert!(tolerance.holds(&Deviation {
            observation: 0.0,
            reward: Some(5e-7),
            ends: 0
        }));
        assert!(!tolerance.holds(&Deviation {
            observation: 5e-7,
            reward: None,
            ends: 0
        }));
        assert!(!tolerance.holds(&Deviation {
            observation: 0.0,
            reward: None,
            ends: 1
        }));
    }

    #[test]
    fn a_time_limit_must_be_noted_and_may_be_shorter() {
        let short = recorded(EnvId::HalfCheetah, 20);
        assert_eq!(deviation(&short, EnvId::HalfCheetah).ends, 0);
        let mut whole = recorded(EnvId::HalfCheetah, 1000);
        *whole.truncated.last_mut().expect("steps") = false;
        assert_eq!(deviation(&whole, EnvId::HalfCheetah).ends, 1);
    }

    #[test]
    fn a_recording_of_every_environment_replays_to_the_bit() {
        for env in EnvId::ALL {
            let demonstration = recorded(env, 30);
            let exact = Deviation {
                observation: 0.0,
                reward: Some(0.0),
                ends: 0,
            };
            assert_eq!(deviation(&demonstration, env), exact, "{env}");
            let without = Demonstration {
                rewards: None,
                ..demonstration
            };
            assert_eq!(
                deviation(&without, env),
                Deviation {
                    reward: None,
                    ..exact
                },
                "{env}"
            );
        }
    }
}
