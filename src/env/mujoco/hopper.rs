//! Hopper-v2: one leg, in a plane.

use super::{Definition, Landmark, Noise, first_coordinate, simulation::Simulation, squared_norm, write};
use crate::env::EnvId;

pub(in crate::env) static HOPPER: Definition = Definition {
    env: EnvId::Hopper,
    model: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/third_party/models/hopper.xml")),
    frame_skip: 4,
    observation_dim: 11,
    position_noise: 0.005,
    velocity_noise: Noise::Uniform(0.005),
    complete: |_| (),
    observe,
    position: first_coordinate,
    landmark: Landmark::Distance,
    reward,
    terminated,
};

/// Positions without the first, and velocities, clipped; Walker2d's too.
pub(super) fn observe(simulation: &Simulation, observation: &mut [f64]) {
    let velocities = simulation.qvel().iter().map(|v| v.clamp(-10.0, 10.0));
    write(observation, simulation.qpos()[1..].iter().copied().chain(velocities));
}

/// Forward velocity, 1 for being upright, and a control cost; Walker2d's too.
pub(super) fn reward(_: &Simulation, velocity: f64, action: &[f64]) -> f64 {
    velocity + 1.0 - 1e-3 * squared_norm(action)
}

fn terminated(simulation: &Simulation) -> bool {
    let (height, angle) = (simulation.qpos()[1], simulation.qpos()[2]);
    let calm = simulation.qpos()[2..].iter().chain(simulation.qvel()).all(|x| x.abs() < 100.0);
    !(calm && height > 0.7 && angle.abs() < 0.2)
}
