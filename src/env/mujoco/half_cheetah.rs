//! HalfCheetah-v2: two legs and a trunk, in a plane; it never ends.

use super::{Definition, Landmark, Noise, first_coordinate, simulation::Simulation, squared_norm, write};
use crate::env::EnvId;

pub(in crate::env) static HALF_CHEETAH: Definition = Definition {
    env: EnvId::HalfCheetah,
    model: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/third_party/models/half_cheetah.xml")),
    frame_skip: 5,
    observation_dim: 17,
    position_noise: 0.1,
    velocity_noise: Noise::Normal(0.1),
    complete: |_| (),
    observe,
    position: first_coordinate,
    landmark: Landmark::Distance,
    reward: |_, velocity, action| velocity - 0.1 * squared_norm(action),
    terminated: |_| false,
};

/// Positions without the first, and velocities.
fn observe(simulation: &Simulation, observation: &mut [f64]) {
    write(observation, simulation.qpos()[1..].iter().chain(simulation.qvel()).copied());
}
