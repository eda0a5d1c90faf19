//! Slurm, through its own commands: submits jobs, asks about their states, and cancels them.
//!
//! No process of ours stays running. Slurm's answers are hints: the runs' own files hold their
//! outcome. Names of files and folders reach Slurm only as arguments of their own, and scripts only
//! between quotes. Start at [`sbatch`] and [`queue`].

pub mod jobs;
pub mod places;
pub mod program;
pub mod queue;
pub mod script;

use std::{
    ffi::{OsStr, OsString},
    io,
    process::{Command, Output},
};

/// Errors of Slurm's commands.
#[derive(Debug, thiserror::Error)]
pub enum SlurmError {
    /// The command cannot be started.
    #[error("cannot start {program}: {source}; is this a machine of the cluster?")]
    Missing {
        /// The command.
        program: &'static str,
        /// The system's error.
        source: io::Error,
    },
    /// Slurm refused.
    #[error("{program}: {said}")]
    Refused {
        /// The command.
        program: &'static str,
        /// Slurm's message.
        said: String,
    },
}

/// The number of array indices where the cluster does not say (Slurm's default of `MaxArraySize`).
const MAX_ARRAY_SIZE: usize = 1001;

/// Runs `program`; returns what it writes to stdout.
fn call<S: AsRef<OsStr>>(program: &'static str, arguments: &[S]) -> Result<String, SlurmError> {
    let Output {
        status,
        stdout,
        stderr,
    } = Command::new(program)
        .args(arguments)
        .output()
        .map_err(|source| SlurmError::Missing { program, source })?;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    let own = format!("{program}: error: ");
    let said = String::from_utf8_lossy(&stderr);
    let said = said
        .lines()
        .map(|line| line.trim_start_matches(&own))
        .collect::<Vec<_>>()
        .join("; ");
    let said = if said.is_empty() {
        status.to_string()
    } else {
        said
    };
    Err(SlurmError::Refused { program, said })
}

/// Submits a script, and returns the number of its job.
///
/// # Errors
///
/// Slurm is not there, or refuses.
pub fn sbatch(arguments: &[OsString]) -> Result<String, SlurmError> {
    let said = call("sbatch", arguments)?;
    // JOB or JOB;CLUSTER
    let job = said.trim().split(';').next().unwrap_or_default().to_owned();
    match !job.is_empty() && job.bytes().all(|c| c.is_ascii_digit()) {
        true => Ok(job),
        false => Err(SlurmError::Refused {
            program: "sbatch",
            said: format!("it gave no job's number: {}", said.trim()),
        }),
    }
}

/// Cancels jobs, or elements of them (`12_3`).
///
/// # Errors
///
/// Slurm is not there, or refuses.
pub fn scancel(jobs: &[String]) -> Result<(), SlurmError> {
    // The jobs are split up, since the length of a command line is limited.
    jobs.chunks(1000)
        .try_for_each(|jobs| call("scancel", jobs).map(drop))
}

/// Lets an element of a job be started again from its beginning.
///
/// # Errors
///
/// Slurm is not there, or refuses.
pub fn requeue(element: &str) -> Result<(), SlurmError> {
    call("scontrol", &["requeue", element]).map(drop)
}

/// The most elements that one array may have: the cluster's limit, or otherwise Slurm's default.
pub fn most_elements() -> usize {
    let config = call("scontrol", &["show", "config"]).unwrap_or_default();
    let value = config
        .lines()
        .find_map(|line| line.trim().strip_prefix("MaxArraySize")?.split_once('='));
    // The greatest index is one less than `MaxArraySize`.
    value
        .and_then(|(_, size)| size.trim().parse().ok())
        .filter(|&size| size > 0)
        .unwrap_or(MAX_ARRAY_SIZE)
}
