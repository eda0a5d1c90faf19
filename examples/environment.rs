//! An environment of one's own in Rust: a cart that is pushed along a rail and is to come to rest
//! one metre further on.
//!
//!     cargo run --release --example environment
//!
//! It plays one episode under a controller written by hand, with the sparse reward of a [`Task`]: 1
//! for each whole quarter of a metre. A robot that MuJoCo simulates needs no Rust: it is a table in
//! the matrix file.

#![expect(clippy::print_stdout, reason = "an example shows what it finds")]

use mcpo_run::{
    env::{EnvError, Environment, EpisodeEnd, Outcome, Pose, Reward, Spaces, SparseMode, Task},
    quantity::constant,
    rng::{Rng, Seed, Stream},
};
use rand::RngExt;

const NAME: &str = "Cart";
/// Seconds of one step.
const STEP: f64 = 0.05;
/// The greatest push, m/s^2; an action is held to `[-PUSH, PUSH]`, while its cost counts all of it.
const PUSH: f64 = 2.0;
/// Where the cart is to rest, metres from the origin.
const GOAL: f64 = 1.0;

/// A cart without friction.
#[derive(Debug, Default)]
struct Cart {
    /// Metres and m/s.
    position: f64,
    velocity: f64,
    /// Where the episode began, metres.
    start: f64,
}

impl Cart {
    /// Begins an episode here.
    fn begin(&mut self, position: f64, velocity: f64, observation: &mut [f64]) {
        *self = Self {
            position,
            velocity,
            start: position,
        };
        self.observe(observation);
    }

    /// What is observed is all that the next step depends on: position and velocity.
    fn observe(&self, observation: &mut [f64]) {
        observation.copy_from_slice(&[self.position, self.velocity]);
    }
}

/// The numbers, if there are as many as needed and all are finite.
fn checked<const N: usize>(what: &'static str, numbers: &[f64]) -> Result<[f64; N], EnvError> {
    let env = || NAME.to_owned();
    let wrong_length = |_| EnvError::WrongLength {
        env: env(),
        what,
        got: numbers.len(),
        expected: N,
    };
    let checked = <[f64; N]>::try_from(numbers).map_err(wrong_length)?;
    if checked.iter().all(|number| number.is_finite()) {
        Ok(checked)
    } else {
        Err(EnvError::NonFinite {
            env: env(),
            what,
            numbers: numbers.to_vec(),
        })
    }
}

impl Environment for Cart {
    fn spaces(&self) -> Spaces {
        Spaces {
            observation_dim: 2,
            action_dim: 1,
            action_bound: PUSH,
        }
    }

    fn reset(&mut self, rng: &mut Rng, observation: &mut [f64]) {
        self.begin(rng.random_range(-0.05..0.05), 0.0, observation);
    }

    fn step(&mut self, action: &[f64], observation: &mut [f64]) -> Result<Outcome, EnvError> {
        self.advance(action)?;
        self.observe(observation);
        let reward = -(self.position - GOAL).abs() - 0.01 * action[0].powi(2);
        // A cart that has left the rail ends the episode: no reward comes after it.
        Ok(Outcome {
            reward,
            terminated: self.position.abs() > 2.0,
        })
    }

    fn advance(&mut self, action: &[f64]) -> Result<(), EnvError> {
        let [push] = checked("the action", action)?;
        self.velocity += STEP * push.clamp(-PUSH, PUSH);
        self.position += STEP * self.velocity;
        Ok(())
    }

    /// Metres from the episode's start, which is what SPARSE2 pays for.
    fn landmark(&self) -> f64 {
        self.position - self.start
    }

    fn pose(&self) -> Pose {
        Pose {
            qpos: vec![self.position],
            qvel: vec![self.velocity],
        }
    }

    fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError> {
        let ([position], [velocity]) = (checked("qpos", &pose.qpos)?, checked("qvel", &pose.qvel)?);
        self.begin(position, velocity, observation);
        Ok(())
    }

    fn save(&self) -> Vec<f64> {
        vec![self.position, self.velocity, self.start]
    }

    fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
        let [position, velocity, start] = checked("the saved state", state)?;
        *self = Self {
            position,
            velocity,
            start,
        };
        Ok(())
    }
}

/// Pushes towards the goal and against the motion: critically damped, so that the cart comes to
/// rest without passing it.
fn controller(observation: &[f64]) -> [f64; 1] {
    [2.0 * (GOAL - observation[0]) - 8f64.sqrt() * observation[1]]
}

/// Plays on to the episode's end, and gives its sparse return and its dense one from here on, and
/// how it ended.
fn play(task: &mut Task, observation: &mut [f64]) -> Result<(f64, f64, EpisodeEnd), EnvError> {
    let (mut sparse, mut dense) = (0.0, 0.0);
    loop {
        let transition = task.step(&controller(observation), observation)?;
        sparse += transition.reward;
        dense += transition.dense_reward;
        if let Some(end) = transition.end {
            return Ok((sparse, dense, end));
        }
    }
}

/// Plays the episode twice: to its end, and again from a saved state.
///
/// # Errors
///
/// An action or a state does not fit the cart.
pub fn main() -> Result<(), EnvError> {
    let reward = Reward::Sparse2 {
        distance: constant(0.25),
        mode: SparseMode::Milestone,
    };
    let mut task = Task::from_environment(NAME, Box::new(Cart::default()), reward, 200);
    let mut observation = vec![0.0; task.spaces().observation_dim];
    task.reset(
        &mut Seed(0).stream(Stream::Environment, 0),
        &mut observation,
    );
    task.step(&controller(&observation), &mut observation)?;
    let (state, mut again) = (task.save(), observation.clone());

    let (sparse, dense, end) = play(&mut task, &mut observation)?;
    println!(
        "{end:?} at {:.4} m, {:.4} m/s",
        observation[0], observation[1]
    );
    println!("return {sparse} in the sparse reward, {dense:.2} in the dense one");
    assert!(
        (observation[0] - GOAL).abs() < 1e-3 && observation[1].abs() < 1e-3,
        "the cart rests at the goal"
    );

    task.restore(&state)?;
    assert_eq!(
        play(&mut task, &mut again)?,
        (sparse, dense, end),
        "a restored episode goes on as it did"
    );
    assert_eq!(again, observation, "to the same bits");
    println!("the same from a saved state");
    Ok(())
}
