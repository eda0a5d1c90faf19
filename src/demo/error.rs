//! The ways in which a file is no demonstration, or not the one that is needed.

use std::{io, path::PathBuf};

use polars::error::PolarsError;

use super::import::ImportError;
use crate::{
    env::{EnvError, EnvId},
    parquet::ParquetError,
};

/// Errors of demonstrations; the message names the file.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// The file cannot be opened or read.
    #[error("cannot read the demonstration {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The reader's error.
        source: ReadError,
    },
    /// The file cannot be written.
    #[error("cannot write the demonstration {}: {source}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The writer's error.
        source: WriteError,
    },
    /// The file is readable but not a demonstration of this environment.
    #[error("the demonstration {} does not fit {env}: {source}", path.display())]
    Misfit {
        /// The file.
        path: PathBuf,
        /// The environment.
        env: EnvId,
        /// The mismatch.
        source: Mismatch,
    },
    /// The demonstration has no poses.
    #[error("cannot replay the demonstration {}: without the columns `qpos` and `qvel` there is no state to start from", .0.display())]
    NoPoses(PathBuf),
    /// The environment failed while it was replayed.
    #[error("cannot replay the demonstration {}: {source}", path.display())]
    Environment {
        /// The file.
        path: PathBuf,
        /// The environment's error.
        source: EnvError,
    },
}

/// Errors of reading a demonstration.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It cannot be opened, or is larger than what is read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It is no Parquet, or a column is missing or of another type.
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    /// Another program's file cannot be read.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// Its columns do not make a demonstration.
    #[error(transparent)]
    Flaw(#[from] Flaw),
}

/// Errors of writing a demonstration.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The folder or the disk refuses.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The columns cannot be encoded.
    #[error(transparent)]
    Encoding(#[from] PolarsError),
    /// It is no demonstration.
    #[error(transparent)]
    Flaw(#[from] Flaw),
}

/// The ways in which steps are no demonstration.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Flaw {
    /// There are none.
    #[error("it has no steps")]
    NoSteps,
    /// A quantity has not one entry for each step.
    #[error("{quantity} has {found} entries for {steps} observations")]
    Entries {
        /// The quantity.
        quantity: &'static str,
        /// The number of its entries.
        found: usize,
        /// The number of steps.
        steps: usize,
    },
    /// Observations or actions have the length 0.
    #[error("an observation or an action has no numbers")]
    NoNumbers,
    /// A number is NaN or infinite.
    #[error("its {0} column holds a number that is not finite")]
    NotFinite(&'static str),
    /// Poses have several lengths.
    #[error("its poses differ in length")]
    UnequalPoses,
    /// The episodes do not follow each other from the first step to the last.
    #[error("its episodes do not start at step 0 and then one after another")]
    Starts,
    /// An episode has no steps.
    #[error("an episode starts after the last step")]
    StartsAfterLast,
    /// An episode goes on after its end.
    #[error("row {row} ends its episode, but row {} continues it", row + 1)]
    GoesOn {
        /// The row that ends the episode.
        row: usize,
    },
    /// An episode comes after one of a higher number.
    #[error(
        "episode {episode} comes after episode {before} in row {row}; episodes must be whole and in order"
    )]
    TornEpisode {
        /// The row.
        row: usize,
        /// Its episode.
        episode: i64,
        /// The episode of the row before.
        before: i64,
    },
    /// A step does not follow the one before.
    #[error("row {row} is step {step} of episode {episode}; expected step {expected}")]
    OutOfStep {
        /// The row.
        row: usize,
        /// Its episode.
        episode: i64,
        /// Its step.
        step: i64,
        /// The step that would follow.
        expected: i64,
    },
}

/// The ways in which a demonstration is another environment's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Mismatch {
    /// The file names another environment.
    #[error("the file says that it is from {}", .0.escape_debug())]
    Label(String),
    /// An observation, action or pose has another length.
    #[error(
        "{quantity} has {found} numbers; {needed} are needed{}",
        in_brackets(version)
    )]
    Length {
        /// The quantity.
        quantity: &'static str,
        /// Its length.
        found: usize,
        /// The length that the environment needs.
        needed: usize,
        /// How another version of the environment differs that has this length.
        version: Option<&'static str>,
    },
    /// The observations change as another robot's.
    #[error("its observations move like those of {0}")]
    Motion(EnvId),
    /// An episode is longer than any.
    #[error(
        "episode {episode} has {steps} steps, and at most {limit} are possible; the file does not say where its episodes end, or does so under an unknown name"
    )]
    TooLong {
        /// The episode, from 0.
        episode: usize,
        /// Its length, steps.
        steps: usize,
        /// The environment's time limit, steps.
        limit: u64,
    },
}

fn in_brackets(remark: &Option<&str>) -> String {
    remark.map_or_else(String::new, |remark| format!(" ({remark})"))
}
