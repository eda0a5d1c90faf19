//! When two runs are the same run: the fingerprint, and what differs where they are not.

use std::collections::BTreeMap;

use serde_json::Value;

use super::RunSpec;

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
    let keys: std::collections::BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    keys.into_iter()
        .filter(|key| before.get(*key) != after.get(*key))
        .map(|key| format!("{key}: {} -> {}", show(before.get(key)), show(after.get(key))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{super::tests::planned, *};
    use crate::quantity::constant;

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
