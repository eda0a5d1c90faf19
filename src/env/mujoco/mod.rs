//! The six MuJoCo tasks.
//!
//! Owns the engine ([`Simulation`], the only place that names `mujoco_rs`) and each task's [`Definition`], one file a
//! task. Knows nothing of time limits or sparse rewards. Start at [`hopper`].
//!
//! The paper's were Gym's of 2019 on MuJoCo 2.0 or 1.5. Today's engine refuses two of those models; Gymnasium's are used, and
//! Gym's noise, rewards and ends. Trajectories differ from the authors'; uniform actions earn what Table 4 says.

mod ant;
mod half_cheetah;
mod hopper;
mod inverted_double_pendulum;
mod inverted_pendulum;
mod simulation;
mod walker2d;

pub(super) use ant::ANT;
pub(super) use half_cheetah::HALF_CHEETAH;
pub(super) use hopper::HOPPER;
pub(super) use inverted_double_pendulum::INVERTED_DOUBLE_PENDULUM;
pub(super) use inverted_pendulum::INVERTED_PENDULUM;
pub use simulation::engine_version;
pub(super) use walker2d::WALKER2D;

use rand::RngExt;
use rand_distr::StandardNormal;

use self::simulation::Simulation;
use super::{EnvError, EnvId, Environment, Outcome, Pose, Spaces, check_finite, check_length, untag};
use crate::rng::Rng;

/// What Gym adds to a model to make a task of it.
pub(super) struct Definition {
    env: EnvId,
    /// The model, as MJCF.
    model: &'static str,
    /// Steps of physics a step of the task.
    frame_skip: usize,
    observation_dim: usize,
    /// Initial positions are uniform within this distance of the model's.
    position_noise: f64,
    velocity_noise: Noise,
    /// Computes, after stepping, what else the task reads.
    complete: fn(&mut Simulation),
    observe: fn(&Simulation, &mut [f64]),
    /// Where the body is along the track, metres.
    position: fn(&Simulation) -> f64,
    landmark: Landmark,
    /// From the simulation after the step, the velocity along the track (m/s) and the unclamped action.
    reward: fn(&Simulation, f64, &[f64]) -> f64,
    terminated: fn(&Simulation) -> bool,
}

/// How initial velocities are drawn around 0.
enum Noise {
    /// Uniformly within this distance.
    Uniform(f64),
    /// Normally with this standard deviation.
    Normal(f64),
}

/// What the sparse reward watches.
enum Landmark {
    /// The distance covered since the episode's start.
    Distance,
    /// A height, metres.
    Height(fn(&Simulation) -> f64),
}

/// A task on a simulated body.
pub(super) struct MujocoEnvironment {
    definition: &'static Definition,
    simulation: Simulation,
    /// Position along the track at the episode's start.
    start: f64,
    /// Position along the track after the last step. Kept, since MuJoCo's own may be of a state that is not saved.
    position: f64,
}

impl MujocoEnvironment {
    /// The task at its model's start.
    ///
    /// Errors: MuJoCo refuses the model.
    pub(super) fn new(definition: &'static Definition) -> Result<Self, EnvError> {
        let simulation = Simulation::new(definition.env, definition.model)?;
        let mut environment = Self { definition, simulation, start: 0.0, position: 0.0 };
        environment.start(|_| ());
        Ok(environment)
    }

    fn start(&mut self, disturb: impl FnOnce(&mut Simulation)) {
        self.simulation.start(disturb);
        self.start = (self.definition.position)(&self.simulation);
        self.position = self.start;
    }
}

impl Environment for MujocoEnvironment {
    fn spaces(&self) -> Spaces {
        let range = self.simulation.control_range();
        Spaces { observation_dim: self.definition.observation_dim, action_dim: range.len(), action_bound: range[0][1] }
    }

    fn reset(&mut self, rng: &mut Rng, observation: &mut [f64]) {
        let Definition { position_noise, velocity_noise, observe, .. } = self.definition;
        self.start(|simulation| {
            for q in simulation.qpos_mut() {
                *q += rng.random_range(-position_noise..*position_noise);
            }
            for v in simulation.qvel_mut() {
                *v += match velocity_noise {
                    Noise::Uniform(bound) => rng.random_range(-bound..*bound),
                    Noise::Normal(deviation) => deviation * rng.sample::<f64, _>(StandardNormal),
                };
            }
        });
        observe(&self.simulation, observation);
    }

    fn step(&mut self, action: &[f64], observation: &mut [f64]) -> Result<Outcome, EnvError> {
        self.advance(action)?;
        let Definition { frame_skip, observe, position, reward, terminated, .. } = self.definition;
        let before = std::mem::replace(&mut self.position, position(&self.simulation));
        let velocity = (self.position - before) / (self.simulation.time_step() * *frame_skip as f64);
        observe(&self.simulation, observation);
        Ok(Outcome { reward: reward(&self.simulation, velocity, action), terminated: terminated(&self.simulation) })
    }

    fn advance(&mut self, action: &[f64]) -> Result<(), EnvError> {
        self.simulation.advance(action, self.definition.frame_skip)?;
        (self.definition.complete)(&mut self.simulation);
        Ok(())
    }

    fn landmark(&self) -> f64 {
        match self.definition.landmark {
            Landmark::Distance => self.position - self.start,
            Landmark::Height(height) => height(&self.simulation),
        }
    }

    fn pose(&self) -> Pose {
        self.simulation.pose()
    }

    fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError> {
        let env = self.definition.env;
        check_length(env, "qpos", pose.qpos.len(), self.simulation.qpos().len())?;
        check_length(env, "qvel", pose.qvel.len(), self.simulation.qvel().len())?;
        check_finite(env, "qpos", &pose.qpos)?;
        check_finite(env, "qvel", &pose.qvel)?;
        self.start(|simulation| {
            simulation.qpos_mut().copy_from_slice(&pose.qpos);
            simulation.qvel_mut().copy_from_slice(&pose.qvel);
        });
        (self.definition.observe)(&self.simulation, observation);
        Ok(())
    }

    fn save(&self) -> Vec<f64> {
        let mut state = vec![self.definition.env.tag(), self.start, self.position];
        state.extend_from_slice(&self.simulation.state());
        state
    }

    fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
        let state = untag(self.definition.env, state, 2 + self.simulation.state_len())?;
        self.simulation.set_state(&state[2..])?;
        (self.start, self.position) = (state[0], state[1]);
        Ok(())
    }
}

/// A digest of the model of `env`, hexadecimal; `None` for a task without one.
pub fn model_digest(env: EnvId) -> Option<String> {
    let definitions = [&INVERTED_PENDULUM, &INVERTED_DOUBLE_PENDULUM, &HALF_CHEETAH, &HOPPER, &WALKER2D, &ANT];
    let definition = definitions.into_iter().find(|definition| definition.env == env)?;
    Some(blake3::hash(definition.model.as_bytes()).to_hex()[..16].to_owned())
}

/// The position of tasks whose first coordinate is the one along the track.
fn first_coordinate(simulation: &Simulation) -> f64 {
    simulation.qpos()[0]
}

/// The sum of squares that control costs are made of.
fn squared_norm(action: &[f64]) -> f64 {
    action.iter().map(|a| a * a).sum()
}

/// Writes an observation, number after number.
fn write(observation: &mut [f64], numbers: impl Iterator<Item = f64>) {
    let mut slots = observation.iter_mut();
    for number in numbers {
        *slots.next().expect("an observation's buffer has its length") = number;
    }
}
