//! Walker2d-v2: two legs, in a plane.

use super::{Definition, Landmark, Noise, first_coordinate, hopper, simulation::Simulation};
use crate::env::EnvId;

pub(in crate::env) static WALKER2D: Definition = Definition {
    env: EnvId::Walker2d,
    model: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/third_party/models/walker2d.xml")),
    frame_skip: 4,
    observation_dim: 17,
    position_noise: 0.005,
    velocity_noise: Noise::Uniform(0.005),
    complete: |_| (),
    observe: hopper::observe,
    position: first_coordinate,
    landmark: Landmark::Distance,
    reward: hopper::reward,
    terminated,
};

fn terminated(simulation: &Simulation) -> bool {
    let (height, angle) = (simulation.qpos()[1], simulation.qpos()[2]);
    !(height > 0.8 && height < 2.0 && angle.abs() < 1.0)
}
