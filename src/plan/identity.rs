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
    told(&with_content(recorded), &with_content(wanted))
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
    told(&evaluation(recorded), &evaluation(wanted))
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
    told(&lines[0], &lines[1])
}

fn told(before: &BTreeMap<String, String>, after: &BTreeMap<String, String>) -> Vec<String> {
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
mod tests {
    use super::{
        super::{canonical::recorded, tests::planned},
        *,
    };
    use crate::{env::EnvId, quantity::constant};

    fn run() -> RunSpec {
        planned("[[matrix]]\nseed = [7]\nenv = ['HalfCheetah-v2']\nalgorithm = ['mcpo']\n")
            .remove(0)
    }

    fn versions() -> Versions {
        Versions {
            revisions: BTreeMap::from([("mcpo".to_owned(), 1)]),
            env: 1,
            mujoco: Some("3.17.0".into()),
            model: Some("abc".into()),
        }
    }

    /// The ten and more runs whose fingerprints are pinned, as an older program's `run.json` holds
    /// them: all algorithms, all environments. Never made anew: what changes one of these lines
    /// voids every recorded run.
    const PINNED: &str = include_str!("pinned.json");

    #[derive(serde::Deserialize)]
    struct Pinned {
        fingerprint: String,
        spec: serde_json::Value,
    }

    #[test]
    fn fingerprints_are_for_ever() {
        let pinned: Vec<Pinned> = serde_json::from_str(PINNED).expect("JSON");
        let mut algorithms = BTreeSet::new();
        let mut envs = BTreeSet::new();
        for Pinned { fingerprint, spec } in &pinned {
            let run = recorded(spec).expect("an older program's run can be read");
            assert_eq!(
                run.fingerprint(Some("x"), &versions()),
                *fingerprint,
                "{}",
                run.id
            );
            algorithms.insert(run.algorithm_name());
            envs.insert(run.env);
        }
        assert_eq!(
            (algorithms.len(), envs.len()),
            (Algorithm::names().count(), EnvId::ALL.len())
        );
    }

    #[test]
    fn the_canonical_text_is_what_a_reader_expects() {
        let run = planned(
            "[[matrix]]\nseed = [7]\nenv = ['Hopper-v2']\nalgorithm = ['bc']\n\
             reward = [{ sparse2 = { distance = 1.0, mode = 'beyond' } }]\n",
        )
        .remove(0);
        let text = run.canonical_text(Some("d1g357"), &versions());
        let expected = r#"algorithm = "bc"
bc.epochs = 50
bc.learning_rate = 0.0001
bc.loss = "mse"
bc.minibatch = 64
demonstration = d1g357
env = "Hopper-v2"
env.revision = 1
form = 1
max_steps = 1000
model = abc
mujoco = 3.17.0
network.hidden = [300, 400]
network.initial_std = 0.5
network.observation_clip = 10
revision.mcpo = 1
reward.sparse2.distance = 1
reward.sparse2.mode = "beyond"
rollout.environments = 8
rollout.steps = 4096
seed = 7
"#;
        assert_eq!(text, expected);
    }

    #[test]
    fn whatever_decides_training_changes_the_fingerprint() {
        let run = run();
        let print = run.fingerprint(Some("x"), &versions());
        assert_eq!(
            (print.len(), &print),
            (16, &run.fingerprint(Some("x"), &versions()))
        );
        let seed = RunSpec {
            seed: crate::rng::Seed(8),
            ..run.clone()
        };
        let reward = RunSpec {
            reward: crate::env::Reward::Dense,
            ..run.clone()
        };
        let random =
            planned("[[matrix]]\nseed = [7]\nenv = ['HalfCheetah-v2']\nalgorithm = ['random']\n")
                .remove(0);
        for other in [seed, reward, random] {
            assert_ne!(
                other.fingerprint(Some("x"), &versions()),
                print,
                "{:?}",
                differences(&run, &other)
            );
        }
        assert_ne!(run.fingerprint(Some("y"), &versions()), print);
        assert_ne!(run.fingerprint(None, &versions()), print);
        for other in [
            Versions {
                revisions: BTreeMap::from([("mcpo".to_owned(), 2)]),
                ..versions()
            },
            Versions {
                env: 2,
                ..versions()
            },
            Versions {
                mujoco: Some("4.0.0".into()),
                ..versions()
            },
            Versions {
                model: None,
                ..versions()
            },
        ] {
            assert_ne!(run.fingerprint(Some("x"), &other), print);
        }
    }

    #[test]
    fn what_cannot_change_training_does_not() {
        let run = run();
        let mut other = RunSpec {
            experiment: "other".into(),
            id: "elsewhere".into(),
            axes: BTreeMap::new(),
            demonstration: Some("elsewhere.parquet".into()),
            ..run.clone()
        };
        other.budget.env_steps = constant(7);
        other.checkpoint.every_seconds = constant(1.0);
        other.checkpoint.keep_policy_every = Some(constant(10_000));
        other.evaluation.every = constant(1);
        other.evaluation.final_episodes = constant(1);
        assert_eq!(
            other.fingerprint(Some("x"), &versions()),
            run.fingerprint(Some("x"), &versions())
        );
        assert_eq!(differences(&run, &other), Vec::<String>::new());
        let otherwise = [
            "evaluation.every: 20000 -> 1",
            "evaluation.final_episodes: 50 -> 1",
        ];
        assert_eq!(evaluated_otherwise(&run, &other), otherwise);
        assert_ne!(
            other.identity(),
            run.identity(),
            "in one plan they are two runs"
        );
    }

    #[test]
    fn training_takes_whole_rollouts() {
        let steps = |budget: i64, algorithm: &str| {
            let text = format!(
                "[[matrix]]\nseed = [7]\nenv = ['Ant-v2']\nalgorithm = ['{algorithm}']\n\
                 'budget.env_steps' = [{budget}]\n'rollout.steps' = [1024]\n"
            );
            planned(&text)[0].trained_steps()
        };
        assert_eq!(
            [
                steps(1024, "mcpo"),
                steps(1025, "mcpo"),
                steps(2048, "mcpo")
            ],
            [1024, 2048, 2048]
        );
        assert_eq!([steps(1025, "bc"), steps(1025, "random")], [0, 0]);
    }

    #[test]
    fn departures_are_what_is_learned_otherwise_than_by_default() {
        let departures = |matrix: &str| {
            let runs = planned(&format!(
                "[[matrix]]\nseed = [7]\nenv = ['HalfCheetah-v2']\n{matrix}"
            ));
            runs[0].departures().into_iter().collect::<Vec<_>>()
        };
        for name in Algorithm::names() {
            for env in EnvId::ALL {
                let text =
                    format!("[[matrix]]\nseed = [1]\nenv = ['{env}']\nalgorithm = ['{name}']\n");
                assert!(planned(&text)[0].departures().is_empty(), "{name}, {env}");
            }
        }
        let length = "'budget.env_steps' = [200_000]\n'evaluation.every' = [5_000]\n'checkpoint.every_seconds' = [1]\n";
        assert_eq!(
            departures(&format!("algorithm = ['mcpo']\n{length}")),
            [""; 0]
        );
        assert_eq!(
            departures("algorithm = ['expert']\nreward = ['dense']\n"),
            [""; 0],
            "it always has that one"
        );
        assert_eq!(
            departures(
                "algorithm = ['mcpo']\nreward = ['dense']\nd = [0.5]\n'mmd.bandwidth' = ['median']\n"
            ),
            ["mcpo.d", "mcpo.mmd.bandwidth", "reward"]
        );
        assert_eq!(
            departures(
                "algorithm = ['pretraining']\n'pretraining.ppo.clip' = [0.1]\n'network.hidden' = [[64, 64]]\n"
            ),
            ["network.hidden", "pretraining.ppo.clip"]
        );
        assert_eq!(
            departures(
                "algorithm = ['ppo']\nreward = [{ sparse2 = { distance = 1.0 } }]\n'rollout.steps' = [2048]\n"
            ),
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
            [
                "mcpo.d: 0.001 -> 0.5",
                "mcpo.max_d: absent -> 1",
                "seed: 7 -> 8"
            ]
        );
    }
}
