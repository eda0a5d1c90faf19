//! The rewards that can be trained on.

use std::mem;

use serde::{Deserialize, Serialize};

use super::{EnvError, EnvId};
use crate::quantity::Positive;

/// The reward that is trained on. Externally tagged: `"dense"`, `"sparse1"`, `{ sparse2 = {
/// distance = 15.0 } }`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Reward {
    /// Gym's own ("exact") reward.
    Dense,
    /// SPARSE1: +1 on reaching the goal (MountainCar).
    Sparse1,
    /// SPARSE2: +1 for having moved forward (HalfCheetah, Hopper, Walker2d, Ant).
    Sparse2 {
        /// Metres from the episode's start.
        distance: Positive,
        /// Once for each whole distance, or on every step beyond the distance.
        #[serde(default)]
        mode: SparseMode,
    },
    /// SPARSE3: +1 on every step on which the last pole is high (InvertedPendulum,
    /// InvertedDoublePendulum).
    Sparse3 {
        /// Metres: the height of the single pole's tip, or of the centre of the double pendulum's
        /// second pole.
        height: Positive,
    },
}

/// When SPARSE2 pays.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum SparseMode {
    /// Once for each whole distance covered, so that going farther is worth more.
    #[default]
    Milestone,
    /// On every step beyond the distance; going farther is worth no more.
    Beyond,
}

impl Reward {
    /// # Errors
    ///
    /// `env` does not have this reward.
    pub(super) fn check(self, env: EnvId) -> Result<(), EnvError> {
        let has = env.sparse_reward();
        if self == Self::Dense || mem::discriminant(&self) == mem::discriminant(&has) {
            Ok(())
        } else {
            let has = if has == Self::Dense {
                "no other; its table names no landmark"
            } else {
                has.name()
            };
            Err(EnvError::NoSuchReward {
                env,
                reward: self.name(),
                has,
            })
        }
    }

    /// The name, as it is written in a matrix.
    const fn name(self) -> &'static str {
        match self {
            Self::Dense => "dense",
            Self::Sparse1 => "sparse1",
            Self::Sparse2 { .. } => "sparse2",
            Self::Sparse3 { .. } => "sparse3",
        }
    }
}
