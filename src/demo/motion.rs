//! Whether observations move as an environment's do: each step, replayed from its own observation.
//!
//! Needs no recorded pose: an observation holds all of a pose but the place along the ground, which
//! the physics does not depend on. A replay of one step tells nothing of last bits (the engine's
//! warm start is missing, velocities may be clipped, and other engines differ), but another robot,
//! units that are not raw, and two episodes joined end to end stand out by far.

use super::Demonstration;
use crate::env::{EnvError, EnvId};

/// A step whose positions change by less than this (metres and radians, summed) tells nothing.
const STILL: f64 = 1e-3;
/// The fewest steps that show whose motion it is.
const FEWEST: usize = 10;
/// The most steps that are replayed to find whose motion it is.
const MOST: usize = 200;
/// If the physics leaves more than this share unexplained in half of the steps, they are another
/// environment's.
/// The authors' demonstrations, of an older engine and with clipped observations, have 0.11 at
/// most.
/// HalfCheetah's steps have 0.95 and more in Walker2d, and Walker2d's 8 in HalfCheetah.
const FOREIGN: f64 = 0.5;
/// A step that leaves more than this unexplained (metres and radians, summed) may be a jump.
/// The most within an episode is 0.12 in the authors' files, counting steps of which nearly all is
/// unexplained.
/// Where two episodes are joined it is 0.23 and more.
const JUMP: f64 = 0.2;
/// The share of a jump that the physics leaves unexplained: nearly all, since a jump has nothing to
/// do with the step before.
const NEARLY_ALL: f64 = 0.8;

/// One step's change of positions compared with the physics.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Motion {
    /// The step after which the positions are compared.
    step: usize,
    /// The sum of the magnitudes of the recorded changes.
    recorded: f64,
    /// The sum of the magnitudes of the differences from the replay.
    unexplained: f64,
}

/// The environment whose motion a demonstration shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mover {
    /// Its own environment, or there are too few steps to tell.
    Own,
    /// Another environment, whose observations and actions have the same lengths.
    Other(EnvId),
    /// None that is known: the observations are not raw, or are another robot's.
    Unknown,
}

/// Finds whose motion `demonstration` shows; its shapes must fit `env`.
///
/// # Errors
///
/// The physics engine refuses a model.
pub(super) fn mover(demonstration: &Demonstration, env: EnvId) -> Result<Mover, EnvError> {
    if !is_foreign(demonstration, env)? {
        return Ok(Mover::Own);
    }
    let shape = |env: EnvId| {
        env.spaces()
            .map(|spaces| (spaces.observation_dim, spaces.action_dim))
    };
    for other in EnvId::shipped() {
        if other != env && shape(other) == shape(env) && !is_foreign(demonstration, other)? {
            return Ok(Mover::Other(other));
        }
    }
    Ok(Mover::Unknown)
}

/// Whether half of the steps that tell anything do not move as `env` does.
fn is_foreign(demonstration: &Demonstration, env: EnvId) -> Result<bool, EnvError> {
    let motions = motions(demonstration, env, MOST)?;
    let moving = motions.iter().filter(|motion| motion.recorded > STILL);
    let mut shares: Vec<f64> = moving
        .map(|motion| motion.unexplained / motion.recorded)
        .collect();
    shares.sort_by(f64::total_cmp);
    Ok(shares.len() >= FEWEST && shares[shares.len() / 2] > FOREIGN)
}

/// The steps after which the observation jumps as no physics does, though the episode goes on.
/// None if most steps jump: the observations are then not of `env` at all.
///
/// # Errors
///
/// The physics engine refuses the model.
pub(super) fn jumps(demonstration: &Demonstration, env: EnvId) -> Result<Vec<usize>, EnvError> {
    let motions = motions(demonstration, env, usize::MAX)?;
    let jumps = motions
        .iter()
        .filter(|m| m.unexplained > JUMP && m.unexplained > NEARLY_ALL * m.recorded);
    let steps: Vec<usize> = jumps.map(|motion| motion.step).collect();
    Ok(if 2 * steps.len() <= motions.len() {
        steps
    } else {
        Vec::new()
    })
}

/// The motion from step to step within each episode, for the first `most` steps; empty for an
/// environment whose observations do not hold a pose.
/// The shapes must be those of `env`.
///
/// # Errors
///
/// The physics engine refuses the model.
fn motions(
    demonstration: &Demonstration,
    env: EnvId,
    most: usize,
) -> Result<Vec<Motion>, EnvError> {
    let mut environment = env.build()?;
    let mut after = vec![0.0; environment.spaces().observation_dim];
    let mut motions = Vec::new();
    let within = demonstration
        .episodes()
        .flat_map(|steps| steps.start..steps.end - 1);
    for step in within.take(most) {
        let (before, next) = (
            demonstration.observations.column(step),
            demonstration.observations.column(step + 1),
        );
        let Some((pose, positions)) = environment.pose_of(before.as_slice()) else {
            break;
        };
        environment.set_pose(&pose, &mut after)?;
        // A pose that the physics refuses is no motion of this environment.
        let replayed = environment
            .step(demonstration.actions.column(step).as_slice(), &mut after)
            .is_ok();
        let sum = |of: &dyn Fn(usize) -> f64| (0..positions).map(|i| of(i).abs()).sum::<f64>();
        let recorded = sum(&|i| next[i] - before[i]);
        let unexplained = if replayed {
            sum(&|i| next[i] - after[i])
        } else {
            f64::INFINITY
        };
        motions.push(Motion {
            step,
            recorded,
            unexplained,
        });
    }
    Ok(motions)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// A recording of Gymnasium's, of several episodes.
    fn recorded(env: EnvId) -> Demonstration {
        Demonstration::read(&Path::new("tests/parity").join(format!("{env}.parquet")))
            .expect("it was recorded")
    }

    #[test]
    fn each_environment_knows_its_own_motion() {
        for env in EnvId::ALL {
            assert_eq!(
                mover(&recorded(env), env).expect("it is replayed"),
                Mover::Own,
                "{env}"
            );
            assert!(
                jumps(&recorded(env), env)
                    .expect("it is replayed")
                    .is_empty(),
                "{env}"
            );
        }
    }

    #[test]
    fn two_robots_of_one_shape_are_told_apart() {
        let (cheetah, walker) = (EnvId::HalfCheetah, EnvId::Walker2d);
        assert_eq!(
            mover(&recorded(cheetah), walker).expect("it is replayed"),
            Mover::Other(cheetah)
        );
        assert_eq!(
            mover(&recorded(walker), cheetah).expect("it is replayed"),
            Mover::Other(walker)
        );
        let mut scaled = recorded(EnvId::Hopper);
        scaled
            .observations
            .row_iter_mut()
            .skip(1)
            .step_by(2)
            .for_each(|mut row| row *= -3.0);
        assert_eq!(
            mover(&scaled, EnvId::Hopper).expect("it is replayed"),
            Mover::Unknown
        );
    }

    #[test]
    fn episodes_that_were_joined_jump_where_they_were() {
        for env in EnvId::ALL {
            let mut joined = recorded(env);
            let starts = std::mem::replace(&mut joined.episode_starts, vec![0]);
            let expected: Vec<usize> = starts[1..].iter().map(|start| start - 1).collect();
            assert!(!expected.is_empty());
            assert_eq!(
                jumps(&joined, env).expect("it is replayed"),
                expected,
                "{env}"
            );
        }
    }
}
