//! Uniform actions, which learn nothing: the lower end of the scale of returns.

use serde::{Deserialize, Serialize};

use super::definition::{About, Definition, Learner};

/// No hyperparameters.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {}

/// Uniform actions as an algorithm of the catalogue.
pub static RANDOM: Definition<Hyperparameters> = Definition {
    about: About {
        name: "random",
        label: "Random",
        demonstration: false,
        dense: false,
        trains: false,
        steps: None,
        passes: 0.0,
        part: None,
        later: &[],
    },
    defaults: |_| Hyperparameters {},
    cloning: None,
    start: |_, _| Ok(Learner::Uniform),
    operations: |_, _| Vec::new(),
};
