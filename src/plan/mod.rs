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
pub use canonical::recorded;
pub use columns::AxisValue;
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
mod tests {
    use std::path::Path;

    use super::*;
    use crate::spec::{Overrides, parse};

    /// The plan of an experiment whose matrix is `matrix`.
    pub(super) fn planned(matrix: &str) -> Vec<RunSpec> {
        let text = format!("name = 'test'\nbudget.env_steps = 100_000\n{matrix}");
        plan(
            &parse(Path::new("test.toml"), &text, &Overrides::default())
                .expect("a valid experiment"),
        )
        .expect("a plan")
    }

    const TWO: &str =
        "[[matrix]]\nseed = [3, 1]\nenv = ['Ant-v2', 'Hopper-v2']\nalgorithm = ['ppo', 'mcpo']\n";

    #[test]
    fn runs_stand_in_the_order_of_the_file_with_the_seed_innermost() {
        let ids: Vec<String> = planned(&format!("{TWO}epsilon = [0.5, 0]\nd = [1, 2]\n"))
            .into_iter()
            .map(|run| run.id)
            .collect();
        let mut expected = Vec::new();
        for env in ["Ant-v2", "Hopper-v2"] {
            expected.extend([3, 1].map(|seed| format!("{env}/ppo/seed-{seed}")));
            for (epsilon, d) in [("0.5", 1), ("0.5", 2), ("0", 1), ("0", 2)] {
                expected.extend(
                    [3, 1].map(|seed| format!("{env}/mcpo-d={d}-epsilon={epsilon}/seed-{seed}")),
                );
            }
        }
        assert_eq!(ids, expected);
    }

    #[test]
    fn a_run_that_two_blocks_name_is_one() {
        let again = "[[matrix]]\nseed = [1, 2]\nenv = ['Ant-v2']\nalgorithm = ['ppo']\n";
        assert_eq!(planned(&format!("{TWO}{again}")).len(), 8 + 1);
        // Table 2's tolerance for Ant, written out, is the run that the first block names.
        let same =
            "[[matrix]]\nseed = [1]\nenv = ['Ant-v2']\nalgorithm = ['mcpo']\nd = [1e-5, 1e-4]\n";
        let runs = planned(&format!("{TWO}{same}"));
        assert_eq!(runs.len(), 8 + 1);
        assert_eq!(runs[8].id, "Ant-v2/mcpo-d=0.0001/seed-1");
    }

    #[test]
    fn hyperparameters_come_from_the_nearest_that_says_anything() {
        let said = "[algorithms.mcpo]\nd = 0.5\nmax_kl = 0.1\nmmd.samples = 'rollout'\n\
                    [environments.Ant-v2.algorithms.mcpo]\nd = 0.25\n[environments.Hopper-v2.algorithms.mcpo]\nd = 0.75\n";
        let runs = planned(&format!("{TWO}max_kl = [0.2]\n{said}"));
        let mcpo = |env| {
            runs.iter()
                .find(|run| run.env == env && run.algorithm_name() == "mcpo")
                .expect("it is planned")
        };
        assert_eq!(
            (mcpo(EnvId::Ant).d(), mcpo(EnvId::Hopper).d()),
            (Some(0.25), Some(0.75))
        );
        assert_eq!(
            mcpo(EnvId::Ant).value("mcpo.max_kl"),
            Some(toml::Value::Float(0.2)),
            "the axis"
        );
        assert_eq!(
            mcpo(EnvId::Ant).value("mmd.samples"),
            Some(toml::Value::String("rollout".into())),
            "the file"
        );
        assert_eq!(
            mcpo(EnvId::Ant).value("mmd.estimator"),
            Some(toml::Value::String("v".into())),
            "the default"
        );
        assert_eq!(mcpo(EnvId::Ant).epsilon(), Some(1e-3), "Table 2");
    }

    #[test]
    fn reports_find_d_and_epsilon_and_labels_on_every_run() {
        let runs = planned(TWO);
        let mcpo = runs
            .iter()
            .find(|run| run.algorithm_name() == "mcpo")
            .expect("it is planned");
        assert_eq!(mcpo.axes.keys().collect::<Vec<_>>(), ["d", "epsilon"]);
        assert_eq!(mcpo.label(), "mcpo d=1e-5 epsilon=0.001");
        assert_eq!(
            mcpo.demonstration.as_deref(),
            Some(Path::new("demos/Ant-v2.parquet"))
        );
        let ppo = &runs[0];
        assert_eq!(
            (ppo.d(), ppo.epsilon(), ppo.label().as_str()),
            (None, None, "ppo")
        );
        assert_eq!(ppo.demonstration, None);
        assert_eq!(ppo.value("mcpo.d"), None);
        assert_eq!(ppo.value("rollout.steps"), Some(toml::Value::Integer(4096)));
    }

    #[test]
    fn the_expert_trains_on_the_dense_reward_whatever_is_said() {
        let runs =
            planned("[[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['expert', 'ppo']\n");
        assert_eq!(runs[0].reward, Reward::Dense);
        assert_eq!(runs[1].reward, EnvId::Ant.sparse_reward());
    }

    #[test]
    fn demonstrations_of_one_file_name_are_told_apart_in_the_names_of_runs() {
        let block = "[[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['mcpo']\n";
        let ids = |matrix: &str| {
            planned(matrix)
                .into_iter()
                .map(|run| run.id)
                .collect::<Vec<_>>()
        };
        let apart = ["good_Ant-v2", "poor_Ant-v2"]
            .map(|name| format!("Ant-v2/mcpo-demonstrations={name}/seed-0"));
        assert_eq!(
            ids(&format!(
                "{block}demonstrations = ['good/{{env}}.parquet', 'poor/{{env}}.parquet']\n"
            )),
            apart
        );
        let each = ["good", "poor"]
            .map(|name| format!("{block}demonstrations = ['{name}/{{env}}.parquet']\n"));
        assert_eq!(ids(&each.concat()), apart);
        assert_eq!(ids(&each[0]), ["Ant-v2/mcpo-demonstrations=Ant-v2/seed-0"]);
        let labels: Vec<_> = planned(&each.concat()).iter().map(RunSpec::label).collect();
        assert!(
            labels[0].contains("demonstrations=good/Ant-v2"),
            "{labels:?}"
        );
    }

    #[test]
    fn a_run_comes_back_from_json_as_it_was() {
        for run in planned(&format!(
            "{TWO}reward = ['dense', {{ sparse2 = {{ distance = 2.5 }} }}]\n"
        )) {
            let text = serde_json::to_string(&run).expect("it can be written");
            assert_eq!(
                serde_json::from_str::<RunSpec>(&text).expect("and read"),
                run
            );
        }
    }
}
