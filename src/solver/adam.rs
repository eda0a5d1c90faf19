//! Adam (Kingma and Ba, 2015), with L2 penalty in the gradient as in the paper's Table 1.

use serde::{Deserialize, Serialize};

/// The optimiser's moments, for one vector of parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    first: Vec<f32>,
    second: Vec<f32>,
    steps: u64,
}

impl Adam {
    /// Zero moments for `dim` parameters.
    pub fn new(dim: usize) -> Self {
        Self { first: vec![0.0; dim], second: vec![0.0; dim], steps: 0 }
    }

    /// Takes one step down `gradient` (`[dim]`) with step size `learning_rate` (0.9, 0.999, epsilon 1e-8).
    pub fn step(&mut self, parameters: &mut [f32], gradient: &[f32], learning_rate: f64) {
        let _ = (parameters, gradient, learning_rate);
        todo!()
    }
}
