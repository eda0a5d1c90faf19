//! The diagonal Gaussian policy: a network's mean, and a standard deviation that does not depend on
//! the state (the authors' later code has one that does; the paper is silent).

use nalgebra::{DMatrix, DMatrixView};
use serde::{Deserialize, Serialize};

use super::{Mlp, Pass};
use crate::rng::Rng;

/// ln(2 pi).
const LN_2_PI: f64 = 1.837_877_066_409_345_3;

/// `pi(a|s) = N(mean(s), diag(exp(2 log_std)))`. Its parameters are the network's, then `log_std`
/// (`[action_dim]`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GaussianPolicy {
    mean: Mlp,
    log_std: Vec<f32>,
}

impl GaussianPolicy {
    /// A policy whose mean starts near zero (output weights times 0.1) and whose standard deviation
    /// is `std`.
    pub fn new(
        observation_dim: usize,
        hidden: &[usize],
        action_dim: usize,
        std: f64,
        rng: &mut Rng,
    ) -> Self {
        let widths = [&[observation_dim], hidden, &[action_dim]].concat();
        Self {
            mean: Mlp::new(&widths, 0.1, rng),
            log_std: vec![std.ln() as f32; action_dim],
        }
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

    /// All parameters, to be changed: the network's, then `log_std`.
    pub fn parts_mut(&mut self) -> [&mut [f32]; 2] {
        [self.mean.parameters_mut(), &mut self.log_std]
    }

    /// Replaces all parameters (`[dim]`).
    pub fn set_parameters(&mut self, parameters: &[f32]) {
        let (mean, log_std) = parameters.split_at(self.mean.parameters().len());
        self.mean.parameters_mut().copy_from_slice(mean);
        self.log_std.copy_from_slice(log_std);
    }

    /// Runs normalised observations (`[observation_dim x n]`) through the mean's network; the means
    /// are in [`Pass::output`].
    pub fn forward(&self, observations: &DMatrix<f32>, pass: &mut Pass) {
        self.mean.forward(observations, pass);
    }

    /// Writes `log pi(a|s)` of each column of `actions` (`[action_dim x n]`) under `means` to
    /// `densities` (`[n]`).
    pub fn log_densities(
        &self,
        means: DMatrixView<'_, f32>,
        actions: &DMatrix<f32>,
        densities: &mut [f64],
    ) {
        assert_eq!(means.shape(), actions.shape(), "shape of the actions");
        assert_eq!(
            densities.len(),
            actions.ncols(),
            "a density for each action"
        );
        densities.fill(
            self.log_std
                .iter()
                .map(|&log_std| -f64::from(log_std) - 0.5 * LN_2_PI)
                .sum(),
        );
        for (j, inverse_std) in self.inverse_std().enumerate() {
            for (i, density) in densities.iter_mut().enumerate() {
                let z = (f64::from(actions[(j, i)]) - f64::from(means[(j, i)])) * inverse_std;
                *density -= 0.5 * z * z;
            }
        }
    }

    /// Writes the gradient (`[dim]`) of the sum over samples of `weights[i] * log pi(a_i|s_i)`, the
    /// score function's sum. `pass` is that of the last [`forward`](GaussianPolicy::forward) on
    /// `observations`.
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
        let mut cotangent = DMatrix::zeros(actions.nrows(), actions.ncols());
        let (by_mean, by_log_std) = gradient.split_at_mut(self.mean.parameters().len());
        for ((j, inverse_std), by_log_std) in self.inverse_std().enumerate().zip(by_log_std) {
            let mut sum = 0.0;
            for (i, &weight) in weights.iter().enumerate() {
                let z = (f64::from(actions[(j, i)]) - f64::from(means[(j, i)])) * inverse_std;
                cotangent[(j, i)] = (weight * z * inverse_std) as f32;
                sum += weight * (z * z - 1.0);
            }
            *by_log_std = sum as f32;
        }
        self.mean.vjp(observations, pass, &cotangent, by_mean);
    }

    /// Writes the gradient (`[dim]`, zero in `log_std`) of the sum over samples of `cotangent .
    /// mean`.
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

    /// The mean over samples of `KL(old || self)`, where `means` are this policy's on the same
    /// observations (one or more).
    pub fn kl_from(
        &self,
        old_means: DMatrixView<'_, f32>,
        old_log_std: &[f32],
        means: DMatrixView<'_, f32>,
    ) -> f64 {
        assert_eq!(means.shape(), old_means.shape(), "shape of the means");
        assert_eq!(old_log_std.len(), self.log_std.len(), "length of log_std");
        // KL = log(std / old_std) + (old_std^2 + (old_mean - mean)^2) / (2 std^2) - 1/2, summed
        // over the action's numbers.
        let samples = means.ncols();
        let mut kl = 0.0;
        for (j, (inverse_std, &old)) in self.inverse_std().zip(old_log_std).enumerate() {
            let log_ratio = f64::from(old) - f64::from(self.log_std[j]);
            let square = |i| {
                ((f64::from(old_means[(j, i)]) - f64::from(means[(j, i)])) * inverse_std).powi(2)
            };
            let mean_square = (0..samples).map(square).sum::<f64>() / samples as f64;
            kl += 0.5 * ((2.0 * log_ratio).exp_m1() + mean_square) - log_ratio;
        }
        kl
    }

    /// The entropy in nats, the same in every state.
    pub fn entropy(&self) -> f64 {
        self.log_std
            .iter()
            .map(|&log_std| f64::from(log_std) + 0.5 * (1.0 + LN_2_PI))
            .sum()
    }

    /// `1 / std` `[action_dim]`.
    pub(super) fn inverse_std(&self) -> impl Iterator<Item = f64> {
        self.log_std
            .iter()
            .map(|&log_std| (-f64::from(log_std)).exp())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::{
        super::mlp::tests::{ROUNDING, moved, numbers, plain_output, small, widened},
        *,
    };

    pub(in crate::nn) const N: usize = 40;

    /// A small policy with two different standard deviations, observations, and actions near the
    /// means.
    pub(in crate::nn) fn problem() -> (GaussianPolicy, DMatrix<f32>, DMatrix<f32>) {
        let (mean, observations) = small(N);
        let actions = DMatrix::from_vec(2, N, numbers(2 * N, 7));
        (
            GaussianPolicy {
                mean,
                log_std: vec![-0.7, 0.3],
            },
            observations,
            actions,
        )
    }

    /// By plain loops in f64, the means `[action_dim]` of each observation, and log_std.
    pub(in crate::nn) fn plain(
        policy: &GaussianPolicy,
        parameters: &[f64],
        observations: &DMatrix<f32>,
    ) -> (Vec<Vec<f64>>, Vec<f64>) {
        let (network, log_std) = parameters.split_at(parameters.len() - policy.log_std.len());
        let mean = |column: nalgebra::DVectorView<'_, f32>| {
            plain_output(policy.mean.widths(), network, column.as_slice())
        };
        (
            observations.column_iter().map(mean).collect(),
            log_std.to_vec(),
        )
    }

    fn plain_log_density(mean: &[f64], log_std: &[f64], action: &[f32]) -> f64 {
        let factor = |((m, s), &a): ((&f64, &f64), &f32)| {
            let variance = (2.0 * s).exp();
            let density = (-(f64::from(a) - m).powi(2) / (2.0 * variance)).exp();
            (density / (2.0 * std::f64::consts::PI * variance).sqrt()).ln()
        };
        mean.iter().zip(log_std).zip(action).map(factor).sum()
    }

    /// One-dimensional policies whose densities can be integrated by a sum, and a grid to do it on.
    fn integrable(mean: f32, std: f64) -> (GaussianPolicy, DMatrix<f32>) {
        let mut policy = GaussianPolicy::new(
            1,
            &[],
            1,
            std,
            &mut crate::rng::Seed(1).stream(crate::rng::Stream::Network, 0),
        );
        policy.mean.parameters_mut().copy_from_slice(&[0.0, mean]);
        (
            policy,
            DMatrix::from_fn(1, 20_001, |_, i| (i as f32 - 10_000.0) * 1e-3),
        )
    }

    fn densities_on(policy: &GaussianPolicy, actions: &DMatrix<f32>) -> Vec<f64> {
        let mut pass = Pass::default();
        policy.forward(&DMatrix::zeros(1, actions.ncols()), &mut pass);
        let mut densities = vec![0.0; actions.ncols()];
        policy.log_densities(pass.output(), actions, &mut densities);
        densities
    }

    #[test]
    fn a_new_policy_has_the_deviation_asked_for_and_a_mean_near_zero() {
        let mut rng = crate::rng::Seed(2).stream(crate::rng::Stream::Network, 0);
        let policy = GaussianPolicy::new(5, &[30, 20], 3, 0.5, &mut rng);
        assert_eq!(policy.log_std, [0.5f32.ln(); 3]);
        assert_eq!(policy.mean.widths(), [5, 30, 20, 3]);
        let (weights, biases) = policy.mean.layers().last().expect("a network has layers");
        assert!(weights.amax() <= 0.1 / 20f32.sqrt() && biases == [0.0; 3]);
        let mut other = GaussianPolicy::new(5, &[30, 20], 3, 1.0, &mut rng);
        other.set_parameters(&policy.parameters());
        assert_eq!(other, policy);
    }

    #[test]
    fn log_densities_agree_with_the_plain_formula() {
        let (policy, observations, actions) = problem();
        let (mut pass, mut densities) = (Pass::default(), vec![f64::NAN; N]);
        policy.forward(&observations, &mut pass);
        policy.log_densities(pass.output(), &actions, &mut densities);
        let (means, log_std) = plain(&policy, &widened(&policy.parameters()), &observations);
        for ((density, mean), action) in densities.iter().zip(&means).zip(actions.column_iter()) {
            assert!(
                (density - plain_log_density(mean, &log_std, action.as_slice())).abs()
                    < ROUNDING * 10.0
            );
        }
    }

    #[test]
    fn densities_integrate_to_one_and_to_the_entropy() {
        let (policy, grid) = integrable(0.4, 0.8);
        let (mut mass, mut entropy) = (0.0, 0.0);
        for density in densities_on(&policy, &grid) {
            mass += density.exp() * 1e-3;
            entropy -= density.exp() * density * 1e-3;
        }
        // The grid's points are f32 numbers: 1e-6 of their value away from where they should be.
        assert!((mass - 1.0).abs() < 1e-6, "{mass}");
        assert!((entropy - policy.entropy()).abs() < 1e-5, "{entropy}");
    }

    #[test]
    fn kl_agrees_with_its_integral_and_is_zero_from_itself() {
        let ((old, grid), (new, _)) = (integrable(0.4, 0.8), integrable(-0.3, 1.3));
        let (p, q) = (densities_on(&old, &grid), densities_on(&new, &grid));
        let integral: f64 = p
            .iter()
            .zip(&q)
            .map(|(p, q)| p.exp() * (p - q) * 1e-3)
            .sum();
        let (old_mean, new_mean) = (
            DMatrix::from_element(1, 3, 0.4f32),
            DMatrix::from_element(1, 3, -0.3f32),
        );
        let kl = new.kl_from(old_mean.as_view(), old.log_std(), new_mean.as_view());
        assert!((kl - integral).abs() < 1e-5, "{kl}, {integral}");
        assert_eq!(
            new.kl_from(new_mean.as_view(), new.log_std(), new_mean.as_view()),
            0.0
        );
    }

    #[test]
    fn score_agrees_with_finite_differences_of_log_densities() {
        let (policy, observations, actions) = problem();
        let weights = widened(&numbers(N, 8));
        let (mut pass, mut gradient) = (Pass::default(), vec![f32::NAN; policy.dim()]);
        policy.forward(&observations, &mut pass);
        policy.score(&observations, &mut pass, &actions, &weights, &mut gradient);
        let value = |parameters: &[f64]| -> f64 {
            let (means, log_std) = plain(&policy, parameters, &observations);
            let columns = means.iter().zip(actions.column_iter()).zip(&weights);
            columns
                .map(|((mean, action), w)| w * plain_log_density(mean, &log_std, action.as_slice()))
                .sum()
        };
        let parameters = widened(&policy.parameters());
        for (i, &g) in gradient.iter().enumerate() {
            let mut unit = vec![0.0; policy.dim()];
            unit[i] = 1.0;
            let slope = (value(&moved(&parameters, 1e-5, &unit))
                - value(&moved(&parameters, -1e-5, &unit)))
                / 2e-5;
            // 40 terms of order one.
            assert!(
                (f64::from(g) - slope).abs() < 20.0 * ROUNDING,
                "parameter {i}: {g}, {slope}"
            );
        }
    }

    #[test]
    fn mean_gradient_is_the_networks_and_leaves_log_std_alone() {
        let (policy, observations, cotangent) = problem();
        let (mut pass, mut gradient) = (Pass::default(), vec![f32::NAN; policy.dim()]);
        policy.forward(&observations, &mut pass);
        policy.mean_gradient(&observations, &mut pass, &cotangent, &mut gradient);
        let mut of_network = vec![f32::NAN; policy.dim() - 2];
        policy
            .mean
            .vjp(&observations, &mut pass, &cotangent, &mut of_network);
        assert_eq!(gradient, [&of_network[..], &[0.0, 0.0]].concat());
    }
}
