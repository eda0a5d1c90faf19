//! Robots in MuJoCo.
//!
//! Owns the engine ([`simulation`], the only place that names `mujoco_rs`), the model's text with
//! the files that it needs, and the task that a [`Robot`] makes of it. Knows nothing of time limits
//! or of what the sparse rewards pay. Start at [`RobotEnvironment`].
//!
//! The paper used Gym's environments of 2019 on MuJoCo 2.0 or 1.5. Today's engine refuses two of
//! those models, so Gymnasium's are used, with Gym's noise, rewards and ends. Trajectories differ
//! from the authors'; uniform actions earn what Table 4 says.

mod model;
mod observed;
mod pieces;
mod reading;
mod simulation;

pub(super) use model::Model;
pub use simulation::engine_version;

use rand::RngExt;
use rand_distr::StandardNormal;

use self::{
    observed::Observed,
    pieces::{Controls, Paid, Pieces},
    simulation::Simulation,
};
use super::{
    EnvError, Environment, Outcome, Pose, Spaces, check_finite, check_length,
    robot::{InitialNoise, Landmark, Noise, Robot},
    untag,
};
use crate::rng::Rng;

/// A task on a simulated body.
pub(super) struct RobotEnvironment {
    /// Its name, for messages.
    name: &'static str,
    /// The number in front of its saved states.
    tag: f64,
    pieces: Pieces,
    noise: InitialNoise,
    simulation: Simulation,
    /// Position along the way at the episode's start.
    start: f64,
    /// Position along the way after the last step. Kept here, since MuJoCo's own may belong to a
    /// state that is not saved.
    position: f64,
    /// Distance of the goal's body from its target after the last step, kept for the same reason; 0
    /// if there is no goal.
    distance: f64,
    /// The controls computed from scaled actions.
    controls: Vec<f64>,
}

impl RobotEnvironment {
    /// The task of `robot` at the start of its `model`, with `tag` in front of its saved states.
    ///
    /// # Errors
    ///
    /// MuJoCo refuses the model, or the model lacks something that the robot's table names.
    pub(super) fn new(
        name: &'static str,
        tag: f64,
        robot: &Robot,
        model: &Model,
    ) -> Result<Self, EnvError> {
        let simulation = Simulation::new(name, model)?;
        let pieces = Pieces::new(name, robot, &simulation)?;
        let controls = vec![0.0; simulation.control_range().len()];
        let (start, position, distance) = (0.0, 0.0, 0.0);
        let noise = robot.initial_noise.clone();
        let mut environment = Self {
            name,
            tag,
            pieces,
            noise,
            simulation,
            start,
            position,
            distance,
            controls,
        };
        environment.begin(|_| ());
        Ok(environment)
    }

    fn begin(&mut self, disturb: impl FnOnce(&mut Simulation)) {
        self.simulation.start(disturb);
        self.start = self.pieces.forward.read(&self.simulation);
        self.position = self.start;
        self.distance = self.goal_distance();
    }

    /// The distance of the goal's body from its target, metres; 0 if there is no goal.
    fn goal_distance(&self) -> f64 {
        self.pieces
            .goal
            .map_or(0.0, |goal| goal.distance(&self.simulation))
    }

    /// The dense reward of a step at `velocity` along the way (m/s), begun `before` metres from the
    /// goal.
    fn reward(&self, velocity: f64, before: f64, action: &[f64]) -> f64 {
        let paid = |term| {
            pieces::paid(
                term,
                &self.simulation,
                velocity,
                [before, self.distance],
                action,
            )
        };
        let sum = self.pieces.terms.iter().map(paid).fold(None, |sum, paid| {
            Some(match (sum, paid) {
                (None, Paid::More(x)) => x,
                (None, Paid::Less(x)) => -x,
                (Some(sum), Paid::More(x)) => sum + x,
                (Some(sum), Paid::Less(x)) => sum - x,
            })
        });
        sum.unwrap_or(0.0)
    }

    fn is_alive(&self) -> bool {
        self.pieces
            .alive
            .iter()
            .all(|(reading, bounds)| bounds.holds(reading.read(&self.simulation)))
    }

    /// The parts of the state that MuJoCo does not hold.
    fn kept(&self) -> Vec<f64> {
        let distance = self.pieces.goal.map(|_| self.distance);
        [self.start, self.position]
            .into_iter()
            .chain(distance)
            .collect()
    }
}

impl Environment for RobotEnvironment {
    fn spaces(&self) -> Spaces {
        let action_bound = match self.pieces.controls {
            Controls::Raw { bound } => bound,
            Controls::Scaled => 1.0,
        };
        Spaces {
            observation_dim: self.pieces.observation.iter().map(Observed::len).sum(),
            action_dim: self.controls.len(),
            action_bound,
        }
    }

    fn reset(&mut self, rng: &mut Rng, observation: &mut [f64]) {
        let InitialNoise {
            positions,
            velocities,
            disc,
        } = self.noise.clone();
        self.begin(|simulation| {
            disturb(simulation.qpos_mut(), positions, rng);
            disturb(simulation.qvel_mut(), velocities, rng);
            if let Some(disc) = disc {
                let radius = disc.radius.get();
                let point = loop {
                    let point = [(); 2].map(|()| rng.random_range(-radius..radius));
                    if point[0].hypot(point[1]) < radius {
                        break point;
                    }
                };
                simulation.qpos_mut()[disc.first..][..2].copy_from_slice(&point);
                simulation.qvel_mut()[disc.first..][..2].fill(0.0);
            }
        });
        self.pieces.observe(&self.simulation, observation);
    }

    fn step(&mut self, action: &[f64], observation: &mut [f64]) -> Result<Outcome, EnvError> {
        self.advance(action)?;
        let seconds = self.simulation.time_step() * self.pieces.frame_skip as f64;
        let before = std::mem::replace(
            &mut self.position,
            self.pieces.forward.read(&self.simulation),
        );
        let velocity = (self.position - before) / seconds;
        let distance = self.goal_distance();
        let before = std::mem::replace(&mut self.distance, distance);
        self.pieces.observe(&self.simulation, observation);
        Ok(Outcome {
            reward: self.reward(velocity, before, action),
            terminated: !self.is_alive(),
        })
    }

    fn advance(&mut self, action: &[f64]) -> Result<(), EnvError> {
        let frame_skip = self.pieces.frame_skip;
        match self.pieces.controls {
            Controls::Raw { .. } => self.simulation.advance(action, frame_skip)?,
            Controls::Scaled => {
                check_length(self.name, "the action", action.len(), self.controls.len())?;
                check_finite(self.name, "the action", action)?;
                let ranges = self.simulation.control_range();
                for ((control, action), [low, high]) in
                    self.controls.iter_mut().zip(action).zip(ranges)
                {
                    *control = low + (high - low) * (action.clamp(-1.0, 1.0) + 1.0) / 2.0;
                }
                self.simulation.advance(&self.controls, frame_skip)?;
            }
        }
        if self.pieces.reads_contacts {
            // Today's MuJoCo computes contact forces on request only; without the request they are
            // 0, as they were for Gym with mujoco-py 2.
            self.simulation.update_contact_forces();
        }
        Ok(())
    }

    fn landmark(&self) -> f64 {
        match &self.pieces.landmark {
            Some((Landmark::Goal(within), _)) => f64::from(u8::from(self.distance < within.get())),
            Some((Landmark::Height(_), Some(height))) => height.read(&self.simulation),
            _ => self.position - self.start,
        }
    }

    fn pose(&self) -> Pose {
        self.simulation.pose()
    }

    fn pose_of(&self, observation: &[f64]) -> Option<(Pose, usize)> {
        let (nq, nv) = (self.simulation.qpos().len(), self.simulation.qvel().len());
        observed::pose_of(&self.pieces.observation, observation, nq, nv)
    }

    fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError> {
        check_length(
            self.name,
            "qpos",
            pose.qpos.len(),
            self.simulation.qpos().len(),
        )?;
        check_length(
            self.name,
            "qvel",
            pose.qvel.len(),
            self.simulation.qvel().len(),
        )?;
        check_finite(self.name, "qpos", &pose.qpos)?;
        check_finite(self.name, "qvel", &pose.qvel)?;
        self.begin(|simulation| {
            simulation.qpos_mut().copy_from_slice(&pose.qpos);
            simulation.qvel_mut().copy_from_slice(&pose.qvel);
        });
        self.pieces.observe(&self.simulation, observation);
        Ok(())
    }

    fn save(&self) -> Vec<f64> {
        let mut state = vec![self.tag];
        state.extend(self.kept());
        state.extend_from_slice(&self.simulation.state());
        state
    }

    fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
        let kept = self.kept().len();
        let state = untag(
            self.name,
            self.tag,
            state,
            kept + self.simulation.state_len(),
        )?;
        let (kept, simulated) = state.split_at(kept);
        self.simulation.set_state(simulated)?;
        (self.start, self.position) = (kept[0], kept[1]);
        self.distance = kept.get(2).copied().unwrap_or(0.0);
        Ok(())
    }
}

/// Adds `noise` to each of `numbers`.
fn disturb(numbers: &mut [f64], noise: Option<Noise>, rng: &mut Rng) {
    let Some(noise) = noise else { return };
    for number in numbers {
        *number += match noise {
            Noise::Uniform(bound) => rng.random_range(-bound.get()..bound.get()),
            Noise::Normal(deviation) => deviation.get() * rng.sample::<f64, _>(StandardNormal),
        };
    }
}
