//! InvertedPendulum-v2: a pole on a cart.

use super::{Definition, Landmark, Noise, first_coordinate, simulation::Simulation, write};
use crate::env::EnvId;

/// Length of the pole, metres.
const LENGTH: f64 = 0.6;

pub(in crate::env) static INVERTED_PENDULUM: Definition = Definition {
    env: EnvId::InvertedPendulum,
    model: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/third_party/models/inverted_pendulum.xml")),
    frame_skip: 2,
    observation_dim: 4,
    position_noise: 0.01,
    velocity_noise: Noise::Uniform(0.01),
    complete: |_| (),
    observe: |simulation, observation| write(observation, simulation.qpos().iter().chain(simulation.qvel()).copied()),
    position: first_coordinate,
    // The tip's height over the cart, less the millimetre by which the model's pole leans.
    landmark: Landmark::Height(|simulation| LENGTH * angle(simulation).cos()),
    // Also on the step that ends the episode.
    reward: |_, _, _| 1.0,
    terminated: |simulation| angle(simulation).abs() > 0.2,
};

fn angle(simulation: &Simulation) -> f64 {
    simulation.qpos()[1]
}
