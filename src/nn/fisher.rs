//! The Fisher information of a policy, as an operator.

use nalgebra::DMatrix;

use super::{GaussianPolicy, Pass};
use crate::solver::LinearOperator;

/// The Fisher information of a policy over a batch, plus damping: the Hessian of the mean KL at the
/// policy itself. Each product is a Gauss-Newton product on the activations of one forward pass.
#[derive(Debug)]
pub struct Fisher<'a> {
    policy: &'a GaussianPolicy,
    observations: &'a DMatrix<f32>,
    pass: &'a mut Pass,
    damping: f64,
}

impl<'a> Fisher<'a> {
    /// `pass` is that of `policy`'s last forward pass on `observations`; `damping` is added to the
    /// diagonal.
    pub fn new(
        policy: &'a GaussianPolicy,
        observations: &'a DMatrix<f32>,
        pass: &'a mut Pass,
        damping: f64,
    ) -> Self {
        Self {
            policy,
            observations,
            pass,
            damping,
        }
    }
}

impl LinearOperator for Fisher<'_> {
    fn dim(&self) -> usize {
        self.policy.dim()
    }

    fn apply(&mut self, x: &[f32], product: &mut [f32]) {
        let network = &self.policy.mean();
        let (x_mean, x_log_std) = x.split_at(network.parameters().len());
        let (product_mean, product_log_std) = product.split_at_mut(network.parameters().len());
        // The KL's Hessian by the mean is 1 / std^2; here also the division by the number of
        // samples.
        let samples = self.observations.ncols() as f64;
        let weights: Vec<f32> = self
            .policy
            .inverse_std()
            .map(|r| (r * r / samples) as f32)
            .collect();
        network.gauss_newton(self.observations, self.pass, &weights, x_mean, product_mean);
        let damping = self.damping as f32;
        product_mean
            .iter_mut()
            .zip(x_mean)
            .for_each(|(y, x)| *y += damping * x);
        // By log_std the KL's Hessian is 2, in every state.
        product_log_std
            .iter_mut()
            .zip(x_log_std)
            .for_each(|(y, x)| *y = (2.0 + damping) * x);
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            mlp::tests::{moved, numbers, widened},
            policy::tests::{N, plain, problem},
        },
        *,
    };

    /// `x . F y`.
    fn fisher_form(fisher: &mut Fisher<'_>, x: &[f32], y: &[f32]) -> f64 {
        let mut product = vec![f32::NAN; y.len()];
        fisher.apply(y, &mut product);
        crate::solver::dot(x, &product)
    }

    #[test]
    fn fisher_is_the_hessian_of_the_mean_kl() {
        let (policy, observations, _) = problem();
        let start = widened(&policy.parameters());
        let (means, log_std) = plain(&policy, &start, &observations);
        // By the textbook's formula, since it must be smooth in f64.
        let kl_at = |parameters: &[f64]| -> f64 {
            let (new_means, new_log_std) = plain(&policy, parameters, &observations);
            let mut sum = 0.0;
            for (mean, new_mean) in means.iter().zip(&new_means) {
                for j in 0..2 {
                    let (variance, new_variance) =
                        ((2.0 * log_std[j]).exp(), (2.0 * new_log_std[j]).exp());
                    sum += 0.5 * (new_variance / variance).ln() - 0.5
                        + (variance + (mean[j] - new_mean[j]).powi(2)) / (2.0 * new_variance);
                }
            }
            sum / N as f64
        };
        let mut pass = Pass::default();
        policy.forward(&observations, &mut pass);
        let mut fisher = Fisher::new(&policy, &observations, &mut pass, 0.0);
        for index in 0..10 {
            let (x, y) = (
                numbers(policy.dim(), 20 + index),
                numbers(policy.dim(), 40 + index),
            );
            // Central differences of step h err by h^2 times fourth derivatives, and by 1e-16 / h^2
            // in rounding.
            let h = 1e-4;
            let curvature = |sign: f64| {
                let at = |h: f64| kl_at(&moved(&moved(&start, h, &x), sign * h, &y));
                at(h) + at(-h)
            };
            let hessian = (curvature(1.0) - curvature(-1.0)) / (4.0 * h * h);
            let product = fisher_form(&mut fisher, &x, &y);
            assert!(
                (product - hessian).abs() < 1e-4 * hessian.abs().max(1.0),
                "{product}, {hessian}"
            );
        }
    }

    #[test]
    fn fisher_is_symmetric_positive_and_damped() {
        let (policy, observations, _) = problem();
        let (mut pass, mut other_pass) = (Pass::default(), Pass::default());
        policy.forward(&observations, &mut pass);
        policy.forward(&observations, &mut other_pass);
        let mut fisher = Fisher::new(&policy, &observations, &mut pass, 0.0);
        let mut damped = Fisher::new(&policy, &observations, &mut other_pass, 0.25);
        assert_eq!(fisher.dim(), policy.dim());
        for index in 0..10 {
            let (x, y) = (
                numbers(policy.dim(), 60 + index),
                numbers(policy.dim(), 80 + index),
            );
            let (there, back) = (
                fisher_form(&mut fisher, &x, &y),
                fisher_form(&mut fisher, &y, &x),
            );
            assert!((there - back).abs() < 1e-4, "{there}, {back}");
            let square = fisher_form(&mut fisher, &x, &x);
            assert!(square > 0.0);
            let expected = square + 0.25 * crate::solver::dot(&x, &x);
            assert!((fisher_form(&mut damped, &x, &x) / expected - 1.0).abs() < 1e-5);
        }
    }
}
