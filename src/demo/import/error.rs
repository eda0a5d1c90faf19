//! The ways in which another program's file is no demonstration.

use std::io;

use super::{
    MAX_NUMBERS, MAX_UNFOLDED, assemble::MAX_STEPS, npz::NpzError, rlframe::TrajectoryError,
};
use crate::parquet::ParquetError;

/// Errors of reading another program's file.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// Its first bytes are none of a known kind's.
    #[error("it is not a pickle (bzip2-compressed or not), Parquet or .npz")]
    UnknownKind,
    /// Its compression is damaged, or a bomb.
    #[error("its bzip2 compression is damaged: {0}")]
    Bzip2(#[source] UnfoldError),
    /// It is a pickle, but does not hold the authors' trajectories.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// It begins as Parquet, and is none.
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    /// It begins as an archive, and is none.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// Its arrays do not make a demonstration.
    #[error(transparent)]
    Arrays(#[from] ArraysError),
    /// The same of an archive, whose members are told.
    #[error("{source} (the archive holds {})", members.join(", "))]
    ArchivedArrays {
        /// The fault in the arrays.
        source: ArraysError,
        /// The names of all arrays.
        members: Vec<String>,
    },
}

/// Errors of undoing a compression.
#[derive(Debug, thiserror::Error)]
pub enum UnfoldError {
    /// The compressed bytes are damaged.
    #[error(transparent)]
    Damaged(#[from] io::Error),
    /// They unpack to more than is read.
    #[error("it unpacks to more than {} MiB", MAX_UNFOLDED >> 20)]
    TooLarge,
}

/// Errors of arrays that should make a demonstration; the message names the array.
#[derive(Debug, thiserror::Error)]
pub enum ArraysError {
    /// A column of a Parquet file cannot be read.
    #[error(transparent)]
    Column(#[from] ParquetError),
    /// A member of an archive cannot be read.
    #[error(transparent)]
    Member(#[from] NpzError),
    /// An array that marks episodes contradicts the others.
    #[error(transparent)]
    Episodes(#[from] EpisodesError),
    /// An array is missing.
    #[error("it has none of {}", .0.join(", "))]
    NoneOf(Vec<&'static str>),
    /// There are no actions.
    #[error("it has no steps")]
    NoSteps,
    /// There are more steps than are read.
    #[error("it has {0} steps; at most {MAX_STEPS} are read")]
    TooManySteps(usize),
    /// There are more numbers than are read.
    #[error("it holds more than {MAX_NUMBERS} numbers")]
    TooManyNumbers,
    /// An array has not one number for each step.
    #[error("`{name}` has {found} numbers for {steps} actions")]
    Numbers {
        /// The array's name.
        name: &'static str,
        /// The count of its numbers.
        found: usize,
        /// The number of steps.
        steps: usize,
    },
    /// An array has neither a row for each step, nor one more for each episode.
    #[error("`{name}` has {found} rows for {steps} actions in {}", counted(*episodes))]
    Rows {
        /// The array's name.
        name: &'static str,
        /// The number of its rows.
        found: usize,
        /// The number of steps.
        steps: usize,
        /// The number of episodes.
        episodes: usize,
    },
}

fn counted(episodes: usize) -> String {
    match episodes {
        1 => "1 episode".to_owned(),
        _ => format!("{episodes} episodes"),
    }
}

/// Errors of what an array says about episodes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EpisodesError {
    /// Places of episodes' first steps are no rising rows.
    #[error("its `{0}` do not rise within its actions")]
    Disorder(&'static str),
    /// Steps of one episode are apart.
    #[error("`{name}` {number} appears again in row {row}; an episode's steps must be together")]
    Apart {
        /// The array's name.
        name: &'static str,
        /// The number of the episode.
        number: f64,
        /// The row in which it appears again.
        row: usize,
    },
    /// The place of a step in its episode is no number.
    #[error("`{name}` is {step} in row {row}")]
    NoStep {
        /// The array's name.
        name: &'static str,
        /// The entry.
        step: f64,
        /// Its row.
        row: usize,
    },
    /// A step neither follows the one before nor begins an episode.
    #[error("`{name}` is {step} in row {row}; expected {next}, or {first} again")]
    OutOfStep {
        /// The array's name.
        name: &'static str,
        /// The entry.
        step: f64,
        /// Its row.
        row: usize,
        /// The entry that would follow the row before.
        next: f64,
        /// The entry at the beginning of an episode.
        first: f64,
    },
    /// An array of flags has not one for each step.
    #[error("`{name}` has {found} rows for {steps} actions")]
    Flags {
        /// The array's name.
        name: &'static str,
        /// The number of its flags.
        found: usize,
        /// The number of steps.
        steps: usize,
    },
    /// Two arrays contradict each other.
    #[error("`{one}` begins an episode in row {row}, where `{other}` does not")]
    Contradiction {
        /// The array that begins an episode.
        one: &'static str,
        /// The array that does not.
        other: &'static str,
        /// The row.
        row: usize,
    },
    /// There is not one return for each episode.
    #[error("`{name}` says {told} episodes, but the arrays hold {found}")]
    Returns {
        /// The array's name.
        name: &'static str,
        /// The number of returns.
        told: usize,
        /// The number of episodes.
        found: usize,
    },
}
