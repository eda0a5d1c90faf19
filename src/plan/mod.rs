//! The plan: from a specification to an ordered list of fully resolved runs.
//!
//! Owns the product of the axes, the resolution of hyperparameters, and every run's id and
//! fingerprint. Pure: reads no file, starts nothing. Start at [`plan`] and [`RunSpec`].

mod canonical;
mod columns;
mod id;
mod identity;
mod selection;
mod values;

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    path::PathBuf,
};

use serde::{Deserialize, Serialize};

pub use crate::spec::{Selection, SelectionError};
pub(crate) use canonical::leaves;
pub use canonical::recorded;
pub use columns::AxisValue;
pub(crate) use identity::changes;
pub use identity::{Versions, differences, evaluated_otherwise};
pub use values::Values;

use crate::{
    env::{EnvId, Reward},
    rng::Seed,
    spec::{
        Algorithm, Budget, Checkpoint, Evaluation, ExperimentSpec, Key, Network, ResolveError,
        Rollout, Settings,
    },
};

/// One run, with nothing left to default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunSpec {
    /// The experiment's name.
    pub experiment: String,
    /// The run's folder under `runs/`: `<env>/<algorithm and axes>/seed-<n>`.
    pub id: String,
    /// The seed of everything random in it.
    pub seed: Seed,
    /// The environment.
    pub env: EnvId,
    /// The values of the block's axes that apply to it, and `d` and `epsilon` where the algorithm
    /// has them, for reports; a demonstration by what tells its file apart from the others of the
    /// experiment.
    pub axes: BTreeMap<String, toml::Value>,
    /// The axes of the whole experiment, which are columns of all of its tables.
    #[serde(default)]
    pub columns: Vec<String>,
    /// The reward that is trained on.
    pub reward: Reward,
    /// The time limit in steps.
    pub max_steps: u64,
    /// The demonstration's file, for algorithms that use one.
    pub demonstration: Option<PathBuf>,
    /// The algorithm and its hyperparameters.
    pub algorithm: Algorithm,
    /// The networks.
    pub network: Network,
    /// How experience is collected.
    pub rollout: Rollout,
    /// The length of the run.
    pub budget: Budget,
    /// How and when the run is evaluated.
    pub evaluation: Evaluation,
    /// When checkpoints are written.
    pub checkpoint: Checkpoint,
}

/// A specification that gives no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// A run cannot be resolved.
    #[error(transparent)]
    Resolve(#[from] ResolveError),
    /// Two runs that differ would share a folder.
    #[error("two different runs would both be called {id}: {}", differences.join("; "))]
    SameId {
        /// The id.
        id: String,
        /// The differences between the two runs.
        differences: Vec<String>,
    },
}

/// The axes that every run of an algorithm that has them carries, varied or not.
const ALWAYS: [&str; 2] = ["d", "epsilon"];

/// The key whose values are demonstrations' files.
const DEMONSTRATIONS: &str = "demonstrations";

/// Every run of `spec`, each once: block after block, in each by environment, algorithm, axes (the
/// last one fastest), and seed innermost. A run that several blocks name stands where the first one
/// names it.
///
/// # Errors
///
/// A value cannot be resolved, which [`load`](crate::spec::load) would have refused, or two runs
/// that differ would have one id.
pub fn plan(spec: &ExperimentSpec) -> Result<Vec<RunSpec>, PlanError> {
    let mut runs: Vec<RunSpec> = Vec::new();
    let mut known = HashSet::new();
    let mut ids: HashMap<String, usize> = HashMap::new();
    let columns = columns::keys(spec);
    // A run's name depends on the demonstrations of all blocks, so all are resolved first.
    let mut resolved = Vec::new();
    let mut demonstrations: BTreeMap<EnvId, BTreeSet<PathBuf>> = BTreeMap::new();
    for block in &spec.matrix {
        for (env, algorithm, axes) in block.combinations() {
            let (settings, algorithm) = spec.resolve(env, algorithm, &axes)?;
            let keys: Vec<String> = axes
                .iter()
                .map(|(parameter, _)| parameter.to_string())
                .collect();
            let files = demonstrations.entry(env).or_default();
            files.extend(
                keys.iter()
                    .any(|key| key == DEMONSTRATIONS)
                    .then(|| settings.demonstrations.clone()),
            );
            resolved.push((block, env, settings, algorithm, keys));
        }
    }
    for (block, env, settings, algorithm, keys) in resolved {
        let names = Names {
            columns: &columns,
            demonstrations: &demonstrations[&env],
        };
        let run = RunSpec::new(spec, env, settings, algorithm, &keys, names);
        // Once for all its seeds: there may be many.
        let identity = blake3::hash(run.identity().as_bytes());
        for &seed in &block.seed {
            // A run that several blocks name stands where the first one names it.
            if !known.insert((identity, seed)) {
                continue;
            }
            let run = RunSpec {
                id: format!("{}/seed-{seed}", run.id),
                seed: Seed(seed),
                ..run.clone()
            };
            // The id is the run's folder, so no two runs may share one.
            if let Some(&other) = ids.get(&run.id) {
                let differences = identity::all_differences(&runs[other], &run);
                return Err(PlanError::SameId {
                    id: run.id,
                    differences,
                });
            }
            ids.insert(run.id.clone(), runs.len());
            runs.push(run);
        }
    }
    Ok(runs)
}

/// The context for the names of a run's axes.
#[derive(Clone, Copy)]
struct Names<'a> {
    /// The axes of the whole experiment.
    columns: &'a [String],
    /// The files on the axis of demonstrations, for one environment.
    demonstrations: &'a BTreeSet<PathBuf>,
}

impl RunSpec {
    /// The run of seed 0, its id without the seed, with the axes `keys`.
    fn new(
        spec: &ExperimentSpec,
        env: EnvId,
        settings: Settings,
        algorithm: Algorithm,
        keys: &[String],
        names: Names<'_>,
    ) -> Self {
        let demonstration = algorithm
            .uses_demonstration()
            .then_some(settings.demonstrations);
        let mut run = Self {
            experiment: spec.name.clone(),
            id: String::new(),
            seed: Seed(0),
            env,
            axes: BTreeMap::new(),
            columns: names.columns.to_vec(),
            reward: settings.reward,
            max_steps: settings.max_steps.get(),
            demonstration,
            algorithm,
            network: settings.network,
            rollout: settings.rollout,
            budget: settings.budget,
            evaluation: settings.evaluation,
            checkpoint: settings.checkpoint,
        };
        let varied: BTreeMap<String, toml::Value> = keys
            .iter()
            .filter_map(|key| Some((key.clone(), run.axis(key, names)?)))
            .collect();
        run.id = format!("{env}/{}", id::folder(run.algorithm_name(), &varied));
        run.axes = ALWAYS
            .iter()
            .filter_map(|key| Some(((*key).to_owned(), run.value(key)?)))
            .chain(varied)
            .collect();
        run
    }

    /// The value of the axis `key` as it is written in names.
    fn axis(&self, key: &str, names: Names<'_>) -> Option<toml::Value> {
        match (key, &self.demonstration) {
            (DEMONSTRATIONS, Some(path)) => {
                Some(toml::Value::String(id::among(path, names.demonstrations)))
            }
            _ => self.value(key),
        }
    }

    /// The algorithm's name.
    pub fn algorithm_name(&self) -> &'static str {
        self.algorithm.name()
    }

    /// The tolerance d, where the algorithm has one.
    pub fn d(&self) -> Option<f64> {
        self.value("d")?.as_float()
    }

    /// The annealing factor epsilon, where the algorithm has one.
    pub fn epsilon(&self) -> Option<f64> {
        self.value("epsilon")?.as_float()
    }

    /// The resolved value of `env`, `algorithm`, `seed`, a setting (`budget.env_steps`) or a
    /// hyperparameter (`d`, `mcpo.max_kl`); `None` if this run has no such key.
    pub fn value(&self, key: &str) -> Option<toml::Value> {
        self.values().get(&Key::parse(key)?)
    }

    /// All values, for many look-ups.
    pub fn values(&self) -> Values {
        Values::of(self)
    }

    /// The algorithm with the values of its axes, as in `mcpo d=0.001 epsilon=0`.
    pub fn label(&self) -> String {
        let prefix = format!("{}.", self.algorithm_name());
        let axes = self.axes.iter().map(|(key, value)| {
            format!(
                " {}={}",
                key.strip_prefix(&prefix).unwrap_or(key),
                id::short(value)
            )
        });
        std::iter::once(self.algorithm_name().to_owned())
            .chain(axes)
            .collect()
    }
}

#[cfg(test)]
mod tests;
