//! Made-up runs for the tests of this module.

use std::{fs, path::Path};

use crate::{
    measured::{Cell, EvaluationEpisode, Iteration, progress},
    plan::plan,
    quantity::constant,
    record::{
        Build, Checkpoint, Demonstrated, Executable, Manifest, Outcome, RunPaths, Stamp, rows,
    },
    spec::{self, Overrides},
};

use super::recorded::{Evaluation, Recording, Run, State};

/// A missing run of MCPO.
pub fn mcpo(env: &str, d: f64, epsilon: f64, seed: u64) -> Run {
    run(
        "mcpo",
        &format!("env = [{env:?}]\nd = [{d:?}]\nepsilon = [{epsilon:?}]\nseed = [{seed}]"),
    )
}

/// A missing run of PPO.
pub fn ppo(env: &str, seed: u64) -> Run {
    run("ppo", &format!("env = [{env:?}]\nseed = [{seed}]"))
}

/// The one run of a matrix of these axes, of 100 steps.
pub fn run(algorithm: &str, axes: &str) -> Run {
    let text = format!(
        r#"
        name = "made-up"
        description = ""
        budget.env_steps = 4096
        [[matrix]]
        algorithm = ["{algorithm}"]
        {axes}
        "#
    );
    let spec =
        spec::parse(Path::new("made-up.toml"), &text, &Overrides::default()).expect("a valid file");
    let spec = plan(&spec).expect("a plan").pop().expect("one run");
    Run::new(spec, State::Missing).budget(100) // less than a rollout, which no matrix may ask for
}

impl Run {
    /// The same with another budget.
    pub fn budget(mut self, env_steps: i64) -> Self {
        self.spec.budget.env_steps = constant(env_steps);
        Self::new(self.spec, self.state)
    }

    /// The same, computed by these versions.
    pub fn by(mut self, versions: serde_json::Value) -> Self {
        if let State::Finished(recording) = &mut self.state {
            recording.versions = versions;
        }
        self
    }

    /// The same, failed.
    pub fn failed(mut self, error: &str) -> Self {
        self.state = State::Failed {
            error: error.into(),
        };
        self
    }

    /// The same, finished with these evaluations: environment steps and the returns of the
    /// episodes.
    pub fn finished(mut self, evaluations: &[(u64, &[f64])]) -> Self {
        let end = evaluations.iter().map(|(env_steps, _)| *env_steps).max();
        let episodes = evaluations.iter().flat_map(|&(env_steps, returns)| {
            let last = Some(env_steps) == end;
            returns.iter().map(move |&dense_return| Evaluation {
                env_steps,
                last,
                dense_return,
            })
        });
        self.state = State::Finished(Recording {
            evaluations: episodes.collect(),
            ..Recording::default()
        });
        self
    }

    /// The same, having learned from the demonstration of this digest.
    pub fn demonstrated(mut self, digest: Option<&str>, mean_return: Option<f64>) -> Self {
        if let State::Finished(recording) = &mut self.state {
            recording.demonstration = digest.map(str::to_owned);
            recording.demonstrated = mean_return.map(|mean| Demonstrated {
                episodes: 1,
                steps: 300,
                mean_return: Some(mean),
            });
        }
        self
    }

    /// The same with a column of progress.
    pub fn progress(mut self, column: &str, rows: &[(u64, f64)]) -> Self {
        if let State::Finished(recording) = &mut self.state {
            let steps = rows.iter().map(|row| Some(row.0 as f64)).collect();
            recording.progress.insert(&progress::ENV_STEPS, steps);
            let column = progress::find(column).expect("a column");
            recording
                .progress
                .insert(column, rows.iter().map(|row| Some(row.1)).collect());
        }
        self
    }
}

/// Writes under the folder `results` what `run` has come to at its last checkpoint: the rows that
/// it would have finished with.
pub fn record_under_way(run: &Run, results: &Path) {
    let paths = RunPaths::new(results, &run.spec.experiment, &run.spec.id).expect("a good id");
    paths.open().expect("made");
    let recording = run.recording().expect("it has rows");
    let evaluations = recording
        .evaluations
        .iter()
        .zip(0..)
        .map(|(evaluation, episode)| episode_row(evaluation, episode));
    let (iterations, evaluations) = (iteration_rows(recording), evaluations.collect());
    let checkpoint = Checkpoint {
        iterations,
        evaluations,
        ..Checkpoint::default()
    };
    Manifest::new(stamp(run))
        .write(&RunPaths::manifest(&paths.partial))
        .expect("written");
    checkpoint
        .write(&RunPaths::checkpoint(&paths.partial), FINGERPRINT)
        .expect("written");
}

const FINGERPRINT: &str = "f";

fn stamp(run: &Run) -> Stamp {
    let recording = run.recording().cloned().unwrap_or_default();
    let build = Build {
        program: "0".into(),
        executable: Executable::Recorded(String::new()),
        versions: recording.versions,
        cpu_class: String::new(),
        libm: String::new(),
    };
    Stamp {
        spec: serde_json::to_value(&run.spec).expect("a specification serialises"),
        fingerprint: FINGERPRINT.into(),
        demonstration: recording.demonstration,
        demonstrated: recording.demonstrated,
        build,
        origin: None,
    }
}

/// Writes what `run` left under the folder `results`, as the runner does.
pub fn record(run: &Run, results: &Path) {
    let paths = RunPaths::new(results, &run.spec.experiment, &run.spec.id).expect("a good id");
    fs::create_dir_all(&paths.complete).expect("made");
    let stamp = stamp(run);
    let keys = rows::Keys {
        experiment: run.spec.experiment.clone(),
        run: run.spec.id.clone(),
        env: run.spec.env.name().into(),
        algorithm: run.spec.algorithm_name().into(),
        d: run.spec.d(),
        epsilon: run.spec.epsilon(),
        seed: run.spec.seed.0,
        axes: Default::default(),
    };
    let mut manifest = Manifest::new(stamp.clone());
    manifest.outcome = match &run.state {
        State::Missing | State::Differs { .. } => Outcome::Begun,
        State::Failed { error } => Outcome::Failed {
            error: error.clone(),
            log_tail: Vec::new(),
        },
        State::Finished(recording) => {
            let episodes: Vec<EvaluationEpisode> = recording
                .evaluations
                .iter()
                .zip(0..)
                .map(|(evaluation, episode)| episode_row(evaluation, episode))
                .collect();
            rows::write_evaluations(
                &RunPaths::evaluations(&paths.complete),
                &keys,
                &stamp,
                &episodes,
            )
            .expect("written");
            let iterations = iteration_rows(recording);
            rows::write_progress(
                &RunPaths::progress(&paths.complete),
                &keys,
                &stamp,
                &iterations,
            )
            .expect("written");
            Outcome::Finished
        }
    };
    manifest
        .write(&RunPaths::manifest(&paths.complete))
        .expect("written");
}

fn episode_row(evaluation: &Evaluation, episode: u64) -> EvaluationEpisode {
    let Evaluation {
        env_steps,
        last,
        dense_return,
    } = *evaluation;
    EvaluationEpisode {
        env_steps,
        last,
        episode,
        dense_return,
        training_return: 0.0,
        length: 1,
    }
}

fn iteration_rows(recording: &Recording) -> Vec<Iteration> {
    let height = recording
        .progress
        .get(&progress::ENV_STEPS)
        .map_or(0, <[_]>::len);
    let row = |row: usize| {
        let mut iteration = Iteration {
            iteration: row as u64 + 1,
            ..Iteration::default()
        };
        for column in progress::COLUMNS {
            let number = recording.progress.get(column).and_then(|cells| cells[row]);
            match (&column.cell, number) {
                (Cell::Whole(field), Some(number)) => (field.set)(&mut iteration, number as u64),
                (Cell::Number(field), Some(number)) => (field.set)(&mut iteration, number),
                (Cell::MaybeNumber(field), number) => (field.set)(&mut iteration, number),
                _ => {}
            }
        }
        iteration
    };
    (0..height).map(row).collect()
}
