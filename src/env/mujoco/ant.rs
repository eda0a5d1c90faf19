//! Ant-v2: four legs, in space, with contact forces among its 111 observations.

use super::{Definition, Landmark, Noise, simulation::Simulation, squared_norm, write};
use crate::env::EnvId;

/// The torso, after the world.
const TORSO: usize = 1;

pub(in crate::env) static ANT: Definition = Definition {
    env: EnvId::Ant,
    model: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/third_party/models/ant.xml")),
    frame_skip: 5,
    observation_dim: 111,
    position_noise: 0.1,
    velocity_noise: Noise::Normal(0.1),
    // Today's MuJoCo computes contact forces on request alone; without this they are 0, as Gym with mujoco-py 2 had them.
    complete: Simulation::update_contact_forces,
    observe,
    position: |simulation| simulation.body_position(TORSO)[0],
    landmark: Landmark::Distance,
    reward,
    terminated,
};

/// Positions without the first two, velocities, and the contact forces, clipped.
fn observe(simulation: &Simulation, observation: &mut [f64]) {
    let motion = simulation.qpos()[2..].iter().chain(simulation.qvel()).copied();
    write(observation, motion.chain(clipped_contact_forces(simulation)));
}

/// Forward velocity, 1 for being alive, a control cost and a contact cost.
fn reward(simulation: &Simulation, velocity: f64, action: &[f64]) -> f64 {
    let contact: f64 = clipped_contact_forces(simulation).map(|f| f * f).sum();
    velocity + 1.0 - 0.5 * squared_norm(action) - 5e-4 * contact
}

fn terminated(simulation: &Simulation) -> bool {
    !(0.2..=1.0).contains(&simulation.qpos()[2])
}

fn clipped_contact_forces(simulation: &Simulation) -> impl Iterator<Item = f64> {
    simulation.contact_forces().iter().map(|f| f.clamp(-1.0, 1.0))
}
