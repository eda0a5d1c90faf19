//! One episode as the learner sees it: physics, the reward that is trained on, and the time limit.

use super::{
    EnvError, EnvId, Environment, EpisodeEnd, Pose, Reward, Spaces, SparseMode, check_length,
};
use crate::rng::Rng;

/// An environment with its reward and time limit.
pub struct Task {
    /// The environment's name, for messages.
    name: String,
    environment: Box<dyn Environment>,
    reward: Reward,
    max_steps: u64,
    /// Steps since the episode's start.
    elapsed: u64,
    /// Whole distances that SPARSE2 has paid for in this episode.
    milestones: f64,
}

/// The result of one step, beside the observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transition {
    /// The reward that is trained on.
    pub reward: f64,
    /// Gym's own reward.
    pub dense_reward: f64,
    /// Whether, and how, the episode ended.
    pub end: Option<EpisodeEnd>,
}

impl Task {
    /// The task `env` with `reward`, cut after `max_steps`.
    ///
    /// # Errors
    ///
    /// The environment does not have the reward, or the engine refuses the model.
    pub fn new(env: EnvId, reward: Reward, max_steps: u64) -> Result<Self, EnvError> {
        reward.check(env)?;
        Ok(Self::from_environment(
            env.name(),
            env.build()?,
            reward,
            max_steps,
        ))
    }

    /// The task of `environment`, which messages call `name`, with `reward`, cut after `max_steps`;
    /// for environments that this crate does not know.
    /// A sparse reward pays by the environment's own [`landmark`](Environment::landmark).
    pub fn from_environment(
        name: &str,
        environment: Box<dyn Environment>,
        reward: Reward,
        max_steps: u64,
    ) -> Self {
        Self {
            name: name.to_owned(),
            environment,
            reward,
            max_steps,
            elapsed: 0,
            milestones: 0.0,
        }
    }

    /// The shapes and bounds.
    pub fn spaces(&self) -> Spaces {
        self.environment.spaces()
    }

    /// Starts an episode and writes its first observation (`[observation_dim]`).
    pub fn reset(&mut self, rng: &mut Rng, observation: &mut [f64]) {
        self.environment.reset(rng, observation);
        (self.elapsed, self.milestones) = (0, 0.0);
    }

    /// Takes one step under `action` (`[action_dim]`, unclamped) and writes the observation after
    /// it.
    /// After an end, call [`reset`](Task::reset) next.
    /// A termination on the last step that the limit allows counts as a termination.
    ///
    /// # Errors
    ///
    /// The action has a wrong length or is not finite, or the physics diverged.
    pub fn step(
        &mut self,
        action: &[f64],
        observation: &mut [f64],
    ) -> Result<Transition, EnvError> {
        let outcome = self.environment.step(action, observation)?;
        self.elapsed += 1;
        let end = if outcome.terminated {
            Some(EpisodeEnd::Terminated)
        } else if self.elapsed >= self.max_steps {
            Some(EpisodeEnd::Truncated)
        } else {
            None
        };
        Ok(Transition {
            reward: self.trained_reward(outcome.reward),
            dense_reward: outcome.reward,
            end,
        })
    }

    /// Takes the physics of a step alone: see [`Environment::advance`].
    ///
    /// # Errors
    ///
    /// As for [`step`](Task::step).
    pub fn advance(&mut self, action: &[f64]) -> Result<(), EnvError> {
        self.environment.advance(action)
    }

    fn trained_reward(&mut self, dense: f64) -> f64 {
        let landmark = self.environment.landmark();
        let one_if = |paid: bool| f64::from(u8::from(paid));
        match self.reward {
            Reward::Dense => dense,
            Reward::Sparse1 => one_if(landmark == 1.0),
            Reward::Sparse2 {
                distance,
                mode: SparseMode::Beyond,
            } => one_if(landmark > distance.get()),
            Reward::Sparse2 {
                distance,
                mode: SparseMode::Milestone,
            } => {
                let covered = (landmark / distance.get()).floor().max(self.milestones);
                covered - std::mem::replace(&mut self.milestones, covered)
            }
            Reward::Sparse3 { height } => one_if(landmark > height.get()),
        }
    }

    /// Starts an episode in `pose` and writes its first observation.
    ///
    /// # Errors
    ///
    /// The pose has a wrong length or is not finite.
    pub fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError> {
        self.environment.set_pose(pose, observation)?;
        (self.elapsed, self.milestones) = (0, 0.0);
        Ok(())
    }

    /// The current pose.
    pub fn pose(&self) -> Pose {
        self.environment.pose()
    }

    /// Everything that the next step depends on, for a checkpoint.
    pub fn save(&self) -> Vec<f64> {
        let mut state = vec![self.elapsed as f64, self.milestones];
        state.extend(self.environment.save());
        state
    }

    /// Restores a state of [`save`](Task::save); every later bit is as it would have been.
    ///
    /// # Errors
    ///
    /// The state is of another environment.
    pub fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
        let [elapsed, milestones, environment @ ..] = state else {
            return check_length(&self.name, "the saved state", state.len(), 2);
        };
        self.environment.restore(environment)?;
        (self.elapsed, self.milestones) = (*elapsed as u64, *milestones);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{env::Outcome, quantity::constant};

    /// An environment whose landmark follows a list, one number a step; its dense reward is -1.
    struct Scripted {
        landmarks: Vec<f64>,
        step: usize,
    }

    impl Environment for Scripted {
        fn spaces(&self) -> Spaces {
            Spaces {
                observation_dim: 1,
                action_dim: 1,
                action_bound: 1.0,
            }
        }

        fn reset(&mut self, _: &mut Rng, _: &mut [f64]) {
            self.step = 0;
        }

        fn step(&mut self, _: &[f64], _: &mut [f64]) -> Result<Outcome, EnvError> {
            self.advance(&[])?;
            Ok(Outcome {
                reward: -1.0,
                terminated: self.step == self.landmarks.len(),
            })
        }

        fn advance(&mut self, _: &[f64]) -> Result<(), EnvError> {
            self.step += 1;
            Ok(())
        }

        fn landmark(&self) -> f64 {
            self.landmarks[self.step - 1]
        }

        fn pose(&self) -> Pose {
            Pose {
                qpos: vec![],
                qvel: vec![],
            }
        }

        fn set_pose(&mut self, _: &Pose, _: &mut [f64]) -> Result<(), EnvError> {
            self.step = 0;
            Ok(())
        }

        fn save(&self) -> Vec<f64> {
            vec![self.step as f64]
        }

        fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
            self.step = state[0] as usize;
            Ok(())
        }
    }

    fn task(reward: Reward, max_steps: u64, landmarks: &[f64]) -> Task {
        let environment = Box::new(Scripted {
            landmarks: landmarks.to_vec(),
            step: 0,
        });
        Task::from_environment("scripted", environment, reward, max_steps)
    }

    fn episode(task: &mut Task) -> (Vec<f64>, EpisodeEnd) {
        let mut rewards = Vec::new();
        loop {
            let transition = task.step(&[0.0], &mut [0.0]).expect("a scripted step");
            assert_eq!(transition.dense_reward, -1.0);
            rewards.push(transition.reward);
            if let Some(end) = transition.end {
                return (rewards, end);
            }
        }
    }

    fn sparse2(mode: SparseMode) -> Reward {
        Reward::Sparse2 {
            distance: constant(15.0),
            mode,
        }
    }

    const WAY: [f64; 8] = [-20.0, 14.9, 15.0, 15.1, 3.0, 46.0, 44.0, 60.0];

    #[test]
    fn sparse2_pays_on_every_step_beyond_the_distance() {
        let mut task = task(sparse2(SparseMode::Beyond), 100, &WAY);
        assert_eq!(
            episode(&mut task).0,
            [0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0]
        );
    }

    #[test]
    fn sparse2_by_milestones_pays_once_for_each_whole_distance_of_an_episode() {
        let mut task = task(sparse2(SparseMode::Milestone), 100, &WAY);
        let expected = [0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 1.0];
        assert_eq!(episode(&mut task).0, expected);
        task.set_pose(
            &Pose {
                qpos: vec![],
                qvel: vec![],
            },
            &mut [0.0],
        )
        .expect("scripted");
        assert_eq!(
            episode(&mut task).0,
            expected,
            "a new episode earns them again"
        );
    }

    #[test]
    fn milestones_already_paid_for_are_restored() {
        let mut task = task(sparse2(SparseMode::Milestone), 100, &WAY);
        for _ in 0..4 {
            task.step(&[0.0], &mut [0.0]).expect("a scripted step");
        }
        let state = task.save();
        let rest = episode(&mut task).0;
        task.restore(&state).expect("its own state");
        assert_eq!(episode(&mut task).0, rest);
        assert_eq!(rest, [0.0, 2.0, 0.0, 1.0]);
    }

    #[test]
    fn sparse1_pays_at_the_goal_and_sparse3_above_the_height() {
        assert_eq!(
            episode(&mut task(Reward::Sparse1, 100, &[0.0, 0.0, 1.0])).0,
            [0.0, 0.0, 1.0]
        );
        let high = Reward::Sparse3 {
            height: constant(0.59),
        };
        assert_eq!(
            episode(&mut task(high, 100, &[0.6, 0.591, 0.59, 0.2])).0,
            [1.0, 1.0, 0.0, 0.0]
        );
    }

    #[test]
    fn a_termination_on_the_last_step_is_no_truncation() {
        assert_eq!(
            episode(&mut task(Reward::Dense, 3, &[0.0; 4])),
            (vec![-1.0; 3], EpisodeEnd::Truncated)
        );
        assert_eq!(
            episode(&mut task(Reward::Dense, 4, &[0.0; 4])),
            (vec![-1.0; 4], EpisodeEnd::Terminated)
        );
    }
}
