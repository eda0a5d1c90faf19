//! The ways in which a pickle does not hold trajectories as the authors' code writes them.

use crate::demo::import::{MAX_NUMBERS, pickle::PickleError};

/// Errors of reading trajectories; the message tells the episode and step.
#[derive(Debug, thiserror::Error)]
pub enum TrajectoryError {
    /// The pickle cannot be read.
    #[error(transparent)]
    Pickle(#[from] PickleError),
    /// There are no episodes.
    #[error("the pickle has no list `trajectory`")]
    NoEpisodes,
    /// An episode is not a list of steps.
    #[error("episode {0} of the pickle's `trajectory` is not a list")]
    Episode(usize),
    /// A step has no names.
    #[error("step {step} of episode {episode} in the pickle is not a dictionary")]
    Step {
        /// The step.
        step: usize,
        /// Its episode.
        episode: usize,
    },
    /// A step lacks its state or action.
    #[error("step {step} of episode {episode} has no array of numbers `{key}`")]
    NoNumbers {
        /// The name of the state or action.
        key: &'static str,
        /// The step.
        step: usize,
        /// Its episode.
        episode: usize,
    },
    /// States or actions have several lengths.
    #[error("`{key}` in step {step} of episode {episode} has {found} numbers; {before} before")]
    Length {
        /// The name of the state or action.
        key: &'static str,
        /// The step.
        step: usize,
        /// Its episode.
        episode: usize,
        /// Its length.
        found: usize,
        /// The length in the steps before.
        before: usize,
    },
    /// The steps share objects so often that they are more than is read.
    #[error("the pickle's steps unpack to more than {MAX_NUMBERS} numbers")]
    TooManyNumbers,
    /// The filter lacks a statistic.
    #[error("the pickle's filter has no numbers `{0}`")]
    NoStatistic(&'static str),
    /// A statistic of the filter has another length than the states.
    #[error("`{key}` of the pickle's filter has {found} numbers for states of {needed}")]
    Statistic {
        /// The statistic's name.
        key: &'static str,
        /// Its length.
        found: usize,
        /// The states' length.
        needed: usize,
    },
    /// The filter has not counted enough states for a deviation.
    #[error("the pickle's filter has no count `zfilter n_step` above 1")]
    NoCount,
}
