//! The keys that tell runs apart.

use std::{cmp::Ordering, fmt};

use super::{
    Parameter,
    check::BLOCK_KEYS,
    named::{Named, by_name},
};

/// A key of runs, for which a run has a value or none.
/// Keys make rows, columns, curves and panels, and a selection asks for their values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Key {
    /// The environment.
    Env,
    /// The algorithm.
    Algorithm,
    /// The seed.
    Seed,
    /// A setting or hyperparameter.
    Parameter(Parameter),
}

impl Key {
    /// The key that a file calls `name`; `None` when there is none.
    pub fn parse(name: &str) -> Option<Self> {
        match name {
            "env" => Some(Self::Env),
            "algorithm" => Some(Self::Algorithm),
            "seed" => Some(Self::Seed),
            _ => Parameter::find(name).map(Self::Parameter),
        }
    }

    /// The last part of its name, which readers know it by: `max_kl` of `mcpo.max_kl`.
    pub fn last_part(&self) -> &str {
        match self {
            Self::Env => "env",
            Self::Algorithm => "algorithm",
            Self::Seed => "seed",
            Self::Parameter(parameter) => parameter.last_part(),
        }
    }
}

impl Named for Key {
    const WHAT: &str = "axis";

    fn named(name: &str) -> Option<Self> {
        Self::parse(name)
    }

    fn known() -> Vec<String> {
        BLOCK_KEYS
            .into_iter()
            .map(str::to_owned)
            .chain(Parameter::names())
            .collect()
    }
}

by_name!(Key);

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Parameter(parameter) => parameter.fmt(f),
            other => f.write_str(other.last_part()),
        }
    }
}

impl Ord for Key {
    /// Orders keys by name.
    fn cmp(&self, other: &Self) -> Ordering {
        self.to_string().cmp(&other.to_string())
    }
}

impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
