//! The discriminator of POfD and GAIL: it tells the agent's state-action pairs from the
//! demonstration's.
//!
//! Owns the classifier and its one update an iteration. Knows nothing of rewards' weights. Start at
//! [`Discriminator`].
//!
//! `D(s, a)` is near 1 on the agent's pairs and near 0 on the demonstration's (Kang et al., 2018),
//! so that `-log D` rewards what looks like the demonstration. The network's output is D's logit.
//! It sees normalised observations, the demonstration's normalised anew each iteration, and has
//! neither the entropy bonus of some codes nor Table 1's L2 penalty.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::{AlgoError, Batch, finite, revision::Part};
use crate::{
    demo::{Demonstration, stack},
    nn::{Mlp, Normalizer, Pass},
    quantity::{Count, Positive, constant},
    rng::{Seed, Stream},
    solver::adam::Adam,
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "discriminator",
    revision: 1,
    uses: &[],
};

/// How the discriminator learns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Adam's step size.
    pub learning_rate: Positive,
    /// Steps of Adam an iteration, each on the whole batch and the whole demonstration.
    pub updates: Count,
}

impl Default for Hyperparameters {
    fn default() -> Self {
        Self {
            learning_rate: constant(1e-4),
            updates: constant(1),
        }
    }
}

/// A classifier of state-action pairs.
pub struct Discriminator {
    hyperparameters: Hyperparameters,
    observations: DMatrix<f64>,
    actions: DMatrix<f32>,
    state: State,
    pass: Pass,
}

#[derive(Serialize, Deserialize)]
struct State {
    network: Mlp,
    optimizer: Adam,
}

impl Discriminator {
    /// A classifier against `demonstration`, with hidden layers of `hidden`.
    pub fn new(
        hyperparameters: Hyperparameters,
        demonstration: &Demonstration,
        hidden: &[usize],
        seed: Seed,
    ) -> Self {
        let inputs = demonstration.observations.nrows() + demonstration.actions.nrows();
        let widths = [&[inputs], hidden, &[1]].concat();
        let network = Mlp::new(&widths, 0.1, &mut seed.stream(Stream::Network, 2));
        let optimizer = Adam::new(network.parameters().len());
        Self {
            hyperparameters,
            observations: demonstration.observations.clone(),
            actions: demonstration.actions.map(|action| action as f32),
            state: State { network, optimizer },
            pass: Pass::default(),
        }
    }

    /// Takes its steps on `batch` against the demonstration.
    /// Returns the loss before the last step: `-mean log D` on the agent's pairs, minus
    /// `mean log(1 - D)` on the demonstration's.
    ///
    /// # Errors
    ///
    /// The loss is no longer finite.
    pub fn update(&mut self, batch: &Batch, normalizer: &Normalizer) -> Result<f64, AlgoError> {
        let agent = stack(&batch.observations, &batch.actions);
        let demonstration = stack(
            &normalizer.normalize_columns(&self.observations),
            &self.actions,
        );
        let (n, m) = (agent.ncols(), demonstration.ncols());
        let mut inputs = DMatrix::zeros(agent.nrows(), n + m);
        inputs.columns_mut(0, n).copy_from(&agent);
        inputs.columns_mut(n, m).copy_from(&demonstration);

        let State { network, optimizer } = &mut self.state;
        let mut gradient = vec![0.0; network.parameters().len()];
        let mut loss = 0.0;
        for _ in 0..self.hyperparameters.updates.get() {
            network.forward(&inputs, &mut self.pass);
            loss = 0.0;
            let cotangent = DMatrix::from_fn(1, n + m, |_, i| {
                let logit = f64::from(self.pass.output()[(0, i)]);
                // log D = -softplus(-logit), log(1 - D) = -softplus(logit).
                let (term, slope) = if i < n {
                    (softplus(-logit), sigmoid(logit) - 1.0)
                } else {
                    (softplus(logit), sigmoid(logit))
                };
                let weight = 1.0 / if i < n { n } else { m } as f64;
                loss += weight * term;
                (weight * slope) as f32
            });
            finite("the discriminator's loss", loss)?;
            network.vjp(&inputs, &mut self.pass, &cotangent, &mut gradient);
            optimizer.step(
                network.parameters_mut(),
                &gradient,
                self.hyperparameters.learning_rate.get(),
            );
        }
        Ok(loss)
    }

    /// `-log D(s, a)` of each of the batch's pairs `[n]`, 0 or above.
    pub fn imitation_rewards(&mut self, batch: &Batch) -> Vec<f64> {
        self.state
            .network
            .forward(&stack(&batch.observations, &batch.actions), &mut self.pass);
        self.pass
            .output()
            .iter()
            .map(|&logit| softplus(-f64::from(logit)))
            .collect()
    }

    /// Everything that the next update depends on.
    pub fn save(&self) -> Vec<u8> {
        super::to_bytes(&self.state)
    }

    /// Restores a state of [`save`](Discriminator::save).
    ///
    /// # Errors
    ///
    /// The bytes are of another state.
    pub fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        self.state = super::from_bytes("the discriminator", state)?;
        Ok(())
    }
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// `log(1 + e^x)`, without overflow.
fn softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        algo::{
            adversarial::Adversarial,
            one_step,
            ppo::{self, Ppo},
            reference,
        },
        env::EnvId,
    };

    #[test]
    fn softplus_and_sigmoid_hold_at_large_arguments() {
        assert_eq!(softplus(800.0), 800.0);
        assert_eq!(softplus(-800.0), 0.0);
        assert!((softplus(0.3) - (1.0 + 0.3f64.exp()).ln()).abs() < 1e-15);
        assert_eq!((sigmoid(-800.0), sigmoid(800.0)), (0.0, 1.0));
    }

    #[test]
    fn its_loss_a_step_and_the_new_rewards_are_numpys() {
        let reference = reference::reference();
        let expected = &reference.discriminator;
        let demonstration = Demonstration {
            observations: reference::columns(&expected.demonstration_observations),
            actions: reference::columns(&expected.demonstration_actions),
            ..one_step::demonstration(7, |s| s)
        };
        let hyperparameters = Hyperparameters {
            learning_rate: constant(1e-2),
            updates: constant(1),
        };
        let mut discriminator =
            Discriminator::new(hyperparameters, &demonstration, &reference::HIDDEN, Seed(0));
        discriminator
            .state
            .network
            .parameters_mut()
            .copy_from_slice(&expected.network);
        let (batch, agent) = (reference.batch(), reference.agent(&reference.policy));
        let loss = discriminator
            .update(&batch, &agent.normalizer)
            .expect("finite");
        reference::assert_near(&[loss], &[expected.loss], reference::ROUNDING);
        reference::assert_near(
            discriminator.state.network.parameters(),
            &expected.after,
            reference::ROUNDING,
        );
        let inner = Box::new(Ppo::new(
            ppo::Hyperparameters::for_env(EnvId::Hopper),
            agent,
        ));
        let mut pofd = Adversarial {
            discriminator,
            task: 1.0,
            imitation: 0.1,
            inner,
        };
        reference::assert_near(
            &pofd.rewards(&batch),
            &expected.rewards,
            reference::ROUNDING,
        );
    }

    #[test]
    fn it_tells_the_agent_from_the_demonstration_and_rewards_the_latter() {
        let agent = one_step::agent(0.3);
        let demonstration = one_step::demonstration(200, |s| s + 1.0);
        let hyperparameters = Hyperparameters {
            learning_rate: constant(1e-2),
            updates: constant(1),
        };
        let mut discriminator = Discriminator::new(hyperparameters, &demonstration, &[16], Seed(0));
        let batch = one_step::batch(
            &agent,
            400,
            |_, _| 0.0,
            &mut Seed(0).stream(Stream::Action, 0),
        );
        let first = discriminator
            .update(&batch, &agent.normalizer)
            .expect("finite");
        discriminator.hyperparameters.updates = constant(100);
        let last = discriminator
            .update(&batch, &agent.normalizer)
            .expect("finite");
        assert!(first < 1.4 && last < 0.5 * first, "{first}, {last}");

        let mut alike = batch.clone();
        alike.actions = alike.observations.map(|s| s + 1.0);
        let mean = |rewards: Vec<f64>| rewards.iter().sum::<f64>() / rewards.len() as f64;
        let (own, like) = (
            mean(discriminator.imitation_rewards(&batch)),
            mean(discriminator.imitation_rewards(&alike)),
        );
        assert!(
            like > 5.0 * own,
            "{like} for the demonstration's actions, {own} for the agent's"
        );
    }
}
