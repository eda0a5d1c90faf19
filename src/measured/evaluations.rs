//! `evaluations.parquet`: one row per evaluation episode.

use serde::{Deserialize, Serialize};

use super::{Cell, Column, Field, Role, columns};

/// One evaluation episode.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct EvaluationEpisode {
    /// [`ENV_STEPS`].
    pub env_steps: u64,
    /// [`LAST`].
    pub last: bool,
    /// [`EPISODE`].
    pub episode: u64,
    /// [`DENSE_RETURN`].
    pub dense_return: f64,
    /// [`TRAINING_RETURN`].
    pub training_return: f64,
    /// [`LENGTH`].
    pub length: u64,
}

columns! { EvaluationEpisode;
    ENV_STEPS "env_steps" Whole = env_steps, Position, "environment steps", "",
        "Environment steps of training behind the policy";
    LAST "last" Truth = last, Position, "", "",
        "Whether the episode belongs to the evaluation at the end of training";
    EPISODE "episode" Whole = episode, Position, "", "",
        "Counted from 0 within the evaluation";
    DENSE_RETURN "dense_return" Number = dense_return, Measured, "return", "dense reward",
        "Return in the dense reward";
    TRAINING_RETURN "training_return" Number = training_return, Measured,
        "return", "training reward",
        "Return in the reward that is trained on";
    LENGTH "length" Whole = length, Measured, "episode length", "steps",
        "Length of the episode";
}
