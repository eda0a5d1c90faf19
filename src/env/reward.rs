//! The rewards that can be trained on.

use serde::{Deserialize, Serialize};

use crate::quantity::Positive;

/// The reward that is trained on. Externally tagged: `"dense"`, `"sparse1"`, `{ sparse2 = { distance = 15.0 } }`.
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
        /// Every step beyond the distance, or once for each whole distance.
        #[serde(default)]
        mode: SparseMode,
    },
    /// SPARSE3: +1 on every step on which the last pole is high (InvertedPendulum, InvertedDoublePendulum).
    Sparse3 {
        /// Metres: the tip's height of the single pole, the second pole's centre of the double one.
        height: Positive,
    },
}

/// When SPARSE2 pays.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SparseMode {
    /// On every step beyond the distance.
    #[default]
    Beyond,
    /// Once for each whole distance covered.
    Milestone,
}
