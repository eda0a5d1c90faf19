//! What runs leave, without running them.

use std::{fs, path::Path};

use mcpo_run::{
    algo::Update,
    plan::RunSpec,
    record::{Build, Manifest, Outcome, RunPaths, Stamp, rows},
    train::{EvaluationEpisode, Iteration},
};

/// Evaluation episodes as environment steps, whether of the last evaluation, and return; iterations
/// as environment steps and MMD.
pub type Rows<'a> = (&'a [(u64, bool, f64)], &'a [(u64, f64)]);

/// Writes what `spec` would have left: an error, which is its log too, or rows.
pub fn write(spec: &RunSpec, results: &Path, end: Result<Rows<'_>, &str>) {
    let paths = RunPaths::new(results, &spec.experiment, &spec.id).expect("a good id");
    fs::create_dir_all(&paths.complete).expect("made");
    let json = serde_json::to_value(spec).expect("a specification serialises");
    let build = Build::current(serde_json::Value::Null);
    let mut manifest = Manifest::new(Stamp {
        spec: json,
        fingerprint: "f".into(),
        demonstration: None,
        demonstrated: None,
        build,
        origin: None,
    });
    manifest.outcome = match end {
        Err(error) => Outcome::Failed {
            error: error.into(),
            log_tail: vec![error.into()],
        },
        Ok((returns, mmd)) => {
            let keys = rows::Keys {
                experiment: spec.experiment.clone(),
                run: spec.id.clone(),
                env: spec.env.name().into(),
                algorithm: spec.algorithm_name().into(),
                d: spec.d(),
                epsilon: spec.epsilon(),
                seed: spec.seed.0,
                axes: Default::default(),
            };
            let episode =
                |(episode, &(env_steps, last, dense_return)): (usize, &(u64, bool, f64))| {
                    EvaluationEpisode {
                        env_steps,
                        last,
                        episode: episode as u64,
                        dense_return,
                        training_return: 0.0,
                        length: 10,
                    }
                };
            let iteration = |(index, &(env_steps, mmd)): (usize, &(u64, f64))| Iteration {
                iteration: index as u64 + 1,
                env_steps,
                episodes: 0,
                dense_return: None,
                training_return: None,
                episode_length: None,
                update: Update {
                    mmd: Some(mmd),
                    d: Some(1e-3),
                    ..Update::default()
                },
                rollout_seconds: 0.0,
                update_seconds: 0.0,
                physics_seconds: 0.0,
            };
            let episodes: Vec<EvaluationEpisode> =
                returns.iter().enumerate().map(episode).collect();
            let iterations: Vec<Iteration> = mmd.iter().enumerate().map(iteration).collect();
            rows::write_evaluations(
                &RunPaths::evaluations(&paths.complete),
                &keys,
                &manifest.stamp,
                &episodes,
            )
            .expect("written");
            rows::write_progress(
                &RunPaths::progress(&paths.complete),
                &keys,
                &manifest.stamp,
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
