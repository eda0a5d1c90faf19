//! Slurm, by its own commands: what is submitted, what it says of it, and how it is cancelled.
//!
//! Nothing of ours stays running, and Slurm's word is a hint: the runs' own files say what has
//! become of them. Everything that a file or a folder is called reaches Slurm as an argument of its
//! own, and a script only between quotes. Start at
//! [`sbatch`] and [`queue`].

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

/// Why Slurm did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum SlurmError {
    /// Its commands are not there.
    #[error("cannot start {program}: {source}; is this a machine of the cluster?")]
    Missing {
        /// The command.
        program: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// It refused.
    #[error("{program}: {said}")]
    Refused {
        /// The command.
        program: &'static str,
        /// What it said.
        said: String,
    },
}

/// The array indices of a cluster that does not say (Slurm's default of `MaxArraySize`).
const MAX_ARRAY_SIZE: usize = 1001;

/// What `program` writes to stdout.
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

/// Submits a script, and gives the number of its job.
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
    // A command line holds only so much.
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

/// How many elements one array may have: the cluster's, or else Slurm's default.
pub fn most_elements() -> usize {
    let config = call("scontrol", &["show", "config"]).unwrap_or_default();
    let value = config
        .lines()
        .find_map(|line| line.trim().strip_prefix("MaxArraySize")?.split_once('='));
    // The greatest index is one less.
    value
        .and_then(|(_, size)| size.trim().parse().ok())
        .filter(|&size| size > 0)
        .unwrap_or(MAX_ARRAY_SIZE)
}
