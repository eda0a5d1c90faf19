//! The checks before anything starts, for all runs at once.

use std::{
    collections::BTreeMap,
    fmt,
    path::{Path, PathBuf},
};

use super::state::{Planned, RunState};
use crate::{
    demo::{DemoError, Demonstration},
    env::{self, EnvId},
    plan::{RunSpec, Versions},
    record::{Build, Claim, Demonstrated, Origin, RecordError, RunPaths, Stamp, check_writable},
};

/// A reason why nothing was started.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// A demonstration is missing, damaged or of another environment.
    #[error(transparent)]
    Demonstration(#[from] DemoError),
    /// The results cannot be read or written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Two runs would be recorded in the same place.
    #[error("two different runs would be recorded as {}", .0.display())]
    SamePlace(PathBuf),
    /// The recorded run has another specification.
    #[error(
        "{} holds another run; it differs in {}; --results DIR records elsewhere, \
         --fresh sets it aside and starts again",
        folder.display(),
        keys.join(", ")
    )]
    Differs {
        /// The folder of the recorded run.
        folder: PathBuf,
        /// The keys that differ.
        keys: Vec<String>,
    },
    /// The recorded run cannot be used, or is damaged.
    #[error("{reason}; it is left untouched; --fresh sets it aside and starts again")]
    Unusable {
        /// Why it cannot be used.
        reason: String,
    },
    /// A run that would be set aside is being written.
    #[error("{} cannot be set aside: another process works on it", .0.display())]
    InUse(PathBuf),
    /// The results would not fit.
    #[error(
        "{} has {available_mib} MiB left; these runs may need {needed_mib} MiB; free some space, \
         or name another folder with --results",
        folder.display()
    )]
    NoSpace {
        /// The folder of all results.
        folder: PathBuf,
        /// The free space, MiB.
        available_mib: u64,
        /// The space that the runs may need, MiB.
        needed_mib: u64,
    },
}

/// All reasons why nothing was started; at least one.
#[derive(Debug)]
pub struct Problems(pub Vec<Problem>);

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<String> = self.0.iter().map(Problem::to_string).collect();
        f.write_str(&lines.join("\n"))
    }
}

impl std::error::Error for Problems {}

/// Gives every run its places and its fingerprint, and checks the demonstrations. Writes nothing.
///
/// # Errors
///
/// Every demonstration that cannot be used, each once; names that lead elsewhere; runs that share a
/// place.
pub fn plan(specs: Vec<RunSpec>, results: &Path) -> Result<Vec<Planned>, Problems> {
    let mut problems = Vec::new();
    let mut demonstrations = BTreeMap::new();
    for spec in &specs {
        let Some(path) = &spec.demonstration else {
            continue;
        };
        // Each demonstration is read once and reported once, however many runs learn from it.
        demonstrations
            .entry((path.clone(), spec.env))
            .or_insert_with(|| match demonstration(path, spec.env) {
                Ok(demonstration) => Some(demonstration),
                Err(error) => {
                    problems.push(Problem::Demonstration(error));
                    None
                }
            });
    }
    // The program and the call are the same for all runs, so they are looked up once.
    let build = Build::current(serde_json::Value::Null);
    let origin = Origin::current(results);
    let mut planned: Vec<Planned> = Vec::new();
    let mut places: BTreeMap<PathBuf, String> = BTreeMap::new();
    for spec in specs {
        let path = spec.demonstration.as_ref();
        let (digest, demonstrated) = path
            .and_then(|path| demonstrations.get(&(path.clone(), spec.env))?.clone())
            .unzip();
        let versions = versions(&spec);
        let stamp = Stamp {
            spec: serde_json::to_value(&spec).unwrap_or_default(),
            fingerprint: spec.fingerprint(digest.as_deref(), &versions),
            demonstration: digest,
            demonstrated,
            build: Build {
                versions: serde_json::to_value(&versions).unwrap_or_default(),
                ..build.clone()
            },
            origin: Some(origin.clone()),
        };
        match RunPaths::new(results, &spec.experiment, &spec.id) {
            Err(error) => problems.push(error.into()),
            Ok(paths) => match places.insert(paths.complete.clone(), stamp.fingerprint.clone()) {
                None => planned.push(Planned { spec, paths, stamp }),
                Some(before) if before == stamp.fingerprint => {} // named twice: one run
                Some(_) => problems.push(Problem::SamePlace(paths.complete)),
            },
        }
    }
    if problems.is_empty() {
        Ok(planned)
    } else {
        Err(Problems(problems))
    }
}

/// The versions of the components that `spec` uses.
fn versions(spec: &RunSpec) -> Versions {
    let model = spec.env.model_digest();
    Versions {
        revisions: spec.algorithm.revisions(),
        env: spec.env.revision(),
        mujoco: model.is_some().then(|| env::engine_version().to_owned()),
        model,
    }
}

/// The digest of a demonstration's file and a description of its contents, once it is known to fit.
fn demonstration(path: &Path, env: EnvId) -> Result<(String, Demonstrated), DemoError> {
    let demonstration = Demonstration::read_for(path, env)?;
    let episodes = demonstration.episode_starts.len();
    let demonstrated = Demonstrated {
        episodes,
        steps: demonstration.len(),
        mean_return: demonstration
            .returns()
            .map(|returns| returns.iter().sum::<f64>() / episodes as f64),
    };
    Ok((Demonstration::digest(path)?, demonstrated))
}

/// Prepares the results: checks that the folder is writable and has room, and that no existing
/// record stands in the way. With `fresh`, such records are set aside. Returns each run's state.
///
/// # Errors
///
/// All problems that stand in the way; then nothing was set aside.
pub fn prepare(
    planned: &[Planned],
    results: &Path,
    fresh: bool,
) -> Result<Vec<RunState>, Problems> {
    let mut problems = Vec::new();
    // Without its folder, nothing else can be looked at.
    if let Err(error) = check_writable(results) {
        return Err(Problems(vec![error.into()]));
    }
    let mut states = Vec::with_capacity(planned.len());
    let mut needed = 0;
    for run in planned {
        match run.state() {
            Err(error) => problems.push(error.into()),
            Ok(RunState::Differs { keys }) if !fresh => {
                let folder = if run.paths.complete.exists() {
                    &run.paths.complete
                } else {
                    &run.paths.partial
                };
                problems.push(Problem::Differs {
                    folder: folder.clone(),
                    keys,
                });
            }
            Ok(RunState::Unusable { reason } | RunState::Damaged { reason }) if !fresh => {
                problems.push(Problem::Unusable { reason })
            }
            Ok(state) => {
                if !matches!(state, RunState::Finished(_)) {
                    needed += bytes_needed(&run.spec);
                }
                states.push(state);
            }
        }
    }
    match fs4::available_space(results) {
        Ok(available) if available < needed => problems.push(Problem::NoSpace {
            folder: results.to_owned(),
            available_mib: available >> 20,
            needed_mib: needed.div_ceil(1 << 20),
        }),
        _ => {} // a file system that does not tell is no reason to refuse
    }
    // Nothing is set aside unless everything can start.
    if !problems.is_empty() {
        return Err(Problems(problems));
    }
    for (run, state) in planned.iter().zip(&mut states) {
        if matches!(
            state,
            RunState::Differs { .. } | RunState::Unusable { .. } | RunState::Damaged { .. }
        ) {
            set_aside(run).map_err(|problem| Problems(vec![problem]))?;
            *state = RunState::ToDo;
        }
        // A claimed run is settled by the process that holds it.
        if run.paths.is_unsettled()
            && let Ok(Some(_claim)) = Claim::take(&run.paths)
        {
            run.paths
                .settle()
                .map_err(|error| Problems(vec![error.into()]))?;
        }
    }
    Ok(states)
}

fn set_aside(run: &Planned) -> Result<(), Problem> {
    let Some(_claim) = Claim::take(&run.paths)? else {
        return Err(Problem::InUse(run.paths.partial.clone()));
    };
    run.paths.set_aside()?;
    Ok(())
}

/// The space that a run may take on the disk, bytes: its rows, and checkpoints and policies of the
/// size of its networks.
fn bytes_needed(spec: &RunSpec) -> u64 {
    let hidden: Vec<u64> = spec
        .network
        .hidden
        .iter()
        .map(|width| width.get())
        .collect();
    let inside: u64 = hidden
        .windows(2)
        .map(|pair| pair[0].saturating_mul(pair[1]))
        .sum();
    // 120: Ant's 111 observations are the most.
    let parameters = inside + 120 * hidden.iter().sum::<u64>();
    let network = 4 * parameters; // f32
    let steps = spec.budget.env_steps.get();
    let rows = 300
        * (steps / spec.rollout.steps.get()
            + steps / spec.evaluation.every.get() * spec.evaluation.episodes.get());
    let kept = spec
        .checkpoint
        .keep_policy_every
        .map_or(0, |every| steps / every.get());
    // Two networks with two moments each, in two checkpoints while one replaces the other, and in a
    // shorter run's.
    rows.saturating_add(network.saturating_mul(2 * 3 * 3))
        .saturating_add(kept.saturating_mul(2 * network))
}
