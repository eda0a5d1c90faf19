//! Demonstrations, and how far a policy is from one.
//!
//! Owns the Parquet format, import, verification by re-simulation, the Gaussian kernel, its units
//! and the MMD. Knows nothing of networks or updates. Start at [`Demonstration`] and [`mmd`].

mod character;
pub mod import;
mod kernel;
pub mod mmd;
mod motion;
mod pairs;
mod parquet;
mod standardizer;
mod verify;

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use nalgebra::DMatrix;

pub use character::stack;
pub use kernel::{Bandwidth, Kernel};
pub use mmd::Estimator;
pub use standardizer::Standardizer;
pub use verify::{At, Deviation, Replay, Tolerance, verify};

use crate::env::{EnvError, EnvId, Pose};
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
        let misfit = |reason| DemoError::Misfit {
            path: path.to_owned(),
            env,
            reason,
        };
        if let Some(label) = self.label().filter(|label| *label != env.name())
            && EnvId::of_label(label).is_some_and(|(other, _)| other != env)
        {
            return Err(misfit(format!(
                "the file says that it is from {}",
                label.escape_debug()
            )));
        }
        let environment = env.build().map_err(failed)?;
        let (spaces, pose) = (environment.spaces(), environment.pose());
        let first_pose = self.poses.as_ref().and_then(|poses| poses.first());
        for (what, got, expected) in [
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
            if let Some(got) = got.filter(|&got| got != expected) {
                let version = env
                    .observing(got)
                    .filter(|_| what == "an observation")
                    .and_then(|version| env.differs_in(version));
                let version =
                    version.map_or_else(String::new, |difference| format!(" ({difference})"));
                return Err(misfit(format!(
                    "{what} has {got} numbers; {expected} are needed{version}"
                )));
            }
        }
        // HalfCheetah and Walker2d have the same lengths, so only motion tells them apart.
        match motion::mover(self, env).map_err(failed)? {
            Mover::Other(other) => Err(misfit(format!(
                "its observations move like those of {other}"
            ))),
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

    /// The reason why this is no demonstration; `None` if it is one.
    fn flaw(&self) -> Option<String> {
        let n = self.len();
        if n == 0 {
            return Some("it has no steps".into());
        }
        let lengths = [
            ("actions", Some(self.actions.ncols())),
            ("rewards", self.rewards.as_ref().map(Vec::len)),
            ("terminated", Some(self.terminated.len())),
            ("truncated", Some(self.truncated.len())),
            ("poses", self.poses.as_ref().map(Vec::len)),
        ];
        if let Some((what, Some(length))) = lengths
            .into_iter()
            .find(|(_, length)| length.is_some_and(|l| l != n))
        {
            return Some(format!("{what} has {length} entries for {n} observations"));
        }
        if self.observations.nrows() == 0 || self.actions.nrows() == 0 {
            return Some("an observation or an action has no numbers".into());
        }
        if self.episode_starts.first() != Some(&0)
            || !self.episode_starts.iter().is_sorted_by(|a, b| a < b)
        {
            return Some("its episodes do not start at step 0 and then one after another".into());
        }
        if self.episode_starts.last().is_some_and(|&start| start >= n) {
            return Some("an episode starts after the last step".into());
        }
        for steps in self.episodes() {
            let before_last = steps.start..steps.end - 1;
            if let Some(step) = before_last
                .into_iter()
                .find(|&step| self.terminated[step] || self.truncated[step])
            {
                return Some(format!(
                    "row {step} ends its episode, but row {} continues it",
                    step + 1
                ));
            }
        }
        let poses = self.poses.iter().flatten();
        if let Some(first) = self.poses.as_ref().and_then(|poses| poses.first())
            && poses.clone().any(|pose| {
                pose.qpos.len() != first.qpos.len() || pose.qvel.len() != first.qvel.len()
            })
        {
            return Some("its poses differ in length".into());
        }
        let numbers = [
            ("observation", self.observations.as_slice()),
            ("action", self.actions.as_slice()),
            ("reward", self.rewards.as_deref().unwrap_or_default()),
        ];
        let infinite = numbers
            .into_iter()
            .find(|(_, numbers)| numbers.iter().any(|x| !x.is_finite()));
        if let Some((what, _)) = infinite {
            return Some(format!(
                "its {what} column holds a number that is not finite"
            ));
        }
        if poses
            .clone()
            .any(|pose| pose.qpos.iter().chain(&pose.qvel).any(|x| !x.is_finite()))
        {
            return Some("its qpos or qvel column holds a number that is not finite".into());
        }
        None
    }
}

/// Errors of demonstrations; the message names the file.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// The file cannot be opened or read.
    #[error("cannot read the demonstration {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The reader's error.
        reason: String,
    },
    /// The file cannot be written.
    #[error("cannot write the demonstration {}: {reason}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The writer's error.
        reason: String,
    },
    /// The file is readable but not a demonstration of this environment.
    #[error("the demonstration {} does not fit {env}: {reason}", path.display())]
    Misfit {
        /// The file.
        path: PathBuf,
        /// The environment.
        env: EnvId,
        /// The mismatch.
        reason: String,
    },
    /// The demonstration has no poses.
    #[error("cannot replay the demonstration {}: without the columns `qpos` and `qvel` there is no state to start from", .0.display())]
    NoPoses(PathBuf),
    /// The environment failed while it was replayed.
    #[error("cannot replay the demonstration {}: {source}", path.display())]
    Environment {
        /// The file.
        path: PathBuf,
        /// The environment's error.
        source: EnvError,
    },
}

#[cfg(test)]
mod tests;
