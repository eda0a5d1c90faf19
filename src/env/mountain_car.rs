//! MountainCarContinuous-v0: a car too weak for its hill.
//!
//! As in Gym 0.15, in f64; Gymnasium computes the same in f32.

use std::sync::OnceLock;

use rand::RngExt;

use super::{
    EnvError, Environment, Outcome, Pose, Reward, Spaces,
    catalog::{Body, Descriptor},
    check_finite, check_length, untag,
};
use crate::rng::Rng;

pub(super) static DESCRIPTOR: Descriptor = Descriptor {
    name: "MountainCarContinuous-v0",
    paper_name: Some("MountainCar-v0"),
    max_steps: 999,
    default_reward: || Reward::Sparse1,
    revision: 1,
    microseconds: 0.03,
    is_f32_in_gymnasium: true,
    versions: &[],
    body: Body::MountainCar,
    spaces: OnceLock::new(),
};

const POSITIONS: [f64; 2] = [-1.2, 0.6];
const MAX_SPEED: f64 = 0.07;
const GOAL: f64 = 0.45;
const POWER: f64 = 0.0015;
const GRAVITY: f64 = 0.0025;
const MAX_FORCE: f64 = 1.0;

/// The car.
#[derive(Debug, Default)]
pub(super) struct MountainCar {
    /// Its name, for messages.
    name: &'static str,
    /// The number in front of its saved states.
    tag: f64,
    position: f64,
    velocity: f64,
}

impl MountainCar {
    /// A car in the valley, called `name`, with `tag` in front of its saved states.
    pub(super) fn new(name: &'static str, tag: f64) -> Self {
        Self {
            name,
            tag,
            position: 0.0,
            velocity: 0.0,
        }
    }

    fn at_goal(&self) -> bool {
        self.position >= GOAL && self.velocity >= 0.0
    }

    fn observe(&self, observation: &mut [f64]) {
        observation.copy_from_slice(&[self.position, self.velocity]);
    }
}

impl Environment for MountainCar {
    fn spaces(&self) -> Spaces {
        Spaces {
            observation_dim: 2,
            action_dim: 1,
            action_bound: MAX_FORCE,
        }
    }

    fn reset(&mut self, rng: &mut Rng, observation: &mut [f64]) {
        (self.position, self.velocity) = (rng.random_range(-0.6..-0.4), 0.0);
        self.observe(observation);
    }

    fn step(&mut self, action: &[f64], observation: &mut [f64]) -> Result<Outcome, EnvError> {
        self.advance(action)?;
        self.observe(observation);
        let goal = if self.at_goal() { 100.0 } else { 0.0 };
        Ok(Outcome {
            reward: goal - 0.1 * action[0].powi(2),
            terminated: self.at_goal(),
        })
    }

    fn advance(&mut self, action: &[f64]) -> Result<(), EnvError> {
        check_length(self.name, "the action", action.len(), 1)?;
        check_finite(self.name, "the action", action)?;
        let force = action[0].clamp(-MAX_FORCE, MAX_FORCE);
        let [left, right] = POSITIONS;
        self.velocity += force * POWER - GRAVITY * (3.0 * self.position).cos();
        self.velocity = self.velocity.clamp(-MAX_SPEED, MAX_SPEED);
        self.position = (self.position + self.velocity).clamp(left, right);
        if self.position == left {
            self.velocity = self.velocity.max(0.0);
        }
        Ok(())
    }

    fn landmark(&self) -> f64 {
        f64::from(u8::from(self.at_goal()))
    }

    fn pose(&self) -> Pose {
        Pose {
            qpos: vec![self.position],
            qvel: vec![self.velocity],
        }
    }

    fn pose_of(&self, observation: &[f64]) -> Option<(Pose, usize)> {
        let [position, velocity] = *observation else {
            return None;
        };
        Some((
            Pose {
                qpos: vec![position],
                qvel: vec![velocity],
            },
            1,
        ))
    }

    fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError> {
        check_length(self.name, "qpos", pose.qpos.len(), 1)?;
        check_length(self.name, "qvel", pose.qvel.len(), 1)?;
        check_finite(self.name, "qpos", &pose.qpos)?;
        check_finite(self.name, "qvel", &pose.qvel)?;
        (self.position, self.velocity) = (pose.qpos[0], pose.qvel[0]);
        self.observe(observation);
        Ok(())
    }

    fn save(&self) -> Vec<f64> {
        vec![self.tag, self.position, self.velocity]
    }

    fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
        let state = untag(self.name, self.tag, state, 2)?;
        (self.position, self.velocity) = (state[0], state[1]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Position and velocity after one step from `position` and `velocity`, and what it gave.
    fn step(position: f64, velocity: f64, action: f64) -> (f64, f64, Outcome) {
        let mut car = MountainCar {
            position,
            velocity,
            ..MountainCar::new("car", 0.0)
        };
        let outcome = car.step(&[action], &mut [0.0; 2]).expect("a step");
        (car.position, car.velocity, outcome)
    }

    #[test]
    fn the_left_wall_stops_the_car() {
        assert_eq!(step(-1.19, -0.05, -1.0).0, -1.2);
        assert_eq!(step(-1.19, -0.05, -1.0).1, 0.0);
    }

    #[test]
    fn speed_and_position_are_bounded() {
        assert_eq!(step(-0.3, -0.07, -1.0).1, -0.07);
        assert_eq!(step(-0.9, 0.07, 1.0).1, 0.07);
        assert_eq!(step(0.59, 0.07, 1.0).0, 0.6);
    }

    #[test]
    fn the_goal_is_reached_by_position_and_direction_and_costs_the_unclamped_action() {
        assert_eq!(
            step(0.44, 0.05, 2.0).2,
            Outcome {
                reward: 99.6,
                terminated: true
            }
        );
        assert_eq!(
            step(0.47, -0.01, 1.0).2,
            Outcome {
                reward: -0.1,
                terminated: false
            }
        );
    }
}
