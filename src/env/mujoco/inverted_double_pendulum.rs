//! InvertedDoublePendulum-v2: two poles, one on the other, on a cart.

use super::{Definition, Landmark, Noise, first_coordinate, simulation::Simulation, write};
use crate::env::EnvId;

/// Length of each pole, metres.
const LENGTH: f64 = 0.6;
/// The site at the upper pole's end.
const TIP: usize = 0;

pub(in crate::env) static INVERTED_DOUBLE_PENDULUM: Definition = Definition {
    env: EnvId::InvertedDoublePendulum,
    model: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/third_party/models/inverted_double_pendulum.xml")),
    frame_skip: 5,
    observation_dim: 11,
    position_noise: 0.1,
    velocity_noise: Noise::Normal(0.1),
    complete: |_| (),
    observe,
    position: first_coordinate,
    landmark: Landmark::Height(second_pole_height),
    reward,
    terminated: |simulation| tip(simulation).1 <= 1.0,
};

/// The cart's position, sines and cosines of the angles, velocities and constraint forces, clipped.
fn observe(simulation: &Simulation, observation: &mut [f64]) {
    let (cart, angles) = simulation.qpos().split_at(1);
    let clipped = |x: &f64| x.clamp(-10.0, 10.0);
    let parts = cart
        .iter()
        .copied()
        .chain(angles.iter().map(|a| a.sin()))
        .chain(angles.iter().map(|a| a.cos()))
        .chain(simulation.qvel().iter().map(clipped))
        .chain(simulation.constraint_forces().iter().map(clipped));
    write(observation, parts);
}

/// 10 for being alive, less the tip's distance from upright and the joints' velocities.
fn reward(simulation: &Simulation, _: f64, _: &[f64]) -> f64 {
    let (x, height) = tip(simulation);
    let (v1, v2) = (simulation.qvel()[1], simulation.qvel()[2]);
    10.0 - 0.01 * x.powi(2) - (height - 2.0).powi(2) - 1e-3 * v1.powi(2) - 5e-3 * v2.powi(2)
}

/// The tip's position along the track and its height.
fn tip(simulation: &Simulation) -> (f64, f64) {
    let [x, _, z] = simulation.site_position(TIP);
    (x, z)
}

/// The height of the second pole's centre over the cart: 0.9 upright.
fn second_pole_height(simulation: &Simulation) -> f64 {
    let (first, second) = (simulation.qpos()[1], simulation.qpos()[2]);
    LENGTH * first.cos() + LENGTH / 2.0 * (first + second).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_poles_centre_is_where_the_engine_has_it() {
        const SECOND_POLE: usize = 3;
        let definition = &INVERTED_DOUBLE_PENDULUM;
        let mut simulation = Simulation::new(definition.env, definition.model).expect("the model loads");
        for angles in [[0.0, 0.0], [0.3, 0.2], [-1.0, 0.4], [2.0, -3.0]] {
            simulation.start(|simulation| simulation.qpos_mut()[1..].copy_from_slice(&angles));
            let base = simulation.body_position(SECOND_POLE)[2];
            let (_, tip) = tip(&simulation);
            assert!((second_pole_height(&simulation) - (base + tip) / 2.0).abs() < 1e-12, "{angles:?}");
        }
    }
}
