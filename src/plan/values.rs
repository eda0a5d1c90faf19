//! The resolved values of a run by their keys, made once for many look-ups.

use super::RunSpec;
use crate::spec::{Key, Parameter};

/// The values of a run's keys; see [`RunSpec::value`].
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    algorithm: &'static str,
    /// Everything that is set except the algorithm, by the keys of the file; also `env` and `seed`.
    settings: toml::Table,
    hyperparameters: toml::Table,
}

impl Values {
    /// The values of `run`.
    pub(super) fn of(run: &RunSpec) -> Self {
        let mut settings =
            toml::Table::try_from(run).expect("a run is tables of numbers, names and lists");
        if let Some(path) = settings.remove("demonstration") {
            settings.insert("demonstrations".into(), path);
        }
        settings.insert("env".into(), run.env.name().into());
        Self {
            algorithm: run.algorithm_name(),
            settings,
            hyperparameters: run.algorithm.hyperparameters(),
        }
    }

    /// The value of `env`, `algorithm`, `seed`, a setting or a hyperparameter; `None` if the run
    /// has no such key.
    pub fn get(&self, key: &Key) -> Option<toml::Value> {
        match key {
            Key::Algorithm => Some(self.algorithm.into()),
            Key::Env => self.settings.get("env").cloned(),
            Key::Seed => self.settings.get("seed").cloned(),
            Key::Parameter(Parameter::Setting(key)) => look_up(&self.settings, key),
            Key::Parameter(parameter) => look_up(
                &self.hyperparameters,
                parameter.hyperparameter_of(self.algorithm)?,
            ),
        }
    }
}

fn look_up(table: &toml::Table, key: &str) -> Option<toml::Value> {
    let (first, rest) = match key.split_once('.') {
        Some((first, rest)) => (first, Some(rest)),
        None => (key, None),
    };
    let value = table.get(first)?;
    match rest {
        None => Some(value.clone()),
        Some(rest) => look_up(value.as_table()?, rest),
    }
}
