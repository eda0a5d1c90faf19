//! When two runs are the same run: the fingerprint, and what differs where they are not.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::RunSpec;
use crate::{
    env::Reward,
    spec::{Algorithm, Parameter, Settings},
};

/// The versions that matter for a run's numbers.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Versions {
    /// Raised whenever an algorithm's numbers change.
    pub algorithm_revision: u32,
    /// The version of MuJoCo.
    pub mujoco: String,
    /// A digest of the models.
    pub models: String,
}

/// Keys of a run that decide no number: names, paths, and how often it saves what it could resume from.
const NAMES: [&str; 4] = ["experiment", "id", "axes", "demonstration"];
const SAVING: &str = "checkpoint.every_seconds";

impl RunSpec {
    /// What identifies this run's numbers: the first 16 hexadecimal digits of the BLAKE3 digest of its resolved
    /// specification, its demonstration's content digest, and `versions`. Names, paths and `checkpoint.every_seconds` do
    /// not count.
    pub fn fingerprint(&self, demonstration_digest: Option<&str>, versions: &Versions) -> String {
        let whole = (self.leaves(), demonstration_digest, versions);
        let text = serde_json::to_string(&whole).expect("a run is numbers, names and lists");
        blake3::hash(text.as_bytes()).to_hex()[..16].to_owned()
    }

    /// The same but for the demonstration, whose path stands for it: runs of one experiment with one identity are one.
    pub(super) fn identity(&self) -> String {
        let whole = (self.leaves(), &self.demonstration);
        serde_json::to_string(&whole).expect("a run is numbers, names and lists")
    }

    /// The settings and hyperparameters that are not the defaults of its environment and algorithm: `mcpo.mmd.bandwidth`,
    /// `reward`. Those that only say how long it is, how it is evaluated and what it saves do not count, nor does the
    /// demonstration.
    pub fn departures(&self) -> BTreeSet<String> {
        let defaults = Settings::for_env(self.env, self.budget.env_steps);
        let algorithm = Algorithm::defaults(self.algorithm_name(), self.env).expect("it has a name");
        let reward = if algorithm.trains_on_dense_reward() { Reward::Dense } else { defaults.reward };
        let Settings { max_steps, rollout, network, .. } = defaults;
        let default = Self { reward, max_steps: max_steps.get(), rollout, network, algorithm, ..self.clone() };
        let (own, default) = (self.leaves(), default.leaves());
        differing(&own, &default).map(parameter).collect()
    }

    /// Everything that decides numbers, by dotted keys in their order.
    fn leaves(&self) -> BTreeMap<String, Value> {
        let whole = serde_json::to_value(self).expect("a run is numbers, names and lists");
        let mut leaves = BTreeMap::new();
        flatten(String::new(), whole, &mut leaves);
        leaves.retain(|key, _| {
            let first = key.split('.').next().unwrap_or(key);
            !NAMES.contains(&first) && key != SAVING
        });
        leaves
    }
}

fn flatten(key: String, value: Value, leaves: &mut BTreeMap<String, Value>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                flatten(if key.is_empty() { name } else { format!("{key}.{name}") }, value, leaves);
            }
        }
        leaf => {
            leaves.insert(key, leaf);
        }
    }
}

/// What decides numbers and differs between `recorded` and `wanted`: dotted keys with both values, as in
/// `algorithm.mcpo.d: 0.001 -> 0.01`; empty when nothing does.
pub fn differences(recorded: &RunSpec, wanted: &RunSpec) -> Vec<String> {
    let (before, after) = (recorded.leaves(), wanted.leaves());
    let show = |value: Option<&Value>| value.map_or_else(|| "absent".into(), Value::to_string);
    let told = |key| format!("{key}: {} -> {}", show(before.get(key)), show(after.get(key)));
    differing(&before, &after).map(told).collect()
}

/// The keys whose values differ.
fn differing<'a>(
    before: &'a BTreeMap<String, Value>,
    after: &'a BTreeMap<String, Value>,
) -> impl Iterator<Item = &'a str> {
    let keys: BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    keys.into_iter().filter(|key| before.get(*key) != after.get(*key)).map(String::as_str)
}

/// The parameter that the leaf `key` belongs to: `mcpo.mmd.bandwidth` of `algorithm.mcpo.mmd.bandwidth.fixed`.
fn parameter(key: &str) -> String {
    let mut name = key.strip_prefix("algorithm.").unwrap_or(key);
    while let (None, Some((outer, _))) = (Parameter::find(name), name.rsplit_once('.')) {
        name = outer;
    }
    name.to_owned()
}

#[cfg(test)]
mod tests {
    use super::{super::tests::planned, *};
    use crate::{env::EnvId, quantity::constant};

    fn run() -> RunSpec {
        planned("[[matrix]]\nseed = [7]\nenv = ['HalfCheetah-v2']\nalgorithm = ['mcpo']\n").remove(0)
    }

    fn versions() -> Versions {
        Versions { algorithm_revision: 1, mujoco: "3.17.0".into(), models: "abc".into() }
    }

    #[test]
    fn whatever_decides_numbers_changes_the_fingerprint() {
        let run = run();
        let print = run.fingerprint(Some("x"), &versions());
        assert_eq!((print.len(), &print), (16, &run.fingerprint(Some("x"), &versions())));
        let seed = RunSpec { seed: crate::rng::Seed(8), ..run.clone() };
        let reward = RunSpec { reward: crate::env::Reward::Dense, ..run.clone() };
        let mut kept = run.clone();
        kept.checkpoint.keep_policy_every = Some(constant(10_000));
        for other in [seed, reward, kept] {
            assert_ne!(other.fingerprint(Some("x"), &versions()), print, "{:?}", differences(&run, &other));
        }
        assert_ne!(run.fingerprint(Some("y"), &versions()), print);
        assert_ne!(run.fingerprint(None, &versions()), print);
        let other = Versions { algorithm_revision: 2, ..versions() };
        assert_ne!(run.fingerprint(Some("x"), &other), print);
        let other = Versions { mujoco: "4.0.0".into(), ..versions() };
        assert_ne!(run.fingerprint(Some("x"), &other), print);
    }

    #[test]
    fn names_and_paths_do_not() {
        let run = run();
        let mut moved = RunSpec {
            experiment: "other".into(),
            id: "elsewhere".into(),
            axes: BTreeMap::new(),
            demonstration: Some("elsewhere.parquet".into()),
            ..run.clone()
        };
        moved.checkpoint.every_seconds = constant(1.0);
        assert_eq!(moved.fingerprint(Some("x"), &versions()), run.fingerprint(Some("x"), &versions()));
        assert_eq!(differences(&run, &moved), Vec::<String>::new());
    }

    #[test]
    fn departures_are_what_is_learned_otherwise_than_by_default() {
        let departures = |matrix: &str| {
            let runs = planned(&format!("[[matrix]]\nseed = [7]\nenv = ['HalfCheetah-v2']\n{matrix}"));
            runs[0].departures().into_iter().collect::<Vec<_>>()
        };
        for name in Algorithm::names() {
            for env in EnvId::ALL {
                let text = format!("[[matrix]]\nseed = [1]\nenv = ['{env}']\nalgorithm = ['{name}']\n");
                assert!(planned(&text)[0].departures().is_empty(), "{name}, {env}");
            }
        }
        let length = "'budget.env_steps' = [200_000]\n'evaluation.every' = [5_000]\n'checkpoint.every_seconds' = [1]\n";
        assert_eq!(departures(&format!("algorithm = ['mcpo']\n{length}")), [""; 0]);
        assert_eq!(departures("algorithm = ['expert']\nreward = ['dense']\n"), [""; 0], "it always has that one");
        assert_eq!(
            departures("algorithm = ['mcpo']\nreward = ['dense']\nd = [0.5]\n'mmd.bandwidth' = ['median']\n"),
            ["mcpo.d", "mcpo.mmd.bandwidth", "reward"]
        );
        assert_eq!(
            departures("algorithm = ['pretraining']\n'pretraining.ppo.clip' = [0.1]\n'network.hidden' = [[64, 64]]\n"),
            ["network.hidden", "pretraining.ppo.clip"]
        );
        assert_eq!(
            departures("algorithm = ['ppo']\nreward = [{ sparse2 = { distance = 1.0 } }]\n'rollout.steps' = [2048]\n"),
            ["reward", "rollout.steps"]
        );
    }

    #[test]
    fn differences_name_the_key_and_both_values() {
        let before = run();
        let other = "[[matrix]]\nseed = [8]\nenv = ['HalfCheetah-v2']\nalgorithm = ['mcpo']\nd = [0.5]\nmax_d = [1]\n";
        let after = planned(other).remove(0);
        assert_eq!(
            differences(&before, &after),
            ["algorithm.mcpo.d: 0.001 -> 0.5", "algorithm.mcpo.max_d: absent -> 1.0", "seed: 7 -> 8"]
        );
    }
}
