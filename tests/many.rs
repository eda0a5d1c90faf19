//! Ten thousand recorded runs: what `plan`, `status` and `report` take of time and memory on them.
//!
//! `cargo test --release --test many -- --ignored --nocapture` writes them (some minutes, 2 GB in
//! the temporary folder) and prints the figures that `experiments/scaling.md` shows.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use mcpo_run::{
    algo::Update,
    plan,
    record::{Manifest, Outcome, RunPaths, TableDigests, rows},
    schedule::{preflight, state::Planned},
    spec::{self, Overrides},
    train::{EvaluationEpisode, Iteration},
};

/// 250 seeds, five environments, eight settings.
const SETTINGS: &str = r#"
    [[matrix]]
    seed = SEEDS
    env = ["InvertedPendulum-v2", "HalfCheetah-v2", "Hopper-v2", "Walker2d-v2", "Ant-v2"]
    algorithm = ["mcpo", "ppo", "trpo", "gail"]
    d = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1]
"#;
/// What each command may take.
const MOST_SECONDS: f64 = 10.0;
const MOST_MIB: u64 = 1000;

/// Writes the tables that `run` would have left: a row an iteration, two episodes every 20,000
/// steps and 50 at the end.
fn write_tables(run: &Planned) {
    let (steps, every) = (run.spec.trained_steps(), run.spec.rollout.steps.get());
    let seed = run.spec.seed.0 as f64;
    let value = |n: u64| (seed + n as f64).sin() * 100.0 + n as f64;
    let iterations: Vec<Iteration> = (1..=steps / every)
        .map(|n| Iteration {
            iteration: n,
            env_steps: n * every,
            episodes: 4,
            dense_return: Some(value(n)),
            training_return: Some(value(n) / 3.0),
            episode_length: Some(1000.0 / (n as f64 + 0.3)),
            update: Update {
                kl: Some(0.01 / value(n).abs().max(1.0)),
                entropy: Some(value(n) / 7.0),
                surrogate_gain: Some(value(n) / 1e4),
                value_loss: Some(value(n).abs()),
                mmd: run.spec.d().map(|d| d * value(n).abs()),
                d: run.spec.d(),
                lambda: run.spec.d().map(|_| value(n).abs()),
                ..Update::default()
            },
            physics_seconds: 0.1 + value(n).abs() / 1e3,
            rollout_seconds: 0.2 + value(n).abs() / 1e3,
            update_seconds: 0.3 + value(n).abs() / 1e3,
        })
        .collect();
    let episode = |env_steps, last, episode: u64| EvaluationEpisode {
        env_steps,
        last,
        episode,
        dense_return: value(env_steps / 20_000 + episode),
        training_return: value(env_steps / 20_000 + episode) / 3.0,
        length: 1000,
    };
    let under_way = (0..steps / 20_000).flat_map(|n| [0, 1].map(|k| episode(n * 20_000, false, k)));
    let evaluations: Vec<EvaluationEpisode> = under_way
        .chain((0..50).map(|k| episode(steps, true, k)))
        .collect();

    let folder = &run.paths.complete;
    let keys = rows::Keys::from(&run.spec);
    rows::write_progress(&RunPaths::progress(folder), &keys, &run.stamp, &iterations)
        .expect("written");
    rows::write_evaluations(
        &RunPaths::evaluations(folder),
        &keys,
        &run.stamp,
        &evaluations,
    )
    .expect("written");
}

/// Writes what `run` would have left, with the tables of `like`, the first seed of its setting:
/// numbers of its own would take minutes to write and as long to read.
fn record(run: &Planned, like: &Planned) {
    let (folder, other) = (&run.paths.complete, &like.paths.complete);
    fs::create_dir_all(folder).expect("made");
    if folder == other {
        write_tables(run);
    } else {
        for file in [RunPaths::progress, RunPaths::evaluations] {
            fs::copy(file(other), file(folder)).expect("copied");
        }
    }
    let tables = Some(TableDigests::of(folder).expect("there"));
    let steps = run.spec.trained_steps();
    let (outcome, seconds) = (Outcome::Finished, 100.0);
    let manifest = Manifest {
        env_steps: steps,
        seconds,
        tables,
        outcome,
        ..Manifest::new(run.stamp.clone())
    };
    manifest
        .write(&RunPaths::manifest(folder))
        .expect("written");
}

/// Files and bytes under `folder`, and the most entries of one folder.
fn size(folder: &Path) -> (u64, u64, u64) {
    let (mut files, mut bytes, mut entries, mut most) = (0, 0, 0, 0);
    for entry in fs::read_dir(folder).expect("readable") {
        let entry = entry.expect("readable");
        entries += 1;
        if entry.file_type().expect("known").is_dir() {
            let inner = size(&entry.path());
            (files, bytes, most) = (files + inner.0, bytes + inner.1, most.max(inner.2));
        } else {
            (files, bytes) = (files + 1, bytes + entry.metadata().expect("readable").len());
        }
    }
    (files, bytes, most.max(entries))
}

/// Seconds of wall time and of the processor, and MiB at most, of the program with `arguments`.
fn measured(arguments: &[&str], folder: &Path) -> (f64, f64, u64) {
    let began = Instant::now();
    let mut program = Command::new(env!("CARGO_BIN_EXE_mcpo-run"));
    program
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null());
    let mut child = program.spawn().expect("it starts");
    let (mut seconds, mut mib) = (0.0, 0);
    let status = loop {
        let process = format!("/proc/{}", child.id());
        let peak = fs::read_to_string(format!("{process}/status")).unwrap_or_default();
        let peak = peak.lines().find_map(|line| {
            line.strip_prefix("VmHWM:")?
                .trim()
                .split(' ')
                .next()?
                .parse()
                .ok()
        });
        mib = peak.map_or(mib, |kib: u64| mib.max(kib >> 10));
        let times = fs::read_to_string(format!("{process}/stat")).unwrap_or_default();
        let times: Vec<f64> = times
            .split_whitespace()
            .skip(13)
            .take(2)
            .filter_map(|field| field.parse().ok())
            .collect();
        seconds = times.iter().sum::<f64>().max(seconds * 100.0) / 100.0; // a tick is 10 ms
        match child.try_wait().expect("it can be waited for") {
            Some(status) => break status,
            None => thread::sleep(Duration::from_millis(20)),
        }
    };
    assert!(status.success(), "{arguments:?}");
    (began.elapsed().as_secs_f64(), seconds, mib)
}

/// Records `10_000 / 250 * seeds` runs and measures the commands on them; gives the worst of the
/// processor's seconds and MiB.
#[expect(clippy::print_stderr, reason = "the figures are what it is for")]
fn measure(seeds: u64) -> (f64, u64) {
    let folder = tempfile::tempdir().expect("a folder");
    let seeds: Vec<u64> = (0..seeds).collect();
    let demonstrations = fs::canonicalize("experiments/demos").expect("they are there");
    let text = format!(
        "name = \"many\"\ndemonstrations = \"{}/{{env}}.parquet\"\nbudget.env_steps = 1_000_000\n\
         algorithms.mcpo.cg_iterations = 10\n{}",
        demonstrations.display(),
        SETTINGS.replace("SEEDS", &format!("{seeds:?}"))
    );
    let path = folder.path().join("many.toml");
    fs::write(&path, &text).expect("written");
    let results = folder.path().join("results");
    let spec = spec::load(&path, &Overrides::default()).expect("a matrix");
    let runs = preflight::plan(plan::plan(&spec).expect("a plan"), &results).expect("places");
    // The seeds of a setting stand together.
    for setting in runs.chunks(seeds.len()) {
        setting.iter().for_each(|run| record(run, &setting[0]));
    }
    let (files, bytes, entries) = size(&results);
    eprintln!(
        "{} runs: {files} files, {} MB, at most {entries} entries in a folder",
        runs.len(),
        bytes / 1_000_000
    );
    eprintln!("| command | seconds | of the processor | MiB |\n|---|---:|---:|---:|");
    let mut worst = (0.0_f64, 0);
    for command in ["plan", "status", "report"] {
        let (wall, seconds, mib) = measured(&[command, "many.toml"], folder.path());
        eprintln!("| `{command}` | {wall:.1} | {seconds:.1} | {mib} |");
        worst = (worst.0.max(seconds), worst.1.max(mib));
    }
    worst
}

#[test]
#[ignore = "writes ten thousand runs"]
fn ten_thousand_runs_take_seconds_and_less_than_a_gigabyte() {
    let (seconds, mib) = measure(250);
    assert!(
        seconds < MOST_SECONDS && mib < MOST_MIB,
        "{seconds} s, {mib} MiB"
    );
}

#[test]
fn a_few_hundred_runs_take_a_share_of_that() {
    let (seconds, mib) = measure(5);
    // A fiftieth of the runs may take a tenth of the time, which what does not grow is part of.
    assert!(
        seconds < MOST_SECONDS / 10.0 && mib < MOST_MIB / 2,
        "{seconds} s, {mib} MiB"
    );
}
