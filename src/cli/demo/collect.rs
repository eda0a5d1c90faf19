//! `mcpo-run demo collect`.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    io::{self, Write as _},
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, bail, ensure};

use super::{
    super::{chosen::Chosen, print},
    mmd_of_doing_nothing, not_over,
};
use crate::{
    algo::Agent,
    demo::Demonstration,
    env::{self, EnvId, Reward, Task},
    plan::RunSpec,
    record::{RunPaths, policy},
    report::reference,
    rng::{Seed, Stream},
    train::evaluate::{self, Actor},
};

/// The arguments of `demo collect`.
#[derive(Debug, clap::Args)]
pub struct CollectArguments {
    #[command(flatten)]
    chosen: Chosen,
    /// The folder that the demonstrations are written to, as ENV.parquet
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace demonstrations that already exist
    #[arg(long)]
    force: bool,
    /// Initial states that each policy is tried from
    #[arg(long, value_name = "N", default_value_t = 8)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1000))]
    starts: u32,
    /// The return to come close to, whatever else the episode is like [default: the paper's Demo
    /// column, and within 1 % of it the likeness to the authors' demonstration]
    #[arg(long, value_name = "RETURN", allow_negative_numbers = true)]
    target: Option<f64>,
}

/// A return this near to the wanted one (as a share of it) is as good as the wanted one.
const SAME: f64 = 0.01;

/// A policy is good enough where its mean return over the starts is no farther off than this (as a
/// share of the wanted return). A better policy's mishap may have the wanted return, but it teaches
/// a better policy's behaviour.
const AS_GOOD: f64 = 0.2;

/// A return farther off than this (as a share of the wanted one) leads to a warning.
const FAR: f64 = 0.1;

/// The episode to look for.
struct Wanted {
    dense_return: f64,
    /// The authors' demonstration. Likeness to it decides between episodes of the [`SAME`] return.
    like: Option<&'static reference::Demonstration>,
}

/// How far an episode is from what is wanted; the least is the best.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
enum Misfit {
    /// The return is the [`SAME`] and the policy [`AS_GOOD`]. The number is the unlikeness to the
    /// authors' demonstration, or without one the distance from the wanted return.
    Near(f64),
    /// The return is the [`SAME`], but the policy is better or worse than its episode. The number
    /// is how far the policy's mean return is off.
    Untypical(f64),
    /// The return is not the [`SAME`]. The number is how far it is off.
    Far(f64),
}

/// One episode of one kept policy.
struct Candidate {
    run: RunSpec,
    fingerprint: String,
    /// Environment steps of training behind the policy.
    env_steps: u64,
    agent: Agent,
    /// The number of the initial state.
    start: u32,
    dense_return: f64,
    /// The policy's mean return over all starts.
    mean_return: f64,
}

/// Writes one demonstration per environment, and prints where each comes from.
pub fn run(arguments: &CollectArguments) -> anyhow::Result<ExitCode> {
    let specs = arguments.chosen.load()?;
    let mut runs: BTreeMap<EnvId, Vec<RunSpec>> = BTreeMap::new();
    for run in arguments.chosen.runs(&specs)? {
        runs.entry(run.env).or_default().push(run);
    }
    let file = |env: EnvId| arguments.out.join(format!("{env}.parquet"));
    let mut names = BTreeSet::new();
    for env in runs.keys() {
        ensure!(
            names.insert(env.name()),
            "two files describe different robots called `{env}`, and there is one {} for them: \
             collect from each file alone, with an `--out` of its own",
            file(*env).display()
        );
    }
    // Refused before any policy plays, since that takes long.
    runs.keys()
        .try_for_each(|&env| not_over(&file(env), arguments.force))?;
    fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot make {}", arguments.out.display()))?;
    // What is missing is told at the end, when the others' files are written.
    let mut missing = Vec::new();
    for (env, runs) in runs {
        let wanted = Wanted::new(env, arguments.target)?;
        match best(&runs, &arguments.chosen.results, arguments.starts, &wanted)? {
            None => missing.push(env.name()),
            Some(candidate) => tell(
                &candidate,
                &wanted,
                &write(&candidate, &wanted, &file(env))?,
            )?,
        }
    }
    if !missing.is_empty() {
        bail!(
            "no run kept a policy for {}; run the experiment first (it needs \
             `checkpoint.keep_policy_every`)",
            missing.join(", ")
        );
    }
    Ok(ExitCode::SUCCESS)
}

impl Wanted {
    /// The wanted episode: any with the return `target`, or without one an episode like the
    /// authors' demonstration of `env`.
    fn new(env: EnvId, target: Option<f64>) -> anyhow::Result<Self> {
        if let Some(dense_return) = target {
            return Ok(Self {
                dense_return,
                like: None,
            });
        }
        let paper = reference::returns(env.name()).with_context(|| {
            format!(
                "the paper has no {env}: `--target RETURN` says what its demonstration is to earn"
            )
        })?;
        Ok(Self {
            dense_return: paper.demo,
            like: reference::demonstration(env.name()),
        })
    }

    /// How far off a return is, as a share of the wanted one.
    fn off(&self, dense_return: f64) -> f64 {
        (dense_return - self.dense_return).abs() / self.dense_return.abs()
    }

    /// The misfit of an episode with `dense_return`, played by a policy whose mean return is
    /// `mean_return`. `record` plays the episode again, step by step.
    fn misfit(
        &self,
        dense_return: f64,
        mean_return: f64,
        record: impl FnOnce() -> anyhow::Result<Demonstration>,
    ) -> anyhow::Result<Misfit> {
        let off = self.off(dense_return);
        Ok(match self.like {
            _ if off.is_nan() || off > SAME => {
                Misfit::Far((dense_return - self.dense_return).abs())
            }
            None => Misfit::Near(off),
            Some(_) if self.off(mean_return) > AS_GOOD => Misfit::Untypical(self.off(mean_return)),
            Some(like) => Misfit::Near(unlikeness(like, &record()?)),
        })
    }
}

/// How unlike the authors' demonstration `episode` is: the logarithm of the factor within which
/// length, rms of the actions and D of doing nothing all agree; 0 where they are equal.
fn unlikeness(like: &reference::Demonstration, episode: &Demonstration) -> f64 {
    [
        episode.len() as f64 / like.steps as f64,
        episode.action_rms() / like.action_rms,
        mmd_of_doing_nothing(episode) / like.mmd_of_doing_nothing,
    ]
    .map(|ratio| ratio.ln().abs())
    .into_iter()
    .fold(0.0, f64::max)
}

/// The episode with the least misfit; `None` where none of the `runs` has kept a policy yet.
fn best(
    runs: &[RunSpec],
    results: &Path,
    starts: u32,
    wanted: &Wanted,
) -> anyhow::Result<Option<Candidate>> {
    let mut best: Option<(Misfit, Candidate)> = None;
    for run in runs {
        let paths = RunPaths::new(results, &run.experiment, &run.id)?;
        // The number of tasks changes no episode, only how many play at a time.
        let mut tasks: Vec<Task> = (0..starts.min(8))
            .map(|_| Task::new(run.env, Reward::Dense, run.max_steps))
            .collect::<Result<_, _>>()?;
        for path in kept_policies(&paths)? {
            let (agent, stamp) = policy::read_for(&path, tasks[0].spaces())?;
            // Each start has a stream of its own, so that recording can repeat its episode.
            let generator = |start| run.seed.stream(Stream::Evaluation, start);
            let generators = (0..starts).map(generator).collect();
            let episodes = evaluate::episodes(
                &mut Actor::MeanAction(&agent),
                &mut tasks,
                generators,
                &mut || {},
            )?;
            let mean_return = episodes
                .iter()
                .map(|episode| episode.dense_return)
                .sum::<f64>()
                / episodes.len() as f64;
            for (start, episode) in (0..).zip(&episodes) {
                // Recording plays the episode again, so it is done only where the misfit needs it.
                let misfit = wanted.misfit(episode.dense_return, mean_return, || {
                    Ok(evaluate::record(&agent, &mut tasks[0], generator(start))?)
                })?;
                if best.as_ref().is_none_or(|(least, _)| misfit < *least) {
                    let candidate = Candidate {
                        run: run.clone(),
                        fingerprint: stamp.fingerprint.clone(),
                        env_steps: RunPaths::kept_after(&path)
                            .context("a kept policy's name is a number of steps")?,
                        agent: agent.clone(),
                        start,
                        dense_return: episode.dense_return,
                        mean_return,
                    };
                    best = Some((misfit, candidate));
                }
            }
        }
    }
    Ok(best.map(|(_, candidate)| candidate))
}

/// The policies that a run has kept, whether it has ended or not, in the order of training.
fn kept_policies(paths: &RunPaths) -> anyhow::Result<Vec<PathBuf>> {
    let folder = [&paths.complete, &paths.partial]
        .map(|folder| folder.join("policies"))
        .into_iter()
        .find(|f| f.is_dir());
    let Some(folder) = folder else {
        return Ok(Vec::new());
    };
    let mut files = fs::read_dir(&folder)
        .and_then(|entries| {
            entries
                .map(|entry| Ok(entry?.path()))
                .collect::<Result<Vec<_>, _>>()
        })
        .with_context(|| format!("cannot read {}", folder.display()))?;
    files.retain(|file| RunPaths::kept_after(file).is_some());
    files.sort();
    Ok(files)
}

/// Plays the candidate's episode again, step by step, and writes it.
fn write(candidate: &Candidate, wanted: &Wanted, path: &Path) -> anyhow::Result<Demonstration> {
    let Candidate {
        run, agent, start, ..
    } = candidate;
    let mut task = Task::new(run.env, Reward::Dense, run.max_steps)?;
    let Seed(seed) = run.seed;
    let mut demonstration = evaluate::record(
        agent,
        &mut task,
        run.seed.stream(Stream::Evaluation, *start),
    )?;
    demonstration.provenance = [
        ("environment", run.env.name().to_owned()),
        ("return", format!("{:.6}", candidate.dense_return)),
        (
            "mean_return_of_policy",
            format!("{:.6}", candidate.mean_return),
        ),
        ("wanted_return", wanted.dense_return.to_string()),
        (
            "policy",
            format!("{} on the dense reward", run.algorithm_name()),
        ),
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
    Ok(demonstration)
}

/// Prints the facts of the written demonstration, and warns where it misses the wanted return.
fn tell(candidate: &Candidate, wanted: &Wanted, written: &Demonstration) -> anyhow::Result<()> {
    let Candidate {
        run,
        env_steps,
        start,
        dense_return,
        mean_return,
        ..
    } = candidate;
    let Wanted {
        dense_return: wanted_return,
        ..
    } = wanted;
    let env = run.env;
    print(&format!(
        "{env:<26} {:>4} steps, return {dense_return:>9.2} (wanted {wanted_return:.2}, the \
         policy's mean {mean_return:.0}), action rms {:.3}, D of doing nothing {:.1e}: {} after \
         {env_steps} steps, initial state {start}\n",
        written.len(),
        written.action_rms(),
        mmd_of_doing_nothing(written),
        run.id,
    ))?;
    if wanted.off(*dense_return) > FAR {
        let warning = format!(
            "warning: no episode of {env} has a return within 10 % of {wanted_return:.2}\n"
        );
        drop(io::stderr().write_all(warning.as_bytes())); // nobody listens
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(dense_return: f64) -> Wanted {
        Wanted::new(EnvId::HalfCheetah, Some(dense_return)).expect("any return may be wanted")
    }

    fn misfit(wanted: &Wanted, dense_return: f64) -> Misfit {
        wanted
            .misfit(dense_return, dense_return, || {
                bail!("the return alone decides")
            })
            .expect("it is not played")
    }

    #[test]
    fn the_nearest_return_is_the_best() {
        for target in [600.0, -600.0, 0.0] {
            let wanted = wanted(target);
            let misfits = [0.0, 3.0, 7.0, 50.0, 400.0].map(|off| misfit(&wanted, target - off));
            assert!(misfits.is_sorted_by(|a, b| a < b), "{misfits:?}");
        }
    }

    #[test]
    fn within_one_percent_the_likeness_decides() {
        let wanted = Wanted::new(EnvId::HalfCheetah, None).expect("in the paper");
        let like = wanted.like.expect("the authors published it");
        let episode = |scale: f64| Demonstration {
            observations: nalgebra::DMatrix::from_fn(1, like.steps, |_, j| (j as f64).sin()),
            actions: nalgebra::DMatrix::from_element(1, like.steps, scale * like.action_rms),
            rewards: None,
            episode_starts: vec![0],
            terminated: vec![false; like.steps],
            truncated: vec![false; like.steps],
            poses: None,
            provenance: Vec::new(),
        };
        let near = |scale| {
            let same = wanted.dense_return * 1.009;
            wanted
                .misfit(same, same, || Ok(episode(scale)))
                .expect("played")
        };
        assert!(near(0.2) > near(0.5), "{:?} {:?}", near(0.2), near(0.5));
        assert!(near(0.2) < misfit(&wanted, wanted.dense_return * 1.011));
        let mishap = |mean| {
            wanted
                .misfit(wanted.dense_return, mean, || bail!("not played"))
                .expect("it is not played")
        };
        let (better, far_better) = (
            mishap(wanted.dense_return * 1.3),
            mishap(wanted.dense_return * 2.0),
        );
        assert!(
            near(0.2) < better && better < far_better,
            "a better policy's mishap"
        );
    }
}
