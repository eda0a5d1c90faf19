//! `mcpo-run eval RUN`.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, bail};

use super::{named, print};
use crate::{
    plan,
    record::{Manifest, RunPaths, policy},
    rng::{Seed, Stream},
    train::{build, evaluate},
};

/// The arguments of `eval`.
#[derive(Debug, clap::Args)]
pub struct EvalArguments {
    /// A run's folder, or a policy's file (*.safetensors)
    run: PathBuf,
    /// Episodes with the mean action
    #[arg(long, value_name = "N", default_value_t = 50)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=65_535))]
    episodes: u32,
    /// The seed of the initial states
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    seed: u64,
}

/// The longest episode that is played, in steps: a thousand times the limit of the seven
/// environments.
const LONGEST: u64 = 1_000_000;
/// The most episodes that are played at a time.
const TOGETHER: usize = 64;

/// # Errors
///
/// The run.json beside the policy at the end of a run names another.
fn check_digest(path: &Path) -> anyhow::Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    if path != RunPaths::policy(folder) {
        return Ok(());
    }
    let recorded =
        Manifest::read(&RunPaths::manifest(folder))?.and_then(|manifest| manifest.policy);
    match recorded {
        Some(recorded) if recorded != policy::digest(path)? => {
            bail!(
                "{} is not the policy that the run.json beside it records; to play it, copy it \
                 elsewhere",
                path.display()
            )
        }
        _ => Ok(()),
    }
}

/// Plays the episodes, and prints their returns in the dense reward and in the training reward.
pub fn run(arguments: &EvalArguments) -> anyhow::Result<ExitCode> {
    let path = named(&arguments.run);
    let path = if path.is_dir() {
        let policy = RunPaths::policy(&path);
        if !policy.exists() && RunPaths::manifest(&path).exists() {
            bail!(
                "{} keeps no policy; run it again with another --results to have one",
                path.display()
            );
        }
        policy
    } else {
        path
    };
    // Read once for its specification alone: only the environment that it names can check its
    // shapes.
    let (_, stamp) = policy::read(&path)?;
    let spec = plan::recorded(&stamp.spec).with_context(|| {
        format!(
            "{} was written by another version of this program",
            path.display()
        )
    })?;
    // The limit comes from the policy's file, which may name any number.
    if spec.max_steps > LONGEST {
        bail!(
            "{} comes from a run whose episodes last {} steps; at most {LONGEST} are played",
            path.display(),
            spec.max_steps
        );
    }
    check_digest(&path)?;
    // The number of episodes that play together does not change any of them.
    let together = spec
        .rollout
        .environments
        .size()
        .min(arguments.episodes as usize)
        .min(TOGETHER);
    let mut tasks =
        build::tasks(&spec, together).with_context(|| format!("cannot play {}", path.display()))?;
    let (agent, _) = policy::read_for(&path, tasks[0].spaces())?;
    let starts = (0..arguments.episodes)
        .map(|index| Seed(arguments.seed).stream(Stream::Evaluation, index))
        .collect();
    let episodes = evaluate::episodes(
        &mut evaluate::Actor::MeanAction(&agent),
        &mut tasks,
        starts,
        &mut || {},
    )?;
    let row = |name: &str, numbers: Vec<f64>| {
        let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
        let squares: f64 = numbers.iter().map(|number| (number - mean).powi(2)).sum();
        // One episode has no deviation: 0 is shown instead of NaN.
        let std = (squares / (numbers.len() as f64 - 1.0).max(1.0)).sqrt();
        let (least, most) = numbers
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| {
                (a.min(x), b.max(x))
            });
        format!("{name:<16} {mean:>10.2} ± {std:<10.2} from {least:.2} to {most:.2}\n")
    };
    let text = [
        format!(
            "{} in {}, {} episodes with the mean action\n",
            spec.label(),
            spec.env,
            episodes.len()
        ),
        row(
            "dense return",
            episodes
                .iter()
                .map(|episode| episode.dense_return)
                .collect(),
        ),
        row(
            "training return",
            episodes
                .iter()
                .map(|episode| episode.training_return)
                .collect(),
        ),
        row(
            "length",
            episodes
                .iter()
                .map(|episode| episode.length as f64)
                .collect(),
        ),
    ];
    print(&text.concat())?;
    Ok(ExitCode::SUCCESS)
}
