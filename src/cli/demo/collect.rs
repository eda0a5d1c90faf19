//! `mcpo-run demo collect`.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, bail};

use super::super::{print, selected::Selected};
use crate::{
    algo::Agent,
    env::{self, EnvId, Reward, Task},
    plan::RunSpec,
    record::{RunPaths, policy},
    report::reference,
    rng::{Seed, Stream},
    train::evaluate::{self, Actor},
};

/// Which runs, and what to look for.
#[derive(Debug, clap::Args)]
pub struct CollectArguments {
    #[command(flatten)]
    selected: Selected,
    /// The folder that the demonstrations are written to, as ENV.parquet
    #[arg(long, value_name = "DIR", default_value = "experiments/demos")]
    out: PathBuf,
    /// Initial states that each policy is tried from
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=1000))]
    starts: u32,
    /// The return to come near to [default: the paper's Demo column]
    #[arg(long, value_name = "RETURN", allow_negative_numbers = true)]
    target: Option<f64>,
}

/// One episode of one kept policy.
struct Candidate {
    run: RunSpec,
    fingerprint: String,
    /// Steps of training behind the policy.
    env_steps: u64,
    agent: Agent,
    /// Which initial state.
    start: u32,
    dense_return: f64,
}

/// Writes one demonstration an environment, and prints where each comes from.
pub fn run(arguments: &CollectArguments) -> anyhow::Result<ExitCode> {
    let specs = arguments.selected.load()?;
    let mut runs: BTreeMap<EnvId, Vec<RunSpec>> = BTreeMap::new();
    for run in arguments.selected.runs(&specs)? {
        runs.entry(run.env).or_default().push(run);
    }
    fs::create_dir_all(&arguments.out).with_context(|| format!("cannot make {}", arguments.out.display()))?;
    let mut missing = Vec::new();
    for (env, runs) in runs {
        let target = match arguments.target {
            Some(target) => target,
            None => reference::returns(env.name()).map(|row| row.demo).context("the paper has no such environment")?,
        };
        match nearest(&runs, &arguments.selected.results, arguments.starts, target)? {
            None => missing.push(env.name()),
            Some(candidate) => {
                let path = arguments.out.join(format!("{env}.parquet"));
                let steps = write(&candidate, target, &path)?;
                print(&format!(
                    "{env:<26} {steps:>4} steps, return {:>9.2} (wanted {target:.2}): {} after {} steps, initial state {}\n",
                    candidate.dense_return, candidate.run.id, candidate.env_steps, candidate.start,
                ))?;
            }
        }
    }
    if !missing.is_empty() {
        bail!(
            "no run kept a policy for {}; run the experiment first (it needs `checkpoint.keep_policy_every`)",
            missing.join(", ")
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// The episode with the return nearest `target`; `None` when none of the `runs` has kept a policy yet.
fn nearest(runs: &[RunSpec], results: &Path, starts: u32, target: f64) -> anyhow::Result<Option<Candidate>> {
    let mut best: Option<Candidate> = None;
    for run in runs {
        let paths = RunPaths::new(results, &run.experiment, &run.id)?;
        let mut tasks: Vec<Task> =
            (0..starts.min(8)).map(|_| Task::new(run.env, Reward::Dense, run.max_steps)).collect::<Result<_, _>>()?;
        for path in kept_policies(&paths)? {
            let (agent, stamp) = policy::read(&path)?;
            let generators = (0..starts).map(|start| run.seed.stream(Stream::Evaluation, start)).collect();
            let episodes = evaluate::episodes(&mut Actor::MeanAction(&agent), &mut tasks, generators, &mut || {})?;
            for (start, episode) in (0..).zip(&episodes) {
                let distance = |dense_return: f64| (dense_return - target).abs();
                if best.as_ref().is_none_or(|best| distance(episode.dense_return) < distance(best.dense_return)) {
                    best = Some(Candidate {
                        run: run.clone(),
                        fingerprint: stamp.fingerprint.clone(),
                        env_steps: RunPaths::kept_after(&path).context("a kept policy's name is a number of steps")?,
                        agent: agent.clone(),
                        start,
                        dense_return: episode.dense_return,
                    });
                }
            }
        }
    }
    Ok(best)
}

/// The policies that a run has kept, whether it has ended or not, in the order of training.
fn kept_policies(paths: &RunPaths) -> anyhow::Result<Vec<PathBuf>> {
    let folder =
        [&paths.complete, &paths.partial].map(|folder| folder.join("policies")).into_iter().find(|f| f.is_dir());
    let Some(folder) = folder else { return Ok(Vec::new()) };
    let mut files = fs::read_dir(&folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, _>>())
        .with_context(|| format!("cannot read {}", folder.display()))?;
    files.retain(|file| RunPaths::kept_after(file).is_some());
    files.sort();
    Ok(files)
}

/// Plays the candidate's episode again, step by step, and writes it; gives its length.
fn write(candidate: &Candidate, target: f64, path: &Path) -> anyhow::Result<usize> {
    let Candidate { run, agent, start, .. } = candidate;
    let mut task = Task::new(run.env, Reward::Dense, run.max_steps)?;
    let Seed(seed) = run.seed;
    let mut demonstration = evaluate::record(agent, &mut task, run.seed.stream(Stream::Evaluation, *start))?;
    demonstration.provenance = [
        ("environment", run.env.name().to_owned()),
        ("return", format!("{:.6}", candidate.dense_return)),
        ("wanted_return", target.to_string()),
        ("policy", format!("{} on the dense reward", run.algorithm_name())),
        ("run", format!("{}/{}", run.experiment, run.id)),
        ("seed", seed.to_string()),
        ("env_steps", candidate.env_steps.to_string()),
        ("initial_state", start.to_string()),
        ("fingerprint", candidate.fingerprint.clone()),
        ("mujoco", env::engine_version().to_owned()),
        ("program", env!("CARGO_PKG_VERSION").to_owned()),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .to_vec();
    demonstration.write(path)?;
    Ok(demonstration.len())
}
