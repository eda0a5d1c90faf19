//! One episode as the learner sees it: physics, the reward that is trained on, and the time limit.

use super::{EnvError, EnvId, EpisodeEnd, Pose, Reward, Spaces};
use crate::rng::Rng;

/// An environment with its reward and time limit.
pub struct Task {}

/// What one step gives, beside the observation.
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
    /// Errors: the environment does not have the reward, or the engine refuses the model.
    pub fn new(env: EnvId, reward: Reward, max_steps: u64) -> Result<Self, EnvError> {
        let _ = (env, reward, max_steps);
        todo!()
    }

    /// The shapes and bounds.
    pub fn spaces(&self) -> Spaces {
        todo!()
    }

    /// Starts an episode and writes its first observation.
    pub fn reset(&mut self, rng: &mut Rng, observation: &mut [f64]) {
        let _ = (rng, observation);
        todo!()
    }

    /// Takes one step and writes the observation after it. After an end, [`reset`](Task::reset) comes next.
    pub fn step(&mut self, action: &[f64], observation: &mut [f64]) -> Result<Transition, EnvError> {
        let _ = (action, observation);
        todo!()
    }

    /// Starts an episode in `pose`.
    pub fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError> {
        let _ = (pose, observation);
        todo!()
    }

    /// The pose now.
    pub fn pose(&self) -> Pose {
        todo!()
    }

    /// Everything the next step depends on.
    pub fn save(&self) -> Vec<f64> {
        todo!()
    }

    /// Puts back what [`save`](Task::save) gave.
    pub fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
        let _ = state;
        todo!()
    }
}
