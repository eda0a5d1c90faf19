//! Fitting the value network to returns.

use nalgebra::DMatrix;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use super::{
    AlgoError, Batch, finite,
    gae::{self, Advantages},
    revision::Part,
};
use crate::{
    nn::{Mlp, Pass},
    quantity::{Count, Discount, NonNegative, Positive, UnitInterval, constant},
    rng::Rng,
    solver::adam::Adam,
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "critic",
    revision: 1,
    uses: &[&gae::PART],
};

/// The value network of a second-order method, and the advantages whose baseline it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Hyperparameters {
    /// Discount gamma.
    pub discount: Discount,
    /// GAE's lambda.
    pub gae_lambda: UnitInterval,
    /// Adam's step size for the value network.
    pub learning_rate: Positive,
    /// L2 penalty on the value network's parameters.
    pub l2_penalty: NonNegative,
    /// Passes of the value network over each batch.
    pub value_epochs: Count,
    /// Samples in a minibatch of the value network.
    pub minibatch: Count,
}

impl Hyperparameters {
    /// The paper's Table 1, with minibatches of `minibatch` samples.
    pub fn with_minibatch(minibatch: i64) -> Self {
        Self {
            discount: constant(0.99),
            gae_lambda: constant(0.95),
            learning_rate: constant(1e-4),
            l2_penalty: constant(1e-3),
            value_epochs: constant(10),
            minibatch: constant(minibatch),
        }
    }

    /// The advantages and returns of `rewards` (`[n]`) in `batch`, with `value` as baseline.
    pub fn estimate(
        &self,
        batch: &Batch,
        rewards: &[f64],
        value: &Mlp,
        pass: &mut Pass,
    ) -> Advantages {
        let (discount, lambda) = (self.discount.get(), self.gae_lambda.get());
        gae::estimate(batch, rewards, value, discount, lambda, pass)
    }

    /// The fit of the value network.
    pub fn fit(&self) -> Fit {
        Fit {
            epochs: self.value_epochs.size(),
            minibatch: self.minibatch.size(),
            learning_rate: self.learning_rate.get(),
            l2_penalty: self.l2_penalty.get(),
        }
    }
}

/// How a value network is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Passes over the batch.
    pub epochs: usize,
    /// Samples in a minibatch; the last one of an epoch may be smaller.
    pub minibatch: usize,
    /// Adam's step size.
    pub learning_rate: f64,
    /// Weight of the sum of squared parameters, taken as decoupled decay (Loshchilov and Hutter,
    /// 2019): in Adam's own gradient it would wipe out the weights at full step size while a sparse
    /// reward gives no other gradient.
    pub l2_penalty: f64,
}

/// Adam's moments and the buffers of a value network's regression.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Critic {
    optimizer: Adam,
    #[serde(skip)]
    buffers: Buffers,
}

#[derive(Debug, Clone, Default)]
struct Buffers {
    pass: Pass,
    observations: DMatrix<f32>,
    cotangent: DMatrix<f32>,
    gradient: Vec<f32>,
}

impl Critic {
    /// A critic for `value`, with zero moments.
    pub fn new(value: &Mlp) -> Self {
        Self {
            optimizer: Adam::new(value.parameters().len()),
            buffers: Buffers::default(),
        }
    }

    /// Fits `value` to `returns` (`[n]`) at `observations` (`[observation_dim x n]`) by minibatches
    /// of the mean squared error, with the L2 penalty.
    /// Returns the mean squared error over the last epoch, each minibatch before its step.
    ///
    /// # Errors
    ///
    /// The loss is no longer finite.
    pub fn fit(
        &mut self,
        value: &mut Mlp,
        observations: &DMatrix<f32>,
        returns: &[f64],
        fit: Fit,
        rng: &mut Rng,
    ) -> Result<f64, AlgoError> {
        let Buffers {
            pass,
            observations: minibatch,
            cotangent,
            gradient,
        } = &mut self.buffers;
        gradient.resize(value.parameters().len(), 0.0);
        let mut order: Vec<usize> = (0..returns.len()).collect();
        let mut loss = f64::NAN;
        for _ in 0..fit.epochs {
            order.shuffle(rng);
            let mut squares = 0.0;
            for chosen in order.chunks(fit.minibatch) {
                gather(observations, chosen, minibatch);
                value.forward(minibatch, pass);
                cotangent.resize_mut(1, chosen.len(), 0.0);
                for ((cotangent, &prediction), &i) in
                    cotangent.iter_mut().zip(pass.output().iter()).zip(chosen)
                {
                    let error = f64::from(prediction) - returns[i];
                    squares += error * error;
                    *cotangent = (2.0 * error / chosen.len() as f64) as f32;
                }
                value.vjp(minibatch, pass, cotangent, gradient);
                // Decay acts on the parameters and not on the gradient, for the reason at
                // `Fit::l2_penalty`.
                let keep = (1.0 - 2.0 * fit.learning_rate * fit.l2_penalty) as f32;
                value
                    .parameters_mut()
                    .iter_mut()
                    .for_each(|parameter| *parameter *= keep);
                self.optimizer
                    .step(value.parameters_mut(), gradient, fit.learning_rate);
            }
            loss = finite("the value network's loss", squares / returns.len() as f64)?;
        }
        Ok(loss)
    }
}

/// Copies the `chosen` columns of `matrix` to `columns`, in their order.
pub(crate) fn gather(matrix: &DMatrix<f32>, chosen: &[usize], columns: &mut DMatrix<f32>) {
    let rows = matrix.nrows();
    if columns.shape() != (rows, chosen.len()) {
        *columns = DMatrix::zeros(rows, chosen.len());
    }
    for (target, &source) in columns.as_mut_slice().chunks_exact_mut(rows).zip(chosen) {
        target.copy_from_slice(&matrix.as_slice()[source * rows..(source + 1) * rows]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Seed, Stream};

    const FIT: Fit = Fit {
        epochs: 200,
        minibatch: 64,
        learning_rate: 3e-3,
        l2_penalty: 0.0,
    };

    fn regression(fit: Fit) -> (f64, Mlp) {
        let observations = DMatrix::from_fn(2, 256, |row, column| {
            ((row * 256 + column) as f32 * 1.3).sin()
        });
        let returns: Vec<f64> = observations
            .column_iter()
            .map(|x| f64::from(x[0] * x[1] + x[0].abs()))
            .collect();
        let mut value = Mlp::new(&[2, 32, 1], 1.0, &mut Seed(0).stream(Stream::Network, 0));
        let mut critic = Critic::new(&value);
        let mut rng = Seed(0).stream(Stream::Update, 0);
        (
            critic
                .fit(&mut value, &observations, &returns, fit, &mut rng)
                .expect("a finite loss"),
            value,
        )
    }

    #[test]
    fn a_value_network_learns_a_curved_function_that_its_start_does_not_know() {
        let (first, _) = regression(Fit {
            epochs: 1,
            learning_rate: 1e-9,
            ..FIT
        });
        let (last, _) = regression(FIT);
        assert!(first > 0.2 && last < 0.01, "from {first} to {last}");
    }

    #[test]
    fn the_penalty_shrinks_the_parameters() {
        let norm = |penalty| {
            let (_, value) = regression(Fit {
                l2_penalty: penalty,
                ..FIT
            });
            value
                .parameters()
                .iter()
                .map(|&p| f64::from(p * p))
                .sum::<f64>()
        };
        assert!(norm(30.0) < 0.5 * norm(0.0));
    }

    #[test]
    fn a_return_that_is_not_a_number_is_an_error() {
        let mut value = Mlp::new(&[1, 4, 1], 1.0, &mut Seed(0).stream(Stream::Network, 0));
        let result = Critic::new(&value).fit(
            &mut value,
            &DMatrix::zeros(1, 2),
            &[0.0, f64::NAN],
            FIT,
            &mut Seed(0).stream(Stream::Update, 0),
        );
        assert!(matches!(result, Err(AlgoError::Diverged { .. })));
    }
}
