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
