//! Verification: replay the actions from each episode's first state and compare.

use std::path::Path;

use super::{DemoError, Demonstration};
use crate::env::EnvId;

/// The greatest deviations of a replay from the demonstration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Of an observation's number.
    pub observation: f64,
    /// Of a reward.
    pub reward: f64,
    /// Steps whose end differs.
    pub ends: usize,
}

/// Replays `demonstration` in `env`, and gives the greatest deviations.
///
/// Errors: shapes do not fit `env` (the message names `path`), or no pose was recorded.
pub fn verify(demonstration: &Demonstration, path: &Path, env: EnvId) -> Result<Deviation, DemoError> {
    let _ = (demonstration, path, env);
    todo!()
}
