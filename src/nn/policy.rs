//! The diagonal Gaussian policy: a network's mean, and a standard deviation that does not depend on the state.

use nalgebra::{DMatrix, DMatrixView};
use serde::{Deserialize, Serialize};

use super::{Mlp, Pass};
use crate::{rng::Rng, solver::LinearOperator};

/// `pi(a|s) = N(mean(s), diag(exp(2 log_std)))`. Its parameters are the network's, then `log_std` (`[action_dim]`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GaussianPolicy {
    mean: Mlp,
    log_std: Vec<f32>,
}

impl GaussianPolicy {
    /// A policy whose mean starts near zero (output weights times 0.1) and whose standard deviation is `std`.
    pub fn new(observation_dim: usize, hidden: &[usize], action_dim: usize, std: f64, rng: &mut Rng) -> Self {
        let _ = (observation_dim, hidden, action_dim, std, rng);
        todo!()
    }

    /// The mean's network.
    pub fn mean(&self) -> &Mlp {
        &self.mean
    }

    /// The logarithms of the standard deviations `[action_dim]`.
    pub fn log_std(&self) -> &[f32] {
        &self.log_std
    }

    /// Number of parameters, `log_std` included.
    pub fn dim(&self) -> usize {
        self.mean.parameters().len() + self.log_std.len()
    }

    /// A copy of all parameters `[dim]`.
    pub fn parameters(&self) -> Vec<f32> {
        [self.mean.parameters(), &self.log_std].concat()
    }

    /// Replaces all parameters (`[dim]`).
    pub fn set_parameters(&mut self, parameters: &[f32]) {
        let (mean, log_std) = parameters.split_at(self.mean.parameters().len());
        self.mean.parameters_mut().copy_from_slice(mean);
        self.log_std.copy_from_slice(log_std);
    }

    /// Runs normalised observations (`[observation_dim x n]`) through the mean's network; the means are in
    /// [`Pass::output`].
    pub fn forward(&self, observations: &DMatrix<f32>, pass: &mut Pass) {
        self.mean.forward(observations, pass);
    }

    /// Writes `log pi(a|s)` of each column of `actions` (`[action_dim x n]`) under `means` to `densities` (`[n]`).
    pub fn log_densities(&self, means: DMatrixView<'_, f32>, actions: &DMatrix<f32>, densities: &mut [f64]) {
        let _ = (means, actions, densities);
        todo!()
    }

    /// Writes the gradient (`[dim]`) of the sum over samples of `weights[i] * log pi(a_i|s_i)`, the score function's sum.
    /// `pass` is that of the last [`forward`](GaussianPolicy::forward) on `observations`.
    pub fn score(
        &self,
        observations: &DMatrix<f32>,
        pass: &mut Pass,
        actions: &DMatrix<f32>,
        weights: &[f64],
        gradient: &mut [f32],
    ) {
        let _ = (observations, pass, actions, weights, gradient);
        todo!()
    }

    /// Writes the gradient (`[dim]`, zero in `log_std`) of the sum over samples of `cotangent . mean`.
    pub fn mean_gradient(
        &self,
        observations: &DMatrix<f32>,
        pass: &mut Pass,
        cotangent: &DMatrix<f32>,
        gradient: &mut [f32],
    ) {
        let _ = (observations, pass, cotangent, gradient);
        todo!()
    }

    /// The mean over samples of `KL(old || self)`, where `means` are this policy's on the same observations.
    pub fn kl_from(&self, old_means: DMatrixView<'_, f32>, old_log_std: &[f32], means: DMatrixView<'_, f32>) -> f64 {
        let _ = (old_means, old_log_std, means);
        todo!()
    }

    /// The entropy in nats, the same in every state.
    pub fn entropy(&self) -> f64 {
        todo!()
    }
}

/// The Fisher information of a policy over a batch, plus damping: the Hessian of the mean KL at the policy itself.
/// Each product is one JVP and one VJP on the activations of one forward pass.
#[derive(Debug)]
pub struct Fisher<'a> {
    policy: &'a GaussianPolicy,
    observations: &'a DMatrix<f32>,
    pass: &'a mut Pass,
    damping: f64,
}

impl<'a> Fisher<'a> {
    /// `pass` is that of `policy`'s last forward pass on `observations`; `damping` is added to the diagonal.
    pub fn new(policy: &'a GaussianPolicy, observations: &'a DMatrix<f32>, pass: &'a mut Pass, damping: f64) -> Self {
        Self { policy, observations, pass, damping }
    }
}

impl LinearOperator for Fisher<'_> {
    fn dim(&self) -> usize {
        self.policy.dim()
    }

    fn apply(&mut self, x: &[f32], product: &mut [f32]) {
        let _ = (x, product, self.observations, &mut self.pass, self.damping);
        todo!()
    }
}
