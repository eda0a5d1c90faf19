//! The diagonal Gaussian policy: a network's mean, and a standard deviation that does not depend on the state.

use nalgebra::{DMatrix, DMatrixView};
use serde::{Deserialize, Serialize};

use super::{Mlp, Pass};
use crate::{rng::Rng, solver::LinearOperator};

/// ln(2 pi).
const LN_2_PI: f64 = 1.837_877_066_409_345_3;

/// `pi(a|s) = N(mean(s), diag(exp(2 log_std)))`. Its parameters are the network's, then `log_std` (`[action_dim]`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GaussianPolicy {
    mean: Mlp,
    log_std: Vec<f32>,
}

impl GaussianPolicy {
    /// A policy whose mean starts near zero (output weights times 0.1) and whose standard deviation is `std`.
    pub fn new(observation_dim: usize, hidden: &[usize], action_dim: usize, std: f64, rng: &mut Rng) -> Self {
        let widths = [&[observation_dim], hidden, &[action_dim]].concat();
        Self { mean: Mlp::new(&widths, 0.1, rng), log_std: vec![std.ln() as f32; action_dim] }
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
        assert_eq!(means.shape(), actions.shape(), "shape of the actions");
        assert_eq!(densities.len(), actions.ncols(), "a density for each action");
        let inverse_std = self.inverse_std();
        let constant: f64 = self.log_std.iter().map(|&log_std| -f64::from(log_std) - 0.5 * LN_2_PI).sum();
        for ((density, mean), action) in densities.iter_mut().zip(means.column_iter()).zip(actions.column_iter()) {
            let squares = action.iter().zip(mean.iter()).zip(&inverse_std);
            let square: f64 = squares.map(|((&a, &m), r)| ((f64::from(a) - f64::from(m)) * r).powi(2)).sum();
            *density = constant - 0.5 * square;
        }
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
        let means = pass.output();
        assert_eq!(means.shape(), actions.shape(), "shape of the actions");
        assert_eq!(weights.len(), actions.ncols(), "a weight for each action");
        // By the mean: w (a - m) / std^2. By log_std: w ((a - m)^2 / std^2 - 1).
        let inverse_std = self.inverse_std();
        let mut by_log_std = vec![0.0f64; self.log_std.len()];
        let mut cotangent = DMatrix::zeros(actions.nrows(), actions.ncols());
        for (i, &weight) in weights.iter().enumerate() {
            for (j, r) in inverse_std.iter().enumerate() {
                let z = (f64::from(actions[(j, i)]) - f64::from(means[(j, i)])) * r;
                cotangent[(j, i)] = (weight * z * r) as f32;
                by_log_std[j] += weight * (z * z - 1.0);
            }
        }
        let (by_mean, rest) = gradient.split_at_mut(self.mean.parameters().len());
        self.mean.vjp(observations, pass, &cotangent, by_mean);
        rest.iter_mut().zip(by_log_std).for_each(|(g, sum)| *g = sum as f32);
    }

    /// Writes the gradient (`[dim]`, zero in `log_std`) of the sum over samples of `cotangent . mean`.
    pub fn mean_gradient(
        &self,
        observations: &DMatrix<f32>,
        pass: &mut Pass,
        cotangent: &DMatrix<f32>,
        gradient: &mut [f32],
    ) {
        let (by_mean, by_log_std) = gradient.split_at_mut(self.mean.parameters().len());
        self.mean.vjp(observations, pass, cotangent, by_mean);
        by_log_std.fill(0.0);
    }

    /// The mean over samples of `KL(old || self)`, where `means` are this policy's on the same observations.
    pub fn kl_from(&self, old_means: DMatrixView<'_, f32>, old_log_std: &[f32], means: DMatrixView<'_, f32>) -> f64 {
        assert_eq!(means.shape(), old_means.shape(), "shape of the means");
        assert_eq!(old_log_std.len(), self.log_std.len(), "length of log_std");
        // KL = log(std / old_std) + (old_std^2 + (old_mean - mean)^2) / (2 std^2) - 1/2, summed over the action's numbers.
        let constant: f64 = self
            .log_std
            .iter()
            .zip(old_log_std)
            .map(|(&new, &old)| {
                let log_ratio = f64::from(old) - f64::from(new);
                0.5 * (2.0 * log_ratio).exp_m1() - log_ratio
            })
            .sum();
        let inverse_std = self.inverse_std();
        let mut sum = 0.0;
        for (mean, old_mean) in means.column_iter().zip(old_means.column_iter()) {
            let squares = mean.iter().zip(old_mean.iter()).zip(&inverse_std);
            sum += squares.map(|((&m, &o), r)| ((f64::from(o) - f64::from(m)) * r).powi(2)).sum::<f64>();
        }
        constant + 0.5 * sum / means.ncols() as f64
    }

    /// The entropy in nats, the same in every state.
    pub fn entropy(&self) -> f64 {
        self.log_std.iter().map(|&log_std| f64::from(log_std) + 0.5 * (1.0 + LN_2_PI)).sum()
    }

    /// `1 / std` `[action_dim]`.
    fn inverse_std(&self) -> Vec<f64> {
        self.log_std.iter().map(|&log_std| (-f64::from(log_std)).exp()).collect()
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
    /// Derivatives by the mean `[action_dim x n]`.
    by_mean: DMatrix<f32>,
}

impl<'a> Fisher<'a> {
    /// `pass` is that of `policy`'s last forward pass on `observations`; `damping` is added to the diagonal.
    pub fn new(policy: &'a GaussianPolicy, observations: &'a DMatrix<f32>, pass: &'a mut Pass, damping: f64) -> Self {
        let by_mean = DMatrix::zeros(policy.log_std.len(), observations.ncols());
        Self { policy, observations, pass, damping, by_mean }
    }
}

impl LinearOperator for Fisher<'_> {
    fn dim(&self) -> usize {
        self.policy.dim()
    }

    fn apply(&mut self, x: &[f32], product: &mut [f32]) {
        let network = &self.policy.mean;
        let (x_mean, x_log_std) = x.split_at(network.parameters().len());
        let (product_mean, product_log_std) = product.split_at_mut(network.parameters().len());
        network.jvp(self.observations, self.pass, x_mean, &mut self.by_mean);
        // The KL's Hessian by the mean is 1 / std^2; here also the division by the number of samples.
        let samples = self.by_mean.ncols() as f64;
        let weights: Vec<f32> = self.policy.inverse_std().iter().map(|r| (r * r / samples) as f32).collect();
        for column in self.by_mean.as_mut_slice().chunks_exact_mut(weights.len()) {
            column.iter_mut().zip(&weights).for_each(|(x, w)| *x *= w);
        }
        network.vjp(self.observations, self.pass, &self.by_mean, product_mean);
        let damping = self.damping as f32;
        product_mean.iter_mut().zip(x_mean).for_each(|(y, x)| *y += damping * x);
        // By log_std the KL's Hessian is 2, in every state.
        product_log_std.iter_mut().zip(x_log_std).for_each(|(y, x)| *y = (2.0 + damping) * x);
    }
}
