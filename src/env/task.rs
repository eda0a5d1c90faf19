//! One episode as the learner sees it: physics, the reward that is trained on, and the time limit.

use super::{EnvError, EnvId, Environment, EpisodeEnd, Pose, Reward, Spaces, SparseMode, check_length};
use crate::rng::Rng;

/// An environment with its reward and time limit.
pub struct Task {
    env: EnvId,
    environment: Box<dyn Environment>,
    reward: Reward,
    max_steps: u64,
    /// Steps since the episode's start.
    elapsed: u64,
    /// Whole distances that SPARSE2 has paid for in this episode.
    milestones: f64,
}

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
        reward.check(env)?;
        Ok(Self { env, environment: env.build()?, reward, max_steps, elapsed: 0, milestones: 0.0 })
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

    /// Takes one step under `action` (`[action_dim]`, unclamped) and writes the observation after it. After an end,
    /// [`reset`](Task::reset) comes next. A termination on the last step that the limit allows is a termination.
    ///
    /// Errors: the action has a wrong length or is not finite, or the physics diverged.
    pub fn step(&mut self, action: &[f64], observation: &mut [f64]) -> Result<Transition, EnvError> {
        let outcome = self.environment.step(action, observation)?;
        self.elapsed += 1;
        let end = if outcome.terminated {
            Some(EpisodeEnd::Terminated)
        } else if self.elapsed >= self.max_steps {
            Some(EpisodeEnd::Truncated)
        } else {
            None
        };
        Ok(Transition { reward: self.trained_reward(outcome.reward), dense_reward: outcome.reward, end })
    }

    fn trained_reward(&mut self, dense: f64) -> f64 {
        let landmark = self.environment.landmark();
        let one_if = |paid: bool| f64::from(u8::from(paid));
        match self.reward {
            Reward::Dense => dense,
            Reward::Sparse1 => one_if(landmark == 1.0),
            Reward::Sparse2 { distance, mode: SparseMode::Beyond } => one_if(landmark > distance.get()),
            Reward::Sparse2 { distance, mode: SparseMode::Milestone } => {
                let covered = (landmark / distance.get()).floor().max(self.milestones);
                covered - std::mem::replace(&mut self.milestones, covered)
            }
            Reward::Sparse3 { height } => one_if(landmark > height.get()),
        }
    }

    /// Starts an episode in `pose` and writes its first observation.
    ///
    /// Errors: the pose has a wrong length or is not finite.
    pub fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError> {
        self.environment.set_pose(pose, observation)?;
        (self.elapsed, self.milestones) = (0, 0.0);
        Ok(())
    }

    /// The pose now.
    pub fn pose(&self) -> Pose {
        self.environment.pose()
    }

    /// Everything the next step depends on, for a checkpoint.
    pub fn save(&self) -> Vec<f64> {
        let mut state = vec![self.elapsed as f64, self.milestones];
        state.extend(self.environment.save());
        state
    }

    /// Puts back what [`save`](Task::save) gave; from then on every bit is as it would have been.
    ///
    /// Errors: the state is of another environment.
    pub fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
        let [elapsed, milestones, environment @ ..] = state else {
            return check_length(self.env, "the saved state", state.len(), 2);
        };
        self.environment.restore(environment)?;
        (self.elapsed, self.milestones) = (*elapsed as u64, *milestones);
        Ok(())
    }
}
