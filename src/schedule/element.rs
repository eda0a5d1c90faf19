//! An element of a submission: a small campaign of its own, wherever a cluster starts it.
//!
//! Its job comes from the frozen plan. Nobody listens to it, so its messages go to the runs' own
//! files and to the cluster's log. Each run is a process of its own below it, so that a run that
//! dies is recorded with its cause, whatever killed it.

use std::{
    env, io,
    path::{Path, PathBuf},
};

use super::{
    campaign::{Options, Summary},
    local, preflight,
    progress::Style,
    state::{Planned, unfinished},
    stop::StopRequest,
    submission::Submission,
};
use crate::record::RecordError;

/// Why an element could not begin.
#[derive(Debug, thiserror::Error)]
pub enum ElementError {
    /// Its plan cannot be used.
    #[error(transparent)]
    Plan(#[from] RecordError),
    /// The folder where paths start does not exist on this machine.
    #[error("cannot go to {}, where the plan's paths start: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The runs cannot be prepared.
    #[error(transparent)]
    Preflight(#[from] preflight::Problems),
    /// No process can be started.
    #[error("cannot set up: {0}")]
    SetUp(#[from] io::Error),
}

/// The outcome of an element.
#[derive(Debug)]
pub struct Ended {
    /// The outcome of the runs that were due.
    pub summary: Summary,
    /// Whether any of them made progress.
    pub is_farther: bool,
}

/// Continues the unfinished runs of the element `index` of `plan`.
///
/// # Errors
///
/// The element cannot begin.
pub fn run(plan: &Path, index: usize, stop: &StopRequest) -> Result<Ended, ElementError> {
    let (submission, planned) = Submission::element(plan, index)?;
    // Relative paths start in this folder. If it is missing, they must not be looked up wherever
    // the cluster starts programs.
    env::set_current_dir(&submission.folder).map_err(|source| ElementError::Folder {
        folder: PathBuf::from(&submission.folder),
        source,
    })?;
    let states = preflight::prepare(&planned, submission.results.as_ref(), false)?;
    let due: Vec<Planned> = unfinished(&planned, &states)
        .map(|(run, _)| run.clone())
        .collect();
    let before = steps_done(&due);
    let options = Options {
        retries: submission.retries,
        verbose: submission.verbose,
        ..Options::new(cores().unwrap_or(submission.cpus))
    };
    let results = submission.results.as_ref();
    let summary = local::run_unknown(&due, results, options, Style::choose(false), stop)?;
    Ok(Ended {
        is_farther: steps_done(&due) > before,
        summary,
    })
}

/// The cores that the cluster gave this element; absent where it does not say.
fn cores() -> Option<usize> {
    env::var("SLURM_CPUS_PER_TASK")
        .ok()?
        .parse()
        .ok()
        .filter(|&cores| cores > 0)
}

fn steps_done(runs: &[Planned]) -> u64 {
    runs.iter()
        .filter_map(|run| Some(run.state().ok()?.steps_done()))
        .sum()
}
