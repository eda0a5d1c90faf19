//! The names of the environments.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::{EnvError, Environment, Reward};

/// One of the seven tasks; written as its Gym v2 id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum EnvId {
    /// `MountainCarContinuous-v0`; the paper says MountainCar-v0.
    MountainCar,
    /// `InvertedPendulum-v2`; the paper says Pendulum-v2.
    InvertedPendulum,
    /// `InvertedDoublePendulum-v2`; the paper says DoublePendulum-v2.
    InvertedDoublePendulum,
    /// `HalfCheetah-v2`.
    HalfCheetah,
    /// `Hopper-v2`.
    Hopper,
    /// `Walker2d-v2`.
    Walker2d,
    /// `Ant-v2`, with contact forces: 111 observations.
    Ant,
}

impl EnvId {
    /// All seven, in the paper's order.
    pub const ALL: [Self; 7] = [
        Self::MountainCar,
        Self::InvertedPendulum,
        Self::InvertedDoublePendulum,
        Self::HalfCheetah,
        Self::Hopper,
        Self::Walker2d,
        Self::Ant,
    ];

    /// The Gym id.
    pub const fn name(self) -> &'static str {
        match self {
            Self::MountainCar => "MountainCarContinuous-v0",
            Self::InvertedPendulum => "InvertedPendulum-v2",
            Self::InvertedDoublePendulum => "InvertedDoublePendulum-v2",
            Self::HalfCheetah => "HalfCheetah-v2",
            Self::Hopper => "Hopper-v2",
            Self::Walker2d => "Walker2d-v2",
            Self::Ant => "Ant-v2",
        }
    }

    /// Gym's time limit, steps.
    pub const fn max_steps(self) -> u64 {
        match self {
            Self::MountainCar => 999,
            _ => 1000,
        }
    }

    /// The paper's sparse reward of this environment, with the thresholds that this project chose.
    pub fn sparse_reward(self) -> Reward {
        todo!()
    }

    /// The physics.
    ///
    /// Errors: the engine refuses the model.
    pub fn build(self) -> Result<Box<dyn Environment>, EnvError> {
        todo!()
    }
}

impl fmt::Display for EnvId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for EnvId {
    type Err = EnvError;

    fn from_str(name: &str) -> Result<Self, EnvError> {
        let _ = name;
        todo!()
    }
}

impl TryFrom<String> for EnvId {
    type Error = EnvError;

    fn try_from(name: String) -> Result<Self, EnvError> {
        name.parse()
    }
}

impl From<EnvId> for String {
    fn from(id: EnvId) -> String {
        id.name().to_owned()
    }
}
