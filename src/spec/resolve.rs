//! From a file's settings to those of one run: defaults, the general tables, the environment's, the
//! axes.

use super::{Algorithm, ExperimentSpec, Parameter, Settings, catalog::Catalog};
use crate::{
    env::{EnvId, Reward},
    fit::{self, Mistake},
    quantity::constant,
};

/// Why a run cannot be resolved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ResolveError {
    /// Nothing says how long the run is.
    #[error("no budget.env_steps for {env}: the length of a run has no default")]
    NoBudget {
        /// The environment.
        env: EnvId,
    },
    /// No algorithm has this name.
    #[error("unknown algorithm `{0}`")]
    NoAlgorithm(String),
    /// A value does not fit its key.
    #[error("{env}, {algorithm}: {source}")]
    Value {
        /// The environment.
        env: EnvId,
        /// The algorithm.
        algorithm: String,
        /// The mistake.
        source: Mistake,
    },
}

impl ExperimentSpec {
    /// The settings and the algorithm of a run of `algorithm` in `env` under the axes' values
    /// `axes`.
    ///
    /// # Errors
    ///
    /// There is no budget, or a value is wrong, which [`load`](super::load) would have refused.
    pub fn resolve(
        &self,
        env: EnvId,
        algorithm: &str,
        axes: &[(&Parameter, &toml::Value)],
    ) -> Result<(Settings, Algorithm), ResolveError> {
        let wrong = |source| ResolveError::Value {
            env,
            algorithm: algorithm.into(),
            source,
        };
        let catalog = Catalog::get();
        let no_algorithm = || ResolveError::NoAlgorithm(algorithm.into());
        let section = catalog.algorithm(algorithm).ok_or_else(no_algorithm)?;
        let mut hyperparameters = Algorithm::defaults(algorithm, env)
            .ok_or_else(no_algorithm)?
            .hyperparameters();
        let mut given = toml::Table::new();

        // The environment's own tables are merged second, so that they win.
        let here = self.environments.get(&env);
        for settings in [Some(&self.settings), here].into_iter().flatten() {
            catalog.settings.merge(&mut given, settings);
        }
        let algorithms = [
            Some(&self.algorithms),
            here.and_then(|here| here.get("algorithms")?.as_table()),
        ];
        for own in algorithms
            .into_iter()
            .flatten()
            .filter_map(|algorithms| algorithms.get(algorithm)?.as_table())
        {
            section.merge(&mut hyperparameters, own);
        }
        // Axes come last, so that they win.
        for (parameter, value) in axes {
            match parameter {
                Parameter::Setting(key) => catalog.settings.merge(&mut given, &nested(key, value)),
                Parameter::Shared(_) | Parameter::Own { .. } => {
                    if let Some(key) = parameter.hyperparameter_of(algorithm) {
                        section.merge(&mut hyperparameters, &nested(key, value));
                    }
                }
            }
        }

        // These hyperparameters were merged above, and are no settings.
        given.remove("algorithms");
        let mut settings = settings(env, algorithm, given)
            .map_err(wrong)?
            .ok_or(ResolveError::NoBudget { env })?;
        let algorithm = Algorithm::from_hyperparameters(algorithm, hyperparameters)
            .ok_or_else(no_algorithm)?
            .map_err(wrong)?;
        if algorithm.trains_on_dense_reward() {
            settings.reward = Reward::Dense;
        }
        // Only now is it known which layer's folder won.
        settings.demonstrations = settings
            .demonstrations
            .to_string_lossy()
            .replace("{env}", env.name())
            .into();
        Ok((settings, algorithm))
    }
}

/// The defaults of `algorithm` in `env`, overridden by `given`; `None` without a budget.
fn settings(env: EnvId, algorithm: &str, given: toml::Table) -> Result<Option<Settings>, Mistake> {
    let is_given =
        |table: &str, key: &str| given.get(table).and_then(|table| table.get(key)).is_some();
    if !is_given("budget", "env_steps") {
        return Ok(None);
    }
    let evaluation_given = is_given("evaluation", "every");
    let defaults = toml::Table::try_from(Settings::defaults(env, algorithm, constant(1)))
        .expect("settings are TOML");
    let mut table = defaults;
    Catalog::get().settings.merge(&mut table, &given);
    let mut settings: Settings = fit::read(table.into())?;
    if !evaluation_given {
        settings.evaluation.every =
            Settings::evaluate_every(settings.evaluation.episodes, settings.max_steps);
    }
    Ok(Some(settings))
}

/// `value` as a table with the dotted `key`.
fn nested(key: &str, value: &toml::Value) -> toml::Table {
    let mut keys = key.rsplit('.');
    let innermost = keys.next().unwrap_or(key);
    keys.fold(
        toml::Table::from_iter([(innermost.to_owned(), value.clone())]),
        |inner, key| toml::Table::from_iter([(key.to_owned(), toml::Value::Table(inner))]),
    )
}
