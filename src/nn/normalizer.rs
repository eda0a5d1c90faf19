//! The running normaliser of observations (Welford, 1962).

use serde::{Deserialize, Serialize};

/// Running mean and variance of observations; normalised observations are clipped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Normalizer {
    count: f64,
    mean: Vec<f64>,
    /// Sum of squared deviations from the mean.
    deviations: Vec<f64>,
    clip: f64,
}

impl Normalizer {
    /// A normaliser of observations of `dim` numbers that has seen none: until it has seen two, it only clips.
    /// Normalised numbers are clipped to `[-clip, clip]`.
    pub fn new(dim: usize, clip: f64) -> Self {
        Self { count: 0.0, mean: vec![0.0; dim], deviations: vec![0.0; dim], clip }
    }

    /// Takes one raw observation (`[dim]`) into account.
    pub fn update(&mut self, observation: &[f64]) {
        let _ = observation;
        todo!()
    }

    /// Writes the normalised observation (`[dim]`).
    pub fn normalize(&self, observation: &[f64], normalized: &mut [f32]) {
        let _ = (observation, normalized, self.clip, &self.deviations, self.count);
        todo!()
    }

    /// The mean of what was seen `[dim]`.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The standard deviation of what was seen `[dim]`; ones before two observations.
    pub fn std(&self) -> Vec<f64> {
        todo!()
    }

    /// How many observations were seen.
    pub fn count(&self) -> u64 {
        self.count as u64
    }

    /// The bound of a normalised number.
    pub fn clip(&self) -> f64 {
        self.clip
    }
}
