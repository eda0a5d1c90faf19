//! What an imported demonstration earned, as far as its observations tell.

use std::path::Path;

use crate::{
    demo::{DemoError, Demonstration},
    env::{EnvError, EnvId, Pose},
};

/// The dense reward of each step (`[n]`), from observations and actions alone.
///
/// MountainCar's observation is its whole state, so it is replayed; InvertedPendulum pays 1 a step; the double pendulum's
/// pose follows from its observation. For the four that run, the forward velocity at a step's beginning stands in for the
/// distance of that step, which the observation does not hold: on the authors' demonstrations the return is within 0.5 %
/// of the paper's Table 3. Ant's contact cost is that of the observation's clipped forces.
///
/// Errors: the shapes do not fit `env` (the message names `path`), or MountainCar cannot be replayed.
pub fn recomputed_rewards(demonstration: &Demonstration, path: &Path, env: EnvId) -> Result<Vec<f64>, DemoError> {
    demonstration.check(path, env)?;
    if env == EnvId::MountainCar {
        return replayed(demonstration).map_err(|source| DemoError::Environment { path: path.to_owned(), source });
    }
    let steps = demonstration.observations.column_iter().zip(demonstration.actions.column_iter());
    Ok(steps.map(|(observation, action)| reward(env, observation.as_slice(), action.norm_squared())).collect())
}

/// MountainCar's rewards, each step replayed from its observation.
fn replayed(demonstration: &Demonstration) -> Result<Vec<f64>, EnvError> {
    let mut environment = EnvId::MountainCar.build()?;
    let mut after = [0.0; 2];
    let steps = demonstration.observations.column_iter().zip(demonstration.actions.column_iter());
    steps
        .map(|(observation, action)| {
            let pose = Pose { qpos: vec![observation[0]], qvel: vec![observation[1]] };
            environment.set_pose(&pose, &mut after)?;
            Ok(environment.step(action.as_slice(), &mut after)?.reward)
        })
        .collect()
}

/// The reward of a step from its observation and its action's squared norm; MountainCar's without that of the goal.
fn reward(env: EnvId, observation: &[f64], effort: f64) -> f64 {
    match env {
        EnvId::MountainCar => -0.1 * effort,
        EnvId::InvertedPendulum => 1.0,
        EnvId::InvertedDoublePendulum => {
            let [x, sin1, sin2, cos1, cos2, _, v1, v2, ..] = *observation else { return f64::NAN };
            // The second angle is relative to the first; poles of 0.6 m.
            let tip_x = x + 0.6 * sin1 + 0.6 * (sin1 * cos2 + cos1 * sin2);
            let tip_z = 0.6 * cos1 + 0.6 * (cos1 * cos2 - sin1 * sin2);
            10.0 - 0.01 * tip_x * tip_x - (tip_z - 2.0).powi(2) - 1e-3 * v1 * v1 - 5e-3 * v2 * v2
        }
        EnvId::HalfCheetah => observation[8] - 0.1 * effort,
        EnvId::Hopper => observation[5] + 1.0 - 1e-3 * effort,
        EnvId::Walker2d => observation[8] + 1.0 - 1e-3 * effort,
        EnvId::Ant => {
            let contact: f64 = observation[27..].iter().map(|force| force.clamp(-1.0, 1.0).powi(2)).sum();
            observation[13] + 1.0 - 0.5 * effort - 5e-4 * contact
        }
    }
}
