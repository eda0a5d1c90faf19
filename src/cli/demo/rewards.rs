//! The rewards of a demonstration's steps.

use std::path::Path;

use crate::demo::{Demonstration, import::recomputed_rewards};

/// Dense rewards, and their origin.
pub struct Rewards {
    /// One reward per step.
    pub values: Vec<f64>,
    /// Their origin, in words: `as recorded`, or the quantities that they were computed from.
    pub source: &'static str,
}

impl Rewards {
    /// The rewards that the demonstration in the file `path` records. Without them, the rewards
    /// computed from observations and actions, if the environment is known.
    pub fn of(demonstration: &Demonstration, path: &Path) -> anyhow::Result<Option<Self>> {
        if let Some(values) = demonstration.rewards.clone() {
            return Ok(Some(Rewards {
                values,
                source: "as recorded",
            }));
        }
        let env = demonstration
            .provenance
            .iter()
            .find(|(key, _)| key == "env")
            .and_then(|(_, name)| name.parse().ok());
        env.map(|env| {
            let values = recomputed_rewards(demonstration, path, env)?;
            Ok(Rewards {
                values,
                source: "from observations and actions",
            })
        })
        .transpose()
    }
}
