//! Demonstrations, and how far a policy is from one.
//!
//! Owns the Parquet format, import, verification by re-simulation, the Gaussian kernel, its units
//! and the MMD. Knows nothing of networks or updates. Start at [`Demonstration`] and [`mmd`].

mod block;
mod character;
mod error;
mod exponents;
pub mod import;
mod kernel;
pub mod mmd;
mod motion;
mod pairs;
mod parquet;
mod same_states;
mod standardizer;
mod verify;

use std::{ops::Range, path::Path};

use nalgebra::DMatrix;

pub use character::stack;
pub use error::{DemoError, Flaw, Mismatch, ReadError, WriteError};
pub use kernel::{Bandwidth, Kernel};
pub use mmd::Estimator;
pub use standardizer::Standardizer;
pub use verify::{At, Deviation, Replay, Tolerance, verify};

use crate::env::{EnvId, Pose};
use motion::Mover;

/// Episodes of somebody else's behaviour, step after step.
#[derive(Debug, Clone, PartialEq)]
pub struct Demonstration {
    /// Raw observations, each before its step `[observation_dim x n]`.
    pub observations: DMatrix<f64>,
    /// Raw actions, unclamped `[action_dim x n]`.
    pub actions: DMatrix<f64>,
    /// Dense rewards `[n]`; absent where the source had none.
    pub rewards: Option<Vec<f64>>,
    /// Index of the first step of each episode, in order; the first is 0.
    pub episode_starts: Vec<usize>,
    /// Whether the task ended the episode at this step `[n]`.
    pub terminated: Vec<bool>,
    /// Whether the time limit cut the episode at this step `[n]`.
    pub truncated: Vec<bool>,
    /// Poses before each step `[n]`; absent where the source had none.
    pub poses: Option<Vec<Pose>>,
    /// Where it comes from, as key and value: environment, seed, checkpoint, return ...
    pub provenance: Vec<(String, String)>,
}

impl Demonstration {
    /// The number of steps.
    pub fn len(&self) -> usize {
        self.observations.ncols()
    }

    /// Whether it has no steps; no demonstration that was read is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The steps of each episode, in order.
    pub fn episodes(&self) -> impl Iterator<Item = Range<usize>> {
        let ends = self
            .episode_starts
            .iter()
            .skip(1)
            .copied()
            .chain([self.len()]);
        self.episode_starts
            .iter()
            .copied()
            .zip(ends)
            .map(|(start, end)| start..end)
    }

    /// The sum of the dense rewards of each episode; absent where the rewards are.
    pub fn returns(&self) -> Option<Vec<f64>> {
        self.rewards.as_deref().map(|rewards| self.sums(rewards))
    }

    /// The sum over each episode of `values`, which has one a step.
    pub fn sums(&self, values: &[f64]) -> Vec<f64> {
        self.episodes()
            .map(|steps| values[steps].iter().sum())
            .collect()
    }

    /// The name of its environment in the file, as its writer spelled it.
    fn label(&self) -> Option<&str> {
        const KEYS: [&str; 4] = ["env", "environment", "env_name", "env_id"];
        let label = |key: &&str| self.provenance.iter().find(|(name, _)| name == key);
        KEYS.iter().find_map(label).map(|(_, label)| label.as_str())
    }

    /// Checks that observations, actions and poses have the lengths that `env` needs, and that they
    /// are not another environment's.
    /// That would show in the file's label, or, where another environment has the same lengths, in
    /// how they move.
    ///
    /// # Errors
    ///
    /// They do not fit (the message names `path`), or the physics engine refuses a model.
    pub fn check(&self, path: &Path, env: EnvId) -> Result<(), DemoError> {
        let failed = |source| DemoError::Environment {
            path: path.to_owned(),
            source,
        };
        let misfit = |source| DemoError::Misfit {
            path: path.to_owned(),
            env,
            source,
        };
        if let Some(label) = self.label().filter(|label| *label != env.name())
            && EnvId::of_label(label).is_some_and(|(other, _)| other != env)
        {
            return Err(misfit(Mismatch::Label(label.to_owned())));
        }
        let environment = env.build().map_err(failed)?;
        let (spaces, pose) = (environment.spaces(), environment.pose());
        let first_pose = self.poses.as_ref().and_then(|poses| poses.first());
        for (quantity, found, needed) in [
            (
                "an observation",
                Some(self.observations.nrows()),
                spaces.observation_dim,
            ),
            ("an action", Some(self.actions.nrows()), spaces.action_dim),
            (
                "qpos",
                first_pose.map(|pose| pose.qpos.len()),
                pose.qpos.len(),
            ),
            (
                "qvel",
                first_pose.map(|pose| pose.qvel.len()),
                pose.qvel.len(),
            ),
        ] {
            if let Some(found) = found.filter(|&found| found != needed) {
                let version = env
                    .observing(found)
                    .filter(|_| quantity == "an observation")
                    .and_then(|version| env.differs_in(version));
                return Err(misfit(Mismatch::Length {
                    quantity,
                    found,
                    needed,
                    version,
                }));
            }
        }
        // HalfCheetah and Walker2d have the same lengths, so only motion tells them apart.
        match motion::mover(self, env).map_err(failed)? {
            Mover::Other(other) => Err(misfit(Mismatch::Motion(other))),
            Mover::Own | Mover::Unknown => Ok(()),
        }
    }

    /// Reads the Parquet file `path`, as [`read`](Demonstration::read), and checks that it fits
    /// `env`.
    ///
    /// # Errors
    ///
    /// It cannot be read, or is of another environment.
    pub fn read_for(path: &Path, env: EnvId) -> Result<Self, DemoError> {
        let demonstration = Self::read(path)?;
        demonstration.check(path, env)?;
        Ok(demonstration)
    }

    /// Checks that this is a demonstration: whole episodes of equal quantities.
    fn is_sound(&self) -> Result<(), Flaw> {
        let n = self.len();
        if n == 0 {
            return Err(Flaw::NoSteps);
        }
        let lengths = [
            ("actions", Some(self.actions.ncols())),
            ("rewards", self.rewards.as_ref().map(Vec::len)),
            ("terminated", Some(self.terminated.len())),
            ("truncated", Some(self.truncated.len())),
            ("poses", self.poses.as_ref().map(Vec::len)),
        ];
        for (quantity, found) in lengths {
            if let Some(found) = found.filter(|&found| found != n) {
                return Err(Flaw::Entries {
                    quantity,
                    found,
                    steps: n,
                });
            }
        }
        if self.observations.nrows() == 0 || self.actions.nrows() == 0 {
            return Err(Flaw::NoNumbers);
        }
        self.episodes_are_whole()?;
        self.numbers_are_sound()
    }

    /// Checks that each episode begins where the one before ended, and no step before its last ends
    /// it.
    fn episodes_are_whole(&self) -> Result<(), Flaw> {
        let starts = &self.episode_starts;
        if starts.first() != Some(&0) || !starts.is_sorted_by(|a, b| a < b) {
            return Err(Flaw::Starts);
        }
        if starts.last().is_some_and(|&start| start >= self.len()) {
            return Err(Flaw::StartsAfterLast);
        }
        let ends = |row: &usize| self.terminated[*row] || self.truncated[*row];
        let mut before_last = self.episodes().flat_map(|steps| steps.start..steps.end - 1);
        match before_last.find(ends) {
            Some(row) => Err(Flaw::GoesOn { row }),
            None => Ok(()),
        }
    }

    /// Checks that poses are equally long, and all numbers finite.
    fn numbers_are_sound(&self) -> Result<(), Flaw> {
        let poses = self.poses.as_deref().unwrap_or_default();
        let lengths = |pose: &Pose| (pose.qpos.len(), pose.qvel.len());
        if poses
            .windows(2)
            .any(|two| lengths(&two[0]) != lengths(&two[1]))
        {
            return Err(Flaw::UnequalPoses);
        }
        let numbers = [
            ("observation", self.observations.as_slice()),
            ("action", self.actions.as_slice()),
            ("reward", self.rewards.as_deref().unwrap_or_default()),
        ];
        let of_poses = poses.iter().flat_map(|pose| {
            [pose.qpos.as_slice(), &pose.qvel].map(|numbers| ("qpos or qvel", numbers))
        });
        let is_infinite = |(_, numbers): &(_, &[f64])| numbers.iter().any(|x| !x.is_finite());
        match numbers.into_iter().chain(of_poses).find(is_infinite) {
            Some((column, _)) => Err(Flaw::NotFinite(column)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
