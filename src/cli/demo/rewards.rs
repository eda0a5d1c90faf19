//! What a demonstration's steps earned.

use std::path::Path;

use crate::demo::{Demonstration, import::recomputed_rewards};

/// Dense rewards, and where they are from.
pub struct Rewards {
    /// One a step.
    pub values: Vec<f64>,
    /// `as recorded`, or what they were computed from.
    pub source: &'static str,
}

impl Rewards {
    /// Those that the demonstration in the file `path` has recorded; else those that observations
    /// and actions tell, if it is known of which environment they are.
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
