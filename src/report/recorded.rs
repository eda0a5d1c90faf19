//! The runs of an experiment as they lie on the disk.
//!
//! Owns what the report takes from the recorded files: final and intermediate returns, and the
//! numeric columns of progress. A run whose files are damaged, or whose final return is not a
//! number, counts as failed. Of a run under way, it takes what the last checkpoint holds. Knows
//! nothing of figures or tables, nor of which runs may be averaged, which is `comparable`'s. Start
//! at [`load`].

use std::{cell::OnceCell, collections::BTreeSet, path::Path};

use super::comparable;
use crate::{
    measured::{Column, Iteration},
    plan::{self, RunSpec, Selection, Values},
    record::{
        Demonstrated, Git, Manifest, Outcome, RecordError, RunPaths, Stamp, UnderWay, rows,
        rows::Numbers,
    },
    spec::Key,
};

/// The runs of a plan, as far as they are recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// One entry per planned run, in the plan's order.
    pub runs: Vec<Run>,
    /// Remarks for a reader that concern all runs, a sentence each.
    pub remarks: Vec<String>,
}

/// The columns of progress that are asked for.
pub type Columns<'a> = &'a [&'static Column<Iteration>];

/// Loads the records of `plan`, one experiment's runs, from the folder `results`. Only `columns` of
/// the progress are read.
///
/// A run recorded under another specification than the plan's becomes [`State::Differs`]. A run
/// with a file that cannot be read counts as failed.
///
/// # Errors
///
/// A run's id leads out of the folder.
pub fn load(plan: &[RunSpec], results: &Path, columns: Columns<'_>) -> Result<Loaded, RecordError> {
    let (mut runs, mut remarks) = (Vec::with_capacity(plan.len()), Vec::new());
    for planned in plan {
        let paths = RunPaths::new(results, &planned.experiment, &planned.id)?;
        let run = load_run(planned, &paths, columns);
        let mut run = run.unwrap_or_else(|error| {
            Run::new(
                planned.clone(),
                State::Failed {
                    error: error.to_string(),
                },
            )
        });
        if run.state == State::Missing {
            match under_way(planned, &paths, columns) {
                Ok(so_far) => run.under_way = so_far,
                Err(error) => remarks.push(format!(
                    "{} is under way and cannot be drawn: {error}",
                    planned.id
                )),
            }
        }
        runs.push(run);
    }
    remarks.extend(comparable::tell_apart(plan, &mut runs));
    Ok(Loaded { runs, remarks })
}

fn load_run(planned: &RunSpec, paths: &RunPaths, columns: Columns<'_>) -> Result<Run, RecordError> {
    let Some(manifest) = paths.ended()? else {
        return Ok(Run::new(planned.clone(), State::Missing));
    };
    let trace = Trace::of(&manifest);
    Ok(Run {
        trace: Some(trace),
        ..ended(planned, paths, manifest, columns)?
    })
}

/// The planned run with the state that its `manifest` tells.
fn ended(
    planned: &RunSpec,
    paths: &RunPaths,
    manifest: Manifest,
    columns: Columns<'_>,
) -> Result<Run, RecordError> {
    let as_planned = |state| Run::new(planned.clone(), state);
    let recorded = match plan::recorded(&manifest.stamp.spec) {
        Ok(recorded) => recorded,
        Err(_) => {
            return Ok(as_planned(State::Differs {
                changes: vec![comparable::FORMAT.to_owned()],
            }));
        }
    };
    let changes = comparable::changes(&recorded, planned);
    if !changes.is_empty() {
        return Ok(as_planned(State::Differs { changes }));
    }
    match &manifest.outcome {
        Outcome::Begun => Ok(as_planned(State::Missing)),
        Outcome::Failed { error, .. } => Ok(as_planned(State::Failed {
            error: error.clone(),
        })),
        Outcome::Finished => {
            let recording = match recording(manifest, paths, columns)? {
                Ok(recording) => recording,
                Err(error) => {
                    let error = error.to_string();
                    return Ok(as_planned(State::Failed { error }));
                }
            };
            // Its budget and evaluations, which do not make it another run, are reported as
            // recorded and not as planned.
            let (experiment, id, axes) = (
                planned.experiment.clone(),
                planned.id.clone(),
                planned.axes.clone(),
            );
            Ok(Run::new(
                RunSpec {
                    experiment,
                    id,
                    axes,
                    ..recorded
                },
                State::Finished(recording),
            ))
        }
    }
}

/// The progress of `planned`, which has not ended; `None` where a run of another specification is
/// under way.
///
/// # Errors
///
/// Its files are damaged or of another program.
fn under_way(
    planned: &RunSpec,
    paths: &RunPaths,
    columns: Columns<'_>,
) -> Result<Option<SoFar>, RecordError> {
    let Some(UnderWay {
        manifest,
        iterations,
        evaluations,
    }) = UnderWay::read(paths)?
    else {
        return Ok(None);
    };
    let same = plan::recorded(&manifest.stamp.spec).is_ok_and(|recorded| {
        recorded.budget == planned.budget && comparable::changes(&recorded, planned).is_empty()
    });
    let Some(last) = iterations.last().filter(|_| same) else {
        return Ok(None);
    };
    let env_steps = last.env_steps;
    let progress = Numbers::of(&iterations, columns);
    let evaluations = evaluations
        .iter()
        .map(|row| Evaluation::new(row.env_steps, row.last, row.dense_return))
        .collect();
    Ok(Some(SoFar {
        env_steps,
        recording: Recording::new(manifest.stamp, evaluations, progress),
    }))
}

/// The ways in which what a finished run recorded is no result.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
enum NoResult {
    /// A final return is NaN or infinite.
    #[error("the return of its final evaluation is {0}")]
    NotFinite(f64),
    /// No episode belongs to the evaluation at the end of training.
    #[error("it has no final evaluation")]
    NoFinalEvaluation,
}

/// The recorded results of a finished run, unless they are no result.
fn recording(
    manifest: Manifest,
    paths: &RunPaths,
    columns: Columns<'_>,
) -> Result<Result<Recording, NoResult>, RecordError> {
    manifest.check_tables(&paths.complete)?;
    let episodes = rows::read_evaluations(&RunPaths::evaluations(&paths.complete))?;
    let evaluations = episodes
        .iter()
        .map(|row| Evaluation::new(row.env_steps, row.last, row.dense_return))
        .collect();
    let progress = match columns {
        [] => Numbers::default(),
        columns => rows::read_numbers(&RunPaths::progress(&paths.complete), columns)?,
    };
    let recording = Recording::new(manifest.stamp, evaluations, progress);
    let returns = recording.final_returns();
    Ok(match returns.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(NoResult::NotFinite(*value)),
        None if returns.is_empty() => Err(NoResult::NoFinalEvaluation),
        None => Ok(recording),
    })
}

/// One run of the plan, with its state.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its specification: as recorded if it finished, and otherwise as planned.
    pub spec: RunSpec,
    /// Its state, with the results of a finished run.
    pub state: State,
    /// Its progress, where it has not ended.
    pub under_way: Option<SoFar>,
    /// The origin of its final record, where that can be read.
    pub trace: Option<Trace>,
    values: Values,
    departures: OnceCell<BTreeSet<String>>,
}

/// The state of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    /// It has not ended.
    Missing,
    /// It ended in an error.
    Failed {
        /// The cause, in a sentence.
        error: String,
    },
    /// Another specification was recorded in its place.
    Differs {
        /// The differences, as `key: recorded -> planned`.
        changes: Vec<String>,
    },
    /// It used its budget.
    Finished(Recording),
}

/// Where a run that has ended comes from, and what it left to read.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// The program's version.
    pub program: String,
    /// The commit of the folder that the program was called in, where that was a repository's.
    pub git: Option<Git>,
    /// The class of the processor, on which the last bits of results depend.
    pub cpu_class: String,
    /// The processor; absent where an older program recorded the run.
    pub cpu: Option<String>,
    /// The version of MuJoCo; absent where the environment does without.
    pub mujoco: Option<String>,
    /// Environment steps of training.
    pub env_steps: u64,
    /// Wall-clock seconds of training.
    pub seconds: f64,
    /// The last lines of the log of a run that failed.
    pub log_tail: Vec<String>,
}

impl Trace {
    fn of(manifest: &Manifest) -> Self {
        let Manifest {
            stamp,
            env_steps,
            seconds,
            outcome,
            ..
        } = manifest;
        let origin = stamp.origin.as_ref();
        let log_tail = match outcome {
            Outcome::Failed { log_tail, .. } => log_tail.clone(),
            Outcome::Begun | Outcome::Finished => Vec::new(),
        };
        Self {
            program: stamp.build.program.clone(),
            git: origin.and_then(|origin| origin.git.clone()),
            cpu_class: stamp.build.cpu_class.clone(),
            cpu: origin.map(|origin| origin.cpu.clone()),
            mujoco: stamp
                .build
                .versions
                .get("mujoco")
                .and_then(|version| version.as_str())
                .map(str::to_owned),
            env_steps: *env_steps,
            seconds: *seconds,
            log_tail,
        }
    }
}

/// The progress of a run under way, at its last checkpoint.
#[derive(Debug, Clone, PartialEq)]
pub struct SoFar {
    /// Environment steps that it has taken.
    pub env_steps: u64,
    /// Its results up to then.
    pub recording: Recording,
}

/// The recorded results of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// The evaluation episodes.
    pub evaluations: Vec<Evaluation>,
    /// The columns of `progress.parquet` that were asked for.
    pub progress: Numbers,
    /// The digest of the demonstration that it learned from; absent for an algorithm without one.
    pub demonstration: Option<String>,
    /// A description of that demonstration; absent for an algorithm without one, and where an older
    /// program recorded the run.
    pub demonstrated: Option<Demonstrated>,
    /// The versions of what computes numbers.
    pub versions: serde_json::Value,
}

/// One evaluation episode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evaluation {
    /// Environment steps of training behind the policy.
    pub env_steps: u64,
    /// Whether it belongs to the evaluation at the end of training.
    pub last: bool,
    /// Return in the dense reward.
    pub dense_return: f64,
}

impl Evaluation {
    fn new(env_steps: u64, last: bool, dense_return: f64) -> Self {
        Self {
            env_steps,
            last,
            dense_return,
        }
    }
}

impl Run {
    /// The run `spec` in `state`.
    pub fn new(spec: RunSpec, state: State) -> Self {
        let values = spec.values();
        Self {
            spec,
            state,
            under_way: None,
            trace: None,
            values,
            departures: OnceCell::new(),
        }
    }

    /// Its recorded results, if it finished.
    pub fn recording(&self) -> Option<&Recording> {
        match &self.state {
            State::Finished(recording) => Some(recording),
            State::Missing | State::Failed { .. } | State::Differs { .. } => None,
        }
    }

    /// As [`RunSpec::value`], without building its tables again.
    pub fn value(&self, key: &Key) -> Option<toml::Value> {
        self.values.get(key)
    }

    /// Whether `selection` matches the run.
    pub fn is_in(&self, selection: &Selection) -> bool {
        selection.matches_values(&self.values)
    }

    /// As [`RunSpec::departures`], computed once.
    pub fn departures(&self) -> &BTreeSet<String> {
        self.departures.get_or_init(|| self.spec.departures())
    }

    /// Whether the setting or hyperparameter `key`, in full or by its last part, is not the
    /// default.
    pub fn departs_in(&self, key: &Key) -> bool {
        let name = key.to_string();
        let is_of = |departure: &String| {
            departure
                .strip_suffix(&name)
                .is_some_and(|path| path.is_empty() || path.ends_with('.'))
        };
        self.departures().iter().any(is_of)
    }
}

/// The mean return of the demonstration that the finished ones of `runs` learned from, as far as
/// they learn from one. `None` where they learned from several, or none recorded it.
pub fn demonstrated_return(runs: &[&Run]) -> Option<f64> {
    let learners = runs.iter().filter(|run| run.spec.demonstration.is_some());
    let recordings: Vec<&Recording> = learners.filter_map(|run| run.recording()).collect();
    let one = recordings.first()?.demonstration.as_ref()?;
    if recordings
        .iter()
        .any(|recording| recording.demonstration.as_ref() != Some(one))
    {
        return None;
    }
    recordings
        .iter()
        .find_map(|recording| recording.demonstrated.as_ref()?.mean_return)
}

impl Recording {
    fn new(stamp: Stamp, evaluations: Vec<Evaluation>, progress: Numbers) -> Self {
        let Stamp {
            demonstration,
            demonstrated,
            build,
            ..
        } = stamp;
        Self {
            evaluations,
            progress,
            demonstration,
            demonstrated,
            versions: build.versions,
        }
    }

    /// Dense returns of the episodes at the end of training.
    pub fn final_returns(&self) -> Vec<f64> {
        self.evaluations
            .iter()
            .filter(|episode| episode.last)
            .map(|episode| episode.dense_return)
            .collect()
    }
}

#[cfg(test)]
mod tests;
