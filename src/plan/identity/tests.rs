use super::{
    super::{canonical::recorded, tests::planned},
    *,
};
use crate::{env::EnvId, quantity::constant};

fn run() -> RunSpec {
    planned("[[matrix]]\nseed = [7]\nenv = ['HalfCheetah-v2']\nalgorithm = ['mcpo']\n").remove(0)
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
const PINNED: &str = include_str!("../pinned.json");

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
            let text = format!("[[matrix]]\nseed = [1]\nenv = ['{env}']\nalgorithm = ['{name}']\n");
            assert!(planned(&text)[0].departures().is_empty(), "{name}, {env}");
        }
    }
    let length = "'budget.env_steps' = [200_000]\n'evaluation.every' = [5_000]\n\
        'checkpoint.every_seconds' = [1]\n";
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
            "algorithm = ['pretraining']\n'pretraining.ppo.clip' = [0.1]\n\
             'network.hidden' = [[64, 64]]\n"
        ),
        ["network.hidden", "pretraining.ppo.clip"]
    );
    assert_eq!(
        departures(
            "algorithm = ['ppo']\nreward = [{ sparse2 = { distance = 1.0 } }]\n\
             'rollout.steps' = [2048]\n"
        ),
        ["reward", "rollout.steps"]
    );
}

#[test]
fn differences_name_the_key_and_both_values() {
    let before = run();
    let other = "[[matrix]]\nseed = [8]\nenv = ['HalfCheetah-v2']\nalgorithm = ['mcpo']\n\
        d = [0.5]\nmax_d = [1]\n";
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
