//! The algorithms that a matrix can name.

use serde::{Deserialize, Serialize};

use crate::{algo, env::EnvId};

/// An algorithm with its hyperparameters; externally tagged, so that errors keep their place.
///
/// A new one is a variant here and a line in `REGISTRY`. Its hyperparameters are a struct, empty where it has none, that
/// refuses unknown fields. A `minibatch` among them is checked against the rollout.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// MCPO.
    Mcpo(algo::mcpo::Hyperparameters),
    /// PPO.
    Ppo(algo::ppo::Hyperparameters),
    /// Behaviour cloning, then PPO.
    Pretraining(algo::pretraining::Hyperparameters),
    /// POfD.
    Pofd(algo::pofd::Hyperparameters),
    /// MMD imitation.
    MmdIl(algo::mmd_il::Hyperparameters),
    /// PPO on the dense reward.
    Expert(algo::ppo::Hyperparameters),
    /// Uniform actions.
    Random(Nothing),
    /// TRPO.
    Trpo(algo::trpo::Hyperparameters),
    /// GAIL.
    Gail(algo::gail::Hyperparameters),
    /// Behaviour cloning alone.
    Bc(algo::cloning::Hyperparameters),
    /// The surrogate minus a weighted MMD^2.
    Penalty(algo::penalty::Hyperparameters),
}

/// The hyperparameters of an algorithm that has none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Nothing {}

/// What must be known of an algorithm before it runs.
struct Entry {
    /// The serialised tag of its variant.
    name: &'static str,
    /// Whether it learns from a demonstration.
    demonstration: bool,
    /// Whether it trains on the dense reward, whatever the environment's reward says.
    dense: bool,
    /// Its defaults for an environment.
    defaults: fn(EnvId) -> Algorithm,
}

/// Every algorithm, in the order in which messages list them.
const REGISTRY: [Entry; 11] = [
    Entry {
        name: "mcpo",
        demonstration: true,
        dense: false,
        defaults: |env| Algorithm::Mcpo(algo::mcpo::Hyperparameters::for_env(env)),
    },
    Entry {
        name: "ppo",
        demonstration: false,
        dense: false,
        defaults: |env| Algorithm::Ppo(algo::ppo::Hyperparameters::for_env(env)),
    },
    Entry {
        name: "pretraining",
        demonstration: true,
        dense: false,
        defaults: |env| Algorithm::Pretraining(algo::pretraining::Hyperparameters::for_env(env)),
    },
    Entry {
        name: "pofd",
        demonstration: true,
        dense: false,
        defaults: |env| Algorithm::Pofd(algo::pofd::Hyperparameters::for_env(env)),
    },
    Entry {
        name: "mmd_il",
        demonstration: true,
        dense: false,
        defaults: |env| Algorithm::MmdIl(algo::mmd_il::Hyperparameters::for_env(env)),
    },
    Entry {
        name: "expert",
        demonstration: false,
        dense: true,
        defaults: |env| Algorithm::Expert(algo::ppo::Hyperparameters::for_env(env)),
    },
    Entry { name: "random", demonstration: false, dense: false, defaults: |_| Algorithm::Random(Nothing {}) },
    Entry {
        name: "trpo",
        demonstration: false,
        dense: false,
        defaults: |env| Algorithm::Trpo(algo::trpo::Hyperparameters::for_env(env)),
    },
    Entry {
        name: "gail",
        demonstration: true,
        dense: false,
        defaults: |env| Algorithm::Gail(algo::gail::Hyperparameters::for_env(env)),
    },
    Entry {
        name: "bc",
        demonstration: true,
        dense: false,
        defaults: |env| Algorithm::Bc(algo::cloning::Hyperparameters::for_env(env)),
    },
    Entry {
        name: "penalty",
        demonstration: true,
        dense: false,
        defaults: |env| Algorithm::Penalty(algo::penalty::Hyperparameters::for_env(env)),
    },
];

impl Algorithm {
    /// The names of all algorithms.
    pub fn names() -> impl Iterator<Item = &'static str> {
        REGISTRY.iter().map(|entry| entry.name)
    }

    /// The algorithm called `name` with its defaults for `env`; `None` when there is none of that name.
    pub fn defaults(name: &str, env: EnvId) -> Option<Self> {
        REGISTRY.iter().find(|entry| entry.name == name).map(|entry| (entry.defaults)(env))
    }

    /// Its name, as a matrix writes it.
    pub fn name(&self) -> &'static str {
        self.entry().name
    }

    /// Whether it learns from a demonstration.
    pub fn uses_demonstration(&self) -> bool {
        self.entry().demonstration
    }

    /// Whether it trains on the dense reward, whatever the environment's reward says.
    pub fn trains_on_dense_reward(&self) -> bool {
        self.entry().dense
    }

    /// Whether it takes steps of training in the environment; the others are evaluated alone.
    pub fn trains(&self) -> bool {
        !matches!(self, Self::Bc(_) | Self::Random(_))
    }

    /// Its hyperparameters as TOML.
    pub fn hyperparameters(&self) -> toml::Table {
        let mut tagged = toml::Table::try_from(self).expect("hyperparameters are tables of numbers, names and lists");
        match tagged.remove(self.name()) {
            Some(toml::Value::Table(table)) => table,
            other => panic!("the hyperparameters of {} are {other:?}, not a table", self.name()),
        }
    }

    /// The algorithm called `name` with these hyperparameters.
    ///
    /// Errors: a key is missing, unknown or out of range.
    pub(super) fn from_hyperparameters(name: &str, table: toml::Table) -> Result<Self, toml::de::Error> {
        toml::Table::from_iter([(name.to_owned(), toml::Value::Table(table))]).try_into()
    }

    fn entry(&self) -> &'static Entry {
        let variant = std::mem::discriminant(self);
        REGISTRY
            .iter()
            .find(|entry| std::mem::discriminant(&(entry.defaults)(EnvId::HalfCheetah)) == variant)
            .expect("every variant has its line in the registry")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_registry_and_the_enum_name_the_same_algorithms() {
        let schema = schemars::schema_for!(Algorithm).to_value();
        let mut variants: Vec<&str> = schema["oneOf"]
            .as_array()
            .expect("an externally tagged enum is a choice")
            .iter()
            .filter_map(|variant| variant["required"][0].as_str())
            .collect();
        variants.sort_unstable();
        let mut names: Vec<&str> = Algorithm::names().collect();
        names.sort_unstable();
        assert_eq!(variants, names);
        for name in names {
            let algorithm = Algorithm::defaults(name, EnvId::Ant).expect("a registered name");
            assert_eq!(algorithm.name(), name);
            let again = Algorithm::from_hyperparameters(name, algorithm.hyperparameters());
            assert_eq!(again.expect("defaults are complete"), algorithm);
        }
    }
}
