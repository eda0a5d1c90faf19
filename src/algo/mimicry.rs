//! The mimicry constraint: MMD^2 between the policy and the demonstration, and its gradient, in
//! both readings.
//!
//! Owns D(theta), b and the descent on D (appendix, Eq. 13). Knows nothing of returns. Start at
//! [`Mimicry::measure`].
//!
//! The appendix does not say which samples stand for the policy. In `demo_states` they are the
//! demonstration's states with the policy's mean action there, and b comes by backpropagation;
//! Table 2's tolerances fit this reading. In `rollout` they are the agent's own state-action pairs,
//! and b comes by the score function, `b = E[grad log pi(a|s) A_f(s, a)]`, where A_f is the
//! advantage of the cost `f = 2 (mean_pi k - mean_demo k)`, taken from its mean over the rollout. D
//! compares samples that weigh alike, whose number does not change when an episode ends and another
//! begins: what follows an end is a mean step, of cost 0. Without the subtraction a far policy,
//! whose every step costs, would be told to end its episodes. Points are the state in units of the
//! demonstration ([`Standardizer`]) and the raw action, one below the other.
//!
//! Eq. (2) weighs the step t by `gamma^t`, Eq. (4) all alike. D follows Eq. (4); gamma and GAE's
//! lambda enter b as they enter g, to trade its variance for bias.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError,
    critic::{self, Critic},
    finite,
    operations::{Counter, Operations, Work},
    revision::Part,
    trust_region::{self, Surrogate},
};
use crate::{
    demo::{Bandwidth, Demonstration, Estimator, Kernel, Standardizer, mmd::Target, stack},
    nn::{GaussianPolicy, Mlp, Pass},
    quantity::{Count, constant},
    rng::{Rng, Seed, Stream},
    solver::adam::Adam,
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "mimicry",
    revision: 1,
    uses: &[&critic::PART, &trust_region::PART],
};

/// How MMD^2 to the demonstration is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Where the policy's samples come from.
    pub samples: Samples,
    /// V-statistic (Eq. 4) or U-statistic.
    pub estimator: Estimator,
    /// The Gaussian kernel's bandwidth.
    pub bandwidth: Bandwidth,
}

/// Where the policy's samples come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Samples {
    /// The demonstration's states under the policy's mean action; the gradient by backpropagation.
    DemoStates,
    /// The agent's rollout; the gradient by the score function.
    Rollout,
}

impl Default for Hyperparameters {
    fn default() -> Self {
        Self {
            samples: Samples::DemoStates,
            estimator: Estimator::V,
            bandwidth: Bandwidth::Fixed(constant(1.0)),
        }
    }
}

/// A demonstration to stay near to.
pub struct Mimicry {
    hyperparameters: Hyperparameters,
    /// Raw observations of the demonstration `[observation_dim x m]`, for the policy.
    observations: DMatrix<f64>,
    standardizer: Standardizer,
    target: Target,
    state: State,
    pass: Pass,
}

#[derive(Serialize, Deserialize)]
struct State {
    /// The value network of the cost f, for `rollout`.
    value: Mlp,
    critic: Critic,
}

/// D at the policy of this iteration, its gradient, and the means to follow it nearby.
pub struct Measured {
    /// `D(theta_k)`.
    pub mmd: f64,
    /// `b`, the gradient of D `[policy's dim]`.
    pub gradient: Vec<f32>,
    nearby: Nearby,
}

/// The course of a descent on D.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Descent {
    /// D at its start.
    pub before: f64,
    /// D at its end.
    pub after: f64,
    /// Steps of Adam taken.
    pub steps: u64,
}

/// The way to know D at other policies than the iteration's.
enum Nearby {
    /// Measure it again, at the same states, which are the policy's inputs `[observation_dim x m]`.
    DemoStates { inputs: DMatrix<f32> },
    /// To first order, by the importance-weighted advantages of the cost f `[n]`.
    Rollout { advantages: Vec<f64> },
}

impl Mimicry {
    /// The constraint to `demonstration`, for a policy with hidden layers of `hidden`.
    pub fn new(
        hyperparameters: Hyperparameters,
        demonstration: &Demonstration,
        hidden: &[usize],
        seed: Seed,
    ) -> Self {
        let widths = [&[demonstration.observations.nrows()], hidden, &[1]].concat();
        let value = Mlp::new(&widths, 0.0, &mut seed.stream(Stream::Network, 1));
        let critic = Critic::new(&value);
        let standardizer = Standardizer::new(&demonstration.observations);
        let states = standardizer.standardize(&demonstration.observations);
        let points = stack(&states, &demonstration.actions.map(|action| action as f32));
        let kernel = Kernel::new(hyperparameters.bandwidth, &points);
        Self {
            observations: demonstration.observations.clone(),
            standardizer,
            target: Target::new(points, kernel, hyperparameters.estimator),
            hyperparameters,
            state: State { value, critic },
            pass: Pass::default(),
        }
    }

    /// D and b at `agent`'s policy. For `rollout`, `surrogate` is that of the iteration's batch,
    /// `pass` holds the policy's forward pass on it, and the cost's value network learns as
    /// `critic` says for returns.
    ///
    /// # Errors
    ///
    /// D or the cost's value is no longer finite.
    pub fn measure(
        &mut self,
        agent: &Agent,
        surrogate: &Surrogate<'_>,
        pass: &mut Pass,
        critic: &critic::Hyperparameters,
        rng: &mut Rng,
    ) -> Result<Measured, AlgoError> {
        let Agent {
            policy, normalizer, ..
        } = agent;
        match self.hyperparameters.samples {
            Samples::DemoStates => {
                let inputs = normalizer.normalize_columns(&self.observations);
                let mut gradient = vec![0.0; policy.dim()];
                let mmd = self.at_states(policy, &inputs, Some(&mut gradient));
                Ok(Measured {
                    mmd: finite("D", mmd)?,
                    gradient,
                    nearby: Nearby::DemoStates { inputs },
                })
            }
            Samples::Rollout => {
                let batch = surrogate.batch();
                let mut cost = vec![0.0; batch.len()];
                let states = self.standardizer.standardize(&batch.raw_observations);
                let mmd = self
                    .target
                    .mmd_squared_witness(&stack(&states, &batch.actions), &mut cost);
                // Without this a far policy, whose every step costs, would be told to end its
                // episodes.
                let mean = cost.iter().sum::<f64>() / cost.len() as f64;
                cost.iter_mut().for_each(|f| *f = 2.0 * (*f - mean));
                let State {
                    value,
                    critic: fitted,
                } = &mut self.state;
                let estimate = critic.estimate(batch, &cost, value, &mut self.pass);
                fitted.fit(
                    value,
                    &batch.observations,
                    &estimate.returns,
                    critic.fit(),
                    rng,
                )?;
                let gradient = surrogate.score(policy, pass, &estimate.advantages);
                let nearby = Nearby::Rollout {
                    advantages: estimate.advantages,
                };
                Ok(Measured {
                    mmd: finite("D", mmd)?,
                    gradient,
                    nearby,
                })
            }
        }
    }

    /// D at `policy`, a step away from the measured policy; `ratios` (`[n]`) are its probabilities
    /// of the batch's actions relative to that policy's.
    pub fn at(&mut self, measured: &Measured, policy: &GaussianPolicy, ratios: &[f64]) -> f64 {
        match &measured.nearby {
            Nearby::DemoStates { inputs } => self.at_states(policy, inputs, None),
            Nearby::Rollout { advantages } => {
                let change: f64 = ratios
                    .iter()
                    .zip(advantages)
                    .map(|(ratio, a)| (ratio - 1.0) * a)
                    .sum();
                measured.mmd + change / ratios.len() as f64
            }
        }
    }

    /// Eq. (13) at the demonstration's states: moves `agent`'s policy down D by at most `steps`
    /// steps of Adam, until D is at most `enough`.
    ///
    /// # Errors
    ///
    /// D is no longer finite.
    pub fn descend(
        &mut self,
        agent: &mut Agent,
        enough: f64,
        steps: u64,
        learning_rate: f64,
    ) -> Result<Descent, AlgoError> {
        let Agent {
            policy, normalizer, ..
        } = agent;
        let inputs = normalizer.normalize_columns(&self.observations);
        let mut optimizer = Adam::new(policy.dim());
        let mut gradient = vec![0.0; policy.dim()];
        let mut before = None;
        for step in 0.. {
            let mmd = self.at_states(policy, &inputs, Some(&mut gradient));
            let before = *before.get_or_insert(finite("D", mmd)?);
            if mmd <= enough || step == steps {
                return Ok(Descent {
                    before,
                    after: finite("D", mmd)?,
                    steps: step,
                });
            }
            optimizer.step_parts(policy.parts_mut(), &gradient, learning_rate);
        }
        unreachable!("the loop ends at its last step")
    }

    /// MMD^2 between the demonstration and the mean action 0 at its states.
    pub fn of_doing_nothing(&self) -> f64 {
        let Self {
            observations,
            target,
            ..
        } = self;
        let action_dim = target.dim() - observations.nrows();
        target.mmd_squared_at_states(&DMatrix::zeros(action_dim, observations.ncols()))
    }

    /// Everything that the next measurement depends on.
    pub fn save(&self) -> Vec<u8> {
        super::to_bytes(&self.state)
    }

    /// Restores a state of [`save`](Mimicry::save).
    ///
    /// # Errors
    ///
    /// The bytes are of another state.
    pub fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        self.state = super::from_bytes("the mimicry constraint", state)?;
        Ok(())
    }

    /// D between the demonstration and `policy`'s mean actions at its states, which are `inputs` to
    /// the policy; and its gradient, if `gradient` is given.
    fn at_states(
        &mut self,
        policy: &GaussianPolicy,
        inputs: &DMatrix<f32>,
        gradient: Option<&mut [f32]>,
    ) -> f64 {
        let Self { target, pass, .. } = self;
        policy.forward(inputs, pass);
        let actions = pass.output().into_owned();
        match gradient {
            None => target.mmd_squared_at_states(&actions),
            Some(gradient) => {
                let mut cotangent = DMatrix::zeros(actions.nrows(), actions.ncols());
                let mmd = target.mmd_squared_at_states_gradient(&actions, &mut cotangent);
                policy.mean_gradient(inputs, pass, &cotangent, gradient);
                mmd
            }
        }
    }
}

/// The work of D and b, and of D as many times `again` as the line search measures it.
pub(super) fn operations(
    samples: Samples,
    value_epochs: Count,
    again: f64,
    counter: &Counter<'_>,
) -> Operations {
    let &Counter { n, m, policy, .. } = counter;
    let work = match samples {
        Samples::DemoStates => {
            descent_step(counter) + again * (m * policy.forward() + kernel_at_states(counter))
        }
        Samples::Rollout => {
            Work::products(2.0 * counter.point() * (n * n / 2.0 + n * counter.m))
                + n * policy.vjp()
                + counter.values().1
                + counter.value_epochs(value_epochs).1
        }
    };
    ("mimicry", work)
}

/// The work of a descent on D at the demonstration's states: D and its gradient before each
/// step and after the last.
pub(super) fn descent_operations(counter: &Counter<'_>) -> Work {
    (counter.update.recovery_steps.unwrap_or(0) + 1) as f64 * descent_step(counter)
}

fn descent_step(counter: &Counter<'_>) -> Work {
    let &Counter {
        m, action, policy, ..
    } = counter;
    let kernel_gradient = Work::products(2.0 * action * (m * m + m * m));
    m * policy.forward_and_vjp() + kernel_at_states(counter) + kernel_gradient
}

/// The work of the kernel's values among samples at the demonstration's states, and between them
/// and the demonstration's points: the states of two points once, their actions three times.
fn kernel_at_states(counter: &Counter<'_>) -> Work {
    let &Counter {
        m,
        observation,
        action,
        ..
    } = counter;
    Work::products(2.0 * (observation + 3.0 * action) * (m * m / 2.0))
}

#[cfg(test)]
mod tests;
