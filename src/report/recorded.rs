//! The runs of an experiment as they lie on the disk.
//!
//! Owns what the report takes from the recorded files: final and intermediate returns, and the numeric columns of progress.
//! Knows nothing of figures or tables. Start at [`load`].

use std::{collections::BTreeMap, fs::File, path::Path};

use polars::prelude::{DataType, ParquetReader, PolarsResult, SerReader};

use crate::{
    plan::{self, RunSpec},
    record::{Demonstrated, Manifest, Outcome, RecordError, RunPaths, Stamp, rows},
};

/// What `plan`, one experiment's runs, left under the folder `results`. Progress is read only if it is asked for.
///
/// A run that has ended comes with the specification that was recorded, since the one of today may have another budget.
///
/// Errors: a file of an ended run cannot be read, or is not what its name says.
pub fn load(plan: &[RunSpec], results: &Path, progress: bool) -> Result<Vec<Run>, RecordError> {
    plan.iter().map(|spec| load_run(spec, results, progress)).collect()
}

fn load_run(planned: &RunSpec, results: &Path, progress: bool) -> Result<Run, RecordError> {
    let paths = RunPaths::new(results, &planned.experiment, &planned.id)?;
    let Some(manifest) = paths.ended()? else {
        return Ok(Run { spec: planned.clone(), state: State::Missing });
    };
    let spec = recorded_spec(&manifest, &paths)?;
    let state = match manifest.outcome {
        Outcome::Begun => State::Missing,
        Outcome::Failed { error, .. } => State::Failed { error },
        Outcome::Finished => {
            let episodes = rows::read_evaluations(&RunPaths::evaluations(&paths.complete))?;
            let evaluations = episodes.iter().map(|episode| Evaluation {
                env_steps: episode.env_steps,
                last: episode.last,
                dense_return: episode.dense_return,
            });
            let file = RunPaths::progress(&paths.complete);
            let progress = if progress { numbers(&file)? } else { BTreeMap::new() };
            let Stamp { demonstration, demonstrated, .. } = manifest.stamp;
            State::Finished(Recording { evaluations: evaluations.collect(), progress, demonstration, demonstrated })
        }
    };
    Ok(Run { spec, state })
}

fn recorded_spec(manifest: &Manifest, paths: &RunPaths) -> Result<RunSpec, RecordError> {
    plan::recorded(&manifest.stamp.spec).map_err(|error| RecordError::Malformed {
        path: RunPaths::manifest(&paths.complete),
        expected: "the manifest of a run that this program can read",
        reason: error.to_string(),
    })
}

/// Every numeric column of a Parquet file, whatever its name, so that a figure can draw it.
fn numbers(path: &Path) -> Result<BTreeMap<String, Vec<Option<f64>>>, RecordError> {
    let file = File::open(path).map_err(|source| RecordError::Io { action: "read", path: path.to_owned(), source })?;
    let columns = || -> PolarsResult<_> {
        let frame = ParquetReader::new(file).finish()?;
        let numeric = frame.columns().iter().filter(|column| column.dtype().is_primitive_numeric());
        numeric
            .map(|column| {
                let cells = column.cast(&DataType::Float64)?.f64()?.iter().collect();
                Ok((column.name().to_string(), cells))
            })
            .collect()
    };
    columns().map_err(|error| RecordError::Malformed {
        path: path.to_owned(),
        expected: "a Parquet file of progress",
        reason: error.to_string(),
    })
}

/// One run of the plan, and what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// What it was to be.
    pub spec: RunSpec,
    /// What became of it.
    pub state: State,
}

/// What became of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    /// It has not ended.
    Missing,
    /// It ended in an error.
    Failed {
        /// The cause, in a sentence.
        error: String,
    },
    /// It used its budget.
    Finished(Recording),
}

/// What a finished run recorded.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// The evaluation episodes.
    pub evaluations: Vec<Evaluation>,
    /// The numeric columns of `progress.parquet`, one entry an iteration; a null is `None`.
    pub progress: BTreeMap<String, Vec<Option<f64>>>,
    /// The digest of the demonstration that it learned from; absent for an algorithm without one.
    pub demonstration: Option<String>,
    /// What that demonstration holds; absent for an algorithm without one, and where an older program recorded the run.
    pub demonstrated: Option<Demonstrated>,
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

impl Run {
    /// What it recorded, if it finished.
    pub fn recording(&self) -> Option<&Recording> {
        match &self.state {
            State::Finished(recording) => Some(recording),
            State::Missing | State::Failed { .. } => None,
        }
    }
}

/// The mean return of the demonstration that the finished ones of `runs` learned from, as far as they learn from one; `None`
/// where they learned from several, or none recorded it.
pub fn demonstrated_return(runs: &[&Run]) -> Option<f64> {
    let learners = runs.iter().filter(|run| run.spec.demonstration.is_some());
    let recordings: Vec<&Recording> = learners.filter_map(|run| run.recording()).collect();
    let one = recordings.first()?.demonstration.as_ref()?;
    if recordings.iter().any(|recording| recording.demonstration.as_ref() != Some(one)) {
        return None;
    }
    recordings.iter().find_map(|recording| recording.demonstrated.as_ref()?.mean_return)
}

impl Recording {
    /// Dense returns of the episodes at the end of training.
    pub fn final_returns(&self) -> Vec<f64> {
        self.evaluations.iter().filter(|episode| episode.last).map(|episode| episode.dense_return).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    #[test]
    fn a_damaged_file_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let run = fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])]).progress("kl", &[(10, 0.5)]);
        fixture::record(&run, folder.path());
        let paths = RunPaths::new(folder.path(), &run.spec.experiment, &run.spec.id).expect("a good id");
        std::fs::write(RunPaths::progress(&paths.complete), "not Parquet").expect("written");
        let error = load(std::slice::from_ref(&run.spec), folder.path(), true).expect_err("damaged");
        assert!(error.to_string().contains("progress.parquet"), "{error}");
        assert!(load(&[run.spec], folder.path(), false).is_ok(), "progress was not asked for");
    }

    #[test]
    fn a_demonstrations_return_is_told_where_all_that_learned_from_one_learned_from_the_same() {
        let finished = |seed, digest, mean_return| {
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, seed).finished(&[(100, &[1.0])]).demonstrated(digest, mean_return)
        };
        let one = finished(0, Some("a"), Some(974.5));
        let told = |other: Run| demonstrated_return(&[&one, &other]);
        assert_eq!(told(finished(1, Some("b"), Some(974.5))), None, "another demonstration");
        assert_eq!(told(finished(1, None, None)), None, "it may have been another");
        assert_eq!(told(finished(1, Some("a"), None)), Some(974.5), "an older program's record of the same");
        assert_eq!(told(fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])])), Some(974.5), "PPO has none");
        assert_eq!(told(fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 1)), Some(974.5), "nothing is recorded");
        assert_eq!(demonstrated_return(&[&finished(0, Some("a"), None)]), None, "no rewards, or an older program");
        assert_eq!(demonstrated_return(&[&fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])])]), None);
    }

    #[test]
    fn runs_come_back_as_they_were_recorded() {
        let folder = tempfile::tempdir().expect("a folder");
        let finished = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0)
            .finished(&[(50, &[1.0, 2.0]), (100, &[3.0])])
            .progress("mmd", &[(10, 0.5), (20, 0.25)])
            .demonstrated(Some("a"), Some(974.5));
        let failed = fixture::ppo("Hopper-v2", 1).failed("training diverged");
        let missing = fixture::ppo("Hopper-v2", 2);
        fixture::record(&finished, folder.path());
        fixture::record(&failed, folder.path());
        let plan = [&finished, &failed, &missing].map(|run| run.spec.clone());
        let runs = load(&plan, folder.path(), true).expect("readable");
        assert_eq!(runs[1..], [failed, missing]);
        let (read, written) = (runs[0].recording().expect("finished"), finished.recording().expect("finished"));
        assert_eq!(read.evaluations, written.evaluations);
        assert_eq!((&read.demonstration, &read.demonstrated), (&written.demonstration, &written.demonstrated));
        assert_eq!(read.progress["mmd"], written.progress["mmd"]);
        assert_eq!(read.progress["env_steps"], written.progress["env_steps"]);
        assert_eq!(read.progress["kl"], [None, None]);
        assert!(!read.progress.contains_key("case"), "text is no number");
    }

    #[test]
    fn the_recorded_budget_counts_not_the_planned_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let run = fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])]);
        fixture::record(&run, folder.path());
        let runs = load(&[run.budget(999).spec], folder.path(), false).expect("readable");
        assert_eq!(runs[0].spec.budget.env_steps.get(), 100);
    }
}
