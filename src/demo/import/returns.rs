//! The rewards of an imported demonstration, as far as its observations tell.

use std::path::Path;

use crate::{
    demo::{DemoError, Demonstration},
    env::{EnvError, EnvId},
};

/// The dense reward of each step (`[n]`), from observations and actions alone.
///
/// InvertedPendulum pays 1 a step; the double pendulum's pose follows from its observation. For the
/// four that run, the forward velocity at a step's beginning stands in for the distance of that
/// step, which the observation does not hold: on the authors' demonstrations the return is within
/// 0.5 % of the paper's Table 3. Ant's contact cost is that of the observation's clipped forces. In
/// any other environment each step is replayed from its observation.
///
/// # Errors
///
/// The shapes do not fit `env` (the message names `path`), or a step must be replayed and cannot
/// be.
pub fn recomputed_rewards(
    demonstration: &Demonstration,
    path: &Path,
    env: EnvId,
) -> Result<Vec<f64>, DemoError> {
    demonstration.check(path, env)?;
    let steps = demonstration
        .observations
        .column_iter()
        .zip(demonstration.actions.column_iter());
    let told = steps
        .map(|(observation, action)| reward(env, observation.as_slice(), action.norm_squared()));
    if let Some(rewards) = told.collect() {
        return Ok(rewards);
    }
    let replayed = replayed(demonstration, env);
    let replayed = replayed.map_err(|source| DemoError::Environment {
        path: path.to_owned(),
        source,
    })?;
    replayed.ok_or_else(|| DemoError::NoPoses(path.to_owned()))
}

/// The rewards of `env`, each step replayed from its observation; `None` where an observation does
/// not hold a pose.
///
/// # Errors
///
/// The physics cannot bear a step.
fn replayed(demonstration: &Demonstration, env: EnvId) -> Result<Option<Vec<f64>>, EnvError> {
    let mut environment = env.build()?;
    let mut after = vec![0.0; environment.spaces().observation_dim];
    let mut rewards = Vec::new();
    for (observation, action) in demonstration
        .observations
        .column_iter()
        .zip(demonstration.actions.column_iter())
    {
        let Some((pose, _)) = environment.pose_of(observation.as_slice()) else {
            return Ok(None);
        };
        environment.set_pose(&pose, &mut after)?;
        rewards.push(environment.step(action.as_slice(), &mut after)?.reward);
    }
    Ok(Some(rewards))
}

/// The reward of a step from its observation and its action's squared norm; `None` if they do not
/// determine it.
fn reward(env: EnvId, observation: &[f64], effort: f64) -> Option<f64> {
    Some(match env {
        EnvId::InvertedPendulum => 1.0,
        EnvId::InvertedDoublePendulum => {
            let [x, sin1, sin2, cos1, cos2, _, v1, v2, ..] = *observation else {
                return None;
            };
            // The second angle is relative to the first; poles of 0.6 m.
            let tip_x = x + 0.6 * sin1 + 0.6 * (sin1 * cos2 + cos1 * sin2);
            let tip_z = 0.6 * cos1 + 0.6 * (cos1 * cos2 - sin1 * sin2);
            10.0 - 0.01 * tip_x * tip_x - (tip_z - 2.0).powi(2) - 1e-3 * v1 * v1 - 5e-3 * v2 * v2
        }
        EnvId::HalfCheetah => observation[8] - 0.1 * effort,
        EnvId::Hopper => observation[5] + 1.0 - 1e-3 * effort,
        EnvId::Walker2d => observation[8] + 1.0 - 1e-3 * effort,
        EnvId::Ant => {
            let contact: f64 = observation[27..]
                .iter()
                .map(|force| force.clamp(-1.0, 1.0).powi(2))
                .sum();
            observation[13] + 1.0 - 0.5 * effort - 5e-4 * contact
        }
        _ => return None,
    })
}
