//! The mimicry constraint: MMD^2 between the policy and the demonstration, and its gradient, in both readings.
//!
//! Owns D(theta), b and the descent on D (appendix, Eq. 13). Knows nothing of returns. Start at [`Mimicry::measure`].
//!
//! The appendix does not say which samples stand for the policy. In `demo_states` they are the demonstration's states with
//! the policy's mean action there, and b comes by backpropagation; Table 2's tolerances fit this reading. In `rollout`
//! they are the agent's own state-action pairs, and b comes by the score function,
//! `b = E[grad log pi(a|s) A_f(s, a)]`, where A_f is the advantage of the cost `f = 2 (mean_pi k - mean_demo k)`. Points are
//! the normalised state and the raw action, one below the other; the demonstration is normalised anew each iteration.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::{
    AlgoError, Batch,
    critic::{self, Critic},
    finite, gae,
    trust_region::Surrogate,
};
use crate::{
    demo::{Bandwidth, Demonstration, Estimator, Kernel, mmd::Target},
    nn::{GaussianPolicy, Mlp, Normalizer, Pass},
    quantity::constant,
    rng::{Rng, Seed, Stream},
    solver::adam::Adam,
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
    /// Raw observations of the demonstration `[observation_dim x m]`.
    observations: DMatrix<f64>,
    /// Its actions `[action_dim x m]`.
    actions: DMatrix<f32>,
    state: State,
    pass: Pass,
}

#[derive(Serialize, Deserialize)]
struct State {
    /// Set at the first measurement, and kept: a distance whose unit changed could not be held to a tolerance.
    kernel: Option<Kernel>,
    /// The value network of the cost f, for `rollout`.
    value: Mlp,
    critic: Critic,
}

/// D at the policy of this iteration, what is needed to follow it nearby, and its gradient.
pub struct Measured {
    /// `D(theta_k)`.
    pub mmd: f64,
    /// `b`, the gradient of D `[policy's dim]`.
    pub gradient: Vec<f32>,
    nearby: Nearby,
}

/// How D is known at other policies than that of the iteration.
enum Nearby {
    /// Measured again, at the same states.
    DemoStates { states: DMatrix<f32>, target: Target },
    /// To first order, by the importance-weighted advantages of the cost f `[n]`.
    Rollout { advantages: Vec<f64> },
}

/// What the fit of the cost's value network needs; the same as for returns.
pub struct Costs {
    /// Discount gamma.
    pub discount: f64,
    /// GAE's lambda.
    pub lambda: f64,
    /// How the value network is fitted.
    pub fit: critic::Fit,
}

impl Mimicry {
    /// Nearness to `demonstration`, for a policy with hidden layers of `hidden`.
    pub fn new(
        hyperparameters: Hyperparameters,
        demonstration: &Demonstration,
        hidden: &[usize],
        seed: Seed,
    ) -> Self {
        let widths = [&[demonstration.observations.nrows()], hidden, &[1]].concat();
        let value = Mlp::new(&widths, 0.0, &mut seed.stream(Stream::Network, 1));
        let critic = Critic::new(&value);
        Self {
            hyperparameters,
            observations: demonstration.observations.clone(),
            actions: demonstration.actions.map(|action| action as f32),
            state: State { kernel: None, value, critic },
            pass: Pass::default(),
        }
    }

    /// D and b at `policy`. For `rollout`, `surrogate` is that of the iteration's batch and `pass` holds `policy`'s forward
    /// pass on it.
    ///
    /// Errors: D or the cost's value is no longer finite.
    #[expect(clippy::too_many_arguments, reason = "one iteration's parts, each used by one of the readings")]
    pub fn measure(
        &mut self,
        policy: &GaussianPolicy,
        normalizer: &Normalizer,
        batch: &Batch,
        surrogate: &Surrogate<'_>,
        pass: &mut Pass,
        costs: &Costs,
        rng: &mut Rng,
    ) -> Result<Measured, AlgoError> {
        let states = self.states(normalizer);
        let target = self.target(&states);
        match self.hyperparameters.samples {
            Samples::DemoStates => {
                let mut gradient = vec![0.0; policy.dim()];
                let mmd = demo_states(policy, &states, &target, &mut self.pass, Some(&mut gradient));
                Ok(Measured { mmd: finite("D", mmd)?, gradient, nearby: Nearby::DemoStates { states, target } })
            }
            Samples::Rollout => {
                let mut cost = vec![0.0; batch.len()];
                let mmd = target.mmd_squared_witness(&stack(&batch.observations, &batch.actions), &mut cost);
                cost.iter_mut().for_each(|f| *f *= 2.0);
                let State { value, critic, .. } = &mut self.state;
                let estimate = gae::estimate(batch, &cost, value, costs.discount, costs.lambda, &mut self.pass);
                critic.fit(value, &batch.observations, &estimate.returns, costs.fit, rng)?;
                let gradient = surrogate.score(policy, pass, &estimate.advantages);
                let nearby = Nearby::Rollout { advantages: estimate.advantages };
                Ok(Measured { mmd: finite("D", mmd)?, gradient, nearby })
            }
        }
    }

    /// D at `policy`, a step away from the policy that was measured; `ratios` (`[n]`) are its probabilities of the batch's
    /// actions relative to that policy's.
    pub fn at(&mut self, measured: &Measured, policy: &GaussianPolicy, ratios: &[f64]) -> f64 {
        match &measured.nearby {
            Nearby::DemoStates { states, target } => demo_states(policy, states, target, &mut self.pass, None),
            Nearby::Rollout { advantages } => {
                let change: f64 = ratios.iter().zip(advantages).map(|(ratio, a)| (ratio - 1.0) * a).sum();
                measured.mmd + change / ratios.len() as f64
            }
        }
    }

    /// Eq. (13) at the demonstration's states: moves `policy` down D by at most `steps` steps of Adam, until D is at most
    /// `enough`. Gives the steps taken and D at the end.
    ///
    /// Errors: D is no longer finite.
    pub fn descend(
        &mut self,
        policy: &mut GaussianPolicy,
        normalizer: &Normalizer,
        enough: f64,
        steps: u64,
        learning_rate: f64,
    ) -> Result<(u64, f64), AlgoError> {
        let states = self.states(normalizer);
        let target = self.target(&states);
        let mut optimizer = Adam::new(policy.dim());
        let mut gradient = vec![0.0; policy.dim()];
        let mut parameters = policy.parameters();
        for step in 0..steps {
            let mmd = demo_states(policy, &states, &target, &mut self.pass, Some(&mut gradient));
            if finite("D", mmd)? <= enough {
                return Ok((step, mmd));
            }
            optimizer.step(&mut parameters, &gradient, learning_rate);
            policy.set_parameters(&parameters);
        }
        let mmd = demo_states(policy, &states, &target, &mut self.pass, None);
        Ok((steps, finite("D", mmd)?))
    }

    /// Everything the next measurement depends on.
    pub fn save(&self) -> Vec<u8> {
        super::to_bytes(&self.state)
    }

    /// Puts back what [`save`](Mimicry::save) gave.
    ///
    /// Errors: the bytes are of another state.
    pub fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        self.state = super::from_bytes("the mimicry constraint", state)?;
        Ok(())
    }

    /// The demonstration's states, normalised `[observation_dim x m]`.
    fn states(&self, normalizer: &Normalizer) -> DMatrix<f32> {
        let mut states = DMatrix::zeros(self.observations.nrows(), self.observations.ncols());
        for (raw, normalized) in
            self.observations.column_iter().zip(states.as_mut_slice().chunks_exact_mut(self.observations.nrows()))
        {
            normalizer.normalize(raw.as_slice(), normalized);
        }
        states
    }

    fn target(&mut self, states: &DMatrix<f32>) -> Target {
        let points = stack(states, &self.actions);
        let bandwidth = self.hyperparameters.bandwidth;
        let kernel = *self.state.kernel.get_or_insert_with(|| Kernel::new(bandwidth, &points));
        Target::new(points, kernel, self.hyperparameters.estimator)
    }
}

/// D between the demonstration and `policy`'s mean actions at its `states`; and its gradient, where asked for.
fn demo_states(
    policy: &GaussianPolicy,
    states: &DMatrix<f32>,
    target: &Target,
    pass: &mut Pass,
    gradient: Option<&mut [f32]>,
) -> f64 {
    policy.forward(states, pass);
    let points = stack(states, &pass.output().into_owned());
    match gradient {
        None => target.mmd_squared(&points),
        Some(gradient) => {
            let mut point_gradient = DMatrix::zeros(points.nrows(), points.ncols());
            let mmd = target.mmd_squared_gradient(&points, &mut point_gradient);
            let cotangent = point_gradient.rows(states.nrows(), points.nrows() - states.nrows()).into_owned();
            policy.mean_gradient(states, pass, &cotangent, gradient);
            mmd
        }
    }
}

/// States above actions: the points between which the kernel measures.
fn stack(states: &DMatrix<f32>, actions: &DMatrix<f32>) -> DMatrix<f32> {
    let mut points = DMatrix::zeros(states.nrows() + actions.nrows(), states.ncols());
    points.rows_mut(0, states.nrows()).copy_from(states);
    points.rows_mut(states.nrows(), actions.nrows()).copy_from(actions);
    points
}
