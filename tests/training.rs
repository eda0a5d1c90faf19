//! Laws of a training run, for every algorithm: it repeats bit for bit, it resumes bit for bit, and
//! being watched does not change it.

use std::path::Path;

use mcpo_run::{
    algo::{Agent, Entry, catalogue},
    arithmetic::threads,
    plan::{self, RunSpec},
    spec::{self, Algorithm, Overrides},
    train::{self, Ending, EvaluationEpisode, Flow, Iteration, RunSink, SinkError},
};

/// Remembers what it is told, and the last checkpoint; stops after `stop_after` iterations.
#[derive(Default)]
struct Memory {
    stop_after: Option<u64>,
    iterations: Vec<Iteration>,
    evaluations: Vec<EvaluationEpisode>,
    policies: Vec<(u64, bool, Agent)>,
    checkpoint: Option<Vec<u8>>,
}

impl Memory {
    /// Asserts that `other` has the same iterations, evaluations and policies, to the bit.
    fn assert_is(&self, other: &Self, case: &str) {
        assert_eq!(self.iterations, other.iterations, "{case}");
        assert_eq!(self.evaluations, other.evaluations, "{case}");
        assert_eq!(self.policies, other.policies, "{case}");
    }
}

impl RunSink for Memory {
    fn iteration(
        &mut self,
        row: &Iteration,
        checkpoint: &dyn Fn() -> Vec<u8>,
    ) -> Result<Flow, SinkError> {
        let mut row = row.clone();
        (row.physics_seconds, row.rollout_seconds, row.update_seconds) = (0.0, 0.0, 0.0);
        row.update.seconds.clear();
        let stop = self.stop_after == Some(row.iteration);
        self.iterations.push(row);
        self.checkpoint = Some(checkpoint());
        Ok(if stop { Flow::Stop } else { Flow::Continue })
    }

    fn evaluation(&mut self, episodes: &[EvaluationEpisode]) -> Result<(), SinkError> {
        self.evaluations.extend_from_slice(episodes);
        Ok(())
    }

    fn policy(&mut self, env_steps: u64, last: bool, agent: &Agent) -> Result<(), SinkError> {
        self.policies.push((env_steps, last, agent.clone()));
        Ok(())
    }
}

/// A run of five small iterations.
fn run_spec(algorithm: &str, env: &str, more: &str) -> RunSpec {
    let demonstration = format!("{}/tests/parity/{env}.parquet", env!("CARGO_MANIFEST_DIR"));
    let text = format!(
        r#"
        name = "training"
        demonstrations = "{demonstration}"
        [[matrix]]
        seed = [3]
        env = ["{env}"]
        algorithm = ["{algorithm}"]
        [budget]
        env_steps = 5120
        [rollout]
        steps = 1024
        environments = 4
        [network]
        hidden = [16, 8]
        [evaluation]
        final_episodes = 3
        {more}
        "#
    );
    let spec = spec::parse(Path::new("training.toml"), &text, &Overrides::default())
        .unwrap_or_else(|e| panic!("{e}"));
    let mut runs = plan::plan(&spec).expect("one run");
    runs.pop().expect("one run")
}

fn trained(spec: &RunSpec, checkpoint: Option<&[u8]>, sink: &mut Memory) -> Ending {
    train::run(spec, checkpoint, sink)
        .unwrap_or_else(|error| panic!("{}: {error}", spec.algorithm_name()))
}

#[test]
fn every_algorithm_repeats_and_resumes_bit_for_bit() {
    for algorithm in Algorithm::names() {
        let spec = run_spec(algorithm, "InvertedPendulum-v2", "");
        let (mut whole, mut again) = (Memory::default(), Memory::default());
        assert_eq!(trained(&spec, None, &mut whole), Ending::Finished);
        trained(&spec, None, &mut again);
        assert_eq!(
            whole.iterations, again.iterations,
            "{algorithm} does not repeat"
        );
        assert_eq!(
            whole.evaluations, again.evaluations,
            "{algorithm} does not repeat"
        );
        assert!(
            whole
                .evaluations
                .iter()
                .filter(|episode| episode.last)
                .count()
                == 3,
            "{algorithm}"
        );
        // Cloning tells its loss in a row of no steps.
        if whole.iterations.iter().all(|row| row.env_steps == 0) {
            assert!(!spec.algorithm.trains(), "{algorithm} trained nothing");
            continue;
        }
        assert_eq!(
            whole.iterations.last().map(|row| row.env_steps),
            Some(5120),
            "{algorithm}"
        );

        let mut resumed = Memory {
            stop_after: Some(2),
            ..Memory::default()
        };
        assert_eq!(trained(&spec, None, &mut resumed), Ending::Stopped);
        let checkpoint = resumed
            .checkpoint
            .take()
            .expect("stopped with a checkpoint");
        resumed.stop_after = None;
        assert_eq!(
            trained(&spec, Some(&checkpoint), &mut resumed),
            Ending::Finished
        );
        whole.assert_is(&resumed, &format!("{algorithm} resumes as another run"));
    }
}

#[test]
fn every_algorithm_goes_on_from_the_end_of_a_shorter_run_as_the_longer_one_bit_for_bit() {
    // The shorter run ends where an evaluation under way is due in the longer one, and where none
    // is.
    for (every, budget) in [(1024, 2048), (2048, 3072)] {
        for algorithm in catalogue::all()
            .map(Entry::about)
            .filter(|about| about.trains)
            .map(|about| about.name)
        {
            let long = run_spec(
                algorithm,
                "InvertedPendulum-v2",
                &format!("every = {every}\nepisodes = 1"),
            );
            let mut short = long.clone();
            short.budget.env_steps = mcpo_run::quantity::constant(budget);
            let (mut whole, mut extended) = (Memory::default(), Memory::default());
            trained(&long, None, &mut whole);
            trained(&short, None, &mut extended);
            // What the longer run does not have: the shorter one's last evaluation and policy.
            extended.evaluations.retain(|row| !row.last);
            extended.policies.retain(|(_, last, _)| !last);
            let checkpoint = extended.checkpoint.take().expect("it has iterations");
            trained(&long, Some(&checkpoint), &mut extended);
            whole.assert_is(&extended, &format!("{algorithm} goes on as another run"));
        }
    }
}

#[test]
fn a_resumed_mujoco_run_with_contacts_is_the_same_run() {
    let spec = run_spec("ppo", "Walker2d-v2", "");
    let mut whole = Memory::default();
    trained(&spec, None, &mut whole);
    let mut resumed = Memory {
        stop_after: Some(3),
        ..Memory::default()
    };
    trained(&spec, None, &mut resumed);
    let checkpoint = resumed
        .checkpoint
        .take()
        .expect("stopped with a checkpoint");
    resumed.stop_after = None;
    trained(&spec, Some(&checkpoint), &mut resumed);
    assert_eq!(whole.iterations, resumed.iterations);
    assert_eq!(whole.policies, resumed.policies);
}

#[test]
fn threads_share_the_work_without_changing_a_bit() {
    for (algorithm, env) in [
        ("ppo", "Hopper-v2"),
        ("mcpo", "HalfCheetah-v2"),
        ("gail", "InvertedPendulum-v2"),
    ] {
        let spec = run_spec(algorithm, env, "");
        let mut one: Option<Memory> = None;
        for count in [1, 2, 4] {
            threads::set(count);
            let mut memory = Memory::default();
            trained(&spec, None, &mut memory);
            if let Some(one) = &one {
                one.assert_is(&memory, &format!("{algorithm} with {count} threads"));
            } else {
                one = Some(memory);
            }
        }
        threads::set(1);
    }
}

#[test]
fn evaluating_more_often_does_not_change_training() {
    let rare = run_spec("mcpo", "InvertedPendulum-v2", "");
    let often = run_spec("mcpo", "InvertedPendulum-v2", "every = 1024\nepisodes = 5");
    let (mut seldom, mut frequent) = (Memory::default(), Memory::default());
    trained(&rare, None, &mut seldom);
    trained(&often, None, &mut frequent);
    assert!(frequent.evaluations.len() > seldom.evaluations.len());
    assert_eq!(seldom.iterations, frequent.iterations);
    assert_eq!(seldom.policies, frequent.policies);
    let last = |memory: &Memory| {
        memory
            .evaluations
            .iter()
            .filter(|row| row.last)
            .cloned()
            .collect::<Vec<_>>()
    };
    assert_eq!(
        last(&seldom),
        last(&frequent),
        "the last evaluation depends on those before it"
    );
    // More episodes at the end: the same ones first.
    let more = RunSpec {
        evaluation: spec::Evaluation {
            final_episodes: mcpo_run::quantity::constant(5),
            ..rare.evaluation.clone()
        },
        ..rare.clone()
    };
    let mut longer = Memory::default();
    trained(&more, None, &mut longer);
    assert_eq!(
        (seldom.iterations, &last(&longer)[..3]),
        (longer.iterations.clone(), &last(&frequent)[..])
    );
}

#[test]
fn another_seed_is_another_run() {
    let first = run_spec("ppo", "InvertedPendulum-v2", "");
    let second = RunSpec {
        seed: mcpo_run::rng::Seed(4),
        ..first.clone()
    };
    let (mut one, mut other) = (Memory::default(), Memory::default());
    trained(&first, None, &mut one);
    trained(&second, None, &mut other);
    assert_ne!(one.iterations, other.iterations);
}

#[test]
fn a_checkpoint_of_another_run_or_cut_short_is_refused() {
    let spec = run_spec("mcpo", "InvertedPendulum-v2", "");
    let mut memory = Memory {
        stop_after: Some(1),
        ..Memory::default()
    };
    trained(&spec, None, &mut memory);
    let checkpoint = memory.checkpoint.expect("stopped with a checkpoint");
    let half = &checkpoint[..checkpoint.len() / 2];
    assert!(train::run(&spec, Some(half), &mut Memory::default()).is_err());
    let other = run_spec("ppo", "InvertedPendulum-v2", "");
    assert!(train::run(&other, Some(&checkpoint), &mut Memory::default()).is_err());
}
