//! Decides when two runs are the same run, by their fingerprints, and tells the differences if they
//! are not.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    RunSpec,
    canonical::{all, canonical},
};
use crate::{
    env::Reward,
    spec::{Algorithm, Parameter, Settings},
};

/// The version of the canonical text; a new one voids every recorded run.
const FORM: u32 = 1;

/// The versions that matter for a run's numbers: only those of parts that it uses, so that a change
/// elsewhere leaves it valid.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Versions {
    /// The revisions of the parts of its algorithm, by their names.
    pub revisions: BTreeMap<String, u32>,
    /// The revision of its environment.
    pub env: u32,
    /// The version of MuJoCo; absent if the environment does without.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub mujoco: Option<String>,
    /// A digest of the environment's model; absent if it has none.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub model: Option<String>,
}

impl RunSpec {
    /// The identity of this run's numbers: the first 16 hexadecimal digits of the BLAKE3 digest of
    /// its canonical form with its demonstration's content digest and `versions`.
    /// Names, paths, the budget, `evaluation.*` and `checkpoint.*` do not count: whatever they are,
    /// training takes the same steps.
    pub fn fingerprint(&self, demonstration_digest: Option<&str>, versions: &Versions) -> String {
        blake3::hash(
            self.canonical_text(demonstration_digest, versions)
                .as_bytes(),
        )
        .to_hex()[..16]
            .to_owned()
    }

    fn canonical_text(&self, demonstration_digest: Option<&str>, versions: &Versions) -> String {
        let mut lines = canonical(self);
        let mut add = |key: &str, value: Option<String>| {
            lines.extend(value.map(|value| (key.to_owned(), value)))
        };
        add("form", Some(FORM.to_string()));
        add("demonstration", demonstration_digest.map(str::to_owned));
        add("env.revision", Some(versions.env.to_string()));
        add("mujoco", versions.mujoco.clone());
        add("model", versions.model.clone());
        for (part, revision) in &versions.revisions {
            add(&format!("revision.{part}"), Some(revision.to_string()));
        }
        lines
            .iter()
            .map(|(key, value)| format!("{key} = {value}\n"))
            .collect()
    }

    /// Every setting except the seed as one text.
    /// Runs of one experiment with the same identity and seed are one run.
    /// How often a run saves its checkpoint does not count.
    pub(super) fn identity(&self) -> String {
        let mut lines = all(self);
        lines.remove("checkpoint.every_seconds");
        lines.remove("seed");
        format!("{lines:?} {:?}", self.demonstration)
    }

    /// The steps that training takes: the budget, rounded up to whole rollouts; 0 for an algorithm
    /// that does not train in the environment.
    pub fn trained_steps(&self) -> u64 {
        let steps = self.rollout.steps.get();
        if self.algorithm.trains() {
            self.budget
                .env_steps
                .get()
                .div_ceil(steps)
                .saturating_mul(steps)
        } else {
            0
        }
    }

    /// Whether rounding up to whole rollouts makes the run longer by more than a hundredth.
    pub fn trains_noticeably_longer(&self) -> bool {
        let budget = self.budget.env_steps.get();
        self.trained_steps() > budget.saturating_add(budget / 100)
    }

    /// The settings and hyperparameters that are not the defaults of its environment and algorithm,
    /// such as `mcpo.mmd.bandwidth` or `reward`.
    /// Its length, its evaluation, its checkpoints and its demonstration do not count.
    pub fn departures(&self) -> BTreeSet<String> {
        let defaults = Settings::defaults(self.env, self.algorithm_name(), self.budget.env_steps);
        let algorithm =
            Algorithm::defaults(self.algorithm_name(), self.env).expect("it has a name");
        let reward = if algorithm.trains_on_dense_reward() {
            Reward::Dense
        } else {
            defaults.reward
        };
        let Settings {
            max_steps,
            rollout,
            network,
            ..
        } = defaults;
        let default = Self {
            reward,
            max_steps: max_steps.get(),
            rollout,
            network,
            algorithm,
            ..self.clone()
        };
        let (own, default) = (all(self), all(&default));
        differing(&own, &default).map(parameter).collect()
    }
}

/// The values that decide training and differ between `recorded` and `wanted`, with both values, as
/// in `mcpo.d: 0.001 -> 0.01`; empty if none differs.
/// A user's model counts by its content too, as `env.model`.
pub fn differences(recorded: &RunSpec, wanted: &RunSpec) -> Vec<String> {
    changes(&with_content(recorded), &with_content(wanted))
}

/// The canonical lines of `run`, with the digest of a user's model beside its file's name.
/// The canonical text itself has no place for it: fingerprints take it from the versions.
fn with_content(run: &RunSpec) -> BTreeMap<String, String> {
    let mut lines = canonical(run);
    if let (Some(file), Some(digest)) = (lines.get_mut("env.model"), run.env.model_digest()) {
        *file = format!("{file} (content {digest})");
    }
    lines
}

/// The differences in evaluation between `recorded` and `wanted`, in the same form as
/// [`differences`].
pub fn evaluated_otherwise(recorded: &RunSpec, wanted: &RunSpec) -> Vec<String> {
    let evaluation = |run| {
        let mut lines = all(run);
        lines.retain(|key, _| key.starts_with("evaluation."));
        lines
    };
    changes(&evaluation(recorded), &evaluation(wanted))
}

/// All differences in settings between `recorded` and `wanted`, in the same form as
/// [`differences`].
pub(super) fn all_differences(recorded: &RunSpec, wanted: &RunSpec) -> Vec<String> {
    let mut lines = [all(recorded), all(wanted)];
    for (lines, run) in lines.iter_mut().zip([recorded, wanted]) {
        lines.extend(
            run.demonstration
                .as_ref()
                .map(|path| ("demonstrations".to_owned(), path.display().to_string())),
        );
    }
    changes(&lines[0], &lines[1])
}

/// The keys whose values differ, each with both values: `mcpo.d: 0.001 -> 0.01`.
pub(crate) fn changes(
    before: &BTreeMap<String, String>,
    after: &BTreeMap<String, String>,
) -> Vec<String> {
    let show = |value: Option<&String>| value.map_or("absent", String::as_str).to_owned();
    differing(before, after)
        .map(|key| {
            format!(
                "{key}: {} -> {}",
                show(before.get(key)),
                show(after.get(key))
            )
        })
        .collect()
}

/// The keys whose values differ.
fn differing<'a>(
    before: &'a BTreeMap<String, String>,
    after: &'a BTreeMap<String, String>,
) -> impl Iterator<Item = &'a str> {
    let keys: BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    keys.into_iter()
        .filter(|key| before.get(*key) != after.get(*key))
        .map(String::as_str)
}

/// The parameter that the line `key` belongs to: `mcpo.mmd.bandwidth` of
/// `mcpo.mmd.bandwidth.fixed`.
fn parameter(key: &str) -> String {
    let mut name = key;
    while let (None, Some((outer, _))) = (Parameter::find(name), name.rsplit_once('.')) {
        name = outer;
    }
    name.to_owned()
}

#[cfg(test)]
mod tests;
