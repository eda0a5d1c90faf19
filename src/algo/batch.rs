//! A batch of experience: what one rollout of several environments leaves for an update.

use std::ops::Range;

use nalgebra::DMatrix;

/// `n` samples, environment by environment, each environment's in the order of time.
#[derive(Debug, Clone)]
pub struct Batch {
    /// Normalised observations as the policy saw them `[observation_dim x n]`.
    pub observations: DMatrix<f32>,
    /// The same observations as the environments gave them `[observation_dim x n]`.
    pub raw_observations: DMatrix<f64>,
    /// The policy's mean actions `[action_dim x n]`; the same bits as its forward pass on
    /// `observations` gives.
    pub means: DMatrix<f32>,
    /// Actions as sampled around them, unclamped `[action_dim x n]`.
    pub actions: DMatrix<f32>,
    /// The rewards that are trained on `[n]`.
    pub rewards: Vec<f64>,
    /// Pieces of episodes that cover all samples in order.
    pub segments: Vec<Segment>,
}

/// A piece of one episode, contiguous in the batch.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Its samples.
    pub range: Range<usize>,
    /// How the episode goes on after its last sample.
    pub end: SegmentEnd,
}

/// How an episode goes on after a segment of it.
#[derive(Debug, Clone, PartialEq)]
pub enum SegmentEnd {
    /// It does not: the episode terminated, and its return is complete.
    Terminated,
    /// It would go on, but the time limit or the rollout's end cut it: the value of the next state
    /// stands in for the rest.
    Bootstrapped {
        /// The normalised observation after the last action `[observation_dim]`.
        last_observation: Vec<f32>,
    },
}

impl Batch {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.rewards.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.rewards.is_empty()
    }
}
